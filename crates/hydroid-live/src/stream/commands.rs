//! Alignment of the commands of a stream with the samples of the model.

use hydroid::log::{CommandTiming, InputDelay, LogError};

const MAX_DELAY: i64 = 100_000;

/// Commands of the last samples. The command of row `k` acts `by` samples later (-1 for [`CommandTiming::After`]
/// without delay: it has acted when the row is read).
#[derive(Clone, Debug)]
pub(super) struct Commands {
    inputs: usize,
    by: i64,
    after: bool,
    last: Vec<f64>,
    /// Ring of the last `by + 1` commands, and index of the oldest.
    ring: Vec<f64>,
    oldest: usize,
}

impl Commands {
    pub(super) fn new(
        inputs: usize,
        dt: f64,
        timing: CommandTiming,
        delay: InputDelay,
    ) -> Result<Self, LogError> {
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
        let mut own =
            Self { inputs, by, after, last: Vec::new(), ring: vec![f64::NAN; rows * inputs], oldest: 0 };
        own.last = vec![f64::NAN; inputs];
        Ok(own)
    }

    pub(super) fn restart(&mut self) {
        self.ring.fill(f64::NAN);
    }

    /// Takes the command of the first sample of a run; true if it was missing and the last one is held.
    pub(super) fn begin(&mut self, command: &[f64]) -> bool {
        let held = self.take(command);
        self.push();
        held
    }

    /// Advances `steps` samples to one with this command, and calls `act` with the command of each interval (NaN if
    /// unknown). True if a missing command was held.
    pub(super) fn advance_to(
        &mut self,
        steps: usize,
        command: &[f64],
        mut act: impl FnMut(usize, &[f64]),
    ) -> bool {
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
    pub(super) fn ahead(&self, plan: &[f64], into: &mut [f64]) {
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

    pub(super) fn known(&self) -> bool {
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

    pub(super) fn memory_len(&self) -> usize {
        self.last.len() + self.ring.len()
    }

    /// Values for a state file: last command, then the ring from the oldest on.
    pub(super) fn memory(&self) -> Vec<f64> {
        let ring = (0..self.rows()).flat_map(|age| self.row(age));
        self.last.iter().chain(ring).copied().collect()
    }

    pub(super) fn restore(&mut self, memory: &[f64]) {
        let (last, ring) = memory.split_at(self.inputs);
        self.last.copy_from_slice(last);
        self.ring.copy_from_slice(ring);
        self.oldest = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Commands of each interval, for commands 1, 2, .. at samples 0, 1, 2, 5, 6.
    fn acts(timing: CommandTiming, delay: i64) -> Vec<f64> {
        let mut commands = Commands::new(1, 0.1, timing, InputDelay::Samples(delay)).unwrap();
        let mut acted = Vec::new();
        commands.begin(&[1.0]);
        for (steps, command) in [(1, 2.0), (1, f64::NAN), (3, 4.0), (1, 5.0)] {
            let held = commands.advance_to(steps, &[command], |_, c| acted.push(c[0]));
            assert_eq!(held, command.is_nan());
        }
        acted.iter().map(|c| if c.is_nan() { -1.0 } else { *c }).collect()
    }

    /// The alignment is that of logs (`log::grid`).
    #[test]
    fn commands_act_as_in_a_log() {
        use CommandTiming::{After, Before};
        assert_eq!(acts(Before, 0), [1.0, 2.0, 2.0, 2.0, 2.0, 4.0]);
        assert_eq!(acts(After, 0), [2.0, 2.0, 4.0, 4.0, 4.0, 5.0]);
        assert_eq!(acts(Before, 2), [-1.0, -1.0, 1.0, 2.0, 2.0, 2.0]);
        assert_eq!(acts(After, 1), [1.0, 2.0, 2.0, 4.0, 4.0, 4.0]);
        assert_eq!(acts(Before, -1), [2.0, 2.0, 2.0, 2.0, 4.0, 5.0]);
        assert!(Commands::new(1, 0.1, Before, InputDelay::Samples(-2)).is_err());
        assert!(Commands::new(1, 0.1, Before, InputDelay::Seconds(1e8)).is_err());
    }

    #[test]
    fn what_will_act_is_under_way_or_planned_or_held() {
        let mut commands = Commands::new(1, 0.1, CommandTiming::Before, InputDelay::Samples(2)).unwrap();
        commands.begin(&[1.0]);
        assert!(!commands.known());
        commands.advance_to(2, &[2.0], |_, _| {});
        assert!(commands.known());
        let ahead = |plan: &[f64]| {
            let mut into = [0.0; 6];
            commands.ahead(plan, &mut into);
            into
        };
        assert_eq!(ahead(&[]), [1.0, 1.0, 2.0, 2.0, 2.0, 2.0]);
        assert_eq!(ahead(&[7.0, f64::NAN, 9.0]), [1.0, 1.0, 7.0, 2.0, 9.0, 9.0]);
    }

    #[test]
    fn memory_comes_back_wherever_the_ring_stood() {
        let mut commands = Commands::new(2, 0.1, CommandTiming::Before, InputDelay::Samples(3)).unwrap();
        commands.begin(&[1.0, 2.0]);
        commands.advance_to(5, &[3.0, f64::NAN], |_, _| {});
        let mut other = Commands::new(2, 0.1, CommandTiming::Before, InputDelay::Samples(3)).unwrap();
        other.restore(&commands.memory());
        assert_eq!(commands.memory().len(), commands.memory_len());
        for command in [[4.0, 5.0], [6.0, 7.0], [8.0, 9.0]] {
            let walk = |commands: &mut Commands| {
                let mut acted = Vec::new();
                commands.advance_to(2, &command, |_, c| acted.extend_from_slice(c));
                acted
            };
            assert_eq!(walk(&mut commands), walk(&mut other));
        }
    }
}
