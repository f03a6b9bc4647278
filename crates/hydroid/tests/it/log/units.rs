//! Units of channels.

use std::f64::consts::TAU;

use hydroid::log::units::{Unit, UnitError, from_name};
use hydroid::log::{PrepareOptions, Selection, prepare};

use super::{input, log};

#[test]
fn units_are_converted_to_si() {
    for (text, expected, si) in [
        ("m/s", 1.0, "m/s"),
        ("kn", 0.514_444_444, "m/s"),
        ("knots", 0.514_444_444, "m/s"),
        ("km/h", 0.277_777_778, "m/s"),
        ("cm/s", 0.01, "m/s"),
        ("mm/s", 0.001, "m/s"),
        ("ft/s", 0.3048, "m/s"),
        ("rad/s", 1.0, "rad/s"),
        ("deg/s", 0.017_453_293, "rad/s"),
        ("deg/min", 0.000_290_888, "rad/s"),
        ("rpm", 1.0 / 60.0, "rps"),
        ("rps", 1.0, "rps"),
        ("deg", 0.017_453_293, "rad"),
        ("km", 1000.0, "m"),
        ("NM", 1852.0, "m"),
        ("kN", 1000.0, "N"),
        ("N m", 1.0, "N m"),
        ("N*m", 1.0, "N m"),
        ("N s", 1.0, "N s"),
        ("ms", 0.001, "s"),
        ("us", 1.0, "us"),
        ("min", 60.0, "s"),
        ("h", 3600.0, "s"),
        ("%", 0.01, "1"),
        ("V", 1.0, "V"),
        // As loggers write them.
        ("deg/sec", 0.017_453_293, "rad/s"),
        ("Deg/Second", 0.017_453_293, "rad/s"),
        ("degrees/second", 0.017_453_293, "rad/s"),
        ("Deg", 0.017_453_293, "rad"),
        ("DEGREES", 0.017_453_293, "rad"),
        ("KN", 0.514_444_444, "m/s"),
        ("Kn", 0.514_444_444, "m/s"),
        ("kts", 0.514_444_444, "m/s"),
        ("KTS", 0.514_444_444, "m/s"),
        ("Knots", 0.514_444_444, "m/s"),
        ("m/sec", 1.0, "m/s"),
        ("M/S", 1.0, "m/s"),
        ("m/sec^2", 1.0, "m/s^2"),
        ("m/sec/sec", 1.0, "m/s^2"),
        ("Km/h", 0.277_777_778, "m/s"),
        ("RPM", 1.0 / 60.0, "rps"),
        ("Rad", 1.0, "rad"),
        ("RAD/S", 1.0, "rad/s"),
        ("Sec", 1.0, "s"),
        ("KNM", 1000.0, "N m"),
        ("mv", 0.001, "V"),
    ] {
        let Unit { factor, si: found, .. } = Unit::parse(text).unwrap();
        assert!((factor - expected).abs() < 1e-9 * expected.max(1.0), "{text}: {factor}");
        assert_eq!(found, si, "{text}");
    }
}

#[test]
fn case_distinguishes_units() {
    let si = |text: &str| Unit::parse(text).unwrap().si;
    assert_eq!([si("Nm"), si("NM"), si("Ns"), si("ns")], ["N m", "m", "N s", "s"]);
    assert_eq!([si("kN"), si("kn")], ["N", "m/s"]);
    assert!(!Unit::parse("MV").unwrap().is_known());
    for text in ["nM", "NS", "nS"] {
        assert!(matches!(Unit::parse(text), Err(UnitError::AmbiguousCase { .. })), "{text}");
    }
    let doubtful = |text: &str| Unit::parse(text).unwrap().is_doubtful();
    assert!(doubtful("KN") && doubtful("Kn") && !doubtful("kN") && !doubtful("kn") && !doubtful("kts"));
    assert_eq!(Unit::parse("nm"), Err(UnitError::Ambiguous));
    let unknown = Unit::parse("furlong/fortnight").unwrap();
    assert!(!unknown.is_known());
    assert_eq!((unknown.factor, unknown.si.as_str()), (1.0, "furlong/fortnight"));
}

#[test]
fn pulse_widths_stay_microseconds_and_times_do_not() {
    let rows: String =
        (0..40).map(|k| format!("{},{},{}\n", 100_000 * k, 1 + k % 3, 1500 + 10 * k)).collect();
    let text = format!("t [us],u [m/s],n [us]\n{rows}");
    let selection = Selection::of("u", "n=n - 1500").unwrap();
    let found = prepare(&[log(&text)], &selection, &PrepareOptions::default()).unwrap();
    assert!((found.runs[0].dt - 0.1).abs() < 1e-12);
    assert_eq!(input(&found, 0, 0)[..3], [0.0, 10.0, 20.0]);
}

#[test]
fn conversions_need_the_same_quantity() {
    let (rpm, rads) = (Unit::parse("rpm").unwrap(), Unit::parse("rad/s").unwrap());
    assert!((rpm.to(&rads).unwrap() - TAU / 60.0).abs() < 1e-12);
    let kn = Unit::parse("kn").unwrap();
    let message = kn.to(&rads).unwrap_err().to_string();
    assert!(message.contains("`kn`") && message.contains("`rad/s`"), "{message}");
}

#[test]
fn endings_of_names_state_units() {
    for (name, clock, expected) in [
        ("u_mps", false, Some(("u", "m/s"))),
        ("v_from_pos_mps", false, Some(("v_from_pos", "m/s"))),
        ("pwm_left_us", false, None),
        ("t_ms", true, Some(("t", "ms"))),
        ("YAW_RATE_DEGPS", false, Some(("YAW_RATE", "deg/s"))),
        ("shaft_RPM", false, Some(("shaft", "rpm"))),
        ("motor_n", false, None),
        ("gap", false, None),
        ("_m", false, None),
        ("u_m_s", false, Some(("u", "m/s"))),
        ("acc_x_m_s2", false, Some(("acc_x", "m/s^2"))),
        ("r_deg_s", false, Some(("r", "deg/s"))),
        ("r_rad_s", false, Some(("r", "rad/s"))),
        ("rot_deg_min", false, Some(("rot", "deg/min"))),
        ("sog_km_h", false, Some(("sog", "km/h"))),
        ("time_s", true, Some(("time", "s"))),
        ("°_ü", false, None),
    ] {
        assert_eq!(from_name(name, clock), expected, "{name}");
    }
}

/// Velocities in knots under a header with m/s were learned as twice what they are, without a word.
#[test]
fn a_name_that_contradicts_its_header_is_told() {
    let text = "t,u_kn [m/s],n\n0,1.0,1\n1,1.5,2\n2,1.2,3\n3,1.4,1\n";
    let told = |outputs: &str| {
        let selection = Selection::of(outputs, "n").unwrap();
        let prepared = prepare(&[log(text)], &selection, &PrepareOptions::default());
        prepared.unwrap().notes.iter().any(|note| {
            note.is_warning()
                && note.message.contains("the name of `u_kn` says kn and its header m/s: m/s is used")
        })
    };
    assert!(told("u=u_kn"));
    assert!(!told("u=u_kn [m/s]"));
}
