//! Figures: scales, clipping, decimation, and the drawn SVG.

use hydroid_report::figure::clip::{Frame, clip, dashes};
use hydroid_report::figure::scale::{Scale, Ticks};
use hydroid_report::figure::text::{fit, width};
use hydroid_report::figure::{
    Figure, Interval, Key, Line, Mark, Panel, Points, RangeRow, Sign, envelope, range_chart, steps,
};
use hydroid_report::style;

fn everything(values: &[f64]) -> Figure {
    let points: Vec<(f64, f64)> = values.iter().enumerate().map(|(k, v)| (k as f64, *v)).collect();
    let bars = points.iter().map(|p| (p.0, p.0 + 1.0, p.1)).collect();
    let band = points.iter().map(|p| (p.0, p.1 - 1.0, p.1 + 1.0)).collect();
    Figure::new("A \"title\" with <tags>", "time [s]")
        .key(Key::Line(style::MODEL_LINE), "model <b>")
        .key(Key::Area(style::MODEL), "area")
        .key(Key::Sign(Sign::Cross, style::ALARM), "sign")
        .panel(
            Panel::new("<b> [m/s]")
                .mark(Mark::Band { points: band, colour: style::MODEL, opacity: 0.2 })
                .mark(Mark::Line(Line::new(points.clone(), style::MODEL_LINE).labelled("model & co")))
                .mark(Mark::Line(Line::new(points.clone(), style::PERSISTENCE_LINE).labelled("persistence")))
                .mark(Mark::Verticals { at: vec![1.0, f64::NAN], stroke: style::MEASURED_LINE }),
        )
        .panel(
            Panel::new("count")
                .mark(Mark::Bars { bars, colour: style::MODEL })
                .mark(Mark::Level { at: 0.5, stroke: style::PERSISTENCE_LINE })
                .mark(Mark::Points(Points {
                    points,
                    sign: Sign::Ring,
                    colour: style::ALARM,
                    radius: 3.0,
                    label: Some("chosen".into()),
                })),
        )
}

#[test]
fn what_is_drawn_is_escaped_and_repeats() {
    let svg = everything(&[0.0, 1.0, f64::NAN, 2.0, 3.0]).svg().unwrap();
    assert!(svg.starts_with("<svg viewBox=\"0 0 4800 "));
    assert!(svg.ends_with("</svg>\n") || svg.ends_with("</svg>"), "{}", &svg[svg.len() - 20..]);
    assert!(svg.contains("aria-label=\"A &quot;title&quot; with &lt;tags&gt;\""), "{}", &svg[..200]);
    for text in ["&lt;b&gt; [m/s]", "model &amp; co", "persistence", "chosen", "time [s]"] {
        assert!(svg.contains(text), "{text}");
    }
    for text in ["<b>", "xmlns", "http", "NaN", "inf"] {
        assert!(!svg.contains(text), "{text}");
    }
    assert_eq!(svg, everything(&[0.0, 1.0, f64::NAN, 2.0, 3.0]).svg().unwrap());
}

#[test]
fn degenerate_data_are_drawn_as_far_as_they_go() {
    let bad = f64::NAN;
    for values in [
        &[][..],
        &[bad],
        &[bad, bad],
        &[1.0],
        &[0.0, 0.0],
        &[f64::INFINITY, 1.0],
        &[-1e308, 1e308],
        &[1e-320],
    ] {
        let svg = everything(values).svg().unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf\""), "{values:?}");
    }
    assert!(Figure::new("empty", "x").svg().unwrap().contains("svg"));
    assert!(Figure::new("empty", "x").panel(Panel::new("y")).svg().unwrap().contains("no data"));
    let nothing = Interval { low: bad, high: bad, mean: bad };
    let row = RangeRow { name: "u".into(), intervals: vec![nothing; 3] };
    let svg = range_chart("ranges", &[("training", style::MODEL)], &[row]).unwrap();
    assert!(svg.contains("does not vary"));
    assert!(range_chart("ranges", &[], &[]).is_ok());
}

#[test]
fn labels_of_lines_are_moved_apart_and_stay_in_the_frame() {
    let mut panel = Panel::new("y").height(100.0).range(0.0, 100.0);
    for (label, value) in [("first", 50.0), ("second", 48.0), ("third", 49.0), ("alone", 90.0)] {
        let line = Line::new(vec![(0.0, value), (1.0, value)], style::MODEL_LINE);
        panel = panel.mark(Mark::Line(line.labelled(label)));
    }
    let svg = Figure::new("labels", "x").panel(panel).svg().unwrap();
    let height = |label: &str| -> f64 {
        let end = svg.find(&format!(">{label}<")).unwrap();
        let tag = &svg[svg[..end].rfind("<text").unwrap()..end];
        tag.split(" y=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    // In tenths of a pixel below the label of the lone line, which stays beside its end.
    let below = ["first", "third", "second"].map(|label| height(label) - height("alone"));
    assert_eq!(below, [250.0, 410.0, 570.0]);
}

fn labels(ticks: &Ticks) -> Vec<String> {
    ticks.values.iter().map(|v| ticks.label(*v)).collect()
}

#[test]
fn ticks_are_round_and_written_shortly() {
    let ticks =
        |low: f64, high: f64, wanted, most| labels(&Scale::new((low, high), 0.0, 1.0).ticks(wanted, most));
    assert_eq!(ticks(-0.42, 0.41, 4, 9), ["−0.4", "−0.2", "0.0", "0.2", "0.4"]);
    assert_eq!(ticks(-0.0985, -0.005, 2, 3), ["−0.075", "−0.050", "−0.025"]);
    assert_eq!(ticks(0.0, 5.0, 5, 9), ["0", "1", "2", "3", "4", "5"]);
    assert_eq!(ticks(1400.0, 1600.0, 2, 9), ["1400", "1500", "1600"]);
    // The axis label states the power of ten of tiny and huge values.
    let tiny = Scale::new((-2e-5, 2e-5), 0.0, 1.0).ticks(4, 9);
    assert_eq!((tiny.factor().as_str(), labels(&tiny)[0].as_str()), ("×10⁻⁶", "−20"));
    assert_eq!(Scale::new((0.0, 3e9), 0.0, 1.0).ticks(3, 9).factor(), "×10⁹");
}

#[test]
fn labels_of_a_logarithmic_axis_are_the_values() {
    let decades = |low: f64, high: f64| Scale::new((low, high), 0.0, 1.0).decades(8);
    assert_eq!(labels(&decades(-3.2, 0.5)), ["0.001", "0.01", "0.1", "1"]);
    assert_eq!(labels(&decades(-1.5, -0.2)), ["0.05", "0.1", "0.2", "0.5"]);
    assert_eq!(labels(&decades(-7.1, -4.9)), ["1e-7", "1e-6", "1e-5"]);
    assert!(labels(&decades(0.31, 0.39)).len() >= 2);
    let ticks = decades(0.1, 0.2);
    assert_eq!([1.4, 12.0, 0.00034].map(|x: f64| ticks.label(x.log10())), ["1.4", "12", "0.00034"]);
    assert!((2..=9).contains(&labels(&decades(-300.0, 300.0)).len()));
}

#[test]
fn degenerate_ranges_have_a_scale() {
    for range in [
        (0.0, 0.0),
        (3.0, 3.0),
        (f64::NAN, 1.0),
        (0.0, f64::INFINITY),
        (-1e308, 1e308),
        (2.0, 1.0),
        (0.0, 1e-320),
        (1e9, 1e9 + 1e-7),
    ] {
        let scale = Scale::new(range, 100.0, 0.0);
        assert!(scale.place(0.5).is_finite(), "{range:?}");
        let ticks = scale.ticks(5, 9);
        assert!((1..=20).contains(&ticks.values.len()), "{range:?}: {ticks:?}");
    }
    let scale = Scale::new((0.0, 1.0), 0.0, 1.0);
    assert!(scale.place(f64::NAN).is_nan() && scale.place(1e300).is_finite());
}

#[test]
fn lines_are_clipped_at_the_frame_and_gaps_remain() {
    let frame = Frame { left: 0.0, top: 0.0, right: 10.0, bottom: 10.0 };
    let parts = clip(&[(0.0, 5.0), (5.0, 5.0), (5.0, 25.0), (7.0, 25.0), (7.0, 5.0)], frame);
    assert_eq!(parts, [vec![(0.0, 5.0), (5.0, 5.0), (5.0, 10.0)], vec![(7.0, 10.0), (7.0, 5.0)]]);
    // A sample between two gaps is kept.
    let gap = (1.0, f64::NAN);
    let parts = clip(&[gap, (1.0, 1.0), (2.0, 1.0), gap, (3.0, 3.0), gap], frame);
    assert_eq!(parts, [vec![(1.0, 1.0), (2.0, 1.0)], vec![(3.0, 3.0)]]);
    assert!(clip(&[(f64::NAN, 1.0), (20.0, 20.0)], frame).is_empty());
}

#[test]
fn dashes_cover_their_share_of_the_line() {
    let parts = dashes(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)], 3.0, 1.0);
    let pairs = parts.iter().flat_map(|part| part.windows(2));
    let length: f64 = pairs.map(|p| (p[1].0 - p[0].0).hypot(p[1].1 - p[0].1)).sum();
    assert!((length - 15.0).abs() < 1e-9, "{length}");
}

#[test]
fn the_envelope_keeps_extremes_and_gaps() {
    let value = |k: usize| match k {
        500 => 9.0,
        700..800 => f64::NAN,
        _ => (k as f64 * 0.01).sin(),
    };
    let thin = envelope((0..1000).map(|k| (k as f64, value(k))), 50);
    assert!(thin.len() <= 110, "{}", thin.len());
    assert!(thin.contains(&(500.0, 9.0)));
    assert!(thin.iter().any(|p| p.1.is_nan()));
    assert!(thin.windows(2).all(|p| p[0].0 <= p[1].0));
    assert_eq!(envelope((0..3).map(|k| (f64::from(k), 0.0)), 50).len(), 3);
    assert!(envelope(std::iter::empty(), 0).is_empty());
}

#[test]
fn held_values_are_stairs() {
    let stairs = steps([1.0, 1.0, 2.0].into_iter(), 0.0, 0.5);
    assert_eq!(stairs, [(0.0, 1.0), (1.0, 1.0), (1.0, 2.0), (1.5, 2.0)]);
    assert!(steps(std::iter::empty(), 0.0, 1.0).is_empty());
}

#[test]
fn long_texts_are_shortened() {
    assert_eq!(fit("surge", 14.0, 100.0), "surge");
    let short = fit("a very long name of a channel", 14.0, 100.0);
    assert!(short.ends_with('…') && width(&short, 14.0) <= 100.0, "{short}");
    assert_eq!(fit("surge", 14.0, 0.0), "…");
}
