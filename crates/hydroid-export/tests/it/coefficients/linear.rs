//! Linear derivatives of a straight course against differences of the models.

use hydroid::boat::{Input, Role};
use hydroid::evaluate::DesignRange;
use hydroid::model::{Members, Model};
use hydroid_core::craft::{Craft, Dynamics};
use hydroid_export::coefficients::{CoefficientOptions, Coefficients, Inertia, latex, straight_course};

use super::equations::{MOTION, with_inputs};
use super::tables::{cell, number};
use super::{VESSELS, content, model, options, vessel};

const INERTIA: Inertia = Inertia {
    mass: 400.0,
    i_z: 900.0,
    x_g: 0.1,
    x_udot: -20.0,
    y_vdot: -300.0,
    y_rdot: -15.0,
    n_rdot: -200.0,
};

/// Gates, functions, lags and kinks beside the terms that have derivatives, each with its coefficients of `u`, `v`, `r`.
const TERMS: [(&str, [f64; 3]); 17] = [
    ("u", [-0.2, 0.0, 0.0]),
    ("u |u|", [-0.05, 0.0, 0.0]),
    ("v", [0.0, -0.6, -0.05]),
    ("v |u| below(u, 1.5, 4)", [0.0, -0.1, -0.02]),
    ("r |u| above(u, 1.5, 4)", [0.0, 0.05, -0.3]),
    ("u r", [0.0, -0.4, 0.0]),
    ("v r", [0.5, 0.0, 0.0]),
    ("n", [0.01, 0.0, 0.0]),
    ("n |n|", [0.02, 0.0, 0.0]),
    ("u n", [-0.003, 0.0, 0.0]),
    ("lag(n, 1.5 s)", [0.04, 0.0, 0.001]),
    ("delta", [0.0, -0.02, 0.03]),
    ("u^2 delta", [0.0, -0.1, 0.3]),
    ("delta^2", [-0.07, 0.0, 0.0]),
    ("u |u| sin(lag(delta, 0.4 s))", [0.0, -0.02, 0.11]),
    ("delta above(delta, 0.1, 12)", [0.0, 0.0, 0.2]),
    ("u cos(delta)", [0.05, 0.0, 0.0]),
];

fn launch(inputs: [(&str, &str); 2], terms: &[(&str, [f64; 3])], members: &[f64]) -> Model {
    let names = [("n", inputs[0].0), ("delta", inputs[1].0)];
    // The terms are written with the names n and delta.
    let named = |text: &str| -> String {
        let is_name = |c: char| c.is_alphanumeric();
        let word = |part: &str| {
            let name = part.trim_end_matches(|c| !is_name(c));
            let other = names.iter().find(|(from, _)| *from == name).map_or(name, |(_, to)| to);
            format!("{other}{}", &part[name.len()..])
        };
        text.split_inclusive(|c| !is_name(c)).map(word).collect()
    };
    let texts: Vec<String> = terms.iter().map(|(text, _)| named(text)).collect();
    let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
    let rows: Vec<Vec<f64>> = (0..3).map(|i| terms.iter().map(|(_, row)| row[i]).collect()).collect();
    let tables: Vec<Vec<f64>> =
        members.iter().map(|scale| rows.concat().iter().map(|x| scale * x).collect()).collect();
    let members = if tables.is_empty() { Members::default() } else { Members::new(&tables) };
    let mut model = with_inputs(&inputs, &MOTION, &texts, &rows, members);
    model.description.outputs[0].range = DesignRange { low: 0.5, high: 3.5 };
    model
}

fn with(speed: Option<f64>) -> CoefficientOptions {
    CoefficientOptions { inertia: Some(INERTIA), speed, length: Some(4.0), ..CoefficientOptions::default() }
}

/// Symbols and values of the linear derivatives.
fn found(model: &Model, speed: f64) -> Vec<(String, f64)> {
    let coefficients = Coefficients::of(model, &with(Some(speed)), "latex").unwrap();
    let rows = straight_course(model, &coefficients, speed).unwrap();
    rows.into_iter().map(|row| (row.latex, row.derivative.value)).collect()
}

fn value(rows: &[(String, f64)], symbol: &str) -> f64 {
    rows.iter().find(|(known, _)| known == symbol).unwrap_or_else(|| panic!("{symbol}: {rows:?}")).1
}

/// The derivative of a function at 0 on the side of `h`, of second order.
fn slope(f: impl Fn(f64) -> [f64; 3], h: f64) -> [f64; 3] {
    let (zero, half, whole) = (f(0.0), f(0.5 * h), f(h));
    std::array::from_fn(|i| (4.0 * half[i] - whole[i] - 3.0 * zero[i]) / h)
}

/// Forces of accelerations.
fn forces([m11, m22, m23, m33]: [f64; 4], [x, y, n]: [f64; 3]) -> [f64; 3] {
    [m11 * x, m22 * y + m23 * n, m23 * y + m33 * n]
}

/// Accelerations of equations with all lags settled.
fn accelerations(model: &Model, nu: [f64; 3], c: &[f64]) -> [f64; 3] {
    let named = model.equations().unwrap();
    let equations = named.equations();
    let mut slots = vec![0.0; equations.slots().max(1 + equations.variables())];
    let signals = equations.signals().iter().map(|signal| c[usize::from(signal.source()) - 3]);
    let all = nu.iter().copied().chain(c.iter().copied()).chain(signals);
    slots[1..].iter_mut().zip(all).for_each(|(slot, x)| *slot = x);
    let mut rates = [0.0; 3];
    equations.derivative(&mut slots, &mut rates);
    rates
}

fn near(found: f64, expected: f64, scale: f64, what: &str) {
    assert!((found - expected).abs() <= 1e-6 * scale.max(1e-9), "{what}: {found} {expected}");
}

#[test]
fn linear_derivatives_of_equations_are_differences_of_their_accelerations() {
    let model = launch([("n", "rps"), ("delta", "rad")], &TERMS, &[]);
    let mass = INERTIA.mass_matrix();
    for speed in [0.8, 1.5, 2.6] {
        let rows = found(&model, speed);
        for (k, symbol) in ["n", "\\delta"].into_iter().enumerate() {
            let at = |h: f64| {
                let mut c = [0.0; 2];
                c[k] = h;
                forces(mass, accelerations(&model, [speed, 0.0, 0.0], &c))
            };
            let expected = slope(at, 1e-5);
            for (force, expected) in ["X", "Y", "N"].into_iter().zip(expected) {
                let symbol = format!("{force}_{{{symbol}}}(U)");
                near(value(&rows, &symbol), expected, 100.0, &format!("{symbol} at {speed}"));
            }
        }
        // Gates are part of the derivatives by velocities.
        for (symbol, force, j) in [
            ("X_u(U)", 0, 0),
            ("Y_v(U)", 1, 1),
            ("Y_r(U) - m U", 1, 2),
            ("N_v(U)", 2, 1),
            ("N_r(U) - m x_g U", 2, 2),
        ] {
            let at = |h: f64| {
                let mut nu = [speed, 0.0, 0.0];
                nu[j] += h;
                forces(mass, accelerations(&model, nu, &[0.0; 2]))
            };
            near(value(&rows, symbol), slope(at, 1e-5)[force], 1000.0, &format!("{symbol} at {speed}"));
        }
    }
}

#[test]
fn the_table_has_the_terms_with_inputs_and_names_those_without_a_derivative() {
    let model = launch([("n", "rps"), ("delta", "rad")], &TERMS, &[0.9, 1.0, 1.1]);
    let text = content(&latex(&model, &options(), &with(None)).unwrap(), "boat.tex");
    // The middle of the training range.
    assert!(text.contains("at U = 2 m/s") && text.contains("middle of the training range"), "{text}");
    let [m11, m22, m23, m33] = INERTIA.mass_matrix();
    for (symbol, expected, unit) in [
        ("X_{n}", m11 * 0.01, "\\mathrm{kg}\\,\\mathrm{m}\\,\\mathrm{s}^{-2}\\,\\mathrm{rps}^{-1}"),
        (
            "X_{\\lvert n\\rvert n}",
            m11 * 0.02,
            "\\mathrm{kg}\\,\\mathrm{m}\\,\\mathrm{s}^{-2}\\,\\mathrm{rps}^{-2}",
        ),
        ("X_{u n}", m11 * -0.003, "\\mathrm{kg}\\,\\mathrm{s}^{-1}\\,\\mathrm{rps}^{-1}"),
        ("X_{\\hat{n}}", m11 * 0.04, "\\mathrm{kg}\\,\\mathrm{m}\\,\\mathrm{s}^{-2}\\,\\mathrm{rps}^{-1}"),
        ("X_{\\delta \\delta}", m11 * -0.07, "\\mathrm{kg}\\,\\mathrm{m}\\,\\mathrm{s}^{-2}"),
        ("Y_{\\delta}", m22 * -0.02 + m23 * 0.03, "\\mathrm{kg}\\,\\mathrm{m}\\,\\mathrm{s}^{-2}"),
        ("N_{uu \\delta}", m23 * -0.1 + m33 * 0.3, "\\mathrm{kg}"),
    ] {
        let found = cell(&text, symbol, 1);
        assert!(
            (number(&found) / expected - 1.0).abs() < 5e-2 && found.contains("\\pm"),
            "{symbol}: {found}"
        );
        assert_eq!(cell(&text, symbol, 2), format!("${unit}$"), "{symbol}");
    }
    for words in [
        "kg/m times u |u| sin(lag(delta, 0.4 s)), standard deviation",
        "delta above(delta, 0.1, 12)",
        "u cos(delta)",
    ] {
        assert!(
            text.lines().any(|line| line.starts_with("% Not in the tables: ") && line.contains(words)),
            "{text}"
        );
    }
    // The prime system: rho/2 L^3 U^2 for a moment per radian.
    let (si, prime) = (number(&cell(&text, "N_{\\delta}(U)", 1)), number(&cell(&text, "N_{\\delta}(U)", 3)));
    assert!((si / (0.5 * 1025.0 * 64.0 * 4.0) / prime - 1.0).abs() < 5e-2, "{si} {prime}");
    assert!(cell(&text, "N_{\\delta}(U)", 1).contains("\\pm"));
}

#[test]
fn both_sides_of_a_kink_are_stated_and_a_jump_has_no_derivative() {
    let terms = [
        ("u", [-0.2, 0.0, 0.0]),
        ("|delta|", [-0.3, 0.0, 0.0]),
        ("v |v|", [0.0, -1.0, 0.0]),
        ("sgn(n)", [0.1, 0.0, 0.0]),
    ];
    let model = launch([("n", "rps"), ("delta", "rad")], &terms, &[]);
    let rows = found(&model, 1.0);
    let m11 = INERTIA.mass_matrix()[0];
    assert_eq!(value(&rows, "X^{+}_{\\delta}(U)"), -0.3 * m11);
    assert_eq!(value(&rows, "X^{-}_{\\delta}(U)"), 0.3 * m11);
    assert!(value(&rows, "X_{n}(U)").is_nan());
    assert_eq!(value(&rows, "N_{\\delta}(U)"), 0.0);
    let text = content(&latex(&model, &options(), &with(Some(1.0))).unwrap(), "boat.tex");
    assert!(text.contains("$X_{n}(U)$ has no value") && !text.contains("NaN"), "{text}");
}

/// Members whose coefficients of `delta` and `u^2 delta` change against each other: at the speed where the changes cancel, the
/// derivative is certain.
#[test]
fn standard_deviations_contain_the_correlations_of_coefficients() {
    let terms = [("u", [-0.2, 0.0, 0.0]), ("delta", [0.0, 0.0, 0.1]), ("u^2 delta", [0.0, 0.0, 0.3])];
    let mut model = launch([("n", "rps"), ("delta", "rad")], &terms, &[]);
    let member = |change: f64| {
        [vec![-0.2, 0.0, 0.0], vec![0.0; 3], vec![0.0, 0.1 - 4.0 * change, 0.3 + change]].concat()
    };
    model.members = Members::new(&[member(-0.01), member(0.0), member(0.01)]);
    let deviation = |speed: f64| {
        let coefficients = Coefficients::of(&model, &with(Some(speed)), "latex").unwrap();
        let rows = straight_course(&model, &coefficients, speed).unwrap();
        rows.into_iter().find(|row| row.latex == "N_{\\delta}(U)").unwrap().derivative.deviation
    };
    let m33 = INERTIA.mass_matrix()[3];
    assert!(deviation(2.0).is_none_or(|deviation| deviation < 1e-9 * m33), "{:?}", deviation(2.0));
    // (U^2 - 4) 0.01
    near(deviation(3.0).unwrap(), 5.0 * 0.01 * m33, m33, "deviation");
}

#[test]
fn inputs_of_any_name_and_unit_have_derivatives() {
    let terms = [
        ("u", [-0.2, 0.0, 0.0]),
        ("n", [0.01, 0.0, 0.0]),
        ("n |n|", [1e-6, 0.0, 0.0]),
        ("u delta", [0.0, 0.0, 0.3]),
    ];
    // An input of pulse widths in its own unit, and one with a scale.
    let mut model = launch([("x1", "us"), ("helm", "1")], &terms, &[]);
    model.description.inputs[0].range = DesignRange { low: 1100.0, high: 1900.0 };
    let boat = &mut model.description.boat.inputs;
    let of = |role, neutral, limits, scale| Input {
        role: Some(role),
        unit: Some(String::from("us")),
        neutral: Some(neutral),
        limits: Some(limits),
        scale,
        ..Input::default()
    };
    boat.insert(String::from("x1"), of(Role::Propulsion, 1480.0, [1100.0, 1900.0], None));
    boat.insert(String::from("helm"), of(Role::Thruster, 1500.0, [1100.0, 1900.0], Some(400.0)));
    let rows = found(&model, 1.2);
    let [m11, _, m23, m33] = INERTIA.mass_matrix();
    near(value(&rows, "X_{x_{1}}(U)"), m11 * (0.01 + 2.0 * 1480.0 * 1e-6), m11, "X_x1");
    near(value(&rows, "N_{\\mathrm{helm}}(U)"), m33 * 0.3 * 1.2, m33, "N_helm");
    near(value(&rows, "Y_{\\mathrm{helm}}(U)"), m23 * 0.3 * 1.2, m33, "Y_helm");
    let text = content(&latex(&model, &options(), &with(Some(1.2))).unwrap(), "boat.tex");
    let force = "\\mathrm{kg}\\,\\mathrm{m}\\,\\mathrm{s}^{-2}";
    assert_eq!(cell(&text, "X_{x_{1}}(U)", 2), format!("${force}\\,\\mathrm{{us}}^{{-1}}$"));
    assert_eq!(cell(&text, "Y_{\\mathrm{helm}}(U)", 2), format!("${force}$"));
    assert!(text.contains("% Input helm: ") && text.contains("in the model 0.0025 (raw - 1500)"), "{text}");
}

#[test]
fn linear_derivatives_of_vessels_are_differences_of_their_accelerations() {
    for name in VESSELS {
        let file = vessel(name);
        let model = model(&file);
        let craft = &file.craft;
        let dynamics = Dynamics::new(craft);
        for speed in [0.9, 5.0] {
            let rows = found(&model, speed);
            for (k, command) in craft.commands.iter().enumerate() {
                let step = 1e-5 * (command.limits[1] - command.limits[0]);
                let at = |h: f64| {
                    let mut c: Vec<f64> = craft.commands.iter().map(|command| command.neutral).collect();
                    c[k] += h;
                    let mut positions = vec![0.0; dynamics.servos()];
                    dynamics.settle(&c, &mut positions);
                    forces(craft.hull.mass_matrix(), dynamics.acceleration([speed, 0.0, 0.0], &positions))
                };
                let sides = [slope(at, step), slope(at, -step)];
                let coefficients = Coefficients::of(&model, &with(None), "latex").unwrap();
                let latex = &coefficients.inputs[k].latex;
                let scale = sides.as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                for (i, force) in ["X", "Y", "N"].into_iter().enumerate() {
                    for (side, sign) in sides.iter().zip(["+", "-"]) {
                        let whole = format!("{force}_{{{latex}}}(U)");
                        let one = format!("{force}^{{{sign}}}_{{{latex}}}(U)");
                        let known = |symbol: &&String| rows.iter().any(|(known, _)| known == *symbol);
                        let symbol = [&whole, &one].into_iter().find(known).unwrap();
                        let what = format!("{name} {symbol} at {speed}");
                        near(value(&rows, symbol), side[i], 1e3 * scale.max(1e-3 * craft.hull.mass), &what);
                    }
                }
            }
        }
    }
}

#[test]
fn a_positive_rudder_turns_to_starboard_and_the_sign_convention_is_stated() {
    let model = model(&vessel("vessels/mariner"));
    let rows = found(&model, 7.7175);
    assert!(value(&rows, "N_{\\mathrm{rudder}}(U)") > 0.0 && value(&rows, "Y_{\\mathrm{rudder}}(U)") < 0.0);
    let with = CoefficientOptions { speed: Some(7.7175), ..CoefficientOptions::default() };
    let text = content(&latex(&model, &options(), &with).unwrap(), "boat.tex");
    assert!(text.contains("an input with a positive N turns the bow to starboard"), "{text}");
    // 1/2 rho A f_alpha (1 - w)^2 U^2 of the rudder, without the race of a propeller at rest.
    let normal = 0.5 * 1025.0 * 30.0 * 2.4 * (0.853_f64 * 7.7175).powi(2);
    let expected = normal * 80.5;
    near(value(&rows, "N_{\\mathrm{rudder}}(U)"), expected, expected, "N_rudder");
}

#[test]
fn linear_derivatives_of_built_in_vessels_are_differences_of_their_accelerations() {
    for params in [Craft::simple(), Craft::hydrofoil()] {
        let params = Craft { flying: None, ..params };
        let model = Model::of_vessel(&params, 0.1).unwrap();
        let rows = found(&model, 1.7);
        let plant = Dynamics::new(&params);
        let body = Coefficients::of(&model, &with(None), "latex").unwrap().inertia.mass_matrix();
        let nu = [1.7, 0.0, 0.0];
        let by_propeller = slope(|h| forces(body, plant.acceleration(nu, &[h, 0.0])), 1e-3);
        let by_rudder = slope(|h| forces(body, plant.acceleration(nu, &[0.0, h])), 1e-4);
        let [pp, rd] = [0, 1].map(|k| model.description.inputs[k].channel.name.clone());
        let symbol =
            |force: &str, name: &str| format!("{force}_{{{}}}(U)", hydroid::model::latex_symbol(name));
        for (symbol, expected) in [
            (symbol("X", &pp), by_propeller[0]),
            (symbol("N", &pp), by_propeller[2]),
            (symbol("X", &rd), by_rudder[0]),
            (symbol("Y", &rd), by_rudder[1]),
            (symbol("N", &rd), by_rudder[2]),
        ] {
            near(value(&rows, &symbol), expected, by_rudder[2].abs().max(1.0), &symbol);
        }
    }
}
