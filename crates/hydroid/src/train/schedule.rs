//! Step-size schedules.
//!
//! With the peak `p` after `s` of `n` steps:
//!
//! ```text
//! constant    p
//! cosine      p (e + (1 - e) (1 + cos(pi s / n)) / 2)                       e = 1/100
//! one-cycle   warm-up, s < w n:   p (a + (1 - a) (1 - cos(pi s / (w n))) / 2)     a = 1/25,  w = 1/10
//!             then:               p (z + (1 - z) (1 + cos(pi (s - w n) / (n - w n))) / 2)    z = 1/1000
//! ```
//!
//! Cosine: Loshchilov and Hutter, SGDR, 2017. One-cycle: Smith and Topin, Super-convergence, 2018, with cosines instead
//! of straight lines.

use std::f64::consts::PI;

use super::Schedule;

/// Final step size of a cosine, relative to the peak.
const COSINE_END: f64 = 0.01;
/// Initial and final step size of a cycle, relative to the peak.
const CYCLE_START: f64 = 0.04;
const CYCLE_END: f64 = 0.001;
/// Share of the steps in the warm-up.
const WARM_UP: f64 = 0.1;

/// Step size after `done` of `steps` steps.
pub fn rate(schedule: Schedule, peak: f64, done: usize, steps: usize) -> f64 {
    let part = done as f64 / steps.max(1) as f64;
    let fall = |part: f64, end: f64| end + (1.0 - end) * 0.5 * (1.0 + (PI * part.min(1.0)).cos());
    peak * match schedule {
        Schedule::Constant => 1.0,
        Schedule::Cosine => fall(part, COSINE_END),
        Schedule::OneCycle if part < WARM_UP => fall(1.0 - part / WARM_UP, CYCLE_START),
        Schedule::OneCycle => fall((part - WARM_UP) / (1.0 - WARM_UP), CYCLE_END),
    }
}
