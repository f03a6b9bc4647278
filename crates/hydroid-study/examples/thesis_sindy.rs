//! The thesis's recipe for sparse equations on the hydrofoil, setting by setting, beside what hydroid does
//! when it is left alone.
//!
//! ```text
//! cargo run --release -p hydroid --example thesis_sindy
//! cargo run --release -p hydroid --example thesis_sindy -- FOLDER
//! ```
//!
//! The recipe: a polynomial library of degree 2 or 3 in `u, v, r` and the two commands, derivatives by
//! differences, thresholded least squares (STLSQ). The propeller force is not measured. What the thesis
//! leaves open is varied:
//!
//! - the differences: central, or smoothed (the slope of a parabola through 11 or 51 samples, Savitzky and
//!   Golay 1964);
//! - the threshold, from none to 0.5, on the coefficients as they stand;
//! - the unit of the propeller command: newtons, where its coefficient in `du/dt` is about 0.005, or 100 N.
//!
//! The last rows are hydroid's defaults ([`identify`]): weak form, settings chosen by rollouts, the lag of the
//! propeller and the change of mode found in the data.
//!
//! The data: two hours of the built-in hydrofoil under mixed commands, sampled at 0.1 s, with its measurement
//! noise, seed 0; ten minutes to validate on (seed 2; hydroid alone uses them); judged on twenty minutes of
//! seed 1. With a folder they come from the logs `both_train.csv`, `both_val.csv` and `both_test.csv` in it,
//! which have columns as `hydroid simulate hydrofoil` writes them.
//!
//! Columns: number of terms; mean absolute error of `u`, `v` \[m/s\] and `r` \[rad/s\] at 20 and at 100 steps,
//! of rollouts that start at the true state, against the truth (what `hydroid evaluate --origin true
//! --against truth --origin-stride 20` reports); how many rollouts diverged (these are in no mean); and a
//! verdict, one of those of [`hydroid_study::recipe`].

// A test includes this file as a module; neither has an outside.
#![allow(unreachable_pub, missing_docs)]

use std::path::Path;

use hydroid::evaluate::Evaluation;
use hydroid::excitation::Excitation;
use hydroid::identify::{GivenRanges, Identified, Job, Method, Networks, SindySettings, identify, ranges};
use hydroid::log::{self, PrepareOptions, Selection, Split, Trajectory};
use hydroid::model::Reading;
use hydroid::progress::silent;
use hydroid::simulate::{self, simulate};
use hydroid::sindy::Structure;
use hydroid_core::model::Persistence;
use hydroid_core::vessel::VesselParams;
use hydroid_study::StudyError;
use hydroid_study::recipe::{DIFFERENCES, Errors, HORIZONS, THRESHOLDS, errors, judged, recipe};

/// Runs of the hydrofoil.
pub struct Data {
    pub train: Trajectory,
    pub validate: Trajectory,
    pub test: Trajectory,
}

impl Data {
    /// Simulated, with a training run of so many seconds.
    pub fn simulated(train_s: f64, test_s: f64) -> Self {
        let run = |duration_s, seed| {
            let options = simulate::Options {
                duration_s,
                seed,
                ..simulate::Options::new(VesselParams::hydrofoil(), Excitation::Mixed)
            };
            let record = simulate(&options, &mut silent()).expect("the built-in vessel can be simulated");
            record.to_trajectory(&["u", "v", "r"]).expect("these are measured")
        };
        Self { train: run(train_s, 0), validate: run(600.0, 2), test: run(test_s, 1) }
    }

    /// From logs.
    ///
    /// # Errors
    /// If one of them is not there, or is not a log of a simulated hydrofoil.
    pub fn read(folder: &Path) -> Result<Self, log::LogError> {
        let selection = Selection::of("u,v,r", "PP_cmd,RD_ang")?;
        let run = |name: &str| {
            let raw = log::read(&folder.join(name))?;
            let prepared = log::prepare(&[raw], &selection, &PrepareOptions::default())?;
            prepared.runs.into_iter().next().ok_or(log::LogError::NoFiles)
        };
        Ok(Self {
            train: run("both_train.csv")?,
            validate: run("both_val.csv")?,
            test: run("both_test.csv")?,
        })
    }
}

/// What hydroid finds when nothing is set.
pub fn defaults(data: &Data) -> Identified {
    let part = |run: &Trajectory| vec![run.clone()];
    let split = Split {
        train: part(&data.train),
        validation: part(&data.validate),
        test: part(&data.test),
        notes: Vec::new(),
    };
    let job = Job {
        methods: vec![Method::Sindy],
        split,
        reading: Reading::default(),
        horizon: HORIZONS[1],
        origin_stride: 20,
        seed: 0,
        ranges: GivenRanges::new(),
        networks: Networks::default(),
        sindy: SindySettings::default(),
    };
    identify(&job, &mut silent()).expect("the hydrofoil is identified")
}

/// Errors of what was identified, against the truth.
///
/// # Errors
/// If the test run is too short.
pub fn against_truth(identified: &Identified, data: &Data) -> Result<Evaluation, StudyError> {
    let mut session = identified.candidates[0].model.session();
    judged(session.as_mut(), &ranges(&[&data.train]), &data.test)
}

fn cells(errors: &Errors) -> String {
    let row = |values: &[f64]| values.iter().map(|x| format!("{x:.4}")).collect::<Vec<_>>().join(" ");
    format!("{:<20} | {:<20}", row(&errors[0]), row(&errors[1]))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let data = match std::env::args_os().nth(1) {
        Some(folder) => Data::read(Path::new(&folder))?,
        None => Data::simulated(7_200.0, 1_200.0),
    };
    println!(
        "train {} samples of {}, test {} samples of {}",
        data.train.len(),
        data.train.name,
        data.test.len(),
        data.test.name
    );
    println!();
    println!(
        "| degree | differences  | force | threshold | terms | 20 steps: u, v, r    | 100 steps: u, v, r   | diverged | verdict |"
    );
    println!("| ---: | --- | --- | ---: | ---: | --- | --- | ---: | --- |");
    for row in recipe(&data.train, &data.test, &[2, 3], &DIFFERENCES, &THRESHOLDS)? {
        println!(
            "| {:>6} | {:<12} | {:<5} | {:>9} | {:>5} | {} | {:>8} | {} |",
            row.degree,
            row.difference,
            row.unit,
            row.threshold,
            row.terms,
            row.errors.as_ref().map_or_else(|| format!("{:<20} | {:<20}", "-", "-"), cells),
            format!("{}/{}", row.diverged, row.windows),
            row.verdict
        );
    }
    let identified = defaults(&data);
    let candidate = &identified.candidates[0];
    let test = against_truth(&identified, &data)?;
    println!(
        "| hydroid, nothing set | | | | {} | {} | {}/{} | |",
        candidate.model.weights(),
        cells(&errors(&test.mae)),
        test.diverged,
        test.windows
    );
    let mut nothing = Persistence::new(3, 2);
    let kept = judged(&mut nothing, &ranges(&[&data.train]), &data.test)?;
    println!("| nothing changes | | | | 0 | {} | 0 | |", cells(&errors(&kept.persistence.mae)));
    let Some(found) = candidate.found() else { return Ok(()) };
    let structure: &Structure = &found.trials[found.chosen].structure;
    println!();
    for lag in &structure.lags {
        let input = &data.train.inputs.channels()[lag.input].name;
        println!("lag found: {input} through {:.4} s", lag.time_constant_s);
    }
    if let Some(schedule) = structure.gate {
        let output = &data.train.outputs.channels()[schedule.output].name;
        println!(
            "change of mode found: {output} = {:.4}, slope {:.3}",
            schedule.gate.centre.0, schedule.gate.slope.0
        );
    }
    Ok(())
}
