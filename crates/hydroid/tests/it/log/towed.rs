//! Towed and carried parts of a log.

use super::{has_note, log, output, prepared, prepared_with, table};
use hydroid::log::PrepareOptions;

/// Rows at 10 Hz: 30 s before, 100 s under command, 40 s after.
const BEFORE: usize = 300;
const AFTER: usize = 1300;
const ROWS: usize = 1700;

fn command(k: usize) -> String {
    let steered = (BEFORE..AFTER).contains(&k);
    // Zero for 25 s in the middle as well.
    let rests = (500..750).contains(&k);
    format!("{}", if steered && !rests { 1 + k / 100 % 3 } else { 0 })
}

/// Under command u is between 0 and 1 m/s (standard deviation 0.35); before, it is zero, afterwards `end` of the time
/// since \[s\].
fn speed(end: impl Fn(f64) -> f64) -> impl Fn(usize) -> String {
    move |k| {
        let t = k as f64 * 0.1;
        let u = match k {
            _ if k < BEFORE => 0.0,
            // It slows down while the commands rest.
            500..750 => 0.4 * (50.0 - t).exp(),
            _ if k < AFTER => 0.5 - 0.5 * ((t - 30.0) * 0.4).cos(),
            _ => end(t - 130.0),
        };
        // A wave.
        format!("{}", u + 0.05 * (7.0 * t).sin())
    }
}

#[test]
fn a_towed_end_is_removed() {
    let text = table(ROWS, speed(|t| if t < 15.0 { 0.1 } else { 0.6 }), command);
    let p = prepared(&text);
    assert_eq!((p.runs.len(), p.runs[0].len(), p.runs[0].t0), (1, AFTER, 0.0));
    assert!(
        has_note(&p, "the end of the log, 39.9 s from line 1302 to line 1701, is removed"),
        "{:?}",
        p.notes
    );
    assert!(p.notes.iter().any(|n| n.is_warning() && n.remedy.as_deref() == Some("keep it with keep_towed")));
    let kept = prepared_with(&text, &PrepareOptions { keep_towed: true, ..PrepareOptions::default() });
    assert_eq!(kept.runs[0].len(), ROWS);
    assert!(!has_note(&kept, "is removed"), "{:?}", kept.notes);
}

#[test]
fn a_pushed_start_is_removed() {
    let end = speed(|t| (-0.1 * t).exp());
    let pushed = |k: usize| if (200..BEFORE).contains(&k) { "-0.7".to_owned() } else { end(k) };
    let p = prepared(&table(ROWS, pushed, command));
    assert_eq!((p.runs[0].len(), p.runs[0].t0), (ROWS - BEFORE, 30.0));
    assert_eq!(output(&p, 0, 0)[0].to_string(), end(BEFORE));
    assert!(has_note(&p, "the beginning of the log, 29.9 s from line 2 to line 301"), "{:?}", p.notes);
}

/// A trailer in the middle of a log, for a quarter of it, was learned as motion without propulsion.
#[test]
fn a_carried_part_is_removed() {
    let (from, to) = (500, 900);
    let rest =
        |k: usize| if (from..to).contains(&k) { "0".to_owned() } else { format!("{}", 1 + k / 100 % 3) };
    let speed = |carried: f64| {
        move |k: usize| {
            let t = k as f64 * 0.1;
            let own = 0.5 - 0.5 * (0.4 * t).cos();
            format!(
                "{}",
                if (from..to).contains(&k) {
                    own * (-0.3 * (t - 50.0)).exp() + carried * (t - 50.0)
                } else {
                    own
                }
            )
        }
    };
    let p = prepared(&table(AFTER, speed(0.3), rest));
    assert_eq!(p.runs.iter().map(hydroid::log::Trajectory::len).collect::<Vec<_>>(), [from, AFTER - to]);
    assert!(has_note(&p, "a part of the log, 39.9 s from line 502 to line 901, is removed"), "{:?}", p.notes);
    // A pause of the commands, in which the vessel slows down, is kept.
    let p = prepared(&table(AFTER, speed(0.0), rest));
    assert_eq!(p.runs[0].len(), AFTER);
}

#[test]
fn uncommanded_motion_is_kept() {
    type End = fn(f64) -> f64;
    let ends: [(&str, End); 5] = [
        ("coasts", |t| (-0.1 * t).exp()),
        ("rests", |_| 0.0),
        ("goes on gathering way for a while, as its propeller runs down", |t| {
            if t < 8.0 { 0.1 * t } else { 0.8 * (-0.1 * (t - 8.0)).exp() }
        }),
        ("stops and drifts slowly", |t| -0.2 * (1.0 - (-0.2 * t).exp())),
        ("is not measured", |_| f64::NAN),
    ];
    for (what, end) in ends {
        let p = prepared(&table(ROWS, speed(end), command));
        assert!(!has_note(&p, "towed or pushed"), "{what}: {:?}", p.notes);
    }
    // Shorter than the least duration.
    let p = prepared(&table(AFTER + 190, speed(|t| t), command));
    assert_eq!(p.runs[0].len(), AFTER + 190);
    // More than half of the log.
    let seldom = |k: usize| if k < 1100 { "0".to_owned() } else { "1".to_owned() };
    assert_eq!(prepared(&table(ROWS, speed(|t| t), seldom)).runs[0].len(), ROWS);
    // A blank command holds the previous one.
    let blank = |k: usize| {
        if k < AFTER - 1 {
            command(k)
        } else if k < AFTER {
            "2".into()
        } else {
            String::new()
        }
    };
    assert_eq!(prepared(&table(ROWS, speed(|t| t), blank)).runs[0].len(), ROWS);
    // An output that is constant under command is not evidence.
    let late = |k: usize| if k < AFTER { String::new() } else { format!("{}", 0.01 * k as f64) };
    assert!(!has_note(&prepared(&table(ROWS, late, command)), "towed or pushed"));
    // A log without commands is not cut.
    let p = prepared(&table(ROWS, speed(|t| t), |_| "0".to_owned()));
    assert_eq!(p.runs[0].len(), ROWS);
}

/// A heading grows while a vessel finishes its turn.
#[test]
fn channels_other_than_velocities_do_not_indicate_a_tow() {
    let text = table(ROWS, speed(|t| if t < 15.0 { 0.1 } else { 0.6 }), command);
    for (unit, rows) in [("rad", ROWS), ("m/s", AFTER)] {
        let log = log(&text.replacen("u [m/s]", &format!("psi [{unit}]"), 1));
        let selection = hydroid::log::Selection::of("psi", "n").unwrap();
        let p = hydroid::log::prepare(&[log], &selection, &PrepareOptions::default()).unwrap();
        assert_eq!(p.runs[0].len(), rows, "{unit}");
    }
}

#[test]
fn wind_is_not_a_command() {
    let mut text = "t,u [m/s],n,wind [m/s],from [rad]\n".to_owned();
    let u = speed(|t| if t < 15.0 { 0.1 } else { 0.6 });
    for k in 0..ROWS {
        text += &format!("{:.1},{},{},2,0.5\n", k as f64 * 0.1, u(k), command(k));
    }
    let mut selection = hydroid::log::Selection::of("u", "n").unwrap();
    selection.wind = Some("wind,from".parse().unwrap());
    let p = hydroid::log::prepare(&[log(&text)], &selection, &PrepareOptions::default()).unwrap();
    assert_eq!(p.runs[0].len(), AFTER);
}
