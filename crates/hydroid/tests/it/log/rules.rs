//! Rules of the preparation of runs.

use super::{error_of, has_note, input, log, log_as, output, prepared, prepared_with, table};
use hydroid::log::{ChannelSpec, CommandTiming, InputDelay, PrepareOptions, Selection, Trajectory, prepare};

fn u(k: usize) -> String {
    format!("{}", (k % 7) as f64 * 0.1)
}

fn n(k: usize) -> String {
    format!("{}", k * k)
}

fn delayed(timing: CommandTiming, delay: InputDelay) -> PrepareOptions {
    PrepareOptions { command_timing: timing, input_delay: delay, ..PrepareOptions::default() }
}

#[test]
fn a_regular_log_comes_through_unchanged() {
    let p = prepared(&table(50, u, n));
    let run = &p.runs[0];
    assert_eq!((run.name.as_str(), run.t0, run.dt, run.len()), ("log.csv", 0.0, 0.1, 50));
    assert_eq!(output(&p, 0, 0), (0..50).map(|k| (k % 7) as f64 * 0.1).collect::<Vec<_>>());
    assert_eq!(input(&p, 0, 0), (0..50).map(|k| (k * k) as f64).collect::<Vec<_>>());
    assert_eq!(run.outputs.channels()[0].unit, "m/s");
    assert!(p.notes.iter().all(|n| !n.is_warning()), "{:?}", p.notes);
}

#[test]
fn units_scales_and_names_are_applied() {
    let log = log("time [ms],SOG [kn],YAW [deg/s],shaft\n0,1,90,60\n100,2,180,120\n200,3,45,60\n");
    let selection = Selection::of("u=SOG,r=YAW", "n=shaft [rpm] * 2").unwrap();
    let p = prepare(&[log], &selection, &PrepareOptions::default()).unwrap();
    let run = &p.runs[0];
    assert_eq!(run.dt, 0.1);
    assert!((run.outputs.row(1)[0] - 2.0 * 0.514_444_444).abs() < 1e-8);
    assert!((run.outputs.row(1)[1] - std::f64::consts::PI).abs() < 1e-12);
    assert_eq!(run.inputs.row(1), [4.0]);
    let units: Vec<&str> =
        run.outputs.channels().iter().chain(run.inputs.channels()).map(|c| c.unit.as_str()).collect();
    assert_eq!(units, ["m/s", "rad/s", "rps"]);
    assert!(has_note(&p, "from kn to m/s"), "{:?}", p.notes);
}

#[test]
fn names_may_leave_out_the_unit_at_the_end() {
    let log = log("t_s,u_mps,r_degps,n_cmd\n0,1,90,1\n1,2,180,2\n2,1,0,3\n");
    let p = prepare(&[log], &Selection::default(), &PrepareOptions::default()).unwrap();
    let channels = p.runs[0].outputs.channels();
    assert_eq!((channels[0].name.as_str(), channels[0].unit.as_str()), ("u", "m/s"));
    assert_eq!((channels[1].name.as_str(), channels[1].unit.as_str()), ("r", "rad/s"));
    assert!((p.runs[0].outputs.row(1)[1] - std::f64::consts::PI).abs() < 1e-12);
}

#[test]
fn a_wrong_unit_is_refused_and_a_corrected_one_noted() {
    let text = "t,u [kn],n\n0,1,1\n1,2,2\n2,1,3\n";
    let with = |spec: &str| {
        let selection = Selection {
            outputs: vec![spec.parse::<ChannelSpec>().unwrap()],
            ..Selection::of("u", "n").unwrap()
        };
        prepare(&[log(text)], &selection, &PrepareOptions::default())
    };
    let p = with("u [km/h]").unwrap();
    assert!((p.runs[0].outputs.row(0)[0] - 1.0 / 3.6).abs() < 1e-12);
    assert!(p.notes.iter().any(|n| n.is_warning() && n.message.contains("kn")), "{:?}", p.notes);
    assert!(error_of(with("u [rad]")).contains("measure different things"));
}

#[test]
fn wind_becomes_two_inputs() {
    let log = log("t,u,n,ws [m/s],wd [deg]\n0,1,1,2,90\n1,2,2,2,\n2,1,3,3,180\n3,1,3,3,180\n");
    let selection = Selection { wind: Some("ws,wd".parse().unwrap()), ..Selection::of("u", "n").unwrap() };
    let p = prepare(&[log], &selection, &PrepareOptions::default()).unwrap();
    let inputs = &p.runs[0].inputs;
    assert_eq!(inputs.channels()[1].name, "wind_x");
    assert_eq!(inputs.channels()[2].unit, "m^2/s^2");
    assert!((inputs.row(0)[2] - 4.0).abs() < 1e-12 && inputs.row(0)[1].abs() < 1e-12);
    assert_eq!(inputs.row(1), inputs.row(1));
    assert!((inputs.row(1)[2] - 4.0).abs() < 1e-12, "holds its last value");
    assert!((inputs.row(2)[1] + 9.0).abs() < 1e-12);
}

#[test]
fn truth_is_found_and_converted_like_its_output() {
    let log = log("t,SOG [cm/s],SOG_true,n\n0,100,110,1\n1,200,210,2\n2,100,110,3\n");
    let p = prepare(&[log], &Selection::of("u=SOG", "n").unwrap(), &PrepareOptions::default()).unwrap();
    let truth = p.runs[0].truth.as_ref().unwrap();
    assert!((truth.row(1)[0] - 2.1).abs() < 1e-12);
    assert_eq!(truth.channels(), p.runs[0].outputs.channels());
}

#[test]
fn commands_hold_and_leading_blanks_are_dropped() {
    let p = prepared(&table(10, u, |k| if k == 2 || k == 6 { format!("{k}") } else { String::new() }));
    assert_eq!(input(&p, 0, 0), [2.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0]);
    assert!((p.runs[0].t0 - 0.2).abs() < 1e-12);
    assert!(has_note(&p, "before the first command") && has_note(&p, "6 blank cells"), "{:?}", p.notes);
}

#[test]
fn a_run_is_cut_only_where_an_output_is_missing_too_long() {
    let holes = |k: usize| if (20..25).contains(&k) || (40..60).contains(&k) { String::new() } else { u(k) };
    let p = prepared(&table(100, holes, n));
    assert_eq!(p.runs.iter().map(Trajectory::len).collect::<Vec<_>>(), [40, 40]);
    assert_eq!(p.sources, [0, 0]);
    assert!((p.runs[1].t0 - 6.0).abs() < 1e-9);
    assert_eq!(input(&p, 1, 0)[0], 3600.0);
    assert_ne!(p.runs[0].name, p.runs[1].name);
    assert!(has_note(&p, "20 samples in the middle cut out"), "{:?}", p.notes);
    let longer = PrepareOptions { max_gap_s: Some(3.0), ..PrepareOptions::default() };
    assert_eq!(prepared_with(&table(100, holes, n), &longer).runs.len(), 1);
}

#[test]
fn a_run_has_every_output_and_no_long_gap() {
    let runs = |outputs: &[[u8; 2]], max_gap_s| {
        let cell = |measured, k: usize| if measured == 1 { format!("{}", k * k) } else { String::new() };
        let row = |(k, [u, v]): (usize, &[u8; 2])| format!("{k},{},{},{}\n", cell(*u, k), cell(*v, k), k % 5);
        let text = "t,u,v,n\n".to_owned() + &outputs.iter().enumerate().map(row).collect::<String>();
        let options = PrepareOptions { max_gap_s: Some(max_gap_s), ..PrepareOptions::default() };
        let p = prepare(&[log(&text)], &Selection::of("u,v", "n").unwrap(), &options);
        p.map(|p| p.runs.iter().map(|run| (run.t0, run.len())).collect::<Vec<_>>())
    };
    let gap = [1, 0, 1, 0, 0, 0, 1, 1, 1].map(|u| [u, 1]);
    assert_eq!(runs(&gap, 3.0).unwrap(), [(0.0, 3), (6.0, 3)]);
    assert_eq!(runs(&gap, 4.0).unwrap(), [(0.0, 9)]);
    let ends = [[0, 1], [1, 0], [1, 1], [1, 1], [0, 1], [0, 1]];
    assert_eq!(runs(&ends, 10.0).unwrap(), [(1.0, 3)]);
    assert!(runs(&[[0, 1], [0, 0], [1, 0]], 9.0).is_err());
}

#[test]
fn missing_ends_are_trimmed() {
    let p = prepared(&table(50, |k| if (5..30).contains(&k) { u(k) } else { String::new() }, n));
    assert_eq!(p.runs[0].len(), 25);
    assert!(
        has_note(&p, "5 samples at the beginning") && has_note(&p, "20 samples at the end"),
        "{:?}",
        p.notes
    );
}

#[test]
fn rows_without_time_are_dropped() {
    let mut text = table(20, u, n);
    text += "NaN,NaN,NaN\nNaN,NaN,NaN\n";
    let p = prepared(&text);
    assert_eq!(p.runs[0].len(), 20);
    assert!(has_note(&p, "2 rows without a time stamp"), "{:?}", p.notes);
}

#[test]
fn rows_left_out_are_missing_measurements() {
    let text: String = table(30, u, n)
        .lines()
        .enumerate()
        .filter(|(i, _)| *i != 11)
        .map(|(_, l)| format!("{l}\n"))
        .collect();
    let p = prepared(&text);
    assert_eq!(p.runs[0].len(), 30);
    assert!(p.runs[0].outputs.row(10)[0].is_nan());
    assert_eq!(p.runs[0].inputs.row(10), [81.0]);
    assert!(has_note(&p, "without a row in the log"), "{:?}", p.notes);
}

#[test]
fn a_jump_in_time_splits_the_run() {
    let mut text = table(20, u, n);
    for k in 0..20 {
        text += &format!("{:.1},{},{}\n", 100.0 + k as f64 * 0.1, u(k), n(k));
    }
    let p = prepared(&text);
    assert_eq!(p.runs.iter().map(|r| (r.t0, r.len())).collect::<Vec<_>>(), [(0.0, 20), (100.0, 20)]);
    assert!(has_note(&p, "1 jump in time"), "{:?}", p.notes);
}

#[test]
fn sensors_at_different_rates_survive() {
    let mut text = "t,u,v,n\n".to_owned();
    for k in 0..600 {
        let slow = if k % 50 == 0 { format!("{}", k as f64 * 0.01) } else { String::new() };
        text += &format!("{:.1},{},{slow},{k}\n", k as f64 * 0.1, u(k));
    }
    let p = prepare(&[log(&text)], &Selection::of("u,v", "n").unwrap(), &PrepareOptions::default()).unwrap();
    assert_eq!(p.runs.len(), 1);
    assert_eq!(p.runs[0].len(), 551);
    assert!(
        p.notes.iter().any(|n| n.remedy.as_ref().is_some_and(|r| r.contains("dt=5.000"))),
        "{:?}",
        p.notes
    );
    let coarse = PrepareOptions { dt: Some(5.0), ..PrepareOptions::default() };
    let p = prepare(&[log(&text)], &Selection::of("u,v", "n").unwrap(), &coarse).unwrap();
    assert_eq!(output(&p, 0, 1), (0..12).map(|k| (k * 50) as f64 * 0.01).collect::<Vec<_>>());
}

/// Ten rows within 20 ms, once per second, were "regular, step 0.002 s". The time has its unit in its name.
#[test]
fn rows_in_bursts_are_no_regular_clock() {
    let mut text = "timestamp_ms,u,n\n".to_owned();
    for k in 0..600 {
        let ms = 1000 * (k / 10) + 2 * (k % 10);
        text += &format!("{ms},{:.3},{}\n", (0.001 * f64::from(ms)).sin(), k / 50 % 2);
    }
    let p = prepared(&text);
    assert!((p.runs[0].dt - 0.1).abs() < 0.01, "{}", p.runs[0].dt);
    assert!(p.notes.iter().any(|n| n.is_warning() && n.message.contains("irregular")), "{:?}", p.notes);
}

#[test]
fn an_irregular_clock_is_resampled_and_reported() {
    let mut text = "t,u,n\n".to_owned();
    for k in 0..100 {
        let t = k as f64 * 0.1 + if k % 3 == 1 { 0.02 } else { 0.0 };
        text += &format!("{t:.3},{:.3},{k}\n", 2.0 * t);
    }
    let p = prepared(&text);
    let run = &p.runs[0];
    for k in 0..run.len() {
        let t = run.t0 + k as f64 * run.dt;
        assert!((run.outputs.row(k)[0] - 2.0 * t).abs() < 2e-3, "a straight line stays one");
        let command = run.inputs.row(k)[0];
        let given = command * 0.1 + if command % 3.0 == 1.0 { 0.02 } else { 0.0 };
        assert!(given <= t + 1e-6 && command == command.round(), "the command in force at {t}: {command}");
    }
    assert!(p.notes.iter().any(|n| n.is_warning() && n.message.contains("irregular")), "{:?}", p.notes);
}

#[test]
fn a_coarser_step_reads_off_outputs_and_averages_commands() {
    let p = prepared_with(&table(41, u, n), &PrepareOptions { dt: Some(0.4), ..PrepareOptions::default() });
    let run = &p.runs[0];
    assert_eq!(run.len(), 11);
    for k in 0..10 {
        assert_eq!(run.outputs.row(k)[0], (4 * k % 7) as f64 * 0.1);
        let mean = (4 * k..4 * k + 4).map(|i| (i * i) as f64).sum::<f64>() / 4.0;
        assert!((run.inputs.row(k)[0] - mean).abs() < 1e-9 * mean.max(1.0));
    }
}

#[test]
fn a_finer_step_interpolates_outputs_and_holds_commands() {
    let p = prepared_with(&table(10, u, n), &PrepareOptions { dt: Some(0.05), ..PrepareOptions::default() });
    let run = &p.runs[0];
    assert_eq!(run.len(), 19);
    assert!((run.outputs.row(3)[0] - 0.15).abs() < 1e-12);
    assert_eq!(run.inputs.row(3), [1.0]);
}

#[test]
fn headings_are_interpolated_the_short_way() {
    let log = log("t,psi [deg],n\n0,350,1\n1,10,2\n2,30,2\n3,50,2\n");
    let selection = Selection::of("psi", "n").unwrap();
    let p =
        prepare(&[log], &selection, &PrepareOptions { dt: Some(0.5), ..PrepareOptions::default() }).unwrap();
    let degrees: Vec<f64> = output(&p, 0, 0).iter().map(|x| x.to_degrees().round()).collect();
    assert_eq!(&degrees[..5], [350.0, 0.0, 10.0, 20.0, 30.0]);
}

/// Positions are metres from the middle of the log, whatever rows before the first fix hold; the only pair of them counts.
#[test]
fn a_run_has_the_positions_of_its_log() {
    let position = |header: &str, row: &dyn Fn(f64) -> String, dt: Option<f64>| {
        let rows: String = (0..40).map(|k| format!("{k},1,{}\n", row(f64::from(k)))).collect();
        let log = log(&format!("t,n,u [m/s],{header}\n{rows}"));
        let selection = Selection::of("u", "n").unwrap();
        let options = PrepareOptions { dt, ..PrepareOptions::default() };
        prepare(&[log], &selection, &options).unwrap().runs[0].position.clone()
    };
    let way = |position: Option<Vec<[f64; 2]>>| {
        let position = position.unwrap();
        [0, 1].map(|axis| position[30][axis] - position[20][axis])
    };
    let plane = |k: f64| format!("{},{},{}", 1.0 + 0.1 * k, 2.0 * k, 5.0 - k);
    for header in ["north [m],east [m]", "x,y", "pos_x [m],pos_y [m]", "northing,easting"] {
        assert_eq!(way(position(header, &plane, None)), [20.0, -10.0], "{header}");
    }
    // WGS 84 at 34 degrees south: 110.9 m and 92.4 m for a thousandth of a degree.
    let globe = |k: f64| {
        let fix = if k < 5.0 { [0.0, 0.0] } else { [-34.0 + 1e-4 * k, 151.0 - 1e-4 * k] };
        format!("{},{},{}", 1.0 + 0.1 * k, fix[0], fix[1])
    };
    for header in ["lat,lon", "latitude [deg],longitude [deg]", "gps_lat [deg],gps_lon [deg]"] {
        let [north, east] = way(position(header, &globe, None));
        assert!((north - 110.92).abs() < 0.1 && (east + 92.39).abs() < 0.1, "{header}: {north}, {east}");
    }
    for header in ["x_ref,y_ref", "target_x [m],target_y [m]", "x,z", "x [m/s],y [m/s]"] {
        assert_eq!(position(header, &plane, None), None, "{header}");
    }
    // An interpolated position is no measurement.
    let finer = position("x,y", &plane, Some(0.5)).unwrap();
    assert_eq!(finer.iter().filter(|place| place[0].is_finite()).count(), 40);
}

#[test]
fn an_after_log_is_shifted_by_one() {
    let p = prepared_with(&table(10, u, n), &delayed(CommandTiming::After, InputDelay::default()));
    let run = &p.runs[0];
    assert_eq!((run.t0, run.len()), (0.0, 9));
    assert_eq!(input(&p, 0, 0), (1..10).map(|k| (k * k) as f64).collect::<Vec<_>>());
    assert!(has_note(&p, "1 sample dropped at the end"), "{:?}", p.notes);
}

#[test]
fn delays_go_both_ways_in_samples_and_seconds() {
    for delay in [InputDelay::Samples(3), InputDelay::Seconds(0.3)] {
        let p = prepared_with(&table(10, u, n), &delayed(CommandTiming::Before, delay));
        assert!((p.runs[0].t0 - 0.3).abs() < 1e-12);
        assert_eq!(input(&p, 0, 0), (0..7).map(|k| (k * k) as f64).collect::<Vec<_>>());
        assert_eq!(output(&p, 0, 0)[0], 3.0 * 0.1);
    }
    let p = prepared_with(&table(10, u, n), &delayed(CommandTiming::Before, InputDelay::Samples(-2)));
    assert_eq!(p.runs[0].t0, 0.0);
    assert_eq!(input(&p, 0, 0), (2..10).map(|k| (k * k) as f64).collect::<Vec<_>>());
    let options = delayed(CommandTiming::Before, InputDelay::Samples(20));
    let too_far = prepare(&[log(&table(10, u, n))], &Selection::of("u", "n").unwrap(), &options);
    assert!(error_of(too_far).contains("shorter input delay"));
}

#[test]
fn resampled_delays_agree_with_shifted_rows() {
    let shift = delayed(CommandTiming::After, InputDelay::Samples(3));
    let native = prepared_with(&table(40, u, n), &shift);
    let half = prepared_with(&table(40, u, n), &PrepareOptions { dt: Some(0.05), ..shift });
    assert!((native.runs[0].t0 - half.runs[0].t0).abs() < 1e-9);
    for k in 0..native.runs[0].len() {
        assert_eq!(native.runs[0].inputs.row(k), half.runs[0].inputs.row(2 * k));
    }
}

#[test]
fn different_steps_go_to_the_coarser() {
    let a = log_as("a.csv", &table(41, u, n));
    let b = log_as("b.csv", "t,u [m/s],n\n0,1,1\n0.2,2,2\n0.4,1,3\n0.6,3,1\n");
    let p = prepare(&[a, b], &Selection::of("u", "n").unwrap(), &PrepareOptions::default()).unwrap();
    assert_eq!(p.runs.iter().map(|r| (r.dt, r.len())).collect::<Vec<_>>(), [(0.2, 21), (0.2, 4)]);
    assert_eq!(p.sources, [0, 1]);
    assert!(has_note(&p, "different steps"), "{:?}", p.notes);
}

#[test]
fn files_of_one_name_keep_their_folders() {
    let a = log_as("one/run.csv", &table(10, u, n));
    let b = log_as("two/run.csv", &table(10, u, n));
    let p = prepare(&[a, b], &Selection::of("u", "n").unwrap(), &PrepareOptions::default()).unwrap();
    assert_eq!(p.runs[0].name, "one/run.csv");
}

#[test]
fn notes_are_data() {
    let p = prepared(&table(20, u, |_| "5".into()));
    let json = serde_json::to_string(&p.notes).unwrap();
    assert!(json.contains(r#""severity":"warning""#), "{json}");
}

#[test]
fn units_of_other_loggers_are_converted() {
    let log = log("t [Sec],u [KTS],r [deg/sec],n [RPM]\n0,1,90,60\n1,2,180,120\n2,3,45,60\n");
    let p = prepare(&[log], &Selection::of("u,r", "n").unwrap(), &PrepareOptions::default()).unwrap();
    assert!((p.runs[0].outputs.row(0)[0] - 0.514_444_444).abs() < 1e-8);
    assert!((p.runs[0].outputs.row(1)[1] - std::f64::consts::PI).abs() < 1e-12);
    assert_eq!(p.runs[0].inputs.row(1), [2.0]);
    assert!(p.notes.iter().all(|n| !n.is_warning()), "{:?}", p.notes);
}

#[test]
fn an_unknown_unit_of_an_output_is_warned_of_until_one_is_stated() {
    let with = |u: &str| {
        let log = log("t,u [furlong/h],n [clicks]\n0,1,60\n1,2,120\n2,3,60\n");
        prepare(&[log], &Selection::of(u, "n").unwrap(), &PrepareOptions::default()).unwrap()
    };
    let p = with("u");
    let warnings: Vec<&str> = p.notes.iter().filter(|n| n.is_warning()).map(|n| n.message.as_str()).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("SI units are assumed"), "{:?}", p.notes);
    assert_eq!(output(&p, 0, 0), [1.0, 2.0, 3.0]);
    let p = with("u [km/h]");
    assert!(p.notes.iter().all(|n| !n.is_warning()), "{:?}", p.notes);
    assert!((output(&p, 0, 0)[0] - 1.0 / 3.6).abs() < 1e-12);
}

#[test]
fn capital_knots_are_taken_as_knots_with_a_warning_and_may_be_kilonewtons() {
    let with = |n: &str| {
        let log = log("t,u [KN],F [KN]\n0,1,1\n1,2,2\n2,3,1\n");
        prepare(&[log], &Selection::of("u [kn]", n).unwrap(), &PrepareOptions::default()).unwrap()
    };
    let p = with("F [kN]");
    assert_eq!(input(&p, 0, 0), [1000.0, 2000.0, 1000.0]);
    assert!((output(&p, 0, 0)[0] - 0.514_444_444).abs() < 1e-8);
    assert!(p.notes.iter().all(|n| !n.is_warning()), "{:?}", p.notes);
    let p = with("F");
    assert_eq!(p.runs[0].inputs.channels()[0].unit, "m/s");
    assert!(p.notes.iter().any(|n| n.is_warning() && n.message.contains("taken as knots")), "{:?}", p.notes);
}

#[test]
fn a_step_below_the_logs_is_warned_of() {
    let finer = |dt: f64| {
        let p =
            prepared_with(&table(20, u, n), &PrepareOptions { dt: Some(dt), ..PrepareOptions::default() });
        p.notes.iter().any(|n| n.is_warning() && n.message.contains("interpolated with the next measurement"))
    };
    assert!(finer(0.05) && finer(0.09));
    assert!(!finer(0.0995) && !finer(0.1) && !finer(0.2));
}

#[test]
fn alternating_sensors_give_the_advice_to_resample() {
    for rows in [40, 41] {
        let mut text = "t,u,v,n\n".to_owned();
        for k in 0..rows {
            let (a, b) = if k % 2 == 0 { (u(k), String::new()) } else { (String::new(), u(k)) };
            text += &format!("{:.1},{a},{b},{k}\n", k as f64 * 0.1);
        }
        let with = |options: &PrepareOptions| {
            prepare(&[log(&text)], &Selection::of("u,v", "n").unwrap(), options).unwrap()
        };
        let p = with(&PrepareOptions::default());
        let advised = |part: &str| {
            p.notes.iter().any(|n| {
                n.message.contains(part) && n.remedy.as_ref().is_some_and(|r| r.contains("dt=0.200"))
            })
        };
        assert!(advised("`u` has values in") && advised("`v` has values in"), "{:?}", p.notes);
        assert!(advised("no two outputs ever"), "{:?}", p.notes);
        let p = with(&PrepareOptions { dt: Some(0.2), ..PrepareOptions::default() });
        assert!(!has_note(&p, "has values in") && !has_note(&p, "no two outputs"), "{:?}", p.notes);
    }
}

#[test]
fn outputs_that_are_never_measured_together_are_warned_of() {
    let mut text = "t,u,v,n\n".to_owned();
    for k in 0..50 {
        let (a, b) = if k % 5 < 3 { (u(k), String::new()) } else { (String::new(), u(k)) };
        text += &format!("{:.1},{a},{b},{k}\n", k as f64 * 0.1);
    }
    let p = prepare(&[log(&text)], &Selection::of("u,v", "n").unwrap(), &PrepareOptions::default()).unwrap();
    let warned = p.notes.iter().find(|n| n.is_warning() && n.message.contains("no two outputs")).unwrap();
    assert!(warned.remedy.as_ref().unwrap().contains("dt=0.2"), "{warned:?}");
}

#[test]
fn units_in_parentheses_and_quotients_in_names_are_read() {
    let text = "Time (ms),u (kn),r_deg_s,thruster (1),rudder (S),Trim (%)\n0,1,90,1,2,50\n100,2,0,2,3,50\n200,3,45,3,4,50\n";
    let raw = log(text);
    let names: Vec<&str> = raw.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["Time", "u", "r_deg_s", "thruster (1)", "rudder (S)", "Trim"]);
    let selection = Selection::of("u,r", "thruster (1),rudder (S),Trim").unwrap();
    let p = prepare(&[raw], &selection, &PrepareOptions::default()).unwrap();
    assert!((p.runs[0].dt - 0.1).abs() < 1e-12);
    assert!((output(&p, 0, 0)[0] - 1852.0 / 3600.0).abs() < 1e-12);
    assert!((output(&p, 0, 1)[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert_eq!(input(&p, 0, 2)[0], 0.5);
}

#[test]
fn two_columns_that_differ_in_the_unit_in_parentheses_keep_it_in_their_names() {
    let text = "t,speed (kn),speed (km/h),n\n0,1,1.852,1\n1,2,3.704,2\n2,3,5.556,3\n";
    for (column, others) in [("speed (kn)", 1.0), ("speed (km/h)", 1.0)] {
        let selection = Selection::of(&format!("u={column}"), "n").unwrap();
        let p = prepare(&[log(text)], &selection, &PrepareOptions::default()).unwrap();
        assert!((output(&p, 0, 0)[0] - others * 1852.0 / 3600.0).abs() < 1e-12);
    }
}

#[test]
fn an_offset_is_subtracted_before_the_scale_and_the_unit() {
    let text = "t,u [kn],pwm\n0,1,1500\n1,2,1700\n2,3,1300\n";
    let selection = Selection::of("u=(u - 1) * 2", "L=(pwm - 1500) / 400").unwrap();
    let p = prepare(&[log(text)], &selection, &PrepareOptions::default()).unwrap();
    assert_eq!(input(&p, 0, 0), [0.0, 0.5, -0.5]);
    assert!((output(&p, 0, 0)[2] - 4.0 * 1852.0 / 3600.0).abs() < 1e-12);
    // The selection of the model file reads further logs in the same way.
    assert_eq!(p.selection.inputs[0].to_string(), "L=(pwm - 1500) * 0.0025");
}

#[test]
fn a_column_whose_name_looks_like_an_expression_is_found() {
    let text = "t,u,Engine - 1,Engine - 2\n0,1,5,6\n1,2,7,8\n2,3,9,9\n";
    let selection = Selection::of("u", "Engine - 1,Engine - 2").unwrap();
    let p = prepare(&[log(text)], &selection, &PrepareOptions::default()).unwrap();
    assert_eq!((input(&p, 0, 0), input(&p, 0, 1)), (vec![5.0, 7.0, 9.0], vec![6.0, 8.0, 9.0]));
    let again = prepare(&[log(text)], &p.selection, &PrepareOptions::default()).unwrap();
    assert_eq!(again.runs[0].inputs, p.runs[0].inputs);
}

#[test]
fn an_offset_without_blanks_is_refused_with_the_right_form() {
    let raw = log("t,u,pwm\n0,1,1500\n1,2,1700\n2,3,1300\n");
    for (inputs, expected) in [("L=pwm-1500", "`pwm - 1500`"), ("L=pwm/400", "`pwm / 400`")] {
        let selection = Selection::of("u", inputs).unwrap();
        let message = error_of(prepare(std::slice::from_ref(&raw), &selection, &PrepareOptions::default()));
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn columns_that_are_not_used_are_named_where_the_inputs_are_guessed() {
    let mut text = String::from("t,u,r,throttle [%],rudder_cmd,x [m],y [m],u_true,empty,name\n");
    for k in 0..50 {
        text += &format!("{},{},0.1,{},{},{k},{k},1,0,a\n", 0.1 * f64::from(k), k % 7, k % 5, k % 3);
    }
    let p = prepare(&[log(&text)], &Selection::default(), &PrepareOptions::default()).unwrap();
    let note = p.notes.iter().find(|note| note.message.contains("not used")).unwrap();
    assert!(
        note.message.ends_with("the inputs are rudder_cmd, by their names; not used: throttle"),
        "{note:?}"
    );
    assert!(note.remedy.as_ref().unwrap().contains("inputs"));
    let stated = Selection::of("u,r", "rudder_cmd").unwrap();
    let p = prepare(&[log(&text)], &stated, &PrepareOptions::default()).unwrap();
    assert!(!has_note(&p, "not used"));
}
