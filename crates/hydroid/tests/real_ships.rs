//! Identification on logs of real ships, against the ridge baseline on the same split.
//!
//! The logs are found through `HYDROID_DATA`; without it the tests say so and pass.

#[path = "../examples/ridge_baseline.rs"]
#[allow(dead_code)] // what the example prints, and no test needs
mod ridge_baseline;

use std::io::Write as _;
use std::path::{Path, PathBuf};

use hydroid::evaluate::Evaluation;
use hydroid::identify::{Grade, Identified, Job, Method, SindySettings, identify};
use hydroid::log::{self, PrepareOptions, Selection, Split, split_named};
use hydroid::model::Reading;
use hydroid::progress::silent;
use ridge_baseline::{CYBERSHIP, ESSO, Row, Ship, baseline, last};

fn data() -> Option<PathBuf> {
    let data = std::env::var_os("HYDROID_DATA").map(PathBuf::from);
    if data.is_none() {
        let _ = writeln!(std::io::stderr(), "skipped: no HYDROID_DATA");
    }
    data
}

fn job(split: Split, horizon: usize, origin_stride: usize) -> Job {
    Job {
        methods: vec![Method::Sindy],
        split,
        reading: Reading::default(),
        horizon,
        origin_stride,
        seed: 0,
        sindy: SindySettings::default(),
    }
}

fn identified(ship: &Ship, data: &Path) -> Identified {
    let [train, validation, test] = ship.runs(data);
    let split = Split { train, validation, test, notes: Vec::new() };
    identify(&job(split, ship.horizon, 1), &mut silent()).unwrap()
}

/// The baseline without shrinkage to speak of: what "plain" ridge regression is.
fn plain(rows: &[Row]) -> impl Iterator<Item = &Row> {
    rows.iter().filter(|row| row.lambda <= 1e-2)
}

fn beats_persistence(test: &Evaluation, factor: f64) {
    let horizon_1_s = (1.0 / test.dt).round();
    for (h, (errors, kept)) in test.nrmse.iter().zip(&test.persistence.nrmse).enumerate() {
        for (error, kept) in errors.iter().zip(kept) {
            assert!((h as f64) + 1.0 < horizon_1_s || *error < factor * kept, "{h}: {error} against {kept}");
        }
    }
}

#[test]
fn cybership_is_better_than_plain_ridge_in_the_mean_and_close_in_every_output() {
    let Some(data) = data() else { return };
    let result = identified(&CYBERSHIP, &data);
    let test = &result.candidates[0].test;
    assert_eq!((test.diverged, test.windows), (0, 7204));
    let (ours, mean) = last(test);
    for row in plain(&baseline(&CYBERSHIP, &data)) {
        let (ridge, ridge_mean) = last(&row.test);
        assert!(mean < 0.95 * ridge_mean, "{mean} against {ridge_mean}");
        assert!(ours.iter().zip(&ridge).all(|(a, b)| *a < 1.03 * b), "{ours:?} against {ridge:?}");
    }
    beats_persistence(test, 0.85);
    assert!(result.sound());
}

#[test]
fn esso_is_no_worse_than_ridge_in_the_mean_of_outputs() {
    let Some(data) = data() else { return };
    let result = identified(&ESSO, &data);
    let test = &result.candidates[0].test;
    assert_eq!(test.diverged, 0);
    let (_, mean) = last(test);
    for row in &baseline(&ESSO, &data) {
        let (_, ridge_mean) = last(&row.test);
        assert!(mean <= ridge_mean, "{mean} against {ridge_mean}");
    }
    assert!(result.sound());
}

/// Ten minutes of the hydrofoil in one log: two minutes of validation once chose equations that ran away on
/// the very data they had been fitted to, and a good log was called of no use.
#[test]
fn a_short_log_is_not_at_the_mercy_of_a_short_validation() {
    let Some(path) = data().map(|data| data.join("../reference/records/both_val.csv")) else { return };
    if !path.exists() {
        let _ = writeln!(std::io::stderr(), "skipped: no simulated records beside HYDROID_DATA");
        return;
    }
    let selection = Selection::of("u,v,r", "PP_cmd,RD_ang").unwrap();
    let prepared =
        log::prepare(&[log::read(&path).unwrap()], &selection, &PrepareOptions::default()).unwrap();
    let split = split_named(prepared.runs, Vec::new(), Vec::new()).unwrap();
    let result = identify(&job(split, 100, 1), &mut silent()).unwrap();
    assert!(result.verdicts.iter().all(|v| v.grade == Grade::Good), "{:?}", result.verdicts);
}

#[test]
fn the_ugly_log_is_not_made_to_look_good() {
    let Some(data) = data() else { return };
    let files = ["boat1_2_circle.csv", "boat1_2_sin.csv"].map(|file| data.join("usv-asw").join(file));
    let raw: Vec<_> = files.iter().map(|file| log::read(file).unwrap()).collect();
    let selection =
        Selection::of("u=u_mps,v=v_mps,r=r_radps", "left=pwm_left_us,right=pwm_right_us").unwrap();
    let doubts = log::inspect(&raw[1], &selection, &PrepareOptions::default()).unwrap().notes;
    assert!(doubts.iter().any(|note| note.message.contains("the sway is not to be trusted")));
    let prepared = log::prepare(&raw, &selection, &PrepareOptions::default()).unwrap();
    let split = split_named(prepared.runs, Vec::new(), Vec::new()).unwrap();
    let result = identify(&job(split, 100, 1), &mut silent()).unwrap();
    assert!(!result.sound());
    let sway = &result.verdicts[1];
    assert_eq!((sway.channel.as_str(), sway.grade), ("v", Grade::NotIdentified));
    assert!(result.warnings.iter().any(|note| note.message.contains("'v' is not identified")));
}
