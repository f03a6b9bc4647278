//! The inspection of a file leaves out columns, and reports the same as the inspection of the whole log.

use std::fmt::Write as _;
use std::io::Write as _;

use hydroid::log::{
    ChannelSpec, InputDelay, PrepareOptions, Selection, inspect, inspect_file, prepare, read,
};

/// A boat that turns, with its pose, true values, a force that is not used, and a mode in words.
fn boat(rows: usize) -> Vec<Vec<String>> {
    let row = |k: usize| {
        let t = k as f64 * 0.1;
        let (u, v, r) = (2.0 + (0.3 * t).sin(), 0.2 * (0.5 * t).cos(), 0.3 * (0.2 * t).sin());
        let psi = 1.5 * (1.0 - (0.2 * t).cos());
        let numbers = [t, (0.3 * t + 0.2).sin(), psi, u, v, r, 2.0 * t, -t, u + 0.01, 0.3 - v, 40.0 * u];
        let mut cells: Vec<String> = numbers.iter().map(ToString::to_string).collect();
        cells.push(if k.is_multiple_of(2) { "auto" } else { "hand" }.to_owned());
        cells
    };
    (0..rows).map(row).collect()
}

const HEADER: &str = "t,n_cmd,heading [rad],u,v,r,x,y,u_true,v_true,force [N],mode";

/// A change of the rows.
type Edit = fn(&mut Vec<Vec<String>>);

#[test]
fn an_inspected_file_has_the_report_of_the_whole_log() {
    let plain = Selection::default();
    let named = |outputs: &str, inputs: &str| Selection {
        outputs: ChannelSpec::parse_list(outputs).unwrap(),
        inputs: ChannelSpec::parse_list(inputs).unwrap(),
        ..Selection::default()
    };
    let edits: [(&str, Edit); 6] = [
        ("complete", |_| {}),
        ("repeated rows", |rows| {
            for k in [30, 31, 90] {
                let row = rows[k].clone();
                rows.insert(k, row);
            }
        }),
        ("rows that repeat all but an unused column", |rows| {
            let mut row = rows[50].clone();
            row[10] = "1".to_owned();
            rows.insert(51, row);
        }),
        ("rows without a time, and gaps", |rows| {
            rows[20][0].clear();
            rows[60][2].clear();
            for row in &mut rows[100..140] {
                row[3].clear();
            }
            rows.drain(200..210);
        }),
        ("text in an unused column and in a true value", |rows| {
            rows[70][10] = "high".to_owned();
            rows[71][8] = "high".to_owned();
        }),
        ("constant columns", |rows| {
            for row in rows {
                row[10] = "3".to_owned();
                row[1] = "1".to_owned();
            }
        }),
    ];
    let selections = [
        plain,
        named("u,r", "n_cmd"),
        named("u=u [kn],v,r=r [deg/s]", "n_cmd,mode"),
        named("u,r", "force"),
        named("u,speed", "n_cmd"),
        named("u,r", "u"),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut prepared_once = false;
    for (what, edit) in edits {
        let mut rows = boat(600);
        edit(&mut rows);
        for header in [HEADER, &HEADER.replace("n_cmd", "throttle"), &HEADER.replace("t,", "when,")] {
            let mut text = format!("{header}\n");
            for row in &rows {
                writeln!(text, "{}", row.join(",")).unwrap();
            }
            std::fs::File::create(&path).unwrap().write_all(text.as_bytes()).unwrap();
            for (selection, dt) in selections.iter().flat_map(|own| [(own, None), (own, Some(0.2))]) {
                let options =
                    PrepareOptions { dt, input_delay: InputDelay::Samples(1), ..PrepareOptions::default() };
                let log = read(&path).unwrap();
                let expected = inspect(&log, selection, &options);
                let found = inspect_file(&path, selection, &options);
                let report = found.as_ref().map(|(inspection, _)| inspection);
                assert_eq!(format!("{report:?}"), format!("{expected:?}"), "{what}, {header}, {selection:?}");
                let (Ok((_, runs)), Ok(prepared)) = (&found, prepare(&[log], selection, &options)) else {
                    continue;
                };
                prepared_once = true;
                assert_eq!(runs.len(), prepared.runs.len(), "{what}");
                for (run, expected) in runs.iter().zip(&prepared.runs) {
                    let shown = |run: &hydroid::log::Trajectory| {
                        format!(
                            "{} {} {} {:?} {:?} {:?}",
                            run.name, run.t0, run.dt, run.outputs, run.inputs, run.heading
                        )
                    };
                    assert_eq!(shown(run), shown(expected), "{what}");
                }
            }
        }
    }
    assert!(prepared_once);
}
