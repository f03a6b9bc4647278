//! `hydroid adapt .. --black-box FILE`, and `hydroid adapt MODEL --replay FILE`.

use std::path::Path;

use anyhow::Context;
use hydroid::model::Model;
use hydroid_live::black_box::{BlackBox, DEFAULT_MINUTES, ModelFile, RecordingOptions};
use hydroid_live::stream::fingerprint;

use super::super::Outcome;
use crate::args::{Adapt, Global};

/// Options of the black box, if requested.
pub fn settings(args: &Adapt) -> anyhow::Result<Option<RecordingOptions>> {
    let Some(path) = &args.black_box.black_box else { return Ok(None) };
    recording(path, args.black_box.black_box_minutes, &args.model).map(Some)
}

/// Options of a black box in the file `path`.
pub fn recording(path: &Path, minutes: Option<f64>, model: &Path) -> anyhow::Result<RecordingOptions> {
    Ok(RecordingOptions {
        path: path.to_owned(),
        minutes: minutes.unwrap_or(DEFAULT_MINUTES),
        model: ModelFile {
            file: model.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            fingerprint: of_file(model)?,
        },
    })
}

fn of_file(path: &Path) -> anyhow::Result<String> {
    if !path.exists() {
        // A built-in vessel is identified by its name; the black box contains the program version.
        return Ok(fingerprint(path.as_os_str().as_encoded_bytes()));
    }
    let file = std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
    Ok(fingerprint(&file))
}

/// Repeats the recorded session and compares each result bit for bit.
pub fn replay(args: &Adapt, global: Global, model: Model, path: &Path) -> anyhow::Result<Outcome> {
    let black_box = BlackBox::read(path)?;
    let model = model.at_step(black_box.head.dt)?;
    let replayed = hydroid_live::black_box::replay(&model, &of_file(&args.model)?, &black_box, |step| {
        if global.json && step.is_sample() {
            outln!("{}", step.json());
        }
    })?;
    let summary = match &replayed.first {
        None if replayed.samples == 0 => String::from(
            "no sample was replayed: the black box holds none that follows a whole snapshot, and nothing could be compared",
        ),
        None => format!("{} samples replayed, all identical", replayed.samples),
        Some(first) => format!(
            "{} samples replayed, {} different; the first at {} s: {} recorded {}, replayed {}",
            replayed.samples, replayed.different, first.t, first.what, first.recorded, first.replayed
        ),
    };
    if global.json {
        eprintln!("{summary}");
    } else {
        outln!("{summary}");
    }
    let identical = replayed.first.is_none() && replayed.samples > 0;
    Ok(if identical { Outcome::Done } else { Outcome::Missed })
}
