//! Backstepping in closed loop on the true plants: Lyapunov function, disturbance estimates, comparison with feedback
//! linearization.

use hydroid_core::actuator::Limits;
use hydroid_core::control::{
    Affine, AffineEquations, AffinePlant, Backstepping, BacksteppingOptions, Controller, Estimate,
    FeedbackLinearization, FeedbackLinearizationOptions, Status,
};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{Path, Reference, Side, SpeedLimits, SpeedProfile, TimedReference};
use hydroid_core::vessel::State;
use proptest::prelude::*;

use crate::controllers::helm::{DT, Moment, Mover, Sea, rms, sail, under_way};
use crate::controllers::written::{Force, equations};

fn law<M: Affine>(model: M, vessel: &Craft, settings: BacksteppingOptions) -> Backstepping<M> {
    Backstepping::new(model, &AffinePlant::limits(vessel), DT, settings).unwrap()
}

fn plant(vessel: &Craft) -> AffinePlant {
    AffinePlant::new(vessel).unwrap()
}

/// A circle of the simple vessel under a wind, with an initial error of half a metre.
fn windy(controller: &mut dyn Controller, vessel: &Craft, wind: [f64; 2], noise: f64) -> Vec<Moment> {
    let path = Path::circle([0.0, 0.0], 10.0, Side::Starboard, 0.0).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(1.5)).unwrap();
    let sea =
        Sea { vessel, path: &path, profile: &profile, duration_s: 300.0, noise, seed: 5, wind, force: false };
    let start = under_way(vessel, &path, &profile, 1.0, 0.5);
    sail(&sea, controller, Mover::Clock(TimedReference::new(&profile)), start, 1.0)
}

const FIXED: BacksteppingOptions = BacksteppingOptions {
    lookahead: 1.0,
    position: 1.0,
    velocity: 1.0,
    weight: 1.0,
    weather: 0.0,
    body: 0.0,
    most: 0.3,
    closing_speed: 1.0,
    min_control_authority: 0.05,
    tolerance: 2.0,
    response: 0.0,
    ahead: false,
};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// `k_p = q + k_1 k_2` and `k_d = k_1 + k_2`.
    #[test]
    fn without_adaptation_the_law_is_feedback_linearization(
        (k_1, k_2, q) in (0.3..2.0f64, 0.3..2.0f64, 0.1..3.0f64),
        (x, y, psi) in (-0.3..0.3f64, -0.3..0.3f64, -0.3..0.3f64), (u, v, r) in (1.0..2.0f64, -0.1..0.1f64, -0.1..0.1f64),
    ) {
        let vessel = Craft::simple();
        let settings = BacksteppingOptions { position: k_1, velocity: k_2, weight: q, closing_speed: 1e3, ..FIXED };
        let same = FeedbackLinearizationOptions {
            proportional: q + k_1 * k_2, derivative: k_1 + k_2, closing_speed: 1e3, ..FeedbackLinearizationOptions::new(1.0)
        };
        let mut other = FeedbackLinearization::new(plant(&vessel), &AffinePlant::limits(&vessel), DT, same).unwrap();
        let estimate = Estimate { eta: [x, y, psi], nu: [u, v, r], current: [0.0; 2], actuators: &[70.0, f64::NAN] };
        let reference = Reference {
            s: 0.0, position: [1.0, 0.0], velocity: [1.5, 0.0], acceleration: [0.02, 0.1], course: 0.0, curvature: 0.0, speed: 1.5,
        };
        let (mut one, mut two) = ([0.0; 2], [0.0; 2]);
        let status = law(plant(&vessel), &vessel, settings).command(&estimate, &reference, &mut one);
        prop_assert_eq!(status, other.command(&estimate, &reference, &mut two));
        for i in 0..2 {
            prop_assert!((one[i] - two[i]).abs() < 1e-9 * (1.0 + two[i].abs()), "{one:?} {two:?}");
        }
    }

    #[test]
    fn commands_keep_their_limits_and_failures_have_a_status(
        seed in 0u64..1000, speed in 0.2..6.0f64, radius in 3.0..40.0f64, tight in 0.05..1.0f64, rate in 0.05..5.0f64,
        (x, y, psi) in (-60.0..60.0f64, -60.0..60.0f64, -4.0..4.0f64), u in -1.0..4.0f64,
    ) {
        let vessel = Craft::hydrofoil();
        let path = Path::circle([0.0, 0.0], radius, Side::Port, 0.0).unwrap();
        let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(speed)).unwrap();
        let limits = [
            Limits::between([-130.0 * tight, 350.0 * tight]).with_rate(200.0 * rate),
            Limits::between([-0.5 * tight, 0.4 * tight]).with_rate(rate),
        ];
        let settings = BacksteppingOptions::new(1.5);
        let mut controller = Backstepping::new(plant(&vessel), &limits, DT, settings).unwrap();
        let sea = Sea {
            vessel: &vessel, path: &path, profile: &profile, duration_s: 40.0, noise: 1.0, seed, wind: [0.05, -0.02], force: false,
        };
        let mut last = [0.0; 2];
        for moment in sail(&sea, &mut controller, Mover::Clock(TimedReference::new(&profile)), State { x, y, psi, u, ..State::REST }, 1.5) {
            for i in 0..2 {
                prop_assert!((limits[i].low..=limits[i].high).contains(&moment.command[i]));
                prop_assert!((moment.command[i] - last[i]).abs() <= limits[i].rate * DT * (1.0 + 1e-9));
            }
            last = moment.command;
            prop_assert!(moment.state.is_finite());
            prop_assert!(moment.error <= settings.tolerance || moment.status >= Status::Lost);
        }
        prop_assert!(controller.weather().iter().chain(&controller.body()).all(|b| b.abs() <= settings.most));
    }
}

/// A wind that is constant north and east turns around the vessel on a circle. It is estimated, and the distance
/// converges to zero; without adaptation it is `a / k_p`.
#[test]
fn wind_on_a_circle_is_compensated() {
    let vessel = Craft::simple();
    let wind = [0.05f64, -0.03];
    let size = wind[0].hypot(wind[1]);
    let without =
        rms(&windy(&mut law(plant(&vessel), &vessel, FIXED), &vessel, wind, 0.0), 150.0, |m| m.error);
    assert!((0.3..0.8).contains(&(without / size)), "k_p = 2: {without} m for {size} m/s^2");
    let mut learning = law(plant(&vessel), &vessel, BacksteppingOptions::new(1.0));
    let with = rms(&windy(&mut learning, &vessel, wind, 0.0), 200.0, |m| m.error);
    assert!(with < 0.02 * without, "{with} beside {without}");
    let [north, east] = learning.weather();
    assert!((north - wind[0]).abs() < 0.005 && (east - wind[1]).abs() < 0.005, "{:?}", learning.weather());
    assert!(learning.body().iter().all(|b| b.abs() < 0.005), "{:?}", learning.body());
}

/// 20 % more mass and drag: a disturbance that is constant in the body frame on a circle.
#[test]
fn model_error_on_a_circle_is_compensated() {
    let vessel = Craft::simple();
    let mut heavy = vessel.clone();
    heavy.hull.mass *= 1.2;
    heavy.hull.i_z *= 1.2;
    heavy.hull.linear[0][0] *= 1.2;
    heavy.hull.linear[2][2] *= 1.2;
    let error = |settings: BacksteppingOptions, from: f64| {
        rms(&windy(&mut law(plant(&vessel), &vessel, settings), &heavy, [0.0; 2], 0.0), from, |m| m.error)
    };
    let (without, with) = (error(FIXED, 150.0), error(BacksteppingOptions::new(1.0), 200.0));
    let weather_alone = error(BacksteppingOptions { body: 0.0, ..BacksteppingOptions::new(1.0) }, 200.0);
    println!(
        "without {without:.4} m, with {with:.6} m, with the part for weather alone {weather_alone:.4} m"
    );
    assert!(without > 0.05 && with < 0.001 && weather_alone > 10.0 * with);
}

/// `dV/dt = -q k_1 |z_1|^2 - k_2 |z_2|^2`, up to the effects of sampling and of the lag of the propeller.
#[test]
fn the_lyapunov_function_falls() {
    let mut vessel = Craft::simple();
    vessel.thrusters[0].servo.lag = 0.01;
    vessel.commands[0].limits = [-1e4, 1e4];
    vessel.commands[1].limits = [-1e3, 1e3];
    let path = Path::circle([0.0, 0.0], 10.0, Side::Starboard, 0.0).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(1.5)).unwrap();
    let sea = Sea {
        vessel: &vessel,
        path: &path,
        profile: &profile,
        duration_s: 20.0,
        noise: 0.0,
        seed: 0,
        wind: [0.0; 2],
        force: false,
    };
    let slow = FIXED.with_rate(0.4);
    let settings = BacksteppingOptions { weather: 0.0, body: 0.0, ..slow };
    let start = under_way(&vessel, &path, &profile, 1.0, 0.8);
    let run = sail(
        &sea,
        &mut law(plant(&vessel), &vessel, settings),
        Mover::Clock(TimedReference::new(&profile)),
        start,
        1.0,
    );
    let mut walker = TimedReference::new(&profile);
    let mut values = Vec::new();
    for moment in &run {
        let (reference, s) = (walker.reference(&path, &profile), moment.state);
        let (sin, cos) = s.psi.sin_cos();
        let z_1 = [s.x + cos - reference.position[0], s.y + sin - reference.position[1]];
        let velocity = [s.u * cos - (s.v + s.r) * sin, s.u * sin + (s.v + s.r) * cos];
        let z_2: Vec<f64> =
            (0..2).map(|i| velocity[i] - reference.velocity[i] + settings.position * z_1[i]).collect();
        let square = |z: &[f64]| z.iter().map(|x| x * x).sum::<f64>();
        values.push((
            0.5 * (settings.weight * square(&z_1) + square(&z_2)),
            settings.weight * settings.position * square(&z_1) + settings.velocity * square(&z_2),
        ));
        walker.advance(&profile, DT);
    }
    for pair in values.windows(2) {
        let (fall, promised) = ((pair[0].0 - pair[1].0) / DT, 0.5 * (pair[0].1 + pair[1].1));
        assert!((fall - promised).abs() < 0.15 * promised + 1e-9, "{fall} for {promised}");
    }
    assert!(values[199].0 < 1e-5 * values[0].0);
}

#[test]
fn the_hydrofoil_tracks_circles_in_all_modes() {
    let vessel = Craft::hydrofoil();
    for (speed, radius, limit) in [(1.5, 15.0, 0.006), (2.5, 25.0, 0.008), (4.0, 30.0, 0.006)] {
        let path = Path::circle([0.0, 0.0], radius, Side::Starboard, 0.0).unwrap();
        let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(speed)).unwrap();
        let model = AffineEquations::new(&equations(&vessel, Force::Hidden), [0, 1, 2]).unwrap();
        let mut controller = law(model, &vessel, BacksteppingOptions::new(1.5));
        let sea = Sea {
            vessel: &vessel,
            path: &path,
            profile: &profile,
            duration_s: 150.0,
            noise: 1.0,
            seed: 3,
            wind: [0.0; 2],
            force: false,
        };
        let start = under_way(&vessel, &path, &profile, 1.5, 0.5);
        let run = sail(&sea, &mut controller, Mover::Clock(TimedReference::new(&profile)), start, 1.5);
        // The two disturbances become observable after half a turn.
        let error = rms(&run, 100.0, |m| m.error);
        println!("{speed} m/s: {error:.4} m");
        assert!(error < limit, "{speed} m/s: {error}");
    }
}

#[test]
fn invalid_tasks_are_refused_and_missing_measurements_hold_the_command() {
    let vessel = Craft::simple();
    let make = |settings| {
        Backstepping::new(plant(&vessel), &AffinePlant::limits(&vessel), DT, settings)
            .map(|_| ())
            .unwrap_err()
    };
    assert_eq!(
        make(BacksteppingOptions { weather: -1.0, ..FIXED }).to_string(),
        "the adaptation gain of the weather is -1: 0 or more is needed"
    );
    assert_eq!(
        make(BacksteppingOptions { position: 0.0, ..FIXED }).to_string(),
        "the gain of the position is 0: a finite number greater than 0 is needed"
    );
    let mut controller = law(plant(&vessel), &vessel, BacksteppingOptions::new(1.0));
    let path = Path::legs(&[[0.0, 0.0], [100.0, 0.0]]).unwrap();
    let reference = Reference::new(1.2, &path.at(1.2), 1.5, 0.0);
    let (mut command, mut held) = ([0.0; 2], [0.0; 2]);
    let seen = |u| Estimate { eta: [0.0; 3], nu: [u, 0.0, 0.01], current: [0.0; 2], actuators: &[] };
    controller.command(&seen(1.4), &reference, &mut command);
    assert_eq!(controller.command(&seen(f64::NAN), &reference, &mut held), Status::Blind);
    assert_eq!(command, held);
}
