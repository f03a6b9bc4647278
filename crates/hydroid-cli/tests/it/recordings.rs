//! Recordings on the command line: topics, proposal, configuration file, conversion.

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::Stdio;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{Limit, done, hydroid, run, signal, text};

/// A boat on a weaving course, as a folder of topics.
fn boat(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    let stamp = |t: f64| format!("2026-05-01T10:00:{t:06.3}Z");
    let small = |k: u32| f64::sin(f64::from(k * k) * 12.9898);
    let mut gnss = "time,lat [deg],lon [deg],sog [kn],cog [deg]\n".to_owned();
    let mut compass = "time,heading [deg]\n".to_owned();
    let mut gyro = "time,yaw_rate [deg/s]\n".to_owned();
    let mut cmd = "time,rudder [deg]\n".to_owned();
    let (mut north, mut east) = (0.0, 0.0);
    for k in 0..300 {
        let t = 0.1 * f64::from(k);
        let psi = 40.0 + 30.0 * (0.5 * t).sin();
        if k % 2 == 0 {
            let (latitude, longitude) = (60.0 + north / 111_412.0, 5.0 + east / 55_800.0);
            let (speed, course) = (4.0 + 0.03 * small(k), psi + 0.4 * small(k + 1));
            let _ = writeln!(gnss, "{},{latitude:.9},{longitude:.9},{speed:.4},{course:.3}", stamp(t));
        }
        let _ = writeln!(compass, "{},{:.3}", stamp(t), psi + 0.3 * small(k + 2));
        let _ = writeln!(gyro, "{},{:.4}", stamp(t), 15.0 * (0.5 * t).cos() + 0.1 * small(k + 3));
        if k % 30 == 0 {
            let _ = writeln!(cmd, "{},{}", stamp(t), k % 50);
        }
        let speed = 4.0 * 1852.0 / 3600.0;
        let middle = (40.0 + 30.0 * (0.5 * t + 0.025).sin()).to_radians();
        north += 0.1 * speed * middle.cos();
        east += 0.1 * speed * middle.sin();
    }
    for (name, rows) in [("gnss", gnss), ("compass", compass), ("gyro", gyro), ("cmd", cmd)] {
        std::fs::write(folder.join(format!("{name}.csv")), rows).unwrap();
    }
}

#[test]
fn from_topics_to_a_run() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    boat(&folder.join("boat"));

    let shown = text(&done(folder, "inspect boat --write-config").stdout);
    for expected in [
        "boat: folder, 4 topics",
        "gyro: 300 rows, from 2026-05-01T10:00:00.000Z, duration 29.900 s, usual step 0.100 s",
        "gnss.sog                   kn",
        "heading: compass.heading",
        "command rudder: cmd.rudder",
        "written to hydroid.toml",
    ] {
        assert!(shown.contains(expected), "{expected} is missing in\n{shown}");
    }
    let apart = run(folder, "inspect boat --write-config new.toml");
    assert!(text(&apart.stderr).contains("give it as --write-config=new.toml"), "{}", text(&apart.stderr));
    assert!(apart.status.code() != Some(0) && !folder.join("new.toml").exists());
    let again = run(folder, "inspect boat --write-config");
    assert!(!again.status.success());
    assert!(
        text(&again.stderr).contains("hydroid.toml exists: --write-config writes a new file"),
        "{}",
        text(&again.stderr)
    );
    let json: Value = serde_json::from_slice(&done(folder, "inspect boat --json").stdout).unwrap();
    assert_eq!(json["topics"].as_array().map(Vec::len), Some(4));
    assert_eq!(json["proposal"]["selection"]["sensors"]["yaw_rate"], "gyro.yaw_rate");
    assert_eq!(
        json["config"].as_str(),
        Some(std::fs::read_to_string(folder.join("hydroid.toml")).unwrap().as_str())
    );

    let output = done(folder, "convert boat -o run.csv");
    assert!(
        text(&output.stdout).contains("rows of t, u, v, r, rudder, psi, x, y, deviation_u"),
        "{}",
        text(&output.stdout)
    );
    assert!(text(&output.stderr).contains("t = 0 is 2026-05-01T10:00:00.000Z"), "{}", text(&output.stderr));
    std::fs::remove_file(folder.join("hydroid.toml")).unwrap();
    let report: Value =
        serde_json::from_slice(&done(folder, "inspect run.csv --inputs rudder --json").stdout).unwrap();
    let mean = |name: &str| {
        let columns = report["columns"].as_array().unwrap();
        columns.iter().find(|column| column["name"] == name).unwrap()["mean"].as_f64().unwrap()
    };
    assert!((mean("u") - 2.06).abs() < 0.05, "{}", mean("u"));
    assert!(mean("r").abs() < 0.05, "{}", mean("r"));
}

/// The search for the statistics of the sensors ends at a signal, and nothing is written.
#[test]
fn a_signal_ends_the_computation_of_velocities() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    boat(&at.join("boat"));
    done(at, "inspect boat --write-config");
    let mut child =
        hydroid(at, &["convert", "boat", "-o", "run.csv"]).stderr(Stdio::piped()).spawn().unwrap();
    let _limit = Limit::of(&child);
    let mut notes = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    // The last note before the logs are read.
    assert!(notes.next().unwrap().contains("options from hydroid.toml"));
    signal(&child, "-INT");
    let rest: Vec<String> = notes.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert_eq!(rest, ["error: interrupted before it was done"]);
    assert!(!at.join("run.csv").exists());
}

#[test]
fn outputs_of_convert_are_checked() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    boat(&folder.join("boat"));
    boat(&folder.join("other"));
    for (args, expected) in [
        ("convert boat -o run.dat", "give -o a name that ends in .csv or .parquet"),
        ("convert boat other -o {}.dat", "give -o a name that ends in .csv or .parquet"),
        ("convert boat other -o run.csv", "is one file for 2 logs; give -o a folder, or a name with {}"),
        ("convert boat other -o out/run.parquet", "for those of the logs, as out/{}-run.parquet"),
        ("convert boat boat -o out", "two of the logs would be written to out/boat.csv"),
        ("convert boat boat -o {}.parquet", "two of the logs would be written to boat.parquet"),
        ("convert boat -o run.csv", "gnss.lat"),
        ("convert boat/gnss.csv -o boat/gnss.csv", "would overwrite it"),
        ("convert missing.BIN -o run.csv", "missing.BIN: there is no such file"),
    ] {
        let output = run(folder, args);
        assert!(!output.status.success(), "{args}");
        assert!(text(&output.stderr).contains(expected), "{args}: {}", text(&output.stderr));
    }
}

/// The names of the files in a folder.
fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_run_in_parquet_is_that_in_csv() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    boat(&folder.join("boat"));
    // The elements of an array are columns of their own, one of which starts late.
    let servo = "time,pwm_us[0],pwm_us[1]\n2026-05-01T10:00:05Z,1600,1400\n2026-05-01T10:00:07Z,,1450\n";
    std::fs::write(folder.join("boat/servo.csv"), servo).unwrap();
    let channels =
        "--outputs u=gnss.sog,psi=compass.heading,r=gyro.yaw_rate --inputs servo.pwm_us[0],servo.pwm_us[1]";
    for file in ["run.csv", "run.parquet"] {
        let output = done(folder, &format!("convert boat {channels} -o {file}"));
        let expected = format!("{file}: 150 rows of t, u, psi, r, servo.pwm_us[0], servo.pwm_us[1]");
        assert!(text(&output.stdout).contains(&expected), "{}", text(&output.stdout));
    }
    // Of a recording, the topics are in front of the table.
    let columns = |file: &str| -> Value {
        let args =
            format!("inspect {file} --outputs u,psi,r --inputs servo.pwm_us[0],servo.pwm_us[1] --json");
        let document: Value = serde_json::from_slice(&done(folder, &args).stdout).unwrap();
        document.as_array().and_then(|parts| parts.last()).unwrap_or(&document)["columns"].clone()
    };
    let csv = columns("run.csv");
    assert_eq!(columns("run.parquet"), csv);
    assert_eq!((&csv[3]["name"], &csv[3]["unit"]), (&Value::from("r"), &Value::from("rad/s")));
    assert_eq!((&csv[4]["name"], &csv[4]["missing"]), (&Value::from("servo.pwm_us[0]"), &Value::from(25)));

    // A command that reads named columns and the time.
    done(folder, "simulate simple --duration 60 --seed 1 -o log.csv");
    let [of_csv, of_parquet] = ["log-run.csv", "log-run.parquet"].map(|file| {
        done(folder, &format!("convert log.csv --outputs u,v,r --inputs PP_cmd,RD_cmd -o {file}"));
        let errors = done(folder, &format!("evaluate simple {file} --horizon 5s --json"));
        text(&errors.stdout).replace(file, "FILE")
    });
    assert!(of_csv.contains("\"windows\": 550"), "{of_csv}");
    assert_eq!(of_parquet, of_csv);
}

#[test]
fn several_runs_have_the_names_of_their_logs() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    boat(&folder.join("boat"));
    boat(&folder.join("other"));
    let channels = "--outputs u=gnss.sog,r=gyro.yaw_rate --inputs rudder=cmd.rudder";
    for (output, found) in [("out", "out"), ("csv/{}.csv", "csv"), ("parquet/run-{}.PARQUET", "parquet")] {
        done(folder, &format!("convert boat other {channels} -o {output}"));
        let names = match found {
            "parquet" => ["run-boat.PARQUET", "run-other.PARQUET"],
            _ => ["boat.csv", "other.csv"],
        };
        assert_eq!(files(&folder.join(found)), names);
    }
}

/// A table of sensors with times of day and a row of units, past midnight, as a logger in German writes it.
#[test]
fn inspect_proposes_the_sensors_of_a_table_without_velocities() {
    let folder = TempDir::new().unwrap();
    let mut table = "Datum;Uhrzeit;Breite;Länge;Kompass;Fahrt ü. Grund;Kurs ü. Grund;ruder_cmd\n;;deg;deg;deg;kn;deg;deg\n".to_owned();
    for k in 0..900 {
        let t = 0.2 * f64::from(k);
        let (day, s) = if t < 60.0 { (1, 86_340.0 + t) } else { (2, t - 60.0) };
        let (sine, cosine) = (0.05 * t).sin_cos();
        let (north, east) = (40.0 * sine, -40.0 * cosine);
        let course = (0.05 * t).to_degrees() % 360.0;
        let clock = format!("{:02}:{:02}:{:04.1}", (s / 3600.0).floor(), (s / 60.0).floor() % 60.0, s % 60.0);
        let _ = writeln!(
            table,
            "0{day}.05.2026;{clock};{:.8};{:.8};{course:.2};{:.3};{course:.2};{:.1}",
            54.0 + north / 111_200.0,
            8.0 + east / 65_400.0,
            3.888 + 0.02 * f64::from(k).sin(),
            10.0 * (0.3 * t).sin()
        );
    }
    std::fs::write(folder.path().join("tag.csv"), table).unwrap();
    let output = run(folder.path(), "inspect tag.csv");
    let said = text(&output.stdout);
    for expected in [
        "Fahrt ü. Grund             kn",
        "latitude: Breite",
        "speed: Fahrt ü. Grund",
        "course: Kurs ü. Grund",
        "command ruder_cmd",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    let output = run(folder.path(), "inspect tag.csv --json");
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(document["config"].as_str().unwrap().contains("[log.sensors]"), "{document}");
    run(folder.path(), "inspect tag.csv --write-config");
    let output = run(folder.path(), "convert tag.csv --config hydroid.toml -o out.csv");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let rows = std::fs::read_to_string(folder.path().join("out.csv")).unwrap();
    let names: Vec<&str> = rows.lines().next().unwrap().split(',').collect();
    let at = |name: &str| names.iter().position(|cell| cell.starts_with(name)).unwrap();
    let middle: Vec<f64> =
        rows.lines().nth(500).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!((middle[at("u ")] - 2.0).abs() < 0.05 && (middle[at("r ")] - 0.05).abs() < 0.005, "{middle:?}");
    assert!(rows.lines().count() > 850, "{}", rows.lines().count());
}

/// Milliseconds since 1970 were the year 2262.
#[test]
fn a_time_in_milliseconds_without_a_unit_is_refused_in_recordings() {
    let folder = TempDir::new().unwrap();
    let mut rows = String::new();
    for k in 0..50 {
        let _ = writeln!(rows, "{},54.0,8.0,{k}", 1_760_000_000_000_i64 + 200 * k);
    }
    std::fs::write(folder.path().join("ms.csv"), format!("timestamp,lat,lon,heading\n{rows}")).unwrap();
    let output = run(folder.path(), "inspect ms.csv --write-config");
    let said = text(&output.stderr);
    assert!(!output.status.success() && said.contains("timestamp [ms]"), "{said}");
}

/// Position, heading and two pulse widths of a catamaran: a model and a steered boat without a configuration by hand.
#[test]
fn a_table_of_one_day_becomes_a_steered_boat() {
    let folder = TempDir::new().unwrap();
    let mut table = "time,latitude,longitude,heading,speed,port_pwm,starboard_pwm\n".to_owned();
    // Numbers between -1 and 1 without a pattern.
    let scatter = |k: i32, of: f64| 2.0 * ((f64::from(k) * of).sin() * 43_758.547).rem_euclid(1.0) - 1.0;
    let ([mut north, mut east, mut psi], [mut u, mut r]) = ([0.0, 0.0, 0.3_f64], [0.0_f64, 0.0]);
    for k in 0..3000 {
        let pulse = |of: f64| 100.0 * (1.0 + 3.5 * scatter(k / 25, of)).round();
        let (port, starboard) = (pulse(12.9898), pulse(78.233));
        let _ = writeln!(
            table,
            "{:.1},{:.9},{:.9},{:.2},{:.3},{:.0},{:.0}",
            0.2 * f64::from(k),
            54.0 + (north + 0.03 * scatter(k, 3.7)) / 111_320.0,
            8.0 + (east + 0.03 * scatter(k, 5.3)) / 65_433.0,
            (psi.to_degrees() + 0.5 * scatter(k, 7.1)).rem_euclid(360.0),
            u.abs(),
            1500.0 + port,
            1500.0 + starboard
        );
        for _ in 0..4 {
            let (sum, difference) = ((port + starboard) / 400.0, (port - starboard) / 400.0);
            u += 0.05 * (0.6 * sum - 0.3 * u - 0.25 * u * u.abs());
            r += 0.05 * (0.9 * difference - 1.2 * r);
            psi += 0.05 * r;
            north += 0.05 * u * psi.cos();
            east += 0.05 * u * psi.sin();
        }
    }
    std::fs::write(folder.path().join("day1.csv"), table).unwrap();
    for (command, status) in [
        ("inspect day1.csv --write-config", 0),
        // An output is not judged.
        ("identify day1.csv --methods committee -o out", 1),
        ("control out/committee.safetensors --controller pid --task lawn-mower -o steered", 0),
    ] {
        let output = run(folder.path(), command);
        assert_eq!(output.status.code(), Some(status), "{command}: {}", text(&output.stderr));
    }
    // Without an inertial unit or velocities, the sway of a slow boat is that which the smoother assumes.
    let found = std::fs::read(folder.path().join("out/identify.json")).unwrap();
    let found: Value = serde_json::from_slice(&found).unwrap();
    let grades: Vec<&str> =
        found["verdicts"].as_array().unwrap().iter().map(|of| of["grade"].as_str().unwrap()).collect();
    assert_eq!(grades, ["good", "not_judged", "good"], "{found}");
    let reason = found["verdicts"][1]["reason"].as_str().unwrap();
    assert!(reason.contains("the sensors do not determine it"), "{reason}");
    let steered = std::fs::read(folder.path().join("steered/control.json")).unwrap();
    let steered: Value = serde_json::from_slice(&steered).unwrap();
    let off = steered["rms_position"].as_f64();
    assert!(steered["arrived"] == true && off.is_some_and(|off| off < 0.3), "{steered}");
    // The neutral pulse is a guess: no boat is commanded with it.
    let output = run(folder.path(), "control out/committee.safetensors --controller pid --task lawn-mower -");
    let said = text(&output.stderr);
    assert!(!output.status.success() && said.contains("--neutral port_pwm"), "{said}");
}
