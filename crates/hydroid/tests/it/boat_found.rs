//! The boat that a recording describes, and the logs that are read with it.

use std::path::{Path, PathBuf};

use hydroid::boat::{Boat, BoatError, Evidence, Input, Output, Property, Range, Role};
use hydroid::config::{self, Config, Logs};
use hydroid::log::{self, ChannelSpec, Neutral, NeutralBy, Selection};
use hydroid::model::Reading;
use hydroid::recording::{Proposal, survey};
use tempfile::TempDir;

fn shared(path: &str) -> Option<PathBuf> {
    let data = std::env::var_os("HYDROID_DATA").map(|data| PathBuf::from(data).join(path));
    if data.is_none() {
        println!("skipped: no HYDROID_DATA");
    }
    data
}

fn proposal(path: &Path) -> Proposal {
    survey(path, None).unwrap().proposal()
}

fn found(output: Output, parameters: &[(&str, f64)], seen: &Range) -> (Input, Vec<String>) {
    let parameters = parameters.iter().map(|(key, value)| ((*key).to_owned(), *value)).collect();
    let mut boat = Boat::default();
    let remarks = boat.find_output("x", Some(output), &parameters, seen);
    (boat.inputs.remove("x").unwrap_or_default(), remarks)
}

fn range(low: f64, high: f64) -> Range {
    Range { low, high, neutral: Some(Neutral { value: 1500.0, found: NeutralBy::MostCommon }) }
}

fn numbers(input: &Input) -> (Option<Role>, Option<f64>, Option<[f64; 2]>, Option<f64>) {
    (input.role, input.neutral, input.limits, input.scale)
}

#[test]
fn parameters_of_ardupilot() {
    let of = |n: u32, function: f64, trim: Option<f64>| {
        let keys = ["FUNCTION", "MIN", "MAX", "TRIM"].map(|what| format!("SERVO{n}_{what}"));
        let values = [Some(function), Some(1000.0), Some(2000.0), trim];
        let all: Vec<(&str, f64)> =
            keys.iter().zip(values).filter_map(|(key, value)| Some((key.as_str(), value?))).collect();
        found(Output::ArduPilot(n), &all, &range(1000.0, 2000.0))
    };
    let limits = Some([1000.0, 2000.0]);
    let (rudder, remarks) = of(4, 26.0, Some(1463.0));
    assert_eq!(numbers(&rudder), (Some(Role::Steering), Some(1463.0), limits, Some(500.0)));
    assert_eq!(
        rudder.found[&Property::Role],
        Evidence::Parameter("SERVO4_FUNCTION = 26 (ground steering)".into())
    );
    assert_eq!(rudder.found[&Property::Neutral], Evidence::Parameter("SERVO4_TRIM".into()));
    assert!(remarks.is_empty(), "{remarks:?}");

    let (throttle, remarks) = of(2, 70.0, None);
    assert_eq!(numbers(&throttle), (Some(Role::Propulsion), Some(1500.0), limits, Some(500.0)));
    let middle = "middle of SERVO2_MIN and SERVO2_MAX: the file has no SERVO2_TRIM";
    assert_eq!(throttle.found[&Property::Neutral], Evidence::Convention(middle.into()));
    assert!(remarks.is_empty(), "{remarks:?}");

    // A motor of a copter rests at its lower limit: neither a role nor a neutral position.
    let (motor, remarks) = of(1, 33.0, Some(1500.0));
    assert_eq!(numbers(&motor), (None, None, limits, None));
    assert!(
        remarks[0].contains("SERVO1_FUNCTION = 33 is not a function whose role is known: state role"),
        "{remarks:?}"
    );

    let (outside, remarks) = of(3, 73.0, Some(2100.0));
    assert_eq!(numbers(&outside), (Some(Role::Thruster), Some(1500.0), limits, Some(500.0)));
    assert!(
        remarks[0].contains("SERVO3_TRIM = 2100 is outside SERVO3_MIN = 1000 to SERVO3_MAX = 2000"),
        "{remarks:?}"
    );
}

#[test]
fn parameters_that_contradict_each_other_are_not_used() {
    let parameters =
        [("SERVO1_FUNCTION", 74.0), ("SERVO1_MIN", 1900.0), ("SERVO1_MAX", 1100.0), ("SERVO1_TRIM", 1600.0)];
    let (input, remarks) = found(Output::ArduPilot(1), &parameters, &range(1100.0, 1900.0));
    assert_eq!(numbers(&input), (Some(Role::Thruster), Some(1500.0), Some([1100.0, 1900.0]), Some(400.0)));
    assert!(matches!(input.found[&Property::Limits], Evidence::Convention(_)));
    assert!(matches!(input.found[&Property::Neutral], Evidence::Log(_)));
    let expected = "SERVO1_MIN = 1900 is not below SERVO1_MAX = 1100; the parameters are not used";
    assert!(remarks[0].contains(expected) && remarks[0].ends_with("in [boat.inputs.x]"), "{remarks:?}");
    // A recording that goes beyond the limits.
    let parameters = [("SERVO1_FUNCTION", 74.0), ("SERVO1_MIN", 1200.0), ("SERVO1_MAX", 1800.0)];
    let (_, remarks) = found(Output::ArduPilot(1), &parameters, &range(1150.0, 1800.0));
    assert!(remarks[0].contains("the recording has 1150, outside the limits 1200 to 1800"), "{remarks:?}");
}

#[test]
fn parameters_of_px4() {
    let limits = [("PWM_MAIN_MIN2", 1000.0), ("PWM_MAIN_MAX2", 2000.0)];
    let (input, _) = found(Output::Px4(2), &limits, &range(1000.0, 2000.0));
    assert_eq!(numbers(&input), (None, Some(1500.0), Some([1000.0, 2000.0]), Some(500.0)));
    assert!(matches!(input.found[&Property::Neutral], Evidence::Log(_)));
    let all = [limits[0], limits[1], ("PWM_MAIN_DIS2", 1480.0)];
    assert_eq!(found(Output::Px4(2), &all, &range(1000.0, 2000.0)).0.neutral, Some(1480.0));
    // Of an output that is not used, the parameters say nothing.
    let unused = [limits[0], limits[1], ("PWM_MAIN_FUNC2", 0.0)];
    assert_eq!(found(Output::Px4(2), &unused, &range(1100.0, 1900.0)).0.limits, Some([1100.0, 1900.0]));
    let (motor, _) = found(Output::Px4Motor(2), &[("CA_R_REV", 2.0)], &Range::default());
    assert_eq!(numbers(&motor), (None, Some(0.0), Some([-1.0, 1.0]), None));
}

#[test]
fn the_recording_of_an_autopilot() {
    let Some(fleet) = shared("fleet/formats") else { return };
    let otter = proposal(&fleet.join("otter.BIN"));
    for name in ["throttle_left", "throttle_right"] {
        let expected = (Some(Role::Thruster), Some(1500.0), Some([1100.0, 1900.0]), Some(400.0));
        assert_eq!(numbers(&otter.boat.inputs[name]), expected);
    }
    let text = otter.to_toml("otter.BIN");
    for line in [
        "[boat.inputs.throttle_left] # RCOU.C1",
        "role = \"thruster\"     # SERVO1_FUNCTION = 73 (throttle left)",
        "unit = \"us\"",
        "neutral = 1500        # middle of SERVO1_MIN and SERVO1_MAX: the file has no SERVO1_TRIM",
        "limits = [1100, 1900] # SERVO1_MIN, SERVO1_MAX",
        "scale = 400           # half of SERVO1_MAX - SERVO1_MIN",
    ] {
        assert!(text.lines().any(|of| of == line), "{line} in\n{text}");
    }
    // What is written is read: the same numbers, stated.
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("hydroid.toml");
    std::fs::write(&file, &text).unwrap();
    let read = config::read(&file).unwrap();
    let mut stated = otter.boat.clone();
    stated.inputs.values_mut().for_each(|input| input.found.clear());
    assert_eq!(read.boat, stated);
    let inputs = &read.reading().unwrap().selection.inputs;
    assert_eq!(inputs[0].to_string(), "throttle_left=(RCOU.C1 [us] - 1500) * 0.0025 [1]");

    let px4 = proposal(&fleet.join("otter.ulg"));
    assert_eq!(px4.boat.inputs["output_0"].scale, Some(400.0));
    let ros = proposal(&fleet.join("otter_zstd.mcap"));
    assert!(matches!(ros.boat.inputs["left"].found[&Property::Limits], Evidence::Convention(_)));
}

/// Two propellers with pulse widths, without parameters: rests at 1511, in another order.
fn table(folder: &Path) -> PathBuf {
    let file = folder.join("day.csv");
    let mut text = "t [s],u [m/s],v [m/s],r [rad/s],pwm_right,pwm_left,rpm\n".to_owned();
    let (mut u, mut r) = (0.0_f64, 0.0_f64);
    for k in 0..600_u32 {
        let rest = k < 120;
        let step = |n: u32| f64::from((k / 25 * n + 7 * n) % 11) - 3.0;
        let [right, left] =
            if rest { [1511.0; 2] } else { [1511.0 + 40.0 * step(3), 1511.0 + 40.0 * step(5)] };
        let row = [f64::from(k) * 0.1, u, 0.1 * r, r, right, left, 900.0 + f64::from(k)];
        text += &row.map(|x| x.to_string()).join(",");
        text.push('\n');
        u += 0.1 * (0.004 * (left + right - 3022.0) - 0.5 * u);
        r += 0.1 * (0.004 * (left - right) - r);
    }
    std::fs::write(&file, text).unwrap();
    file
}

#[test]
fn pulse_widths_without_parameters() {
    let folder = TempDir::new().unwrap();
    let file = table(folder.path());
    let found = proposal(&file);
    let left = &found.boat.inputs["pwm_left"];
    assert_eq!(numbers(left), (None, Some(1511.0), Some([1100.0, 1900.0]), Some(400.0)));
    assert_eq!(
        left.found[&Property::Neutral],
        Evidence::Log("the most common value of the recording".into())
    );
    // The rate of revolution has values of pulse widths, and no name or unit that says so.
    assert!(found.selection.inputs.iter().any(|spec| spec.column == "rpm"));
    assert!(!found.boat.inputs.contains_key("rpm"));
    // What only the values tell stays weak when the file is read.
    let written = folder.path().join("hydroid.toml");
    std::fs::write(&written, found.to_toml("day.csv")).unwrap();
    let read = config::read(&written).unwrap().boat.inputs["pwm_left"].clone();
    assert_eq!(read.found.len(), 1);
    assert_eq!(read.found[&Property::Neutral], left.found[&Property::Neutral]);
    assert!(found.remarks.iter().all(|remark| !remark.contains("[boat")), "{:?}", found.remarks);
}

fn config(boat: &str, inputs: &str) -> Config {
    toml::from_str(&format!("[log]\noutputs = [\"u\", \"v\", \"r\"]\n{inputs}\n{boat}")).unwrap()
}

const LEFT: &str = "[boat.inputs.left]\nunit = \"us\"\nneutral = 1511\nlimits = [1111, 1911]\nscale = 400\n";

#[test]
fn a_log_is_read_with_the_boat() {
    let folder = TempDir::new().unwrap();
    let file = table(folder.path());
    let raw = log::read(&file).unwrap();
    let boat = config(LEFT, "inputs = [\"left=pwm_left\", \"pwm_right\"]");
    let reading = boat.reading().unwrap();
    let run = &log::prepare([&raw], &reading.selection, &reading.options).unwrap().runs[0];
    let channels = run.inputs.channels();
    assert_eq!((channels[0].unit.as_str(), channels[1].unit.as_str()), ("1", ""));
    let logged = &raw.columns[raw.position("pwm_left").unwrap()].values;
    for k in [0, 200, 555] {
        assert_eq!(run.inputs.row(k)[0], (logged[k] - 1511.0) / 400.0);
    }
    let logs = Logs { train: vec![raw.clone()], validate: Vec::new(), test: Vec::new() };
    let (job, _) = boat.job(reading, &logs, None).unwrap();
    assert_eq!(job.boat.inputs["left"].neutral, Some(1511.0), "the boat keeps raw values");
    // The reading of a model reads further logs.
    let text = serde_json::to_string(&job.reading).unwrap();
    assert_eq!(serde_json::from_str::<Reading>(&text).unwrap(), job.reading);

    // A log of model inputs is not converted again.
    let scaled =
        hydroid::recording::converted(&logs.train[0], &job.reading.selection, &mut Vec::new()).unwrap();
    let mut again = Selection::of("u,v,r", "left").unwrap();
    job.boat.read(&mut again.inputs).unwrap();
    let mut notes = Vec::new();
    let read = log::prepare([&scaled], &again, &job.reading.options).unwrap();
    notes.extend(read.notes);
    assert_eq!(read.runs[0].inputs.row(555)[0], (logged[555] - 1511.0) / 400.0);
    assert!(
        notes.iter().any(|note| note.message.contains("`left` is a pure number by its header")),
        "{notes:?}"
    );
}

/// A motor that only turns ahead rests at its shortest pulse, which is not near 1500 us.
#[test]
fn the_neutral_position_of_a_motor_that_only_turns_ahead_is_not_guessed() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("ahead.csv");
    let rows = (0..400_u32).map(|k| {
        let pulse = if k < 200 { 1100 } else { 1300 + 50 * (k / 25 % 5) };
        format!("{},{},0,0,{pulse}\n", f64::from(k) * 0.1, 0.5 + 0.001 * f64::from(k))
    });
    let text = "t [s],u [m/s],v [m/s],r [rad/s],pwm_motor\n".to_owned() + &rows.collect::<String>();
    std::fs::write(&file, text).unwrap();
    assert!(!proposal(&file).boat.inputs.contains_key("pwm_motor"));
}

#[test]
fn a_header_in_another_unit_than_the_boat_is_converted() {
    let folder = TempDir::new().unwrap();
    let file = table(folder.path());
    let text = std::fs::read_to_string(&file).unwrap().replacen("pwm_left", "pwm_left [ms]", 1);
    let thousandth = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[5] = (cells[5].parse::<f64>().unwrap() / 1000.0).to_string();
        cells.join(",")
    };
    let (head, rows) = text.split_once('\n').unwrap();
    let rows: Vec<String> = rows.lines().map(thousandth).collect();
    let reading = config(LEFT, "inputs = [\"left=pwm_left\", \"pwm_right\"]").reading().unwrap();
    let read = |text: &str| {
        let raw = log::read_from(text.as_bytes(), "day.csv").unwrap();
        log::prepare([&raw], &reading.selection, &reading.options).unwrap().runs[0].inputs.row(200)[0]
    };
    let [first, second] = [std::fs::read_to_string(&file).unwrap(), format!("{head}\n{}\n", rows.join("\n"))];
    assert!((read(&first) - read(&second)).abs() < 1e-9, "{} {}", read(&first), read(&second));
}

#[test]
fn a_boat_and_a_log_that_contradict_each_other() {
    let error =
        |boat: &str, spec: &str| config(boat, &format!("inputs = [\"{spec}\"]")).reading().unwrap_err();
    let two = error(LEFT, "left=pwm_left - 1500");
    assert!(matches!(two, BoatError::TwoFormulas { .. }));
    let text = two.to_string();
    assert!(text.contains("'left=pwm_left - 1500' in [log] inputs, and neutral, limits or scale"), "{text}");
    assert!(matches!(error(LEFT, "left=pwm_left * -1"), BoatError::TwoFormulas { .. }));
    assert!(matches!(error(LEFT, "left=angle [deg]"), BoatError::OtherUnit { .. }));
    let unscaled = "[boat.inputs.left]\nunit = \"us\"\nneutral = 1500\n";
    assert!(matches!(error(unscaled, "left=pwm_left - 1500"), BoatError::TwoFormulas { .. }));
    let text = error("[boat.inputs.left]\nunit = \"us\"\nscale = 400\n", "left=pwm_left").to_string();
    assert!(text.contains("(raw - neutral) / scale; add neutral = VALUE to [boat.inputs.left]"), "{text}");
    assert!(matches!(
        error("[boat.inputs.left]\nneutral = 1500\nscale = 0\n", "left=pwm_left"),
        BoatError::NoScale(_)
    ));
    // Columns that are found by their names have no boat.
    let folder = TempDir::new().unwrap();
    let logs = Logs {
        train: vec![log::read(&table(folder.path())).unwrap()],
        validate: Vec::new(),
        test: Vec::new(),
    };
    let unnamed = config(LEFT, "");
    let error = unnamed.clone().job(unnamed.reading().unwrap(), &logs, None).unwrap_err();
    assert!(error.to_string().contains("[log] names no inputs"), "{error}");
    // Without a scale, the column may have a formula, as before.
    let spec: ChannelSpec = "left=pwm_left - 1500".parse().unwrap();
    let kept = config("[boat.inputs.left]\nrole = \"thruster\"\n", "inputs = [\"left=pwm_left - 1500\"]");
    assert_eq!(kept.reading().unwrap().selection.inputs, [spec]);
}
