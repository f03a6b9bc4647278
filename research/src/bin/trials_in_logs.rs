//! Turns and zigzags in logs beside the predictions of models that were identified without them.
//!
//! ```text
//! HYDROID_DATA=... cargo run --release -p hydroid-research --bin trials_in_logs -- [method] [SET ...]
//! ```
//!
//! Each run of the simulated fleet is left out once. The best model (of `committee`, or of the given method), identified
//! from all other runs, predicts the trials in the run from their first samples. The table has the median and the largest
//! error over all trials of a vessel, relative to the measured value for advance and tactical diameter, and the number of
//! trials; then the share of all measured figures inside the intervals, and of those inside the intervals of the members alone.

use std::path::Path;

use hydroid::identify::{Method, MotionOption, identify};
use hydroid::manoeuvre::{Comparison, Figure, compare};
use hydroid::model::Model;
use hydroid::progress::silent;
use hydroid_research::sets::{SETS, Set, methods};

/// A column of the table: figure, factor of relative errors (`None`: absolute), unit.
const COLUMNS: [(&str, bool, &str); 4] = [
    ("advance_m", true, " %"),
    ("tactical_diameter_m", true, " %"),
    ("first_overshoot_deg", false, " deg"),
    ("second_overshoot_deg", false, " deg"),
];

fn value(figures: &[Figure], name: &str) -> Option<f64> {
    figures.iter().find(|figure| figure.name == name)?.value
}

/// Sorted errors of a figure, and the number of trials in which the prediction does not reach it.
fn errors(comparisons: &[Comparison], name: &str, relative: bool) -> (Vec<f64>, usize) {
    let (mut errors, mut missed) = (Vec::new(), 0);
    for comparison in comparisons {
        let Some(measured) = value(&comparison.measured, name) else { continue };
        let scale = if relative { 100.0 / measured.abs() } else { 1.0 };
        match value(&comparison.predicted, name) {
            Some(predicted) => errors.push((predicted - measured).abs() * scale),
            None => missed += 1,
        }
    }
    errors.sort_unstable_by(f64::total_cmp);
    (errors, missed)
}

fn cell(comparisons: &[Comparison], (name, relative, unit): (&str, bool, &str)) -> String {
    let (errors, missed) = errors(comparisons, name, relative);
    let Some(largest) = errors.last() else { return String::from("-") };
    let half = errors.len() / 2;
    let median = if errors.len() % 2 == 1 { errors[half] } else { 0.5 * (errors[half - 1] + errors[half]) };
    let missed = if missed == 0 { String::new() } else { format!(", {missed} not reached") };
    format!("{median:.2}{unit} ({largest:.1}{unit}, {}{missed})", errors.len())
}

/// Measured figures inside the intervals of their predictions.
fn inside(comparisons: &[Comparison]) -> String {
    let pairs = comparisons.iter().flat_map(|trial| trial.measured.iter().zip(&trial.predicted));
    let judged = pairs.filter_map(|(measured, predicted)| Some((measured.value?, predicted.interval?)));
    let (held, all) = judged.fold((0, 0), |(held, all), (value, [low, high])| {
        (held + u32::from(low <= value && value <= high), all + 1)
    });
    format!("{:.0} % of {all}", 100.0 * f64::from(held) / f64::from(all.max(1)))
}

fn measure(set: &Set, data: &Path, methods: &[Method]) -> anyhow::Result<()> {
    let (runs, reading) = set.read(data)?;
    let (mut comparisons, mut of_members) = (Vec::new(), Vec::new());
    for (left_out, test) in runs.iter().enumerate() {
        let job = set.job(&runs, &reading, left_out, methods, MotionOption::Auto, None)?;
        let identified = identify(&job, &mut silent())?;
        let best = &identified.candidates[identified.best.unwrap_or(0)].model;
        comparisons.extend(compare(best, test, &mut silent())?);
        let mut alone: Model = best.clone();
        alone.description.trial_errors.clear();
        of_members.extend(compare(&alone, test, &mut silent())?);
    }
    let cells: Vec<String> = COLUMNS.into_iter().map(|column| cell(&comparisons, column)).collect();
    let held = [inside(&comparisons), inside(&of_members)];
    println!("| {} | {} | {} |", set.name, cells.join(" | "), held.join(" | "));
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let Some(data) = std::env::var_os("HYDROID_DATA") else {
        println!("skipped: no HYDROID_DATA");
        return Ok(());
    };
    let mut args = std::env::args().skip(1);
    let methods = methods(&args.next().unwrap_or_else(|| String::from("committee")))?;
    let chosen: Vec<String> = args.collect();
    println!(
        "| vessel | advance | tactical diameter | first overshoot | second overshoot | inside | inside (members) |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for set in SETS.iter().filter(|set| set.folder.starts_with("fleet")) {
        if chosen.is_empty() || chosen.iter().any(|name| name == set.name) {
            measure(set, Path::new(&data), &methods)?;
        }
    }
    Ok(())
}
