//! Tables in LaTeX.

use hydroid::model::Model;
use hydroid_core::craft::Craft;
use hydroid_export::coefficients::{CoefficientOptions, latex};

use super::{content, model, options, vessel};

fn with_speed(speed: f64) -> CoefficientOptions {
    CoefficientOptions { speed: Some(speed), ..CoefficientOptions::default() }
}

/// A cell as a number: `-1.160 \times 10^{-2}`, `-77.5 \pm 7.8`, `(-4.1 \pm 0.1) \times 10^{3}`.
pub(crate) fn number(cell: &str) -> f64 {
    let cell = cell.trim().trim_matches('$');
    let (mantissa, power) = cell.split_once(" \\times 10^{").unwrap_or((cell, "0}"));
    let value = mantissa.trim_start_matches('(').split(" \\pm").next().unwrap();
    value.parse::<f64>().unwrap() * 10_f64.powi(power.trim_end_matches('}').parse().unwrap())
}

/// A column of the row of a symbol.
pub(crate) fn cell(text: &str, symbol: &str, column: usize) -> String {
    let start = format!("  ${symbol}$ &");
    let row =
        text.lines().find(|line| line.starts_with(&start)).unwrap_or_else(|| panic!("{symbol}: {text}"));
    row.trim_end_matches("\\\\").split('&').nth(column).unwrap().trim().to_owned()
}

/// M. S. Chislett and J. Stroem-Tejsen (1965), Planar motion mechanism tests and full-scale steering and manoeuvring
/// predictions for a Mariner class vessel, as in `mariner.m` of MSS: derivatives in the prime system at 15 kn.
#[test]
fn the_mariner_has_the_published_derivatives() {
    let files = latex(&model(&vessel("vessels/mariner")), &options(), &with_speed(7.7175)).unwrap();
    let text = content(&files, "boat.tex");
    for (symbol, published) in [
        ("m", 798e-5),
        ("I_z", 39.2e-5),
        ("x_g", -0.023),
        ("X_{\\dot{u}}", -42e-5),
        ("Y_{\\dot{v}}", -748e-5),
        ("Y_{\\dot{r}}", -9.354e-5),
        ("N_{\\dot{r}}", -43.8e-5),
        ("Y_v(U)", -1160e-5),
        ("Y_r(U) - m U", -499e-5),
        ("N_v(U)", -264e-5),
        ("N_r(U) - m x_g U", -166e-5),
    ] {
        let found = number(&cell(&text, symbol, 3));
        assert!((found / published - 1.0).abs() < 2e-3, "{symbol}: {found} {published}");
    }
}

#[test]
fn the_prime_system_needs_length_and_speed() {
    let file = vessel("vessels/otter");
    let text = |options_of: &CoefficientOptions, file| {
        content(&latex(&model(file), &options(), options_of).unwrap(), "boat.tex")
    };
    let without = text(&CoefficientOptions::default(), &file);
    assert_eq!(cell(&without, "X_{u}", 3), "--");
    assert_ne!(cell(&without, "X_{\\dot{u}}", 3), "--");
    assert!(without.contains("need a stated speed.") && !without.contains("straight course"));
    let mut bare = file.clone();
    bare.craft.hull.size = None;
    bare.craft.hull.cross_flow = 0.0;
    let bare_text = text(&CoefficientOptions::default(), &bare);
    assert_eq!(cell(&bare_text, "m", 3), "--");
    assert!(bare_text.contains("needs a length"));
    let given = CoefficientOptions { length: Some(2.0), ..with_speed(1.5) };
    let (given, whole) = (text(&given, &bare), text(&with_speed(1.5), &file));
    for symbol in ["m", "X_{u}", "N_{r}", "N_{\\lvert r\\rvert r}"] {
        assert_eq!(cell(&given, symbol, 3), cell(&whole, symbol, 3), "{symbol}");
    }
    for (wrong, words) in [
        (with_speed(0.0), "speed is 0"),
        (with_speed(f64::NAN), "speed is NaN"),
        (CoefficientOptions { length: Some(-1.0), ..CoefficientOptions::default() }, "length is -1"),
        (
            CoefficientOptions { water_density: f64::INFINITY, ..CoefficientOptions::default() },
            "density of the water is inf",
        ),
    ] {
        let error = latex(&model(&file), &options(), &wrong).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("positive number"), "{error}");
    }
}

#[test]
fn estimates_have_their_standard_deviations() {
    let mut file = vessel("vessels/otter");
    for estimate in &mut file.estimate {
        let (_, value) = file.craft.parameters()[estimate.index].clone();
        estimate.deviation = Some(0.05 * value.abs());
    }
    // As a grey box that was written and read again.
    let file = hydroid::craft::parse(&file.text(), "boat.toml".as_ref()).unwrap();
    let text = content(&latex(&model(&file), &options(), &with_speed(1.5)).unwrap(), "boat.tex");
    assert_eq!(cell(&text, "X_{u}", 1), "$-77.5 \\pm 3.9$");
    assert_eq!(cell(&text, "I_z", 1), "$16.30 \\pm 0.82$");
    assert_eq!(cell(&text, "X_u(U)", 1), "$-77.5 \\pm 3.9$");
    assert!(!cell(&text, "m", 1).contains("\\pm"));
    // The starboard thruster has the numbers of the one to port, and their standard deviations.
    for side in ["port", "starboard"] {
        let line = text.lines().find(|line| line.contains(&format!("thruster.{side}.forward"))).unwrap();
        assert!(line.contains("0.01108 \\pm 0.00055"), "{line}");
    }
}

#[test]
fn a_built_in_vessel_has_a_table_that_names_what_it_lacks() {
    let model = Model::of_vessel(&Craft::hydrofoil(), 0.1).unwrap();
    let text = content(&latex(&model, &options(), &with_speed(2.0)).unwrap(), "boat.tex");
    assert!(text.contains("without the Munk moment") && text.contains("% Not in the tables: flying mode"));
    assert_eq!(number(&cell(&text, "N_{\\lvert r\\rvert r}", 1)), -414.4);
}
