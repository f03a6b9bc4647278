//! Text forms of channels, wind, selections and input delays.

use hydroid::log::{ChannelSpec, InputDelay, Selection, Wind};
use proptest::prelude::*;

fn spec(text: &str) -> ChannelSpec {
    text.parse().unwrap()
}

#[test]
fn specifications_have_name_column_unit_and_scale() {
    assert_eq!(spec("u"), ChannelSpec::named("u"));
    assert_eq!(spec(" u = SOG "), ChannelSpec::renamed("u", "SOG"));
    assert_eq!(
        spec("u=SOG [kn]"),
        ChannelSpec { unit: Some("kn".into()), ..ChannelSpec::renamed("u", "SOG") }
    );
    assert_eq!(
        spec("n=shaft speed [rpm] * 0.01"),
        ChannelSpec { unit: Some("rpm".into()), scale: 0.01, ..ChannelSpec::renamed("n", "shaft speed") }
    );
    assert_eq!(spec("u [m/s]"), ChannelSpec { unit: Some("m/s".into()), ..ChannelSpec::named("u") });
    assert_eq!(spec("F=a*b"), ChannelSpec::renamed("F", "a*b"));
    assert_eq!(spec("u=x * -1").scale, -1.0);
}

#[test]
fn a_specification_has_an_offset() {
    let offset =
        |offset: f64, scale: f64| ChannelSpec { offset, scale, ..ChannelSpec::renamed("L", "thr_left") };
    assert_eq!(spec("L=thr_left - 1511"), offset(1511.0, 1.0));
    assert_eq!(spec("L=thr_left + 0.5"), offset(-0.5, 1.0));
    assert_eq!(spec("L=(thr_left - 1500) / 400"), offset(1500.0, 1.0 / 400.0));
    assert_eq!(spec("L = ( thr_left - 1500 ) * 0.5"), offset(1500.0, 0.5));
    assert_eq!(spec("L=thr_left / 4"), offset(0.0, 0.25));
    assert_eq!(
        spec("L=(thr_left [us] - 1500) / 400"),
        ChannelSpec { unit: Some("us".into()), ..offset(1500.0, 1.0 / 400.0) }
    );
    assert_eq!(spec("thr_left - 1511"), ChannelSpec { offset: 1511.0, ..ChannelSpec::named("thr_left") });
    // A sign without a blank before it belongs to the name, and so does text.
    for name in ["pwm-1", "engine/2", "a - b", "a+1", "x (left)", "(a)", "- 3"] {
        assert_eq!(spec(&format!("L={name}")), ChannelSpec::renamed("L", name));
    }
}

#[test]
fn a_unit_may_be_in_parentheses() {
    let speed = ChannelSpec { unit: Some("kn".into()), ..ChannelSpec::renamed("u", "Speed") };
    assert_eq!(spec("u=Speed (kn)"), speed);
    assert_eq!(spec("u=(Speed (kn) - 2) * 3"), ChannelSpec { offset: 2.0, scale: 3.0, ..speed });
}

#[test]
fn writing_and_reading_a_specification_is_the_identity() {
    for text in [
        "u",
        "u=SOG",
        "u=SOG [kn]",
        "n=shaft speed [rpm] * 0.01",
        "u * -1",
        "L=thr_left - 1511",
        "L=thr_left + 3",
        "L=(thr_left [us] - 1500) * 0.0025",
    ] {
        assert_eq!(spec(text).to_string(), text);
    }
}

proptest! {
    #[test]
    fn every_specification_is_read_as_it_was_written(
        name in "[a-z][a-z0-9_]{0,6}",
        column in "[A-Za-z][A-Za-z0-9_/*+-]{0,8}[a-z]( [a-z(]{1,4})?",
        unit in prop::option::of(prop::sample::select(vec!["kn", "m/s", "us", "m/s^2", "°"])),
        offset in prop_oneof![Just(0.0), -3000.0..3000.0_f64, any::<f64>().prop_filter("finite", |x| x.is_finite())],
        scale in prop_oneof![
            Just(1.0),
            -10.0..-0.001_f64,
            any::<f64>().prop_filter("a scale", |x| x.is_finite() && *x != 0.0)
        ],
        is_number: bool,
    ) {
        let written = ChannelSpec { name, column, unit: unit.map(String::from), offset, scale, is_number };
        prop_assert_eq!(written.to_string().parse::<ChannelSpec>().unwrap(), written.clone());
        let json = serde_json::to_string(&written).unwrap();
        prop_assert_eq!(serde_json::from_str::<ChannelSpec>(&json).unwrap(), written);
    }

    #[test]
    fn a_specification_that_is_read_is_written_and_read_again(text in "[a-c=()\\[\\]+*/ .0-9-]{0,24}") {
        if let Ok(read) = text.parse::<ChannelSpec>() {
            let again = read.to_string().parse::<ChannelSpec>();
            prop_assert!(again.is_ok(), "{} {:?}", read, again);
        }
    }
}

#[test]
fn wrong_specifications_are_refused_with_the_reason() {
    for (text, reason) in [
        ("", "empty"),
        ("u=", "empty"),
        ("=u", "empty"),
        ("u=x * 0", "scale"),
        ("u=x * inf", "scale"),
        ("u=x * nan", "scale"),
        ("u=x / 0", "scale"),
        ("u=x - 3 * 2", "parentheses"),
        ("u=x * 2 - 3", "parentheses"),
    ] {
        let message = text.parse::<ChannelSpec>().unwrap_err().to_string();
        assert!(message.contains(reason) && message.contains(&format!("`{text}`")), "{message}");
    }
    assert!("speed".parse::<Wind>().unwrap_err().to_string().contains("two columns"));
}

#[test]
fn a_selection_is_read_from_json() {
    let text = r#"{"outputs":["u=SOG [kn]"],"wind":{"speed":"ws","direction":"wd [deg]"}}"#;
    let selection: Selection = serde_json::from_str(text).unwrap();
    assert_eq!(selection.outputs, [spec("u=SOG [kn]")]);
    assert!(serde_json::from_str::<Selection>(r#"{"output":["u"]}"#).is_err());
}

#[test]
fn delays_are_written_in_samples_or_seconds() {
    assert_eq!("3".parse::<InputDelay>().unwrap(), InputDelay::Samples(3));
    assert_eq!("-1".parse::<InputDelay>().unwrap(), InputDelay::Samples(-1));
    assert_eq!("0.3 s".parse::<InputDelay>().unwrap(), InputDelay::Seconds(0.3));
    for bad in ["", "s", "three", "nans", "infs", "99999999999999"] {
        assert!(bad.parse::<InputDelay>().is_err(), "{bad}");
    }
    assert_eq!(InputDelay::Seconds(0.26).samples(0.1), 3);
    assert_eq!(InputDelay::Samples(-3).seconds_at(0.5), -1.5);
    assert_eq!(InputDelay::Seconds(0.26).seconds_at(0.5), 0.26);
}
