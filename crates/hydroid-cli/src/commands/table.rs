//! Tables of errors by horizon.

use std::fmt::Write as _;

use hydroid::evaluate::{BandCoverage, Evaluation, PredictionCoverage};
use hydroid::identify::{Grade, Verdict};

/// Rows of a table: first, last and round horizons.
pub fn horizons(evaluation: &Evaluation) -> Vec<usize> {
    let last = evaluation.horizons.last().copied().unwrap_or(0);
    let mut chosen: Vec<usize> = [1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0]
        .iter()
        .map(|seconds| seconds / evaluation.dt)
        .filter(|steps| (steps - steps.round()).abs() < 1e-6 * steps && *steps < last as f64)
        // Positive and below the last horizon.
        .map(|steps| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // a number of steps, rounded; a cast saturates
            let steps = steps.round() as usize;
            steps
        })
        .filter(|&steps| steps > 1)
        .collect();
    chosen.insert(0, 1);
    chosen.push(last);
    chosen.dedup();
    chosen
}

pub fn errors(evaluation: &Evaluation) -> String {
    let mut text = String::new();
    let mut line = |cells: [&str; 8]| {
        let [horizon, channel, mae, rmse, max, nrmse, r2, persistence] = cells;
        let _ = writeln!(
            text,
            "{horizon:>10}  {channel:<16} {mae:>10} {rmse:>10} {max:>10} {nrmse:>8} {r2:>8} {persistence:>12}"
        );
    };
    line(["horizon", "output", "MAE", "RMSE", "max", "NRMSE", "R2", "persistence"]);
    for horizon in horizons(evaluation) {
        let Some(h) = evaluation.at(horizon) else { continue };
        for (c, channel) in evaluation.channels.iter().enumerate() {
            let unit = &evaluation.units[c];
            let name = if unit.is_empty() { channel.clone() } else { format!("{channel} [{unit}]") };
            let time =
                if c == 0 { format!("{:.4} s", horizon as f64 * evaluation.dt) } else { String::new() };
            line([
                &trim(&time),
                &name,
                &figure(evaluation.mae[h][c]),
                &figure(evaluation.rmse[h][c]),
                &figure(evaluation.max[h][c]),
                &ratio(evaluation.nrmse[h][c]),
                &ratio(evaluation.r2[h][c]),
                &ratio(evaluation.persistence.nrmse[h][c]),
            ]);
        }
    }
    let _ = writeln!(
        text,
        "{} windows, {} of them without overlap, {} diverged; origin {}, against {}; last column: NRMSE of persistence",
        evaluation.windows,
        evaluation.independent,
        evaluation.diverged,
        word(&evaluation.origin),
        word(&evaluation.against)
    );
    if evaluation.nrmse.iter().flatten().any(|nrmse| nrmse.is_nan()) {
        let _ = writeln!(text, "-: undefined, because the output does not vary over the windows");
    }
    if evaluation.runs.unused > 0 {
        let _ = writeln!(
            text,
            "{} runs ({} samples) are shorter than the horizon and were not evaluated",
            evaluation.runs.unused, evaluation.runs.unused_samples
        );
    }
    for d in &evaluation.divergences {
        let _ = writeln!(
            text,
            "  diverged: {} from {:.3} s, step {}, in {}",
            d.run, d.origin_s, d.horizon, d.channel
        );
    }
    text + &runs(evaluation)
}

/// Largest number of runs in a table.
const MOST_RUNS: usize = 30;

/// Errors of each run at the longest horizon; nothing for a single run.
fn runs(evaluation: &Evaluation) -> String {
    let mut text = String::new();
    let all = &evaluation.by_run;
    let Some(&last) = evaluation.horizons.last().filter(|_| all.len() > 1) else { return text };
    let time = trim(&format!("{:.4} s", last as f64 * evaluation.dt));
    let _ = writeln!(
        text,
        "each run, {time} ahead: NRMSE with the standard deviation over all runs (persistence)"
    );
    for run in all.iter().take(MOST_RUNS) {
        let cells = evaluation.channels.iter().zip(run.nrmse.iter().zip(&run.persistence));
        let cells: Vec<String> = cells
            .map(|(channel, (nrmse, kept))| format!("{channel} {} ({})", ratio(*nrmse), ratio(*kept)))
            .collect();
        let diverged = if run.diverged > 0 { format!(", {} diverged", run.diverged) } else { String::new() };
        let _ = writeln!(text, "  {}: {}; {} windows{diverged}", run.run, cells.join(", "), run.windows);
    }
    if all.len() > MOST_RUNS {
        let _ = writeln!(text, "  and {} more runs", all.len() - MOST_RUNS);
    }
    text
}

/// Share of the measurements inside the prediction bands of a model.
pub fn coverage(coverage: &PredictionCoverage, evaluation: &Evaluation) -> String {
    let mut text = String::new();
    let levels: Vec<String> = coverage.levels.iter().map(|level| format!("{:.0} %", 100.0 * level)).collect();
    let _ = writeln!(text, "share of the measurements inside the prediction bands of {}:", levels.join(", "));
    for (h, horizon) in coverage.horizons.iter().enumerate() {
        let time = trim(&format!("{:.4} s", *horizon as f64 * evaluation.dt));
        let cells = evaluation.channels.iter().enumerate().map(|(c, channel)| {
            let share = |table: &Vec<Vec<f64>>| {
                let share = table[h][c];
                if share.is_nan() { String::from("-") } else { format!("{:.0} %", 100.0 * share) }
            };
            format!("{channel} {}", coverage.share.iter().map(share).collect::<Vec<_>>().join(", "))
        });
        let _ = writeln!(text, "{time:>10}  {}", cells.collect::<Vec<_>>().join("; "));
    }
    text
}

pub fn band(band: &BandCoverage, evaluation: &Evaluation) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "fraction of points inside the {:.0} % band of {} ensemble members ({} origins):",
        100.0 * band.level,
        band.members,
        band.origins
    );
    for (horizon, shares) in band.horizons.iter().zip(&band.share) {
        let time = trim(&format!("{:.4} s", *horizon as f64 * evaluation.dt));
        let cells = evaluation.channels.iter().zip(shares).map(|(channel, share)| {
            let percent = if share.is_nan() { String::from("-") } else { format!("{:.0} %", 100.0 * share) };
            format!("{channel} {percent}")
        });
        let _ = writeln!(text, "{time:>10}  {}", cells.collect::<Vec<_>>().join(", "));
    }
    let _ = writeln!(
        text,
        "the band covers the uncertainty of the coefficients only, not measurement noise, waves, wind or model error"
    );
    text
}

/// Errors of frozen, filtered (if any) and adapted model on the same windows.
pub fn side_by_side(frozen: &Evaluation, filtered: Option<&Evaluation>, adapted: &Evaluation) -> String {
    let mut text = String::new();
    let mut line = |horizon: &str, channel: &str, cells: &[String]| {
        let _ = write!(text, "{horizon:>10}  {channel:<16}");
        for cell in cells {
            let _ = write!(text, " {cell:>13}");
        }
        text.push('\n');
    };
    let all: Vec<(&str, &Evaluation)> =
        [("frozen", Some(frozen)), ("filtered", filtered), ("adapted", Some(adapted))]
            .into_iter()
            .filter_map(|(name, evaluation)| Some((name, evaluation?)))
            .collect();
    // The first column of each measure has its name.
    let heads = |figure: &str| -> Vec<String> {
        let head = |(i, (name, _)): (usize, &(&str, _))| {
            if i == 0 { format!("{figure} {name}") } else { (*name).to_owned() }
        };
        all.iter().enumerate().map(head).collect()
    };
    line("horizon", "output", &[heads("RMSE"), heads("NRMSE"), vec!["persistence".to_owned()]].concat());
    for horizon in horizons(frozen) {
        let Some(h) = frozen.at(horizon) else { continue };
        for (c, channel) in frozen.channels.iter().enumerate() {
            let unit = &frozen.units[c];
            let name = if unit.is_empty() { channel.clone() } else { format!("{channel} [{unit}]") };
            let time = if c == 0 { format!("{:.4} s", horizon as f64 * frozen.dt) } else { String::new() };
            let rmse = all.iter().map(|(_, evaluation)| figure(evaluation.rmse[h][c]));
            let nrmse = all.iter().map(|(_, evaluation)| ratio(evaluation.nrmse[h][c]));
            let persistence = ratio(frozen.persistence.nrmse[h][c]);
            line(&trim(&time), &name, &rmse.chain(nrmse).chain([persistence]).collect::<Vec<_>>());
        }
    }
    let _ = writeln!(
        text,
        "{} windows; diverged: {} frozen, {} adapted; origin {}, against {}",
        frozen.windows,
        frozen.diverged,
        adapted.diverged,
        word(&frozen.origin),
        word(&frozen.against)
    );
    text
}

pub fn show_verdicts(verdicts: &[Verdict]) {
    for verdict in verdicts {
        let grade = match verdict.grade {
            Grade::Good => "good",
            Grade::Usable => "usable",
            Grade::NotIdentified => "NOT IDENTIFIED",
            Grade::NotJudged => "NOT JUDGED",
        };
        outln!(
            "{}: {grade} (NRMSE {} at the longest horizon; persistence {}{})",
            verdict.channel,
            ratio(verdict.nrmse),
            ratio(verdict.persistence),
            verdict.reason.as_ref().map(|reason| format!("; {reason}")).unwrap_or_default()
        );
    }
}

/// A ratio; a dash if it is undefined.
fn ratio(x: f64) -> String {
    if x.is_nan() { String::from("-") } else { format!("{x:.3}") }
}

fn figure(x: f64) -> String {
    match x.abs() {
        a if a.is_nan() => String::from("-"),
        a if a == 0.0 || (1e-3..1e4).contains(&a) => {
            format!(
                "{x:.*}",
                if a >= 100.0 {
                    1
                } else if a >= 1.0 {
                    3
                } else {
                    4
                }
            )
        }
        _ => format!("{x:.2e}"),
    }
}

fn trim(time: &str) -> String {
    match time.strip_suffix(" s") {
        Some(number) => format!("{} s", number.trim_end_matches('0').trim_end_matches('.')),
        None => time.to_owned(),
    }
}

fn word(option: &impl serde::Serialize) -> String {
    serde_json::to_value(option).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}
