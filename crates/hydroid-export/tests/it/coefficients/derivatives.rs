//! Coefficients of vessels against the equations of motion and published numbers.

use std::path::Path;

use hydroid::model::{self, Model};
use hydroid_core::craft::{Craft, Dynamics};
use hydroid_export::coefficients::{
    CoefficientOptions, Coefficients, Derivative, Force, Variable, latex, mss, sdf,
};

use super::{VESSELS, model, motions, near, options, vessel};

fn coefficients(model: &Model) -> Coefficients {
    Coefficients::of(model, &CoefficientOptions::default(), "sdf").unwrap()
}

/// Accelerations of a hull from the sum of its derivatives: with all terms of the accelerations on the left,
/// `(M_RB - A) nu_dot = F(nu) - C_RB nu`.
pub(crate) fn acceleration(of: &Coefficients, all: &[Derivative], nu: [f64; 3]) -> [f64; 3] {
    let mut force = [0.0; 3];
    let at: Vec<f64> = nu.into_iter().chain(of.inputs.iter().map(|_| 0.0)).collect();
    for derivative in all.iter().filter(|d| !matches!(d.variable, Variable::Acceleration(_))) {
        force[derivative.force as usize] += derivative.value * derivative.variable.value(&at, [0.0; 3]);
    }
    let (m, x_g) = (of.inertia.mass, of.inertia.x_g);
    let [u, v, r] = nu;
    let centripetal = [-m * (v * r + x_g * r * r), m * u * r, m * x_g * u * r];
    let [x, y, n] = std::array::from_fn(|i| force[i] - centripetal[i]);
    let [m11, m22, m23, m33] = of.inertia.mass_matrix();
    let determinant = m22 * m33 - m23 * m23;
    [x / m11, (m33 * y - m23 * n) / determinant, (m22 * n - m23 * y) / determinant]
}

#[test]
fn derivatives_move_a_vessel_as_its_equations_do() {
    for name in VESSELS {
        let mut file = vessel(name);
        file.craft.hull.cross_flow = 0.0;
        let coefficients = coefficients(&model(&file));
        let mut hull = file.craft.clone();
        hull.rudders.clear();
        let dynamics = Dynamics::new(&hull);
        for nu in motions() {
            let expected = dynamics.acceleration(nu, &vec![0.0; dynamics.servos()]);
            let found = acceleration(&coefficients, &coefficients.with_centripetal(), nu);
            let scale = expected.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
            assert!(
                (0..3).all(|i| near(found[i], expected[i], scale)),
                "{name} {nu:?}: {found:?} {expected:?}"
            );
        }
    }
}

#[test]
fn derivatives_move_a_built_in_vessel_as_its_equations_do() {
    for params in [Craft::simple(), Craft::hydrofoil()] {
        // The normal mode.
        let params = Craft { flying: None, ..params };
        let coefficients = coefficients(&Model::of_vessel(&params, 0.1).unwrap());
        let plant = Dynamics::new(&params);
        for nu in motions() {
            let expected = plant.acceleration(nu, &[0.0, 0.0]);
            let found = acceleration(&coefficients, &coefficients.with_centripetal(), nu);
            let scale = expected.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
            assert!((0..3).all(|i| near(found[i], expected[i], scale)), "{nu:?}: {found:?} {expected:?}");
        }
    }
}

#[test]
fn the_flying_mode_and_the_actuators_of_a_built_in_vessel_are_named() {
    let model = Model::of_vessel(&Craft::hydrofoil(), 0.1).unwrap();
    let found = coefficients(&model);
    let described = found.derivatives.iter().map(|derivative| derivative.described(&found.inputs));
    let text = described.chain(found.other_forces.clone()).collect::<Vec<_>>().join("\n");
    for words in ["u sin(RD)", "above 2.5 m/s", "damping by 0.5"] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn cross_flow_drag_has_its_derivatives_in_pure_sway_and_yaw() {
    for name in VESSELS {
        let file = vessel(name);
        let coefficients = coefficients(&model(&file));
        let dynamics = Dynamics::new(&file.craft);
        let mut without = file.craft.clone();
        without.hull.cross_flow = 0.0;
        let without = Dynamics::new(&without);
        for nu in [[0.0, 0.7, 0.0], [0.0, -0.7, 0.0], [0.0, 0.0, 0.3], [0.0, 0.0, -0.3]] {
            let (with, without) = (dynamics.damping(nu), without.damping(nu));
            let mut found = [0.0; 3];
            for d in coefficients.cross_flow_derivatives() {
                found[d.force as usize] -= d.value * d.variable.value(&nu, [0.0; 3]);
            }
            let scale = with[1].abs() + with[2].abs();
            assert!((0..3).all(|i| near(found[i], with[i] - without[i], scale)), "{name} {nu:?}");
        }
    }
}

/// Fossen's formulas of the Otter (`otter.py` of the Python Vehicle Simulator), computed here.
#[test]
fn the_otter_has_the_published_coefficients() {
    let coefficients = coefficients(&model(&vessel("vessels/otter")));
    let (g, hull, payload) = (9.81, 55.0, 25.0);
    let mass = hull + payload;
    let x_g = hull * 0.2 / mass;
    let radius: f64 = 0.25 * 2.0;
    let about_centre = hull * radius * radius + hull * x_g * x_g;
    let i_z = about_centre + mass * x_g * x_g;
    let value = |force, variable| {
        let found = coefficients.derivatives.iter().find(|d| d.force == force && d.variable == variable);
        found.map_or(0.0, |d| d.value)
    };
    let yaw = i_z + 1.7 * about_centre;
    for (what, found, published) in [
        ("m", coefficients.inertia.mass, mass),
        ("x_g", coefficients.inertia.x_g, x_g),
        ("I_z", coefficients.inertia.i_z, i_z),
        ("X_udot", value(Force::X, Variable::Acceleration(0)), -0.1 * hull),
        ("Y_vdot", value(Force::Y, Variable::Acceleration(1)), -1.5 * hull),
        ("N_rdot", value(Force::N, Variable::Acceleration(2)), -1.7 * about_centre),
        ("X_u", value(Force::X, Variable::product(&[0])), -24.4 * g / (6.0 * 0.5144)),
        ("N_r", value(Force::N, Variable::product(&[2])), -yaw),
        ("N_|r|r", value(Force::N, Variable::signed(2, 2)), -10.0 * yaw),
    ] {
        assert!((found / published - 1.0).abs() < 1e-3, "{what}: {found} {published}");
    }
}

#[test]
fn a_symbol_has_its_unit_and_its_prime_system() {
    for (force, variable, symbol, unit, prime) in [
        (Force::X, Variable::Acceleration(0), "X_udot", [1, 0, 0], [3, 0]),
        (Force::Y, Variable::Acceleration(2), "Y_rdot", [1, 1, 0], [4, 0]),
        (Force::N, Variable::Acceleration(1), "N_vdot", [1, 1, 0], [4, 0]),
        (Force::N, Variable::Acceleration(2), "N_rdot", [1, 2, 0], [5, 0]),
        (Force::X, Variable::signed(0, 0), "X_|u|u", [1, -1, 0], [2, 0]),
        (Force::Y, Variable::product(&[1]), "Y_v", [1, 0, -1], [2, 1]),
        (Force::Y, Variable::product(&[0, 2]), "Y_ur", [1, 0, 0], [3, 0]),
        (Force::N, Variable::product(&[2]), "N_r", [1, 2, -1], [4, 1]),
        (Force::N, Variable::signed(0, 1), "N_|u|v", [1, 0, 0], [3, 0]),
        (Force::N, Variable::product(&[1, 1, 1]), "N_vvv", [1, -1, 1], [3, -1]),
        (Force::X, Variable::product(&[]), "X_0", [1, 1, -2], [2, 2]),
    ] {
        let derivative = Derivative::new(force, variable, 1.0);
        assert_eq!(derivative.symbol(&[]), symbol);
        assert_eq!((derivative.unit_powers(), derivative.prime_powers()), (unit, prime), "{symbol}");
    }
}

#[test]
fn other_models_are_refused_with_the_nearest_thing() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds/model_file");
    for kind in ["affine", "committee", "direct", "gru", "lstm", "rnn"] {
        let model = model::read(&root.join(format!("seed-{kind}"))).unwrap();
        let (options, coefficient_options) = (options(), CoefficientOptions::default());
        for (format, files) in [
            ("sdf", sdf(&model, &options, &coefficient_options)),
            ("mss", mss(&model, &options)),
            ("latex", latex(&model, &options, &coefficient_options)),
        ] {
            let error = files.unwrap_err().to_string();
            assert!(error.contains("grey-box") && error.contains(format), "{kind}: {error}");
        }
    }
}
