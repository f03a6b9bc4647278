//! `hydroid convert`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use hydroid::atomic;
use hydroid::config::{self, Config};
use hydroid::log::{Note, RawLog};
use hydroid::recording;
use serde_json::json;

use super::Outcome;
use crate::args::{Convert, Global};
use crate::{logs, outputs, ui};

pub fn run(args: &Convert, global: Global) -> anyhow::Result<Outcome> {
    let config = match &args.config {
        Some(file) => Some(file.clone()),
        None => Some(PathBuf::from(config::FILE)).filter(|file| file.exists()),
    };
    let config = match &config {
        Some(file) => {
            if args.config.is_none() {
                let note = Note::info(format!("options from {} in the current folder", config::FILE));
                ui::print_notes(&[note], global);
            }
            config::read(file).context("the configuration file cannot be used")?
        }
        None => Config::default(),
    };
    let reading = logs::reading(config.log.reading(), &args.log)?;
    let files = targets(&args.logs, &args.output)?;
    for target in &files {
        let read: Vec<&Path> = args.logs.iter().map(PathBuf::as_path).collect();
        outputs::check(&[("-o", Some(target))], &read)?;
    }
    let (raw, mut notes) = recording::read_logs(&args.logs, &reading.selection, reading.options.dt)?;
    let converted = raw
        .iter()
        .map(|log| recording::converted(log, &reading.selection, &mut notes))
        .collect::<Result<Vec<RawLog>, _>>()?;
    ui::print_notes(&notes, global);
    for (target, log) in files.iter().zip(&converted) {
        atomic::write(target, |out| log.write_csv(out))?;
    }
    let summary: Vec<_> = files
        .iter()
        .zip(&converted)
        .map(|(file, log)| {
            let columns: Vec<String> = log.columns.iter().map(|column| column.name.clone()).collect();
            json!({ "log": log.path, "file": file, "rows": log.rows(), "columns": columns })
        })
        .collect();
    if global.json {
        super::print_json(&summary)?;
    } else {
        for (file, log) in files.iter().zip(&converted) {
            let columns: Vec<&str> = log.columns.iter().map(|column| column.name.as_str()).collect();
            outln!("{}: {} rows of {}", file.display(), log.rows(), columns.join(", "));
        }
    }
    Ok(Outcome::Done)
}

/// The files to write: the output, or, for several logs, files with their names in the folder of this name.
fn targets(logs: &[PathBuf], output: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let is_csv = output.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    if let [_] = logs
        && !output.is_dir()
    {
        ensure!(is_csv, "{}: runs are written as CSV; give -o a name that ends in .csv", output.display());
        return Ok(vec![output.to_owned()]);
    }
    ensure!(!is_csv, "{} is one file for {} logs; give -o a folder", output.display(), logs.len());
    let name = |log: &PathBuf| {
        let name = log.canonicalize().unwrap_or_else(|_| log.clone());
        let stem = if name.is_dir() { name.file_name() } else { name.file_stem() };
        output.join(format!("{}.csv", stem.unwrap_or_default().to_string_lossy()))
    };
    let targets: Vec<PathBuf> = logs.iter().map(name).collect();
    for (i, target) in targets.iter().enumerate() {
        ensure!(
            !targets[..i].contains(target),
            "two of the logs would be written to {}; convert them one by one",
            target.display()
        );
    }
    Ok(targets)
}
