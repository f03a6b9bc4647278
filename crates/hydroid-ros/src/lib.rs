//! `hydroid live` as a node of ROS 2: [`main`] is the command `hydroid-ros`.
//!
//! The node speaks DDS itself (`ros2-client`, RustDDS): no installation of ROS is needed. Topics of any type become rows of
//! numbers with the names that a recording has, so that the section `[log]` selects from a graph as from a bag. Messages are
//! recorded with their own types.
//!
//! Order of the modules, each of which imports only modules before it: `names`, `value`, `settings`, `commander`, `link`,
//! `graph`, `outputs`.

#![allow(missing_docs, clippy::missing_errors_doc, reason = "its users are the programs of hydroid")]

pub mod commander;
mod graph;
pub mod link;
pub mod names;
mod outputs;
pub mod settings;
pub mod value;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use clap::{Args as ClapArgs, CommandFactory as _, FromArgMatches as _, Parser};
use hydroid::config;
use hydroid_live::program::file::{self, FromFile};
use hydroid_live::program::{Session, SessionArgs, config_file, interrupt, text};

use self::graph::Graph;
use self::link::RosLink;
use self::names::Names;
use self::outputs::Outputs;
use self::settings::Ros;

/// An example of the configuration file, for a boat with two thrusters.
const EXAMPLE: &str = include_str!("boat.toml");

/// On board as a node of ROS 2: learn from topics, predict, guard, record, show, and steer if allowed
///
/// Topics are named in the section [ros] of the configuration file, sensors and commands in the section [log], as
/// TOPIC.field. Without a model, hydroid records until the data suffice to identify one. Commands are published with
/// --allow-commands only, and end when another node publishes them.
#[derive(Debug, Parser)]
#[command(
    name = "hydroid-ros",
    version,
    about,
    after_help = include_str!("help.txt")
)]
struct Args {
    #[command(flatten)]
    session: SessionArgs,
    #[command(flatten)]
    ros: RosArgs,
}

/// The node.
#[derive(Debug, ClapArgs)]
#[command(next_help_heading = "ROS 2")]
struct RosArgs {
    /// Show warnings and errors only
    #[arg(long, short)]
    quiet: bool,
}

/// Runs the command with the arguments of the process.
pub fn main() -> ExitCode {
    hydroid::key::spell_as_arguments();
    let (names, words) = match Names::read(std::env::args_os()) {
        Ok(read) => read,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::from(2);
        }
    };
    interrupt::catch_interrupt();
    match parse(words, &names.unset).and_then(|args| run(&args, names)) {
        Ok(code) => code,
        Err(error) => {
            text::print_error(&error);
            ExitCode::from(if interrupt::interrupted() { 130 } else { 2 })
        }
    }
}

/// The arguments with those of the section `[live]` of the configuration file, but for the flags of `unset`.
fn parse(words: Vec<OsString>, unset: &[String]) -> anyhow::Result<Args> {
    let command = Args::command();
    // Required options may be in the file.
    let given = command.clone().ignore_errors(true).try_get_matches_from(&words).ok();
    let stated = given.as_ref().and_then(|given| Args::from_arg_matches(given).ok()?.session.config);
    let path = stated.or_else(|| Path::new(config::FILE).exists().then(|| config::FILE.into()));
    let from_file = match (&given, path) {
        (Some(_), Some(path)) => {
            let mut arguments = file::section(&command, command.get_name(), "live", &path, given.as_ref())?;
            arguments.retain(|word| !unset.iter().any(|name| word.to_str() == Some(&format!("--{name}"))));
            Some(FromFile { path, verb: "live", arguments })
        }
        _ => None,
    };
    file::parse(&command, words, from_file, 1)
}

fn run(args: &Args, names: Names) -> anyhow::Result<ExitCode> {
    if args.session.print_config {
        text::write_out(format_args!("{}\n", EXAMPLE.trim_end()));
        return Ok(ExitCode::SUCCESS);
    }
    anyhow::ensure!(
        args.session.time_scale == 1.0,
        "--time-scale {}: the stamps of messages are those of the clock",
        args.session.time_scale
    );
    let file = config_file(&args.session, "hydroid-ros")?;
    let ros = Ros::read(&file)?;
    let topics = ros.subscribed()?;
    let domain = graph::domain()?;
    let commands = &args.session.commands;
    let options = commander::Options {
        may_command: commands.allow_commands,
        is_dry_run: commands.dry_run,
        enable: ros.enable.clone(),
    };
    let link = RosLink::new(topics.clone(), options, domain);
    let commanded = link.commanded();
    let mut graph = Graph::join(names, domain)?;
    let mut outputs = Outputs::new(&mut graph, &ros, &args.session.horizons)?;
    let session = Session { args: &args.session, file, address: format!("ROS 2, domain {domain}") };
    let mut graph = Some(graph);
    let open = move |clock| {
        Box::new(move || {
            let graph = graph.take().ok_or_else(|| std::io::Error::other("the graph was left"))?;
            let commanded = commanded.get().map(Vec::as_slice).unwrap_or_default();
            graph.port(&topics, commanded, clock).map_err(std::io::Error::other)
        }) as Box<_>
    };
    match session.run(link, open, args.ros.quiet, &mut |boat, now_ns| outputs.publish(boat, now_ns))? {}
}
