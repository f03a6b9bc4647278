//! Adaptation with and without the guard on days with drawn faults, and on clean days: see `src/guard`.

use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::Parser;
use hydroid::log::{self, Trajectory};
use hydroid::{atomic, model};
use hydroid_research::guard::{self, Campaign, Case, DayResult};
use hydroid_study::Store;

/// Adaptation with and without the guard. Each seed is a day: it draws a model, a log, one or two faults, and the options
/// of the learner. FOLDER/days.csv has a row for each day, FOLDER/cache the built-in models.
#[derive(Parser)]
struct Args {
    /// Seeds of the days: the first and the one after the last
    #[arg(long, value_name = "A..B", default_value = "1..101", value_parser = seeds)]
    seeds: Range<u64>,
    /// Models in place of the built-in ones; each follows every log
    #[arg(long, value_name = "MODEL", requires = "logs")]
    model: Vec<PathBuf>,
    /// Logs that the models did not learn from
    #[arg(long = "log", value_name = "LOG", requires = "model")]
    logs: Vec<PathBuf>,
    /// Only bad days
    #[arg(long)]
    no_clean: bool,
    /// Search for the worst faults of sensors: number of generations of each search
    #[arg(long, value_name = "GENERATIONS", conflicts_with = "no_clean")]
    adversary: Option<usize>,
    /// Short trainings of the built-in models
    #[arg(long, conflicts_with = "model")]
    quick: bool,
    /// Folder of days.csv and of the cache
    #[arg(long, short, value_name = "FOLDER", default_value = "guard-study")]
    output: PathBuf,
    /// The summary and all days as JSON
    #[arg(long)]
    json: bool,
}

fn seeds(text: &str) -> anyhow::Result<Range<u64>> {
    let (first, end) = text.split_once("..").context("give A..B")?;
    let seeds = first.parse()?..end.parse()?;
    ensure!(!seeds.is_empty(), "there are no seeds");
    Ok(seeds)
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    atomic::probe(&args.output)?;
    let _lock = atomic::Lock::new(&args.output)?;
    let cases = if args.model.is_empty() {
        guard::built_in(args.quick, &Store::new(args.output.join("cache"), hydroid_study::program()))?
    } else {
        args.model.iter().map(|path| case(path, &args.logs)).collect::<anyhow::Result<_>>()?
    };
    let campaign = match args.adversary {
        Some(generations) => guard::adversary(&cases, args.seeds, generations)?,
        None => guard::campaign(&cases, args.seeds, !args.no_clean)?,
    };
    let path = args.output.join("days.csv");
    atomic::write(&path, |out| out.write_all(table(&campaign).as_bytes()))?;
    let summary = guard::summary(&campaign);
    if args.json {
        let report = serde_json::json!({ "summary": summary, "days": campaign });
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        println!("{summary}\n{}", path.display());
    }
    Ok(())
}

fn case(path: &Path, logs: &[PathBuf]) -> anyhow::Result<Case> {
    let model = model::read(path)?;
    let reading = &model.description.reading;
    let mut runs: Vec<Trajectory> = Vec::new();
    for given in logs {
        let raw = log::read(given)?;
        let prepared = log::prepare(&[raw], &reading.selection, &reading.options)
            .with_context(|| format!("{} cannot be used with {}", given.display(), path.display()))?;
        runs.extend(prepared.runs);
    }
    model.check(&runs)?;
    Ok(Case::new(path.display().to_string(), model, &runs))
}

/// A text as a cell of a CSV file.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

fn table(campaign: &Campaign) -> String {
    let mut text = String::from(
        "seed,case,kind,log,faults,reference,unguarded,guarded,excess_unguarded,excess_guarded,false_alarms,sound,spikes,spikes_found,jumps,jumps_held,stuck,stuck_found,longest_hold,trusts,during_unguarded,during_guarded,soon_unguarded,soon_guarded,later_unguarded,later_guarded\n",
    );
    for day in campaign.bad.iter().chain(&campaign.clean) {
        let DayResult {
            errors: [reference, alone, guarded],
            excess,
            false_alarms,
            spikes,
            jumps_held,
            stuck,
            longest_hold,
            trusts,
            during,
            soon,
            later,
            ..
        } = day;
        let seed = day.seed.map(|seed| seed.to_string()).unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{seed},{},{},{},{},{reference},{alone},{guarded},{},{},",
            quoted(&day.case),
            day.kind,
            quoted(&day.log),
            quoted(&day.faults),
            excess[0],
            excess[1],
        );
        let counts = [
            false_alarms[1],
            false_alarms[0],
            spikes[0],
            spikes[1],
            jumps_held[0],
            jumps_held[1],
            stuck[0],
            stuck[1],
            *longest_hold,
            *trusts,
        ];
        let counts: Vec<String> = counts.iter().map(ToString::to_string).collect();
        text.push_str(&counts.join(","));
        for error in [during, soon, later].into_iter().flatten() {
            let _ = write!(text, ",{error}");
        }
        text.push('\n');
    }
    text
}
