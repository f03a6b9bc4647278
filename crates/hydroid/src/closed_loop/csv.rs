//! CSV file of a run.

use std::io::{self, BufWriter, Write};

use hydroid_core::vessel::VesselParams;

use super::run::Run;
use crate::simulate::Shortest;

impl Run {
    /// Writes the run as CSV with the columns of a simulated log, so that a model can be identified from it: time,
    /// commands, pose, measured and true velocities over ground, propeller force; then reference, errors and status.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, vessel: &VesselParams, writer: impl Write) -> io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 16, writer);
        let [propeller, rudder] = [&vessel.commands.propeller, &vessel.commands.rudder];
        write!(
            out,
            "t [s],{} [{}],{} [{}],x [m],y [m],psi [rad],u [m/s],v [m/s],r [rad/s],\
             u_true [m/s],v_true [m/s],r_true [rad/s],P_f_true [N]",
            propeller.name, propeller.unit, rudder.name, rudder.unit
        )?;
        let force = vessel.propeller.force_measured;
        write!(out, "{}", if force { ",P_f [N]" } else { "" })?;
        writeln!(
            out,
            ",x_ref [m],y_ref [m],course_ref [rad],speed_ref [m/s],distance [m],cross_track [m],speed_error [m/s],status"
        )?;
        for sample in &self.samples {
            let ([pp, rd], state, [u, v, r, p_f]) = (sample.command, &sample.state, sample.measured);
            write!(out, "{}", Shortest(sample.t))?;
            let mut row =
                |values: &[f64]| values.iter().try_for_each(|value| write!(out, ",{}", Shortest(*value)));
            row(&[pp, rd, state.x, state.y, state.psi, u, v, r, state.u, state.v, state.r, state.p_f])?;
            if force {
                row(&[p_f])?;
            }
            let reference = &sample.reference;
            let [x, y] = reference.position;
            row(&[x, y, reference.course, reference.speed])?;
            row(&[sample.distance, sample.cross_track, sample.speed_error])?;
            writeln!(out, ",{}", sample.status)?;
        }
        out.flush()
    }
}
