//! Text forms of channels, wind, selections and input delays.

use hydroid::log::{ChannelSpec, InputDelay, Selection, Wind};

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
fn writing_and_reading_a_specification_is_the_identity() {
    for text in ["u", "u=SOG", "u=SOG [kn]", "n=shaft speed [rpm] * 0.01", "u * -1"] {
        assert_eq!(spec(text).to_string(), text);
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
