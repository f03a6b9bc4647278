//! The equations of a model as text, LaTeX, units and Jacobian.

use std::sync::Arc;

use hydroid::evaluate::DesignRange;
use hydroid::log::Channel;
use hydroid::model::{Body, Description, Members, Model, Port, Provenance, Reading, UnitProduct};
use hydroid::sindy::ExpressionParser;
use hydroid_core::model::sparse::{Equations, Factor, Gate, Jacobian, Real, Shape, Signal, Term};
use proptest::prelude::*;

/// A model of channels `(name, unit)` with terms as text and a row of coefficients for each output.
pub(crate) fn model(
    outputs: &[(&str, &str)],
    inputs: &[(&str, &str)],
    terms: &[&str],
    rows: &[&[f64]],
) -> Model {
    let names = outputs.iter().chain(inputs).map(|(name, _)| *name);
    let mut parser = ExpressionParser::new(names, outputs.len(), 0.1);
    let terms = terms.iter().map(|text| parser.term(text).unwrap()).collect();
    made(outputs, inputs, terms, rows.concat(), parser.signals().to_vec())
}

fn made(
    outputs: &[(&str, &str)],
    inputs: &[(&str, &str)],
    terms: Vec<Term>,
    coefficients: Vec<f64>,
    signals: Vec<Signal>,
) -> Model {
    let ports = |channels: &[(&str, &str)]| -> Vec<Port> {
        let port = |(name, unit): &(&str, &str)| Port {
            channel: Channel::new(*name, *unit),
            range: DesignRange { low: -1.0, high: 1.0 },
            training_range: None,
            noise: None,
            rate_limit: None,
        };
        channels.iter().map(port).collect()
    };
    let (n, m) = (outputs.len(), inputs.len());
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: String::from("sindy"),
            dt: 0.1,
            outputs: ports(outputs),
            inputs: ports(inputs),
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
        body: Body::Equations(Arc::new(
            Equations::with_signals(terms, coefficients, n, m, signals, 0.1, 1).unwrap(),
        )),
        members: Members::default(),
        learning: None,
    }
}

/// Surge and yaw of a ship with a slow propeller.
fn ship() -> Model {
    model(
        &[("u", "m/s"), ("r", "rad/s")],
        &[("n", "rps"), ("delta", "rad"), ("P_f", "")],
        &[
            "1",
            "u",
            "r",
            "P_f",
            "u |u|",
            "lag(n, 1.5 s) |lag(n, 1.5 s)|",
            "u |u| sin(delta)",
            "r u(-0.5 s)",
            "r^2/u",
        ],
        &[
            &[0.0, -0.1, 0.0, 1.5e-7, -0.907_04, 2.0, 0.0, 0.0, 12.0],
            &[-0.01, 0.0, -1.0, 0.0, 0.0, 0.0, 123.456, -0.25, 0.0],
        ],
    )
}

/// A hydrofoil's drag in two modes.
fn hydrofoil() -> Model {
    let modes = ["u |u| below(u, 2.5, 12)", "u above(u, 2.5, 12)", "v/u", "ln(u)", "sgn(v)"];
    let row = [-0.3, -1e-9, 1e6, 1.0, -1.0];
    model(&[("u", "m/s"), ("v", "")], &[], &modes, &[&row, &[0.0; 5]])
}

#[test]
fn text_has_equations_signals_and_units() {
    assert_eq!(
        ship().equations().unwrap().equations_text(),
        [
            "du/dt = -0.1000 u + 1.500e-7 P_f - 0.9070 u |u| + 2.000 lag(n, 1.5 s) |lag(n, 1.5 s)| + 12.00 r^2/u",
            "dr/dt = -0.01000 - 1.000 r + 123.5 u |u| sin(delta) - 0.2500 r u(-0.5 s)",
            "d lag(n, 1.5 s)/dt = (n - lag(n, 1.5 s)) / 1.5 s",
            "u(-0.5 s) = u 5 samples ago",
        ]
    );
    assert_eq!(
        ship().equations().unwrap().units_text(),
        [
            "term                           du/dt        dr/dt",
            "1                              -            1/s^2",
            "u                              1/s          -",
            "r                              -            1/s",
            "P_f                            m/s^2/[P_f]  -",
            "u |u|                          1/m          -",
            "lag(n, 1.5 s) |lag(n, 1.5 s)|  m/s^2/rps^2  -",
            "u |u| sin(delta)               -            1/m^2",
            "r u(-0.5 s)                    -            1/m",
            "r^2/u                          m^2/s        -",
        ]
    );
    assert_eq!(
        hydrofoil().equations().unwrap().equations_text(),
        [
            "du/dt = 1.000e6 v/u + 1.000 ln(u) - 1.000 sgn(v) + (1 - s) [-0.3000 u |u|] + s [-1.000e-9 u]",
            "dv/dt = 0",
            "s = sigma(12.00 (u - 2.500)), with sigma(x) = 1 / (1 + exp(-x))",
        ]
    );
    let exact = ship().equations().unwrap().coefficients();
    assert_eq!((exact.len(), exact[2].value, exact[2].unit.as_str()), (9, -0.907_04, "1/m"));
}

/// Letters of gates avoid the names of channels; terms with two gates are written out.
#[test]
fn symbols_of_gates_are_unique() {
    let terms = ["s below(s, -1, 2)", "above(z, 0, 3)", "s above(s, 1, 2) above(z, 1, 2)"];
    let of = model(&[("s", ""), ("z", "")], &[], &terms, &[&[1.0, 0.0, 2.0], &[0.0, -4.0, 0.0]]);
    assert_eq!(
        of.equations().unwrap().equations_text(),
        [
            "ds/dt = 2.000 s above(s, 1, 2) above(z, 1, 2) + (1 - s1) [1.000 s]",
            "dz/dt = s2 [-4.000]",
            "s1 = sigma(2.000 (s + 1.000)), with sigma(x) = 1 / (1 + exp(-x))",
            "s2 = sigma(3.000 z)",
        ]
    );
    let of = model(&[("s", ""), ("z", "")], &[], &terms[..1], &[&[1.0], &[0.0]]);
    assert_eq!(of.equations().unwrap().equations_text()[0], "ds/dt = (1 - gate) [1.000 s]");
    assert_eq!(of.equations().unwrap().units_text()[1], "(1 - gate) s  1/s    -");
}

#[test]
fn latex_uses_the_usual_notation() {
    assert_eq!(
        ship().equations().unwrap().equations_latex(),
        r"\begin{align*}
  \dot{u} &= - 0.1000\,u + 1.500 \times 10^{-7}\,P_{\mathrm{f}} - 0.9070\,u\,\lvert u\rvert + 2.000\,\hat{n}\,\lvert \hat{n}\rvert + 12.00\,\frac{r^{2}}{u} \\
  \dot{r} &= - 0.01000 - 1.000\,r + 123.5\,u\,\lvert u\rvert\,\sin(\delta) - 0.2500\,r\,u(t - 0.5\,\mathrm{s}) \\
  1.5\,\mathrm{s}\,\dot{\hat{n}} &= n - \hat{n}
\end{align*}
"
    );
    assert_eq!(
        ship().equations().unwrap().units_latex(),
        "Time in seconds; $u$ in $\\mathrm{m}\\,\\mathrm{s}^{-1}$; $r$ in $\\mathrm{rad}\\,\\mathrm{s}^{-1}$; \
         $n$ in $\\mathrm{rps}$; $\\delta$ in $\\mathrm{rad}$; $P_{\\mathrm{f}}$ without a stated unit.\n"
    );
    assert_eq!(
        hydrofoil().equations().unwrap().equations_latex(),
        r"\begin{align*}
  \dot{u} &= 1.000 \times 10^{6}\,\frac{v}{u} + 1.000\,\ln(u) - 1.000\,\operatorname{sgn}(v) \\
  &\quad {} + \left(1 - s\right)\,\bigl[ - 0.3000\,u\,\lvert u\rvert \bigr] \\
  &\quad {} + s\,\bigl[ - 1.000 \times 10^{-9}\,u \bigr] \\
  \dot{v} &= 0 \\
  s &= \sigma(12.00(u - 2.500)) \\
  \sigma(x) &= \frac{1}{1 + e^{-x}}
\end{align*}
"
    );
}

#[test]
fn lag_states_have_separate_names_and_long_equations_are_wrapped() {
    let terms = ["lag(n, 1 s)^2", "lag(n, 2.5 s)", "u(-0.1 s)^3", "sin(n)^2", "1/u", "above(u, -1, 3)"];
    let of = model(&[("u", "")], &[("n", "")], &terms, &[&[1.0; 6]]);
    assert_eq!(
        of.equations().unwrap().equations_latex(),
        r"\begin{align*}
  \dot{u} &= 1.000\,\left(\hat{n}^{(1\,\mathrm{s})}\right)^{2} + 1.000\,\hat{n}^{(2.5\,\mathrm{s})} + 1.000\,\left(u(t - 0.1\,\mathrm{s})\right)^{3} + 1.000\,\sin^{2}(n) + 1.000\,\frac{1}{u} \\
  &\quad {} + s\,\bigl[ 1.000 \bigr] \\
  s &= \sigma(3.000(u + 1.000)) \\
  1\,\mathrm{s}\,\dot{\hat{n}}^{(1\,\mathrm{s})} &= n - \hat{n}^{(1\,\mathrm{s})} \\
  2.5\,\mathrm{s}\,\dot{\hat{n}}^{(2.5\,\mathrm{s})} &= n - \hat{n}^{(2.5\,\mathrm{s})} \\
  \sigma(x) &= \frac{1}{1 + e^{-x}}
\end{align*}
"
    );
}

#[test]
fn strange_channel_names_cannot_break_a_document() {
    let name = r"a}\end{align*}\input{x}%_$&#";
    let terms = vec![Term::monomial(&[0])];
    let of = made(&[(name, "m_{/s")], &[], terms, vec![1.0], Vec::new());
    assert_eq!(
        of.equations().unwrap().equations_latex(),
        r"\begin{align*}
  \dot{\text{a\}\textbackslash{}end\{align*\}\textbackslash{}input\{x\}\%}}_{\text{\$\&\#}} &= 1.000\,\text{a\}\textbackslash{}end\{align*\}\textbackslash{}input\{x\}\%}_{\text{\$\&\#}}
\end{align*}
"
    );
    assert!(
        of.equations().unwrap().units_latex().contains(r"in $\text{(m\_\{/s)}$"),
        "{}",
        of.equations().unwrap().units_latex()
    );
}

#[test]
fn the_jacobian_is_text_to_copy() {
    let jacobian = ship().equations().unwrap().jacobian_text();
    let text = |row: &[hydroid::model::JacobianEntry]| -> Vec<String> {
        row.iter().map(|entry| format!("{} [{}]", entry.text, entry.unit)).collect()
    };
    assert_eq!(
        text(&jacobian.A[0]),
        ["-0.1000000 - 1.814080 |u| - 12.00000 r^2/u/u [1/s]", "24.00000 r/u [m/s]"]
    );
    assert_eq!(
        text(&jacobian.B[1]),
        ["0 [1/s^2/rps]", "123.4560 u |u| cos(delta) [1/s^2]", "0 [1/s^2/[P_f]]"]
    );
    assert_eq!(jacobian.signals[0][0].text, "4.000000 |lag(n, 1.5 s)|");
    assert_eq!(jacobian.B[0][2].terms, [(1.5e-7, String::from("1"))]);
    let json = serde_json::to_value(&jacobian).unwrap();
    assert_eq!(json["A"][0][1]["terms"][0][0], 24.0);
    assert_eq!(json["B"][1][1]["variable"], "delta");
}

/// The text agrees with the compiled Jacobian.
#[test]
fn the_text_of_the_jacobian_means_its_value() {
    let of = ship();
    let motion = of.equations().unwrap();
    let equations = motion.equations();
    let names = of.equations().unwrap().variable_names();
    let values = [0.8, -0.3, 2.0, 0.4, 5.0, 1.7, 0.75];
    let compiled = Jacobian::new(equations).unwrap();
    let mut slots = vec![0.0; compiled.slots()];
    slots[1..=values.len()].copy_from_slice(&values);
    let mut expected = vec![0.0; 2 * values.len()];
    compiled.evaluate(&mut slots, &mut expected);
    let text = of.equations().unwrap().jacobian_text();
    for i in 0..2 {
        let row = text.A[i].iter().chain(&text.B[i]).chain(&text.signals[i]);
        for (j, entry) in row.enumerate() {
            assert_eq!(entry.variable, names[j]);
            let channels = &names[..5];
            let motion = of.equations().unwrap();
            let equations = motion.equations();
            let mut parser =
                ExpressionParser::new(channels, 2, 0.1).with_signals(equations.signals().to_vec());
            let sum: f64 = entry.terms.iter().map(|(c, t)| c * parser.term(t).unwrap().value(&values)).sum();
            assert!((sum - expected[i * values.len() + j]).abs() < 1e-12, "{entry:?}");
        }
    }
}

/// Checks balanced braces and dollars, and commands from names.
fn balanced(text: &str) -> Result<(), String> {
    let (mut depth, mut left, mut dollars) = (0i32, 0i32, 0);
    let mut rest = text.chars();
    while let Some(c) = rest.next() {
        match c {
            '\\' => {
                let next = rest.as_str();
                if next.starts_with("left") && !next.starts_with("leftarrow") {
                    left += 1;
                } else if next.starts_with("right") {
                    left -= 1;
                } else {
                    // Escaped characters are skipped.
                    if !next.starts_with(|c: char| c.is_ascii_alphabetic()) {
                        rest.next();
                    }
                }
            }
            '{' => depth += 1,
            '}' => depth -= 1,
            '$' => dollars += 1,
            '%' | '#' | '~' => return Err(format!("bare {c} in {text}")),
            _ => {}
        }
        if depth < 0 || left < 0 {
            return Err(format!("closed before it was opened: {text}"));
        }
    }
    if (depth, left, dollars % 2) == (0, 0, 0) { Ok(()) } else { Err(format!("not closed: {text}")) }
}

fn shape() -> impl Strategy<Value = Shape> {
    let real = || (-1e3..1e3f64).prop_map(Real);
    let gate = move || (real(), real()).prop_map(|(centre, slope)| Gate { centre, slope });
    prop_oneof![
        (1u8..5).prop_map(Shape::Power),
        Just(Shape::Abs),
        Just(Shape::Sign),
        Just(Shape::Sin),
        Just(Shape::Cos),
        Just(Shape::Reciprocal),
        Just(Shape::Log),
        gate().prop_map(Shape::Above),
        gate().prop_map(Shape::Below),
    ]
}

fn unit(text: &str) -> UnitProduct {
    UnitProduct::of_channel("x", text)
}

#[test]
fn units_of_channels_are_products_of_symbols() {
    for (text, expected) in [
        ("m/s", "m/s"),
        ("m/s^2", "m/s^2"),
        ("m^2/s^2", "m^2/s^2"),
        ("ms-1", "1/ms"),
        ("m s-1", "m/s"),
        ("N m", "N m"),
        ("N*m/s/s", "N m/s^2"),
        ("rad/s", "1/s"),
        ("1", "1"),
        ("1/s", "1/s"),
        ("", "[x]"),
        ("furlong/fortnight", "furlong/fortnight"),
        ("U|", "(U|)"),
        ("m//s", "(m//s)"),
        ("3 m", "(3 m)"),
        ("m^999999999999", "(m^999999999999)"),
    ] {
        assert_eq!(unit(text).to_string(), expected, "{text}");
    }
}

#[test]
fn products_of_units_cancel_and_keep_their_order() {
    assert_eq!(unit("kn").per_second().times(&unit("N"), -1).to_string(), "kn/s/N");
    assert_eq!(unit("m/s").per_second().times(&unit("m/s"), -2).to_string(), "1/m");
    assert_eq!(unit("m/s").per_second().times(&unit("m/s"), -1).to_string(), "1/s");
    assert_eq!(unit("").per_second().times(&unit(""), -1).to_string(), "1/s");
}

proptest! {
    #[test]
    fn latex_is_balanced_whatever_the_channels_are_called(
        names in prop::collection::vec("\\PC{0,8}|[a-z{}\\\\$%_^&#~]{0,8}", 3),
        unit in "\\PC{0,6}|[a-z/^{}\\\\$%0-9 -]{0,6}",
        factors in prop::collection::vec(prop::collection::vec((0u16..5, shape()), 0..4), 1..8),
        scale in -1e9..1e9f64,
    ) {
        let term = |factors: Vec<(u16, Shape)>| {
            Term::new(factors.into_iter().map(|(variable, shape)| Factor { variable, shape }).collect())
        };
        let terms: Vec<Term> = factors.into_iter().map(term).collect();
        let coefficients = (0..2 * terms.len()).map(|k| scale * (k as f64 - 1.0)).collect();
        let signals = vec![
            Signal::Lag { input: 2, time_constant_s: Real(1.25) },
            Signal::Past { variable: 0, samples: 3 },
        ];
        let outputs = [(names[0].as_str(), unit.as_str()), (names[1].as_str(), "")];
        let of = made(&outputs, &[(names[2].as_str(), "rad")], terms, coefficients, signals);
        let latex = of.equations().unwrap().equations_latex();
        balanced(&latex).map_err(TestCaseError::fail)?;
        prop_assert_eq!(latex.matches("\\begin{").count(), 1);
        prop_assert_eq!(latex.matches('&').count() - latex.matches("\\&").count(), latex.lines().count() - 2);
        balanced(&of.equations().unwrap().units_latex()).map_err(TestCaseError::fail)?;
        // The other forms do not panic on these names either.
        let _ = (of.equations().unwrap().equations_text(), of.equations().unwrap().units_text(), of.equations().unwrap().jacobian_text(), of.equations().unwrap().coefficients());
    }
}
