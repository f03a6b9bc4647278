//! CSV file of a simulated record.

use std::fmt;
use std::io::{self, BufWriter, Write};

use super::record::Simulated;

impl Simulated {
    /// Writes the record as CSV: time, commands, measured pose and velocities, true velocities and propeller force,
    /// measured force if any. Numbers are the shortest that read back exactly.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 16, writer);
        let [propeller, rudder] = self.command_channels();
        write!(
            out,
            "t [s],{} [{}],{} [{}],x [m],y [m],psi [rad],u [m/s],v [m/s],r [rad/s],\
             u_true [m/s],v_true [m/s],r_true [rad/s],P_f_true [N]",
            propeller.name, propeller.unit, rudder.name, rudder.unit
        )?;
        writeln!(out, "{}", if self.force_measured() { ",P_f [N]" } else { "" })?;
        for (k, ((command, state), measured)) in
            self.commands().iter().zip(self.states()).zip(self.measured()).enumerate()
        {
            write!(out, "{}", Shortest(self.time(k)))?;
            let [u, v, r, p_f] = *measured;
            for value in [
                command.pp, command.rd, state.x, state.y, state.psi, u, v, r, state.u, state.v, state.r,
                state.p_f,
            ] {
                write!(out, ",{}", Shortest(value))?;
            }
            if self.force_measured() {
                write!(out, ",{}", Shortest(p_f))?;
            }
            writeln!(out)?;
        }
        out.flush()
    }
}

/// Shortest decimal that reads back exactly, with an exponent for very small numbers.
pub(crate) struct Shortest(pub(crate) f64);

impl fmt::Display for Shortest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        if value == 0.0 || (1e-5..1e16).contains(&value.abs()) {
            value.fmt(f)
        } else {
            fmt::LowerExp::fmt(&value, f)
        }
    }
}
