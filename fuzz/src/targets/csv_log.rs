//! Logs.

use hydroid::boat::Boat;
use hydroid::log::{
    ChannelSpec, CommandTiming, InputDelay, PrepareOptions, Selection, inspect, prepare, read_from, rows,
    split_runs,
};
use hydroid::manoeuvre::recognise;

/// What is read as a log is inspected and prepared, with the columns found by name and with the first ones by choice.
pub fn csv_log(bytes: &[u8]) {
    let Ok(log) = read_from(bytes, "fuzz.csv") else { return };
    let names: Vec<&str> = log.columns.iter().map(|column| column.name.as_str()).collect();
    let chosen = |skip: usize, take: usize| {
        names.iter().skip(skip).take(take).map(|n| ChannelSpec::named(*n)).collect()
    };
    let first = Selection {
        time: names.first().map(|name| (*name).to_owned()),
        outputs: chosen(1, 2),
        inputs: chosen(3, 1),
        ..Selection::default()
    };
    let other = PrepareOptions {
        dt: Some(0.5),
        max_gap_s: Some(3.0),
        command_timing: CommandTiming::After,
        input_delay: "2".parse().unwrap_or(InputDelay::default()),
        keep_towed: true,
    };
    for (selection, options) in [
        (Selection::default(), PrepareOptions::default()),
        (first.clone(), PrepareOptions::default()),
        (first, other),
    ] {
        let _ = inspect(&log, &selection, &options);
        let _ = rows(&log, &selection);
        let Ok(prepared) = prepare(std::slice::from_ref(&log), &selection, &options) else { continue };
        for run in &prepared.runs {
            assert!(run.dt > 0.0 && run.t0.is_finite() && run.outputs.len() == run.inputs.len());
            assert!((0..run.len()).all(|k| run.inputs.row(k).iter().all(|c| c.is_finite())));
            assert!((0..run.len()).all(|k| !run.outputs.row(k).iter().any(|y| y.is_infinite())));
            let _ = recognise(run, &Boat::default());
        }
        // The complete selection reads the log in the same way.
        let again = prepare(std::slice::from_ref(&log), &prepared.selection, &options);
        let again = again.unwrap_or_else(|error| panic!("the complete selection is refused: {error}"));
        assert_eq!(again.runs.len(), prepared.runs.len());
        let _ = split_runs(prepared.runs);
    }
}
