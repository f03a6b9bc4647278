//! Libraries: terms, order, size, and text form.

use std::collections::HashSet;

use hydroid::log::Channel;
use hydroid::sindy::{Family, Library, VariableKind, Variables};
use hydroid_core::model::sparse::{Shape, Term};

fn text(library: &Library, variables: &Variables, names: &[&str]) -> String {
    library.terms(variables).iter().map(|t| t.name(names)).collect::<Vec<_>>().join(", ")
}

/// A ship: u, v, r; n, delta, wind.
fn ship() -> (Variables, [&'static str; 7]) {
    let channel = |name: &str, unit: &str| Channel::new(name, unit);
    let outputs = [channel("u", "m/s"), channel("v", "m/s"), channel("r", "rad/s")];
    let inputs = [
        channel("n", "rps"),
        channel("delta", "rad"),
        channel("wind_x", "m^2/s^2"),
        channel("wind_y", "m^2/s^2"),
    ];
    (Variables::of_channels(&outputs, &inputs), ["u", "v", "r", "n", "delta", "wind_x", "wind_y"])
}

fn all_families() -> Vec<Family> {
    vec![
        Family::Constant,
        Family::Polynomial { degree: 3 },
        Family::SignedSquares,
        Family::SignedProducts,
        Family::Marine,
        Family::MarineCubic,
        Family::Trigonometric,
        Family::InputsTimesOutputs,
        Family::Rational,
        Family::Listed(vec![Term::constant(), Term::of(0, Shape::Log), Term::monomial(&[0, 1])]),
    ]
}

#[test]
fn order_is_that_of_pysindy() {
    assert_eq!(
        text(&Library::polynomial(2).with(Family::SignedSquares), &Variables::plain(3, 0), &["x", "y", "z"]),
        "1, x, y, z, x |x|, y |y|, z |z|, x^2, x y, x z, y^2, y z, z^2"
    );
    assert_eq!(
        text(&Library::polynomial(3).without_constant(), &Variables::plain(1, 1), &["x", "c"]),
        "x, c, x^2, x c, c^2, x^3, x^2 c, x c^2, c^3"
    );
}

#[test]
fn marine_has_the_terms_of_the_literature() {
    let (variables, names) = ship();
    assert_eq!(
        text(&Library::marine(), &variables, &names),
        "1, u, v, r, n, sin(delta), wind_x, wind_y, u |u|, v |v|, r |r|, n |n|, u |n|, v |r|, |v| r, \
         u^2, u v, u r, u n, u sin(delta), v^2, v r, r^2, u |u| n, u |u| sin(delta), n |n| sin(delta)"
    );
    let cubic = text(&Library::new(vec![Family::MarineCubic]), &variables, &names);
    for term in ["u^3", "v^2 r", "v sin(delta)", "v r sin(delta)", "v sin(delta) sin(delta)"] {
        assert!(cubic.split(", ").any(|t| t == term), "{term} in {cubic}");
    }
    // Without a surge speed, every output replaces it.
    assert_eq!(
        text(&Library::marine().without_constant(), &Variables::plain(2, 1), &["a", "b", "c"]),
        "a, b, c, a |a|, b |b|, c |c|, a |b|, |a| b, a |c|, b |c|, a^2, a b, a c, b^2, b c, a |a| c, b |b| c"
    );
}

#[test]
fn the_other_families_have_their_terms() {
    let (variables, names) = ship();
    let of = |family: Family| text(&Library::new(vec![family]), &variables, &names);
    assert_eq!(of(Family::Rational), "v/u, r/u, v^2/u, v r/u, r^2/u");
    assert_eq!(of(Family::SignedProducts), "u |v|, |u| v, u |r|, |u| r, v |r|, |v| r");
    assert_eq!(
        of(Family::Trigonometric),
        "sin(delta), cos(delta), u sin(delta), u cos(delta), v sin(delta), v cos(delta), r sin(delta), r cos(delta)"
    );
    assert!(of(Family::InputsTimesOutputs).starts_with("n, delta, wind_x, wind_y, u n, u delta"));
}

#[test]
fn number_of_monomials_is_the_binomial_coefficient() {
    for (variables, degree, count) in [(6, 2, 28), (8, 3, 165), (5, 0, 1), (1, 4, 5), (0, 3, 1)] {
        assert_eq!(Library::polynomial(degree).terms(&Variables::plain(variables, 0)).len(), count);
    }
}

/// Every pair of families, and all of them, over few and many variables.
#[test]
fn counting_is_exact_and_the_order_of_families_has_no_meaning() {
    let all = all_families();
    let (ship, _) = ship();
    for variables in [Variables::default(), Variables::plain(1, 0), Variables::plain(2, 2), ship] {
        let check = |families: Vec<Family>| {
            let library = Library::new(families.clone());
            let terms = library.terms(&variables);
            assert_eq!(library.count(&variables), terms.len(), "{library}");
            let distinct: HashSet<&Term> = terms.iter().collect();
            assert_eq!(distinct.len(), terms.len(), "{library}");
            let back = Library::new(families.into_iter().rev().collect());
            assert_eq!(back.terms(&variables), terms, "{library}");
        };
        check(all.clone());
        for a in &all {
            check(vec![a.clone()]);
            for b in &all {
                check(vec![a.clone(), b.clone()]);
            }
        }
    }
    assert_eq!(Library::polynomial(255).count(&Variables::plain(usize::from(u16::MAX), 0)), usize::MAX);
    // A count of billions of terms is immediate.
    assert!(Library::new(vec![Family::SignedProducts]).count(&Variables::plain(60_000, 0)) > 3_000_000_000);
}

#[test]
fn names_are_short_and_read_back() {
    let mut squares = Library::polynomial(2).with(Family::SignedSquares);
    assert_eq!(squares.to_string(), "degree 2 + x|x|");
    squares = squares.without_constant();
    assert_eq!(squares.to_string(), "degree 2 + x|x|, no constant");
    assert_eq!(Library::marine().to_string(), "marine");
    assert_eq!(Library::listed(vec![Term::constant()]).to_string(), "1 listed term");
    for text in [
        "degree 1",
        "marine cubic + rational",
        "degree 2 + x|x| + x|y| + trigonometric + inputs x outputs, no constant",
        "constant",
    ] {
        assert_eq!(text.parse::<Library>().unwrap().to_string(), text);
    }
    assert_eq!("Marine-Cubic+rational".parse::<Library>().unwrap().to_string(), "marine cubic + rational");
    assert_eq!("polynomial 3".parse::<Library>().unwrap(), "degree3".parse().unwrap());
    let wrong = "marin".parse::<Library>().unwrap_err();
    assert!(wrong.to_string().contains("did you mean 'marine'?"), "{wrong}");
    assert!("".parse::<Library>().is_err() && "marine, with salt".parse::<Library>().is_err());
    assert!("degree 999".parse::<Library>().is_err());
}

#[test]
fn a_library_is_read_from_a_file() {
    let library = Library::new(all_families());
    let json = serde_json::to_string(&library).unwrap();
    assert_eq!(serde_json::from_str::<Library>(&json).unwrap(), library);
    assert_eq!(
        serde_json::to_string(&Library::polynomial(2).with(Family::Marine)).unwrap(),
        r#"["constant",{"polynomial":{"degree":2}},"marine"]"#
    );
}

#[test]
fn kinds_of_variables_follow_units_and_names() {
    let channel = |name: &str, unit: &str| Channel::new(name, unit);
    let outputs = [channel("v", "m/s"), channel("u", "m/s")];
    let inputs = [
        channel("n", "rps"),
        channel("delta", "rad"),
        channel("wind_x", "m^2/s^2"),
        channel("wind_y", "m/s"),
    ];
    let variables = Variables::of_channels(&outputs, &inputs);
    assert_eq!(variables.surge(), Some(1));
    let kinds: Vec<VariableKind> = variables.inputs().map(|(_, kind)| kind).collect();
    assert_eq!(kinds, [VariableKind::Plain, VariableKind::Angle, VariableKind::Wind, VariableKind::Plain]);
    assert_eq!(variables.inputs().next(), Some((2, VariableKind::Plain)));
    assert_eq!(Variables::plain(2, 1).surge(), None);
    assert_eq!(Variables::plain(3, 1).surge(), Some(0));
}
