//! A session on board over any link: settings from arguments and the configuration file, page, identification beside it.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use clap::{CommandFactory, FromArgMatches};
use hydroid::config::{self, Config};
use hydroid::log::ChannelSpec;
use hydroid::model;
use hydroid_live::boat::{
    Boat, ExperimentLimits, Identified, Identify, Level, Open, Said, Service, Settings,
};
use hydroid_live::link::{Link, Port, UtcClock};
use hydroid_live::page::{self, Page};

pub use crate::args::SessionArgs;
use crate::args::{self, FromFile};
pub use crate::commands::Outcome;
use crate::{commands, ui};

/// Runs a program of one command: its arguments with those of the section `[live]` of its configuration file, but for flags
/// that are switched off, its errors on standard error, and its exit status.
pub fn program<A: CommandFactory + FromArgMatches>(
    words: &[OsString],
    unset: &[String],
    session: impl FnOnce(&A) -> &SessionArgs,
    run: impl FnOnce(&A) -> anyhow::Result<Outcome>,
) -> std::process::ExitCode {
    ui::catch_interrupt();
    let command = A::command();
    let name = command.get_name().to_owned();
    let of_file = || {
        // Required options may be in the file.
        let Ok(matches) = command.clone().ignore_errors(true).try_get_matches_from(words) else {
            return Ok(None);
        };
        let given = A::from_arg_matches(&matches).ok();
        let stated = given.as_ref().and_then(|args| session(args).config.clone());
        let path = stated.or_else(|| Path::new(config::FILE).exists().then(|| config::FILE.into()));
        let Some(path) = path else { return Ok(None) };
        let mut arguments = args::file::section(&command, &name, "live", &path, Some(&matches))?;
        arguments.retain(|word| !unset.iter().any(|name| word.to_str() == Some(&format!("--{name}"))));
        anyhow::Ok(Some(FromFile { path, verb: "live", arguments }))
    };
    let done =
        of_file().and_then(|file| args::parse(&command, words.to_vec(), file, 1)).and_then(|args| run(&args));
    match done {
        Ok(outcome) => outcome.into(),
        Err(error) => {
            ui::print_error(&error);
            std::process::ExitCode::from(if ui::interrupted() { 130 } else { 2 })
        }
    }
}

/// Prints a text on standard output.
pub fn print(text: &str) {
    outln!("{text}");
}

/// The configuration file of a session.
///
/// # Errors
/// If there is none.
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
///
/// # Errors
/// If it is none.
pub fn check_positive(name: &str, value: f64) -> anyhow::Result<()> {
    ensure!(value > 0.0 && value.is_finite(), "--{name} {value}: a positive number is needed");
    Ok(())
}

/// What a session needs beside its link.
#[derive(Clone, Debug)]
pub struct Session<'a> {
    /// Arguments.
    pub args: &'a SessionArgs,
    /// Configuration file.
    pub file: PathBuf,
    /// Address of the link, for people.
    pub address: String,
}

impl Session<'_> {
    /// Runs until ctrl-C; the program ends with it. `each` is called with each turn of the loop and the present time.
    ///
    /// # Errors
    /// If settings, model, page or link cannot be used.
    pub fn run<L: Link, P: Port<Message = L::Message>>(
        &self,
        link: L,
        open: impl FnOnce(UtcClock) -> Open<P>,
        quiet: bool,
        each: &mut dyn FnMut(&Boat<L>, i64),
    ) -> anyhow::Result<Outcome> {
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
        boat.identify_by(identification(file.clone(), Arc::clone(&stop)));
        if let Some(name) = &args.commands.experiment {
            boat.plan_experiment(name).map_err(anyhow::Error::msg)?;
        }
        let page = (!args.web.no_page).then(|| page(args)).transpose()?;
        if let Some((page, token)) = &page {
            eprintln!("page: http://{}/#token={token}", page.0.address());
        }
        let mut service = Service::open(boat, open(clock), clock, page.map(|(page, _)| page))?;
        // Commands are released first, and then the recording is closed.
        ui::grant(Duration::from_secs(10));
        let ended = Arc::clone(&stop);
        ui::at_interrupt(move || ended.store(true, Ordering::SeqCst));
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
    let mut reading = config.log.reading();
    if reading.selection.outputs.is_empty() {
        reading.selection.outputs = ["u", "v", "r"].map(ChannelSpec::named).to_vec();
    }
    let mut limits = std::collections::BTreeMap::new();
    for given in &args.commands.limit {
        ensure!(given.range.unit.is_none(), "--limit {}: limits are in the unit of the model", given.name);
        limits.insert(given.name.clone(), [given.range.low, given.range.high]);
    }
    let control = commands::control::options::of(&args::control_of(file)?);
    Ok(Settings {
        address: address.to_owned(),
        selection: reading.selection,
        folder: args.output.clone(),
        records: !args.no_record,
        horizons_s: args.horizons.clone(),
        is_dry_run: args.commands.dry_run,
        limits,
        push: args.commands.push.clone(),
        turn: args.commands.turn.clone(),
        experiment: ExperimentLimits {
            fence_m: args.commands.fence,
            centre_deg: args.commands.fence_centre.map(|centre| centre.0),
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

/// `hydroid identify` as another process, which cannot delay the commands.
fn identification(config: PathBuf, stop: Arc<AtomicBool>) -> Identify {
    Arc::new(move |recordings, folder| {
        identify(&config, recordings, folder, &stop).map_err(|error| ui::error_text(&error))
    })
}

/// The command `hydroid`: this program, that in its folder, or that of the search path.
fn command() -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe().context("the program does not find itself")?;
    if own.file_stem().is_some_and(|name| name == "hydroid") {
        return Ok(own);
    }
    let beside = own.with_file_name(format!("hydroid{}", std::env::consts::EXE_SUFFIX));
    Ok(if beside.exists() { beside } else { "hydroid".into() })
}

fn identify(
    config: &Path,
    recordings: &[PathBuf],
    folder: &Path,
    stop: &AtomicBool,
) -> anyhow::Result<Identified> {
    let program = command()?;
    let output = free_folder(folder);
    let mut child = Command::new(program)
        .arg("identify")
        .args(recordings)
        .arg("--config")
        .arg(config)
        .arg("-o")
        .arg(&output)
        .args(["--quiet", "--threads", "1"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .context("the command hydroid cannot be started: install hydroid-cli")?;
    let said = child.stderr.take();
    let said = std::thread::spawn(move || {
        said.map(|mut said| {
            let mut text = Vec::new();
            let _ = std::io::Read::read_to_end(&mut said, &mut text);
            String::from_utf8_lossy(&text).into_owned()
        })
    });
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if stop.load(Ordering::SeqCst) {
            let _ = child.kill();
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    let said = said.join().ok().flatten().unwrap_or_default();
    // 1: it was identified, and is not usable by the criteria of the report, which the crew reads.
    if !matches!(status.code(), Some(0 | 1)) {
        bail!("{}", said.trim().trim_start_matches("error: "));
    }
    let text = std::fs::read_to_string(output.join("identify.json"))?;
    let summary: serde_json::Value = serde_json::from_str(&text)?;
    let models = summary["models"].as_array().map(Vec::as_slice).unwrap_or_default();
    let best = models.iter().find(|model| model["name"] == summary["best"]).or(models.first());
    let best = best.context("the identification has no model")?;
    let name = best["file"].as_str().context("the model has no file")?;
    let path = output.join(Path::new(name).file_name().unwrap_or_default());
    let model = model::read(&path)?;
    Ok(Identified { name: path.display().to_string(), model, text: grades(&summary) })
}

/// A folder that does not exist yet.
fn free_folder(folder: &Path) -> PathBuf {
    let mut all = (1..100_000).map(|k| folder.join(format!("model-{k}")));
    all.find(|path| !path.exists()).unwrap_or_else(|| folder.join("model"))
}

/// Grades and errors of the outputs.
fn grades(summary: &serde_json::Value) -> String {
    let verdicts = summary["verdicts"].as_array().map(Vec::as_slice).unwrap_or_default();
    let of = |verdict: &serde_json::Value| {
        Some(format!(
            "{} {} (NRMSE {:.3})",
            verdict["channel"].as_str()?,
            verdict["grade"].as_str()?.replace('_', " "),
            verdict["nrmse"].as_f64()?
        ))
    };
    verdicts.iter().filter_map(of).collect::<Vec<_>>().join(", ")
}
