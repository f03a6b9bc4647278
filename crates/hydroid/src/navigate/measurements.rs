//! Measurements of runs, and the statistics of their sensors.

use hydroid_core::navigation::{Measurement, Mounting, Noise, Prior};

/// Quantity of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Position of the GNSS antenna north and east of a point \[m\].
    Position,
    /// Velocity of the GNSS antenna to the north and east \[m/s\].
    Velocity,
    /// Heading \[rad\].
    Heading,
    /// Yaw rate \[rad/s\].
    YawRate,
    /// Specific force forward and to starboard \[m/s²\].
    SpecificForce,
    /// Body velocities over ground \[m/s\].
    OverGround,
    /// Body velocities through the water \[m/s\].
    ThroughWater,
}

/// A sensor. Measurements of another quality (a GNSS receiver without fixed ambiguities) are those of another sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Quantity.
    pub kind: Kind,
    /// Place.
    pub mounting: Mounting,
    /// First guess of the standard deviation of the white noise of its values.
    pub deviation: [f64; 2],
}

/// A measurement of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Time \[s\].
    pub t: f64,
    /// Index of the sensor in [`Runs::sensors`].
    pub sensor: usize,
    /// Values; the second is 0 for a sensor of one value.
    pub value: [f64; 2],
}

/// Measurements of a run in the order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Measurements.
    pub events: Vec<Event>,
    /// State before the first measurement.
    pub prior: Prior,
}

/// Runs of one vessel with the same sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Runs {
    /// Sensors.
    pub sensors: Vec<Sensor>,
    /// Runs.
    pub runs: Vec<Run>,
}

/// Statistics of motion and sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics {
    /// Motion, waves, biases, correlated errors.
    pub noise: Noise,
    /// Standard deviations of the white noise of each sensor.
    pub deviations: Vec<[f64; 2]>,
}

impl Statistics {
    /// The measurement of an event.
    pub fn measurement(&self, sensors: &[Sensor], event: &Event) -> Measurement {
        let (value, sensor) = (event.value, &sensors[event.sensor]);
        let (mounting, both) = (sensor.mounting, self.deviations[event.sensor]);
        let deviation = both[0];
        match sensor.kind {
            Kind::Position => Measurement::Position { value, deviation, mounting },
            Kind::Velocity => Measurement::Velocity { value, deviation, mounting },
            Kind::Heading => Measurement::Heading { value: value[0], deviation },
            Kind::YawRate => Measurement::YawRate { value: value[0], deviation },
            Kind::SpecificForce => Measurement::SpecificForce { value, deviation: both, mounting },
            Kind::OverGround => Measurement::OverGround { value, deviation, mounting },
            Kind::ThroughWater => Measurement::ThroughWater { value, deviation, mounting },
        }
    }

    /// The numbers that the likelihood estimates.
    pub(super) fn numbers(&self, sensors: &[Sensor]) -> Vec<f64> {
        let mut copy = self.clone();
        let mut out = Vec::new();
        copy.visit(sensors, |x| out.push(*x));
        out
    }

    /// These statistics with other numbers.
    pub(super) fn with_numbers(&self, sensors: &[Sensor], numbers: &[f64]) -> Self {
        let mut copy = self.clone();
        let mut from = numbers.iter();
        copy.visit(sensors, |x| *x = *from.next().expect("one number for each place"));
        copy
    }

    /// Adds derivatives by the logarithms of the standard deviations of the two values of a sensor.
    pub(super) fn add_deviation(&mut self, sensors: &[Sensor], sensor: usize, by: [f64; 2]) {
        let own = sensors[sensor].kind == Kind::SpecificForce;
        let to = &mut self.deviations[sensor];
        if own {
            *to = [to[0] + by[0], to[1] + by[1]];
        } else {
            to[0] += by[0] + by[1];
        }
    }

    /// Pairs of places in the numbers: the rate of a process and its standard deviation, with half of the power of the rate
    /// in the intensity of the noise that drives it (`2 l s^2`, or `4 l^3 s^2` for Matérn processes).
    pub(super) fn processes(&self, sensors: &[Sensor]) -> Vec<(usize, usize, f64)> {
        let mut marked = self.clone();
        let n = &mut marked.noise;
        let mut pairs = [
            (&mut n.surge_rate, &mut n.surge_acceleration, 0.5),
            (&mut n.sway_rate, &mut n.sway, 1.5),
            (&mut n.yaw_rate, &mut n.yaw, 1.5),
            (&mut n.gnss_rate, &mut n.gnss, 0.5),
            (&mut n.compass_rate, &mut n.compass, 0.5),
        ];
        // Marks that no number has.
        for (k, (rate, deviation, _)) in pairs.iter_mut().enumerate() {
            (**rate, **deviation) = (-1.0 - k as f64, -101.0 - k as f64);
        }
        let powers = pairs.map(|(_, _, power)| power);
        let numbers = marked.numbers(sensors);
        let place = |mark: f64| numbers.iter().position(|number| *number == mark);
        powers
            .iter()
            .enumerate()
            .filter_map(|(k, power)| Some((place(-1.0 - k as f64)?, place(-101.0 - k as f64)?, *power)))
            .collect()
    }

    fn visit(&mut self, sensors: &[Sensor], mut see: impl FnMut(&mut f64)) {
        let n = &mut self.noise;
        let has = |kind| sensors.iter().any(|sensor| sensor.kind == kind);
        for x in [
            &mut n.surge_rate,
            &mut n.surge_acceleration,
            &mut n.sway_rate,
            &mut n.sway,
            &mut n.pivot_rate,
            &mut n.yaw_rate,
            &mut n.yaw,
        ] {
            see(x);
        }
        if has(Kind::Position) {
            see(&mut n.gnss_rate);
            see(&mut n.gnss);
        }
        if has(Kind::Heading) {
            see(&mut n.compass_rate);
            see(&mut n.compass);
        }
        if has(Kind::SpecificForce) {
            for x in [
                &mut n.wave_frequency,
                &mut n.wave_damping,
                &mut n.wave_forward,
                &mut n.wave_starboard,
                &mut n.accelerometer_walk,
            ] {
                see(x);
            }
        }
        if has(Kind::YawRate) {
            see(&mut n.gyro_walk);
        }
        for (sensor, deviation) in sensors.iter().zip(&mut self.deviations) {
            see(&mut deviation[0]);
            if sensor.kind == Kind::SpecificForce {
                see(&mut deviation[1]);
            }
        }
    }
}
