//! Wrong input to a simulation, and command limits.

use std::ops::ControlFlow;
use std::path::Path;

use hydroid::craft::{CraftFile, CraftFileError, load, parse};
use hydroid::excitation::held;
use hydroid::excitation::{
    Circle, Composer, Envelope, Excitation, ExcitationError, LawnMower, LowSpeed, PropellerRudder, Turn,
};
use hydroid::simulate::{Options, SimulateError, Simulated, simulate};
use hydroid::toml_file::TomlError;
use hydroid_core::craft::Craft;
use hydroid_core::vessel::Command;
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

fn run(options: &Options) -> Result<Simulated, SimulateError> {
    simulate(options, &mut |_| ControlFlow::Continue(()))
}

fn hydrofoil() -> Options {
    Options { duration_s: 60.0, ..Options::new(Craft::hydrofoil(), Excitation::Mixed) }
}

fn refused(edit: impl FnOnce(&mut Options)) -> SimulateError {
    let mut options = hydrofoil();
    edit(&mut options);
    run(&options).expect_err("should be refused")
}

#[test]
fn times_that_make_no_sense() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(refused(|o| o.duration_s = bad), SimulateError::Option { .. }));
        assert!(matches!(refused(|o| o.dt_s = bad), SimulateError::Option { .. }));
        assert!(matches!(refused(|o| o.step_s = bad), SimulateError::Option { .. }));
    }
    assert!(matches!(refused(|o| o.duration_s = 1e12), SimulateError::Option { .. }));
    assert!(matches!(refused(|o| o.noise_scale = -0.1), SimulateError::Option { .. }));
    assert!(matches!(refused(|o| o.step_s = 0.03), SimulateError::Substeps { .. }));
    assert!(matches!(refused(|o| o.step_s = 0.2), SimulateError::Substeps { .. }));
}

#[test]
fn steps_that_divide_but_for_rounding() {
    for (dt_s, step_s, samples) in [(0.1, 0.01, 600), (0.3, 0.1, 200), (0.01, 0.01, 6_000), (0.7, 0.007, 86)]
    {
        let record = run(&Options { dt_s, step_s, ..hydrofoil() }).unwrap_or_else(|e| panic!("{dt_s}: {e}"));
        assert_eq!(record.len(), samples);
    }
}

#[test]
fn vessels_that_cannot_be_excited() {
    let error = refused(|o| o.vessel.hull.mass = -1.0);
    assert!(error.to_string().contains("rigid_body.mass is -1"), "{error}");
    let error = refused(|o| {
        o.vessel.hull.linear[0][0] = 0.0;
        o.vessel.hull.quadratic[0][0] = 0.0;
    });
    assert_eq!(error, SimulateError::Excitation(ExcitationError::NoDrag));
    let error = refused(|o| o.vessel.commands[0].limits = [-10.0, 0.0]);
    assert_eq!(error, SimulateError::Excitation(ExcitationError::NoForwardForce { limit: 0.0 }));
}

#[test]
fn a_step_too_long_for_the_vessel_is_an_error() {
    let error = refused(|o| o.vessel.hull.linear[2][2] = 1e6);
    assert!(matches!(error, SimulateError::Diverged { .. }), "{error}");
}

#[test]
fn plans_out_of_reach() {
    let lawn = |plan| refused(|o| o.excitation = Excitation::LawnMower(plan));
    let error = lawn(LawnMower { speeds: vec![2.0, 9.0], ..LawnMower::default() });
    assert!(error.to_string().contains("5.61 m/s"), "{error}");
    for plan in [
        LawnMower { leg: Some(0.0), ..LawnMower::default() },
        LawnMower { spacing: Some(f64::NAN), ..LawnMower::default() },
        LawnMower { turn: Turn::Sharp { speed: Some(-1.0) }, ..LawnMower::default() },
    ] {
        assert!(matches!(lawn(plan), SimulateError::Excitation(ExcitationError::NotPositive { .. })));
    }
    let error = refused(|o| o.excitation = Excitation::Circle(Circle { radius: Some(-3.0), speed: None }));
    assert!(error.to_string().contains("radius"), "{error}");
    let error = refused(|o| o.excitation = Excitation::LowSpeed(LowSpeed { ceiling: 0.0 }));
    assert!(error.to_string().contains("ceiling"), "{error}");
}

fn command(pp: f64, rd: f64) -> Command {
    Command { pp, rd }
}

#[test]
fn given_commands_are_held_until_the_next() {
    let vessel = Craft::hydrofoil();
    let rows = [(5.0, command(10.0, 0.1)), (5.1 + 0.2, command(20.0, 0.2)), (5.35, command(30.0, 0.3))];
    let commands = held(&rows, &PropellerRudder::new(&vessel).unwrap(), 0.1, 6).expect("good rows");
    let pp: Vec<f64> = commands.iter().map(|c| c.pp).collect();
    assert_eq!(pp, [10.0, 10.0, 10.0, 20.0, 30.0, 30.0]);
}

#[test]
fn given_commands_that_are_wrong_name_their_row() {
    let vessel = Craft::hydrofoil();
    let refusal = |rows: &[(f64, Command)]| {
        held(rows, &PropellerRudder::new(&vessel).unwrap(), 0.1, 10).expect_err("should be refused")
    };
    let good = (0.0, command(0.0, 0.0));
    assert_eq!(refusal(&[]), ExcitationError::NoRows);
    assert_eq!(
        refusal(&[good, (0.0, command(0.0, 0.0))]),
        ExcitationError::TimeNotIncreasing { row: 2, time: 0.0, before: 0.0 }
    );
    assert!(matches!(
        refusal(&[good, (f64::NAN, command(0.0, 0.0))]),
        ExcitationError::NotFinite { row: 2, .. }
    ));
    assert!(matches!(
        refusal(&[(0.0, command(0.0, f64::INFINITY))]),
        ExcitationError::NotFinite { row: 1, .. }
    ));
    let error = refusal(&[good, (1.0, command(0.0, 30.0))]);
    assert!(error.to_string().starts_with("row 2 of the commands: RD_ang = 30 is beyond"), "{error}");
}

#[test]
fn a_command_rounded_beyond_its_limit_counts_as_at_its_limit() {
    let vessel = Craft::hydrofoil();
    let nine_digits = "0.523598776".parse().expect("a number");
    let commands =
        held(&[(0.0, command(350.000_1, nine_digits))], &PropellerRudder::new(&vessel).unwrap(), 0.1, 1)
            .expect("good rows");
    assert_eq!(commands, [command(350.0, vessel.commands[1].limits[1])]);
}

#[test]
fn a_vessel_file_reads_back() {
    for params in [Craft::simple(), Craft::hydrofoil(), Craft::hydrofoil_low_speed()] {
        let text = CraftFile::from(params.clone()).text();
        assert_eq!(parse(&text, Path::new("a.toml")).expect("reads").craft, params);
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vessels/hydrofoil.toml");
    assert_eq!(load(path).expect("the example in the repository").craft, Craft::hydrofoil());
}

/// The error for the hydrofoil's file with `from` replaced by `to`.
fn file_error(from: &str, to: &str) -> CraftFileError {
    let text = CraftFile::from(Craft::hydrofoil()).text();
    assert!(text.contains(from), "{text}");
    parse(&text.replacen(from, to, 1), Path::new("boat.toml")).expect_err("should be refused")
}

/// Line of the hydrofoil's file on which `text` starts.
fn line_of(text: &str) -> usize {
    let file = CraftFile::from(Craft::hydrofoil()).text();
    file[..file.find(text).expect("it is there")].lines().count() + 1
}

#[test]
fn a_misspelt_key_names_file_line_and_the_nearest() {
    let error = file_error("mass = 80.0", "mas = 80.0");
    let message = error.to_string();
    let line = line_of("mass = 80.0");
    assert!(
        message.starts_with(&format!("boat.toml, line {line}: unknown key mas, did you mean mass?")),
        "{message}"
    );

    let message = file_error("slope = ", "slop = ").to_string();
    assert!(
        message.contains(&format!("line {}: unknown key slop, did you mean slope?", line_of("slope = "))),
        "{message}"
    );

    let message = file_error("[[rudder]]", "[[ruder]]").to_string();
    assert!(message.contains("unknown key ruder, did you mean rudder?"), "{message}");
    assert!(message.contains(&format!("line {}", line_of("[[rudder]]"))), "{message}");

    let message = file_error("law = \"sine\"", "law = \"sinus\"").to_string();
    assert!(
        message.contains(&format!("line {}", line_of("law = \"sine\""))) && message.contains("sine"),
        "{message}"
    );
}

#[test]
fn other_faults_of_a_vessel_file() {
    let error = file_error("mass = 80.0", "mass = \"heavy\"");
    assert!(
        matches!(&error, CraftFileError::File(TomlError::Syntax { line, .. }) if *line == line_of("mass = 80.0")),
        "{error}"
    );
    let error = file_error("mass = 80.0 # kg\n", "");
    assert!(error.to_string().contains("mass"), "{error}");
    let error = file_error("mass = 80.0", "mass = ");
    assert!(matches!(error, CraftFileError::File(TomlError::Syntax { .. })), "{error}");
    let error = file_error("mass = 80.0", "mass = -80.0");
    assert!(
        matches!(&error, CraftFileError::Invalid { line: Some(line), .. } if *line == line_of("mass = 80.0")),
        "{error}"
    );
    let error = load("/nowhere/boat.toml").expect_err("no such file");
    assert!(error.to_string().contains("/nowhere/boat.toml"), "{error}");
}

#[test]
fn the_former_form_of_vessel_files_is_refused_with_its_remedy() {
    let text = "name = \"boat\"\n[rigid_body]\nmass = 80.0\n[rudder]\nlaw = \"sine\"\ngain = 70.0\n[propeller]\nlag = 1.0\n";
    let error = parse(text, Path::new("boat.toml")).expect_err("should be refused");
    let message = error.to_string();
    assert!(
        matches!(error, CraftFileError::Former { .. }) && message.starts_with("boat.toml: "),
        "{message}"
    );
    for key in ["[[command]]", "[[thruster]]", "[[rudder]]", "--print-vessel"] {
        assert!(message.contains(key), "{message}");
    }
}

#[test]
fn an_excitation_refuses_other_actuators() {
    let error = refused(|o| o.vessel.thrusters[0].position = [0.0, 0.4]);
    assert!(error.to_string().contains("one thruster on the centreline"), "{error}");
    let error = refused(|o| o.vessel.thrusters[0].speed_loss = 1.0);
    assert!(error.to_string().contains("thruster.propeller has a dead band or a loss"), "{error}");
}

/// A propeller that is commanded in percent, behind the rudder: the motion is that of a command in newtons.
#[test]
fn units_and_order_of_the_commands_do_not_change_the_motion() {
    let newtons = run(&hydrofoil()).unwrap();
    let mut options = hydrofoil();
    let vessel = &mut options.vessel;
    vessel.commands.swap(0, 1);
    (vessel.commands[1].limits, vessel.commands[1].neutral) = ([-130.0 / 3.5 + 7.0, 107.0], 7.0);
    (vessel.thrusters[0].forward, vessel.thrusters[0].reverse) = (7.0, 7.0);
    vessel.thrusters[0].servo.order.terms = vec![(1, 7.0, 0.5)];
    vessel.rudders[0].servo.order.terms = vec![(0, 0.0, 1.0)];
    let percent = run(&options).unwrap();
    for (one, other) in newtons.states().iter().zip(percent.states()) {
        let both = [(one.u, other.u), (one.r, other.r), (0.01 * one.p_f, 0.01 * other.p_f)];
        assert!(both.iter().all(|(a, b)| (a - b).abs() < 1e-9), "{one:?} {other:?}");
    }
    assert_eq!(percent.command_channels()[0].name, "PP_cmd");
}

#[test]
fn the_envelope_is_where_force_and_drag_balance() {
    for params in [Craft::simple(), Craft::hydrofoil(), Craft::hydrofoil_low_speed()] {
        let vessel = PropellerRudder::new(&params).expect("valid");
        let envelope = Envelope::new(&vessel).expect("it has drag");
        let force = params.commands[0].limits[1];
        assert!((vessel.dynamics().holding_force(envelope.top_speed) - force).abs() < 1e-9 * force);
    }
}

prop_compose! {
    /// An arbitrary vessel with an excitation.
    fn any_options()(
        seed: u64,
        scale in 0.1..10.0,
        low in -300.0..-1.0,
        high in 1.0..500.0,
        rudder in 0.05..1.5_f64,
        kind in 0..5,
        dt_s in prop::sample::select(vec![0.05, 0.1, 0.2]),
    ) -> Options {
        let mut vessel = Craft::hydrofoil();
        for row in &mut vessel.hull.linear {
            for entry in row {
                *entry *= scale;
            }
        }
        vessel.commands[0].limits = [low, high];
        vessel.commands[1].limits = [-rudder, 0.7 * rudder];
        let excitation = match kind {
            0 => Excitation::Mixed,
            1 => Excitation::LowSpeed(LowSpeed::default()),
            2 => Excitation::LawnMower(LawnMower::default()),
            3 => Excitation::LawnMower(LawnMower { turn: Turn::Sharp { speed: None }, ..LawnMower::default() }),
            _ => Excitation::Circle(Circle::default()),
        };
        Options { seed, dt_s, duration_s: 120.0, ..Options::new(vessel, excitation) }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn commands_stay_within_their_limits(options in any_options()) {
        let record = run(&options).map_err(|e| TestCaseError::fail(e.to_string()))?;
        let channels = record.command_channels();
        for command in record.commands() {
            for (value, channel) in [command.pp, command.rd].into_iter().zip(channels) {
                prop_assert!((channel.limits[0]..=channel.limits[1]).contains(&value), "{value}");
            }
        }
        if matches!(options.excitation, Excitation::LowSpeed(_)) {
            prop_assert!(record.states().iter().all(|state| state.u < 2.5));
        }
    }

    #[test]
    fn a_composed_signal_stays_within_its_range(
        seed: u64, low in -10.0..5.0, span in 0.0..20.0, forward in 0.0..=1.0, pace_s in 0.2..50.0,
    ) {
        let composer = Composer { low, high: low + span, forward, pace_s };
        let signal = composer.compose(200.0, &mut ChaCha8Rng::seed_from_u64(seed));
        prop_assert!(signal.duration_s() >= 200.0);
        for value in signal.sample(0.1, 2_000) {
            prop_assert!((low - 1e-9..=low + span + 1e-9).contains(&value), "{value}");
        }
    }
}
