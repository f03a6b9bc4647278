//! Logarithm of the likelihood of runs, and its gradient.

use hydroid_core::navigation::{Filter, Gradient, Noise};
use rayon::prelude::*;

use super::fit::CONSTANTS;
use super::measurements::{Run, Runs, Statistics};

/// Steps of the filter between checkpoints: the estimates between two of them stay in the
/// cache of a processor.
const SEGMENT: usize = 64;

impl Runs {
    /// Logarithm of the likelihood of the innovations, without its constant, for fixed values of [`CONSTANTS`], and its
    /// derivatives by the logarithms of the numbers of the statistics and by the constants. The runs are independent.
    pub(super) fn log_likelihood(
        &self,
        statistics: &Statistics,
        constants: &[f64; CONSTANTS.len()],
    ) -> (f64, Vec<f64>) {
        let each: Vec<_> = self.runs.par_iter().map(|run| self.of(run, statistics, constants)).collect();
        // In the order of the runs, so that the sum does not depend on the threads.
        let mut sum = 0.0;
        let mut slope = vec![0.0; statistics.numbers(&self.sensors).len() + CONSTANTS.len()];
        for (value, by) in each {
            sum += value;
            for (x, y) in slope.iter_mut().zip(by) {
                *x += y;
            }
        }
        let finite = sum.is_finite() && slope.iter().all(|x: &f64| x.is_finite());
        (if finite { sum } else { f64::NEG_INFINITY }, slope)
    }

    fn of(&self, run: &Run, statistics: &Statistics, constants: &[f64; CONSTANTS.len()]) -> (f64, Vec<f64>) {
        let states = CONSTANTS.iter().zip(constants);
        let prior = states.fold(run.prior.clone(), |prior, (state, value)| prior.with(*state, *value, 0.0));
        let mut filter = Filter::new(statistics.noise, &prior, f64::INFINITY);
        let mut checkpoints = Vec::with_capacity(run.events.len() / SEGMENT + 1);
        let mut sum = 0.0;
        let mut t = run.events.first().map_or(0.0, |event| event.t);
        for events in run.events.chunks(SEGMENT) {
            checkpoints.push((filter.clone(), t));
            for event in events {
                if event.t > t {
                    filter.predict(event.t - t);
                    t = event.t;
                }
                filter.update(&statistics.measurement(&self.sensors, event), |update| {
                    let innovation = update.innovation;
                    sum -= 0.5 * (Gradient::loss(innovation.nis()) + innovation.variance.ln());
                });
            }
        }
        let mut slope =
            Statistics { noise: Noise::default(), deviations: vec![[0.0; 2]; self.sensors.len()] };
        let (mut predictions, mut updates, mut steps) = (Vec::new(), Vec::new(), Vec::new());
        let mut back = Gradient::new(statistics.noise);
        for (events, (mut filter, mut t)) in run.events.chunks(SEGMENT).zip(checkpoints).rev() {
            predictions.clear();
            updates.clear();
            for event in events {
                if event.t > t {
                    predictions.extend_from_slice(std::slice::from_ref(filter.estimate()));
                    filter.predict(event.t - t);
                }
                steps.push(event.t - std::mem::replace(&mut t, event.t));
                updates.extend_from_slice(std::slice::from_ref(filter.estimate()));
                filter.update(&statistics.measurement(&self.sensors, event), |_| {});
            }
            for (event, before) in events.iter().zip(&updates).rev() {
                let by = back.update(before, &statistics.measurement(&self.sensors, event));
                slope.add_deviation(&self.sensors, event.sensor, by);
                let dt = steps.pop().expect("a step for each measurement");
                if dt > 0.0 {
                    back.predict(&predictions.pop().expect("an estimate for each step"), dt);
                }
            }
        }
        let (by_noise, by_mean) = back.finish();
        slope.noise = by_noise;
        let mut numbers = slope.numbers(&self.sensors);
        numbers.extend(CONSTANTS.map(|state| by_mean[state as usize]));
        (sum, numbers)
    }
}

#[cfg(test)]
mod tests {
    use hydroid_core::navigation::{Mounting, Prior, State};

    use super::super::measurements::{Event, Kind, Sensor};
    use super::*;

    /// Two short runs of a turning boat with all sensors; some values are outliers, some are missing.
    fn runs() -> Runs {
        let mounting = Mounting { forward: -3.0, starboard: 1.0 };
        let kinds = [
            (Kind::Position, 0.4),
            (Kind::Velocity, 0.05),
            (Kind::Heading, 0.01),
            (Kind::YawRate, 0.002),
            (Kind::SpecificForce, 0.05),
            (Kind::OverGround, 0.1),
            (Kind::ThroughWater, 0.1),
        ];
        let sensors = kinds.map(|(kind, deviation)| Sensor { kind, mounting, deviation: [deviation; 2] });
        let run = |phase: f64| {
            let mut events = Vec::new();
            for k in 0..420_u32 {
                let (t, sensor) = (0.07 * f64::from(k), k as usize % 7);
                let wave = |period: f64| (t / period + phase).sin();
                let mut value = match sensor {
                    0 => [2.0 * t + wave(3.0), 0.5 * t],
                    1 => [2.0 + 0.2 * wave(2.0), 0.5 * wave(4.0)],
                    2 => [0.5 * wave(5.0), 0.0],
                    3 => [0.1 * wave(5.0) + 0.01, 0.0],
                    4 => [0.1 * wave(1.0), 0.3 * wave(5.0)],
                    _ => [2.0 + 0.1 * wave(6.0), 0.2 * wave(5.0)],
                };
                if k % 50 == 11 {
                    value[0] += 2.0;
                }
                if k % 60 == 5 {
                    value[1] = f64::NAN;
                }
                events.push(Event { t, sensor, value });
            }
            let prior =
                Prior::default().with(State::CurrentNorth, 0.1, 0.5).with(State::CurrentEast, 0.0, 0.5);
            Run { events, prior }
        };
        Runs { sensors: sensors.to_vec(), runs: vec![run(0.3), run(1.7)] }
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let runs = runs();
        let noise = Noise {
            surge_rate: 0.2,
            surge_acceleration: 0.2,
            sway_rate: 0.3,
            sway: 0.2,
            pivot_rate: 0.4,
            yaw_rate: 0.5,
            yaw: 0.2,
            wave_frequency: 1.2,
            wave_damping: 0.2,
            wave_forward: 0.1,
            wave_starboard: 0.2,
            gnss_rate: 0.02,
            gnss: 0.5,
            compass_rate: 0.3,
            compass: 0.01,
            gyro_walk: 1e-3,
            accelerometer_walk: 1e-2,
            current_walk: 1e-3,
        };
        let deviations = runs.sensors.iter().map(|sensor| sensor.deviation).collect();
        let statistics = Statistics { noise, deviations };
        let constants = [0.3, 0.02, 0.4, 0.7, 0.3, -1.5];
        let (_, slope) = runs.log_likelihood(&statistics, &constants);
        let numbers = statistics.numbers(&runs.sensors);
        assert_eq!(slope.len(), numbers.len() + constants.len());
        for (i, slope) in slope.iter().enumerate() {
            let step = 1e-4;
            let at = |sign: f64| {
                let (mut numbers, mut constants) = (numbers.clone(), constants);
                match numbers.get_mut(i) {
                    Some(number) => *number *= (sign * step).exp(),
                    None => constants[i - numbers.len()] += sign * step,
                }
                runs.log_likelihood(&statistics.with_numbers(&runs.sensors, &numbers), &constants).0
            };
            let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
            let error = (slope - difference).abs();
            assert!(error < 1e-5 * (1.0 + difference.abs()), "number {i}: {slope}, differences {difference}");
        }
    }
}
