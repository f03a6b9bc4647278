//! Alignment of the commands of a stream with the samples of the model.

use hydroid::log::{CommandTiming, InputDelay, LogError};
use hydroid_core::memory::Memory;

const MAX_DELAY: i64 = 100_000;

/// Commands of the last samples. The command of row `k` acts `by` samples later (-1 for [`CommandTiming::After`]
/// without delay: it has acted when the row is read).
#[derive(Clone, Debug)]
pub struct Commands {
    inputs: usize,
    by: i64,
    after: bool,
    last: Vec<f64>,
    /// Ring of the last `by + 1` commands, and index of the oldest.
    ring: Vec<f64>,
    oldest: usize,
    /// Time at which the commands that acted were last those of the answers \[s\].
    pub agreed: f64,
}

impl Commands {
    pub fn new(inputs: usize, dt: f64, timing: CommandTiming, delay: InputDelay) -> Result<Self, LogError> {
        delay.check()?;
        let after = timing == CommandTiming::After;
        let by = delay.samples(dt).saturating_sub(i64::from(after));
        if !(-1..=MAX_DELAY).contains(&by) {
            return Err(LogError::BadOption {
                what: "an input delay",
                value: delay.to_string(),
                reason: format!(
                    "the command that acts must be known when the next sample comes: delay and command timing together must be -1 to {MAX_DELAY} samples (timing after: -1)"
                ),
            });
        }
        let rows = usize::try_from(by).unwrap_or(0) + 1;
        let mut own = Self {
            inputs,
            by,
            after,
            last: Vec::new(),
            ring: vec![f64::NAN; rows * inputs],
            oldest: 0,
            agreed: f64::NAN,
        };
        own.last = vec![f64::NAN; inputs];
        Ok(own)
    }

    pub fn restart(&mut self) {
        self.ring.fill(f64::NAN);
    }

    /// Takes the command of the first sample of a run; true if it was missing and the last one is held.
    pub fn begin(&mut self, command: &[f64]) -> bool {
        let held = self.take(command);
        self.push();
        held
    }

    /// Advances `steps` samples to one with this command, and calls `act` with the command of each interval (NaN if
    /// unknown). True if a missing command was held.
    pub fn advance_to(&mut self, steps: usize, command: &[f64], mut act: impl FnMut(usize, &[f64])) -> bool {
        let mut held = false;
        if self.after {
            held = self.take(command);
        }
        for step in 0..steps {
            if step + 1 == steps && !self.after {
                if self.by < 0 {
                    held = self.take(command);
                    self.push();
                    act(step, self.oldest());
                } else {
                    act(step, self.oldest());
                    held = self.take(command);
                    self.push();
                }
            } else if self.by < 0 {
                self.push();
                act(step, self.oldest());
            } else {
                act(step, self.oldest());
                self.push();
            }
        }
        held
    }

    /// Future commands: delayed commands, then the plan with its last row held, or the last command.
    pub fn ahead(&self, plan: &[f64], into: &mut [f64]) {
        let under_way = usize::try_from(self.by).unwrap_or(0);
        let last_row = (plan.len() / self.inputs.max(1)).saturating_sub(1);
        for (step, row) in into.chunks_exact_mut(self.inputs.max(1)).enumerate() {
            match step.checked_sub(under_way) {
                None => row.copy_from_slice(self.row(step)),
                Some(_) if plan.is_empty() => row.copy_from_slice(&self.last),
                Some(at) => {
                    let planned = &plan[at.min(last_row) * self.inputs..][..self.inputs];
                    for ((to, planned), last) in row.iter_mut().zip(planned).zip(&self.last) {
                        *to = if planned.is_nan() { *last } else { *planned };
                    }
                }
            }
        }
    }

    /// Sets the command in force, for a stream whose rows have the commands that have acted.
    pub fn set_last(&mut self, command: &[f64]) {
        self.last.copy_from_slice(command);
    }

    pub fn known(&self) -> bool {
        self.by < 0 || !self.oldest().iter().any(|c| c.is_nan())
    }

    fn take(&mut self, command: &[f64]) -> bool {
        let mut held = false;
        for (last, c) in self.last.iter_mut().zip(command) {
            if c.is_nan() {
                held = true;
            } else {
                *last = *c;
            }
        }
        held
    }

    fn push(&mut self) {
        let at = self.oldest * self.inputs;
        self.ring[at..at + self.inputs].copy_from_slice(&self.last);
        self.oldest = (self.oldest + 1) % self.rows();
    }

    fn rows(&self) -> usize {
        (self.ring.len() / self.inputs.max(1)).max(1)
    }

    fn oldest(&self) -> &[f64] {
        self.row(0)
    }

    fn row(&self, age: usize) -> &[f64] {
        &self.ring[(self.oldest + age) % self.rows() * self.inputs..][..self.inputs]
    }

    /// Visits the last command, then the ring from the oldest on.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.ring.rotate_left(self.oldest * self.inputs);
        self.oldest = 0;
        memory.numbers(&mut self.last);
        memory.numbers(&mut self.ring);
        memory.number(&mut self.agreed);
    }
}
