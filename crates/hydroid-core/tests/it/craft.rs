//! Vessels with any set of actuators.

use hydroid_core::control::{Affine, AffinePlant, Motion};
use hydroid_core::craft::{
    CommandInput, Coriolis, Craft, Dynamics, Flying, Hull, InvalidCraft, NormalForce, Order, Rudder,
    RudderLaw, Servo, ThrustLaw, Thruster,
};
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::{Predictor, Workspace};
use hydroid_core::vessel::Dual;
use proptest::prelude::*;

fn servo(command: usize, lag: f64, rate: Option<f64>) -> Servo {
    let limits = [f64::NEG_INFINITY, f64::INFINITY];
    Servo { order: Order { terms: vec![(command, 0.0, 1.0)], limits }, lag, rate }
}

/// A boat with a steerable thruster, a fixed one, and a rudder in the race of the latter.
pub(crate) fn craft() -> Craft {
    let command =
        |name: &str, limits| CommandInput { name: name.into(), unit: String::new(), limits, neutral: 0.0 };
    let thruster = |name: &str, x, y, command| Thruster {
        name: name.into(),
        position: [x, y],
        angle: 0.1,
        servo: servo(command, 0.3, Some(40.0)),
        dead_band: 1.0,
        law: ThrustLaw::Quadratic,
        forward: 0.5,
        reverse: 0.3,
        speed_loss: 0.2,
        diameter: Some(0.3),
        steering: None,
        force_noise: None,
    };
    let mut azimuth = thruster("azimuth", -0.9, 0.2, 0);
    azimuth.steering = Some(servo(2, 0.2, Some(0.5)));
    Craft {
        name: "boat".into(),
        water_density: 1000.0,
        hull: Hull {
            size: Some([2.0, 1.0, 0.2]),
            mass: 80.0,
            x_g: 0.1,
            i_z: 16.0,
            x_udot: -5.0,
            y_vdot: -80.0,
            y_rdot: -3.0,
            n_rdot: -25.0,
            linear: [[70.0, 1.0, 2.0], [3.0, 160.0, 4.0], [5.0, 6.0, 40.0]],
            quadratic: [[10.0, 0.5, 0.5], [0.5, 20.0, 0.5], [0.5, 0.5, 100.0]],
            lift: [[30.0, 5.0], [6.0, 7.0]],
            cross_flow: 0.8,
            coriolis: Coriolis::Full,
        },
        flying: None,
        commands: vec![
            command("n_1", [-15.0, 20.0]),
            command("n_2", [-15.0, 20.0]),
            command("azimuth", [-1.0, 1.0]),
            command("rudder", [-0.6, 0.6]),
        ],
        thrusters: vec![azimuth, thruster("fixed", -0.9, -0.2, 1)],
        rudders: vec![Rudder {
            name: "rudder".into(),
            servo: servo(3, 0.0, Some(0.3)),
            law: RudderLaw::Normal(NormalForce {
                position: [-1.0, -0.2],
                area: 0.05,
                lift_slope: 2.5,
                wake: 0.1,
                straightening: 0.6,
                drag_deduction: 0.2,
                hull_force: 0.3,
                hull_position: -0.8,
                thruster: Some(1),
                race: 0.5,
            }),
        }],
        noise: [0.01, 0.01, 0.01],
    }
}

proptest! {
    #[test]
    fn a_servo_follows_its_differential_equation(
        lag in 0.0..3.0f64, rate in prop::option::of(0.05..3.0f64), from in -2.0..2.0f64, order in -2.0..2.0f64, h in 0.0..5.0f64,
    ) {
        // Below a hundredth of a second the plain integration is too coarse.
        let lag = if lag < 0.05 { 0.0 } else { lag };
        prop_assume!(lag > 0.0 || rate.is_some());
        let servo = servo(0, lag, rate);
        let exact = servo.step(from, order, h, servo.decay(h));
        let (mut a, steps) = (from, 200_000);
        let dt = h / f64::from(steps);
        for _ in 0..steps {
            let error: f64 = order - a;
            let wanted = if lag > 0.0 { error / lag } else { f64::INFINITY * error };
            let most = rate.unwrap_or(f64::INFINITY);
            let change = if error == 0.0 { 0.0 } else { wanted.clamp(-most, most) * dt };
            a += if lag > 0.0 { change } else { change.clamp(-error.abs(), error.abs()) };
        }
        prop_assert!((exact - a).abs() < 2e-4, "{exact} {a}");
    }

    #[test]
    fn the_cross_flow_drag_is_its_integral(v in -2.0..2.0f64, r in -2.0..2.0f64) {
        let mut craft = craft();
        craft.hull = Hull { linear: [[0.0; 3]; 3], quadratic: [[0.0; 3]; 3], lift: [[0.0; 2]; 2], ..craft.hull };
        let [x, y, n] = Dynamics::new(&craft).damping([1.0, v, r]);
        let (mut force, mut moment, strips) = (0.0, 0.0, 20_000);
        for k in 0..strips {
            let at = -1.0 + 2.0 * (f64::from(k) + 0.5) / f64::from(strips);
            let w = v + at * r;
            let part = 0.5 * 1000.0 * 0.2 * 0.8 * w.abs() * w * 2.0 / f64::from(strips);
            force += part;
            moment += at * part;
        }
        prop_assert_eq!(x, 0.0);
        prop_assert!((y - force).abs() < 1e-5 && (n - moment).abs() < 1e-5, "{y} {force} {n} {moment}");
    }

    #[test]
    fn dual_numbers_give_the_derivatives(
        u in -2.0..3.0f64, v in -1.0..1.0f64, r in -1.0..1.0f64, n in prop::array::uniform2(-14.0..18.0f64),
        angles in prop::array::uniform2(-0.5..0.5f64), lane in 0usize..60,
    ) {
        let craft = craft();
        let numbers: Vec<f64> = craft.parameters().iter().map(|(_, number)| *number).collect();
        let lane = lane % numbers.len();
        // Away from the kinks of the equations.
        prop_assume!(n.iter().all(|n| (n.abs() - 1.0).abs() > 1e-3) && u.abs() > 1e-3 && v.abs() > 1e-3 && r.abs() > 1e-3);
        let moved = |by: f64| {
            let mut numbers = numbers.clone();
            numbers[lane] += by;
            let plant: Craft = craft.with_numbers(&numbers);
            let (mut nu, mut positions) = ([u, v, r], [n[0], angles[0], n[1], angles[1]]);
            Dynamics::new(&plant).advance(&mut nu, &mut positions, &[12.0, 9.0, 0.4, -0.3], 0.02, 5);
            nu
        };
        let size = 1e-6 * numbers[lane].abs().max(1e-2);
        let (low, high) = (moved(-size), moved(size));
        let seeded: Vec<Dual<1>> =
            numbers.iter().enumerate().map(|(i, x)| Dual::along(*x, usize::from(i != lane), 1.0)).collect();
        let dynamics: Dynamics<Dual<1>> = Dynamics::new(&craft.with_numbers(&seeded));
        let constant = |x: f64| Dual::along(x, 1, 0.0);
        let mut nu = [u, v, r].map(constant);
        let mut positions = [n[0], angles[0], n[1], angles[1]].map(constant);
        dynamics.advance(&mut nu, &mut positions, &[12.0, 9.0, 0.4, -0.3], 0.02, 5);
        for i in 0..3 {
            let difference = (high[i] - low[i]) / (2.0 * size);
            let scale = 1e-3 * difference.abs() + 1e-6 / size.max(1e-6) * 1e-6;
            prop_assert!((nu[i].partials[0] - difference).abs() < scale.max(1e-7), "{lane} {i}: {} {difference}", nu[i].partials[0]);
        }
    }
}

/// Two thrusters ahead: the thrust balances the damping, `2 k n^2 = d u`.
#[test]
fn steady_speed_and_turn_are_analytic() {
    let mut craft = craft();
    craft.hull = Hull {
        x_g: 0.0,
        y_rdot: 0.0,
        linear: [[70.0, 0.0, 0.0], [0.0, 160.0, 0.0], [0.0, 0.0, 40.0]],
        quadratic: [[0.0; 3]; 3],
        lift: [[0.0; 2]; 2],
        cross_flow: 0.0,
        ..craft.hull
    };
    craft.rudders.clear();
    craft.commands.truncate(2);
    for (thruster, y) in craft.thrusters.iter_mut().zip([0.4, -0.4]) {
        *thruster = Thruster {
            position: [-0.9, y],
            angle: 0.0,
            dead_band: 0.0,
            speed_loss: 0.0,
            steering: None,
            ..thruster.clone()
        };
    }
    let settle = |commands: [f64; 2]| {
        let dynamics = Dynamics::new(&craft);
        let (mut nu, mut positions) = ([0.0; 3], [0.0; 2]);
        dynamics.advance(&mut nu, &mut positions, &commands, 0.01, 20_000);
        nu
    };
    let [u, v, r] = settle([14.0, 14.0]);
    assert!((u - 2.0 * 0.5 * 14.0 * 14.0 / 70.0).abs() < 1e-9 && v.abs() < 1e-12 && r.abs() < 1e-12);
    // A thrust to the left of the middle turns to starboard: the thrust of the second thruster acts at y = -0.4.
    let [_, _, r] = settle([0.0, 2.0]);
    assert!(r > 0.0);
}

#[test]
fn a_session_waits_restores_and_agrees_with_its_rollout() {
    let model = CraftModel::new(craft(), 0.1).unwrap();
    assert!(model.steps() >= 1);
    let mut session = CraftSession::new(&model);
    let c = [10.0, 8.0, 0.2, 0.1];
    session.advance(&c);
    let mut y = [0.0; 3];
    session.output(&mut y);
    assert!(y.iter().all(|y| y.is_nan()));
    session.observe(&[1.0, 0.0, 0.0]);
    let mut saved = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut saved);
    let mut rolled = [0.0; 3 * 20];
    session.rollout(&c.repeat(20), &mut Workspace::new(), &mut rolled);
    for k in 0..20 {
        session.advance(&c);
        session.output(&mut y);
        assert_eq!(y, rolled[3 * k..][..3]);
    }
    session.restore(&saved);
    session.advance(&c);
    session.output(&mut y);
    assert_eq!(y, rolled[..3]);
    // A missing command gives no prediction, also where the order has limits.
    let mut limited = craft();
    limited.thrusters[1].servo.order.limits = [-15.0, 20.0];
    let mut unknown = CraftSession::new(&CraftModel::new(limited, 0.1).unwrap());
    unknown.observe(&[1.0, 0.0, 0.0]);
    unknown.rollout(&[10.0, f64::NAN, 0.2, 0.1], &mut Workspace::new(), &mut y);
    assert!(y.iter().any(|y| !y.is_finite()), "{y:?}");
    session.advance(&[f64::NAN; 4]);
    session.output(&mut y);
    assert!(y.iter().all(|y| y.is_nan()));
}

#[test]
fn twice_as_many_steps_change_little() {
    for dt in [0.02, 0.1, 0.5] {
        let model = CraftModel::new(craft(), dt).unwrap();
        let run = |factor: usize| {
            let (mut nu, mut positions) = ([0.0; 3], [0.0; 4]);
            for k in 0..200 {
                let c = if k % 40 < 20 { [20.0, 12.0, 0.8, 0.5] } else { [15.0, 20.0, -0.9, -0.4] };
                let steps = factor * model.steps();
                model.dynamics().advance(&mut nu, &mut positions, &c, dt / steps as f64, steps);
            }
            nu
        };
        let (coarse, fine) = (run(1), run(8));
        for i in 0..3 {
            let [low, high] = model.ranges()[i];
            assert!((coarse[i] - fine[i]).abs() < 1e-4 * (high - low), "{dt}: {coarse:?} {fine:?}");
        }
    }
}

#[test]
fn invalid_vessels_are_named() {
    type Change = fn(&mut Craft);
    let cases: [(Change, &str); 12] = [
        (|c| c.hull.mass = -1.0, "rigid_body.mass is -1; it must be greater than 0"),
        (|c| c.hull.x_udot = 4.0, "added_mass.x_udot is 4; as a hydrodynamic derivative"),
        (|c| c.hull.i_z = 0.5, "it must exceed mass * x_g^2"),
        (|c| c.hull.y_rdot = 900.0, "not positive definite"),
        (|c| c.hull.size = None, "drag.cross_flow needs hull.length"),
        (
            |c| c.thrusters[1].position = [3.0, 0.0],
            "thruster.fixed.position is at (3, 0) m, outside the hull",
        ),
        (|c| c.thrusters[1].forward = f64::NAN, "thruster.fixed.forward is NaN; a finite number"),
        (|c| c.thrusters[1].diameter = None, "which has no diameter"),
        (|c| c.thrusters[1].name = "azimuth".into(), "two thrusters have the name 'azimuth'"),
        (|c| c.commands[3].limits = [-35.0, 35.0], "reaches 35 rad, more than half a turn"),
        (|c| c.commands[0].limits = [5.0, 5.0], "the lower limit must be below the upper one"),
        (|c| c.rudders.clear(), "the command 'rudder' moves no actuator"),
    ];
    for (change, words) in cases {
        let mut craft = craft();
        change(&mut craft);
        let error = craft.validate().unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let mut many = craft();
    let more = many.thrusters[1].clone();
    many.thrusters.extend((0..16).map(|k| Thruster { name: format!("{k}"), ..more.clone() }));
    assert_eq!(many.validate(), Err(InvalidCraft::Servos { given: 20 }));
}

#[test]
fn numbers_are_set_in_place_in_the_order_of_the_parameters() {
    for mut craft in [craft(), Craft::hydrofoil(), Craft::simple()] {
        let numbers: Vec<f64> = (0..craft.parameters().len()).map(|k| 1.0 + k as f64).collect();
        let mapped: Craft = craft.with_numbers(&numbers);
        let mut dynamics = Dynamics::new(&craft);
        craft.set_numbers(&numbers);
        assert_eq!(craft, mapped);
        dynamics.set(&craft);
        assert_eq!(dynamics, Dynamics::new(&mapped));
    }
}

#[test]
fn mass_matrices_are_those_of_the_reference() {
    let hull = Craft::hydrofoil().hull;
    for (added, expected) in [(1.0, [85.5, 162.5, 11.0, 41.4455]), (0.5, [82.75, 121.25, 11.0, 28.874])] {
        for (ours, theirs) in hull.mass_matrix_with(added).iter().zip(expected) {
            assert!((ours - theirs).abs() < 1e-12, "{ours} and {theirs}");
        }
    }
}

#[test]
fn invalid_numbers_of_a_hydrofoil_are_named() {
    type Change = fn(&mut Craft);
    let cases: [(Change, &str); 9] = [
        (|c| c.rudders[0].law = RudderLaw::Sine(0.0), "rudder.rudder.gain is 0; it must be greater than 0"),
        (|c| c.thrusters[0].servo.lag = -1.0, "thruster.propeller.lag is -1; it must not be negative"),
        (|c| c.thrusters[0].force_noise = Some(-1.0), "thruster.propeller.force_noise is -1"),
        (|c| flying(c).transition_speed = 0.0, "flying.transition_speed is 0; it must be greater than 0"),
        (|c| flying(c).slope = f64::NAN, "flying.slope is NaN; a finite number is needed"),
        (|c| flying(c).drag_factor = -1.0, "flying.drag_factor is -1; it must not be negative"),
        (|c| c.noise[0] = -1.0, "noise.u is -1; it must not be negative"),
        (|c| c.commands[1].limits = [-30.0, 30.0], "reaches 30 rad, more than half a turn"),
        (
            |c| {
                // The normal mode is valid, the flying mode with three times the added mass is not.
                (c.hull.y_rdot, c.hull.n_rdot) = (-60.0, -25.0);
                flying(c).added_mass_factor = 3.0;
            },
            "the mass matrix of the flying mode is not positive definite",
        ),
    ];
    for (change, words) in cases {
        let mut craft = Craft::hydrofoil();
        assert_eq!(craft.validate(), Ok(()));
        change(&mut craft);
        let error = craft.validate().unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

fn flying(craft: &mut Craft) -> &mut Flying {
    craft.flying.as_mut().expect("the hydrofoil flies")
}

#[test]
fn a_control_law_refuses_commands_without_an_inverse() {
    type Change = fn(&mut Craft);
    let cases: [(Change, &str); 8] = [
        (|c| c.hull.mass = -1.0, "rigid_body.mass is -1"),
        (
            |c| c.rudders[0].servo.order.terms = vec![(0, 0.0, 0.001), (1, 0.0, 1.0)],
            "'PP_cmd' moves 2 actuators",
        ),
        (|c| c.thrusters[0].law = ThrustLaw::Quadratic, "thruster.propeller has the quadratic law"),
        (|c| c.thrusters[0].reverse = 0.5, "thruster.propeller has another thrust ahead than astern"),
        (|c| c.thrusters[0].dead_band = 1.0, "thruster.propeller has a dead band"),
        (|c| c.thrusters[0].servo.rate = Some(5.0), "thruster.propeller has a limit of its rate"),
        (|c| c.rudders[0].servo.order.limits = [-0.1, 0.1], "rudder.rudder has limits of its order"),
        (|c| c.rudders[0].servo.order.terms[0].2 = 0.5, "rudder.rudder has an angle that is not the command"),
    ];
    for (change, words) in cases {
        let mut craft = Craft::hydrofoil();
        assert!(craft.channels().is_ok());
        change(&mut craft);
        let error = craft.channels().unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let error = craft().channels().unwrap_err().to_string();
    assert!(error.contains("has a limit of its rate"), "{error}");
}

/// Twin thrusters and a rudder, with orders in other units and a neutral command: the affine form is the acceleration.
#[test]
fn the_affine_form_of_any_actuators_is_the_acceleration() {
    let mut craft = Craft::hydrofoil();
    craft.rudders[0].law = RudderLaw::Linear(30.0);
    (craft.rudders[0].servo.order.terms[0].2, craft.rudders[0].servo.lag) = (0.01, 0.2);
    craft.commands[1].limits = [-50.0, 50.0];
    let mut second = craft.thrusters[0].clone();
    (second.name, second.position, second.angle) = ("bow".into(), [0.8, 0.1], 1.2);
    second.servo.order.terms = vec![(2, 1500.0, 0.05)];
    (second.forward, second.reverse, second.servo.lag) = (4.0, 4.0, 0.0);
    craft.thrusters.push(second);
    craft.commands.push(CommandInput {
        name: "pulse".into(),
        unit: "us".into(),
        limits: [1100.0, 1900.0],
        neutral: 1500.0,
    });
    let mut affine = AffinePlant::new(&craft).unwrap();
    let dynamics = Dynamics::new(&craft);
    let mut motion = Motion::new(3);
    for (nu, c) in [([2.3, -0.2, 0.3], [120.0, 10.0, 1720.0]), ([3.4, 0.1, -0.2], [-40.0, -30.0, 1210.0])] {
        affine.evaluate(nu, &mut motion);
        let mut positions = [0.0; 3];
        dynamics.settle(&c, &mut positions);
        let expected = dynamics.acceleration(nu, &positions);
        for i in 0..3 {
            let sum: f64 = (0..3).map(|k| motion.g[k][i] * affine.channels()[k].map.value(c[k])).sum();
            assert!((motion.f[i] + sum - expected[i]).abs() < 1e-11, "{i}: {motion:?} {expected:?}");
        }
    }
    assert_eq!(AffinePlant::limits(&craft)[2].rest, 1500.0);
}
