//! The motion in a trial.

use hydroid_core::current::in_body;

use super::approach::Approach;
use crate::plant::{InputMap, Simulation};

/// Motion over ground, sample by sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// Sample time \[s\].
    pub dt: f64,
    /// Pose: north, east \[m\], heading \[rad\], clockwise from north and not wrapped.
    pub eta: Vec<[f64; 3]>,
    /// Body velocities over ground: surge, sway \[m/s\], yaw rate \[rad/s\].
    pub nu: Vec<[f64; 3]>,
    /// Steering held from each sample on: 1 is hard to starboard.
    pub steering: Vec<f64>,
    /// Propulsion: 1 is full ahead.
    pub propulsion: f64,
    /// Velocity of the water, north and east \[m/s\].
    pub current: [f64; 2],
    /// Why the motion after the last sample is not valid.
    pub not_valid: Option<String>,
    /// Sample at which the trial begins, after the approach.
    pub execute: usize,
    /// Mean surge and sway of a measured approach \[m/s\].
    pub approach: Option<[f64; 2]>,
}

/// An instant between two samples: the sample before it, and the share of the sample time after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instant {
    pub(super) sample: usize,
    pub(super) share: f64,
}

impl Track {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.eta.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.eta.is_empty()
    }

    /// Time of a sample since the execute \[s\], rounded to microseconds.
    pub fn time_s(&self, sample: usize) -> f64 {
        (1e6 * (sample as f64 - self.execute as f64) * self.dt).round() / 1e6
    }

    /// Time since the execute at an instant \[s\].
    pub(super) fn time(&self, at: Instant) -> f64 {
        (at.sample as f64 - self.execute as f64 + at.share) * self.dt
    }

    /// Speed over ground at a sample \[m/s\].
    pub fn speed(&self, sample: usize) -> f64 {
        let [u, v, _] = self.nu[sample];
        u.hypot(v)
    }

    /// Leaves the samples from one to another.
    pub(super) fn keep(&mut self, from: usize, to: usize) {
        self.eta = self.eta[from..=to].to_vec();
        self.nu = self.nu[from..=to].to_vec();
        self.steering = self.steering[from..=to].to_vec();
    }

    /// Body velocities through the water at a sample: surge and sway \[m/s\].
    pub fn through_water(&self, sample: usize) -> [f64; 2] {
        let [u, v, _] = self.nu[sample];
        self.relative([u, v], sample)
    }

    /// Surge and sway of the approach over ground \[m/s\].
    pub(super) fn approach(&self) -> [f64; 2] {
        let [u, v, _] = self.nu[self.execute];
        self.approach.unwrap_or([u, v])
    }

    /// Velocities over ground at the heading of a sample, through the water.
    pub(super) fn relative(&self, [u, v]: [f64; 2], sample: usize) -> [f64; 2] {
        let [surge, sway] = in_body(self.current, self.eta[sample][2]);
        [u - surge, v - sway]
    }

    /// The motion of a ship whose lengths are `scale` times those of the vessel: by Froude's law, times and speeds are the square
    /// root of it larger.
    pub(super) fn scale(&mut self, scale: f64) {
        let root = scale.sqrt();
        self.dt *= root;
        self.eta.iter_mut().for_each(|[x, y, _]| (*x, *y) = (*x * scale, *y * scale));
        self.nu.iter_mut().for_each(|[u, v, r]| (*u, *v, *r) = (*u * root, *v * root, *r / root));
        self.current = self.current.map(|velocity| velocity * root);
        self.approach = self.approach.map(|velocities| velocities.map(|velocity| velocity * root));
    }

    /// Change of the heading since the execute \[rad\], positive to the side (1 starboard, -1 port).
    pub(super) fn turned(&self, sample: usize, side: f64) -> f64 {
        side * (self.eta[sample][2] - self.eta[self.execute][2])
    }

    /// First instant from `from` on at which `value` reaches `level` from below; linear between samples.
    pub(super) fn crossing(&self, from: usize, level: f64, value: impl Fn(usize) -> f64) -> Option<Instant> {
        let after = (from..self.len()).find(|&k| value(k) >= level)?;
        if after == from {
            return Some(Instant { sample: from, share: 0.0 });
        }
        let (before, next) = (value(after - 1), value(after));
        Some(Instant { sample: after - 1, share: (level - before) / (next - before) })
    }

    /// Position at an instant relative to that at the execute \[m\]: along the course at the execute, and to its starboard.
    pub(super) fn offset(&self, at: Instant) -> [f64; 2] {
        let position = |axis: usize| {
            let next = self.eta[(at.sample + 1).min(self.len() - 1)][axis];
            let here = self.eta[at.sample][axis];
            here + at.share * (next - here) - self.eta[self.execute][axis]
        };
        in_body([position(0), position(1)], self.eta[self.execute][2])
    }

    /// Length of the path from a sample to an instant \[m\].
    pub(super) fn path_length(&self, from: usize, to: Instant) -> f64 {
        let chord = |k: usize| {
            let ([x, y, _], [x_next, y_next, _]) = (self.eta[k], self.eta[(k + 1).min(self.len() - 1)]);
            (x_next - x).hypot(y_next - y)
        };
        (from..to.sample).map(chord).sum::<f64>() + to.share * chord(to.sample)
    }

    /// The largest value of the heading change after a sample, where the yaw rate changes its sign \[rad\], and its instant;
    /// `None` if the heading still grows at the end. The yaw rate is linear between samples.
    pub(super) fn peak(&self, from: usize, side: f64) -> Option<(f64, Instant)> {
        let rate = |k: usize| side * self.nu[k][2];
        let after = (from..self.len()).find(|&k| rate(k) <= 0.0)?;
        if after == from {
            return Some((self.turned(from, side), Instant { sample: from, share: 0.0 }));
        }
        let before = after - 1;
        let share = rate(before) / (rate(before) - rate(after));
        let gained = 0.5 * rate(before) * share * self.dt;
        Some((self.turned(before, side) + gained, Instant { sample: before, share }))
    }
}

/// A trial under way: the simulation and its track.
pub(super) struct Run<'a> {
    simulation: Simulation,
    map: &'a InputMap,
    command: Vec<f64>,
    longest: usize,
    pub(super) track: Track,
}

impl<'a> Run<'a> {
    /// A trial that begins with the simulation of an approach, and lasts at most `longest_s`.
    pub(super) fn new(approach: &Approach, map: &'a InputMap, s: f64, longest_s: f64) -> Self {
        Self::of(approach.simulation.clone(), map, approach.propulsion, s, longest_s)
    }

    pub(super) fn of(simulation: Simulation, map: &'a InputMap, p: f64, s: f64, longest_s: f64) -> Self {
        let track = Track {
            dt: simulation.dt(),
            eta: vec![simulation.eta()],
            nu: vec![simulation.nu_over_ground()],
            steering: vec![s],
            propulsion: p,
            current: simulation.current(),
            not_valid: None,
            execute: 0,
            approach: None,
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let longest = (longest_s / simulation.dt()) as usize;
        Self { command: map.command(p, s), simulation, map, longest, track }
    }

    /// Sets the steering from the present sample on.
    pub(super) fn steer(&mut self, s: f64) {
        self.map.write_command(self.track.propulsion, s, &mut self.command);
        if let Some(last) = self.track.steering.last_mut() {
            *last = s;
        }
    }

    /// The next sample; false at the end of the time, or if the motion is not valid.
    pub(super) fn advance(&mut self) -> bool {
        if self.track.not_valid.is_some() || self.track.len() > self.track.execute + self.longest {
            return false;
        }
        self.simulation.advance(&self.command);
        self.track.not_valid = self.simulation.not_valid();
        if self.track.not_valid.is_some() {
            return false;
        }
        self.track.eta.push(self.simulation.eta());
        self.track.nu.push(self.simulation.nu_over_ground());
        let s = self.track.steering.last().copied().unwrap_or_default();
        self.track.steering.push(s);
        true
    }

    /// The change of the heading since the execute \[rad\], positive to the side.
    pub(super) fn turned(&self, side: f64) -> f64 {
        self.track.turned(self.track.len() - 1, side)
    }

    /// Yaw rate \[rad/s\].
    pub(super) fn yaw_rate(&self) -> f64 {
        self.simulation.nu()[2]
    }
}
