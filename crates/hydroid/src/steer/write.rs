//! A voyage as a log.

use std::io::{self, BufWriter, Write};

use hydroid_core::vessel::VesselParams;

use super::sail::Voyage;
use crate::simulate::Shortest;

impl Voyage {
    /// Writes the voyage as CSV, in the columns of a simulated log and so fit to be identified from: time, commands as they
    /// were given, pose, velocities over ground as measured and as they were, the force of the propeller. Behind them where to
    /// be, how far off, and the status.
    ///
    /// # Errors
    /// What the writer says.
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
        for moment in &self.moments {
            let ([pp, rd], state, [u, v, r, p_f]) = (moment.command, &moment.state, moment.measured);
            write!(out, "{}", Shortest(moment.t))?;
            let mut row =
                |values: &[f64]| values.iter().try_for_each(|value| write!(out, ",{}", Shortest(*value)));
            row(&[pp, rd, state.x, state.y, state.psi, u, v, r, state.u, state.v, state.r, state.p_f])?;
            if force {
                row(&[p_f])?;
            }
            let reference = &moment.reference;
            let [x, y] = reference.position;
            row(&[x, y, reference.course, reference.speed])?;
            row(&[moment.distance, moment.cross_track, moment.speed_error])?;
            writeln!(out, ",{}", moment.status)?;
        }
        out.flush()
    }
}
