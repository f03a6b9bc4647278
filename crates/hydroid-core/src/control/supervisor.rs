//! The supervisor of a steered vessel: when the commands of a law are in force, and when the way to the task is planned anew.

use crate::memory::{MOST_COUNTED, Memory};

/// What a vessel does with its task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// A measurement is missing: the commands are neutral.
    #[default]
    Blind,
    /// On the way to the task.
    Approach,
    /// On the task.
    OnTask,
    /// The task is done: the commands are neutral.
    Arrived,
    /// The task cannot be reached, or the vessel is outside its fence: the commands are neutral until it is steered anew.
    Stopped,
}

/// Why a vessel was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stop {
    /// It did not come to its task.
    Task,
    /// All ways to its task leave the fence.
    NoWay,
    /// It was outside its fence.
    Outside,
    /// Position or heading contradict the velocities.
    Contradiction,
    /// The position does not change while the commands move the vessel.
    Stuck,
    /// It does not answer to the commands.
    Unanswered,
}

impl Stop {
    /// All causes.
    pub const ALL: [Self; 6] =
        [Self::Task, Self::NoWay, Self::Outside, Self::Contradiction, Self::Stuck, Self::Unanswered];

    /// The cause in words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Task => "the vessel does not come to its task",
            Self::NoWay => "there is no way to the task within the fence",
            Self::Outside => "the vessel is outside the fence",
            Self::Contradiction => "position or heading contradict the velocities",
            Self::Stuck => "the position does not change while the commands move the vessel",
            Self::Unanswered => "the vessel does not answer to its commands",
        }
    }
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 5] = [Self::Blind, Self::Approach, Self::OnTask, Self::Arrived, Self::Stopped];

    /// Whether the commands of the law are in force; otherwise they are neutral.
    pub const fn steers(self) -> bool {
        matches!(self, Self::Approach | Self::OnTask)
    }

    /// Whether the mode lasts until the vessel is steered anew.
    pub const fn is_final(self) -> bool {
        matches!(self, Self::Arrived | Self::Stopped)
    }
}

/// A state machine around a control law that follows a reference along a way.
///
/// | from | condition | to |
/// | --- | --- | --- |
/// | blind | all measurements are there | approach, with a new way |
/// | approach, on task | a measurement is missing or too old | blind |
/// | approach | the vessel is on its way, which has reached the task | on task |
/// | approach, on task | the vessel has been off its way for the patience | approach, with a new way |
/// | on task | the reference has not moved on by the progress for the stall time | approach, with a new way |
/// | approach | the time of the way is over | stopped |
/// | approach, on task | a new way is the fourth one in a row that is no shorter than the best one | stopped |
/// | on task | the end of the task | arrived |
/// | blind, approach, on task | the vessel is outside its fence, no way stays within it, its pose contradicts the velocities for long, or it does not answer to the commands | stopped |
///
/// *Off its way* is a distance from the reference above the tolerance. A way has twice its planned time and ten times the
/// patience. Ways count as shorter by the progress at least, so that the number of ways, and with it the time in which the
/// vessel is steered without being on its task, has a limit: every way is either shorter than the best one by that length, or
/// one of three. At a station, where there is no progress, this count begins anew whenever the vessel is there.
#[derive(Clone, Debug, PartialEq)]
pub struct Supervisor {
    mode: Mode,
    limits: SupervisorLimits,
    /// Time off the way.
    off_s: f64,
    /// Time of the approach, and its limit.
    approach_s: f64,
    limit_s: f64,
    /// Farthest place of the reference on the way, and the time since it was reached.
    farthest_m: f64,
    stalled_s: f64,
    /// Shortest way so far.
    shortest_m: f64,
    /// Ways in a row that were no shorter.
    attempts: usize,
    /// Whether the vessel was on its way at the last sample.
    within: bool,
    cause: Stop,
}

/// Limits of a [`Supervisor`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupervisorLimits {
    /// Patience: time off the way after which a new one is planned \[s\].
    pub patience_s: f64,
    /// Progress: length by which a new way counts as shorter, and by which the reference moves on \[m\].
    pub progress_m: f64,
    /// Time without progress on the task after which a new way is planned \[s\].
    pub stall_s: f64,
}

impl SupervisorLimits {
    /// For the age up to which measurements count \[s\], and a tolerance \[m\] at a speed \[m/s\]: the patience is this age and
    /// the time of two tolerances, and the reference has ten ages and the time of four tolerances to move on by one.
    pub fn new(age_s: f64, tolerance_m: f64, speed_m_s: f64) -> Self {
        let time_s = tolerance_m / speed_m_s;
        let [patience_s, stall_s] = [age_s + 2.0 * time_s, RESERVE * age_s + 4.0 * time_s];
        Self { patience_s, progress_m: tolerance_m, stall_s }
    }
}

/// Where a vessel is after a sample in which a law has computed commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Whether the vessel is on its way.
    pub within: bool,
    /// Whether the reference has reached the task.
    pub joined: bool,
    /// Whether the task is done.
    pub done: bool,
    /// Arc length of the reference \[m\]; infinite where none is expected (a station).
    pub along_m: f64,
}

/// Ways that need not be shorter than those before.
const MOST_ATTEMPTS: usize = 3;

/// Time of an approach beyond twice its plan, in patiences.
const RESERVE: f64 = 10.0;

impl Supervisor {
    /// Before the first sample.
    pub const fn new(limits: SupervisorLimits) -> Self {
        Self {
            mode: Mode::Blind,
            limits,
            farthest_m: f64::NEG_INFINITY,
            stalled_s: 0.0,
            off_s: 0.0,
            approach_s: 0.0,
            limit_s: 0.0,
            shortest_m: f64::INFINITY,
            attempts: 0,
            within: false,
            cause: Stop::Task,
        }
    }

    /// Time off the way after which a new one is planned \[s\].
    pub const fn patience_s(&self) -> f64 {
        self.limits.patience_s
    }

    /// The present mode.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The pose is not known, or has jumped: the way ends.
    pub fn lose(&mut self) {
        if !self.mode.is_final() {
            self.mode = Mode::Blind;
        }
        self.within = false;
    }

    /// Why the vessel was stopped; `None` if it was not.
    pub const fn cause(&self) -> Option<Stop> {
        if matches!(self.mode, Mode::Stopped) { Some(self.cause) } else { None }
    }

    /// Stops the vessel, unless the task has ended.
    pub const fn stop(&mut self, cause: Stop) {
        if !self.mode.is_final() {
            (self.mode, self.cause) = (Mode::Stopped, cause);
            self.within = false;
        }
    }

    /// Begins a sample, `elapsed_s` seconds after the last one. `alive` is whether the measurements are there. Returns whether a
    /// way must be planned; then [`planned`](Self::planned) follows.
    pub fn begin(&mut self, alive: bool, elapsed_s: f64) -> bool {
        if self.mode.is_final() {
            return false;
        }
        if !alive {
            self.lose();
            return false;
        }
        if self.mode == Mode::Blind {
            return true;
        }
        // Not a number counts as no time within a limit.
        let elapsed_s = if elapsed_s >= 0.0 { elapsed_s } else { f64::INFINITY };
        self.off_s = if self.within { 0.0 } else { self.off_s + elapsed_s };
        self.stalled_s += elapsed_s;
        if self.mode == Mode::Approach {
            self.approach_s += elapsed_s;
            if self.approach_s > self.limit_s {
                self.stop(Stop::Task);
                return false;
            }
        }
        let is_stalled = self.mode == Mode::OnTask && self.stalled_s > self.limits.stall_s;
        is_stalled || self.off_s > self.limits.patience_s
    }

    /// A way to the task was planned: its length \[m\], from which the part of the task that is done already may be subtracted,
    /// and its time \[s\].
    pub fn planned(&mut self, left_m: f64, duration_s: f64) {
        let SupervisorLimits { patience_s, progress_m, .. } = self.limits;
        if left_m <= self.shortest_m - progress_m {
            (self.attempts, self.shortest_m) = (0, left_m);
        } else {
            self.attempts += 1;
        }
        (self.off_s, self.approach_s, self.stalled_s) = (0.0, 0.0, 0.0);
        self.farthest_m = f64::NEG_INFINITY;
        self.limit_s = 2.0 * duration_s + RESERVE * patience_s;
        let sound = left_m.is_finite() && self.limit_s.is_finite();
        if sound && self.attempts <= MOST_ATTEMPTS {
            (self.mode, self.within) = (Mode::Approach, true);
        } else {
            self.stop(Stop::Task);
        }
    }

    /// Judges a sample in which the law has computed commands.
    pub fn judge(&mut self, place: &Place) {
        if !self.mode.steers() {
            return;
        }
        let Place { within, joined, done, along_m } = *place;
        self.within = within;
        if along_m >= self.farthest_m + self.limits.progress_m || along_m == f64::INFINITY {
            (self.farthest_m, self.stalled_s) = (along_m, 0.0);
        }
        if done {
            self.mode = Mode::Arrived;
        } else if within && joined {
            self.mode = Mode::OnTask;
            if along_m == f64::INFINITY {
                (self.attempts, self.shortest_m) = (0, f64::INFINITY);
            }
        }
    }

    /// Visits all numbers of the state.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        let mut mode = self.mode as usize;
        memory.count(&mut mode, Mode::ALL.len() - 1);
        self.mode = Mode::ALL[mode];
        let Self { off_s, approach_s, limit_s, farthest_m, stalled_s, shortest_m, .. } = self;
        for number in [off_s, approach_s, limit_s, farthest_m, stalled_s, shortest_m] {
            memory.number(number);
        }
        memory.count(&mut self.attempts, MOST_COUNTED);
        memory.flag(&mut self.within);
        let mut cause = self.cause as usize;
        memory.count(&mut cause, Stop::ALL.len() - 1);
        self.cause = Stop::ALL[cause];
    }
}
