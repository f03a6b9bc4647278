//! Parts of logs that are used.

use super::{error_of, has_note, log_as, output, table};
use hydroid::log::{LogError, Parts, PrepareOptions, Prepared, RawLog, Selection, keep_parts, prepare};

const ROWS: usize = 400;

/// A log of 40 s: u counts the rows in hundredths, n steps every second.
fn counting() -> RawLog {
    log_as("runs/day1.csv", &table(ROWS, |k| (0.01 * k as f64).to_string(), |k| (k / 10 % 3).to_string()))
}

fn parts(between: &[&str], exclude: &[&str], condition: Option<&str>) -> Selection {
    let list = |all: &[&str]| all.iter().map(|text| text.parse().unwrap()).collect();
    Selection {
        parts: Parts {
            between: list(between),
            exclude: list(exclude),
            condition: condition.map(|text| text.parse().unwrap()),
        },
        ..Selection::of("u", "n").unwrap()
    }
}

fn used(mut log: RawLog, selection: &Selection, dt: Option<f64>) -> Result<Prepared, LogError> {
    let mut notes = Vec::new();
    keep_parts(&mut log, selection, dt, &mut notes)?;
    let mut prepared = prepare(&[log], selection, &PrepareOptions { dt, ..PrepareOptions::default() })?;
    prepared.notes.splice(0..0, notes);
    Ok(prepared)
}

/// First and last row of each run.
fn runs(prepared: &Prepared) -> Vec<[f64; 2]> {
    let ends = |run: usize| {
        let u = output(prepared, run, 0);
        [u[0], u[u.len() - 1]].map(|u| (100.0 * u).round())
    };
    (0..prepared.runs.len()).map(ends).collect()
}

#[test]
fn stretches_of_time_are_runs_of_their_own() {
    for (between, exclude, expected) in [
        (&["5:12"][..], &[][..], &[[50.0, 120.0]][..]),
        (&["5:12", "20:"], &[], &[[50.0, 120.0], [200.0, 399.0]]),
        (&[":12"], &["3:5"], &[[0.0, 29.0], [51.0, 120.0]]),
        (&[], &["12:30"], &[[0.0, 119.0], [301.0, 399.0]]),
        // Shorter than the longest gap: the run goes on, and what is left out counts as missing.
        (&[], &["12:12.5"], &[[0.0, 399.0]]),
        (&["day1.csv=5:12"], &["day2.csv=6:7"], &[[50.0, 120.0]]),
        (&["runs/day1.csv=5:12"], &[], &[[50.0, 120.0]]),
        (&["day2.csv=5:12"], &[], &[[0.0, 399.0]]),
    ] {
        let prepared = used(counting(), &parts(between, exclude, None), None).unwrap();
        assert_eq!(runs(&prepared), expected, "{between:?} {exclude:?}");
        assert!(has_note(&prepared, "of 400 rows are used ("), "{:?}", prepared.notes);
        // They are those of these logs, and a model does not contain them.
        assert!(prepared.selection.parts.is_all());
    }
    let prepared = used(counting(), &parts(&["5:12"], &[], None), None).unwrap();
    assert_eq!(prepared.runs[0].t0, 5.0);
}

#[test]
fn a_condition_holds_until_its_columns_change() {
    let mut text = "t,u [m/s],n,mode,Engine 1\n".to_owned();
    for k in 0..ROWS {
        // The mode is logged when it changes.
        let mode = match k {
            50 | 300 => "10",
            150 => "4",
            _ => "",
        };
        text += &format!(
            "{:.1},{},{},{mode},{}\n",
            k as f64 * 0.1,
            0.01 * k as f64,
            k / 10 % 3,
            if k < 350 { 2 } else { 0 }
        );
    }
    for (condition, expected) in [
        ("mode == 10", &[[50.0, 149.0], [300.0, 399.0]][..]),
        ("mode == 10 && 'Engine 1' > 1", &[[50.0, 149.0], [300.0, 349.0]]),
        ("!(mode == 10)", &[[150.0, 299.0]]),
        ("u >= 1 and u < 2.195", &[[100.0, 219.0]]),
    ] {
        let log = log_as("day1.csv", &text);
        let prepared = used(log, &parts(&[], &[], Some(condition)), None).unwrap();
        assert_eq!(runs(&prepared), expected, "{condition}");
    }
    for (condition, said) in [
        ("gear == 1", "has no column `gear`"),
        ("mode == 11", "no row is in the parts that are named (where=\"mode == 11\")"),
    ] {
        let error = error_of(used(log_as("day1.csv", &text), &parts(&[], &[], Some(condition)), None));
        assert!(error.contains(said), "{error}");
    }
    let log = log_as("day1.csv", "t,u,n,mode\n0,1,1,AUTO\n1,1,2,MANUAL\n");
    let error = error_of(used(log, &parts(&[], &[], Some("mode == 1")), None));
    assert!(error.contains("line 2, column `mode`") && error.contains("holds text"), "{error}");
}

#[test]
fn dates_and_rows_without_a_time_are_chosen_as_well() {
    let mut text = "time,u [m/s],n\n".to_owned();
    for k in 0..ROWS {
        text += &format!("2024-05-01T10:00:{:04.1}Z,{},{}\n", k as f64 * 0.1, 0.01 * k as f64, k / 10 % 3);
    }
    let dated = |between: &str| used(log_as("day1.csv", &text), &parts(&[between], &[], None), None);
    for between in
        ["2024-05-01T10:00:05Z/2024-05-01T10:00:12Z", "5:12", "2024-05-01T12:00:05+02:00/2024-05-01T10:00:12"]
    {
        assert_eq!(runs(&dated(between).unwrap()), [[50.0, 120.0]], "{between}");
    }
    let error = error_of(dated("2024-05-02T10:00:05Z/2024-05-02T10:00:12Z"));
    assert!(error.contains("its times are from 0.0 s to 39.9 s"), "{error}");
    let error =
        error_of(used(counting(), &parts(&["2024-05-01T10:00:05Z/2024-05-01T10:00:12Z"], &[], None), None));
    assert!(error.contains("have no date") && error.contains("120:480"), "{error}");

    // Rows without a time are those of the step: what is left out is a gap.
    let text: String = std::iter::once("u [m/s],n\n".to_owned())
        .chain((0..ROWS).map(|k| format!("{},{}\n", 0.01 * k as f64, k % 3)))
        .collect();
    let prepared = used(log_as("day1.csv", &text), &parts(&[], &["12:30"], None), Some(0.1)).unwrap();
    assert_eq!(runs(&prepared), [[0.0, 119.0], [301.0, 399.0]]);
}

#[test]
fn what_is_no_stretch_is_an_error() {
    for (text, said) in [
        ("5", "START:END"),
        (":", "START:END"),
        ("a:b", "START:END"),
        ("10:00:05", "START:END"),
        ("12:5", "not after its start"),
        ("2024-05-01/2024-05-02", "START:END"),
        ("1:inf", "START:END"),
    ] {
        let error = text.parse::<hydroid::log::Stretch>().unwrap_err().to_string();
        assert!(error.contains(said), "{text}: {error}");
    }
    let parts = parts(&["day2.csv=5:12"], &[], None).parts;
    let error = error_of(parts.check_names(&["runs/day1.csv".to_owned()]));
    assert!(error.contains("no log that is read has the name `day2.csv`: runs/day1.csv"), "{error}");
    assert!(parts.check_names(&["runs/day2.csv".to_owned()]).is_ok());
    assert!(parts.of_log("runs/day1.csv").is_all());
}
