//! Velocities from raw sensors: a fixed-interval smoother over runs of measurements at their own times.
//!
//! [`Runs`] contains the measurements. [`fit`] estimates the statistics of motion, waves and sensors by maximum
//! likelihood, [`calibrate`] decides which constants of the sensors the measurements determine, and [`smooth`] computes pose,
//! velocities and current at chosen times, with standard deviations. The filter and its equations are in
//! [`hydroid_core::navigation`].

mod calibration;
mod fit;
mod likelihood;
mod measurements;
mod smoother;

pub use calibration::{CALIBRATED, Calibration, calibrate, calibrated};
pub use fit::{CONSTANTS, Fitted, fit};
pub use measurements::{Event, Kind, Run, Runs, Sensor, Statistics};
pub use smoother::{Row, Smoothed, filtered, smooth};
