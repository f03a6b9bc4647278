//! Simulated records as CSV files and logs.

use std::io::{self, Write};

use super::record::Simulated;
use crate::log::{Channel, RawLog, Rows};

/// Measured pose and velocities, true velocities and propeller force.
const COLUMNS: [(&str, &str); 10] = [
    ("x", "m"),
    ("y", "m"),
    ("psi", "rad"),
    ("u", "m/s"),
    ("v", "m/s"),
    ("r", "rad/s"),
    ("u_true", "m/s"),
    ("v_true", "m/s"),
    ("r_true", "rad/s"),
    ("P_f_true", "N"),
];

impl Rows for Simulated {
    fn channels(&self) -> Vec<Channel> {
        let commands = self.command_channels().iter().map(|c| Channel::new(c.name.as_str(), c.unit.as_str()));
        let columns = COLUMNS.map(|(name, unit)| Channel::new(name, unit));
        let force = self.force_measured().then(|| Channel::new("P_f", "N"));
        [Channel::new("t", "s")].into_iter().chain(commands).chain(columns).chain(force).collect()
    }

    fn len(&self) -> usize {
        self.states().len()
    }

    fn row(&self, k: usize, values: &mut Vec<f64>) {
        let (command, state, [u, v, r, p_f]) = (self.commands()[k], self.states()[k], self.measured()[k]);
        values.extend([self.time(k), command.pp, command.rd, state.x, state.y, state.psi, u, v, r]);
        values.extend([state.u, state.v, state.r, state.p_f]);
        values.extend(self.force_measured().then_some(p_f));
    }
}

impl Simulated {
    /// Writes the record as CSV: time, commands, measured pose and velocities, true velocities and propeller force,
    /// measured force if any. Numbers are the shortest that read back exactly.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        self.write(writer)
    }

    /// The log that is read from the file of [`write_csv`](Self::write_csv).
    pub fn to_log(&self, name: &str) -> RawLog {
        self.log(name)
    }
}
