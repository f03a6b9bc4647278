//! Too few data for a judgement, and inputs that contain the motion.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::common::{done, run, text};

/// The rows of a simulated log, header first.
fn simulated(at: &Path, duration_s: usize, seed: usize) -> Vec<Vec<String>> {
    done(at, &format!("simulate simple --seed {seed} --duration {duration_s} -o simulated.csv"));
    let log = fs::read_to_string(at.join("simulated.csv")).unwrap();
    log.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn write(at: &Path, file: &str, rows: &[Vec<String>], separator: &str) {
    let lines: Vec<String> = rows.iter().map(|row| row.join(separator)).collect();
    fs::write(at.join(file), lines.join("\n") + "\n").unwrap();
}

#[test]
fn a_short_log_is_not_enough_data_and_the_missing_minutes_are_enough() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let rows = simulated(at, 200, 1);
    let first = |seconds: f64| -> Vec<Vec<String>> {
        let is_early = |row: &&Vec<String>| row[0].parse::<f64>().is_ok_and(|t| t <= seconds);
        std::iter::once(&rows[0]).chain(rows[1..].iter().filter(is_early)).cloned().collect()
    };
    // CSV, the same with semicolons, and Parquet: too short for a block of one horizon.
    write(at, "short.csv", &first(6.0), ",");
    write(at, "short.txt", &first(6.0), ";");
    done(at, "convert short.csv -o short.parquet");
    for file in ["short.csv", "short.txt", "short.parquet"] {
        let identify = |file: &str, more: &str| {
            run(at, &format!("identify {file} --methods sindy --members 0 -o out {more}"))
        };
        let output = identify(file, "--json -q");
        assert_eq!(output.status.code(), Some(1), "{file}: {}", text(&output.stderr));
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(document.get("best").is_none(), "{file}");
        let missing = &document["not_enough_data"];
        assert_eq!((&missing["windows"], &missing["needed"]), (&json!(0), &json!(5)), "{file}");
        for verdict in document["verdicts"].as_array().unwrap() {
            assert_eq!(verdict["grade"], "not_judged");
            assert!(verdict["reason"].is_string());
        }
        let output = identify(file, "-q");
        let shown = text(&output.stdout);
        assert!(output.status.code() == Some(1) && shown.contains("not enough data: about "), "{shown}");
        let report = fs::read_to_string(at.join("out/report.html")).unwrap();
        assert!(report.contains("Not enough data.") && !report.contains("NaN") && !shown.contains("NaN"));

        write(at, "enough.csv", &first(6.0 + missing["missing_s"].as_f64().unwrap()), ",");
        let output = identify("enough.csv", "--json -q");
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(document.get("not_enough_data").is_none(), "{file}: {}", document["not_enough_data"]);
    }
}

#[test]
fn a_short_test_run_and_an_output_at_rest_are_not_graded() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let mut rows = simulated(at, 200, 2);
    write(at, "learn.csv", &rows, ",");
    done(at, "simulate simple --seed 3 --duration 25 -o judge.csv");
    done(at, "identify learn.csv --methods sindy --members 0 --horizon 20 -o out -q");
    let output = run(at, "identify learn.csv --test judge.csv --methods sindy --horizon 5s -o short -q");
    let shown = text(&output.stdout);
    assert!(output.status.code() == Some(1) && shown.contains("more minutes of test runs"), "{shown}");
    let output = run(at, "evaluate out/sindy.safetensors judge.csv --horizon 5s");
    let shown = text(&output.stdout);
    assert!(output.status.code() == Some(1) && shown.contains("NOT JUDGED"), "{shown}");

    // The yaw rate is stuck at zero.
    let place = rows[0].iter().position(|name| name.starts_with('r')).unwrap();
    rows[1..].iter_mut().for_each(|row| row[place] = String::from("0"));
    write(at, "stuck.csv", &rows, ",");
    let output = run(at, "evaluate out/sindy.safetensors stuck.csv --horizon 20");
    let shown = text(&output.stdout);
    assert!(output.status.code() == Some(1) && !shown.contains("NaN"), "{shown}");
    assert!(shown.contains("the output does not vary over the judged windows"), "{shown}");
    let output = run(at, "evaluate out/sindy.safetensors stuck.csv --horizon 20 --json -q");
    assert!(!text(&output.stdout).contains("NaN"));
}

/// A log of a vessel that an autopilot steers by heading error and yaw rate, with measured copies of its motion.
fn steered(separator: &str) -> String {
    let names = ["t", "rudder", "r", "copy", "late", "round", "heading", "rate", "fixed", "wind"];
    let mut log = names.join(separator) + "\n";
    let (mut psi, mut r, mut noise, mut wind) = (0.0_f64, 0.0_f64, 1_u32, 0.0);
    let mut white = || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(noise >> 8) / f64::from(1 << 23) - 1.0
    };
    let mut past: Vec<f64> = Vec::new();
    for k in 0..6000 {
        let course = [0.8, -0.4, 0.3, -1.0, 0.5, 0.1][k / 300 % 6];
        let measured = r + 0.002 * white();
        let rudder = (-0.8 * (psi - course) - 0.9 * measured).clamp(-0.5, 0.5);
        past.push(measured);
        let before = |lag: usize| past[past.len().saturating_sub(lag + 1)];
        let (rate, late) = ((measured - before(1)) / 0.1, before(2));
        wind = 0.99 * wind + 0.3 * white();
        let copy = 57.3 * measured + 0.3 * white();
        let cells = [
            0.1 * k as f64,
            rudder,
            measured,
            copy,
            late,
            (100.0 * measured).round() / 100.0,
            psi.to_degrees().rem_euclid(360.0),
            rate,
            3.0,
            5.0 + wind,
        ];
        let cells: Vec<String> = cells.iter().map(|cell| format!("{cell:.6}")).collect();
        let _ = writeln!(log, "{}", cells.join(separator));
        r += 0.1 * (-r / 2.0 - 0.6 * r * r.abs() + 0.4 * rudder + 0.002 * wind);
        psi += 0.1 * r;
    }
    log
}

#[test]
fn a_copy_of_the_motion_is_refused_and_the_rudder_of_an_autopilot_is_not() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    fs::write(at.join("run.csv"), steered(",")).unwrap();
    fs::write(at.join("run.txt"), steered(";")).unwrap();
    done(
        at,
        "convert run.csv --outputs r --inputs rudder,copy,late,round,heading,rate,fixed,wind -o run.parquet",
    );
    let identify = |file: &str, inputs: &str, more: &str| {
        let options =
            "--outputs r --methods sindy --degree 1 --members 0 --horizon 5s --rate-limit none -o out -q";
        run(at, format!("identify {file} --inputs {inputs} {options} {more}").trim())
    };
    for (file, input, form) in [
        ("run.csv", "copy", "is output 'r'"),
        ("run.txt", "late", "is output 'r'"),
        ("run.parquet", "round", "is output 'r'"),
        ("run.txt", "heading", "is the integral of output 'r'"),
        ("run.csv", "rate", "is the rate of change of output 'r'"),
    ] {
        let output = identify(file, &format!("rudder,{input}"), "");
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{file} {input}: {said}");
        for words in
            [&format!("'{input}' {form} in disguise"), "% of it", &format!("--allow-feedback {input}")]
        {
            assert!(said.contains(words), "{words}: {said}");
        }
        let output = identify(file, &format!("rudder,{input}"), &format!("--allow-feedback {input}"));
        assert_ne!(output.status.code(), Some(2), "{file} {input}: {}", text(&output.stderr));
    }
    for file in ["run.csv", "run.txt", "run.parquet"] {
        let output = identify(file, "rudder,fixed,wind", "");
        assert_ne!(output.status.code(), Some(2), "{file}: {}", text(&output.stderr));
    }
    let output = identify("run.csv", "rudder", "--allow-feedback ruder");
    assert!(text(&output.stderr).contains("there is no input 'ruder'"), "{}", text(&output.stderr));
}

/// A boat whose propulsion was switched off while commands went on spoiled the model without a word.
#[test]
fn parts_in_which_the_motion_does_not_follow_the_commands_are_named() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let mut rows = simulated(at, 300, 4);
    let outputs: Vec<usize> =
        ["u", "v", "r"].map(|name| rows[0].iter().position(|cell| cell.starts_with(name)).unwrap()).into();
    for row in &mut rows[1..] {
        if (100.0..155.0).contains(&row[0].parse::<f64>().unwrap()) {
            for c in &outputs {
                row[*c] = "0.001".to_owned();
            }
        }
    }
    write(at, "off.csv", &rows, ",");
    let identify = |more: &str| {
        let output = run(at, &format!("identify off.csv --methods sindy --members 0 {more}-o out"));
        text(&output.stderr) + &text(&output.stdout)
    };
    let said = "the motion does not follow the commands as elsewhere";
    let shown = identify("");
    assert!(shown.contains(said) && shown.contains("off.csv, 100 to 150 s"), "{shown}");
    assert!(shown.contains("--exclude"), "{shown}");
    let used = "rows are used (--exclude off.csv=99:156)";
    let shown = identify("--exclude off.csv=99:156 ");
    assert!(shown.contains(used) && !shown.contains(said), "{shown}");
    // The same in a file.
    fs::write(at.join("hydroid.toml"), "[log]\nexclude = ['off.csv=99:156']\n").unwrap();
    let shown = identify("");
    assert!(shown.contains(used) && !shown.contains(said), "{shown}");
}

/// What a log lacks, and an experiment after which it lacks nothing, by the simulated vessel itself.
#[test]
fn a_plan_adds_what_a_log_lacks() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let rows = simulated(at, 40, 2);
    write(at, "short.csv", &rows, ",");
    let shown = text(&done(at, "inspect short.csv --plan plan.csv").stdout);
    assert!(
        shown.contains("s with changing commands are recorded") && shown.contains("written to plan.csv"),
        "{shown}"
    );
    done(at, "simulate simple --excitation plan.csv --noise 0 -o next.csv");
    let document = |files: &str| -> Value {
        serde_json::from_slice(&done(at, &format!("inspect {files} --json -q")).stdout).unwrap()
    };
    let before = document("short.csv");
    assert!(before["excitation"]["lacks"].as_array().unwrap().len() > 2, "{before}");
    let shown = text(&done(at, "inspect short.csv next.csv").stdout);
    let after = shown.split("all logs together").nth(1).unwrap();
    assert!(!after.contains("are needed"), "{after}");
}
