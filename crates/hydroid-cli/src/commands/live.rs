//! `hydroid live`.

use hydroid_live::link::mavlink::port::Port;
use hydroid_live::link::mavlink::transport::Address;
use hydroid_live::link::mavlink::{MavLink, Settings};
use hydroid_live::program::{Session, check_positive, config_file};

use super::Outcome;
use crate::args::{Global, Live};

/// An example of the configuration file, for ArduPilot Rover.
const EXAMPLE: &str = include_str!("live/boat.toml");

pub fn run(args: &Live, global: Global) -> anyhow::Result<Outcome> {
    if args.session.print_config {
        outln!("{}", EXAMPLE.trim_end());
        return Ok(Outcome::Done);
    }
    let file = config_file(&args.session, "hydroid live")?;
    let address: Address = args.link.parse().map_err(anyhow::Error::msg)?;
    check_positive("rate", args.rate)?;
    let system = args.system;
    let link = MavLink::new(Settings {
        system,
        own_system: args.own_system,
        rate_hz: args.rate,
        may_command: args.session.commands.allow_commands,
        is_dry_run: args.session.commands.dry_run,
    });
    let session = Session { args: &args.session, file, address: args.link.clone() };
    let open = move |clock| Box::new(move || Port::open(&address, system, clock)) as Box<_>;
    match session.run(link, open, global.quiet, &mut |_, _| {})? {}
}
