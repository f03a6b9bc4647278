//! CSV file of a run.

use std::io::{self, BufWriter, Write};

use super::run::Run;
use crate::log::Shortest;

impl Run {
    /// Writes the run as CSV with the columns of a simulated log, so that a model can be identified from it: time,
    /// commands, pose, measured and true outputs over ground; then reference, errors and status.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 16, writer);
        write!(out, "t [s]")?;
        self.inputs.iter().try_for_each(|channel| write!(out, ",{}", channel.heading("")))?;
        write!(out, ",x [m],y [m],psi [rad]")?;
        let measured = &self.outputs[..self.measured_outputs];
        measured.iter().try_for_each(|channel| write!(out, ",{}", channel.heading("")))?;
        self.outputs.iter().try_for_each(|channel| write!(out, ",{}", channel.heading("_true")))?;
        writeln!(
            out,
            ",x_ref [m],y_ref [m],course_ref [rad],speed_ref [m/s],distance [m],cross_track [m],speed_error [m/s],status"
        )?;
        for (k, sample) in self.samples.iter().enumerate() {
            write!(out, "{}", Shortest(sample.t))?;
            let reference = &sample.reference;
            let [x, y] = reference.position;
            let last = [
                x,
                y,
                reference.course,
                reference.speed,
                sample.distance,
                sample.cross_track,
                sample.speed_error,
            ];
            let row = self.command(k).iter().chain(&sample.eta).chain(self.measured(k)).chain(self.truth(k));
            row.chain(&last).try_for_each(|value| write!(out, ",{}", Shortest(*value)))?;
            writeln!(out, ",{}", sample.status)?;
        }
        out.flush()
    }
}
