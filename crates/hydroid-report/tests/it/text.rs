//! Numbers, units, sentences, symbols and statistics of the pages.

use hydroid::log::Note;
use hydroid::sindy::{Library, Optimizer, RegressionForm, Trial};
use hydroid_report::formula::variable;
use hydroid_report::front::{front, stairs};
use hydroid_report::number::{
    count, duration, fixed, magnitude, plain, ratio, seconds_text, text, unit, with_unit,
};
use hydroid_report::page::notes;
use hydroid_report::residuals::Residuals;

#[test]
fn numbers_are_rounded_with_typographic_signs() {
    assert_eq!(text(-0.012_341, 4), "−0.01234");
    assert_eq!(text(-0.000_012_345, 3), "−1.23 × 10⁻⁵");
    assert_eq!(text(99_996.0, 4), "1.000 × 10⁵");
    assert_eq!(text(1234.5, 3), "1230");
    assert_eq!(text(0.0, 3), "0");
    assert_eq!(text(f64::NAN, 3), "–");
    assert_eq!(text(f64::NEG_INFINITY, 3), "−∞");
    assert_eq!(plain(-0.000_012_34, 4), "-1.234e-5");
    assert_eq!(magnitude(-2.5e-7, 2).0, "2.5 × 10<sup>−7</sup>");
    assert_eq!(fixed(-0.001, 2), "0.00");
    assert_eq!(ratio(0.296), "0.30");
    assert_eq!(ratio(1e300), "1.00 × 10³⁰⁰");
    assert_eq!(count(14_101), "14\u{202f}101");
    assert_eq!(count(4963), "4963");
}

#[test]
fn units_have_superscripts_and_durations_a_suitable_unit() {
    assert_eq!(with_unit("a", "m^2/s^-10"), "a [m²/s⁻¹⁰]");
    assert_eq!(with_unit("a", ""), "a");
    assert_eq!(unit("x^^y^"), "x^^y^");
    let times = [5.0, 64.35, 705.0, 36_000.0, f64::NAN].map(duration);
    assert_eq!(times, ["5\u{a0}s", "64\u{a0}s", "11.8\u{a0}min", "10.0\u{a0}h", "–"]);
    assert_eq!(seconds_text(0.05), "0.05");
}

#[test]
fn messages_become_sentences() {
    for (message, sentence) in [
        ("two runs: -0.5 to 1", "Two runs: −0.5 to 1."),
        ("a_1.csv: cut (see --dt and -c)", "a_1.csv: cut (see --dt and -c)."),
        ("'u' is late!", "'u' is late!"),
        ("`u` and `v` differ", "‘u’ and ‘v’ differ."),
        ("/home/me/a.csv: a step of 0.10003000000000029 s", "a.csv: a step of 0.10003 s."),
        ("'x [m/s]' is 12345678 m/s.", "'x [m/s]' is 12345678 m/s."),
        ("", ""),
    ] {
        let list = notes(&[&Note::info(message)]).0;
        assert_eq!(list, format!("<ul class=\"notes\"><li>{sentence}</li></ul>"));
    }
}

#[test]
fn names_become_symbols() {
    for (name, symbol) in [
        ("u", "<i>u</i>"),
        ("wind_x", "wind<sub>x</sub>"),
        ("u5_bow", "<i>u</i><sub>5 bow</sub>"),
        ("<b>", "&lt;b&gt;"),
        ("delta_2", "<i>δ</i><sub>2</sub>"),
        ("lag(n_c, 1 s)", "lag(n_c, 1 s)"),
        ("_", "<i>_</i>"),
        ("", ""),
    ] {
        assert_eq!(variable(name).0, format!("<span class=\"v\">{symbol}</span>"));
    }
}

#[test]
fn the_pareto_front_falls() {
    let trial = |(terms, score)| Trial {
        structure: Library::polynomial(1).into(),
        regression: RegressionForm::Central,
        optimizer: Optimizer::Stepwise(0.01),
        ridge: 0.0,
        terms,
        score,
        validation: score,
        training: None,
        diverged: 0,
        finalist: true,
    };
    let trials = [(5, Some(0.3)), (2, Some(0.9)), (2, Some(0.7)), (3, Some(0.8)), (9, Some(0.3)), (1, None)]
        .map(trial);
    // Scored on few origins only.
    let trials = [&trials[..], &[Trial { finalist: false, ..trial((4, Some(0.1))) }]].concat();
    let front = front(&trials);
    assert_eq!(front, [(2.0, 0.7), (5.0, 0.3)]);
    assert_eq!(stairs(&front, 10.0), [(2.0, 0.7), (5.0, 0.7), (5.0, 0.3), (10.0, 0.3)]);
}

#[test]
fn statistics_of_residuals_skip_gaps_and_need_variation() {
    let mut run: Vec<f64> = (0..400).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
    run[100] = f64::NAN;
    let residuals = Residuals::of(&[&run]).unwrap();
    assert!((residuals.correlation[0] + 1.0).abs() < 0.01 && (residuals.correlation[1] - 1.0).abs() < 0.01);
    assert_eq!(residuals.count, 399);
    assert!((residuals.bars.iter().sum::<f64>() - 100.0).abs() < 1e-9);
    let huge = [f64::MAX, f64::MIN].repeat(10);
    for runs in [&[][..], &[&[1.0; 100][..]], &[&[f64::NAN; 100]], &[&huge]] {
        assert!(Residuals::of(runs).is_none());
    }
}
