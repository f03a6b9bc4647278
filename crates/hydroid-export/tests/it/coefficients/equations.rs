//! Equations of motion of the marine form.

use std::sync::Arc;

use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{Body, Description, Members, Model, Port, Provenance, Reading};
use hydroid::sindy::ExpressionParser;
use hydroid_core::craft::{Craft, Dynamics};
use hydroid_core::model::sparse::Equations;
use hydroid_export::coefficients::{
    CoefficientOptions, Coefficients, Force, Inertia, Variable, latex, mss, sdf,
};

use super::derivatives::acceleration;
use super::{content, motions, near, options, vessel};

const TERMS: [&str; 14] = [
    "u",
    "v",
    "r",
    "u |u|",
    "v |v|",
    "r |r|",
    "v |u|",
    "r |u|",
    "v r",
    "r^2",
    "u r",
    "u v",
    "n |n|",
    "u sin(delta)",
];

fn model(outputs: &[(&str, &str)], terms: &[&str], rows: &[Vec<f64>], members: Members) -> Model {
    with_inputs(&[("n", "rpm"), ("delta", "rad")], outputs, terms, rows, members)
}

pub(crate) fn with_inputs(
    inputs: &[(&str, &str)],
    outputs: &[(&str, &str)],
    terms: &[&str],
    rows: &[Vec<f64>],
    members: Members,
) -> Model {
    let names = outputs.iter().chain(inputs).map(|(name, _)| *name);
    let mut parser = ExpressionParser::new(names, outputs.len(), 0.1);
    let terms = terms.iter().map(|text| parser.term(text).unwrap()).collect();
    let signals = parser.signals().to_vec();
    let port = |(name, unit): &(&str, &str)| Port {
        channel: Channel::new(*name, *unit),
        range: DesignRange { low: -1.0, high: 1.0 },
        training_range: None,
        noise: None,
        rate_limit: None,
    };
    let equations =
        Equations::with_signals(terms, rows.concat(), outputs.len(), inputs.len(), signals, 0.1, 1).unwrap();
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: String::from("sindy"),
            dt: 0.1,
            outputs: outputs.iter().map(port).collect(),
            inputs: inputs.iter().map(port).collect(),
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: String::from("0"),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings: serde_json::Value::Null,
                ..Provenance::default()
            },
        },
        body: Body::Equations(Arc::new(equations)),
        members,
        learning: None,
    }
}

/// The hull of a vessel without cross-flow drag and actuators, and its accelerations per term, found from the accelerations
/// themselves: each term is excited alone by differences of motions.
fn hull(name: &str) -> (Craft, Vec<Vec<f64>>) {
    let mut craft = vessel(name).craft;
    craft.hull.cross_flow = 0.0;
    craft.rudders.clear();
    craft.hull.quadratic[1][0] = 0.0;
    let dynamics = Dynamics::new(&craft);
    let at = |nu: [f64; 3]| dynamics.acceleration(nu, &vec![0.0; dynamics.servos()]);
    let each = |f: &dyn Fn(usize) -> f64| -> [f64; 3] { std::array::from_fn(f) };
    let mut columns: Vec<[f64; 3]> = vec![[0.0; 3]; TERMS.len()];
    // f(1) = a + b, f(-1) = -a - b, f(2) = 2 a + 4 b.
    for j in 0..3 {
        let along = |s: f64| at(std::array::from_fn(|i| if i == j { s } else { 0.0 }));
        let (one, minus, two) = (along(1.0), along(-1.0), along(2.0));
        // Even part: r^2.
        let even = each(&|i| 0.5 * (one[i] + minus[i]));
        let odd = |x: [f64; 3], scale: f64| each(&|i| x[i] - scale * even[i]);
        let (first, second) = (odd(one, 1.0), odd(two, 4.0));
        let quadratic = each(&|i| 0.5 * (second[i] - 2.0 * first[i]));
        columns[j] = each(&|i| first[i] - quadratic[i]);
        columns[3 + j] = quadratic;
        if j == 2 {
            columns[9] = even;
        }
    }
    // Products: what is left of motions along two axes, odd and even in u.
    let rest = |nu: [f64; 3]| {
        let all = at(nu);
        let own: Vec<[f64; 3]> =
            (0..3).map(|j| at(std::array::from_fn(|i| if i == j { nu[i] } else { 0.0 }))).collect();
        each(&|i| all[i] - own.iter().map(|own| own[i]).sum::<f64>())
    };
    for (j, [magnitude, product]) in [(1, [6, 11]), (2, [7, 10])] {
        let with = |u: f64| {
            rest(std::array::from_fn(|i| {
                if i == 0 {
                    u
                } else if i == j {
                    1.0
                } else {
                    0.0
                }
            }))
        };
        let (ahead, astern) = (with(1.0), with(-1.0));
        columns[magnitude] = each(&|i| 0.5 * (ahead[i] + astern[i]));
        columns[product] = each(&|i| 0.5 * (ahead[i] - astern[i]));
    }
    columns[8] = rest([0.0, 1.0, 1.0]);
    let rows = (0..3).map(|i| columns.iter().map(|column| column[i]).collect()).collect();
    (craft, rows)
}

fn inertia(craft: &Craft) -> Inertia {
    let h = &craft.hull;
    Inertia {
        mass: h.mass,
        i_z: h.i_z,
        x_g: h.x_g,
        x_udot: h.x_udot,
        y_vdot: h.y_vdot,
        y_rdot: h.y_rdot,
        n_rdot: h.n_rdot,
    }
}

pub(crate) const MOTION: [(&str, &str); 3] = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];

#[test]
fn equations_with_the_mass_of_a_vessel_have_its_derivatives() {
    for name in ["vessels/otter", "vessels/mariner", "vessels/tug"] {
        let (craft, rows) = hull(name);
        let model = model(&MOTION, &TERMS, &rows, Members::default());
        let options = CoefficientOptions { inertia: Some(inertia(&craft)), ..CoefficientOptions::default() };
        let found = Coefficients::of(&model, &options, "sdf").unwrap();
        let dynamics = Dynamics::new(&craft);
        for nu in motions() {
            let expected = dynamics.acceleration(nu, &vec![0.0; dynamics.servos()]);
            let a = acceleration(&found, &found.with_centripetal(), nu);
            let scale = 1e3 * expected.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
            assert!((0..3).all(|i| near(a[i], expected[i], scale)), "{name} {nu:?}: {a:?} {expected:?}");
        }
        let of = |force, variable: &Variable| {
            let found = found.derivatives.iter().find(|d| d.force == force && d.variable == *variable);
            found.map_or(0.0, |d| d.value)
        };
        let h = &craft.hull;
        for (force, variable, expected) in [
            (Force::X, Variable::product(&[0]), -h.linear[0][0]),
            (Force::Y, Variable::signed(0, 1), -h.lift[0][0]),
            (Force::N, Variable::signed(2, 2), -h.quadratic[2][2]),
            (Force::X, Variable::product(&[1, 2]), -h.y_vdot),
            (Force::N, Variable::product(&[0, 1]), h.y_vdot - h.x_udot),
        ] {
            let scale = 1e4 * (h.mass + expected.abs());
            assert!(near(of(force, &variable), expected, scale), "{name} {variable:?}: {expected}");
        }
    }
}

#[test]
fn forces_of_actuators_and_standard_errors_are_stated() {
    let (craft, mut rows) = hull("vessels/otter");
    rows[0][12] = 2e-3;
    rows[2][13] = 0.5;
    let count = TERMS.len();
    let table = |scale: f64| {
        let mut table = rows.concat();
        table[0] *= scale;
        table[count + 1] *= scale;
        table
    };
    let members = Members::new(&[table(0.9), table(1.0), table(1.1)]);
    let model = model(&MOTION, &TERMS, &rows, members);
    let inertia = inertia(&craft);
    let with = CoefficientOptions {
        inertia: Some(inertia),
        speed: Some(1.0),
        length: Some(2.0),
        ..CoefficientOptions::default()
    };
    let found = Coefficients::of(&model, &with, "sdf").unwrap();
    let [m11, ..] = inertia.mass_matrix();
    let x_u = found.derivatives.iter().find(|d| d.symbol(&[]) == "X_u").unwrap();
    let deviation = 0.1 * rows[0][0].abs() * m11;
    assert!((x_u.deviation.unwrap() / deviation - 1.0).abs() < 1e-9, "{x_u:?} {deviation}");
    let comments = content(&sdf(&model, &options(), &with).unwrap(), "boat_gz.sdf");
    for words in ["X_|n| n = ", "N = 20.72", "kg m/s times u sin(delta)", "<xU>"] {
        assert!(comments.contains(words), "{words}: {comments}");
    }
    let table = content(&latex(&model, &options(), &with).unwrap(), "boat.tex");
    assert!(table.contains("$X_{u}$ & $-77.5 \\pm 7.8$"), "{table}");
    assert!(table.contains("% Not in the tables: N = 20.72"), "{table}");
    assert!(table.contains("  $X_{\\lvert n\\rvert n}$ & $0.1710$ & $\\mathrm{kg}\\,\\mathrm{m}\\,\\mathrm{s}^{-2}\\,\\mathrm{rpm}^{-2}$"), "{table}");
}

#[test]
fn equations_without_a_mass_have_accelerations_in_latex_and_refusals_elsewhere() {
    let (craft, rows) = hull("vessels/otter");
    let plain = CoefficientOptions::default();
    let whole = model(&MOTION, &TERMS, &rows, Members::default());
    let table = content(&latex(&whole, &options(), &plain).unwrap(), "boat.tex");
    assert!(table.contains("\\dot{u} &=") && table.contains("without the mass"), "{table}");
    let error = sdf(&whole, &options(), &plain).unwrap_err().to_string();
    assert!(error.contains("by vessel"), "{error}");
    let inertia = inertia(&craft);
    for (wrong, words) in [
        (Inertia { mass: 0.0, ..inertia }, "not that of a vessel"),
        (Inertia { mass: f64::NAN, ..inertia }, "not that of a vessel"),
        (Inertia { n_rdot: 1e9, ..inertia }, "not that of a vessel"),
    ] {
        let with = CoefficientOptions { inertia: Some(wrong), ..CoefficientOptions::default() };
        let error = sdf(&whole, &options(), &with).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let with = CoefficientOptions { inertia: Some(inertia), ..CoefficientOptions::default() };
    let one = vec![vec![0.0, 1.0]; 3];
    for (outputs, terms, rows, words) in [
        (vec![("u", "m/s"), ("v", "m/s")], vec!["u", "v"], one[..2].to_vec(), "no output r"),
        (vec![("u", "m/s"), ("v", "kn"), ("r", "rad/s")], vec!["u", "v"], one.clone(), "unit 'kn'"),
        ([&MOTION[..], &[("p", "rad/s")]].concat(), vec!["u", "v"], vec![vec![0.0, 1.0]; 4], "4 outputs"),
        (MOTION.to_vec(), vec!["u", "n"], one.clone(), "product of velocities"),
    ] {
        let model = model(&outputs, &terms, &rows, Members::default());
        let error = sdf(&model, &options(), &with).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn delays_and_limits_of_rates_are_refused_as_vehicles() {
    let rows = vec![vec![-1.0, 0.5]; 3];
    let delayed = model(&MOTION, &["u", "n(-0.5 s)"], &rows, Members::default());
    let mut limited = model(&MOTION, &["u", "delta"], &rows, Members::default());
    limited.description.inputs[1].rate_limit = Some(0.1);
    let lags = model(&MOTION, &["u", "lag(n, 1.5 s)"], &rows, Members::default());
    let error = |model| mss(model, &options()).unwrap_err().to_string();
    assert!(error(&delayed).contains("without delays"));
    assert!(error(&limited).contains("'delta' has a limit of the rate"));
    assert!(mss(&lags, &options()).is_ok());
    let other = model(&[("u", "m/s")], &["u"], &[vec![1.0]], Members::default());
    assert!(error(&other).contains("no output v"));
}
