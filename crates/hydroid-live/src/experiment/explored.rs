//! What is known so far: the range of the commands and their changes.

use rand::{Rng, RngExt as _};

use super::allocation::Allocation;
use crate::Axis;

/// Bins of a range.
pub const BINS: usize = 20;
/// Windows in which changes are counted, from [`SHORTEST_WINDOW_S`], each twice as long as the one before.
pub const WINDOWS: usize = 12;
/// Length of the shortest window \[s\].
pub const SHORTEST_WINDOW_S: f64 = 0.25;

/// Share of a range by which the means of two windows must differ for a change.
const CHANGE: f64 = 0.1;
/// Changes that are needed at one time scale. A mean over `n` independent changes is known to one in `sqrt(n)`: a third.
const CHANGES: u32 = 10;
/// Bins of a full range that must have been visited: 60 %.
const FULL_RANGE: f64 = 0.6;
/// Share of the bins of a permitted range that must have been visited.
const PERMITTED_RANGE: f64 = 0.8;
/// Time scales of data that are needed: a sample of independent information arrives about once in a time scale, and an
/// equation of ten terms needs some ten for each.
const DURATION: f64 = 100.0;
/// Time scales for which a change excites the boat: the response is then complete.
const EXCITED: f64 = 5.0;
/// Time scales for which the boat must have turned to each side.
const EACH_SIDE: f64 = 10.0;
/// Time scale that is assumed until the boat's own one is known \[s\].
const ASSUMED_S: f64 = 3.0;
/// Longest time between two samples that belong together \[s\].
const GAP_S: f64 = 5.0;

/// What is known of one command.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name and range.
    pub axis: Axis,
    /// Time spent in each of the equal parts of the range \[s\].
    pub seconds: [f64; BINS],
    /// Number of changes by more than a tenth of the range between the means of successive windows, for windows of
    /// [`SHORTEST_WINDOW_S`] times 1, 2, 4, ...
    pub changes: [u32; WINDOWS],
    windows: [Window; WINDOWS],
    last: Option<f64>,
}

/// A window that is being filled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Window {
    sum: f64,
    seconds: f64,
    before: Option<f64>,
}

impl Channel {
    fn new(axis: Axis) -> Self {
        Self {
            axis,
            seconds: [0.0; BINS],
            changes: [0; WINDOWS],
            windows: [Window::default(); WINDOWS],
            last: None,
        }
    }

    fn bin_width(&self) -> f64 {
        (self.axis.high - self.axis.low) / BINS as f64
    }

    /// Interval of a bin.
    fn bin(&self, bin: usize) -> [f64; 2] {
        let low = self.axis.low;
        [low + bin as f64 * self.bin_width(), low + (bin + 1) as f64 * self.bin_width()]
    }

    /// Adds a command; returns whether it differs significantly from the last significant one.
    fn see(&mut self, dt: f64, value: f64) -> bool {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates
        let bin = ((value - self.axis.low) / self.bin_width()) as usize;
        if let Some(seconds) = self.seconds.get_mut(bin.min(BINS - 1)) {
            *seconds += dt;
        }
        let threshold = CHANGE * (self.axis.high - self.axis.low);
        let mut length_s = SHORTEST_WINDOW_S;
        for (window, changes) in self.windows.iter_mut().zip(&mut self.changes) {
            window.sum += dt * value;
            window.seconds += dt;
            if window.seconds >= length_s {
                let mean = window.sum / window.seconds;
                if window.before.is_some_and(|before| (mean - before).abs() > threshold) {
                    *changes = changes.saturating_add(1);
                }
                *window = Window { sum: 0.0, seconds: 0.0, before: Some(mean) };
            }
            length_s *= 2.0;
        }
        let changed = self.last.is_none_or(|last| (value - last).abs() > threshold);
        if changed {
            self.last = Some(value);
        }
        changed
    }

    fn forget_windows(&mut self) {
        self.windows = [Window::default(); WINDOWS];
    }

    /// Whether each bin that lies at least half in an interval has been visited for a time.
    fn visited(&self, low: f64, high: f64, dwell_s: f64) -> impl Iterator<Item = (usize, bool)> {
        self.seconds.iter().enumerate().filter_map(move |(bin, &seconds)| {
            let [from, to] = self.bin(bin);
            let inside = to.min(high) - from.max(low);
            (inside >= 0.5 * (to - from)).then_some((bin, seconds >= dwell_s))
        })
    }

    /// What is missing of the range between two values, in words.
    fn missing_range(&self, low: f64, high: f64, share: f64, dwell_s: f64) -> Option<String> {
        let bins: Vec<(usize, bool)> = self.visited(low, high, dwell_s).collect();
        let visited = bins.iter().filter(|(_, visited)| *visited).count();
        if visited as f64 >= share * bins.len() as f64 {
            return None;
        }
        let mut gaps: Vec<[f64; 2]> = Vec::new();
        let mut after_gap = false;
        for &(bin, visited) in &bins {
            let [from, to] = self.bin(bin);
            if !visited {
                match gaps.last_mut() {
                    Some(gap) if after_gap => gap[1] = to,
                    _ => gaps.push([from, to]),
                }
            }
            after_gap = !visited;
        }
        let gaps: Vec<String> =
            gaps.into_iter().map(|[from, to]| format!("{} to {}", short(from), short(to))).collect();
        Some(format!(
            "{}: {:.0} % of the range has been used for at least {dwell_s:.1} s per twentieth, {:.0} % are needed; unused: {}",
            self.axis.name,
            100.0 * visited as f64 / bins.len().max(1) as f64,
            100.0 * share,
            gaps.join(", ")
        ))
    }

    /// What is missing of the changes at the time scale, twice and four times it.
    fn missing_changes(&self, scale_s: Option<f64>) -> Option<String> {
        let Some(scale_s) = scale_s else {
            let enough = self.changes.iter().filter(|&&changes| changes >= CHANGES).count();
            return (enough < 3).then(|| {
                format!(
                    "{}: {CHANGES} changes at each of three time scales are needed; complete time scales: {enough}",
                    self.axis.name
                )
            });
        };
        let missing: Vec<String> = [1.0, 2.0, 4.0]
            .into_iter()
            .filter_map(|multiple| {
                let octave = (multiple * scale_s / SHORTEST_WINDOW_S).log2().round();
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates
                let window = (octave as usize).min(WINDOWS - 1);
                let changes = self.changes.get(window).copied().unwrap_or(0);
                let length_s = SHORTEST_WINDOW_S * 2.0_f64.powi(i32::try_from(window).unwrap_or(0));
                (changes < CHANGES).then(|| format!("{changes} over {length_s} s"))
            })
            .collect();
        (!missing.is_empty()).then(|| {
            format!(
                "{}: {CHANGES} changes are needed at each time scale; there are {}",
                self.axis.name,
                missing.join(", ")
            )
        })
    }

    /// A random value of the least explored bin within an interval. The time in a bin is divided by its weight; bins whose
    /// centre is `excluded` do not count.
    fn least_explored(
        &self,
        [low, high]: [f64; 2],
        weight: impl Fn(f64) -> f64,
        excluded: impl Fn(f64) -> bool,
        rng: &mut impl Rng,
    ) -> f64 {
        let mut best: Option<(f64, [f64; 2])> = None;
        for (bin, &seconds) in self.seconds.iter().enumerate() {
            let [from, to] = self.bin(bin);
            let part = [from.max(low), to.min(high)];
            // The draw decides between bins with equal times, and is made for each bin so that seeds stay comparable.
            let draw: f64 = rng.random_range(0.0..1.0);
            let centre = 0.5 * (part[0] + part[1]);
            if part[1] - part[0] < 0.25 * (to - from) || excluded(centre) {
                continue;
            }
            let score = (seconds + 1e-3 * draw) / weight(centre);
            if best.is_none_or(|(least, _)| score < least) {
                best = Some((score, part));
            }
        }
        let [from, to] = best.map_or([low, high], |(_, part)| part);
        let draw: f64 = rng.random_range(0.0..1.0);
        from + draw * (to - from)
    }
}

/// What is known so far of the commands: time in each part of each range, and changes per time scale.
///
/// It is kept also outside of experiments ([`Explored::see`]), so that an experiment explores what the data lack.
#[derive(Clone, Debug, PartialEq)]
pub struct Explored {
    allocation: Allocation,
    inputs: Vec<Channel>,
    push: Channel,
    turn: Channel,
    excited_s: f64,
    since_change_s: f64,
    to_starboard_s: f64,
    to_port_s: f64,
    time_scales: Option<[f64; 2]>,
}

impl Explored {
    /// Nothing is known. The arguments are those of [`Settings`](super::Settings).
    ///
    /// # Errors
    /// If the inputs cannot push ahead or turn to both sides.
    pub fn new(inputs: &[Axis], push: &[(usize, f64)], turn: &[(usize, f64)]) -> Result<Self, String> {
        let allocation = Allocation::new(inputs, push, turn)?;
        Ok(Self {
            inputs: inputs.iter().cloned().map(Channel::new).collect(),
            push: Channel::new(Axis::new("push", [allocation.astern, 1.0], 0.0)),
            turn: Channel::new(Axis::new("turn", [-allocation.turn, allocation.turn], 0.0)),
            allocation,
            excited_s: 0.0,
            since_change_s: f64::INFINITY,
            to_starboard_s: 0.0,
            to_port_s: 0.0,
            time_scales: None,
        })
    }

    /// Adds commands that acted for `dt` seconds. Commands that are not finite or too few are ignored; a gap of more than
    /// 5 s interrupts the count of changes.
    pub fn see(&mut self, dt: f64, commands: &[f64]) {
        if !(dt > 0.0 && dt <= GAP_S)
            || commands.len() < self.inputs.len()
            || commands.iter().any(|command| !command.is_finite())
        {
            for channel in self.inputs.iter_mut().chain([&mut self.push, &mut self.turn]) {
                channel.forget_windows();
            }
            return;
        }
        for (channel, &command) in self.inputs.iter_mut().zip(commands) {
            channel.see(dt, command);
        }
        let [push, turn] = self.allocation.demand(commands);
        let first = self.push.last.is_none();
        let pushed = self.push.see(dt, push);
        let turned = self.turn.see(dt, turn);
        if (pushed || turned) && !first {
            self.since_change_s = 0.0;
        }
        self.since_change_s += dt;
        if self.since_change_s <= EXCITED * self.longest_s() {
            self.excited_s += dt;
        }
        if turn.abs() > CHANGE * self.allocation.turn {
            *(if turn > 0.0 { &mut self.to_starboard_s } else { &mut self.to_port_s }) += dt;
        }
    }

    /// Sets the time scales of speed and yaw rate, for example those of a former
    /// [`Experiment`](super::Experiment::time_scales) \[s\]. Values that are not positive are ignored.
    pub fn set_time_scales(&mut self, push_s: f64, turn_s: f64) {
        if [push_s, turn_s].into_iter().all(|scale| scale.is_finite() && scale > 0.0) {
            self.time_scales = Some([push_s, turn_s]);
        }
    }

    /// What is known of each input.
    pub fn inputs(&self) -> &[Channel] {
        &self.inputs
    }

    /// What is known of the push: 1 is full ahead.
    pub fn push(&self) -> &Channel {
        &self.push
    }

    /// What is known of the turn: 1 is full to starboard.
    pub fn turn(&self) -> &Channel {
        &self.turn
    }

    /// Time in which a change of the commands excited the boat \[s\].
    pub fn excited_s(&self) -> f64 {
        self.excited_s
    }

    /// Time with changing commands that identification needs \[s\].
    pub fn needed_s(&self) -> f64 {
        DURATION * self.longest_s()
    }

    /// Whether the data suffice for identification.
    pub fn is_sufficient(&self) -> bool {
        self.missing().is_empty()
    }

    /// What is missing for identification, one sentence each.
    pub fn missing(&self) -> Vec<String> {
        let mut missing = self.missing_time();
        let [push_s, turn_s] = self.scales();
        for (channel, _) in self.inputs.iter().zip(self.allocation.is_used()).filter(|(_, used)| *used) {
            let Axis { low, high, .. } = channel.axis;
            missing.extend(channel.missing_range(low, high, FULL_RANGE, push_s.min(turn_s)));
        }
        missing
    }

    /// What is missing, and what is known of the inputs that neither push nor turn, in words.
    pub fn text(&self) -> String {
        let missing = self.missing();
        let mut text = if missing.is_empty() {
            "the data suffice for identification".to_owned()
        } else {
            format!("missing for identification: {}", missing.join("; "))
        };
        for (channel, _) in self
            .inputs
            .iter()
            .zip(self.allocation.is_used())
            .filter(|(channel, used)| !used && channel.changes.iter().all(|&changes| changes < CHANGES))
        {
            text += "; ";
            text += &channel.axis.name;
            text += " neither pushes nor turns and hardly moved: its effect stays unknown";
        }
        text
    }

    /// What is missing within permitted pushes and turns.
    pub(super) fn missing_within(&self, push: [f64; 2], turn: f64) -> Vec<String> {
        let mut missing = self.missing_time();
        let [push_s, turn_s] = self.scales();
        missing.extend(self.push.missing_range(push[0], push[1], PERMITTED_RANGE, push_s));
        missing.extend(self.turn.missing_range(-turn, turn, PERMITTED_RANGE, turn_s));
        missing
    }

    /// What is missing of duration, directions and changes.
    fn missing_time(&self) -> Vec<String> {
        let mut missing = Vec::new();
        let needed = DURATION * self.longest_s();
        if self.excited_s < needed {
            missing.push(format!(
                "{:.0} s with changing commands are recorded, {needed:.0} s are needed",
                self.excited_s
            ));
        }
        let [push_s, turn_s] = self.scales();
        for (side, seconds) in [("starboard", self.to_starboard_s), ("port", self.to_port_s)] {
            if seconds < EACH_SIDE * turn_s {
                missing.push(format!(
                    "the boat turned to {side} for {seconds:.0} s, {:.0} s are needed",
                    EACH_SIDE * turn_s
                ));
            }
        }
        missing.extend(self.push.missing_changes(self.time_scales.map(|_| push_s)));
        missing.extend(self.turn.missing_changes(self.time_scales.map(|_| turn_s)));
        missing
    }

    pub(super) fn scales(&self) -> [f64; 2] {
        self.time_scales.unwrap_or([ASSUMED_S; 2])
    }

    fn longest_s(&self) -> f64 {
        let [push_s, turn_s] = self.scales();
        push_s.max(turn_s)
    }

    /// A push in its least explored part; astern counts a third, as boats are mostly driven ahead.
    pub(super) fn least_explored_push(
        &self,
        range: [f64; 2],
        excluded: impl Fn(f64) -> bool,
        rng: &mut impl Rng,
    ) -> f64 {
        let weight = |push: f64| if push < 0.0 { 1.0 / 3.0 } else { 1.0 };
        self.push.least_explored(range, weight, excluded, rng)
    }

    /// A turn in its least explored part.
    pub(super) fn least_explored_turn(
        &self,
        limit: f64,
        excluded: impl Fn(f64) -> bool,
        rng: &mut impl Rng,
    ) -> f64 {
        self.turn.least_explored([-limit, limit], |_| 1.0, excluded, rng)
    }

    pub(super) fn allocation(&self) -> &Allocation {
        &self.allocation
    }

    /// Whether this describes the same inputs.
    pub(super) fn fits(&self, allocation: &Allocation) -> bool {
        self.allocation == *allocation
    }
}

/// A number with two decimals at most.
fn short(value: f64) -> String {
    let rounded = (100.0 * value).round() / 100.0;
    // No negative zero.
    format!("{}", rounded + 0.0)
}
