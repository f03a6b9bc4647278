//! Affine form of equations, compared with the vessels that they describe; refusals.

use crate::controllers::written::{Force, equations};
use hydroid_core::actuator::{Lag, Limits, Map};
use hydroid_core::control::{
    Affine, AffineEquations, AffinePlant, Backstepping, BacksteppingOptions, ControlError, Controller,
    Estimate, FeedbackLinearization, FeedbackLinearizationOptions, Motion, NotAffine,
};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{Path, Reference, Side};
use hydroid_core::model::sparse::{Equations, Factor, Gate, Jacobian, Real, Shape, Signal, Term};
use proptest::prelude::*;

const NAMES: [&str; 7] = ["u", "v", "r", "P_f", "PP", "RD", "lag(PP)"];
const HIDDEN: [&str; 6] = ["u", "v", "r", "PP", "RD", "lag(PP)"];

fn vessels() -> [Craft; 2] {
    [Craft::simple(), Craft::hydrofoil()]
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-10 * (1.0 + a.abs())
}

proptest! {
    #[test]
    fn equations_of_a_vessel_have_its_f_and_g(
        u in -1.0..6.0f64, v in -1.0..1.0f64, r in -0.6..0.6f64, which in 0usize..2, measured in any::<bool>(),
    ) {
        let vessel = &vessels()[which];
        let force = if measured { Force::Measured } else { Force::Hidden };
        let mut plant = AffinePlant::new(vessel).unwrap();
        let mut written = AffineEquations::new(&equations(vessel, force), [0, 1, 2]).unwrap();
        let (mut one, mut two) = (Motion::new(2), Motion::new(2));
        plant.evaluate([u, v, r], &mut one);
        written.evaluate([u, v, r], &mut two);
        for i in 0..3 {
            prop_assert!(close(one.f[i], two.f[i]), "f{i}: {} and {}", one.f[i], two.f[i]);
            for (a, b) in one.g.iter().zip(&two.g) {
                prop_assert!(close(a[i], b[i]), "g{i}: {} and {}", a[i], b[i]);
            }
        }
        for (a, b) in plant.channels().iter().zip(written.channels()) {
            prop_assert_eq!(a, b);
        }
    }

    #[test]
    fn g_is_the_jacobian_by_the_efforts(u in 0.0..6.0f64, v in -1.0..1.0f64, r in -0.6..0.6f64, p in -100.0..300.0f64, d in -0.5..0.5f64) {
        let equations = equations(&Craft::hydrofoil(), Force::Hidden);
        let mut affine = AffineEquations::new(&equations, [0, 1, 2]).unwrap();
        let mut motion = Motion::new(2);
        affine.evaluate([u, v, r], &mut motion);
        let jacobian = Jacobian::new(&equations).unwrap();
        let mut slots = vec![0.0; jacobian.slots()];
        slots[1..=6].copy_from_slice(&[u, v, r, 0.0, d, p]);
        let mut all = vec![0.0; 3 * 6];
        jacobian.evaluate(&mut slots, &mut all);
        for i in 0..3 {
            prop_assert!(close(all[6 * i + 5], motion.g[0][i]), "by the lag state");
            prop_assert!(close(all[6 * i + 4], motion.g[1][i] * d.cos()), "by the angle: cos(RD) of it");
        }
    }
}

/// The plant, its equations with a hidden lag, and those with the force as an output give the same commands.
#[test]
fn commands_do_not_depend_on_how_the_model_is_written() {
    for vessel in &vessels() {
        let settings = FeedbackLinearizationOptions::new(1.2);
        let limits = AffinePlant::limits(vessel);
        let of = |force| AffineEquations::new(&equations(vessel, force), [0, 1, 2]).unwrap();
        let mut laws: Vec<Box<dyn Controller>> = vec![
            Box::new(
                FeedbackLinearization::new(AffinePlant::new(vessel).unwrap(), &limits, 0.1, settings)
                    .unwrap(),
            ),
            Box::new(FeedbackLinearization::new(of(Force::Hidden), &limits, 0.1, settings).unwrap()),
            Box::new(FeedbackLinearization::new(of(Force::Measured), &limits, 0.1, settings).unwrap()),
        ];
        for k in 0..50 {
            let t = 0.1 * f64::from(k);
            let estimate = Estimate {
                eta: [1.4 * t, 0.2 * t.sin(), 0.1 * t],
                nu: [1.5 + 0.3 * t, 0.05, 0.1],
                current: [0.0; 2],
                actuators: &[],
            };
            let reference = Reference {
                s: 0.0,
                position: [1.2 + 1.5 * t, 0.1],
                velocity: [1.5, 0.0],
                acceleration: [0.1, -0.05],
                course: 0.0,
                curvature: 0.0,
                speed: 1.5,
            };
            let mut commands = [[0.0; 2]; 3];
            let statuses: Vec<_> = laws
                .iter_mut()
                .zip(&mut commands)
                .map(|(law, c)| law.command(&estimate, &reference, c))
                .collect();
            for other in 1..3 {
                assert_eq!(statuses[0], statuses[other]);
                for i in 0..2 {
                    assert!((commands[0][i] - commands[other][i]).abs() < 1e-6, "{k}: {commands:?}");
                }
            }
        }
    }
}

/// An adapted model passes its coefficients on, with the lag of a measured force.
#[test]
fn adapted_coefficients_are_used() {
    let (vessel, mut heavy) = (Craft::simple(), Craft::simple());
    heavy.hull.mass *= 1.2;
    heavy.thrusters[0].servo.lag = 1.7;
    let (before, after) = (equations(&vessel, Force::Measured), equations(&heavy, Force::Measured));
    let mut affine = AffineEquations::new(&before, [0, 1, 2]).unwrap();
    affine.set_coefficients(after.coefficients());
    assert_eq!(affine, AffineEquations::new(&after, [0, 1, 2]).unwrap());
    let limits = AffinePlant::limits(&vessel);
    let mut law = FeedbackLinearization::new(
        AffineEquations::new(&before, [0, 1, 2]).unwrap(),
        &limits,
        0.1,
        FeedbackLinearizationOptions::new(1.0),
    )
    .unwrap();
    law.update(|model| model.set_coefficients(after.coefficients())).unwrap();
    let Lag::FirstOrder { rate, .. } = law.model().channels()[0].lag else { panic!() };
    assert!((rate + 1.0 / 1.7).abs() < 1e-12);
    let mut actuators = [0.0; 2];
    affine.actuators_of(&[1.0, 0.1, 0.2, 33.0], &mut actuators);
    assert!(actuators[0] == 33.0 && actuators[1].is_nan());
}

#[test]
fn coefficients_that_are_refused_change_nothing() {
    let (vessel, mut heavy) = (Craft::simple(), Craft::simple());
    heavy.hull.mass *= 1.2;
    let (before, after) = (equations(&vessel, Force::Measured), equations(&heavy, Force::Measured));
    let mut unstable = after.coefficients().to_vec();
    // The propeller force would grow.
    unstable[3 * after.terms().len()..].iter_mut().for_each(|c| *c = -*c);
    let model = || AffineEquations::new(&before, [0, 1, 2]).unwrap();
    let limits = AffinePlant::limits(&vessel);
    let settings = FeedbackLinearizationOptions::new(1.0);
    let make = || FeedbackLinearization::new(model(), &limits, 0.1, settings).unwrap();
    let (mut law, mut untouched) = (make(), make());
    let refused = law.update(|model| model.set_coefficients(&unstable));
    assert_eq!(refused, Err(ControlError::Lag { channel: 0 }));
    assert_eq!(*law.model(), model());
    let mut stepping = Backstepping::new(model(), &limits, 0.1, BacksteppingOptions::new(1.0)).unwrap();
    stepping.update(|model| model.set_coefficients(&unstable)).unwrap_err();
    assert_eq!(*stepping.model(), model());
    let path = Path::circle([0.0, 0.0], 10.0, Side::Starboard, 0.0).unwrap();
    let reference = Reference::new(1.0, &path.at(1.0), 1.5, 0.0);
    let mut commands = [[0.0; 2]; 2];
    for (law, command) in [&mut law, &mut untouched].into_iter().zip(&mut commands) {
        let estimate = Estimate {
            eta: [10.2, 0.1, 1.5],
            nu: [1.4, 0.0, 0.1],
            current: [0.0; 2],
            actuators: &[20.0, f64::NAN],
        };
        law.command(&estimate, &reference, command);
    }
    assert_eq!(commands[0], commands[1]);
    law.update(|model| model.set_coefficients(after.coefficients())).unwrap();
    let (mut learned, mut fresh) = (law.model().clone(), AffineEquations::new(&after, [0, 1, 2]).unwrap());
    let (mut one, mut two) = (Motion::new(2), Motion::new(2));
    learned.evaluate([1.4, 0.1, 0.2], &mut one);
    fresh.evaluate([1.4, 0.1, 0.2], &mut two);
    assert_eq!((one, learned.channels()), (two, fresh.channels()));
}

fn with(output: usize, extra: Term, signals: Vec<Signal>) -> Result<AffineEquations, String> {
    let mut terms = vec![Term::monomial(&[0]), Term::monomial(&[3]), Term::monomial(&[0, 4]), extra];
    let mut coefficients = vec![0.0; 12];
    (coefficients[0], coefficients[1], coefficients[10]) = (-1.0, 0.01, 0.02);
    if terms[..3].contains(&terms[3]) {
        terms.pop();
        panic!("{terms:?} is there already");
    }
    coefficients[4 * output + 3] = 0.5;
    let equations = Equations::with_signals(terms, coefficients, 3, 2, signals, 0.1, 1).unwrap();
    AffineEquations::new(&equations, [0, 1, 2]).map_err(|error| error.with_names(&HIDDEN))
}

fn factor(variable: u16, shape: Shape) -> Factor {
    Factor { variable, shape }
}

#[test]
fn terms_that_are_not_affine_are_refused_by_name() {
    let lag = || vec![Signal::Lag { input: 3, time_constant_s: Real(1.0) }];
    let refused = |output, term, signals| with(output, term, signals).unwrap_err();
    assert_eq!(
        refused(0, Term::monomial(&[3, 3]), Vec::new()),
        "the term PP^2 of du/dt is not affine in one known function (c, sin(c) or c |c|) of a command"
    );
    assert_eq!(
        refused(1, Term::monomial(&[3, 4]), Vec::new()),
        "the term PP RD of dv/dt is not affine in one known function (c, sin(c) or c |c|) of a command"
    );
    let gate = Gate { centre: Real(10.0), slope: Real(1.0) };
    let gated = Term::new(vec![factor(0, Shape::Power(1)), factor(3, Shape::Above(gate))]);
    assert_eq!(
        refused(0, gated, Vec::new()),
        "the term u above(PP, 10, 1) of du/dt is not affine in one known function (c, sin(c) or c |c|) of a command"
    );
    assert_eq!(
        refused(2, Term::of(4, Shape::Sin), Vec::new()),
        "command 1 enters in two ways; the second is in the term sin(RD) of dr/dt"
    );
    assert_eq!(
        refused(0, Term::monomial(&[5]), lag()),
        "command 0 enters in two ways; the second is in the term lag(PP) of du/dt"
    );
    let past = vec![Signal::Past { variable: 0, samples: 2 }];
    let told = with(0, Term::monomial(&[5]), past).unwrap_err();
    assert!(told.starts_with("the term lag(PP) of du/dt has past values"), "{told}");
    // A gate on the speed and a power of it belong to the motion.
    let speed = Gate { centre: Real(2.5), slope: Real(12.0) };
    let fine = Term::new(vec![
        factor(0, Shape::Power(2)),
        factor(0, Shape::Below(speed)),
        factor(4, Shape::Power(1)),
    ]);
    assert!(with(2, fine, Vec::new()).is_ok());
}

#[test]
fn outputs_that_are_no_actuators_are_refused() {
    let vessel = Craft::simple();
    let equations = equations(&vessel, Force::Measured);
    let count = equations.terms().len();
    let changed = |place: usize, value: f64| {
        let mut coefficients = equations.coefficients().to_vec();
        coefficients[place] = value;
        let made = Equations::new(equations.terms().to_vec(), coefficients, 4, 2, 0.1, 1).unwrap();
        AffineEquations::new(&made, [0, 1, 2]).map_err(|error| error.with_names(&NAMES))
    };
    // dP_f/dt gets a term in u, or loses its command.
    assert_eq!(
        changed(3 * count, 0.1).unwrap_err(),
        "P_f is neither u, v, r nor an actuator: its equation has the term u, and an actuator's has itself, one command and a constant"
    );
    assert_eq!(
        changed(3 * count + count - 1, 0.0).unwrap_err(),
        "P_f is neither u, v, r nor an actuator: it follows no command"
    );
    assert_eq!(AffineEquations::new(&equations, [0, 1, 1]).unwrap_err(), NotAffine::Motion);
    assert_eq!(AffineEquations::new(&equations, [0, 1, 7]).unwrap_err(), NotAffine::Motion);
    // Without the term of the rudder one command is left.
    let rudder = equations.terms().iter().position(|term| term.contains(5)).unwrap();
    let told = (0..3)
        .try_fold(equations.coefficients().to_vec(), |mut coefficients, row| {
            coefficients[row * count + rudder] = 0.0;
            Some(coefficients)
        })
        .map(|coefficients| Equations::new(equations.terms().to_vec(), coefficients, 4, 2, 0.1, 1).unwrap())
        .map(|made| AffineEquations::new(&made, [0, 1, 2]).unwrap_err());
    assert_eq!(told, Some(NotAffine::TooFewInputs { given: 1 }));
}

#[test]
fn signed_squares_are_recognised() {
    let terms = vec![
        Term::monomial(&[0]),
        Term::signed_square(3, 3),
        Term::new(vec![factor(0, Shape::Power(2)), factor(4, Shape::Sin)]),
    ];
    let coefficients = vec![-0.5, 2.0, 0.0, 0.0, 0.0, 0.1, -0.1, 0.0, 1.0];
    let made = Equations::new(terms, coefficients, 3, 2, 0.1, 1).unwrap();
    let mut affine = AffineEquations::new(&made, [0, 1, 2]).unwrap();
    assert_eq!([affine.channels()[0].map, affine.channels()[1].map], [Map::SignedSquare, Map::Sine]);
    let mut motion = Motion::new(2);
    affine.evaluate([1.5, 0.0, 0.0], &mut motion);
    assert!(close(motion.f[0], -0.75) && motion.f[1] == 0.0 && close(motion.f[2], -0.15));
    assert_eq!(motion.g, [[2.0, 0.0, 0.0], [0.0, 0.1 * 2.25, 2.25]]);
    let limits = [Limits::between([-3.0, 3.0]), Limits::between([-0.6, 0.6])];
    let mut law =
        FeedbackLinearization::new(affine, &limits, 0.1, FeedbackLinearizationOptions::new(0.5)).unwrap();
    let estimate = Estimate { eta: [-0.5, 0.0, 0.0], nu: [1.5, 0.0, 0.0], current: [0.0; 2], actuators: &[] };
    let reference = Reference {
        s: 0.0,
        position: [0.0; 2],
        velocity: [1.5, 0.0],
        acceleration: [0.25, 0.0],
        course: 0.0,
        curvature: 0.0,
        speed: 1.5,
    };
    let mut command = [0.0; 2];
    law.command(&estimate, &reference, &mut command);
    // 2 n |n| = 0.25 + 0.75
    assert!((command[0] - 0.5f64.sqrt()).abs() < 1e-9, "{command:?}");
}
