use super::*;

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
