//! The memory of the signals of equations.

use alloc::vec::Vec;

use num_traits::Float;

use super::signal::Signal;
use crate::actuator::lag_step;

/// Layout: after the outputs of a state come the lag states, then the values of each variable 1, 2, .. samples ago.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Memory {
    outputs: usize,
    lags: Vec<LagState>,
    pasts: Vec<PastValue>,
    delays: Vec<DelayLine>,
    len: usize,
}

#[derive(Clone, Debug, PartialEq)]
struct LagState {
    slot: usize,
    input: usize,
    /// Decay of a difference to the command over half an integration step and a whole one.
    half: f64,
    whole: f64,
}

#[derive(Clone, Debug, PartialEq)]
struct PastValue {
    slot: usize,
    /// Indices in the state of the value `samples` ago and of the value one sample later.
    from: usize,
    to: usize,
    held: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct DelayLine {
    variable: usize,
    at: usize,
    len: usize,
}

impl Memory {
    pub(super) fn new(signals: &[Signal], outputs: usize, inputs: usize, h: f64) -> Self {
        let first_slot = 1 + outputs + inputs;
        let mut memory = Self { outputs, lags: Vec::new(), pasts: Vec::new(), delays: Vec::new(), len: 0 };
        for (index, signal) in signals.iter().enumerate() {
            if let Signal::Lag { input, time_constant_s } = *signal {
                let half = Float::exp(-0.5 * h / time_constant_s.0);
                let input = usize::from(input) - outputs;
                memory.lags.push(LagState { slot: first_slot + index, input, half, whole: half * half });
            }
        }
        let mut end = outputs + memory.lags.len();
        for variable in 0..outputs + inputs {
            let of_it = |signal: &Signal| match *signal {
                Signal::Past { variable: v, samples } if usize::from(v) == variable => Some(samples),
                _ => None,
            };
            let Some(longest) = signals.iter().filter_map(of_it).max() else { continue };
            let line = DelayLine { variable, at: end, len: usize::from(longest) };
            for (index, signal) in signals.iter().enumerate() {
                let Some(samples) = of_it(signal) else { continue };
                let from = line.at + usize::from(samples) - 1;
                let held = signal.is_held(outputs);
                // One sample after one sample ago is the present; only outputs are interpolated towards it.
                let to = if samples == 1 { if held { from } else { variable } } else { from - 1 };
                memory.pasts.push(PastValue { slot: first_slot + index, from, to, held });
            }
            end += line.len;
            memory.delays.push(line);
        }
        memory.len = end - outputs;
        memory
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Loads the signals that are constant over a sample.
    #[inline]
    pub(super) fn load_held(&self, state: &[f64], slots: &mut [f64]) {
        for past in self.pasts.iter().filter(|past| past.held) {
            slots[past.slot] = state[past.from];
        }
    }

    /// Loads the other signals, `halves` half steps into an integration step, at the share `time` of the sample. A past
    /// output of one sample ago is interpolated towards `before`, the outputs at the start of the sample.
    #[inline]
    pub(super) fn load_moving(
        &self,
        state: &[f64],
        before: &[f64],
        c: &[f64],
        slots: &mut [f64],
        (halves, time): (usize, f64),
    ) {
        for (lag, &a) in self.lags.iter().zip(&state[self.outputs..]) {
            let decay = [1.0, lag.half, lag.whole][halves];
            slots[lag.slot] = lag_step(a, c[lag.input], decay);
        }
        for past in self.pasts.iter().filter(|past| !past.held) {
            let to = if past.to < self.outputs { before[past.to] } else { state[past.to] };
            slots[past.slot] = state[past.from] + (to - state[past.from]) * time;
        }
    }

    /// Advances the lag states by one integration step.
    #[inline]
    pub(super) fn decay(&self, state: &mut [f64], c: &[f64]) {
        for (lag, a) in self.lags.iter().zip(&mut state[self.outputs..]) {
            *a = lag_step(*a, c[lag.input], lag.whole);
        }
    }

    /// Shifts the past values by a sample: `before` are the outputs at its start, `c` its command.
    #[inline]
    pub(super) fn shift(&self, state: &mut [f64], before: &[f64], c: &[f64]) {
        for line in &self.delays {
            state.copy_within(line.at..line.at + line.len - 1, line.at + 1);
            let now = if line.variable < self.outputs {
                before[line.variable]
            } else {
                c[line.variable - self.outputs]
            };
            state[line.at] = now;
        }
    }
}
