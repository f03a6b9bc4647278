//! `hydroid convert`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use hydroid::atomic;
use hydroid::config::{self, Config};
use hydroid::log::{Note, RawLog, TableFormat};
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
    let mut reading = args.log.clone().over(config.reading()?, &config.boat)?;
    let (files, format) = targets(&args.logs, &args.output)?;
    for target in &files {
        let read: Vec<&Path> = args.logs.iter().map(PathBuf::as_path).collect();
        outputs::check(&[("-o", Some(target))], &read)?;
    }
    let (raw, mut notes) = logs::read(&args.logs, &mut reading, global)?;
    let converted = raw
        .iter()
        .map(|log| recording::converted(log, &reading.selection, &mut notes))
        .collect::<Result<Vec<RawLog>, _>>()?;
    ui::print_notes(&notes, global);
    for (target, log) in files.iter().zip(&converted) {
        atomic::write(target, |out| log.write_as(format, out))?;
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

/// Stands for the name of each log in the name of the output.
const NAME: &str = "{}";

/// The files to write and their format, which the extension of the output names. A folder, or a name without such an
/// extension for several logs, is a folder of CSV files with the names of the logs.
fn targets(logs: &[PathBuf], output: &Path) -> anyhow::Result<(Vec<PathBuf>, TableFormat)> {
    let several = logs.len() > 1;
    let named = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let new_folder = several && TableFormat::of(output).is_none() && !named(output).contains(NAME);
    let pattern =
        if output.is_dir() || new_folder { output.join(format!("{NAME}.csv")) } else { output.to_owned() };
    let format = TableFormat::of(&pattern).with_context(|| {
        format!(
            "{}: runs are written as CSV or Parquet; give -o a name that ends in .csv or .parquet",
            output.display()
        )
    })?;
    let file = named(&pattern);
    ensure!(
        !several || file.contains(NAME),
        "{} is one file for {} logs; give -o a folder, or a name with {NAME} for those of the logs, as {}",
        output.display(),
        logs.len(),
        output.with_file_name(format!("{NAME}-{file}")).display()
    );
    let name = |log: &PathBuf| {
        let name = log.canonicalize().unwrap_or_else(|_| log.clone());
        let stem = if name.is_dir() { name.file_name() } else { name.file_stem() };
        pattern.with_file_name(file.replace(NAME, &stem.unwrap_or_default().to_string_lossy()))
    };
    let targets: Vec<PathBuf> = logs.iter().map(name).collect();
    for (i, target) in targets.iter().enumerate() {
        ensure!(
            !targets[..i].contains(target),
            "two of the logs would be written to {}; convert them one by one",
            target.display()
        );
    }
    Ok((targets, format))
}
