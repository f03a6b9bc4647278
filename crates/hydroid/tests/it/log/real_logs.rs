//! The real logs in the folder `HYDROID_DATA`.

use std::io::Write as _;
use std::path::PathBuf;

use hydroid::log::inspect::Confidence;
use hydroid::log::{Inspection, PrepareOptions, RawLog, Selection, inspect, prepare, read};

fn data(file: &str) -> Option<PathBuf> {
    let found = std::env::var_os("HYDROID_DATA").map(|d| PathBuf::from(d).join(file));
    if found.is_none() {
        let _ = writeln!(std::io::stderr(), "skipped: no HYDROID_DATA");
    }
    found
}

fn cybership() -> Selection {
    Selection::of("u,v,r", "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster").unwrap()
}

fn esso() -> Selection {
    Selection {
        wind: Some("wind_velo_relative_mid,wind_dir_relative_mid".parse().unwrap()),
        ..Selection::of("u=u_velo,v=vm_velo,r=r_angvelo", "n=n_prop,delta=delta_rudder").unwrap()
    }
}

fn usv() -> Selection {
    Selection::of("u=u_mps,v=v_mps,r=r_radps", "pwm_left_us,pwm_right_us").unwrap()
}

fn looked_at(log: &RawLog, selection: &Selection) -> Inspection {
    let found = inspect(log, selection, &PrepareOptions::default()).unwrap();
    println!("{}", serde_json::to_string_pretty(&found).unwrap());
    found
}

#[test]
fn cybership_comes_through_whole() {
    let Some(path) = data("cybership-enterprise1/random_run1.csv") else { return };
    let log = read(&path).unwrap();
    let p = prepare(std::slice::from_ref(&log), &cybership(), &PrepareOptions::default()).unwrap();
    assert_eq!((p.runs.len(), p.runs[0].len(), p.runs[0].dt), (1, 14_101, 0.05));
    assert_eq!(p.runs[0].outputs.channels()[2].unit, "rad/s");
    let found = looked_at(&log, &cybership());
    assert!(found.clock.unwrap().regular);
    assert!(found.outputs.iter().any(|o| o.smoothing_window.is_some_and(|w| (20..=22).contains(&w))));
}

#[test]
fn esso_osaka_takes_the_wind() {
    let Some(path) = data("esso-osaka/random_03-Aug-2020_11_04_37.csv") else { return };
    let log = read(&path).unwrap();
    let p = prepare(std::slice::from_ref(&log), &esso(), &PrepareOptions::default()).unwrap();
    assert_eq!((p.runs.len(), p.runs[0].len(), p.runs[0].dt), (1, 8_073, 0.1));
    assert_eq!(p.runs[0].inputs.width(), 4);
    looked_at(&log, &esso());
}

#[test]
fn the_zigzag_loses_only_its_blank_end() {
    let Some(path) = data("esso-osaka/zigzag_31-Jul-2020_13_50_28.csv") else { return };
    let log = read(&path).unwrap();
    let p = prepare(std::slice::from_ref(&log), &esso(), &PrepareOptions::default()).unwrap();
    assert_eq!((p.runs.len(), p.runs[0].len()), (1, 2028 - 327));
    assert!(p.notes.iter().any(|n| n.message.contains("327 rows without a time stamp")));
    looked_at(&log, &esso());
}

#[test]
fn only_the_two_random_runs_that_end_under_tow_are_shortened() {
    let Some(folder) = data("esso-osaka") else { return };
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|f| f.file_name().unwrap().to_string_lossy().starts_with("random"));
    files.sort();
    let logs: Vec<RawLog> = files.iter().map(|f| read(f).unwrap()).collect();
    let p = prepare(&logs, &esso(), &PrepareOptions::default()).unwrap();
    let rows: Vec<usize> = p.runs.iter().map(hydroid::log::Trajectory::len).collect();
    assert_eq!(rows, [8073, 6717, 6077, 6936, 6564, 5684]);
    let kept =
        prepare(&logs, &esso(), &PrepareOptions { keep_towed: true, ..PrepareOptions::default() }).unwrap();
    assert_eq!(kept.runs.iter().map(hydroid::log::Trajectory::len).sum::<usize>(), 40_908);
}

#[test]
fn the_problems_of_the_ugly_log_are_reported() {
    let Some(path) = data("usv-asw/boat1_2_sin.csv") else { return };
    let log = read(&path).unwrap();
    let p = prepare(std::slice::from_ref(&log), &usv(), &PrepareOptions::default()).unwrap();
    assert!((0.105..0.115).contains(&p.runs[0].dt), "{}", p.runs[0].dt);
    let found = looked_at(&log, &usv());
    assert!(!found.clock.unwrap().regular);
    assert!((0.40..0.50).contains(&found.repeated_rows), "{}", found.repeated_rows);
    let warned = |part: &str| found.notes.iter().any(|n| n.is_warning() && n.message.contains(part));
    assert!(warned("irregular") && warned("repeat the measurement") && warned("the sway is unreliable"));
    assert!((found.disagreements[0].correlation - 0.17).abs() < 0.02);
}

#[test]
fn the_noise_of_simulated_logs_is_estimated_and_their_delay_is_zero() {
    let Some(path) = data("../reference/records/both_train.csv") else { return };
    if !path.exists() {
        let _ = writeln!(std::io::stderr(), "skipped: no simulated record");
        return;
    }
    let log = read(&path).unwrap();
    let found = looked_at(&log, &Selection::default());
    let std = found.outputs[0].noise_std.unwrap();
    assert!((std - 0.01).abs() < 0.001, "{std}");
    // The lag of the propeller resembles a delay, the rudder has none: no shift is advised.
    let rudder = found.inputs[1].delay.as_ref().unwrap();
    assert!(rudder.samples == 0 && rudder.confidence == Confidence::High, "{rudder:?}");
    assert!(found.notes.iter().any(|n| n.remedy.as_ref().is_some_and(|r| r.contains("keep input_delay=0"))));
}

#[test]
fn every_real_log_can_be_prepared_or_says_why() {
    for (folder, selection) in
        [("cybership-enterprise1", cybership()), ("esso-osaka", esso()), ("usv-asw", usv())]
    {
        let Some(folder) = data(folder) else { return };
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
        files.retain(|f| f.extension().is_some_and(|e| e == "csv"));
        files.sort();
        let logs: Vec<RawLog> = files.iter().map(|f| read(f).unwrap()).collect();
        let p = prepare(&logs, &selection, &PrepareOptions::default()).unwrap();
        for run in &p.runs {
            println!("{} {} x {} s", run.name, run.len(), run.dt);
        }
        for note in &p.notes {
            println!("{:?}: {}", note.severity, note.message);
        }
        assert!(p.runs.len() >= logs.len());
    }
}

#[test]
fn tank_logs_have_a_step_and_no_time_column() {
    let Some(path) = data("benchmarks/cascaded_tanks.csv") else { return };
    let log = read(&path).unwrap();
    let selection = Selection::of("y=yEst", "u=uEst").unwrap();
    let options = PrepareOptions { dt: Some(4.0), ..PrepareOptions::default() };
    let p = prepare(std::slice::from_ref(&log), &selection, &options).unwrap();
    assert_eq!((p.runs.len(), p.runs[0].len(), p.runs[0].dt), (1, 1024, 4.0));
    assert!(p.notes.iter().any(|n| n.message.contains("rows are taken as 4 s apart")), "{:?}", p.notes);
    let timed = Selection { time: Some("Ts".into()), ..selection };
    let message = prepare(&[log], &timed, &PrepareOptions::default()).unwrap_err().to_string();
    assert!(
        message.contains("line 2, column `Ts`: 4 is the only time") && message.contains("with dt in seconds"),
        "{message}"
    );
}

#[test]
fn the_pulse_widths_of_the_twin_thruster_boat_have_a_neutral_position() {
    let Some(path) = data("usv-asw/boat1_2_circle.csv") else { return };
    let found = inspect(&read(&path).unwrap(), &usv(), &PrepareOptions::default()).unwrap();
    let remedy = found.notes.iter().find(|n| n.message.contains("pulse widths")).unwrap().remedy.as_deref();
    let expected = "inputs=\"pwm_left_us=pwm_left_us - 1510,pwm_right_us=pwm_right_us - 1510\"";
    assert!(remedy.unwrap().contains(expected), "{remedy:?}");
}
