//! `hydroid control MODEL .. -`: a client closes the loop around a simulated boat, line by line.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::Stdio;

use hydroid_core::craft::{Craft, Dynamics, Posed};
use serde_json::{Value, json};

use crate::common::{Service, hydroid, simple_vessel, text};

/// The boat of the client.
struct Boat {
    dynamics: Dynamics,
    state: Posed,
    command: [f64; 2],
    t: f64,
}

impl Boat {
    fn new(vessel: &Craft, x: f64, y: f64, psi: f64) -> Self {
        let state = Posed { eta: [x, y, psi], nu: [0.0; 3], positions: vec![0.0; 2] };
        Self { dynamics: Dynamics::new(vessel), state, command: [0.0; 2], t: 0.0 }
    }

    fn line(&self) -> String {
        let Posed { eta: [x, y, psi], nu: [u, v, r], .. } = self.state;
        json!({ "t": self.t, "x": x, "y": y, "psi": psi, "u": u, "v": v, "r": r }).to_string()
    }

    fn sail(&mut self, answer: &Value, dt: f64) {
        let of = |name: &str| answer["command"][name].as_f64().unwrap();
        self.command = [of("PP_cmd"), of("RD_ang")];
        self.drift(dt);
    }

    /// Sails with the last command.
    fn drift(&mut self, dt: f64) {
        self.dynamics.advance_pose(&mut self.state, &self.command, dt / 4.0, 4, [0.0; 2], [0.0; 2]);
        self.t = (10.0 * (self.t + dt)).round() / 10.0;
    }
}

const LAWN_MOWER: [&str; 11] = [
    "control",
    "hydrofoil",
    "--task",
    "lawn-mower",
    "--legs",
    "4",
    "--leg",
    "60",
    "--horizons",
    "10",
    "--controller",
];

/// The service is killed twice on a lawn-mower of 5 minutes. The boat keeps its last command for half a second each time.
#[test]
fn a_boat_stays_in_its_corridor_although_the_service_is_killed() {
    for controller in ["fl", "backstepping", "cem"] {
        let folder = tempfile::tempdir().unwrap();
        let mut args = LAWN_MOWER.to_vec();
        args.extend([controller, "--state", "boat.state", "-"]);
        let mut service = Service::start(folder.path(), &args);
        let mut boat = Boat::new(&Craft::hydrofoil(), -1.0, 0.5, 0.0);
        let (mut largest, mut answers, mut arrived) = (0.0_f64, 0, false);
        for k in 0..4000 {
            if k == 800 || k == 1601 {
                service.kill();
                (0..5).for_each(|_| boat.drift(0.1));
                service = Service::start(folder.path(), &args);
            }
            let answer = service.ask(&boat.line());
            assert_eq!(answer["t"], boat.t, "{answer}");
            answers += 1;
            if boat.t > 20.0 {
                largest = largest.max(answer["cross_track"].as_f64().unwrap().abs());
            }
            for band in ["band_80", "band_95"] {
                assert!(answer["track"][band]["position"][0].as_f64().unwrap() > 0.0);
            }
            boat.sail(&answer, 0.1);
            arrived = answer["control"] == "arrived";
            if arrived {
                assert_eq!(answer["command"], json!({ "PP_cmd": 0.0, "RD_ang": 0.0 }));
                break;
            }
        }
        println!("{controller}: {largest:.3} m, {answers} answers");
        assert!(arrived, "{controller}");
        assert!(largest < 1.0, "{controller}: {largest} m");
        service.kill();
    }
}

/// After a kill, the answers are those of a service that went on.
#[test]
fn a_restarted_service_gives_the_same_answers() {
    let folder = tempfile::tempdir().unwrap();
    let mut args = LAWN_MOWER.to_vec();
    args.extend(["fl", "--integral", "0.5", "--adapt", "--state"]);
    let with = |name| [&args[..], &[name, "-"]].concat();
    let (mut one, mut other) = (
        Service::start(folder.path(), &with("one.state")),
        Service::start(folder.path(), &with("other.state")),
    );
    let mut boat = Boat::new(&Craft::hydrofoil(), 0.0, 0.5, 0.0);
    let mut since: Vec<(f64, String)> = Vec::new();
    for k in 0..300 {
        if k == 155 {
            other.kill();
            other = Service::start(folder.path(), &with("other.state"));
            // The client sends what the state lacks.
            let saved = other.resumed_at();
            for line in since.iter().filter(|(t, _)| *t > saved).map(|(_, line)| line) {
                other.ask(line);
            }
        }
        let (a, mut b) = (one.ask(&boat.line()), other.ask(&boat.line()));
        b["line"] = a["line"].clone();
        assert_eq!(a, b, "sample {k}");
        since.push((boat.t, boat.line()));
        boat.sail(&a, 0.1);
    }
    one.kill();
    other.kill();
}

/// Lines that cannot be used keep the command; a pose may be missing up to the stated age; degrees are converted. Real time counts
/// as well, so that the age is longer than a loaded machine takes.
#[test]
fn missing_poses_are_predicted_and_bad_lines_keep_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let mut args = LAWN_MOWER.to_vec();
    args.extend(["fl", "--max-age", "10s", "-"]);
    let mut service = Service::start(folder.path(), &args);
    let first = service.ask(r#"{"t":0,"x":0,"y":0,"heading [deg]":90,"u":1.5,"v":0,"r":0}"#);
    assert_eq!(first["pose"]["psi"], std::f64::consts::FRAC_PI_2);
    let bad = service.ask(r#"{"t":0.1,"x":"north"}"#);
    assert_eq!((&bad["status"], &bad["command"]), (&json!("error"), &first["command"]));
    let mut east = 0.0;
    for k in 1..=20 {
        let answer = service.ask(&json!({ "t": f64::from(k), "u": 1.5, "v": 0.0, "r": 0.0 }).to_string());
        if k <= 10 {
            east = answer["pose"]["y"].as_f64().unwrap();
            assert_ne!(answer["control"], "blind");
        } else {
            assert_eq!(
                (&answer["control"], &answer["pose"]["y"]),
                (&json!("blind"), &Value::Null),
                "{answer}"
            );
        }
    }
    assert!((east - 15.0).abs() < 1e-9, "{east}");
    service.kill();
    for (line, words) in [
        ("t,x,u,v,r", "name them x [m] (north) and y [m] (east)"),
        ("t,x,y,u,v,r", "no column of the heading"),
    ] {
        let mut service =
            hydroid(folder.path(), &args).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        writeln!(service.stdin.take().unwrap(), "{line}").unwrap();
        let output = service.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains(words), "{}", text(&output.stderr));
    }
}

/// After a pause, the command in force is hours old: it comes to rest until the time is known. A single wrong stamp has no
/// effect.
#[test]
fn after_a_pause_no_old_command_is_in_force() {
    let folder = tempfile::tempdir().unwrap();
    let mut args = LAWN_MOWER.to_vec();
    args.extend(["fl", "-"]);
    let mut service = Service::start(folder.path(), &args);
    let mut boat = Boat::new(&Craft::hydrofoil(), 0.0, 0.5, 0.0);
    let mut last = Value::Null;
    for _ in 0..50 {
        last = service.ask(&boat.line());
        boat.sail(&last, 0.1);
    }
    let at = |t: f64, boat: &Boat| {
        let mut line: Value = serde_json::from_str(&boat.line()).unwrap();
        line["t"] = t.into();
        line.to_string()
    };
    let wrong = service.ask(&at(9_000.0, &boat));
    assert_eq!((&wrong["status"], &wrong["command"]), (&json!("ahead"), &last["command"]));
    boat.drift(0.1);
    let right = service.ask(&boat.line());
    let used = |answer: &Value| answer.get("prediction").is_some() && answer["control"] != "blind";
    assert!(used(&right), "{right}");
    boat.sail(&right, 0.1);
    let answers: Vec<Value> = (0..4).map(|k| service.ask(&at(9_000.0 + 0.1 * f64::from(k), &boat))).collect();
    let told: Vec<&str> = answers.iter().map(|answer| answer["status"].as_str().unwrap()).collect();
    assert_eq!(told[..3], ["ahead", "ahead", "reset"]);
    assert!(answers[0]["note"].as_str().unwrap().contains("after the last used one"));
    assert_eq!(answers[1]["control"], "blind");
    assert_eq!(answers[1]["command"]["PP_cmd"].as_f64(), Some(0.0), "{}", answers[1]);
    assert!(answers[1]["note"].as_str().unwrap().contains("is not known: the commands rest"));
    assert_eq!(answers[1]["lost"]["heading"], Value::Null);
    for answer in &answers[2..] {
        assert!(used(answer) && answer["pose"]["x"].is_f64(), "{answer}");
    }
    service.kill();
}

/// With way-points in degrees, the lines have latitude and longitude.
#[test]
fn geographic_way_points_need_geographic_positions() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("route.csv"), "lat [deg],lon [deg]\n54.0,10.0\n54.001,10.0\n").unwrap();
    let args =
        ["control", "hydrofoil", "--controller", "pid", "--task", "legs", "--waypoints", "route.csv", "-"];
    let mut service = Service::start(folder.path(), &args);
    // A minute of latitude is 1855 m at 54 degrees (WGS 84).
    let answer = service.ask(r#"{"t":0,"lat":54.0005,"lon":10.0,"psi":0,"u":1.5,"v":0,"r":0}"#);
    assert!((answer["pose"]["x"].as_f64().unwrap() - 55.65).abs() < 0.02, "{answer}");
    assert!(answer["pose"]["y"].as_f64().unwrap().abs() < 1e-6);
    let wrong = service.ask(r#"{"t":0.1,"lat":95,"lon":10.0,"psi":0,"u":1.5,"v":0,"r":0}"#);
    assert!(wrong["message"].as_str().unwrap().contains("latitudes are between"), "{wrong}");
    let far = service.ask(r#"{"t":0.2,"lat":10.0,"lon":54.0005,"psi":0,"u":1.5,"v":0,"r":0}"#);
    assert!(far["message"].as_str().unwrap().contains("exchanged"), "{far}");
    let turned = service.ask(r#"{"t":0.3,"lat":54.0005,"lon":10.0,"psi":270,"u":1.5,"v":0,"r":0}"#);
    assert!(turned["message"].as_str().unwrap().contains("if it counts degrees"), "{turned}");
    service.kill();
}

/// A degree of longitude at 54 degrees \[m\].
const METRES_OF_DEGREE: f64 = 65_577.0;

/// A vessel that leaves its fence has neutral commands from that line on, also where it is inside again.
#[test]
fn outside_the_fence_the_commands_are_neutral() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("route.csv", "lat [deg],lon [deg]\n54.0,10.0\n54.001,10.0\n");
    let ring = "[[9.999, 53.999], [10.001, 53.999], [10.001, 54.002], [9.999, 54.002], [9.999, 53.999]]";
    write("area.geojson", &format!(r#"{{"type": "Polygon", "coordinates": [{ring}]}}"#));
    write("metres.csv", "north,east\n-10,-10\n-10,10\n120,10\n120,-10\n");
    write("small.csv", "north,east\n-10,-10\n-10,10\n20,10\n20,-10\n");
    let area = |inside: bool| {
        format!(
            r#"{{"inclusion": {inside}, "polygon": [[53.999, 9.999], [53.999, 10.001], [54.002, 10.0]]}}"#
        )
    };
    let areas = format!(r#"{{"circles": [], "polygons": [{}, {}]}}"#, area(true), area(false));
    write("both.plan", &format!("\u{feff}{{\"fileType\": \"Plan\", \"geoFence\": {areas}}}"));
    let base = ["control", "hydrofoil", "--controller", "fl", "--task", "legs"];
    let route = ["--waypoints", "route.csv", "--keep-out=rock.csv"];
    write("rock.csv", "lat,lon\n54.0004,10.0004\n54.0004,10.0006\n54.0006,10.0005\n");
    for fence in ["--fence=area.geojson", "--fence=metres.csv"] {
        let args = [&base[..], &route, &[fence, "-"]].concat();
        let mut service = Service::start(folder.path(), &args);
        // A vessel that drifts east from half a metre within the border.
        let border_m = if fence.ends_with("json") { 0.001 * METRES_OF_DEGREE } else { 10.0 };
        let mut line = |k: i32, east_m: f64| {
            let lon = 10.0 + east_m / METRES_OF_DEGREE;
            let t = f64::from(k) / 10.0;
            service.ask(&format!(r#"{{"t":{t},"lat":54.0002,"lon":{lon},"psi":0,"u":0,"v":1.5,"r":0}}"#))
        };
        let inside = line(0, border_m - 0.5);
        assert_ne!(inside["command"]["PP_cmd"], 0.0, "{inside}");
        for k in 1..12 {
            let answer = line(k, border_m - 0.5 + 0.15 * f64::from(k));
            assert_eq!(answer["control"] == "stopped", k > 3, "{answer}");
        }
        // Also where it is inside again.
        let answer = line(12, border_m - 0.5);
        assert_eq!(answer["control"], "stopped", "{answer}");
        assert_eq!(answer["command"], json!({ "PP_cmd": 0.0, "RD_ang": 0.0 }));
        assert!(answer["note"].as_str().unwrap().contains("the vessel is outside the fence"), "{answer}");
        service.kill();
    }
    let points = ["--points", "0,0;100,0"];
    for (path, fence, words) in [
        (&points[..], "--fence=small.csv", "the path leaves the fence at 20.0 m north, 0.0 m east"),
        (&points[..], "--fence=area.geojson", "has latitudes and longitudes, and the path is in metres"),
        (&points[..], "--fence=none.csv", "none.csv"),
        (&["--waypoints", "route.csv"], "--keep-out=route.csv", "at least three corners"),
        (
            &["--waypoints", "route.csv"],
            "--fence=both.plan",
            "has an area to keep out of as well: state it with --keep-out both.plan",
        ),
        (
            &["--waypoints", "route.csv", "--keep-out=rock.csv"],
            "--fence=both.plan",
            "has an area to keep out of as well",
        ),
    ] {
        let args = [&base[..], path, &[fence, "-"]].concat();
        let output = hydroid(folder.path(), &args).stdin(Stdio::null()).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{fence}: {said}");
        assert!(said.contains(words), "{fence}: {said}");
    }
}

/// A service that ended stopped or blind had the exit status 0.
#[test]
fn a_vessel_that_is_left_without_its_task_has_an_exit_status() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("fence.csv"), "north,east\n-10,-10\n-10,10\n120,10\n120,-10\n")
        .unwrap();
    let args = [
        "control",
        "hydrofoil",
        "--controller",
        "fl",
        "--task",
        "legs",
        "--points",
        "0,0;100,0",
        "--fence=fence.csv",
        "-",
    ];
    for (east, status) in [(1.0, 0), (11.0, 1)] {
        let mut service =
            hydroid(folder.path(), &args).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let line = json!({ "t": 0.0, "x": 0.0, "y": east, "psi": 0.0, "u": 1.5, "v": 0.0, "r": 0.0 });
        writeln!(service.stdin.take().unwrap(), "{line}").unwrap();
        assert_eq!(service.wait_with_output().unwrap().status.code(), Some(status), "{east}");
    }
}

/// Silence, and the first line after it, take no more than the rate.
#[test]
fn silence_keeps_the_limits_of_the_rates() {
    let folder = tempfile::tempdir().unwrap();
    let args = [&LAWN_MOWER[..], &["fl", "--max-age", "0.4", "--rate-limit", "PP_cmd=100", "-"]].concat();
    let mut service = Service::start(folder.path(), &args);
    let mut boat = Boat::new(&Craft::hydrofoil(), 0.0, 0.5, 0.0);
    let mut last = 0.0_f64;
    for _ in 0..100 {
        let answer = service.ask(&boat.line());
        boat.sail(&answer, 0.1);
        last = answer["command"]["PP_cmd"].as_f64().unwrap();
        if last.abs() > 120.0 {
            break;
        }
    }
    assert!(last.abs() > 120.0, "{last}");
    let mut age = 0.0;
    for _ in 0..4 {
        let lost: Value = serde_json::from_str(&service.answer()).unwrap();
        let (now, at) =
            (lost["command"]["PP_cmd"].as_f64().unwrap(), lost["lost"]["position"].as_f64().unwrap());
        assert!(
            now.abs() < last.abs() && (last - now).abs() <= 100.0 * (at - age) + 0.2,
            "{last} {age}: {lost}"
        );
        (last, age) = (now, at);
    }
    let again = service.ask(&boat.line());
    let now = again["command"]["PP_cmd"].as_f64().unwrap();
    assert!((now - last).abs() <= 10.0 + 1e-6, "{last}: {again}");
    service.kill();
}

/// Commands on their way to neutral went there at once, beyond the limit of the rate.
#[test]
fn neutral_commands_keep_the_limits_of_the_rates() {
    let folder = tempfile::tempdir().unwrap();
    let base = ["control", "hydrofoil", "--controller", "fl", "--task", "waypoints", "--points", "0,0;100,0"];
    let rates = ["--rate-limit", "RD_ang=0.2", "--rate-limit", "PP_cmd=300", "-"];
    let mut service = Service::start(folder.path(), &[&base[..], &rates].concat());
    let (mut before, mut largest) = ([0.0, 0.0], [0.0_f64, 0.0]);
    for k in 0..80 {
        let t = f64::from(k) / 10.0;
        // Beside the path, and heading away; then without a pose.
        let pose = if k < 20 { r#""x":5,"y":4,"psi":0.6,"# } else { "" };
        let answer = service.ask(&format!(r#"{{"t":{t},{pose}"u":1.5,"v":0,"r":0}}"#));
        let command = ["RD_ang", "PP_cmd"].map(|name| answer["command"][name].as_f64().unwrap());
        for ((now, before), rate) in command.iter().zip(before).zip([0.2, 300.0]) {
            assert!(k == 0 || (now - before).abs() <= rate / 10.0 + 1e-9, "{k}: {answer}");
        }
        if answer["control"] != "blind" {
            largest = [0, 1].map(|i| largest[i].max(command[i].abs()));
        }
        before = command;
    }
    assert!(largest[0] > 0.1 && largest[1] > 50.0, "{largest:?}");
    assert_eq!(before, [0.0, 0.0]);
    assert_eq!(service.ask(r#"{"t":8,"u":1.5,"v":0,"r":0}"#)["control"], "blind");
    service.kill();
}

#[test]
fn options_of_a_simulated_run_are_refused() {
    let folder = tempfile::TempDir::new().unwrap();
    for option in ["--delay=0.2", "--current=0.1,0", "--evaluate-from=5s", "--runs=3", "--noise=0"] {
        let args = ["control", "hydrofoil", "--controller", "fl", option, "-"];
        let output = hydroid(folder.path(), &args).stdin(Stdio::null()).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{option}: {said}");
        assert!(said.contains(option.split('=').next().unwrap()), "{said}");
        assert!(said.contains("leave it out for a controller on board"), "{said}");
    }
}

/// A team could not serve its boat, because its commands do not end in `_cmd` or `_ang`.
#[test]
fn commands_have_any_names() {
    let folder = tempfile::tempdir().unwrap();
    for log in ["a", "b", "d"] {
        let text = std::fs::read_to_string(simple_vessel().join(format!("{log}.csv"))).unwrap();
        let renamed = text.replacen("PP_cmd", "thrust", 1).replacen("RD_cmd", "steering", 1);
        std::fs::write(folder.path().join(format!("{log}.csv")), renamed).unwrap();
    }
    let identify =
        ["identify", "a.csv", "b.csv", "d.csv", "--inputs", "thrust,steering", "-o", "out", "--methods"];
    let output = hydroid(folder.path(), &[&identify[..], &["sindy"]].concat()).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let serve = ["control", "out/sindy.safetensors", "--task", "lawn-mower", "--horizons", "1"];
    let limits = ["--limit", "thrust=-130:350", "--limit", "steering=-0.5:0.5", "-"];
    let serve = [&serve[..], &limits].concat();
    let mut service = Service::start(folder.path(), &serve);
    let answer = service.ask(r#"{"t":0,"x":0,"y":0,"psi":0,"u":1.0,"v":0,"r":0}"#);
    assert!(answer["command"]["thrust"].is_f64() && answer["command"]["steering"].is_f64(), "{answer}");
    service.kill();
}

/// `du/dt = 0.1 n - 0.1 u + 0.02 wind_x`, `dv/dt = -0.3 v - 0.5 r`, `dr/dt = 0.1 delta - 0.2 r + 0.01 wind_y`, in a wind that is never calm.
fn log_in_wind() -> String {
    let mut log = String::from("t,u [m/s],v [m/s],r [rad/s],n,delta [rad],ws [m/s],wd [rad]\n");
    let (mut u, mut v, mut r, mut random) = (1.0_f64, 0.0_f64, 0.0_f64, 1_u64);
    let mut noise = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let (mut n, mut delta, mut speed, mut direction) = (1.0_f64, 0.0_f64, 3.0_f64, 1.0_f64);
    for k in 0..2_400 {
        if k % 23 == 0 {
            (n, delta) = (2.0 + 3.0 * noise(), noise());
        }
        speed = (speed + 0.4 * noise()).clamp(2.0, 5.0);
        direction = (direction + 0.2 * noise()).clamp(0.5, 2.5);
        let [du, dv, dr] = [0.02 * noise(), 0.02 * noise(), 0.004 * noise()];
        let t = 0.5 * f64::from(k);
        writeln!(log, "{t},{},{},{},{n},{delta},{speed},{direction}", u + du, v + dv, r + dr).unwrap();
        let (x, y) = (speed * speed * direction.cos(), speed * speed * direction.sin());
        for _ in 0..10 {
            u += 0.05 * (0.1 * n - 0.1 * u + 0.02 * x);
            v += 0.05 * (-0.3 * v - 0.5 * r);
            r += 0.05 * (0.1 * delta - 0.2 * r + 0.01 * y);
        }
    }
    log
}

#[test]
fn the_wind_is_no_command_of_an_answer() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("wind.csv"), log_in_wind()).unwrap();
    let args =
        ["identify", "wind.csv", "--inputs", "n,delta", "--wind", "ws,wd", "--methods", "sindy", "-o", "out"];
    let output = hydroid(folder.path(), &args).output().unwrap();
    let printed = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{printed}{}", text(&output.stderr));
    assert!(printed.contains("wind_x disturbance  found: its name"), "{printed}");
    let model = "out/sindy.safetensors";
    let refused = hydroid(folder.path(), &["control", model, "--controller", "fl"]).output().unwrap();
    assert!(text(&refused.stderr).contains("'wind_x' is a disturbance"), "{}", text(&refused.stderr));
    let args = ["control", model, "--task", "circle", "--horizons", "10", "--limit", "n=0:4", "-"];
    let mut service = Service::start(folder.path(), &args);
    for k in 0..20 {
        let line = json!({ "t": 0.5 * f64::from(k), "x": 0.5 * f64::from(k), "y": -5.0, "psi": 0.0, "u": 1.0, "v": 0.0, "r": 0.0 });
        let answer = service.ask(&line.to_string());
        let names: Vec<&String> = answer["command"].as_object().unwrap().keys().collect();
        assert_eq!(names, ["delta", "n"], "{answer}");
        assert!(answer["command"]["n"].is_number(), "{answer}");
    }
    service.kill();
}

/// Two propellers with pulses in microseconds, which are ahead in the whole log.
fn log_of_pulses() -> String {
    let mut log = String::from("t,u [m/s],v [m/s],r [rad/s],left [us],right [us]\n");
    let (mut u, mut v, mut r, mut random) = (1.0_f64, 0.0_f64, 0.0_f64, 1_u64);
    let mut noise = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let [mut left, mut right] = [1700.0_f64; 2];
    for k in 0..1_600 {
        if k % 23 == 0 {
            [left, right] = [0, 1].map(|_| (1700.0 + 380.0 * noise()).round());
        }
        let [du, dv, dr] = [0.01 * noise(), 0.01 * noise(), 0.002 * noise()];
        writeln!(log, "{},{},{},{},{left},{right}", 0.5 * f64::from(k), u + du, v + dv, r + dr).unwrap();
        let [port, starboard] = [left, right].map(|pulse| (pulse - 1500.0) / 400.0);
        for _ in 0..10 {
            u += 0.05 * (0.2 * (port + starboard) - 0.15 * u);
            v += 0.05 * (-0.4 * v - 0.3 * r);
            r += 0.05 * (0.2 * (port - starboard) - 0.5 * r);
        }
    }
    log
}

/// A boat that was never at rest in the log got 1690 us when its position was lost.
#[test]
fn the_command_at_rest_is_neutral_or_the_service_does_not_start() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("run.csv"), log_of_pulses()).unwrap();
    let args = ["identify", "run.csv", "--inputs", "left,right", "--methods", "sindy", "-o"];
    let identify = |more: &[&str]| {
        let output = hydroid(folder.path(), &[&args[..], more].concat()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    identify(&["raw"]);
    let service = |model: &str, more: &[&str]| {
        let args = [&["control", model, "--task", "circle", "--horizons", "1"][..], more, &["-"]].concat();
        hydroid(folder.path(), &args).stdin(Stdio::null()).output().unwrap()
    };
    let refused = service("raw/sindy.safetensors", &[]);
    let said = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("[boat.inputs.left] neutral = VALUE, limits = [LOW, HIGH]"), "{said}");
    assert!(said.contains("--neutral left=VALUE and --limit left=LOW:HIGH"), "{said}");

    let stated = ["left=1100:1900", "right=1100:1900"].map(|limit| ["--limit", limit]).concat();
    let stated =
        [stated, ["left=1500", "right=1500"].map(|neutral| ["--neutral", neutral]).concat()].concat();
    let printed = identify(&[&["firm"][..], &stated].concat());
    assert!(printed.contains("neutral 1500 us (stated), limits 1100 to 1900 us (stated)"), "{printed}");
    let within = [&args[..], &["no", "--limit", "left=1450:1650"]].concat();
    let output = hydroid(folder.path(), &within).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("limits of left are 1450 to 1650, and the log commands"));
    for (model, more) in [("firm/sindy.safetensors", &[][..]), ("raw/sindy.safetensors", &stated[..])] {
        let args = [&["control", model, "--task", "circle", "--horizons", "1"][..], more, &["-"]].concat();
        let mut service = Service::start(folder.path(), &args);
        let mut last = Value::Null;
        for k in 0..24 {
            let t = 0.5 * f64::from(k);
            let line = if k < 2 {
                json!({ "t": t, "x": 0.5 * t, "y": 0.0, "psi": 0.0, "u": 1.0, "v": 0.0, "r": 0.0 })
            } else {
                json!({ "t": t, "u": 1.0, "v": 0.0, "r": 0.0 })
            };
            last = service.ask(&line.to_string());
        }
        assert_eq!(last["control"], "blind", "{last}");
        assert_eq!(last["command"], json!({ "left": 1500.0, "right": 1500.0 }), "{last}");
        service.kill();
    }
}

/// The last command was held for ever after silence, and after lines that could not be used.
#[test]
fn silence_and_broken_lines_bring_the_commands_to_rest() {
    let folder = tempfile::tempdir().unwrap();
    for (max_age, limit) in [(&[][..], 1.0), (&["--max-age", "0.4"], 0.4)] {
        let args = [&LAWN_MOWER[..], &["fl"], max_age, &["-"]].concat();
        let mut service = Service::start(folder.path(), &args);
        let mut boat = Boat::new(&Craft::hydrofoil(), 0.0, 0.5, 0.0);
        for _ in 0..20 {
            let answer = service.ask(&boat.line());
            boat.sail(&answer, 0.1);
        }
        let neutral = json!({ "PP_cmd": 0.0, "RD_ang": 0.0 });
        for k in 0..3 {
            let lost: Value = serde_json::from_str(&service.answer()).unwrap();
            assert_eq!(
                (&lost["status"], &lost["command"], &lost["t"]),
                (&json!("lost"), &neutral, &Value::Null)
            );
            let age = lost["lost"]["position"].as_f64().unwrap();
            assert!(age > limit + f64::from(k), "{lost}");
        }
        let again = service.ask(&boat.line());
        assert!(again["command"] != neutral && again["control"] != "blind", "{again}");
        for k in 0..12 {
            let broken = service.ask("{broken");
            assert_eq!(broken["status"], "error");
            let is_lost = f64::from(k + 1) * 0.1 > limit + 1e-6;
            assert!(
                !is_lost
                    || broken["command"] == neutral
                        && broken["message"].as_str().unwrap().contains("the commands rest"),
                "{k}: {broken}"
            );
        }
        drop(service.child.stdin.take());
        let (code, notes) = service.end();
        // The vessel is blind at the end.
        assert!(code == Some(1) && notes.contains(" lost"), "{notes}");
    }
    let simulated = ["control", "hydrofoil", "--controller", "fl", "--max-age", "2"];
    let output = hydroid(folder.path(), &simulated).output().unwrap();
    let said = text(&output.stderr);
    assert!(
        output.status.code() == Some(2) && said.contains("--max-age belongs to a controller on board"),
        "{said}"
    );
}
