//! Results of `inspect` on logs with known problems.

use super::{log, table};
use hydroid::log::inspect::Confidence;
use hydroid::log::{
    CommandTiming, InputDelay, Inspection, LogError, PrepareOptions, RawLog, Selection, Sensors,
};

fn inspect(log: &RawLog, selection: &Selection) -> Result<Inspection, LogError> {
    hydroid::log::inspect(log, selection, &PrepareOptions::default())
}

/// Reproducible numbers from -0.5 to 0.5.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}

/// A boat with one propeller whose random commands act `delay` samples after they are logged.
fn boat(rows: usize, delay: usize, noise_size: f64) -> String {
    let (mut commands, mut measurement) = (noise(1), noise(2));
    let mut level = 0.0;
    let logged: Vec<f64> = (0..rows)
        .map(|k| {
            if k % 13 == 0 {
                level = commands();
            }
            level
        })
        .collect();
    let mut u = 0.0;
    let speeds: Vec<f64> = (0..rows)
        .map(|k| {
            let now = u;
            u += 0.1 * (logged[k.saturating_sub(delay)] - 0.5 * u - 0.3 * u * u.abs());
            now
        })
        .collect();
    table(rows, |k| format!("{}", speeds[k] + noise_size * measurement()), |k| format!("{}", logged[k]))
}

fn found(text: &str) -> Inspection {
    inspect(&log(text), &Selection::of("u", "n").unwrap()).unwrap()
}

#[test]
fn a_known_delay_is_found() {
    for delay in [0, 3, 12] {
        let estimate = found(&boat(3000, delay, 0.0)).input_delay.unwrap();
        assert_eq!(estimate.samples, delay as i64, "{estimate:?}");
        assert_eq!(estimate.confidence, Confidence::High, "{estimate:?}");
    }
}

#[test]
fn a_known_delay_is_found_under_noise() {
    let found = found(&boat(6000, 5, 0.2));
    assert!(found.outputs[0].mostly_noise);
    let estimate = found.input_delay.unwrap();
    assert!((4..=6).contains(&estimate.samples), "{estimate:?}");
}

#[test]
fn commands_without_effect_have_no_delay() {
    let mut u = noise(7);
    let mut n = noise(9);
    let columns: Vec<(f64, f64)> = (0..3000).map(|_| (u(), n())).collect();
    let text = table(3000, |k| columns[k].0.to_string(), |k| columns[k].1.to_string());
    let found = found(&text);
    assert_eq!(found.input_delay.unwrap().confidence, Confidence::None);
    assert!(found.notes.iter().any(|n| n.message.contains("cannot be estimated")));
}

#[test]
fn noise_is_measured() {
    let report = found(&boat(6000, 0, 0.05)).outputs.remove(0);
    let std = report.noise_std.unwrap();
    assert!((std - 0.05 / 12_f64.sqrt()).abs() < 0.001, "{std}");
    assert!(found(&boat(3000, 0, 0.0)).outputs[0].noise_std.is_none());
}

#[test]
fn a_smoothing_window_is_seen() {
    let mut draw = noise(3);
    let white: Vec<f64> = (0..4020).map(|_| draw()).collect();
    let smooth = |k: usize| (white[k..k + 20].iter().sum::<f64>() / 20.0).to_string();
    let text = table(4000, smooth, |k| (k / 50 % 3).to_string());
    let noted = |found: &Inspection| found.notes.iter().any(|n| n.message.contains("smoothed over about 20"));
    let logged = found(&text);
    assert_eq!(logged.outputs[0].smoothing_window, Some(20));
    assert!(noted(&logged), "{:?}", logged.notes);
    // Velocities from sensors are smooth by themselves.
    let computed = Selection { sensors: Some(Sensors::default()), ..Selection::of("u", "n").unwrap() };
    assert!(!noted(&inspect(&log(&text), &computed).unwrap()));
}

#[test]
fn columns_are_counted() {
    let report =
        inspect(&log("t,u,n,mode\n0,1,5,a\n1,,5,a\n2,,5,b\n3,1,5,b\n4,3,5,c\n"), &Selection::default());
    let report = report.unwrap();
    let u = &report.columns[1];
    assert_eq!((u.missing, u.longest_missing, u.min, u.max), (2, 2, Some(1.0), Some(3.0)));
    assert!(report.columns[2].constant);
    assert_eq!(report.columns[2].repeated, 1.0);
    assert_eq!(report.columns[3].not_numbers, 5);
    assert!(report.notes.iter().any(|n| n.message.contains("inputs")), "{:?}", report.notes);
    assert!(report.inputs.is_empty());
    assert!(report.clock.unwrap().regular);
}

#[test]
fn repeated_samples_and_lazy_commands_are_warned_of() {
    let text = table(3000, |k| format!("{}", (k / 2) as f64 * 0.001), |k| usize::from(k > 1500).to_string());
    let report = found(&text);
    assert!((report.repeated_rows - 0.5).abs() < 0.01);
    let warned = |part: &str| report.notes.iter().any(|n| n.is_warning() && n.message.contains(part));
    assert!(warned("50 % of the rows repeat") && warned("`n` hardly moves"), "{:?}", report.notes);
    assert_eq!(report.inputs[0].levels, 2);
    assert_eq!(report.inputs[0].at_limits, 1.0);
}

#[test]
fn a_log_that_cannot_be_prepared_can_be_inspected() {
    let report = found("t,u,n\n0,1,0\n2,2,0\n1,3,0\n3,4,1\n");
    assert_eq!(report.rows, 4);
    assert!(report.notes.iter().any(|n| n.message.contains("backwards")));
    let report = inspect(&log("a,b\n0,1\n1,2\n"), &Selection::default()).unwrap();
    assert_eq!(report.columns.len(), 2);
    let unknown = inspect(&log("t,u,n\n0,1,2\n"), &Selection::of("x", "n").unwrap());
    assert!(unknown.is_err());
}

#[test]
fn correct_reading_options_give_no_warning() {
    let looked_at = |text: &str, options: &PrepareOptions| {
        hydroid::log::inspect(&log(text), &Selection::of("u", "n").unwrap(), options).unwrap()
    };
    let advised = |found: &Inspection, part: &str| {
        found.notes.iter().any(|n| n.remedy.as_ref().is_some_and(|r| r.contains(part)))
    };
    // Each row with the command before its measurement, which is logged one row earlier.
    let timely = boat(3000, 0, 0.0);
    let mut before = String::from("0");
    let late: String = timely
        .lines()
        .enumerate()
        .map(|(i, line)| {
            let (front, command) = line.rsplit_once(',').unwrap();
            let now =
                if i == 0 { command.to_owned() } else { std::mem::replace(&mut before, command.to_owned()) };
            format!("{front},{now}\n")
        })
        .collect();
    let default = PrepareOptions::default();
    let after = PrepareOptions { command_timing: CommandTiming::After, ..default };
    assert!(advised(&looked_at(&late, &default), "command_timing=\"after\""));
    let found = looked_at(&late, &after);
    assert!(!advised(&found, "command_timing") && !advised(&found, "input_delay"), "{:?}", found.notes);
    assert_eq!(found.input_delay.unwrap().samples, 0);

    let delayed = boat(3000, 5, 0.0);
    let by = |n: i64| PrepareOptions { input_delay: InputDelay::Samples(n), ..default };
    assert!(advised(&looked_at(&delayed, &default), "input_delay=5 "));
    // The remaining delay adds to the present shift.
    assert!(advised(&looked_at(&delayed, &by(2)), "input_delay=5 "));
    assert!(!advised(&looked_at(&delayed, &by(5)), "input_delay"));
    // With another step, samples of the runs are not samples of the log.
    let coarse = PrepareOptions { dt: Some(0.2), ..by(2) };
    let found = looked_at(&boat(3000, 6, 0.0), &coarse);
    assert!(advised(&found, "input_delay=\"0.6s\" "), "{:?}", found.notes);
}

#[test]
fn a_log_with_forty_inputs_is_inspected() {
    let mut draw = noise(5);
    let mut text = String::from("t,u,v,r");
    for i in 0..40 {
        text += &format!(",n{i}_cmd");
    }
    let mut levels = [0.0; 40];
    let mut state = [0.0; 3];
    for k in 0..4000 {
        text += &format!("\n{:.1},{},{},{}", k as f64 * 0.1, state[0], state[1], state[2]);
        for (i, level) in levels.iter_mut().enumerate() {
            if (k + i) % 17 == 0 {
                *level = draw();
            }
            text += &format!(",{level:.3}");
        }
        for (i, x) in state.iter_mut().enumerate() {
            *x += 0.1 * (levels[i] + levels[i + 3] - 0.5 * *x);
        }
    }
    let log = log(&text);
    let found = inspect(&log, &Selection::default()).unwrap();
    assert_eq!(found.input_delay.unwrap().samples, 0);
    assert!(found.inputs[..6].iter().all(|i| i.delay.as_ref().is_some_and(|d| d.samples == 0)));
}

#[test]
fn a_log_without_a_time_column_says_so() {
    let text = "when,u,speed,n_cmd\n0,1,1,2\n1,2,2,2\n2,1,1,3\n";
    for selection in [Selection::default(), Selection::of("u", "n_cmd").unwrap()] {
        let found = inspect(&log(text), &selection).unwrap();
        assert!(found.notes.iter().any(|n| n.message.contains("no time column")), "{:?}", found.notes);
        assert_eq!(found.duration_s, None);
    }
    // Neither outputs nor a time.
    let found = inspect(&log("when,speed\n0,1\n1,2\n2,1\n"), &Selection::default()).unwrap();
    assert!(found.notes.iter().any(|n| n.message.contains("no time column")), "{:?}", found.notes);
    let options = PrepareOptions { dt: Some(0.5), ..PrepareOptions::default() };
    let found = hydroid::log::inspect(&log(text), &Selection::default(), &options).unwrap();
    assert_eq!((found.duration_s, found.clock.unwrap().step_s), (Some(1.0), 0.5));
}

#[test]
fn a_column_of_time_stamps_is_seconds() {
    let text = "t,u,n_cmd\n2020-08-03T11:04:37Z,1,2\n2020-08-03T11:04:38Z,2,2\n2020-08-03T11:04:39Z,1,3\n";
    let found = inspect(&log(text), &Selection::default()).unwrap();
    assert_eq!((found.duration_s, found.columns[0].not_numbers), (Some(2.0), 0));
    assert_eq!(found.columns[0].unit, "s");
}

/// Warnings with their remedies for a log with these rows of u, v, r and two commands.
fn warned(rows: usize, row: impl Fn(f64) -> [f64; 5]) -> Vec<(String, String)> {
    let mut text = String::from("t,u,v,r,L,R\n");
    for k in 0..rows {
        let values = row(k as f64).map(|x| x.to_string()).join(",");
        text += &format!("{:.1},{values}\n", k as f64 * 0.1);
    }
    let found = inspect(&log(&text), &Selection::of("u,v,r", "L,R").unwrap()).unwrap();
    let warnings = found.notes.into_iter().filter(hydroid::log::Note::is_warning);
    warnings.map(|n| (n.message, n.remedy.unwrap_or_default())).collect()
}

#[test]
fn a_pulse_width_without_an_offset_is_noted_with_its_neutral_position() {
    let pulse = |k: f64| 1500.0 + (300.0 * (0.2 * k).sin()).round();
    let noted = |row: &dyn Fn(f64) -> [f64; 5]| {
        warned(400, row).into_iter().find(|(message, _)| message.contains("pulse widths"))
    };
    // At rest for a quarter of the log, after a start under command.
    let (message, remedy) = noted(&|k| {
        let left = if k > 300.0 { 1511.0 } else { pulse(k + 3.0) };
        [1.0, 0.1, 0.01 * k.sin(), left, (0.3 * k).sin()]
    })
    .unwrap();
    assert!(message.contains("`L` (1511)") && !message.contains("`R`"), "{message}");
    assert!(remedy.contains("inputs=\"L=L - 1511,R\""), "{remedy}");
    // At rest in the first row only.
    let first = |k: f64| if k == 0.0 { 1489.0 } else { pulse(k) };
    let (_, remedy) = noted(&|k| [1.0, 0.1, 0.01 * k.sin(), first(k), first(k)]).unwrap();
    assert!(remedy.contains("L=L - 1489,R=R - 1489"), "{remedy}");
    // Revolutions per minute, a command in percent, and a pulse width that never rests.
    assert_eq!(noted(&|k| [1.0, 0.1, 0.01 * k.sin(), 3.0 * pulse(k), (30.0 * k).sin()]), None);
    assert_eq!(noted(&|k| [1.0, 0.1, 0.01 * k.sin(), 1800.0 + (300.0 * k.sin()).round(), k.sin()]), None);
}

/// What the unit or the name states is a pulse width, even if the log never rests.
#[test]
fn a_stated_pulse_width_has_the_usual_neutral_position() {
    for (name, expected) in [("L [us]", "L=L - 1500"), ("pwm_left", "pwm_left - 1500"), ("n", "")] {
        let mut text = format!("t,u,{name}\n");
        for k in 0..200_u32 {
            let pulse = 1800.0 + (300.0 * f64::from(k).sin()).round();
            text += &format!("{:.1},{},{pulse}\n", 0.1 * f64::from(k), (0.3 * f64::from(k)).sin());
        }
        let column = name.split(' ').next().unwrap();
        let found = inspect(&log(&text), &Selection::of("u", column).unwrap()).unwrap();
        let note = found.notes.iter().find(|note| note.message.contains("pulse widths"));
        let remedy = note.and_then(|note| note.remedy.as_deref()).unwrap_or_default();
        assert!(note.is_some() != expected.is_empty() && remedy.contains(expected), "{name}: {remedy}");
    }
}

#[test]
fn an_impossible_yaw_rate_and_a_sway_above_surge_are_warned_of() {
    let about = |part: &str, row: &dyn Fn(f64) -> [f64; 5]| {
        warned(400, row).iter().filter(|(message, _)| message.contains(part)).count()
    };
    let moving = |u: f64, v: f64, r: f64| {
        move |k: f64| {
            [u + 0.1 * k.sin(), v * (0.1 * k).sin(), r * (0.1 * k).cos(), (0.2 * k).sin(), (0.3 * k).cos()]
        }
    };
    assert_eq!(about("no vessel turns as fast", &moving(1.0, 0.2, 12.0)), 1);
    assert_eq!(about("no vessel turns as fast", &moving(1.0, 0.2, 1.5)), 0);
    assert_eq!(about("move sideways", &moving(0.2, 2.0, 0.1)), 1);
    assert_eq!(about("move sideways", &moving(1.0, 1.5, 0.1)), 0);
}
