//! A session on board over any link: settings from arguments and the configuration file, page, identification beside it.

use std::convert::Infallible;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use hydroid::config::{self, Config};
use hydroid::log::ChannelSpec;
use hydroid::model;

use super::arguments::SessionArgs;
use super::{file, identification, interrupt};
use crate::boat::{Boat, ExperimentLimits, Level, Open, Said, Service, Settings};
use crate::link::{Link, Port, UtcClock};
use crate::page::{self, Page};

/// The configuration file of a session.
pub fn config_file(args: &SessionArgs, program: &str) -> anyhow::Result<PathBuf> {
    match &args.config {
        Some(file) => Ok(file.clone()),
        None if Path::new(config::FILE).exists() => Ok(PathBuf::from(config::FILE)),
        None => bail!(
            "no configuration: name one with -c, or write an example with `{program} --print-config > {}`",
            config::FILE
        ),
    }
}

/// Refuses the value of an option that is no positive number.
pub fn check_positive(name: &str, value: f64) -> anyhow::Result<()> {
    ensure!(value > 0.0 && value.is_finite(), "--{name} {value}: a positive number is needed");
    Ok(())
}

/// What a session needs beside its link.
#[derive(Clone, Debug)]
pub struct Session<'a> {
    pub args: &'a SessionArgs,
    pub file: PathBuf,
    /// Address of the link, for people.
    pub address: String,
}

impl Session<'_> {
    /// Runs until ctrl-C; the program ends with it. `each` is called with each turn of the loop and the present time.
    pub fn run<L: Link, P: Port<Message = L::Message>>(
        &self,
        link: L,
        open: impl FnOnce(UtcClock) -> Open<P>,
        quiet: bool,
        each: &mut dyn FnMut(&Boat<L>, i64),
    ) -> anyhow::Result<Infallible> {
        let Self { args, file, address } = self;
        let config = config::read(file).context("the configuration file cannot be used")?;
        let settings = settings(args, address, config, file)?;
        let clock = UtcClock::start(args.time_scale);
        let mut boat = Boat::new(settings, link, clock.now_ns())
            .with_context(|| format!("the section [log] of {} cannot be used", file.display()))?;
        if args.model != Path::new("new") {
            let read = model::read(&args.model)?;
            let name = args.model.display().to_string();
            boat.take_on(&name, &read).with_context(|| format!("{name} cannot be taken on board"))?;
        }
        let stop = Arc::new(AtomicBool::new(false));
        boat.identify_by(identification::by_command(file.clone(), Arc::clone(&stop)));
        if let Some(name) = &args.commands.experiment {
            boat.plan_experiment(name).map_err(anyhow::Error::msg)?;
        }
        let page = (!args.web.no_page).then(|| page(args)).transpose()?;
        if let Some((page, token)) = &page {
            eprintln!("page: http://{}/#token={token}", page.0.address());
        }
        let mut service = Service::open(boat, open(clock), clock, page.map(|(page, _)| page))?;
        // Commands are released first, and then the recording is closed.
        interrupt::grant(Duration::from_secs(10));
        let ended = Arc::clone(&stop);
        interrupt::at_interrupt(move || ended.store(true, Ordering::SeqCst));
        service.run(&stop, |said| tell(said, quiet), each);
        // Everything is written; as every command that is interrupted.
        std::process::exit(130)
    }
}

fn settings(args: &SessionArgs, address: &str, config: Config, file: &Path) -> anyhow::Result<Settings> {
    for (name, value) in [
        ("fence", args.commands.fence),
        ("max-speed", args.commands.max_speed),
        ("max-yaw-rate", args.commands.max_yaw_rate),
        ("duration", args.commands.duration),
        ("time-scale", args.time_scale),
    ] {
        check_positive(name, value)?;
    }
    for horizon in &args.horizons {
        check_positive("horizons", *horizon)?;
    }
    let mut reading = config.reading()?;
    if reading.selection.outputs.is_empty() {
        reading.selection.outputs = ["u", "v", "r"].map(ChannelSpec::named).to_vec();
    }
    let mut limits = std::collections::BTreeMap::new();
    for (name, range) in &args.commands.limit {
        ensure!(range.unit.is_none(), "--limit {name}: limits are in the unit of the model");
        limits.insert(name.clone(), [range.low, range.high]);
    }
    let control = file::control_of(file)?.options;
    Ok(Settings {
        address: address.to_owned(),
        selection: reading.selection,
        folder: args.output.clone(),
        records: !args.no_record,
        horizons_s: args.horizons.clone(),
        is_dry_run: args.commands.dry_run,
        boat: config.boat,
        limits,
        neutral: args.commands.neutral.iter().cloned().collect(),
        push: args.commands.push.clone(),
        turn: args.commands.turn.clone(),
        experiment: ExperimentLimits {
            fence_m: args.commands.fence,
            centre_deg: args.commands.fence_centre,
            max_speed_m_s: args.commands.max_speed,
            max_yaw_rate_rad_s: args.commands.max_yaw_rate.to_radians(),
            duration_s: args.commands.duration,
            seed: args.commands.seed,
        },
        time_scale: args.time_scale,
        control,
    })
}

type Opened = (Page, std::sync::mpsc::Receiver<page::Request>);

/// The page and its token.
fn page(args: &SessionArgs) -> anyhow::Result<(Opened, String)> {
    let given = args.web.token.clone().or_else(|| std::env::var("HYDROID_TOKEN").ok());
    let token = match given {
        Some(token) => token,
        None => page::random_token()?,
    };
    let options =
        page::Options { address: args.web.page, token: token.clone(), names: args.web.host_names.clone() };
    let opened = Page::start(options, page::ASSETS).map_err(|error| {
        let is_option = error.kind() == ErrorKind::InvalidInput;
        let error = anyhow::Error::from(error);
        if is_option {
            return error;
        }
        error.context(format!(
            "the page cannot be served at {}: name another address with --page",
            args.web.page
        ))
    })?;
    Ok((opened, token))
}

fn tell(said: &Said, quiet: bool) {
    if said.level != Level::Info || !quiet {
        let text = hydroid::recording::time_text(said.at_ns as f64 / 1e9);
        let level = if said.level == Level::Info { "" } else { said.level.name() };
        let colon = if level.is_empty() { "" } else { ": " };
        eprintln!("{text} {level}{colon}{}", said.text);
    }
}
