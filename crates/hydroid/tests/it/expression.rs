//! Terms and constraints as text.

use hydroid::sindy::expression::{Coefficient, Constraint, ExpressionParser, Relation};
use hydroid_core::model::sparse::{Factor, Gate, Real, Shape, Signal, Term};
use proptest::prelude::*;

const SHIP: [&str; 6] = ["u", "v", "r", "n", "delta", "wind_x"];

fn ship() -> ExpressionParser {
    ExpressionParser::new(SHIP, 3, 0.1)
}

fn message(text: &str) -> String {
    ship().term(text).unwrap_err().to_string()
}

#[test]
fn terms_are_read_as_people_write_them() {
    let gate = Gate { centre: Real(2.5), slope: Real(12.0) };
    for (text, term) in [
        ("1", Term::constant()),
        ("u", Term::monomial(&[0])),
        ("u^2", Term::monomial(&[0, 0])),
        (" u  v ", Term::monomial(&[0, 1])),
        ("u*v", Term::monomial(&[0, 1])),
        ("u |u|", Term::signed_square(0, 0)),
        ("|r| v", Term::signed_square(1, 2)),
        ("sin(delta)", Term::of(4, Shape::Sin)),
        ("sin( delta )^2", Term::of(4, Shape::Sin).times(&Term::of(4, Shape::Sin))),
        ("cos(delta)", Term::of(4, Shape::Cos)),
        ("ln(u)", Term::of(0, Shape::Log)),
        ("sgn(u)", Term::of(0, Shape::Sign)),
        ("r/u", Term::monomial(&[2]).times(&Term::of(0, Shape::Reciprocal))),
        ("v r / u", Term::monomial(&[1, 2]).times(&Term::of(0, Shape::Reciprocal))),
        ("1/u", Term::of(0, Shape::Reciprocal)),
        ("1 / u^2", Term::of(0, Shape::Reciprocal).times(&Term::of(0, Shape::Reciprocal))),
        ("above(u, 2.5, 12)", Term::of(0, Shape::Above(gate))),
        ("v below(u,2.5,12.0)", Term::monomial(&[1]).times(&Term::of(0, Shape::Below(gate)))),
        ("wind_x", Term::monomial(&[5])),
    ] {
        assert_eq!(ship().term(text), Ok(term), "{text}");
    }
}

#[test]
fn signals_are_collected_once_and_only_from_valid_terms() {
    let mut parser = ship();
    assert_eq!(parser.term("lag(n, 1.5 s) |lag(n, 1.5 s)|"), Ok(Term::signed_square(6, 6)));
    assert_eq!(parser.term("u(-0.5 s) v"), Ok(Term::monomial(&[1, 7])));
    assert_eq!(parser.term("lag(n,1.5s)"), Ok(Term::monomial(&[6])));
    assert!(parser.term("lag(n, 3 s) nonsense").is_err());
    assert_eq!(
        parser.signals(),
        [Signal::Lag { input: 3, time_constant_s: Real(1.5) }, Signal::Past { variable: 0, samples: 5 }]
    );
    assert_eq!(parser.names()[6..], ["lag(n, 1.5 s)", "u(-0.5 s)"]);
}

#[test]
fn names_that_are_words_or_hold_strange_characters_are_found() {
    let names = ["sin", "lag", "2nd", "a.b", "a", "speed [kn]", "Geschw. ü", "-x"];
    let mut parser = ExpressionParser::new(names, 4, 0.1);
    for (text, variables) in [
        ("sin", vec![0]),
        ("sin(-0.1 s)", vec![8]),
        ("lag 2nd", vec![1, 2]),
        ("a.b a", vec![3, 4]),
        ("speed [kn] Geschw. ü", vec![5, 6]),
        ("a -x", vec![4, 7]),
    ] {
        assert_eq!(parser.term(text), Ok(Term::monomial(&variables)), "{text}");
    }
    assert_eq!(parser.term("sin(sin)"), Ok(Term::of(0, Shape::Sin)));
}

#[test]
fn mistakes_are_reported_with_their_place() {
    for (text, expected) in [
        ("", "'', character 1: expected a factor such as u, u^2, |u| or sin(delta), found the end"),
        ("u * * v", "'u * * v', character 5: expected a factor such as u, u^2, |u| or sin(delta), found '*'"),
        ("2 u", "'2 u', character 1: expected a factor such as u, u^2, |u| or sin(delta), found '2'"),
        ("u^0", "'u^0', character 3: expected an exponent from 1 to 255, found '0'"),
        ("|u", "'|u', character 3: expected '|', found the end"),
        ("u + v", "'u + v', character 3: expected the end, or one more factor, found '+'"),
        (
            "sinus(u)",
            "'sinus(u)', character 1: there is no function or channel 'sinus', did you mean 'sin'? There are u, v, r, n, delta, wind_x",
        ),
        (
            "Delta",
            "'Delta', character 1: there is no channel 'Delta', did you mean 'delta'? There are u, v, r, n, delta, wind_x",
        ),
        ("lag(u, 1 s)", "'lag(u, 1 s)', character 5: 'u' is an output; only inputs have lag states"),
        (
            "lag(n, 0 s)",
            "'lag(n, 0 s)', character 8: expected a time constant from 0.001 to 1000000 s, found '0'",
        ),
        ("lag(n, 2)", "'lag(n, 2)', character 9: expected 's', for seconds, found ')'"),
        (
            "u(-0.25 s)",
            "'u(-0.25 s)', character 3: the delay of a past value is a multiple of the sample time of 0.1 s, at least one: write it as a negative time",
        ),
        (
            "above(u, x, 1)",
            "'above(u, x, 1)', character 10: expected the centre of the gate, a number, found 'x'",
        ),
    ] {
        assert_eq!(message(text), expected);
    }
}

#[test]
fn constraints_are_linear_in_coefficients() {
    let drag = Coefficient { output: 0, term: Term::signed_square(0, 0) };
    let (coriolis, centripetal) = (
        Coefficient { output: 1, term: Term::monomial(&[0, 2]) },
        Coefficient { output: 0, term: Term::monomial(&[1, 2]) },
    );
    let mut parser = ship();
    let mut read = |text: &str| parser.constraint(text).unwrap();
    assert_eq!(
        read("u: u |u| <= 0"),
        Constraint { sum: vec![(1.0, drag.clone())], relation: Relation::AtMost, bound: 0.0 }
    );
    assert_eq!(
        read("v: u r = u: v r"),
        Constraint {
            sum: vec![(1.0, coriolis.clone()), (-1.0, centripetal.clone())],
            relation: Relation::Equal,
            bound: 0.0
        }
    );
    let long = read("2 * v: u r - u: v r >= 1.5 - 0.5 u: v r + -1");
    assert_eq!(long.sum, [(2.0, coriolis), (-0.5, centripetal)]);
    assert_eq!((long.relation, long.bound), (Relation::AtLeast, 0.5));
    assert_eq!(read("0 ≥ u: u |u|").sum, [(-1.0, drag)]);
    assert_eq!(long.text(&SHIP), "2 v: u r - 0.5 u: v r >= 0.5");
    for (text, expected) in [
        ("u |u| <= 0", "character 1: expected 'u:' and a term of its equation"),
        ("w: u <= 0", "character 1: there is no output 'w'. There are u, v, r"),
        ("n: u <= 0", "there is no output 'n'"),
        ("u: u |u|", "expected one more factor, or <=, >= or =, found the end"),
        ("u: u < 0", "expected one more factor, or <=, >= or =, found '<'"),
        ("1 <= 2", "no coefficient is left"),
        ("u: u = u: u", "no coefficient is left"),
        ("u: u <= ", "expected a number, or a coefficient such as u: u |u|, found the end"),
        ("u: u <= 3 x", "there is no output 'x'"),
    ] {
        let message = ship().constraint(text).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

fn real() -> impl Strategy<Value = Real> {
    prop_oneof![-10.0..10.0f64, any::<f64>().prop_filter("finite", |x| x.is_finite())].prop_map(Real)
}

fn shape() -> impl Strategy<Value = Shape> {
    let gate = || (real(), real()).prop_map(|(centre, slope)| Gate { centre, slope });
    prop_oneof![
        (1u8..=255).prop_map(Shape::Power),
        Just(Shape::Power(1)),
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

fn signal() -> impl Strategy<Value = Signal> {
    prop_oneof![
        (3u16..6, 1u32..1_000_000)
            .prop_map(|(input, ms)| Signal::Lag { input, time_constant_s: Real(f64::from(ms) / 1e3) }),
        (0u16..6, 1u16..=u16::MAX).prop_map(|(variable, samples)| Signal::Past { variable, samples }),
    ]
}

fn term() -> impl Strategy<Value = Term> {
    let factor = (0u16..8, shape()).prop_map(|(variable, shape)| Factor { variable, shape });
    prop::collection::vec(factor, 0..6).prop_map(Term::new)
}

/// Distinct names as in the headers of logs.
fn channels() -> impl Strategy<Value = Vec<String>> {
    prop::collection::hash_set("[a-zA-Zäψ_][a-zA-Z0-9_.]{0,6}", 6).prop_map(|set| set.into_iter().collect())
}

proptest! {
    #[test]
    fn printed_expressions_are_read_back(
        channels in channels(),
        signals in prop::collection::hash_set(signal(), 2),
        term in term(),
        dt in prop_oneof![Just(0.1), Just(1.0 / 3.0), 0.002..5.0f64],
        output in 0usize..3,
        factor in prop_oneof![Just(1.0), -1e3..1e3f64].prop_filter("not 0", |f| *f != 0.0),
        bound in -1e3..1e3f64,
    ) {
        let mut parser = ExpressionParser::new(channels, 3, dt).with_signals(signals.into_iter().collect());
        let names = parser.names();
        let before = parser.clone();
        prop_assert_eq!(&parser.term(&term.name(&names)).map_err(|e| TestCaseError::fail(e.to_string()))?, &term);
        let sum = vec![(factor, Coefficient { output, term })];
        let constraint = Constraint { sum, relation: Relation::AtMost, bound };
        let read = parser.constraint(&constraint.text(&names));
        prop_assert_eq!(read.map_err(|e| TestCaseError::fail(e.to_string()))?, constraint);
        prop_assert_eq!(parser, before);
    }

    #[test]
    fn no_text_panics(text in "\\PC{0,40}", pieces in prop::collection::vec(0usize..24, 0..12)) {
        let known = [
            "u", "v", "n", "delta", "1", "2.5", " ", "^", "2", "|", "(", ")", ",", "-", "/", "*", "sin(", "above(",
            "lag(", " s", "u:", "<=", "=", "1e999",
        ];
        let made: String = pieces.into_iter().map(|i| known[i]).collect();
        for text in [text, made] {
            let mut parser = ship();
            let term = parser.term(&text);
            if let Ok(term) = term {
                // A parsed term can be printed and parsed again.
                prop_assert_eq!(parser.term(&term.name(&parser.names())), Ok(term));
            }
            if let Ok(constraint) = parser.constraint(&text) {
                let text = constraint.text(&parser.names());
                prop_assert_eq!(parser.constraint(&text), Ok(constraint));
            }
        }
    }
}
