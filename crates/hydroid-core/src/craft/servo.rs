//! Positions of actuators.

use alloc::vec::Vec;

use crate::vessel::{Number, Real};

/// An order as a weighted sum of commands, within limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Command, its neutral value, and gain: the order is the sum of `gain (c - neutral)`.
    pub terms: Vec<(usize, f64, f64)>,
    /// Lowest and highest order.
    pub limits: [f64; 2],
}

impl Order {
    /// The order of a row of commands; NaN if a command is NaN.
    #[inline]
    pub fn value(&self, commands: &[f64]) -> f64 {
        let [low, high] = self.limits;
        self.terms
            .iter()
            .map(|&(c, neutral, gain)| gain * (commands[c] - neutral))
            .sum::<f64>()
            .clamp(low, high)
    }
}

/// The position of an actuator, which follows its order with a first-order lag and a limit of the rate:
///
/// ```text
/// da/dt = sat((order - a) / lag, rate)
/// ```
///
/// The step of a held order is exact: the position moves at the limit of the rate while `|order - a| > rate lag`, and the
/// rest decays exponentially. A lag of zero leaves the limit of the rate alone; without both, the position is the order.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo<T = f64> {
    /// The order.
    pub order: Order,
    /// Time constant \[s\].
    pub lag: T,
    /// Largest rate, per second; none for no limit.
    pub rate: Option<T>,
}

impl<T: Real> Servo<T> {
    /// Factor by which the distance from the order decays in `h` seconds without a limit of the rate.
    #[inline]
    pub fn decay(&self, h: f64) -> T {
        if self.lag.value() > 0.0 { (-(T::constant(h) / self.lag)).exp() } else { T::constant(0.0) }
    }

    /// The position after `h` seconds from `position`; `decay` is [`decay`](Self::decay) for this time.
    #[inline]
    pub fn step(&self, position: T, order: f64, h: f64, decay: T) -> T {
        let order = T::constant(order);
        let error = order - position;
        let size = Number::abs(error.value());
        let Some(rate) = self.rate else { return order - error * decay };
        let knee = if self.lag.value() > 0.0 { rate * self.lag } else { T::constant(0.0) };
        if size <= knee.value() {
            return order - error * decay;
        }
        let side = T::constant(if error.value() > 0.0 { 1.0 } else { -1.0 });
        // Time at the limit of the rate.
        let ramp = (error * side - knee) / rate;
        if ramp.value() >= h {
            return position + side * rate * h;
        }
        if self.lag.value() > 0.0 {
            order - side * knee * (-((T::constant(h) - ramp) / self.lag)).exp()
        } else {
            order
        }
    }

    /// Whether the position is always the order: there is no lag and no limit of the rate.
    #[inline]
    pub fn follows_at_once(&self) -> bool {
        self.rate.is_none() && self.lag.value() == 0.0
    }
}
