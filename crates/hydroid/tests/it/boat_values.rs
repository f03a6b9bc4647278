//! Neutral value and limits of inputs: stated, found, by convention, or weak from the log.

use hydroid::boat::{Boat, BoatError, Evidence, Input, Property, Role, Value, check_firm};
use hydroid::closed_loop::limits_of;
use hydroid::config::control::{ClosedLoopOptions, NamedModel, Setup};
use hydroid::config::{self, Config, Logs, TrialName};
use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{self, Model, MovedTogether};
use hydroid::plant::{InputMap, input_values};
use hydroid::progress::silent;
use hydroid_core::model::sparse::Term;

use crate::boat::rudder_only;
use crate::manoeuvre::{equations, port};

fn boat(name: &str, input: Input) -> Boat {
    Boat { inputs: [(name.to_owned(), input)].into(), ..Boat::default() }
}

fn value(channel: (&str, &str), input: Input, seen: [f64; 2]) -> Result<Value, BoatError> {
    let channel = Channel::new(channel.0, channel.1);
    let mut boat = boat(&channel.name, input);
    boat.find(std::slice::from_ref(&channel));
    boat.value(&channel, Some(seen))
}

/// Two propellers with pulses, ahead in the whole log: `du/dt = 1e-4 (l + r - 3000) - 0.05 u`,
/// `dr/dt = 1e-4 (l - r) - 0.2 r`.
fn pulses(unit: &str) -> Model {
    let outputs = vec![port("u", "m/s", 0.0, 3.0), port("r", "rad/s", -0.3, 0.3)];
    let inputs = vec![port("left", unit, 1481.0, 1900.0), port("right", unit, 1430.0, 1900.0)];
    let terms = [&[][..], &[0], &[1], &[2], &[3]].map(Term::monomial).to_vec();
    let coefficients = vec![-0.3, -0.05, 0.0, 1e-4, 1e-4, 0.0, 0.0, -0.2, 1e-4, -1e-4];
    equations(outputs, inputs, 0.5, terms, coefficients)
}

#[test]
fn the_strongest_source_counts() {
    let of = |unit, seen| value(("x", unit), Input::default(), seen).unwrap();
    // A steering angle: 35 degrees by convention, or more if the log has more.
    let rudder = value(("delta", "rad"), Input::default(), [-0.1, 0.2]).unwrap();
    let hard = 35.0_f64.to_radians();
    assert_eq!((rudder.neutral, rudder.limits), (0.0, [-hard, hard]));
    assert!(
        matches!(&rudder.limits_found, Some(Evidence::Convention(text)) if text.contains("MSC.137(76) 5.2"))
    );
    let wide = value(("delta", "rad"), Input::default(), [-0.1, 0.8]).unwrap();
    assert_eq!(wide.limits, [-hard, 0.8]);
    // A pulse width rests at 1500 us; what is called so and is none does not.
    assert_eq!((of("us", [1481.0, 1900.0]).neutral, of("us", [-0.05, 1.0]).neutral), (1500.0, 0.0));
    // A physical quantity rests at 0; a number only if its range contains it.
    assert_eq!((of("rps", [5.0, 12.0]).neutral, of("", [-1.0, 3.0]).neutral), (0.0, 0.0));
    let weak = of("", [2.0, 4.0]);
    assert_eq!((weak.neutral, weak.limits), (3.0, [2.0, 4.0]));
    assert_eq!(weak.weak().collect::<Vec<_>>(), [Property::Neutral, Property::Limits]);
    let note = value(("n", "rps"), Input::default(), [5.0, 12.0]).unwrap().note().unwrap();
    let expected =
        "limits of n: 5 to 12 rps, seen in the log; state them with [boat.inputs.n] limits = [LOW, HIGH]";
    assert_eq!(note, expected);
    // What is stated, in another unit or with a scale.
    let degrees = Input { unit: Some("deg".into()), limits: Some([-20.0, 25.0]), ..Input::default() };
    let stated = value(("delta", "rad"), degrees, [-0.1, 0.2]).unwrap();
    assert!((stated.limits[1] - 25.0_f64.to_radians()).abs() < 1e-12 && stated.limits_found.is_none());
    let scaled = Input {
        unit: Some("us".into()),
        neutral: Some(1500.0),
        limits: Some([1100.0, 1900.0]),
        scale: Some(-400.0),
        ..Input::default()
    };
    let stated = value(("left", ""), scaled.clone(), [-0.2, 0.9]).unwrap();
    assert_eq!((stated.neutral, stated.limits), (0.0, [-1.0, 1.0]));
    assert_eq!(boat("left", scaled).raw(&Channel::new("left", ""), 1.0).unwrap(), 1100.0);
}

#[test]
fn values_that_contradict_each_other_are_refused() {
    let refused = |channel, input| value(channel, input, [0.0, 1.0]).unwrap_err().to_string();
    let limits = |low, high| Input { limits: Some([low, high]), ..Input::default() };
    let left = ("left", "");
    assert!(refused(left, limits(2.0, 1.0)).contains("give the lower one first"));
    assert!(refused(left, limits(f64::NAN, 1.0)).contains("give finite numbers"));
    let outside = Input { neutral: Some(1500.0), ..limits(1600.0, 1900.0) };
    assert_eq!(
        refused(left, outside),
        "neutral of left is 1500, outside of its limits 1600 to 1900: correct one of them in [boat.inputs.left], or by neutral or limit"
    );
    let scale = |scale, neutral| Input { scale: Some(scale), neutral, ..Input::default() };
    assert!(refused(left, scale(0.0, Some(1.0))).contains("scale of left is 0"));
    assert!(refused(left, scale(400.0, None)).contains("(raw - neutral) / scale; add neutral"));
    let unit = Input { unit: Some("us".into()), ..Input::default() };
    let text = refused(("delta", "rad"), unit);
    assert!(text.contains("unit of delta, [us]") && text.contains("different things"), "{text}");
}

#[test]
fn limits_within_the_logged_commands_are_refused_before_the_training() {
    let rows = (0_u32..40).map(|k| {
        format!("{k},{},0,{}\n", 1.0 + 0.1 * f64::from(k % 7), if k % 9 == 0 { 1900 } else { 1450 })
    });
    let text = format!("t,u,r,left\n{}", rows.collect::<Vec<_>>().concat());
    let job = |limits: &str| {
        let config = format!(
            "[log]\noutputs = [\"u\", \"r\"]\ninputs = [\"left\"]\n[boat.inputs.left]\nlimits = {limits}\n"
        );
        let config: Config = toml::from_str(&config).unwrap();
        let log = hydroid::log::read_from(text.as_bytes(), "run.csv").unwrap();
        let logs = Logs { train: vec![log], validate: Vec::new(), test: Vec::new() };
        config.clone().job(config.reading().unwrap(), &logs, None)
    };
    let error = job("[1200, 1800]").unwrap_err().to_string();
    assert!(error.contains("limits of left are 1200 to 1800, and the log commands 1900"), "{error}");
    assert!(job("[1447, 1896]").is_ok(), "one per cent is the noise of a log");
}

#[test]
fn a_service_needs_more_than_the_log() {
    let firm = |model: &Model| check_firm(&input_values(model).unwrap());
    let error = firm(&pulses("")).unwrap_err().to_string();
    assert!(error.contains("neutral value and limits of left"), "{error}");
    assert!(error.contains("[boat.inputs.left] neutral = VALUE, limits = [LOW, HIGH]"), "{error}");
    let error = firm(&pulses("us")).unwrap_err().to_string();
    assert!(error.contains("neutral=\"left=VALUE\" and limit=\"left=LOW:HIGH\""), "{error}");
    let options = ClosedLoopOptions {
        neutral: ["left", "right"].map(|name| (name.to_owned(), 1500.0)).into(),
        limit: ["left", "right"].map(|name| (name.to_owned(), "1100:1900".parse().unwrap())).into(),
        ..ClosedLoopOptions::default()
    };
    let setup =
        |options| Setup::new(options, Some(NamedModel { name: "m".into(), model: pulses("us") }), None);
    let simulated = setup(ClosedLoopOptions::default()).unwrap();
    assert!(simulated.check_firm().is_err());
    assert!(simulated.notes()[0].contains("limits of left: 1481 to 1900 us, seen in the log"));
    let stated = setup(options.clone()).unwrap();
    assert!(stated.check_firm().is_ok() && stated.notes().is_empty());
    let [low, high, rest] = [stated.scenario.limits[1]].map(|l| [l.low, l.high, l.rest])[0];
    // The log has 1430 to 1900 us: the model is believed within half of that beyond.
    assert_eq!([low, high, rest], [1195.0, 1900.0, 1500.0]);
    let mut together = pulses("us");
    let range = DesignRange { low: -10.0, high: 10.0 };
    together.description.provenance.moved_together = vec![MovedTogether { factors: vec![-1.0, 1.0], range }];
    let together =
        Setup::new(options.clone(), Some(NamedModel { name: "m".into(), model: together }), None).unwrap();
    let error = together.check_firm().unwrap_err().to_string();
    assert!(
        error.contains("left and right did not move apart in the logs of the model (right - left hardly"),
        "{error}"
    );
    // The response test has the same limits.
    let turns = |setup: &Setup| setup.response.unwrap().turning_radius_m;
    assert!(turns(&stated) < turns(&simulated), "{} {}", turns(&stated), turns(&simulated));
    let neutral = [("left".to_owned(), 1000.0)].into();
    let error = setup(ClosedLoopOptions { neutral, ..options }).unwrap_err().to_string();
    assert!(error.contains("neutral of left is 1000, outside of its limits 1100 to 1900"), "{error}");
}

#[test]
fn the_neutral_value_and_limits_of_a_vessel_file_are_those_of_the_boat() {
    let text = r#"
        name = "launch"
        rigid_body = { mass = 400.0, x_g = 0.1, i_z = 900.0 }
        added_mass = { x_udot = -30.0, y_vdot = -250.0, n_rdot = -500.0 }
        drag = { linear = [60.0, 300.0, 400.0], quadratic = [20.0, 200.0, 300.0] }
        command = [{ name = "a", neutral = 1400.0, limits = [1100.0, 1900.0] }, { name = "b", neutral = 1500.0, limits = [1100.0, 1900.0] }]
        [[thruster]]
        name = "port"
        position = [-2.0, -0.6]
        order = { a = 0.2, b = 0.1 }
        forward = 0.02
        reverse = 0.01
        [[thruster]]
        name = "starboard"
        like = "port"
        position = [-2.0, 0.6]
        order = { a = 0.2, b = -0.1 }
    "#;
    let launch = model::decode(text.as_bytes(), "launch.toml".as_ref()).unwrap();
    assert_eq!(InputMap::find(&launch).unwrap().neutral, [1400.0, 1500.0]);
    let rests: Vec<f64> = limits_of(&launch).unwrap().iter().map(|limits| limits.rest).collect();
    assert_eq!(rests, [1400.0, 1500.0]);
    check_firm(&input_values(&launch).unwrap()).unwrap();
}

#[test]
fn hard_over_is_a_property_of_the_boat_and_not_of_a_log() {
    let model = rudder_only("delta", "rad");
    let settings = config::Manoeuvre {
        trials: vec![TrialName::TurningCircle, TrialName::Spiral],
        steering: Some(35.0),
        length: Some(40.0),
        ..config::Manoeuvre::default()
    };
    let run = |settings: &config::Manoeuvre| {
        settings.plan(&model).unwrap().run(&model, &mut silent()).unwrap().unwrap()
    };
    let found = run(&settings);
    for trial in &found.trials {
        let outside = trial.outside.iter().find(|outside| outside.name == "delta").unwrap();
        assert!((outside.range[1].to_degrees() - 20.25).abs() < 1e-9, "{outside:?}");
        let reached = outside.reached.map(|angle| angle.to_degrees().abs()).into_iter().fold(0.0, f64::max);
        assert!((reached - 35.0).abs() < 1e-9 && outside.from_s == 0.0, "{outside:?}");
        assert!(trial.figures.iter().all(|figure| figure.extrapolated));
    }
    let judged = |trials: &hydroid::manoeuvre::Trials| {
        trials.trials[0].figures.iter().any(|figure| figure.criterion.is_some())
    };
    assert!(judged(&found));
    let inside = run(&config::Manoeuvre { steering: Some(20.25), ..settings.clone() });
    assert!(inside.trials[0].outside.iter().all(|outside| outside.name != "delta") && !judged(&inside));
    let error = config::Manoeuvre { steering: Some(36.0), ..settings.clone() }.plan(&model).unwrap_err();
    assert!(error.to_string().contains("hard over is 35.0000 deg"), "{error}");
    // Other limits to port than to starboard: each side ends at its own.
    let limit = [("delta".to_owned(), "-30:40 [deg]".parse().unwrap())].into();
    let settings = config::Manoeuvre { steering: None, limit, ..settings };
    let found = run(&settings);
    let ends = [0, 1].map(|k| found.trials[k].kind.title(&found.inputs));
    assert_eq!(ends, ["turning circle, 35 deg to starboard", "turning circle, 30 deg to port"]);
    // The limits of an input without a unit only follow from the log: the largest angle is not known.
    let unknown = rudder_only("x1", "");
    let settings = config::Manoeuvre { length: Some(40.0), ..config::Manoeuvre::default() };
    let found = settings.plan(&unknown).unwrap().run(&unknown, &mut silent()).unwrap().unwrap();
    assert!(!judged(&found) && found.notes[0].contains("seen in the log"), "{:?}", found.notes);
}

#[test]
fn roles_that_are_not_commanded_have_one_value() {
    let wind = value(("wind_x", "m^2/s^2"), Input::default(), [-20.0, -4.0]).unwrap();
    assert_eq!((wind.neutral, wind.limits, wind.is_commanded), (0.0, [0.0; 2], false));
    let depth = Input { role: Some(Role::Setting), ..Input::default() };
    let depth = value(("depth", "m"), depth, [4.0, 6.0]).unwrap();
    assert_eq!((depth.limits, depth.note()), ([5.0; 2], None));
}

#[test]
fn particulars_are_numbers_above_zero() {
    let of = |text: &str| {
        let text = format!("[boat.particulars]\nname = \"Esso Osaka\"\n{text}");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("hydroid.toml");
        std::fs::write(&file, text).unwrap();
        Config::with(Some(&file), &toml::Table::new()).map(|config| config.boat.check(&[]))
    };
    assert_eq!(of("length = 325\nscale = 45.714\nbeam = 53").unwrap(), Ok(()));
    let error = of("length = 0").unwrap().unwrap_err().to_string();
    assert_eq!(
        error,
        "length in [boat.particulars] is 0: give a number in m greater than 0, or leave the line out"
    );
    assert!(of("scale = -1").unwrap().unwrap_err().to_string().contains("scale in [boat.particulars] is -1"));
    assert!(of("lenght = 325").unwrap_err().to_string().contains("line 3"));
}
