//! Leave-one-run-out on public sets of real and simulated vessels: each run is the test run once, and everything is
//! identified again from all other runs.
//!
//! ```text
//! HYDROID_DATA=... cargo run --release -p hydroid-study --example leave_one_run_out -- [method,method[,over-ground][=S]] [SET ...]
//! ```
//!
//! With `over-ground`, no current is estimated. `=S` is the time budget of the networks of an identification \[s\].
//! `-- write FOLDER` writes the prepared runs for other programs (`benches/peers/pysindy_leave_one_run_out.py`).
//!
//! The table has the NRMSE of each output at the horizon, over the windows of all runs together, from every fifth sample
//! on; `frozen` is the committee with constant coefficients. The last column is the smallest and the largest share of the
//! measurements inside each prediction band of the best model, over outputs and quarters of the horizon.

use std::path::{Path, PathBuf};
use std::time::Instant;

use hydroid::evaluate::{Options, PredictionCoverage, evaluate, evaluate_each};
use hydroid::identify::{
    Job, Method, MotionOption, NetworkTrainingOptions, SindyOptions, identify, output_ranges,
};
use hydroid::log::{self, LogError, PrepareOptions, Selection, Split, Trajectory, split_named};
use hydroid::model::Reading;
use hydroid::progress::silent;
use hydroid_core::predict::Predictor;

/// Runs of a vessel.
struct Set {
    name: &'static str,
    folder: &'static str,
    runs: &'static [&'static str],
    outputs: &'static str,
    inputs: &'static str,
    wind: bool,
    horizon_s: f64,
}

const ESSO: Set = Set {
    name: "esso-random",
    folder: "esso-osaka",
    runs: &[
        "random_03-Aug-2020_11_04_37",
        "random_06-Aug-2020_16_24_25_1",
        "random_06-Aug-2020_16_24_25_4",
        "random_06-Aug-2020_16_24_25_6",
        "random_31-Jul-2020_12_29_58",
        "random_31-Jul-2020_14_52_18",
    ],
    outputs: "u=u_velo,v=vm_velo,r=r_angvelo",
    inputs: "n=n_prop,delta=delta_rudder",
    wind: false,
    horizon_s: 30.0,
};

const FLEET: Set = Set {
    name: "",
    folder: "",
    runs: &["run1", "run2", "run3", "run4", "run5", "run6"],
    outputs: "u,v,r",
    inputs: "",
    wind: false,
    horizon_s: 30.0,
};

const SETS: [Set; 9] = [
    Set {
        name: "cybership",
        folder: "cybership-enterprise1",
        runs: &["random_run1", "run1", "random_run3", "dptest1"],
        outputs: "u=u_mps,v=v_mps,r=r_radps",
        inputs: "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster",
        wind: false,
        horizon_s: 5.0,
    },
    Set { name: "esso-random-wind", wind: true, ..ESSO },
    ESSO,
    Set {
        name: "esso-zigzag-wind",
        runs: &[
            "zigzag_31-Jul-2020_13_22_52",
            "zigzag_31-Jul-2020_13_29_19",
            "zigzag_31-Jul-2020_13_50_28",
            "zigzag_31-Jul-2020_14_03_39",
        ],
        wind: true,
        horizon_s: 20.0,
        ..ESSO
    },
    Set { name: "otter", folder: "fleet/otter/rates", inputs: "n_left,n_right", horizon_s: 20.0, ..FLEET },
    Set { name: "tanker", folder: "fleet/tanker/rates", inputs: "rpm,rudder", horizon_s: 60.0, ..FLEET },
    Set { name: "clarke83", folder: "fleet/clarke83/rates", inputs: "thrust,delta", ..FLEET },
    Set { name: "zefakkel", folder: "fleet/zefakkel/rates", inputs: "speed_order,rudder", ..FLEET },
    Set {
        name: "transit",
        folder: "fleet/transit/rates",
        inputs: "throttle,delta_cmd",
        horizon_s: 60.0,
        ..FLEET
    },
];

impl Set {
    /// The runs, by the file that each comes from.
    fn read(&self, data: &Path) -> anyhow::Result<(Vec<Vec<Trajectory>>, Reading)> {
        let files: Vec<PathBuf> =
            self.runs.iter().map(|run| data.join(self.folder).join(run).with_extension("csv")).collect();
        let raw = files.iter().map(|file| log::read(file)).collect::<Result<Vec<_>, _>>()?;
        let wind = self.wind.then(|| "wind_velo_relative_mid,wind_dir_relative_mid".parse());
        let selection = Selection { wind: wind.transpose()?, ..Selection::of(self.outputs, self.inputs)? };
        let options = PrepareOptions::default();
        let prepared = log::prepare(&raw, &selection, &options)?;
        let mut runs = vec![Vec::new(); files.len()];
        for (run, source) in prepared.runs.into_iter().zip(prepared.sources) {
            runs[source].push(run);
        }
        Ok((runs, Reading { selection: prepared.selection, options }))
    }
}

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

fn methods(list: &str) -> anyhow::Result<Vec<Method>> {
    let method = |name: &str| Ok(serde_json::from_value(serde_json::Value::from(name))?);
    list.split(',').map(method).collect()
}

/// All runs but the test runs are cross-validated, or split where a method needs validation runs.
fn split(train: Vec<Trajectory>, test: &[Trajectory], methods: &[Method]) -> Result<Split, LogError> {
    if methods.iter().all(|method| method.is_cross_validated()) {
        return Ok(Split { train, validation: Vec::new(), test: test.to_vec(), notes: Vec::new() });
    }
    split_named(train, Vec::new(), test.to_vec())
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
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
    let horizon = (set.horizon_s / first.dt).round() as usize;
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
        let others = runs.iter().enumerate().filter(|(index, _)| *index != left_out);
        let train: Vec<Trajectory> = others.flat_map(|(_, parts)| parts.iter().cloned()).collect();
        let job = Job {
            methods: methods.to_vec(),
            split: split(train, test, methods)?,
            reading: reading.clone(),
            horizon,
            origin_stride: 5,
            seed: 0,
            ranges: std::collections::BTreeMap::default(),
            motion,
            sindy: SindyOptions::default(),
            networks: NetworkTrainingOptions { budget_s, ..NetworkTrainingOptions::default() },
        };
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
