//! Vessel files with any set of actuators: reading, writing, comparison with an independent integration, grey box.

use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use hydroid::adapt;
use hydroid::craft::{CommandUnit, CraftFile, parse};
use hydroid::evaluate;
use hydroid::identify::{
    Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, Training, identify,
};
use hydroid::log::{Split, Table, Trajectory};
use hydroid::manoeuvre::{TrialKind, TrialOptions, trials};
use hydroid::model::{self, Model, Reading};
use hydroid::plant::{Commands, InputMap, RecordOptions, Simulation, record};
use hydroid::progress::silent;
use hydroid_core::craft::Craft;
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::Predictor;
use proptest::prelude::*;

const VESSELS: [&str; 3] = ["otter", "mariner", "tug"];

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)
}

fn text(name: &str) -> String {
    fs::read_to_string(folder("vessels").join(format!("{name}.toml"))).unwrap()
}

fn file(name: &str) -> CraftFile {
    parse(&text(name), Path::new("boat.toml")).unwrap()
}

/// A vessel with every feature of a vessel file.
fn workboat() -> CraftFile {
    let path = folder("tests/golden/workboat.toml");
    parse(&fs::read_to_string(&path).unwrap(), &path).unwrap()
}

#[test]
fn a_written_vessel_file_is_the_one_that_was_read() {
    for (name, read) in VESSELS.map(|name| (name, file(name))).into_iter().chain([("workboat", workboat())]) {
        let again = parse(&read.text(), Path::new("again.toml")).unwrap();
        assert_eq!(read.ties, again.ties, "{name}");
        assert_eq!(read.estimate, again.estimate, "{name}");
        for ((parameter, a), (other, b)) in read.craft.parameters().iter().zip(again.craft.parameters()) {
            assert_eq!((parameter, *a), (&other, b), "{name}");
        }
        for (a, b) in read.craft.commands.iter().zip(&again.craft.commands) {
            assert_eq!((&a.name, &a.unit), (&b.name, &b.unit));
            let near = |x: f64, y: f64| (x - y).abs() <= 1e-12 * x.abs();
            assert!(
                near(a.limits[0], b.limits[0])
                    && near(a.limits[1], b.limits[1])
                    && near(a.neutral, b.neutral)
            );
        }
        assert_eq!(read.text(), again.text(), "{name}");
    }
}

#[test]
fn shared_numbers_follow() {
    let mut otter = file("otter");
    let parameters = otter.craft.parameters();
    let at = |path: &str| parameters.iter().position(|(p, _)| p.path == path).unwrap();
    let mut numbers: Vec<f64> = parameters.iter().map(|(_, number)| *number).collect();
    numbers[at("thruster.port.forward")] = 0.02;
    numbers[at("thruster.port.position[1]")] = -0.3;
    otter.set_numbers(&numbers);
    let [port, starboard] = &otter.craft.thrusters[..] else { panic!() };
    assert_eq!((port.forward, starboard.forward), (0.02, 0.02));
    assert_eq!((port.position[1], starboard.position[1]), (-0.3, 0.395));
}

#[test]
fn errors_name_file_place_and_remedy() {
    let otter = text("otter");
    for (from, to, words) in [
        (
            "mass = 80.0",
            "mass = -80.0",
            "boat.toml, line 29: rigid_body.mass is -80; it must be greater than 0",
        ),
        ("position = [-0.9, 0.395]", "position = [-9, 0.395]", "outside the hull"),
        ("like = \"port\"", "like = \"prot\"", "did you mean 'port'?; there are: port"),
        ("order = { pwm_right = 0.25 }", "order = { pwm_rihgt = 0.25 }", "did you mean 'pwm_right'?"),
        ("order = { pwm_right = 0.25 }", "order = {}", "write order = { NAME = GAIN }"),
        ("\"rigid_body.i_z\",", "\"rigid_body.iz\",", "did you mean 'rigid_body.i_z'?"),
        ("\"rigid_body.i_z\",", "\"drag.lift[0][0]\",", "the start of an estimate must not be 0"),
        ("forward = 0.01108", "#", "thruster.port has no forward"),
        ("position = [-0.9, -0.395]", "#", "thruster.port has no position"),
        ("quadratic = [0.0", "quadratics = [0.0", "unknown key quadratics, did you mean quadratic?"),
        ("linear = [77.55, 162.5, 41.44]", "linear = [1.0]", "the diagonal"),
        ("unit = \"us\"", "unit = \"nm\"", "may mean nautical miles"),
        ("neutral = 1500", "neutral = 150", "the neutral value between them"),
        ("beam = 1.08 ", "beam = 0.0 ", "hull.beam is 0; it must be greater than 0"),
    ] {
        assert!(otter.contains(from), "{from}");
        let error = parse(&otter.replacen(from, to, 1), Path::new("boat.toml")).unwrap_err().to_string();
        assert!(error.starts_with("boat.toml") && error.contains(words), "{error}");
    }
    let mariner = text("mariner");
    for (from, to, words) in [
        ("unit = \"deg\"", "unit = \"\"", "state the unit of the command as deg"),
        ("diameter = 6.7", "#", "which has no diameter: add it"),
        ("lift_slope = 2.4", "#", "rudder.rudder has no aspect_ratio"),
        ("thruster = \"propeller\"", "thruster = \"screw\"", "there are: propeller"),
    ] {
        let error = parse(&mariner.replacen(from, to, 1), Path::new("boat.toml")).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn standard_deviations_of_estimates_belong_to_estimates() {
    let otter = text("otter");
    let with = |table: &str| parse(&otter.replacen("[hull]", table, 1), Path::new("boat.toml"));
    let read = with("[deviation]\n\"rigid_body.i_z\" = 0.25\n\"thruster.starboard.forward\" = 1e-4\n[hull]")
        .unwrap();
    let deviations: Vec<Option<f64>> = read.estimate.iter().map(|estimate| estimate.deviation).collect();
    assert_eq!(deviations, [Some(0.25), None, None, None, None, Some(1e-4), None]);
    for (table, words) in [
        (
            "[deviation]\n\"rigid_body.mass\" = 1.0\n[hull]",
            "estimated number 'rigid_body.mass', which does not exist",
        ),
        ("[deviation]\n\"rigid_body.i_z\" = -1.0\n[hull]", "must not be negative"),
    ] {
        let error = with(table).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("boat.toml"), "{error}");
    }
}

/// The motion and the trials are those of an independent integration in Python (`tests/peers/craft_golden.py`).
#[test]
fn vessels_move_as_an_independent_integration_says() {
    let golden = fs::read_to_string(folder("tests/golden/craft.json")).unwrap();
    let golden: serde_json::Value = serde_json::from_str(&golden).unwrap();
    for name in VESSELS.into_iter().chain(["workboat"]) {
        let file = if name == "workboat" { workboat() } else { file(name) };
        let of = &golden[name];
        for case in of["cases"].as_array().unwrap() {
            let rows: Vec<Vec<f64>> = serde_json::from_value(case["rows"].clone()).unwrap();
            let model = CraftModel::new(file.craft.clone(), SAMPLE_S).unwrap();
            let mut session = CraftSession::new(&model);
            session.observe(&[0.0; 3]);
            let commands: Vec<(f64, Vec<f64>)> = case["commands"]
                .as_array()
                .unwrap()
                .iter()
                .map(|c| (c["t"].as_f64().unwrap(), serde_json::from_value(c["values"].clone()).unwrap()))
                .collect();
            // Relative to the motion of this case.
            let largest = |i: usize| rows.iter().map(|row| row[i + 1].abs()).fold(0.0, f64::max);
            let (mut t, mut y) = (0.0, [0.0; 3]);
            for row in &rows {
                while t < row[0] - 1e-9 {
                    let (_, values) = commands.iter().rfind(|(from, _)| *from <= t + 1e-9).unwrap();
                    let stored: Vec<f64> =
                        values.iter().zip(&file.units).map(|(value, unit)| value * unit.factor).collect();
                    session.advance(&stored);
                    t += SAMPLE_S;
                }
                session.output(&mut y);
                for i in 0..3 {
                    let error = (y[i] - row[i + 1]).abs();
                    assert!(error <= 1e-3 * largest(i) + 1e-9, "{name}, {}: {y:?} {row:?}", case["name"]);
                }
            }
        }
        if of["circle"].is_object() {
            check_circle(name, &file, &of["circle"]);
        }
    }
}

/// A turning circle after the approach of the golden file.
fn check_circle(name: &str, file: &CraftFile, golden: &serde_json::Value) {
    let numbers = |key: &str| -> Vec<f64> { serde_json::from_value(golden[key].clone()).unwrap() };
    let stored = |key: &str| -> Vec<f64> {
        numbers(key).iter().zip(&file.units).map(|(value, unit)| value * unit.factor).collect()
    };
    let model = Model::of_craft(file, 0.05).unwrap();
    let mut simulation = Simulation::new(&model).unwrap();
    let (approach, hard_over) = (stored("approach"), stored("commands"));
    simulation.start([0.0; 3], &[0.0; 3], &approach);
    // Until the speed is steady.
    let mut speed = -1.0;
    while (simulation.nu()[0] - speed).abs() > 1e-9 {
        speed = simulation.nu()[0];
        (0..1_000).for_each(|_| simulation.advance(&approach));
    }
    simulation.place([0.0; 3]);
    let mut crossings = Vec::new();
    let mut before = simulation.eta();
    while crossings.len() < 2 {
        simulation.advance(&hard_over);
        let now = simulation.eta();
        let goal = FRAC_PI_2 * (crossings.len() + 1) as f64;
        if now[2].abs() >= goal {
            let share = (goal - before[2].abs()) / (now[2].abs() - before[2].abs());
            crossings.push([0, 1].map(|i| before[i] + share * (now[i] - before[i])));
        }
        before = now;
    }
    for (key, value) in [
        ("advance_m", crossings[0][0]),
        ("transfer_m", crossings[0][1].abs()),
        ("tactical_diameter_m", crossings[1][1].abs()),
    ] {
        let golden = golden[key].as_f64().unwrap().abs();
        assert!((value / golden - 1.0).abs() < 1e-3, "{name}, {key}: {value} {golden}");
    }
}

/// Sample time at which the golden cases are compared \[s\]: times of commands and rows are multiples of it.
const SAMPLE_S: f64 = 0.5;

fn trajectory(vessel: &CraftFile, seed: u64, duration_s: f64, dt: f64) -> Trajectory {
    let model = Model::of_craft(vessel, dt).unwrap();
    let commands = Commands::Mixed { duration_s };
    let options = RecordOptions { commands, seed, noise: 1.0, process_noise: 0.0, current: [0.0; 2] };
    let record = record(&model, None, &options, &mut silent()).unwrap();
    Trajectory {
        name: format!("run {seed}"),
        t0: 0.0,
        dt,
        outputs: Table::new(record.outputs.clone(), record.measured.clone()),
        inputs: Table::new(record.inputs.clone(), record.commands.clone()),
        truth: None,
        heading: None,
        position: None,
    }
}

/// Sequences that are rolled out side by side are those that are rolled out alone, from known and unknown positions.
#[test]
fn sequences_side_by_side_are_those_alone() {
    for name in ["otter", "tug", "mariner", "hydrofoil"] {
        let vessel = file(name).craft;
        let (inputs, steps, count) = (vessel.commands.len(), 12, 21);
        let mut session = CraftSession::new(&CraftModel::new(vessel.clone(), 0.5).unwrap());
        session.observe(&[0.8, 0.05, -0.02]);
        let command = |k: usize, i: usize| {
            let ([low, high], share) = (vessel.commands[i].limits, (0.7 * (k * inputs + i) as f64).sin());
            0.5 * (low + high) + 0.4 * share * (high - low)
        };
        let commands: Vec<f64> =
            (0..count * steps).flat_map(|k| (0..inputs).map(|i| command(k, i)).collect::<Vec<_>>()).collect();
        for _ in 0..3 {
            let (mut alone, mut both) = (vec![0.0; count * steps * 3], vec![0.0; count * steps * 3]);
            let mut work = hydroid_core::predict::Workspace::new();
            for (c, y) in commands.chunks(steps * inputs).zip(alone.chunks_mut(steps * 3)) {
                session.rollout(c, &mut work, y);
            }
            session.rollout_batch(count, &commands, &mut work, &mut both);
            for (k, (a, b)) in alone.iter().zip(&both).enumerate() {
                assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{name}, {k}: {a} and {b}");
            }
            session.advance(&commands[..inputs]);
        }
    }
}

fn job(runs: Vec<Trajectory>, vessel: CraftFile, horizon: usize) -> Job {
    Job {
        methods: vec![Method::GreyBox],
        split: Split { train: runs, validation: Vec::new(), test: Vec::new(), notes: Vec::new() },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon,
        origin_stride: 20,
        seed: 0,
        ranges: hydroid::identify::GivenRanges::default(),
        motion: MotionOption::OverGround,
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions::default(),
        networks: NetworkTrainingOptions::default(),
        vessel: Some(vessel),
    }
}

/// Numbers that are wrong by 20 to 40 %, with alternating signs.
fn spoiled(vessel: &CraftFile) -> CraftFile {
    let mut numbers: Vec<f64> = vessel.craft.parameters().iter().map(|(_, number)| *number).collect();
    for (k, estimate) in vessel.estimate.iter().enumerate() {
        numbers[estimate.index] *= [1.3, 0.75, 1.2, 0.7][k % 4];
    }
    let mut spoiled = vessel.clone();
    spoiled.set_numbers(&numbers);
    spoiled
}

struct Found {
    model: Model,
    largest: f64,
}

/// Estimates the marked numbers of a vessel from 20 minutes of a noisy log.
fn found(name: &str, dt: f64, horizon: usize) -> Found {
    let vessel = file(name);
    let runs = (1..=4).map(|seed| trajectory(&vessel, seed, 300.0, dt)).collect();
    let result = identify(&job(runs, spoiled(&vessel), horizon), &mut silent()).unwrap();
    assert!(result.is_usable(), "{name}: {:?}", result.verdicts);
    let candidate = &result.candidates[0];
    let Training::GreyBox(found) = &candidate.training else { panic!() };
    let truth = vessel.craft.parameters();
    let mut largest = 0.0_f64;
    for (estimated, estimate) in found.estimates.iter().zip(&vessel.estimate) {
        let truth = truth[estimate.index].1;
        let error = estimated.value / truth - 1.0;
        println!(
            "{name} {}: {:+.2} %, given {:+.0} %",
            estimated.parameter.path,
            100.0 * error,
            100.0 * (estimated.given / truth - 1.0)
        );
        assert!(estimated.informed, "{}", estimated.parameter.path);
        assert!((estimated.value - truth).abs() < 6.0 * estimated.deviation, "{estimated:?}, truth {truth}");
        largest = largest.max(error.abs());
    }
    Found { model: candidate.model.clone(), largest }
}

fn otter() -> &'static Found {
    static OTTER: OnceLock<Found> = OnceLock::new();
    OTTER.get_or_init(|| found("otter", 0.1, 50))
}

fn tug() -> &'static Found {
    static TUG: OnceLock<Found> = OnceLock::new();
    TUG.get_or_init(|| found("tug", 0.5, 40))
}

#[test]
fn the_grey_box_finds_the_marked_numbers() {
    for found in [otter(), tug()] {
        assert!(found.largest < 0.05, "{}", found.largest);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grey-box.toml");
        model::write(&found.model, &path).unwrap();
        let again = model::read(&path).unwrap();
        let numbers = |model: &Model| model.craft().unwrap().parameters();
        assert_eq!(numbers(&again), numbers(&found.model));
        let estimates = |model: &Model| model.craft_file().unwrap().estimate.clone();
        assert!(estimates(&again).iter().all(|estimate| estimate.deviation.is_some()));
        assert_eq!(estimates(&again), estimates(&found.model));
        assert!(fs::read_to_string(&path).unwrap().contains("(1 sigma)"));
    }
}

#[test]
fn an_estimated_vessel_runs_its_trials() {
    for (name, found) in [("otter", otter()), ("tug", tug())] {
        let truth = Model::of_craft(&file(name), found.model.description.dt).unwrap();
        let map = InputMap::find(&truth).unwrap();
        let figure = |model: &Model| {
            let kinds = [TrialKind::TurningCircle { steering: 1.0 }];
            let trials =
                trials(model, &map, &kinds, &TrialOptions::default(), &mut silent()).unwrap().unwrap();
            let figure = trials.trials[0].figures.iter().find(|figure| figure.name == "tactical_diameter_m");
            figure.unwrap().value.unwrap()
        };
        let (estimated, truth) = (figure(&found.model), figure(&truth));
        assert!((estimated / truth - 1.0).abs() < 0.03, "{name}: {estimated} {truth}");
    }
}

#[test]
fn a_grey_box_needs_marks_and_fitting_channels() {
    let vessel = file("otter");
    let runs = || {
        vec![
            trajectory(&vessel, 1, 60.0, 0.1),
            trajectory(&vessel, 2, 60.0, 0.1),
            trajectory(&vessel, 3, 60.0, 0.1),
        ]
    };
    let error = |job: Job| identify(&job, &mut silent()).unwrap_err().to_string();
    let unmarked = CraftFile { estimate: Vec::new(), ..vessel.clone() };
    assert!(error(job(runs(), unmarked, 20)).contains("marks no number to estimate"));
    assert!(error(Job { vessel: None, ..job(runs(), vessel.clone(), 20) }).contains("vessel=\"boat.toml\""));
    let other = error(job(runs(), file("mariner"), 20));
    assert!(
        other.contains("marks no number") || other.contains("the logs have pwm_left, pwm_right"),
        "{other}"
    );
    let mut tug = file("tug");
    tug.estimate.truncate(1);
    let other = error(job(runs(), tug, 20));
    assert!(
        other.contains("the vessel has the inputs thrust_port") && other.contains("inputs=\"NAME=COLUMN\""),
        "{other}"
    );
}

/// Replacements in a vessel file, most of which make it invalid.
fn replacement() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<f64>().prop_map(|x| format!("{x:?}")),
        (-1e3..1e3f64).prop_map(|x| x.to_string()),
        "[a-z\"\\[\\]={}#.\n-]{0,4}",
        Just(String::from("1e308")),
        Just(String::from("port")),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// What is read can be written, read again and moved; anything else is an error that names the file.
    #[test]
    fn changed_vessel_files_are_refused_or_usable(
        name in prop::sample::select(&VESSELS[..]), changes in prop::collection::vec((any::<prop::sample::Index>(), replacement()), 1..3),
    ) {
        let mut words: Vec<String> = text(name).split_inclusive([' ', '\n', ',', '[', ']']).map(str::to_owned).collect();
        for (index, replacement) in changes {
            let place = index.index(words.len());
            let end = words[place].chars().last().filter(|c| " \n,[]".contains(*c));
            words[place] = replacement;
            words[place].extend(end);
        }
        match parse(&words.concat(), Path::new("boat.toml")) {
            Err(error) => prop_assert!(error.to_string().starts_with("boat.toml"), "{error}"),
            Ok(file) => {
                let again = parse(&file.text(), Path::new("again.toml")).unwrap();
                prop_assert_eq!(again.craft.parameters().len(), file.craft.parameters().len());
                if let Ok(model) = CraftModel::new(file.craft.clone(), 0.1) {
                    let mut session = CraftSession::new(&model);
                    session.observe(&[0.0; 3]);
                    let command: Vec<f64> = file.craft.commands.iter().map(|command| command.limits[1]).collect();
                    (0..3).for_each(|_| session.advance(&command));
                }
            }
        }
    }
}

/// The vessels of the thesis: the form of the Coriolis forces, a rudder that is a yaw moment, and a flying mode.
#[test]
fn the_vessels_of_the_thesis_are_read_as_they_are_written() {
    for craft in [Craft::simple(), Craft::hydrofoil(), Craft::hydrofoil_low_speed()] {
        let units = craft.commands.iter().map(|command| CommandUnit {
            text: command.unit.clone(),
            stored: command.unit.clone(),
            factor: 1.0,
            gain: 1.0,
        });
        let file = CraftFile { units: units.collect(), estimate: Vec::new(), ties: Vec::new(), craft };
        let text = file.text();
        assert_eq!(parse(&text, "thesis.toml".as_ref()).unwrap(), file, "{text}");
    }
}

#[test]
fn keys_of_the_other_law_of_a_rudder_are_errors() {
    let head = r#"
name = "boat"
rigid_body = { mass = 80.0, i_z = 16.0 }
added_mass = { x_udot = -5.0, y_vdot = -80.0, n_rdot = -25.0 }
drag = { linear = [70.0, 160.0, 40.0] }
command = [{ name = "n", limits = [-1.0, 1.0] }, { name = "rudder", unit = "deg", limits = [-30.0, 30.0] }]
thruster = [{ name = "propeller", position = [0.0, 0.0], order = { n = 1.0 }, forward = 90.0 }]
"#;
    let rudder = |keys: &str| {
        let text = format!("{head}\n[[rudder]]\nname = \"helm\"\norder = {{ rudder = 1.0 }}\n{keys}\n");
        parse(&text, "boat.toml".as_ref()).map_err(|error| error.to_string())
    };
    assert!(rudder("law = \"sine\"\ngain = 70.0").is_ok());
    for (keys, words) in [
        ("law = \"sine\"", "rudder.helm has no gain: state the yaw moment"),
        ("law = \"sine\"\ngain = 70.0\narea = 0.1", "rudder.helm.area belongs to the normal force"),
        ("gain = 70.0", "rudder.helm.gain needs law = \"linear\" or \"sine\""),
        ("area = 0.1\naspect_ratio = 1.5", "rudder.helm has no position: write"),
        ("law = \"linear\"\ngain = 0.0", "rudder.helm.gain is 0; it must be greater than 0"),
    ] {
        let error = rudder(keys).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
}

/// Numbers before and after an adaptation on a log of the true vessel, relative to it.
#[test]
fn vessels_with_any_actuators_are_adapted() {
    for (name, dt, horizon, learned) in [("otter", 0.1, 50, 7), ("tug", 0.5, 40, 8)] {
        let truth = file(name);
        let run = trajectory(&truth, 5, 900.0, dt);
        let given = Model::of_craft(&spoiled(&truth), dt).unwrap();
        let options = adapt::Options {
            evaluate: evaluate::Options {
                horizon,
                origin_stride: 10,
                warm_up: run.len() / 2,
                ..evaluate::Options::default()
            },
            ..adapt::Options::of(&given)
        };
        let adapted = adapt::adapt(&given, &[&run], &options, &mut silent()).unwrap();
        let report = &adapted.report;
        assert_eq!((report.frozen.diverged, report.adapted.diverged), (0, 0));
        for (frozen, adapted) in
            report.frozen.nrmse[horizon - 1].iter().zip(&report.adapted.nrmse[horizon - 1])
        {
            assert!(*adapted < 0.75 * frozen, "{name}: {adapted} {frozen}");
        }
        assert_eq!(report.parameters.len(), learned, "{name}: those that the file marks");
        let true_numbers = truth.craft.parameters();
        for number in &report.parameters {
            let truth = true_numbers.iter().find(|(parameter, _)| parameter.path == number.path).unwrap().1;
            let [before, after] = [number.given, number.learned].map(|value| (value / truth - 1.0).abs());
            println!("{name} {}: {:.1} %, given {:.1} %", number.path, 100.0 * after, 100.0 * before);
            assert!(after < 0.5 * before, "{name}, {}: {after} {before}", number.path);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("learned.toml");
        model::write(&adapted.model, &path).unwrap();
        let again = model::read(&path).unwrap();
        assert_eq!(again.craft().unwrap().parameters(), adapted.model.craft().unwrap().parameters());
        assert_eq!(again.description.provenance.settings["adapted"][0]["runs"][0], "run 5");
        let file = again.craft_file().unwrap();
        let forward: Vec<f64> = file.craft.thrusters.iter().map(|thruster| thruster.forward).collect();
        assert!(forward.windows(2).all(|pair| pair[0] == pair[1]), "thrusters like another one stay equal");
    }
}

/// A file that marks no numbers: all but places and directions are learned.
#[test]
fn a_ship_without_marked_numbers_is_adapted() {
    let truth = file("mariner");
    assert!(truth.estimate.is_empty());
    let mut given = truth.clone();
    let changed: Vec<f64> = truth
        .craft
        .parameters()
        .iter()
        .map(|(parameter, number)| if parameter.path.starts_with("drag.") { 1.3 * number } else { *number })
        .collect();
    given.set_numbers(&changed);
    let run = trajectory(&truth, 5, 7200.0, 1.0);
    let given = Model::of_craft(&given, 1.0).unwrap();
    let options = adapt::Options {
        evaluate: evaluate::Options { horizon: 60, origin_stride: 20, ..evaluate::Options::default() },
        ..adapt::Options::of(&given)
    };
    let report = adapt::adapt(&given, &[&run], &options, &mut silent()).unwrap().report;
    assert_eq!((report.frozen.diverged, report.adapted.diverged), (0, 0));
    let paths: Vec<&str> = report.parameters.iter().map(|number| number.path.as_str()).collect();
    assert!(paths.contains(&"rudder.rudder.rate") && paths.contains(&"drag.lift[1][0]"), "{paths:?}");
    assert!(!paths.iter().any(|path| path.contains("position[")), "{paths:?}");
    let mean = |evaluation: &evaluate::Evaluation| evaluation.nrmse[59].iter().sum::<f64>();
    let (frozen, adapted) = (mean(&report.frozen), mean(&report.adapted));
    println!("mariner: {frozen} {adapted}");
    assert!(adapted < 0.5 * frozen, "{adapted} {frozen}");
}
