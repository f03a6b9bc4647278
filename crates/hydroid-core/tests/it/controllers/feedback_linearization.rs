//! Feedback linearization of a point ahead, in closed loop on the true plants.

use crate::controllers::helm::{DT, Moment, Mover, Sea, rms, sail, under_way};
use crate::controllers::written::{Force, equations};
use hydroid_core::actuator::Limits;
use hydroid_core::control::{
    AdaptiveAugmentation, AdaptiveAugmentationOptions, Affine, AffineEquations, AffinePlant, Backstepping,
    BacksteppingOptions, ControlError, Controller, Estimate, FeedbackLinearization,
    FeedbackLinearizationOptions, Status,
};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{
    Path, PathReference, Reference, Side, SpeedLimits, SpeedProfile, TimedReference,
};
use hydroid_core::vessel::{Command, State};

use crate::plant::Plant;
use proptest::prelude::*;

fn law<M: Affine>(
    model: M,
    vessel: &Craft,
    settings: FeedbackLinearizationOptions,
) -> FeedbackLinearization<M> {
    FeedbackLinearization::new(model, &AffinePlant::limits(vessel), DT, settings).unwrap()
}

fn plant(vessel: &Craft) -> AffinePlant {
    AffinePlant::new(vessel).unwrap()
}

/// A circle, started under way with an error of half a metre.
fn circle(
    vessel: &Craft,
    controller: &mut dyn Controller,
    (ahead, radius, speed): (f64, f64, f64),
    (noise, seed): (f64, u64),
) -> Vec<Moment> {
    let path = Path::circle([0.0, 0.0], radius, Side::Starboard, 0.0).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(speed)).unwrap();
    let sea = Sea {
        vessel,
        path: &path,
        profile: &profile,
        duration_s: 120.0,
        noise,
        seed,
        wind: [0.0; 2],
        force: false,
    };
    let start = under_way(vessel, &path, &profile, ahead, 0.5);
    sail(&sea, controller, Mover::Clock(TimedReference::new(&profile)), start, ahead)
}

fn median(mut values: [f64; 3]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[1]
}

/// Independent implementation, with `k_p = 1`, `k_d = 2`: 0 with clean and 0.0042 m with noisy velocities.
#[test]
fn the_simple_vessel_tracks_its_circle_as_an_independent_implementation_does() {
    let vessel = Craft::simple();
    let task = (1.0, 10.0, 1.5);
    let error = |settings, noise, seed| {
        let run = circle(&vessel, &mut law(plant(&vessel), &vessel, settings), task, (noise, seed));
        assert!(run.iter().all(|m| m.t < 5.0 || noise > 0.0 || m.status == Status::Tracking));
        rms(&run, 40.0, |m| m.error)
    };
    let reference = FeedbackLinearizationOptions::new(1.0).with_bandwidth(1.0, 1.0);
    assert!(error(reference, 0.0, 1) < 1e-6);
    let noisy = median([1, 2, 3].map(|seed| error(reference, 1.0, seed)));
    assert!((noisy - 0.0042).abs() < 0.0004, "{noisy}");
    let ours = FeedbackLinearizationOptions::new(1.0);
    assert!(error(ours, 0.0, 1) < 1e-9);
    let noisy = median([1, 2, 3].map(|seed| error(ours, 1.0, seed)));
    assert!(noisy < 0.0036, "{noisy}");
}

/// Displacement mode, take-off and foiling, with the model as equations.
#[test]
fn the_hydrofoil_tracks_circles_in_all_modes() {
    let vessel = Craft::hydrofoil();
    for (speed, radius, limit) in [(1.5, 15.0, 0.0045), (2.5, 25.0, 0.007), (4.0, 30.0, 0.0045)] {
        let model = AffineEquations::new(&equations(&vessel, Force::Hidden), [0, 1, 2]).unwrap();
        let mut controller = law(model, &vessel, FeedbackLinearizationOptions::new(1.5));
        let error = |controller: &mut dyn Controller, noise, seed| {
            controller.reset();
            rms(&circle(&vessel, controller, (1.5, radius, speed), (noise, seed)), 40.0, |m| m.error)
        };
        assert!(error(&mut controller, 0.0, 1) < 1e-6);
        let noisy = median([1, 2, 3].map(|seed| error(&mut controller, 1.0, seed)));
        println!("{speed} m/s: {noisy:.4} m");
        assert!(noisy < limit, "{speed} m/s: {noisy}");
    }
}

/// The documented limit of the bandwidth: during take-off, 3 rad/s are too much for samples of 0.1 s.
#[test]
fn too_high_a_bandwidth_diverges_at_take_off() {
    let vessel = Craft::hydrofoil();
    let error = |omega| {
        let settings = FeedbackLinearizationOptions::new(1.5).with_bandwidth(omega, 0.7);
        let run = circle(&vessel, &mut law(plant(&vessel), &vessel, settings), (1.5, 25.0, 2.5), (0.0, 1));
        rms(&run, 40.0, |m| m.error)
    };
    assert!(error(2.2) < 1e-4 && error(3.0) > 0.1, "{} and {}", error(2.2), error(3.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Without error the point accelerates like its reference, by differences along the equations of the plant.
    #[test]
    fn the_point_accelerates_as_its_reference(
        (u, v, r, psi) in (0.8..3.5f64, -0.3..0.3f64, -0.3..0.3f64, -4.0..4.0f64),
        (north, east) in (-0.15..0.15f64, -0.15..0.15f64), ahead in 0.6..2.0f64, foil in any::<bool>(),
    ) {
        let mut vessel = if foil { Craft::hydrofoil() } else { Craft::simple() };
        // The force follows the command immediately.
        vessel.thrusters[0].servo.lag = 1e-3;
        vessel.commands[0].limits = [-3e3, 3e3];
        let point = |s: &State| [s.x + ahead * s.psi.cos(), s.y + ahead * s.psi.sin()];
        let velocity = |s: &State| {
            let (sin, cos) = s.psi.sin_cos();
            let side = s.v + ahead * s.r;
            [s.u * cos - side * sin, s.u * sin + side * cos]
        };
        let state = State { x: 3.0, y: -7.0, psi, u, v, r, p_f: 0.0 };
        let reference = Reference {
            s: 0.0, position: point(&state), velocity: velocity(&state), acceleration: [north, east], course: 0.0, curvature: 0.0, speed: 1.0,
        };
        let estimate = Estimate { eta: [state.x, state.y, psi], nu: [u, v, r], current: [0.0; 2], actuators: &[] };
        let mut command = [0.0; 2];
        let status = law(plant(&vessel), &vessel, FeedbackLinearizationOptions::new(ahead)).command(&estimate, &reference, &mut command);
        prop_assume!(status == Status::Tracking);
        let (h, sea) = (1e-6, Plant::new(&vessel));
        let held = Command { pp: command[0], rd: command[1] };
        let pushed = State { p_f: command[0], ..state };
        let (before, after) = (sea.advance(&pushed, &held, -h), sea.advance(&pushed, &held, h));
        for (i, wanted) in [north, east].into_iter().enumerate() {
            let moved = (point(&after)[i] - point(&before)[i]) / (2.0 * h);
            prop_assert!((moved - velocity(&state)[i]).abs() < 1e-6);
            let acceleration = (velocity(&after)[i] - velocity(&before)[i]) / (2.0 * h);
            prop_assert!((acceleration - wanted).abs() < 1e-5, "{acceleration} for {wanted}");
        }
    }

    #[test]
    fn commands_keep_their_limits_and_failures_have_a_status(
        seed in 0u64..1000, speed in 0.2..6.0f64, radius in 3.0..40.0f64, tight in 0.05..1.0f64, rate in 0.05..5.0f64,
        (x, y, psi) in (-60.0..60.0f64, -60.0..60.0f64, -4.0..4.0f64), u in -1.0..4.0f64, integral in 0.0..0.5f64,
    ) {
        let vessel = Craft::hydrofoil();
        let path = Path::circle([0.0, 0.0], radius, Side::Port, 0.0).unwrap();
        let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(speed)).unwrap();
        let limits = [
            Limits::between([-130.0 * tight, 350.0 * tight]).with_rate(200.0 * rate),
            Limits::between([-0.5 * tight, 0.4 * tight]).with_rate(rate),
        ];
        let settings = FeedbackLinearizationOptions { integral, ..FeedbackLinearizationOptions::new(1.5) };
        let mut controller = FeedbackLinearization::new(plant(&vessel), &limits, DT, settings).unwrap();
        let sea = Sea { vessel: &vessel, path: &path, profile: &profile, duration_s: 40.0, noise: 1.0, seed, wind: [0.05, -0.02], force: false };
        let start = State { x, y, psi, u, ..State::REST };
        let mut last = [0.0; 2];
        for moment in sail(&sea, &mut controller, Mover::Clock(TimedReference::new(&profile)), start, 1.5) {
            for i in 0..2 {
                prop_assert!((limits[i].low..=limits[i].high).contains(&moment.command[i]));
                prop_assert!((moment.command[i] - last[i]).abs() <= limits[i].rate * DT * (1.0 + 1e-9));
            }
            last = moment.command;
            prop_assert!(moment.state.is_finite());
            prop_assert!(moment.error <= settings.tolerance || moment.status >= Status::Lost);
        }
    }
}

#[test]
fn a_lawn_mower_from_rest_is_tracked() {
    let vessel = Craft::hydrofoil();
    let path = Path::lawn_mower([0.0, 0.0], 0.5, 80.0, 40.0, 3, 18.0, Side::Port).unwrap();
    let limits = SpeedLimits {
        lateral_acceleration: 0.25,
        start: 0.0,
        acceleration: 0.15,
        deceleration: 0.15,
        ..SpeedLimits::cruise(4.0)
    };
    let profile = SpeedProfile::new(&path, &limits).unwrap();
    let settings = FeedbackLinearizationOptions::new(1.5);
    let start = State { psi: 0.5, x: -1.5 * 0.5f64.cos(), y: -1.5 * 0.5f64.sin(), ..State::REST };
    let sea = Sea {
        vessel: &vessel,
        path: &path,
        profile: &profile,
        duration_s: profile.duration(),
        noise: 1.0,
        seed: 4,
        wind: [0.0; 2],
        force: false,
    };
    let run = sail(
        &sea,
        &mut law(plant(&vessel), &vessel, settings),
        Mover::Clock(TimedReference::new(&profile)),
        start,
        1.5,
    );
    assert_eq!(run[0].status, Status::Singular, "at rest the rudder has no force");
    let singular = run.iter().filter(|m| m.status == Status::Singular).map(|m| m.state.u).fold(0.0, f64::max);
    assert!(singular < 0.1, "singular at {singular} m/s");
    let top = run.iter().map(|m| m.state.u).fold(0.0, f64::max);
    assert!(top > 3.5, "through both modes: {top} m/s");
    // The yaw is delayed at jumps of the curvature.
    let worst = run.iter().map(|m| m.error).fold(0.0, f64::max);
    let usual = rms(&run, 5.0, |m| m.error);
    println!("worst {worst:.3} m, root mean square {usual:.4} m");
    assert!(worst < 0.5 && usual < 0.1);
}

/// Without time: the reference is the projection of the point onto the path.
#[test]
fn a_path_is_followed_at_the_speeds_that_its_turns_allow() {
    let vessel = Craft::simple();
    let points = [[0.0, 0.0], [60.0, 0.0], [60.0, 50.0], [10.0, 70.0], [-30.0, 20.0]];
    let path = Path::waypoints(&points, 10.0).unwrap();
    let limits = SpeedLimits { yaw_rate: 0.1, ..SpeedLimits::cruise(1.8) };
    let profile = SpeedProfile::new(&path, &limits).unwrap();
    let sea = Sea {
        vessel: &vessel,
        path: &path,
        profile: &profile,
        duration_s: 150.0,
        noise: 1.0,
        seed: 11,
        wind: [0.0; 2],
        force: true,
    };
    let start = under_way(&vessel, &path, &profile, 1.0, 3.0);
    let mover = Mover::Vessel(PathReference::new(0.0, 5.0));
    let run = sail(
        &sea,
        &mut law(plant(&vessel), &vessel, FeedbackLinearizationOptions::new(1.0)),
        mover,
        start,
        1.0,
    );
    let cross_track = rms(&run, 10.0, |m| m.cross_track);
    let speed = rms(&run, 10.0, |m| m.state.u.hypot(m.state.v + m.state.r) - m.speed);
    println!("cross-track {cross_track:.3} m, speed {speed:.3} m/s");
    assert!(cross_track < 0.05 && speed < 0.05);
    let slow = run.iter().filter(|m| m.t > 10.0).map(|m| m.speed).fold(f64::INFINITY, f64::min);
    assert!((slow - 1.0).abs() < 0.05, "{slow} m/s in the turns");
}

/// A constant disturbance causes an error of `a / k_p`, and none with the integral.
#[test]
fn the_integral_rejects_the_wind() {
    let vessel = Craft::simple();
    let path = Path::legs(&[[0.0, 0.0], [500.0, 0.0]]).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(1.5)).unwrap();
    let sea = Sea {
        vessel: &vessel,
        path: &path,
        profile: &profile,
        duration_s: 200.0,
        noise: 0.0,
        seed: 0,
        wind: [-0.06, 0.05],
        force: false,
    };
    let end = |integral: f64| {
        let settings = FeedbackLinearizationOptions { integral, ..FeedbackLinearizationOptions::new(1.0) };
        let start = under_way(&vessel, &path, &profile, 1.0, 0.0);
        let run = sail(
            &sea,
            &mut law(plant(&vessel), &vessel, settings),
            Mover::Clock(TimedReference::new(&profile)),
            start,
            1.0,
        );
        (rms(&run, 150.0, |m| m.error), settings.proportional)
    };
    let (without, proportional) = end(0.0);
    let expected = 0.06f64.hypot(0.05) / proportional;
    assert!((without - expected).abs() < 0.02 * expected, "{without} for {expected}");
    let (with, _) = end(0.3);
    assert!(with < 1e-4, "{with}");
}

/// A workboat whose reference waited behind it reversed its engine within a sample, and sailed astern.
#[test]
fn a_reference_behind_the_vessel_brakes_it_and_does_not_drive_it_astern() {
    let vessel = Craft::simple();
    let path = Path::legs(&[[0.0, 0.0], [100.0, 0.0]]).unwrap();
    let behind = Reference::new(0.0, &path.at(0.0), 0.0, 0.0);
    let speeds = |ahead: bool| {
        let settings = FeedbackLinearizationOptions { ahead, ..FeedbackLinearizationOptions::new(1.0) };
        let mut controller = law(plant(&vessel), &vessel, settings);
        let sea = Plant::new(&vessel);
        let mut state = State { x: 20.0, u: 1.5, ..State::default() };
        let mut speeds = Vec::new();
        for _ in 0..600 {
            let estimate = Estimate {
                eta: [state.x, state.y, state.psi],
                nu: [state.u, state.v, state.r],
                current: [0.0; 2],
                actuators: &[],
            };
            let mut command = [0.0; 2];
            controller.command(&estimate, &behind, &mut command);
            let held = Command { pp: command[0], rd: command[1] };
            (0..10).for_each(|_| state = sea.advance(&state, &held, 0.1 * DT));
            speeds.push(state.u);
        }
        speeds
    };
    let (driven, free) = (speeds(true), speeds(false));
    assert!(driven.iter().all(|u| *u > -0.02), "{:?}", driven.iter().copied().fold(0.0, f64::min));
    assert!(driven[599].abs() < 0.1, "it stops: {}", driven[599]);
    assert!(free.iter().any(|u| *u < -0.3));
}

#[test]
fn saturation_causes_no_windup() {
    let vessel = Craft::simple();
    let path = Path::legs(&[[0.0, 0.0], [2_000.0, 0.0]]).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(2.0)).unwrap();
    let settings = FeedbackLinearizationOptions { integral: 0.3, ..FeedbackLinearizationOptions::new(1.0) };
    let mut controller = law(plant(&vessel), &vessel, settings);
    // Two minutes of a reference 30 m ahead, then one at the vessel.
    let mut command = [0.0; 2];
    let estimate = Estimate { eta: [0.0; 3], nu: [1.5, 0.0, 0.0], current: [0.0; 2], actuators: &[] };
    let pose = path.at(30.0);
    let far = Reference::new(30.0, &pose, profile.at(0.0).0, 0.0);
    for _ in 0..1_200 {
        assert_eq!(controller.command(&estimate, &far, &mut command), Status::Lost);
        assert!((command[0] - 240.0).abs() < 1e-9);
    }
    let here = Reference::new(1.0, &path.at(1.0), 1.5, 0.0);
    let mut after = 0;
    while after < 100 && controller.command(&estimate, &here, &mut command) != Status::Tracking {
        after += 1;
    }
    assert!(after < 20, "{after} samples at the limit");
}

/// In a known current, the vessel moves as in still water, seen from a frame that drifts with the water.
#[test]
fn a_current_moves_vessel_and_reference_alike() {
    let vessel = Craft::hydrofoil();
    let laws = || -> [Box<dyn Controller>; 3] {
        let base = || law(plant(&vessel), &vessel, FeedbackLinearizationOptions::new(1.5));
        let learned = AdaptiveAugmentation::new(base(), AdaptiveAugmentationOptions::default(), 1).unwrap();
        let limits = AffinePlant::limits(&vessel);
        let options = BacksteppingOptions::new(1.5);
        let backstepping = Backstepping::new(plant(&vessel), &limits, DT, options).unwrap();
        [Box::new(base()), Box::new(backstepping), Box::new(learned)]
    };
    let current = [0.3, -0.4];
    let path = Path::circle([0.0, 0.0], 20.0, Side::Starboard, 0.0).unwrap();
    for (mut still, mut drifting) in laws().into_iter().zip(laws()) {
        let [mut a, mut b] = [[0.0; 2]; 2];
        for k in 0..20 {
            let s = 0.15 * f64::from(k);
            let at = Reference::new(s, &path.at(s), 1.5, 0.0);
            let psi = 0.4 + 0.05 * f64::from(k);
            let eta = [at.position[0] - 0.2, at.position[1] + 0.1, psi];
            let estimate = Estimate { eta, nu: [1.4, 0.05, 0.1], current: [0.0; 2], actuators: &[] };
            let velocity = [0, 1].map(|i| at.velocity[i] + current[i]);
            let [surge, sway] = hydroid_core::current::in_body(current, psi);
            let nu = [estimate.nu[0] + surge, estimate.nu[1] + sway, estimate.nu[2]];
            still.command(&estimate, &at, &mut a);
            let moved = Estimate { nu, current, ..estimate };
            drifting.command(&moved, &Reference { velocity, ..at }, &mut b);
            assert!((a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-9, "sample {k}: {a:?} {b:?}");
        }
    }
}

#[test]
fn measurements_that_are_not_finite_hold_the_last_command() {
    let vessel = Craft::simple();
    let mut controller = law(plant(&vessel), &vessel, FeedbackLinearizationOptions::new(1.0));
    let path = Path::legs(&[[0.0, 0.0], [100.0, 0.0]]).unwrap();
    let reference = Reference::new(1.2, &path.at(1.2), 1.5, 0.0);
    let seen = |nu| Estimate { eta: [0.0; 3], nu, current: [0.0; 2], actuators: &[f64::NAN, f64::NAN] };
    let (mut command, mut held) = ([0.0; 2], [0.0; 2]);
    controller.command(&seen([1.4, 0.0, 0.01]), &reference, &mut command);
    assert_eq!(controller.command(&seen([f64::NAN, 0.0, 0.0]), &reference, &mut held), Status::Blind);
    assert_eq!(command, held);
    let nowhere = Reference { position: [f64::INFINITY, 0.0], ..reference };
    assert_eq!(controller.command(&seen([1.4, 0.0, 0.01]), &nowhere, &mut held), Status::Blind);
    assert_eq!(command, held);
}

#[test]
fn invalid_options_are_refused() {
    let vessel = Craft::simple();
    let limits = AffinePlant::limits(&vessel);
    let make = |settings| {
        FeedbackLinearization::new(plant(&vessel), &limits, DT, settings).map(|_| ()).unwrap_err().to_string()
    };
    let good = FeedbackLinearizationOptions::new(1.0);
    assert_eq!(
        make(FeedbackLinearizationOptions { lookahead: 0.0, ..good }),
        "the lookahead distance is 0: a finite number greater than 0 is needed"
    );
    assert_eq!(
        make(FeedbackLinearizationOptions { integral: 99.0, ..good }),
        "the integral gain is 99: less than the product of the other two is needed for stability"
    );
    assert!(make(good.with_bandwidth(f64::NAN, 0.7)).starts_with("the proportional gain is NaN"));
    let one = FeedbackLinearization::new(plant(&vessel), &limits[..1], DT, good).unwrap_err();
    assert_eq!(one, ControlError::Count { expected: 2, given: 1 });
}
