//! Properties of all logs.

use proptest::prelude::*;

use super::{log, table};
use hydroid::log::{CommandTiming, InputDelay, PrepareOptions, Selection, inspect, prepare, read_from};

/// A valid or invalid cell.
fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        6 => (-50..50_i32).prop_map(|x| format!("{}", f64::from(x) * 0.1)),
        2 => Just(String::new()),
        1 => any::<f64>().prop_map(|x| format!("{x:e}")),
        1 => prop::sample::select(vec!["NaN", "inf", "x", "-", "1e308", "-1e308", "5e-324", "\"1\""]).prop_map(String::from),
    ]
}

fn options() -> impl Strategy<Value = PrepareOptions> {
    (
        prop::option::of(prop_oneof![0.01..5.0_f64, any::<f64>()]),
        prop::option::of(prop_oneof![0.01..50.0_f64, any::<f64>()]),
        any::<(bool, bool)>(),
        prop_oneof![
            (-5..30_i64).prop_map(InputDelay::Samples),
            any::<i64>().prop_map(InputDelay::Samples),
            any::<f64>().prop_map(InputDelay::Seconds)
        ],
    )
        .prop_map(|(dt, max_gap_s, (after, keep_towed), input_delay)| PrepareOptions {
            // Smaller steps are refused for their size in other tests; here they would fill the memory.
            dt: dt.map(|d| if d.abs() < 1e-4 { 1e-4 } else { d }),
            max_gap_s,
            command_timing: if after { CommandTiming::After } else { CommandTiming::Before },
            input_delay,
            keep_towed,
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn the_reader_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = read_from(&bytes[..], "x");
    }

    #[test]
    fn the_reader_never_panics_on_almost_csv(text in "[tu, ;\"\n\r\t0-9.\\-\\[\\]#naife]{0,200}") {
        if let Ok(log) = read_from(text.as_bytes(), "x") {
            for column in &log.columns {
                prop_assert_eq!(column.values.len(), log.rows());
            }
        }
    }

    #[test]
    fn preparation_never_panics_and_gives_valid_runs(
        steps in prop::collection::vec(prop_oneof![4 => Just(1.0), 2 => 0.5..2.0_f64, 1 => 0.0..100.0_f64], 1..60),
        cells in prop::collection::vec((cell(), cell(), cell()), 60),
        wild in prop::bool::weighted(0.1),
        options in options(),
    ) {
        let mut text = "t,u,v,n\n".to_owned();
        let mut t = 0.0;
        for (step, (u, v, n)) in steps.iter().zip(&cells) {
            t += step;
            if wild { text += &format!("{n},{u},{v},{n}\n"); } else { text += &format!("{t},{u},{v},{n}\n"); }
        }
        let Ok(log) = read_from(text.as_bytes(), "x") else { return Ok(()) };
        let selection = Selection::of("u,v", "n").unwrap();
        let _ = inspect(&log, &selection, &options);
        if let Ok(prepared) = prepare(&[log], &selection, &options) {
            prop_assert!(!prepared.runs.is_empty());
            for run in &prepared.runs {
                prop_assert!(run.len() >= 3);
                prop_assert_eq!(run.inputs.len(), run.len());
                prop_assert!(run.inputs.rows(0, run.len()).iter().all(|x| x.is_finite()));
                prop_assert!(run.outputs.rows(0, run.len()).iter().all(|x| !x.is_infinite()));
                for i in 0..2 {
                    prop_assert!(run.outputs.column(i).next().unwrap_or(f64::NAN).is_finite() || run.outputs.column(1 - i).next().is_some());
                }
            }
        }
    }

    #[test]
    fn resampling_to_the_same_clock_is_the_identity(
        values in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64), 10..50),
        jitter in prop::collection::vec(0.0..0.3_f64, 50),
    ) {
        // Resampled runs of an irregular log are regular and are read back unchanged.
        let mut text = "t,u,n\n".to_owned();
        for (k, (u, n)) in values.iter().enumerate() {
            text += &format!("{},{u},{n}\n", k as f64 + jitter[k]);
        }
        let selection = Selection::of("u", "n").unwrap();
        let once = prepare(&[log(&text)], &selection, &PrepareOptions::default()).unwrap();
        for run in &once.runs {
            let mut text = "t,u,n\n".to_owned();
            for k in 0..run.len() {
                let u = run.outputs.row(k)[0];
                text += &format!("{},{},{}\n", run.t0 + k as f64 * run.dt, u, run.inputs.row(k)[0]);
            }
            for dt in [None, Some(run.dt)] {
                let again = prepare(&[log(&text)], &selection, &PrepareOptions { dt, ..PrepareOptions::default() }).unwrap();
                prop_assert_eq!(again.runs.len(), 1);
                prop_assert_eq!(&again.runs[0].outputs, &run.outputs);
                prop_assert_eq!(&again.runs[0].inputs, &run.inputs);
            }
        }
    }

    #[test]
    fn a_delayed_copy_is_realigned_exactly(
        commands in prop::collection::vec(-10..10_i32, 30..60),
        delay in -8..9_i64,
        after in any::<bool>(),
    ) {
        // `u` shows the acting command; the log shows it `delay` samples early or late.
        let timing = if after { CommandTiming::After } else { CommandTiming::Before };
        let shift = delay - i64::from(after);
        let at = |k: i64| usize::try_from(k).ok().and_then(|k| commands.get(k)).copied();
        let text = table(
            commands.len(),
            |k| at(k as i64).unwrap_or(0).to_string(),
            |k| at(k as i64 + shift).unwrap_or(99).to_string(),
        );
        let selection = Selection::of("u", "n").unwrap();
        let options = PrepareOptions { command_timing: timing, input_delay: InputDelay::Samples(delay), ..PrepareOptions::default() };
        if let Ok(p) = prepare(&[log(&text)], &selection, &options) {
            let run = &p.runs[0];
            prop_assert_eq!(run.len(), commands.len() - usize::try_from(shift.unsigned_abs()).unwrap());
            for k in 0..run.len() {
                prop_assert_eq!(run.outputs.row(k)[0], run.inputs.row(k)[0]);
            }
        }
    }
}
