//! A simulated record.

use std::sync::Arc;

use hydroid_core::craft::CommandInput;
use hydroid_core::vessel::{Command, State};

use super::error::SimulateError;
use super::options::Options;
use crate::excitation::PropellerRudder;
use crate::log::{Channel, Table, Trajectory};
use crate::toml_file::nearest;

/// A simulated run: commands, measurements and truth. Row `k` holds the state before command `k` acts; command `k` is
/// held until row `k + 1`. The pose is measured without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    name: String,
    dt_s: f64,
    channels: [CommandInput; 2],
    force_measured: bool,
    commands: Vec<Command>,
    states: Vec<State>,
    /// `[u, v, r, P_f]` with noise; the force only if it is measured.
    measured: Vec<[f64; 4]>,
}

#[derive(Clone, Copy)]
struct Output {
    name: &'static str,
    unit: &'static str,
    truth: fn(&State) -> f64,
    /// Column of `measured`; `None` for the pose.
    noisy: Option<usize>,
}

const OUTPUTS: [Output; 7] = [
    Output { name: "x", unit: "m", truth: |s| s.x, noisy: None },
    Output { name: "y", unit: "m", truth: |s| s.y, noisy: None },
    Output { name: "psi", unit: "rad", truth: |s| s.psi, noisy: None },
    Output { name: "u", unit: "m/s", truth: |s| s.u, noisy: Some(0) },
    Output { name: "v", unit: "m/s", truth: |s| s.v, noisy: Some(1) },
    Output { name: "r", unit: "rad/s", truth: |s| s.r, noisy: Some(2) },
    Output { name: "P_f", unit: "N", truth: |s| s.p_f, noisy: Some(3) },
];

impl Simulated {
    pub(super) fn new(
        options: &Options,
        vessel: &PropellerRudder,
        commands: Vec<Command>,
        states: Vec<State>,
        measured: Vec<[f64; 4]>,
    ) -> Self {
        Self {
            name: format!("{} (seed {})", options.vessel.name, options.seed),
            dt_s: options.dt_s,
            channels: [vessel.propeller().clone(), vessel.rudder().clone()],
            force_measured: vessel.craft().thrusters[0].force_noise.is_some(),
            commands,
            states,
            measured,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Sample time \[s\].
    pub const fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Time of sample `k` \[s\], rounded to the nearest decimal fraction if the sample rate is a whole number.
    pub fn time(&self, k: usize) -> f64 {
        let rate = 1.0 / self.dt_s;
        if (rate - rate.round()).abs() < 1e-9 * rate { k as f64 / rate.round() } else { k as f64 * self.dt_s }
    }

    /// Channels of the two commands.
    pub const fn command_channels(&self) -> &[CommandInput; 2] {
        &self.channels
    }

    /// Commands, sample by sample.
    pub fn commands(&self) -> &[Command] {
        &self.commands
    }

    /// True states, sample by sample.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// Measured `[u, v, r, P_f]` by sample; the force is valid only with [`force_measured`](Self::force_measured).
    pub fn measured(&self) -> &[[f64; 4]] {
        &self.measured
    }

    /// Whether the propeller force is among the measurements.
    pub const fn force_measured(&self) -> bool {
        self.force_measured
    }

    /// Number of crossings of `level` \[m/s\] by the surge velocity.
    pub fn crossings(&self, level: f64) -> usize {
        self.states.windows(2).filter(|pair| (pair[0].u > level) != (pair[1].u > level)).count()
    }

    /// The run with the measured `outputs` (of `x`, `y`, `psi`, `u`, `v`, `r`, `P_f`), their truth, and both commands.
    ///
    /// # Errors
    /// [`SimulateError::UnknownOutput`] for a column that was not measured.
    pub fn to_trajectory(&self, outputs: &[&str]) -> Result<Trajectory, SimulateError> {
        let columns = outputs.iter().map(|name| self.output(name)).collect::<Result<Vec<_>, _>>()?;
        let channels: Arc<[Channel]> =
            columns.iter().map(|column| Channel::new(column.name, column.unit)).collect();
        let mut measured = Vec::with_capacity(self.len() * columns.len());
        let mut truth = Vec::with_capacity(self.len() * columns.len());
        for (state, noisy) in self.states.iter().zip(&self.measured) {
            for column in &columns {
                let true_value = (column.truth)(state);
                truth.push(true_value);
                measured.push(column.noisy.map_or(true_value, |i| noisy[i]));
            }
        }
        let inputs: Arc<[Channel]> =
            self.channels.iter().map(|c| Channel::new(c.name.as_str(), c.unit.as_str())).collect();
        Ok(Trajectory {
            name: self.name.clone(),
            t0: 0.0,
            dt: self.dt_s,
            outputs: Table::new(Arc::clone(&channels), measured),
            inputs: Table::new(inputs, self.commands.iter().flat_map(|c| [c.pp, c.rd]).collect()),
            truth: Some(Table::new(channels, truth)),
            heading: Some(self.states.iter().map(|state| state.psi).collect()),
            position: Some(self.states.iter().map(|state| [state.x, state.y]).collect()),
        })
    }

    fn output(&self, name: &str) -> Result<Output, SimulateError> {
        let there = || OUTPUTS.into_iter().filter(|o| self.force_measured || o.name != "P_f");
        there().find(|o| o.name == name).ok_or_else(|| SimulateError::UnknownOutput {
            name: name.to_owned(),
            nearest: nearest(name, there().map(|o| o.name)),
            known: there().map(|o| o.name.to_owned()).collect(),
        })
    }
}
