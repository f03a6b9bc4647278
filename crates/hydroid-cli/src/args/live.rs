//! Arguments of `hydroid live`.

use clap::Args as ClapArgs;

use hydroid_live::program::SessionArgs;

/// On board: learn from an autopilot, predict, guard, record, show, and steer if allowed
///
/// The autopilot speaks MAVLink (ArduPilot Rover; others can be read). Sensors and commands are selected in the section [log]
/// of the configuration file, with the names of the messages. Without a model, hydroid records until the data suffice to
/// identify one. Commands are sent with --allow-commands only, after checks, and end when the pilot changes the mode.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/live.txt"))]
pub struct Live {
    #[command(flatten)]
    pub session: SessionArgs,
    /// Link to the autopilot: udpin:ADDRESS:PORT (it sends to this port), udpout:ADDRESS:PORT, tcp:ADDRESS:PORT,
    /// serial:DEVICE:BAUD
    #[arg(long, default_value = "udpin:0.0.0.0:14550", value_name = "LINK")]
    pub link: String,
    /// System id of the autopilot (default: the first that is heard)
    #[arg(long, value_name = "ID")]
    pub system: Option<u8>,
    /// Own system id; ArduPilot takes commands from that of its ground station only
    #[arg(long, default_value_t = 255, value_name = "ID")]
    pub own_system: u8,
    /// Rate of the messages that the autopilot is asked for [Hz]
    #[arg(long, default_value_t = 20.0, value_name = "HZ")]
    pub rate: f64,
}
