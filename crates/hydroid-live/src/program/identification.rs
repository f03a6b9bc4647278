//! Identification beside a session: `hydroid identify`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context as _, bail};
use hydroid::model;
use serde::Deserialize;

use super::text::error_text;
use crate::boat::{Identified, Identify};

/// What is read of `identify.json`.
#[derive(Debug, Deserialize)]
struct Summary {
    best: Option<String>,
    #[serde(default)]
    models: Vec<Candidate>,
    #[serde(default)]
    verdicts: Vec<Verdict>,
    not_enough_data: Option<NotEnough>,
    for_trials: Option<ForTrials>,
}

/// The model for trials and control.
#[derive(Debug, Deserialize)]
struct ForTrials {
    model: Option<String>,
}

#[derive(Debug, Deserialize)]
struct NotEnough {
    message: String,
}

#[derive(Debug, Deserialize)]
struct Candidate {
    name: String,
    file: Option<PathBuf>,
}

#[derive(Debug, Deserialize)]
struct Verdict {
    channel: String,
    grade: String,
    /// `None` if it is not finite.
    nrmse: Option<f64>,
}

impl Summary {
    /// The model for control, else the best one in predictions.
    fn best(&self) -> Option<&Candidate> {
        let for_control = self.for_trials.as_ref().and_then(|found| found.model.as_ref());
        let name = for_control.or(self.best.as_ref());
        self.models.iter().find(|model| name == Some(&model.name))
    }

    /// Grades and errors of the outputs.
    fn grades(&self) -> String {
        let of = |Verdict { channel, grade, nrmse }: &Verdict| {
            nrmse.map(|nrmse| format!("{channel} {} (NRMSE {nrmse:.3})", grade.replace('_', " ")))
        };
        self.verdicts.iter().filter_map(of).collect::<Vec<_>>().join(", ")
    }
}

/// `hydroid identify` as another process, which cannot delay the commands.
pub(super) fn by_command(config: PathBuf, stop: Arc<AtomicBool>) -> Identify {
    Arc::new(move |recordings, folder| {
        identify(&config, recordings, folder, &stop).map_err(|error| error_text(&error))
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
    let summary: Summary = serde_json::from_str(&text)?;
    if let Some(missing) = &summary.not_enough_data {
        bail!("{}", missing.message);
    }
    let best = summary.best().context(
        "no model is the best one, because rollouts of all models diverge: log more experiments, and read report.html",
    )?;
    let name = best.file.as_deref().context("the model has no file")?;
    let taken = best.name.clone();
    let path = output.join(name.file_name().unwrap_or_default());
    let model = model::read(&path)?;
    // The grades are those of the best model in predictions.
    let mut text = match &summary.best {
        Some(best) if *best != taken => {
            format!("for control; {best}, the best in predictions: {}", summary.grades())
        }
        _ => summary.grades(),
    };
    if summary.for_trials.is_some_and(|found| found.model.is_none()) {
        text += "; trials of no model stay where it can be believed: read report.html before it steers";
    }
    Ok(Identified { name: path.display().to_string(), model, text })
}

/// A folder that does not exist yet.
fn free_folder(folder: &Path) -> PathBuf {
    let mut all = (1..100_000).map(|k| folder.join(format!("model-{k}")));
    all.find(|path| !path.exists()).unwrap_or_else(|| folder.join("model"))
}
