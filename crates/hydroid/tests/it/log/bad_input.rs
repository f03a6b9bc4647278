//! Invalid logs: each message states place and remedy.

use super::{error, error_of, has_note, log, log_as, prepared, table};
use hydroid::log::{LogError, PrepareOptions, Selection, prepare, read};

fn u(k: usize) -> String {
    format!("{}", (k % 7) as f64 * 0.1)
}

fn n(k: usize) -> String {
    format!("{}", k / 5)
}

fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn missing_file() {
    let message = error_of(read(std::path::Path::new("no/such/log.csv")));
    says(&message, &["no/such/log.csv", "no such file", "spelling"]);
}

#[test]
fn empty_file() {
    says(&error(""), &["log.csv is empty"]);
}

#[test]
fn no_header() {
    says(&error("0,1,2\n1,2,3\n"), &["log.csv", "not column names", "add a first line"]);
}

#[test]
fn unknown_column_with_the_nearest_names() {
    let log = log("t,surge_speed,sway_speed,rpm_port\n0,1,2,3\n");
    let selection = Selection::of("u=surge_sped", "n=rpm_port").unwrap();
    let message = error_of(prepare(&[log], &selection, &PrepareOptions::default()));
    says(&message, &["no column `surge_sped`", "did you mean `surge_speed`", "sway_speed, rpm_port"]);
}

#[test]
fn text_in_a_number_column() {
    let text = table(10, |k| if k == 6 { "fault".into() } else { u(k) }, n);
    says(&error(&text), &["log.csv, line 8", "column `u`", "`fault` is not a number", "blank"]);
}

#[test]
fn text_elsewhere_is_no_error() {
    let log = log("t,u,n,mode\n0,1,2,auto\n1,2,2,auto\n2,1,3,hand\n");
    let selection = Selection::of("u", "n").unwrap();
    assert!(prepare(std::slice::from_ref(&log), &selection, &PrepareOptions::default()).is_ok());
    let selection = Selection::of("u", "n,mode").unwrap();
    says(&error_of(prepare(&[log], &selection, &PrepareOptions::default())), &["text in every row"]);
}

#[test]
fn a_row_of_units_is_read_and_dates_have_their_own_message() {
    for units in ["s,kn,rpm", "[s],[kn],(rpm)", "s,kn,rpm,", "sec,kn,rpm"] {
        let run = prepared(&format!("t,u,n\n{units}\n0,2,60\n1,2,60\n2,1,90\n3,1,90\n")).runs.remove(0);
        assert_eq!(
            (run.outputs.row(0), run.inputs.row(0)),
            (&[2.0 * 1852.0 / 3600.0][..], &[1.0][..]),
            "{units}"
        );
    }
    // A row of states, and one with a single unit, are none.
    for text in ["t,u,n\nN/A,off,m\n0,1,2\n1,2,2\n2,1,3\n", "t,u,n\nstart,m/s,x\n0,1,2\n1,2,2\n2,1,3\n"] {
        says(&error(text), &["line 2"]);
    }
    let dated = "t,u,n\n03/08/2020 11:04:37,1,2\n03/08/2020 11:04:38,2,2\n";
    says(&error(dated), &["line 2", "column `t`", "as seconds"]);
}

#[test]
fn infinity() {
    let text = table(10, |k| if k == 6 { "-inf".into() } else { u(k) }, n);
    says(&error(&text), &["line 8", "column `u`", "`-inf` is infinite"]);
}

#[test]
fn one_nan_stays_missing() {
    let p = prepared(&table(20, |k| if k == 6 { "NaN".into() } else { u(k) }, n));
    assert_eq!(p.runs.len(), 1);
    let run = &p.runs[0];
    assert_eq!(run.len(), 20);
    assert_eq!(run.outputs.column(0).filter(|x| x.is_nan()).count(), 1);
    assert!(run.outputs.row(6)[0].is_nan());
    assert!(has_note(&p, "missing in 1 of 20"), "{:?}", p.notes);
}

#[test]
fn all_nan() {
    says(&error(&table(20, |_| "NaN".into(), n)), &["log.csv", "column `u` holds no value"]);
    says(&error(&table(20, u, |_| String::new())), &["log.csv", "column `n` holds no value"]);
}

#[test]
fn two_identical_time_stamps() {
    let message = error("t,u,n\n0,1,0\n1,2,0\n1,3,0\n2,4,1\n");
    says(&message, &["log.csv, line 4", "two identical time stamps", "line 3", "delete"]);
}

#[test]
fn time_running_backwards() {
    let message = error("t,u,n\n0,1,0\n2,2,0\n1,3,0\n3,4,1\n");
    says(&message, &["log.csv, line 4", "time runs backwards", "from 2 s to 1 s", "sort the rows"]);
    let rows =
        |from: usize| (from..from + 20).map(|k| format!("{}.5,{},{}\n", k, u(k), n(k))).collect::<String>();
    // A clock that restarts, once or more often, begins a run of its own.
    for (text, count) in [
        (format!("t,u,n\n{}{}", rows(900), rows(3)), "once,"),
        (format!("t,u,n\n{}{}{}", rows(900), rows(3), rows(3)), "several times, first"),
    ] {
        let p = prepared(&text);
        let said = format!("log.csv: the clock goes back {count} before line 22, from 919.500 s to 3.500 s");
        assert!(p.notes.iter().any(|n| n.is_warning() && n.message.contains(&said)), "{:?}", p.notes);
        assert!(p.runs.iter().all(|run| run.len() == 20) && p.runs[1].t0 == 919.5 + 3600.0);
    }
    // Rows in a wrong order do not.
    let text: String = format!("t,u,n\n{}0.5,1,0\n1.5,2,0\n", rows(900));
    says(&error(&text), &["log.csv, line 22", "sort the rows"]);
}

#[test]
fn one_sample() {
    says(&error("t,u,n\n0,1,2\n"), &["1 usable samples", "at least 3"]);
    says(&error("t,u,n\n0,1,2\n1,1,2\n"), &["2 usable samples"]);
}

#[test]
fn different_columns_in_two_files() {
    let a = log_as("a.csv", &table(10, u, n));
    let b = log_as("b.csv", &table(10, u, n).replace(",n\n", ",rpm\n"));
    let selection = Selection::of("u", "n").unwrap();
    let message = error_of(prepare(&[a.clone(), b], &selection, &PrepareOptions::default()));
    says(&message, &["a.csv", "b.csv", "no column `n`"]);
    let b = log_as("b.csv", &table(10, u, n).replace("u [m/s]", "u"));
    let message = error_of(prepare(&[a, b], &selection, &PrepareOptions::default()));
    says(&message, &["a.csv", "b.csv", "`u`", "m/s", "no stated unit"]);
}

#[test]
fn a_constant_channel() {
    let p = prepared(&table(20, u, |_| "5".into()));
    assert!(p.notes.iter().any(|n| n.is_warning() && n.message.contains("`n` is constant")), "{:?}", p.notes);
    says(&error(&table(20, |_| "1".into(), n)), &["no output ever changes"]);
}

#[test]
fn a_billion_in_a_velocity_column() {
    let text = table(20, |k| if k == 6 { "1e9".into() } else { u(k) }, n);
    says(&error(&text), &["log.csv, line 8", "column `u`", "1000000000 m/s", "unit", "spike"]);
    let text = table(20, u, |k| if k == 6 { "1e12".into() } else { n(k + 5) });
    says(&error(&text), &["log.csv, line 8", "column `n`", "a million times"]);
}

#[test]
fn milliseconds_since_1970_are_not_seconds() {
    let message = error("t,u,n\n1.7e12,1,0\n1.7001e12,2,0\n1.7002e12,1,0\n");
    says(&message, &["line 2", "not plausible", "[ms]"]);
}

#[test]
fn no_time_outputs_or_inputs_to_guess() {
    let guess =
        |text: &str| error_of(prepare(&[log(text)], &Selection::default(), &PrepareOptions::default()));
    says(&guess("when,u,n_cmd\n0,1,2\n"), &["time=\"COLUMN\"", "when, u, n_cmd"]);
    says(&guess("when,u,n_cmd\n0,1,2\n"), &["no time column", "with dt in seconds"]);
    says(&guess("t,speed,n_cmd\n0,1,2\n"), &["outputs=", "t, speed, n_cmd"]);
    says(&guess("t,u,n\n0,1,2\n"), &["inputs=", "t, u, n"]);
}

#[test]
fn invalid_options() {
    let selection = Selection::of("u", "n").unwrap();
    let log = log(&table(20, u, n));
    for dt in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        let options = PrepareOptions { dt: Some(dt), ..PrepareOptions::default() };
        assert!(matches!(
            prepare(std::slice::from_ref(&log), &selection, &options),
            Err(LogError::BadOption { .. })
        ));
    }
    assert!(matches!(prepare(&[], &selection, &PrepareOptions::default()), Err(LogError::NoFiles)));
    let twice = Selection::of("u,u", "n").unwrap();
    says(&error_of(prepare(&[log], &twice, &PrepareOptions::default())), &["`u` is selected twice"]);
}

#[test]
fn a_step_far_below_the_logs() {
    let selection = Selection::of("u", "n").unwrap();
    let options = PrepareOptions { dt: Some(0.04), ..PrepareOptions::default() };
    let message = error_of(prepare(&[log(&table(20, u, n))], &selection, &options));
    says(&message, &["a step of 0.04 s", "log.csv has a sample every 0.1 s", "leave dt out or give 0.05"]);
}

#[test]
fn a_wind_direction_in_degrees_without_its_unit() {
    let with = |header: &str, wind: &str| {
        let log = log(&format!("t,u,n,ws,{header}\n0,1,1,2,3\n1,2,2,2,\n2,1,3,3,-180\n3,1,3,3,180\n"));
        let selection = Selection { wind: Some(wind.parse().unwrap()), ..Selection::of("u", "n").unwrap() };
        prepare(&[log], &selection, &PrepareOptions::default())
    };
    let message = error_of(with("DIR", "ws,DIR"));
    says(&message, &["log.csv, line 4", "column `DIR`", "-180", "looks like degrees", "`DIR [deg]`"]);
    for (header, wind) in
        [("DIR", "ws,DIR [deg]"), ("DIR [Deg]", "ws,DIR"), ("DIR", "ws,DIR [rad]"), ("DIR", "ws,DIR * 0.01")]
    {
        assert!(with(header, wind).is_ok(), "{header} {wind}");
    }
}
