//! Clocks of real loggers: dates, no time, milliseconds, repeated rows.

use super::{error, error_of, has_note, log, output, prepared, prepared_with};
use hydroid::log::{PrepareOptions, Selection, prepare};

/// A log with these times.
fn timed(header: &str, times: &[&str]) -> String {
    let rows = times.iter().enumerate().map(|(k, t)| format!("{t},{},{}\n", k % 7, k / 3));
    format!("{header},u,n\n{}", rows.collect::<String>())
}

fn stamps(rows: usize) -> Vec<String> {
    (0..rows).map(|k| format!("2020-08-03T11:{:02}:{:02}.{}25Z", 4 + k / 600, k / 10 % 60, k % 10)).collect()
}

fn stamped(header: &str, rows: usize) -> String {
    let stamps = stamps(rows);
    timed(header, &stamps.iter().map(String::as_str).collect::<Vec<_>>())
}

fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn dates_are_seconds_since_the_first_of_them() {
    // For any unit in the header.
    for header in ["t", "t [s]", "Timestamp [UTC]", "timestamp [ms]"] {
        let p = prepared(&stamped(header, 1500));
        assert_eq!((p.runs.len(), p.runs[0].len()), (1, 1500));
        assert_eq!((p.runs[0].t0, p.runs[0].dt), (0.0, 0.1));
        assert!(has_note(&p, "log.csv: times are seconds since 2020-08-03T11:04:00.025Z"), "{:?}", p.notes);
        assert!(!has_note(&p, "UTC)") && !has_note(&p, "no unit"), "{:?}", p.notes);
        assert!(p.notes.iter().all(|n| !n.is_warning()), "{:?}", p.notes);
    }
}

#[test]
fn dates_with_offsets_spaces_and_without_zone() {
    let p = prepared(&timed(
        "t",
        &["2020-08-03T13:59:59.5+02:00", "2020-08-03T12:00:00Z", "", "2020-08-03T10:00:00.5-0200"],
    ));
    assert_eq!((p.runs[0].dt, p.runs[0].len()), (0.5, 3));
    assert!(has_note(&p, "1 row without a time stamp"), "{:?}", p.notes);
    let p = prepared(&timed(
        "t",
        &["2020-02-28 23:59:59", "2020-02-29 00:00:00", "2020-02-29 00:00:01", "2020-02-29 00:00:02"],
    ));
    assert_eq!((p.runs[0].dt, p.runs[0].len()), (1.0, 4));
    assert!(has_note(&p, "2020-02-28 23:59:59 (no zone is given: taken as UTC)"), "{:?}", p.notes);
}

#[test]
fn a_jump_between_dates_splits_relative_to_the_first() {
    let mut text = timed("t", &["2020-08-03T11:04:37Z", "2020-08-03T11:04:38Z", "2020-08-03T11:04:39Z"]);
    text += "2020-08-04T11:04:37Z,5,1\n2020-08-04T11:04:38Z,6,1\n2020-08-04T11:04:39Z,7,1\n";
    let p = prepared(&text);
    assert_eq!(p.runs.iter().map(|r| r.t0).collect::<Vec<_>>(), [0.0, 86_400.0]);
}

#[test]
fn bad_dates_are_reported_with_line_and_column() {
    let message =
        error(&timed("t", &["2020-08-03T11:04:37Z", "2020-13-03T11:04:38Z", "2020-08-03T11:04:39Z"]));
    says(
        &message,
        &["log.csv, line 3", "column `t`", "`2020-13-03T11:04:38Z` is not a number", "that exist"],
    );
    let message =
        error(&timed("t", &["2021-02-29T11:04:37Z", "2021-03-01T11:04:38Z", "2021-03-01T11:04:39Z"]));
    says(&message, &["line 2", "column `t`", "`2021-02-29T11:04:37Z`"]);
}

#[test]
fn dates_and_numbers_do_not_mix() {
    let date = "2020-08-03T11:04:37Z";
    says(&error(&timed("t", &[date, "38", "39"])), &["line 3", "column `t`: `38`", "another kind"]);
    says(&error(&timed("t", &["36", date, "38"])), &["line 3", "column `t`", date, "another kind"]);
    says(&error(&timed("t", &["fault", date, "38"])), &["line 2", "`fault` is not a number"]);
}

#[test]
fn dates_are_times_only() {
    let text = "t,u,n,when\n0,1,1,2020-08-03T11:04:37Z\n1,2,2,2020-08-03T11:04:38Z\n2,1,3,\n";
    assert_eq!(prepared(text).runs[0].len(), 3);
    for (outputs, inputs) in [("when", "n"), ("u", "n,when")] {
        let selection = Selection::of(outputs, inputs).unwrap();
        let message = error_of(prepare(&[log(text)], &selection, &PrepareOptions::default()));
        says(&message, &["line 2", "column `when`", "`2020-08-03T11:04:37Z` is not a number", "time column"]);
    }
}

#[test]
fn a_row_of_dates_and_numbers_is_no_header() {
    says(&error("2020-08-03T11:04:37Z,1,2\n2020-08-03T11:04:38Z,1,2\n"), &["not column names"]);
}

#[test]
fn rows_without_time_are_a_step_apart_if_it_is_given() {
    let text = "u,n\n1,0\n2,0\n1,0\n1,0\n3,1\n";
    says(&error(text), &["log.csv: no time column", "time=\"COLUMN\"", "with dt in seconds"]);
    let options = PrepareOptions { dt: Some(0.25), ..PrepareOptions::default() };
    let p = prepared_with(text, &options);
    assert_eq!((p.runs[0].t0, p.runs[0].dt), (0.0, 0.25));
    // Repeated rows are kept.
    assert_eq!(output(&p, 0, 0), [1.0, 2.0, 1.0, 1.0, 3.0]);
    assert!(has_note(&p, "no time column; the rows are taken as 0.25 s apart"), "{:?}", p.notes);
    // A column with several times is used, a column with one time is not.
    let p = prepared_with("t,u,n\n0,1,0\n0.5,2,0\n1,1,0\n1.5,3,1\n", &options);
    assert!(!has_note(&p, "no time column"), "{:?}", p.notes);
    let p = prepared_with("t,u,n\n4,1,0\n,2,0\n,1,0\n,3,1\n", &options);
    assert_eq!(p.runs[0].len(), 4);
}

#[test]
fn a_time_column_with_one_value_is_no_clock() {
    for text in ["t,u,n\n,1,0\n4,1,0\n,2,0\n,3,1\n", "t,u,n\n,1,0\n4,1,0\n4,2,0\n4,3,1\n"] {
        says(&error(text), &["log.csv, line 3, column `t`: 4 is the only time", "leave time out", "with dt"]);
    }
}

#[test]
fn steps_too_long_for_seconds_ask_for_the_unit() {
    let rows = "0,1,0\n100,2,0\n200,1,0\n300,3,1\n";
    says(
        &error(&format!("t,u,n\n{rows}")),
        &["log.csv, column `t`", "step is 100", "time=\"t [ms]\"", "t [s]"],
    );
    assert_eq!(prepared(&format!("t [s],u,n\n{rows}")).runs[0].dt, 100.0);
    assert_eq!(prepared(&format!("t_s,u,n\n{rows}")).runs[0].dt, 100.0);
    assert_eq!(prepared(&format!("t [ms],u,n\n{rows}")).runs[0].dt, 0.1);
    for (time, dt) in [("t [ms]", 0.1), ("t [s]", 100.0), ("t * 0.01", 1.0)] {
        let selection = Selection { time: Some(time.into()), ..Selection::of("u", "n").unwrap() };
        let log = log(&format!("t,u,n\n{rows}"));
        assert_eq!(prepare(&[log], &selection, &PrepareOptions::default()).unwrap().runs[0].dt, dt);
    }
    assert_eq!(prepared("t,u,n\n0,1,0\n30,2,0\n60,1,0\n90,3,1\n").runs[0].dt, 30.0);
}

#[test]
fn rows_written_twice_are_dropped() {
    let p = prepared("t,u,n,extra\n0,1,0,\n1,2,0,7\n1,2,0,7\n1,2,0,7\n2,1,0,\n2,1,0,\n3,4,1,1\n");
    assert_eq!(output(&p, 0, 0), [1.0, 2.0, 1.0, 4.0]);
    let told: Vec<_> = p.notes.iter().filter(|n| n.message.contains("repeat the row before")).collect();
    assert_eq!(told.len(), 1);
    assert!(told[0].is_warning());
    says(&told[0].message, &["log.csv: 3 rows dropped", "first in line 4"]);
    // Rows that differ in any column are ambiguous.
    let message = error("t,u,n,extra\n0,1,0,\n1,2,0,7\n1,2,0,8\n2,1,0,\n3,4,1,1\n");
    says(&message, &["log.csv, line 4", "two identical time stamps", "line 3"]);
}
