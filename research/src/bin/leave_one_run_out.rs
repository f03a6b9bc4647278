//! Leave-one-run-out on public sets of real and simulated vessels: each run is the test run once, and everything is
//! identified again from all other runs.
//!
//! ```text
//! HYDROID_DATA=... cargo run --release -p hydroid-research --bin leave_one_run_out -- [method,method[,over-ground][=S]] [SET ...]
//! ```
//!
//! With `over-ground`, no current is estimated. `=S` is the time budget of the networks of an identification \[s\].
//! `-- write FOLDER` writes the prepared runs for other programs (`research/peers/pysindy_leave_one_run_out.py`).
//!
//! The table has the NRMSE of each output at the horizon, over the windows of all runs together, from every fifth sample
//! on; `frozen` is the committee with constant coefficients. The last column is the smallest and the largest share of the
//! measurements inside each prediction band of the best model, over outputs and quarters of the horizon.

use std::path::Path;
use std::time::Instant;

use hydroid::evaluate::{Options, PredictionCoverage, evaluate, evaluate_each};
use hydroid::identify::{Method, MotionOption, identify, output_ranges};
use hydroid::log::Trajectory;
use hydroid::progress::silent;
use hydroid_core::predict::Predictor;
use hydroid_research::sets::{SETS, Set, methods};

/// Share of the measurements inside prediction bands, for each level, quarter of the horizon and output.
#[derive(Default)]
struct Coverage {
    levels: Vec<f64>,
    /// Sums of shares, weighted by windows.
    sums: Vec<f64>,
    windows: f64,
}

impl Coverage {
    fn add(&mut self, coverage: &PredictionCoverage, windows: usize) {
        let shares: Vec<f64> = coverage.share.iter().flatten().flatten().copied().collect();
        self.levels.clone_from(&coverage.levels);
        self.sums.resize(shares.len(), 0.0);
        self.sums.iter_mut().zip(shares).for_each(|(sum, share)| *sum += share * windows as f64);
        self.windows += windows as f64;
    }

    /// Smallest and largest share \[%\] of each level over quarters and outputs.
    fn describe(&self) -> String {
        let of = |(level, sums): (&f64, &[f64])| {
            let percent = |x: f64| 100.0 * x / self.windows;
            let low = sums.iter().copied().fold(f64::INFINITY, f64::min);
            let high = sums.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            format!("{:.0} %: {:.0} to {:.0}", 100.0 * level, percent(low), percent(high))
        };
        let count = self.sums.len() / self.levels.len().max(1);
        let each = self.levels.iter().zip(self.sums.chunks_exact(count.max(1)));
        each.map(of).collect::<Vec<_>>().join("; ")
    }
}

fn measure(
    set: &Set,
    data: &Path,
    methods: &[Method],
    motion: MotionOption,
    budget_s: Option<f64>,
) -> anyhow::Result<()> {
    let (runs, reading) = set.read(data)?;
    let first = runs.iter().flatten().next().ok_or_else(|| anyhow::anyhow!("{}: no runs", set.name))?;
    let horizon = set.horizon(first.dt);
    // Sessions by name of the model, with one session for each run.
    let mut sessions: Vec<(String, Vec<Box<dyn Predictor>>)> = Vec::new();
    let mut add = |name: &str, make: &mut dyn FnMut() -> Box<dyn Predictor>, parts: usize| {
        let place = sessions.iter().position(|(known, _)| known == name).unwrap_or(sessions.len());
        if place == sessions.len() {
            sessions.push((name.to_owned(), Vec::new()));
        }
        sessions[place].1.extend((0..parts).map(|_| make()));
    };
    let clock = Instant::now();
    let mut coverage = Coverage::default();
    for (left_out, test) in runs.iter().enumerate() {
        let job = set.job(&runs, &reading, left_out, methods, motion, budget_s)?;
        let Ok(identified) = identify(&job, &mut silent()) else {
            println!("{}: nothing was identified without {}", set.name, set.runs[left_out]);
            return Ok(());
        };
        for candidate in &identified.candidates {
            let model = &candidate.model;
            add(&model.description.name, &mut || model.session(), test.len());
            if model.committee().is_some() {
                add("frozen", &mut || model.frozen().session(), test.len());
            }
        }
        let best = &identified.candidates[identified.best.unwrap_or(0)].model;
        add("best", &mut || best.session(), test.len());
        if let Some(bands) = &best.description.bands {
            let quarters = (1..=4).map(|i| horizon * i / 4).collect();
            let options = Options { horizon, origin_stride: 5, errors_at: quarters, ..Options::default() };
            let (runs, ranges): (Vec<&Trajectory>, _) = (test.iter().collect(), best.output_ranges());
            let errors = evaluate("best", best.session().as_mut(), &ranges, &runs, &options, &mut silent())?;
            coverage.add(&bands.coverage(&errors), errors.windows);
        }
    }
    let seconds = clock.elapsed().as_secs_f64() / runs.len() as f64;
    let all: Vec<&Trajectory> = runs.iter().flatten().collect();
    let ranges = output_ranges(&all);
    // The past of the first origin shows the current.
    let past_s =
        if motion != MotionOption::OverGround && set.folder.starts_with("fleet") { 60.0 } else { 10.0 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
    let warm_up = (past_s / first.dt).round() as usize;
    let options = Options { horizon, origin_stride: 5, warm_up, ..Options::default() };
    for (name, mut sessions) in sessions {
        if sessions.len() != all.len() {
            println!("| {} | `{name}` | missing for some runs |", set.name);
            continue;
        }
        let errors = evaluate_each(&name, &mut sessions, &ranges, &all, &options, &mut silent())?;
        let bands = if name == "best" { coverage.describe() } else { String::new() };
        let last = &errors.nrmse[horizon - 1];
        let mean = |row: &[f64]| row.iter().sum::<f64>() / row.len() as f64;
        let outputs: Vec<String> = last.iter().map(|x| format!("{x:.3}")).collect();
        println!(
            "| {}, {} s | `{name}` | {} | {:.3} | {:.3} | {} | {seconds:.1} | {bands} |",
            set.name,
            set.horizon_s,
            outputs.join(" | "),
            mean(last),
            mean(&errors.persistence.nrmse[horizon - 1]),
            errors.diverged,
        );
    }
    Ok(())
}

/// Writes the prepared runs of all sets as CSV files with `outputs` and inputs, and `sets.json`.
fn write(folder: &Path, data: &Path) -> anyhow::Result<()> {
    let mut sets = Vec::new();
    for set in &SETS {
        let (runs, _) = set.read(data)?;
        let mut names = Vec::new();
        for (number, parts) in runs.iter().enumerate() {
            let mut files = Vec::new();
            for (part, run) in parts.iter().enumerate() {
                let name = format!("{}-{number}-{part}.csv", set.name);
                let mut text = String::new();
                let channels = run.outputs.channels().iter().chain(run.inputs.channels());
                text += &channels.map(|channel| channel.name.as_str()).collect::<Vec<_>>().join(",");
                for k in 0..run.len() {
                    let row = run.outputs.row(k).iter().chain(run.inputs.row(k)).map(f64::to_string);
                    text += "\n";
                    text += &row.collect::<Vec<_>>().join(",");
                }
                std::fs::write(folder.join(&name), text)?;
                files.push(name);
            }
            names.push(files);
        }
        let first = runs.iter().flatten().next().ok_or_else(|| anyhow::anyhow!("{}: no runs", set.name))?;
        sets.push(serde_json::json!({
            "name": set.name, "dt": first.dt, "outputs": first.outputs.channels().len(),
            "horizon": (set.horizon_s / first.dt).round(), "runs": names,
        }));
    }
    Ok(std::fs::write(folder.join("sets.json"), serde_json::to_vec_pretty(&sets)?)?)
}

fn main() -> anyhow::Result<()> {
    let Some(data) = std::env::var_os("HYDROID_DATA") else {
        println!("skipped: no HYDROID_DATA");
        return Ok(());
    };
    let mut args = std::env::args().skip(1);
    let first = args.next().unwrap_or_else(|| String::from("sindy,committee"));
    if first == "write" {
        let folder = args.next().ok_or_else(|| anyhow::anyhow!("write needs a folder"))?;
        return write(Path::new(&folder), Path::new(&data));
    }
    let (names, budget) = first.split_once('=').map_or((&first[..], None), |(names, s)| (names, Some(s)));
    let (names, motion) = match names.strip_suffix(",over-ground") {
        Some(names) => (names, MotionOption::OverGround),
        None => (names, MotionOption::Auto),
    };
    let methods = methods(names)?;
    let budget_s = budget.map(str::parse).transpose()?;
    let chosen: Vec<String> = args.collect();
    println!(
        "| set, horizon | model | u | v | r | mean | persistence | diverged | s per identification | inside bands |"
    );
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |");
    for set in SETS.iter().filter(|set| chosen.is_empty() || chosen.iter().any(|name| name == set.name)) {
        measure(set, Path::new(&data), &methods, motion, budget_s)?;
    }
    Ok(())
}
