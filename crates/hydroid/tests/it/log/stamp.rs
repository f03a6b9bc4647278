//! Dates as time stamps.

use hydroid::log::stamp::{looks_like, parse, pass_midnight};

fn seconds(text: &str) -> f64 {
    parse(text).unwrap_or_else(|| panic!("{text}")).seconds
}

#[test]
fn dates_are_seconds_since_1970() {
    assert_eq!(seconds("1970-01-01T00:00:00Z"), 0.0);
    assert_eq!(seconds("1969-12-31T23:59:59Z"), -1.0);
    assert_eq!(seconds("2000-02-29T00:00:00Z"), 951_782_400.0);
    assert_eq!(seconds("2000-03-01T00:00:00Z"), 951_868_800.0);
    assert_eq!(seconds("2001-09-09T01:46:40Z"), 1e9);
    assert_eq!(seconds("2020-08-03T11:04:37.125Z"), 1_596_452_677.125);
    assert_eq!(seconds("2038-01-19T03:14:08Z"), 2_147_483_648.0);
    assert_eq!(seconds("2100-03-01T00:00:00Z") - seconds("2100-02-28T00:00:00Z"), 86_400.0);
}

#[test]
fn one_moment_has_many_forms() {
    for text in [
        "2020-08-03T11:04:37Z",
        "2020-08-03t11:04:37z",
        "2020-08-03 11:04:37",
        "2020-08-03 11:04:37.000000000",
        "2020-08-03T13:04:37+02:00",
        "2020-08-03T13:04:37+0200",
        "2020-08-03 13:04:37 +02",
        "2020-08-02T23:34:37-11:30",
        "2020-08-04T01:04:37,0+14:00",
    ] {
        assert_eq!(seconds(text), 1_596_452_677.0, "{text}");
        assert!(looks_like(text));
    }
    assert_eq!(seconds("2020-08-03T11:04"), 1_596_452_640.0);
    assert!(parse("2020-08-03T11:04:37Z").unwrap().zoned);
    assert!(!parse("2020-08-03T11:04:37").unwrap().zoned);
    assert_eq!(seconds("2016-12-31T23:59:60Z"), seconds("2017-01-01T00:00:00Z"));
}

#[test]
fn dates_that_do_not_exist_are_refused() {
    for text in [
        "2020-13-03T11:04:37Z",
        "2020-00-03T11:04:37Z",
        "2021-02-29T11:04:37Z",
        "1900-02-29T11:04:37Z",
        "2020-04-31T11:04:37Z",
        "2020-08-00T11:04:37Z",
        "2020-08-03T24:04:37Z",
        "2020-08-03T11:60:37Z",
        "2020-08-03T11:04:61Z",
        "2020-08-03T11:04:60Z",
        "2020-08-03T11:04:37.Z",
        "2020-08-03T11:04:37+2",
        "2020-08-03T11:04:37+02:0",
        "2020-08-03T11:04:37+25:00",
        "2020-08-03T11:04:37Zulu",
        "2020-08-03",
        "2020-8-3T11:04:37",
        "2020-",
        "",
        "11:04",
        "100:00:00",
        "11:60:00",
        "11:4:00",
        "11:04:61",
        "11:04:1e1",
        "11:04:37:00",
        "\u{fffd}020-08",
    ] {
        assert!(parse(text).is_none(), "{text}");
    }
}

#[test]
fn a_time_of_day_counts_from_midnight() {
    for (text, expected) in
        [("00:00:00", 0.0), ("31:00:00", 111_600.0), ("9:05:00.5", 32_700.5), ("23:59:59,25", 86_399.25)]
    {
        let stamp = parse(text).unwrap();
        assert_eq!((stamp.seconds, stamp.dated, stamp.zoned), (expected, false, false), "{text}");
        assert!(looks_like(text));
    }
}

#[test]
fn times_of_day_pass_midnight_and_pauses() {
    let after = |hours: &[f64]| {
        let mut seconds: Vec<f64> = hours.iter().map(|hour| 3600.0 * hour).collect();
        pass_midnight(&mut seconds);
        seconds.iter().map(|s| s / 3600.0).collect::<Vec<_>>()
    };
    assert_eq!(after(&[23.0, 23.9, 0.1, 12.0, 23.9, 1.0]), [23.0, 23.9, 24.1, 36.0, 47.9, 49.0]);
    assert_eq!(after(&[6.0, 18.5, 19.0, 7.0]), [6.0, 18.5, 19.0, 31.0]);
    // A late row about midnight.
    assert_eq!(after(&[23.9, 0.1, 23.95, 0.2]), [23.9, 24.1, 23.95, 24.2]);
    assert_eq!(after(&[23.0, 24.5, 31.0]), [23.0, 24.5, 31.0]);
}
