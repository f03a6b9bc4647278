//! Drift by current and wind.

/// Weight of the drift that was measured at rest, in seconds of data.
const AT_REST_S: f64 = 10.0;
/// Weight of the assumption that there is no sideslip, in (rad/s)² seconds of data.
const NO_SIDESLIP: f64 = 0.01;

/// Estimate of the drift from the velocity to starboard.
///
/// A boat makes little speed to starboard through the water: what it has over ground is the component of the drift, and
/// the sideslip of a turn. The equation `v = -sin(psi) c_north + cos(psi) c_east + k r` is solved for the drift `c` and the
/// sideslip `k` by least squares with exponential forgetting. One turn makes both components observable.
#[derive(Clone, Debug, Default)]
pub(super) struct Drift {
    /// Normal equations: upper triangle and right-hand side.
    matrix: [f64; 6],
    right: [f64; 3],
    at_rest: [f64; 2],
    solution: [f64; 3],
}

impl Drift {
    /// Starts with the velocity of the resting boat.
    pub(super) fn new(at_rest: [f64; 2]) -> Self {
        Self { at_rest, solution: [at_rest[0], at_rest[1], 0.0], ..Self::default() }
    }

    /// Adds a sample; `memory_s` is the time constant of the forgetting.
    pub(super) fn add(&mut self, dt: f64, psi: f64, v: f64, r: f64, memory_s: f64) {
        let keep = (-dt / memory_s).exp();
        let (sin, cos) = psi.sin_cos();
        let row = [-sin, cos, r];
        let products = [
            row[0] * row[0],
            row[0] * row[1],
            row[0] * row[2],
            row[1] * row[1],
            row[1] * row[2],
            row[2] * row[2],
        ];
        for (entry, product) in self.matrix.iter_mut().zip(products) {
            *entry = keep * *entry + dt * product;
        }
        for (entry, x) in self.right.iter_mut().zip(row) {
            *entry = keep * *entry + dt * x * v;
        }
        let [mut a, b, c, mut d, e, mut f] = self.matrix;
        let [mut x, mut y, z] = self.right;
        a += AT_REST_S;
        d += AT_REST_S;
        f += NO_SIDESLIP;
        x += AT_REST_S * self.at_rest[0];
        y += AT_REST_S * self.at_rest[1];
        // Cramer's rule: the matrix is positive definite.
        let det = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d);
        if det > 0.0 {
            let north = x * (d * f - e * e) - b * (y * f - e * z) + c * (y * e - d * z);
            let east = a * (y * f - e * z) - x * (b * f - c * e) + c * (b * z - c * y);
            let slip = a * (d * z - e * y) - b * (b * z - c * y) + x * (b * e - c * d);
            self.solution = [north / det, east / det, slip / det];
        }
    }

    /// Drift, north and east \[m/s\].
    pub(super) fn velocity(&self) -> [f64; 2] {
        [self.solution[0], self.solution[1]]
    }

    /// Speed of the drift \[m/s\].
    pub(super) fn speed(&self) -> f64 {
        self.solution[0].hypot(self.solution[1])
    }

    /// Velocity to starboard per yaw rate \[m\].
    pub(super) fn sideslip(&self) -> f64 {
        self.solution[2]
    }

    /// Component of the drift along a heading \[m/s\].
    pub(super) fn along(&self, psi: f64) -> f64 {
        let (sin, cos) = psi.sin_cos();
        self.solution[0] * cos + self.solution[1] * sin
    }
}
