//! Whether a pose moves as the velocities say.

use core::f64::consts::TAU;

use num_traits::Float;

use crate::memory::Memory;

/// A pose that is integrated from the velocities, and follows the measured one slowly:
///
/// ```text
/// d eta/dt = J(psi) nu + (eta_measured - eta) / T
/// ```
///
/// with north, east, heading `eta`, body velocities over ground `nu` and the time constant `T`. While measurements agree, it
/// stays beside the measured pose: a velocity that is off by `c` is a distance of `c T` (a complementary filter: Mahony, Hamel
/// and Pflimlin, IEEE Trans. Automatic Control 53 (2008) 1203). A position or a heading is *contradicted* where a quarter of
/// the speed `U` of the task goes in a wrong direction: a position that is farther away than `U T / 4`, a heading than
/// `asin(1/4)`, 14.5 degrees. It does not correct then, so that a sensor that jumps and stays remains contradicted. A position
/// that stands still while the vessel moves at `U` is found after `0.29 T`, a heading in a turn of 15 deg/s after a second.
///
/// A frozen compass, a frozen receiver, axes or signs of another convention and a wrong unit are contradictions as soon as the
/// vessel moves. It is not known which of the two is wrong, pose or velocities. Sensors that are wrong together, and a heading
/// that is off from the start beside velocities that were computed with it, do not contradict each other.
#[derive(Clone, Debug, PartialEq)]
pub struct DeadReckoning {
    time_s: f64,
    gate: [f64; 2],
    eta: [f64; 3],
    /// Distances of the measured position \[m\] and heading \[rad\], where they are contradicted; 0 otherwise.
    off: [f64; 2],
    /// Time for which one of them has been contradicted without a measurement that agrees \[s\].
    since_s: [f64; 2],
}

/// Part of the speed that may go in a wrong direction, and the angle with this sine.
const WRONG: f64 = 0.25;
const WRONG_RAD: f64 = 0.252_680_255_142_078_64;

impl DeadReckoning {
    /// Before the first pose, for a speed of the task \[m/s\] and a time constant \[s\].
    pub const fn new(speed_m_s: f64, time_s: f64) -> Self {
        Self {
            time_s,
            gate: [WRONG * speed_m_s * time_s, WRONG_RAD],
            eta: [f64::NAN; 3],
            off: [0.0; 2],
            since_s: [0.0; 2],
        }
    }

    /// A new run begins: the next pose is believed.
    pub const fn reset(&mut self) {
        (self.eta, self.off, self.since_s) = ([f64::NAN; 3], [0.0; 2], [0.0; 2]);
    }

    /// Distances of the measured position \[m\] and heading \[rad\] from those that the velocities say, where they are
    /// contradicted; 0 otherwise.
    pub const fn off(&self) -> [f64; 2] {
        self.off
    }

    /// Whether position or heading have been contradicted for longer than the time constant. The integrated pose is no longer
    /// better than the measured one, and an operator must decide.
    pub fn is_unsettled(&self) -> bool {
        self.since_s.iter().any(|since_s| *since_s > self.time_s)
    }

    /// Time passes \[s\] with body velocities `[u, v, r]`, to a measured pose, whose missing parts are NaN. What is contradicted
    /// becomes NaN.
    pub fn take(&mut self, elapsed_s: f64, [u, v, r]: [f64; 3], pose: &mut [f64; 3]) {
        let turned = r * elapsed_s;
        let (sin, cos) = Float::sin_cos(self.eta[2] + 0.5 * turned);
        let motion = [elapsed_s * (u * cos - v * sin), elapsed_s * (u * sin + v * cos), turned];
        self.eta = core::array::from_fn(|i| self.eta[i] + motion[i]);
        let weight = Float::min(elapsed_s / self.time_s, 1.0);
        for (part, range) in [0..2, 2..3].into_iter().enumerate() {
            if self.since_s[part] > 0.0 {
                self.since_s[part] += elapsed_s;
            }
            if !pose[range.clone()].iter().all(|x| x.is_finite()) {
                continue;
            }
            if !self.eta[range.clone()].iter().all(|x| x.is_finite()) {
                self.eta[range.clone()].copy_from_slice(&pose[range]);
                (self.off[part], self.since_s[part]) = (0.0, 0.0);
                continue;
            }
            let mut apart: [f64; 3] = core::array::from_fn(|i| pose[i] - self.eta[i]);
            apart[2] -= TAU * Float::round(apart[2] / TAU);
            let square: f64 = apart[range.clone()].iter().map(|x| x * x).sum();
            let distance = Float::sqrt(square);
            if distance <= self.gate[part] {
                (self.off[part], self.since_s[part]) = (0.0, 0.0);
                range.for_each(|i| self.eta[i] += weight * apart[i]);
            } else {
                self.off[part] = distance;
                self.since_s[part] = Float::max(self.since_s[part], f64::MIN_POSITIVE);
                pose[range].fill(f64::NAN);
            }
        }
        self.eta[2] -= TAU * Float::round(self.eta[2] / TAU);
    }

    /// Visits all numbers of the state.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.eta);
        memory.numbers(&mut self.off);
        memory.numbers(&mut self.since_s);
    }
}
