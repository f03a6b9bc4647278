//! Hydrodynamic derivatives: symbols, units, prime system.

use std::fmt;

/// A force or moment of the hull.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Force {
    /// Surge force `X` \[N\].
    X,
    /// Sway force `Y` \[N\].
    Y,
    /// Yaw moment `N` \[N m\].
    N,
}

impl Force {
    /// All, in the order of `u`, `v`, `r`.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::N];

    pub fn letter(self) -> &'static str {
        ["X", "Y", "N"][self as usize]
    }
}

/// Letters of the velocities.
pub(super) const VELOCITY: [&str; 3] = ["u", "v", "r"];

/// The variable of a derivative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variable {
    /// The acceleration of `u`, `v` or `r` (0, 1, 2).
    Acceleration(usize),
    /// A product of powers of `u`, `v`, `r` and of the magnitudes of some of them.
    Product {
        /// Powers of `u`, `v`, `r`.
        powers: [u8; 3],
        /// Whether the magnitude of `u`, `v`, `r` is a factor.
        magnitudes: [bool; 3],
    },
}

impl Variable {
    /// A velocity, or the product of several.
    pub fn product(velocities: &[usize]) -> Self {
        let mut powers = [0; 3];
        for &j in velocities {
            powers[j] += 1;
        }
        Self::Product { powers, magnitudes: [false; 3] }
    }

    /// `|nu_i| nu_j`.
    pub fn signed(i: usize, j: usize) -> Self {
        let (mut powers, mut magnitudes) = ([0; 3], [false; 3]);
        powers[j] = 1;
        magnitudes[i] = true;
        Self::Product { powers, magnitudes }
    }

    /// Number of factors of each velocity; an acceleration counts as one of its velocity.
    fn counts(self) -> [i32; 3] {
        match self {
            Self::Acceleration(i) => std::array::from_fn(|j| i32::from(i == j)),
            Self::Product { powers, magnitudes } => {
                std::array::from_fn(|j| i32::from(powers[j]) + i32::from(magnitudes[j]))
            }
        }
    }

    /// Whether the sign of the variable changes with those of `v` and `r`, as from the frame forward, starboard, down to
    /// the frame forward, port, up.
    fn is_odd(self) -> bool {
        match self {
            Self::Acceleration(i) => i > 0,
            Self::Product { powers, .. } => (powers[1] + powers[2]) % 2 == 1,
        }
    }

    /// Its value at velocities and accelerations.
    pub fn value(self, nu: [f64; 3], nu_dot: [f64; 3]) -> f64 {
        match self {
            Self::Acceleration(i) => nu_dot[i],
            Self::Product { powers, magnitudes } => (0..3)
                .map(|j| nu[j].powi(i32::from(powers[j])) * if magnitudes[j] { nu[j].abs() } else { 1.0 })
                .product(),
        }
    }

    /// Its derivative with respect to `u`, `v` or `r` (0, 1, 2) on a straight course, at `nu = (speed, 0, 0)` with a
    /// positive speed. That of `|v|` at 0 is taken as 0.
    pub fn slope(self, by: usize, speed: f64) -> f64 {
        let Self::Product { powers, .. } = self else { return 0.0 };
        let counts = self.counts();
        let rest_is_one = (1..3).all(|j| counts[j] == i32::from(j == by));
        if !rest_is_one || (by > 0 && powers[by] == 0) {
            return 0.0;
        }
        match by {
            0 if counts[0] == 0 => 0.0,
            0 => f64::from(counts[0]) * speed.powi(counts[0] - 1),
            _ => speed.powi(counts[0]),
        }
    }

    /// The factors as text, magnitudes first: `|u| v`; `u v`; `0` without factors, as in the subscript of a constant force.
    fn factors(self, magnitude: impl Fn(&str) -> String, rate: impl Fn(&str) -> String) -> String {
        match self {
            Self::Acceleration(i) => rate(VELOCITY[i]),
            Self::Product { powers, magnitudes } => {
                let first = (0..3).filter(|&j| magnitudes[j]).map(|j| magnitude(VELOCITY[j]));
                let rest = (0..3).map(|j| VELOCITY[j].repeat(usize::from(powers[j])));
                let text: String = first.chain(rest).collect();
                if text.is_empty() { String::from("0") } else { text }
            }
        }
    }
}

/// A hydrodynamic derivative: a force of the hull per variable, as SNAME defines it. Resistance is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivative {
    pub force: Force,
    pub variable: Variable,
    /// Its value in SI units.
    pub value: f64,
    /// Standard deviation of its estimate, if known.
    pub deviation: Option<f64>,
}

impl Derivative {
    /// A derivative without a standard deviation.
    pub fn new(force: Force, variable: Variable, value: f64) -> Self {
        Self { force, variable, value, deviation: None }
    }

    /// `X_udot`, `Y_|u|v`, `N_ur`.
    pub fn symbol(&self) -> String {
        let factors = self.variable.factors(|name| format!("|{name}|"), |name| format!("{name}dot"));
        format!("{}_{factors}", self.force.letter())
    }

    /// `X_{\dot{u}}`, `Y_{\lvert u\rvert v}`.
    pub fn latex(&self) -> String {
        let magnitude = |name: &str| format!("\\lvert {name}\\rvert ");
        let factors = self.variable.factors(magnitude, |name| format!("\\dot{{{name}}}"));
        format!("{}_{{{factors}}}", self.force.letter())
    }

    /// Powers of kilogram, metre and second of its unit.
    pub fn unit(&self) -> [i32; 3] {
        let [u, v, r] = self.variable.counts();
        let rate = i32::from(matches!(self.variable, Variable::Acceleration(_)));
        let moment = i32::from(self.force == Force::N);
        [1, 1 + moment - u - v, -2 + u + v + r + rate]
    }

    /// Powers of length and speed by which the prime system (SNAME 1950) divides it, together with `rho/2`:
    ///
    /// ```text
    /// a' = a / (rho/2 L^p U^q)
    /// ```
    ///
    /// Forces are per `rho/2 L^2 U^2`, moments per `rho/2 L^3 U^2`, velocities per `U`, the yaw rate per `U/L`,
    /// accelerations per `U^2/L` and `U^2/L^2`.
    pub fn prime_powers(&self) -> [i32; 2] {
        let [u, v, r] = self.variable.counts();
        let rate = i32::from(matches!(self.variable, Variable::Acceleration(_)));
        let moment = i32::from(self.force == Force::N);
        [2 + moment + r + rate, 2 - u - v - r - rate]
    }

    /// The value in the frame forward, port, up: `v`, `r`, `Y` and `N` have the other sign there.
    pub fn forward_port_up(&self) -> f64 {
        let odd = self.variable.is_odd() != (self.force != Force::X);
        if odd { -self.value } else { self.value }
    }
}

/// `kg m^2/s` from powers of kilogram, metre and second.
pub(super) fn unit_text(powers: [i32; 3]) -> String {
    struct Power(&'static str, i32);
    impl fmt::Display for Power {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            if self.1 == 1 { f.write_str(self.0) } else { write!(f, "{}^{}", self.0, self.1) }
        }
    }
    let named = || ["kg", "m", "s"].into_iter().zip(powers);
    let above: Vec<String> =
        named().filter(|(_, n)| *n > 0).map(|(name, n)| Power(name, n).to_string()).collect();
    let below = named().filter(|(_, n)| *n < 0).map(|(name, n)| format!("/{}", Power(name, -n)));
    let above = if above.is_empty() { String::from("1") } else { above.join(" ") };
    above + &below.collect::<String>()
}
