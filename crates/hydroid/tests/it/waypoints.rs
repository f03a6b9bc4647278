//! Way-points of CSV and GPX files.

use hydroid::closed_loop::{Waypoints, WaypointsError};
use proptest::prelude::*;

fn parse(text: &str) -> Result<Waypoints, WaypointsError> {
    Waypoints::parse(text.as_bytes(), "route")
}

fn near(points: &[[f64; 2]], expected: &[[f64; 2]], tolerance: f64) {
    assert_eq!(points.len(), expected.len());
    for (point, expected) in points.iter().zip(expected) {
        let off = (0..2).map(|i| (point[i] - expected[i]).abs()).fold(0.0, f64::max);
        assert!(off < tolerance, "{point:?} instead of {expected:?}");
    }
}

/// The arc of one degree on the equator of WGS 84 is `a pi / 180`; the quarter of a meridian has 10 001 965.729 m.
#[test]
fn latitudes_and_longitudes_have_the_lengths_of_the_ellipsoid() {
    let route = parse("lat,lon\n0,10\n0,11\n90,10\n").unwrap();
    assert_eq!(route.origin_deg, Some([0.0, 10.0]));
    let degree = 6_378_137.0 * std::f64::consts::PI / 180.0;
    near(&route.points, &[[0.0, 0.0], [0.0, degree], [10_001_965.729, 0.0]], 1e-3);
}

#[test]
fn metres_are_read_with_their_units_and_names() {
    let expected = [[0.0, 0.0], [100.0, -20.0]];
    for text in [
        "north [m],east [m]\n0,0\n100,-20\n",
        "name;Y;X [km]\nstart;0;0\nend;-20;0.1\n",
        "\u{feff}east,north\n0,0\n-20,100\n",
    ] {
        let route = parse(text).unwrap();
        near(&route.points, &expected, 1e-9);
        assert_eq!(route.origin_deg, None);
    }
}

#[test]
fn a_route_of_gpx_precedes_its_track_and_its_waypoints() {
    let point =
        |kind: &str, lat: f64| format!("<{kind} lat=\"{lat}\" lon=\"4\"><name>&lt;&#65;</name></{kind}>");
    let (wpt, track, route) = (point("wpt", 1.0), point("trkpt", 2.0), point("rtept", 3.0));
    let gpx = |content: &str| {
        parse(&format!(
            "<?xml version=\"1.0\"?>\n<gpx xmlns=\"http://www.topografix.com/GPX/1/1\">{content}</gpx>"
        ))
    };
    let origin = |content: &str| gpx(content).unwrap().origin_deg.unwrap()[0];
    assert_eq!(origin(&format!("{wpt}<trk><trkseg>{track}</trkseg></trk><rte>{route}</rte>")), 3.0);
    assert_eq!(origin(&format!("{wpt}<trk><trkseg>{track}</trkseg></trk>")), 2.0);
    assert_eq!(origin(&wpt), 1.0);
    assert_eq!(gpx(&format!("<rte>{route}<rtept lat='3' lon='4.1'/></rte>")).unwrap().points.len(), 2);
}

#[test]
fn errors_name_place_and_remedy() {
    for (text, words) in [
        ("a,b\n1,2\n", "route: no columns of way-points among a, b: name them north [m]"),
        ("lat,lon\n1,2\n3,\n", "route: line 3: the position of the way-point is not two numbers"),
        ("north [s],east\n1,2\n", "route: the column 'north'"),
        ("lat,lon\n1,2\n95,2\n", "route: line 3: latitude 95, longitude 2: latitudes are between"),
        ("<gpx></gpx>", "route: no way-points"),
        ("<gpx><rte><rtept lat='1'/></rte></gpx>", "route: rtept 1: the position"),
        ("<gpx><rte><rtept lat='1' lon='2'></rte></gpx>", "route: byte 33: "),
    ] {
        let error = parse(text).unwrap_err().to_string();
        assert!(error.starts_with(words), "{error}");
    }
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(start in 0_usize..4, bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let start: &[u8] = [&b"<gpx><rtept lat='"[..], b"lat,lon\n1,", b"north,east\n", b""][start];
        if let Ok(route) = Waypoints::parse(&[start, &bytes].concat(), "route") {
            prop_assert!(route.points.iter().flatten().all(|number| number.is_finite()));
        }
    }
}
