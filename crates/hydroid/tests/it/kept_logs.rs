//! Logs as people keep them: several sessions in a file, clocks of any name, pauses. No motion is invented.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "times are positive, and few")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use hydroid::log::{ChannelSpec, LogError, Note, Parts, PrepareOptions, RawLog, Selection, Sensors, prepare};
use hydroid::progress::silent;
use hydroid::recording::{converted, read_logs, survey};
use tempfile::TempDir;

use crate::recording::Noise;

/// A sample of a boat with a rudder: time \[s\], place north and east \[m\], heading \[rad\], surge \[m/s\], rudder \[deg\].
type Sample = [f64; 6];

/// Zigzags of a boat at 0.2 s, with the noise of its sensors.
fn boat(seconds: u32, seed: u64) -> Vec<Sample> {
    let mut noise = Noise(seed);
    let (mut north, mut east, mut psi, mut u, mut v, mut r) = (0.0, 0.0, 0.4, 2.0, 0.0, 0.0);
    let mut rows = Vec::new();
    for k in 0..50 * seconds {
        let t = f64::from(k) * 0.02;
        let rudder = if (k / 600).is_multiple_of(2) { 10.0 } else { -10.0 };
        if k % 10 == 0 {
            let place = [north, east].map(|x| x + 0.05 * noise.draw());
            rows.push([t, place[0], place[1], psi + 0.005 * noise.draw(), u, rudder]);
        }
        let (sine, cosine) = f64::sin_cos(psi);
        north += 0.02 * (u * cosine - v * sine);
        east += 0.02 * (u * sine + v * cosine);
        psi += 0.02 * r;
        u += 0.02 * ((2.0 - u) / 8.0 - 2.0 * r * r);
        v += 0.02 * (-0.8 * r - v);
        r += 0.02 * (0.02 * rudder - r) / 1.5;
    }
    rows
}

/// Samples as a CSV file with the time in a column of a name and unit.
fn csv(rows: &[Sample], time: &str, per_s: f64) -> String {
    let mut text = format!("{time},north [m],east [m],heading [rad],rudder [deg]\n");
    for [t, north, east, psi, _, rudder] in rows {
        let _ = writeln!(text, "{:.0},{north:.3},{east:.3},{psi:.4},{rudder}", per_s * t);
    }
    text
}

/// Samples as sentences of NMEA, from a time of the day \[s\] and a latitude \[deg\].
fn nmea(rows: &[Sample], day_s: f64, latitude: f64) -> String {
    let minutes =
        |degrees: f64, width: usize| format!("{:0width$}{:08.5}", degrees.trunc(), 60.0 * degrees.fract());
    let mut text = String::new();
    let mut write = |body: String| {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        let _ = writeln!(text, "${body}*{sum:02X}");
    };
    for [t, north, east, psi, _, rudder] in rows {
        let s = day_s + t;
        let (h, m) = ((s / 3600.0).floor(), (s % 3600.0 / 60.0).floor());
        let lat = minutes(latitude + north / 111_300.0, 2);
        let lon = minutes(10.0 + east / (111_300.0 * latitude.to_radians().cos()), 3);
        write(format!("GPGGA,{h:02}{m:02}{:05.2},{lat},N,{lon},E,4,12,0.8,0.0,M,0.0,M,,", s % 60.0));
        write(format!("HEHDT,{:.2},T", psi.to_degrees().rem_euclid(360.0)));
        write(format!("IIRSA,{rudder:.1},A,,"));
    }
    text
}

/// The sensors of the CSV files.
fn sensors(prefix: &str) -> Selection {
    let spec = |name: &str| Some(format!("{prefix}{name}").parse().unwrap());
    let sensors =
        Sensors { north: spec("north"), east: spec("east"), heading: spec("heading"), ..Sensors::default() };
    Selection {
        inputs: ChannelSpec::parse_list(&format!("rudder={prefix}rudder")).unwrap(),
        sensors: Some(sensors),
        ..Selection::default()
    }
}

fn written(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn tables(path: &Path, selection: &Selection) -> Result<(RawLog, Vec<Note>), LogError> {
    let mut selection = selection.clone();
    let (mut logs, mut notes) =
        read_logs(&[path], &mut selection, &PrepareOptions::default(), &mut silent())?;
    // Every command reads the table in this way.
    let table = converted(&logs.remove(0), &selection, &mut notes)?;
    Ok((table, notes))
}

fn column<'a>(log: &'a RawLog, name: &str) -> &'a [f64] {
    &log.columns[log.position(name).unwrap()].values
}

fn mean(log: &RawLog, name: &str) -> f64 {
    column(log, name).iter().sum::<f64>() / log.rows() as f64
}

/// Mean surge of a boat \[m/s\].
fn mean_speed(rows: &[Sample]) -> f64 {
    rows.iter().map(|row| row[4]).sum::<f64>() / rows.len() as f64
}

/// Runs of a table: ranges of rows without a jump in time.
fn runs(log: &RawLog) -> Vec<std::ops::Range<usize>> {
    let t = column(log, "t");
    let ends = (1..t.len()).filter(|k| t[*k] - t[k - 1] > 1.0).chain([t.len()]);
    ends.scan(0, |from, to| Some(std::mem::replace(from, to)..to)).collect()
}

fn said<'a>(notes: &'a [Note], text: &str) -> Option<&'a Note> {
    notes.iter().find(|note| note.message.contains(text))
}

/// Two sessions in one file were interleaved by the time of day.
#[test]
fn a_clock_that_goes_back_begins_a_run_of_its_own() {
    let folder = TempDir::new().unwrap();
    let rows = |from: f64, value: u32| -> String {
        (0..20).fold(String::new(), |text, k| text + &format!("{},{value}\n", from + f64::from(k)))
    };
    let motion = format!("t [s],u [m/s]\n{}{}", rows(0.0, 1), rows(0.5, 2));
    written(&folder, "motion.csv", &motion);
    written(&folder, "cmd.csv", "t [s],n_cmd\n0,7\n");
    let warning =
        "the clock goes back at row 21 of `motion`, from 19.000 s on the clock of the file to 0.500 s";
    let (log, notes) = tables(folder.path(), &Selection::of("u=motion.u", "n=cmd.n_cmd").unwrap()).unwrap();
    assert!(said(&notes, warning).is_some_and(Note::is_warning), "{notes:?}");
    assert_eq!(runs(&log), [0..20, 20..40]);
    let expected: Vec<f64> = (0..40).map(|k| if k < 20 { 1.0 } else { 2.0 }).collect();
    assert_eq!(column(&log, "u"), expected);
    let found = survey(folder.path(), None).unwrap();
    assert!(said(&found.notes, warning).is_some_and(Note::is_warning), "{:?}", found.notes);
}

/// The same with sensors: positions of two places were taken for those of one boat, and the rudder of the other session.
#[test]
fn two_sessions_of_sensors_in_a_file_are_two_runs() {
    let folder = TempDir::new().unwrap();
    let (first, second) = (boat(60, 1), boat(60, 2));
    let turned: Vec<Sample> =
        second.iter().map(|[t, n, e, psi, u, d]| [*t, *n + 80_000.0, *e, *psi, *u, -d]).collect();
    let sentences = nmea(&first, 36_000.0, 55.0) + &nmea(&turned, 36_000.1, 55.0);
    let nmea = written(&folder, "two.nmea", &sentences);
    let found = survey(&nmea, None).unwrap();
    assert!(said(&found.notes, "the clock goes back at row 301 of `GGA`").is_some(), "{:?}", found.notes);
    let spec = |name: &str| Some(name.parse().unwrap());
    let sensors = Sensors {
        latitude: spec("GGA.latitude"),
        longitude: spec("GGA.longitude"),
        heading: spec("HDT.heading"),
        ..Sensors::default()
    };
    let selection = Selection {
        inputs: ChannelSpec::parse_list("rudder=RSA.starboard").unwrap(),
        sensors: Some(sensors),
        ..Selection::default()
    };
    let (log, notes) = tables(&nmea, &selection).unwrap();
    assert!(said(&notes, "the clock goes back at row 301 of `GGA`").is_some(), "{notes:?}");
    assert!(said(&notes, "outliers").is_none() && said(&notes, "left out").is_none(), "{notes:?}");
    let runs = runs(&log);
    assert_eq!(runs.len(), 2, "{runs:?}");
    for (run, rows) in runs.iter().zip([&first, &turned]) {
        assert!(run.len() > 295, "{runs:?}");
        let rudder = &column(&log, "rudder")[run.clone()];
        assert!((rudder[2] - rows[2][5].to_radians()).abs() < 1e-9, "{}", rudder[2]);
        let x = &column(&log, "x")[run.clone()];
        assert!(x.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 2.0));
    }
    let between = column(&log, "x")[runs[1].start] - column(&log, "x")[runs[0].end - 1];
    assert!(between > 79_000.0, "{between}");
}

/// Parts of a bag in the order of their names, a late row and a wrong stamp are no other clock.
#[test]
fn rows_in_another_order_are_no_other_clock() {
    let folder = TempDir::new().unwrap();
    let row = |k: usize| match k {
        50 => 49.0 - 20.0,
        100 => 100.0 + 5000.0,
        k => k as f64,
    };
    let text =
        (0..200).fold("t [s],u [m/s]\n".to_owned(), |text, k| text + &format!("{},{k}\n", row(k) + 0.5));
    written(&folder, "motion.csv", &text);
    written(&folder, "cmd.csv", "t [s],n_cmd\n0,7\n");
    let (log, notes) = tables(folder.path(), &Selection::of("u=motion.u", "n=cmd.n_cmd").unwrap()).unwrap();
    assert!(said(&notes, "goes back").is_none(), "{notes:?}");
    assert!(column(&log, "t").is_sorted(), "{:?}", column(&log, "t"));
    // Later times that come first.
    let stamps = |from: u32| {
        (0..60).fold(String::new(), |text, k| text + &format!("2026-05-01T10:{from:02}:{k:02}Z,{from}\n"))
    };
    written(&folder, "motion.csv", &format!("time,u [m/s]\n{}{}", stamps(5), stamps(4)));
    written(&folder, "cmd.csv", "time,n_cmd\n2026-05-01T10:00:00Z,7\n");
    let (log, _) = tables(folder.path(), &Selection::of("u=motion.u", "n=cmd.n_cmd").unwrap()).unwrap();
    assert_eq!(runs(&log), vec![0..120]);
    assert_eq!(column(&log, "u")[..60], [4.0; 60]);
}

/// Positions that contradict the velocities of the GNSS gave a motion with the remark that most of them are outliers.
#[test]
fn a_gnss_that_is_mostly_outliers_gives_no_motion() {
    let folder = TempDir::new().unwrap();
    let rows = boat(60, 3);
    let path = written(&folder, "boat.csv", &csv(&rows, "t [ms]", 1000.0));
    let mut known = sensors("");
    read_logs(&[&path], &mut known, &PrepareOptions::default(), &mut silent()).unwrap();
    let far: Vec<Sample> = rows
        .iter()
        .enumerate()
        .map(|(k, [t, n, e, psi, u, d])| {
            let jump = if k % 2 == 0 { 500.0 } else { -500.0 };
            [*t, n + jump, e - 2.0 * jump, *psi, *u, *d]
        })
        .collect();
    let path = written(&folder, "far.csv", &csv(&far, "t [ms]", 1000.0));
    let error = tables(&path, &known).unwrap_err().to_string();
    for text in ["% of the positions are outliers", "[log.sensors]"] {
        assert!(error.contains(text), "{error}");
    }
}

/// `--time` had no effect on the files of sensors.
#[test]
fn the_named_time_is_that_of_the_sensors() {
    let folder = TempDir::new().unwrap();
    let rows = boat(40, 4);
    let path = written(&folder, "boat.csv", &csv(&rows, "elapsed", 1000.0));
    assert!(tables(&path, &sensors("")).unwrap_err().to_string().contains("the rows have no time"));
    let timed = Selection { time: Some("elapsed [ms]".to_owned()), ..sensors("") };
    let (log, _) = tables(&path, &timed).unwrap();
    assert!((column(&log, "t")[10] - 2.0).abs() < 1e-9 && log.rows() > 195, "{}", log.rows());
    let found = survey(&path, timed.time.as_deref()).unwrap();
    assert!((found.topics[0].step_s.unwrap() - 0.2).abs() < 1e-6, "{:?}", found.topics[0].step_s);
    // The proposal names it, and is accepted.
    let degrees = rows.iter().map(|[t, north, east, psi, _, rudder]| {
        let (lat, lon) = (55.0 + north / 111_300.0, 10.0 + east / 63_800.0);
        format!("{:.0},{lat:.8},{lon:.8},{psi:.4},{rudder}\n", 1000.0 * t)
    });
    let header = "elapsed,lat,lon,heading [rad],rudder [deg]\n".to_owned();
    let path = written(&folder, "degrees.csv", &degrees.fold(header, |text, line| text + &line));
    let found = survey(&path, timed.time.as_deref()).unwrap();
    let config = written(&folder, "hydroid.toml", &found.proposal().to_toml("degrees.csv"));
    let proposed = hydroid::config::read(&config).unwrap().reading().unwrap().selection;
    assert_eq!(proposed.time, timed.time);
    assert_eq!(tables(&path, &proposed).unwrap().0.rows(), log.rows());
    // A folder: a file without the column has a time of its own.
    let topics = TempDir::new().unwrap();
    written(&topics, "nav.csv", &csv(&rows, "t_ns", 1e9));
    written(&topics, "cmd.csv", "t [s],rudder\n0,1\n");
    let timed = Selection { time: Some("t_ns [ns]".to_owned()), ..sensors("nav.") };
    assert_eq!(tables(topics.path(), &timed).unwrap().0.rows(), log.rows());
    written(&topics, "nav.csv", &csv(&rows, "t [ms]", 1e3));
    let wrong = Selection { time: Some("stamp".to_owned()), ..timed };
    let (_, notes) = tables(topics.path(), &wrong).unwrap();
    assert!(said(&notes, "no CSV file in it has the column `stamp`").is_some(), "{notes:?}");
    assert!(tables(&path, &Selection { time: Some("stamp".to_owned()), ..sensors("") }).is_err());
}

/// A boat of 240 s, what is known of its sensors, and its table.
fn long_boat() -> &'static (Vec<Sample>, Selection, RawLog) {
    static BOAT: OnceLock<(Vec<Sample>, Selection, RawLog)> = OnceLock::new();
    BOAT.get_or_init(|| {
        let rows = boat(240, 5);
        let folder = TempDir::new().unwrap();
        let part = written(&folder, "part.csv", &csv(&rows[..400], "t [ms]", 1000.0));
        let mut known = sensors("");
        read_logs(&[part], &mut known, &PrepareOptions::default(), &mut silent()).unwrap();
        let path = written(&folder, "boat.csv", &csv(&rows, "t [ms]", 1000.0));
        let table = tables(&path, &known).unwrap().0;
        (rows, known, table)
    })
}

/// The boat without the cells of some columns from one second to another.
fn with_hole(columns: &[usize], [from, to]: [f64; 2]) -> TempDir {
    let (rows, ..) = long_boat();
    let folder = TempDir::new().unwrap();
    let text = csv(rows, "t [ms]", 1000.0);
    let lines = text.lines().enumerate().map(|(k, line)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if k > 0 && (from..to).contains(&rows[k - 1][0]) {
            for column in columns {
                cells[*column] = "";
            }
        }
        cells.join(",") + "\n"
    });
    written(&folder, "boat.csv", &lines.collect::<String>());
    folder
}

/// While the GNSS or the compass was silent for two minutes, a smooth track was invented.
#[test]
fn a_hole_of_a_sensor_ends_a_run() {
    let (_, known, whole) = long_boat();
    for (columns, name) in
        [(&[1, 2][..], "no position or velocity"), (&[3], "no heading or yaw rate"), (&[1, 2, 3], "nothing")]
    {
        let folder = with_hole(columns, [80.0, 200.0]);
        // Without a limit, a hole is bridged as long as the velocities are known.
        let options = PrepareOptions { max_gap_s: Some(60.0), ..PrepareOptions::default() };
        let path = folder.path().join("boat.csv");
        let (logs, mut notes) = read_logs(&[path], &mut known.clone(), &options, &mut silent()).unwrap();
        let log = converted(&logs[0], known, &mut notes).unwrap();
        assert!(
            said(&notes, name).is_some_and(|note| note.message.contains("there are no rows from")),
            "{notes:?}"
        );
        let runs = runs(&log);
        assert_eq!(runs.len(), 2, "{name}: {runs:?}");
        let t = column(&log, "t");
        let [from, to] = [t[runs[0].end - 1], t[runs[1].start]];
        assert!((79.0..90.0).contains(&from) && (190.0..201.0).contains(&to), "{name}: {from} to {to}");
        // What remains is right, also at the edges.
        for (velocity, bound) in [("u", 0.3), ("r", 0.1)] {
            let errors = t.iter().zip(column(&log, velocity)).map(|(t, x)| {
                let k = (t / 0.2).round() as usize;
                (x - column(whole, velocity)[k]).abs()
            });
            let largest = errors.skip(20).fold(0.0, f64::max);
            assert!(largest < bound, "{name}: {velocity} {largest}");
        }
        let prepared =
            prepare([&log], &Selection::of("u,v,r", "rudder").unwrap(), &PrepareOptions::default());
        assert_eq!(prepared.unwrap().runs.len(), 2, "{name}");
    }
}

/// A boat that was lifted out of the water in the middle of its log: there was no way to leave that out.
#[test]
fn measurements_beyond_the_parts_are_not_used() {
    let (rows, known, whole) = long_boat();
    let folder = TempDir::new().unwrap();
    // On land, positions and headings are those of another place, and the rudder moves.
    let carried: Vec<Sample> = rows
        .iter()
        .map(|[t, north, east, psi, u, rudder]| match t {
            80.0..120.0 => [*t, north + 9.0 * (t - 80.0), east - 5000.0, 1.0 - psi, *u, -rudder],
            _ => [*t, *north, *east, *psi, *u, *rudder],
        })
        .collect();
    let path = written(&folder, "boat.csv", &csv(&carried, "t [ms]", 1000.0));
    for selection in [
        Parts { exclude: vec!["79.9:120".parse().unwrap()], ..Parts::default() },
        Parts {
            between: vec![":79.9".parse().unwrap(), "boat.csv=120:".parse().unwrap()],
            ..Parts::default()
        },
        Parts { condition: Some("east > -400".parse().unwrap()), ..Parts::default() },
    ] {
        let (log, notes) = tables(&path, &Selection { parts: selection.clone(), ..known.clone() }).unwrap();
        assert!(said(&notes, "rows are used (").is_some(), "{notes:?}");
        let t = column(&log, "t");
        let runs = runs(&log);
        let ends = [t[runs[0].end - 1], t[runs[1].start]];
        assert!(runs.len() == 2 && ends[0] < 80.01 && ends[1] > 119.9, "{selection:?}: {ends:?}");
        for (velocity, bound) in [("u", 0.2), ("r", 0.05)] {
            let errors = t.iter().zip(column(&log, velocity)).map(|(t, x)| {
                let k = (t / 0.2).round() as usize;
                (x - column(whole, velocity)[k]).abs()
            });
            let largest = errors.fold(0.0, f64::max);
            assert!(largest < bound, "{selection:?}: {velocity} {largest}");
        }
    }
    let selection = Parts { between: vec!["300:400".parse().unwrap()], ..Parts::default() };
    let error = tables(&path, &Selection { parts: selection, ..known.clone() }).unwrap_err().to_string();
    assert!(error.contains("no row is in the parts that are named") && error.contains("239.8 s"), "{error}");
}

/// A compass that was mounted the other way round became a model that sails astern.
#[test]
fn a_compass_that_points_astern_is_refused() {
    let folder = TempDir::new().unwrap();
    let rows = boat(120, 7);
    let turned: Vec<Sample> =
        rows.iter().map(|[t, n, e, psi, u, d]| [*t, *n, *e, psi + 3.0, *u, *d]).collect();
    let path = written(&folder, "boat.csv", &csv(&turned, "t [ms]", 1000.0));
    let error = tables(&path, &sensors("")).unwrap_err().to_string();
    assert!(
        error.contains("deg to starboard of its heading") && error.contains("COLUMN [deg] - 17"),
        "{error}"
    );
    // The remedy works.
    let degrees: f64 =
        error.split("COLUMN [deg] - ").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
    let mut selection = sensors("");
    selection.sensors.as_mut().unwrap().heading =
        Some(format!("heading [rad] - {}", degrees.to_radians()).parse().unwrap());
    let (log, _) = tables(&path, &selection).unwrap();
    assert!((mean(&log, "u") - mean_speed(&rows)).abs() < 0.1);
}

/// Yaw rates in degrees under a header with radians were smoothed for minutes.
#[test]
fn yaw_rates_that_no_vessel_has_are_refused() {
    let folder = TempDir::new().unwrap();
    let mut text = "t [s],north [m],east [m],heading [rad],gyro_z [rad/s],rudder [deg]\n".to_owned();
    for (k, [t, north, east, psi, _, rudder]) in boat(20, 6).iter().enumerate() {
        let rate = 40.0 * f64::sin(0.1 * k as f64);
        let _ = writeln!(text, "{t:.1},{north:.3},{east:.3},{psi:.4},{rate:.2},{rudder}");
    }
    let path = written(&folder, "boat.csv", &text);
    let mut selection = sensors("");
    selection.sensors.as_mut().unwrap().yaw_rate = Some("gyro_z".parse().unwrap());
    let error = tables(&path, &selection).unwrap_err().to_string();
    assert!(
        error.contains("no vessel is faster than 20 rad/s") && error.contains("gyro_z [deg/s]"),
        "{error}"
    );
}

/// Knots without a unit were metres per second.
#[test]
fn a_speed_without_a_unit_has_that_of_the_positions() {
    let folder = TempDir::new().unwrap();
    let rows = boat(120, 8);
    let mut text = "t [s],north [m],east [m],heading [rad],speed,course [rad],rudder [deg]\n".to_owned();
    for [t, north, east, psi, u, rudder] in &rows {
        let knots = u * 3600.0 / 1852.0;
        let _ = writeln!(text, "{t:.1},{north:.3},{east:.3},{psi:.4},{knots:.3},{psi:.4},{rudder}");
    }
    let path = written(&folder, "boat.csv", &text);
    let mut selection = sensors("");
    let spec = |name: &str| Some(name.parse().unwrap());
    let own = selection.sensors.as_mut().unwrap();
    (own.speed, own.course) = (spec("speed"), spec("course"));
    let (log, notes) = tables(&path, &selection).unwrap();
    assert!(said(&notes, "`speed` has no unit, and is taken as kn").is_some(), "{notes:?}");
    assert!((mean(&log, "u") - mean_speed(&rows)).abs() < 0.1, "{}", mean(&log, "u"));
    // Without positions nothing shows it.
    let own = selection.sensors.as_mut().unwrap();
    (own.north, own.east) = (None, None);
    let (_, notes) = tables(&path, &selection).unwrap();
    assert!(
        said(&notes, "`speed` has no unit, and is taken as m/s").is_some_and(Note::is_warning),
        "{notes:?}"
    );
}

/// NMEA beside CSV in a folder was ignored without a word.
#[test]
fn instruments_and_commands_of_a_folder_are_read_together() {
    let folder = TempDir::new().unwrap();
    let rows = boat(60, 9);
    let sentences = nmea(&rows, 36_000.0, 55.0);
    let sentences: Vec<&str> = sentences.lines().filter(|line| !line.contains("RSA")).collect();
    written(&folder, "instruments.log", &(sentences.join("\n") + "\n"));
    let mut commands = "t [s],rudder_cmd [deg]\n".to_owned();
    for row in &rows {
        let _ = writeln!(commands, "{:.1},{}", 36_000.0 + row[0], row[5]);
    }
    written(&folder, "commands.csv", &commands);
    written(&folder, "notes.odt", "nothing that can be read");
    let found = survey(folder.path(), None).unwrap();
    let topics: Vec<&str> = found.topics.iter().map(|topic| topic.name.as_str()).collect();
    assert!(["GGA", "HDT", "commands"].iter().all(|name| topics.contains(name)), "{topics:?}");
    assert!(
        said(&found.notes, "files of other formats are not read: notes.odt").is_some(),
        "{:?}",
        found.notes
    );
    let proposal = found.proposal();
    let (log, _) = tables(folder.path(), &proposal.selection).unwrap();
    let rudder = column(&log, &proposal.selection.inputs[0].name);
    assert!(rudder.len() > 250 && rudder.iter().any(|x| *x > 0.1) && rudder.iter().any(|x| *x < -0.1));
    assert!((mean(&log, "u") - mean_speed(&rows)).abs() < 0.1);
}

/// A receiver of 1 Hz in a table of 5 Hz: each fix counted five times, and the velocities were too certain.
#[test]
fn a_fix_that_a_table_repeats_is_one_measurement() {
    let (rows, known, _) = long_boat();
    let folder = TempDir::new().unwrap();
    // At rest for the first 20 s, with a fix that does not change.
    let held = |k: usize| {
        let [_, north, east, ..] = rows[if k < 100 { 0 } else { 5 * (k / 5) }];
        [north, east].map(|x| format!("{x:.3}"))
    };
    let text = |is_held: bool| {
        let mut text = String::from("t [ms],north [m],east [m],heading [rad],rudder [deg]\n");
        for (k, [t, _, _, psi, _, rudder]) in rows.iter().enumerate() {
            let [north, east] = if is_held || k % 5 == 0 { held(k) } else { Default::default() };
            let _ = writeln!(text, "{:.0},{north},{east},{psi:.4},{rudder}", 1e3 * t);
        }
        text
    };
    let read = |name: &str, is_held: bool| {
        let path = written(&folder, name, &text(is_held));
        let (mut logs, notes) =
            read_logs(&[path], &mut known.clone(), &PrepareOptions::default(), &mut silent()).unwrap();
        (converted(&logs.remove(0), known, &mut Vec::new()).unwrap(), notes)
    };
    let ((held, notes), (blank, _)) = (read("held.csv", true), read("blank.csv", false));
    assert!(said(&notes, "the position changes every 5 rows").is_some(), "{notes:?}");
    for name in ["u", "v", "r"] {
        assert_eq!(column(&held, name), column(&blank, name), "{name}");
    }
}

/// `--max-gap` had no effect on logs of sensors.
#[test]
fn the_longest_gap_is_that_of_the_sensors() {
    let (_, known, whole) = long_boat();
    let folder = with_hole(&[1, 2], [80.0, 81.6]);
    let path = folder.path().join("boat.csv");
    let with = |max_gap_s: Option<f64>| {
        let options = PrepareOptions { max_gap_s, ..PrepareOptions::default() };
        read_logs(&[&path], &mut known.clone(), &options, &mut silent()).unwrap().0.remove(0)
    };
    for (max_gap_s, missing) in [(None, 0), (Some(60.0), 0), (Some(1.9), 0), (Some(1.0), 8)] {
        assert_eq!(whole.rows() - with(max_gap_s).rows(), missing, "{max_gap_s:?}");
    }
}

/// A compass that was turned in the middle of a log, and a wrong delay, were reported with a small standard deviation.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn what_the_halves_of_a_log_contradict_is_not_calibrated() {
    let (rows, ..) = long_boat();
    let calibrated = |name: &str, turn_deg: fn(usize) -> f64| {
        let folder = TempDir::new().unwrap();
        let change = |(k, row): (usize, &Sample)| {
            let mut row = *row;
            row[3] += turn_deg(k).to_radians();
            row
        };
        let rows: Vec<Sample> = rows.iter().enumerate().map(change).collect();
        let path = written(&folder, name, &csv(&rows, "t [ms]", 1000.0));
        let mut selection = sensors("");
        let (_, notes) =
            read_logs(&[path], &mut selection, &PrepareOptions::default(), &mut silent()).unwrap();
        (selection.sensors.unwrap().known.unwrap().constants[1], notes)
    };
    let (steady, notes) = calibrated("steady.csv", |_| 4.0);
    let error = (steady.0.to_degrees() - 4.0).abs();
    assert!(error < 1.0 && error < 3.0 * steady.1.to_degrees(), "{steady:?}: {notes:?}");
    assert!(
        said(&notes, "the compass shows").is_some_and(|note| note.message.contains("this is corrected")),
        "{notes:?}"
    );
    let (turned, notes) = calibrated("turned.csv", |k| if k < 600 { 6.0 } else { -6.0 });
    assert_eq!(turned.0, 0.0, "{notes:?}");
    let warning = said(&notes, "the compass shows").unwrap();
    assert!(warning.is_warning() && warning.message.contains("zero is assumed"), "{warning:?}");
}
