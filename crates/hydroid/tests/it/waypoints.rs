//! Way-points of CSV and GPX files.

use hydroid::closed_loop::{Purpose, Waypoints, WaypointsError};
use proptest::prelude::*;

fn parse(text: &str) -> Result<Waypoints, WaypointsError> {
    Waypoints::parse(text.as_bytes(), "route", None, Purpose::Route)
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
        if let Ok(route) = Waypoints::parse(&[start, &bytes].concat(), "route", None, Purpose::Route) {
            prop_assert!(route.points.iter().flatten().all(|number| number.is_finite()));
        }
    }
}

/// A mission and its geofence, as Mission Planner and QGroundControl keep them, and GeoJSON: the same points.
#[test]
fn missions_of_autopilots_are_routes_and_fences() {
    let wpl = "QGC WPL 110\n\
        0\t1\t0\t16\t0\t0\t0\t0\t50.0\t9.0\t3.0\t1\n\
        1\t0\t3\t16\t0\t0\t0\t0\t50.001\t9.0\t0\t1\n\
        2\t0\t3\t206\t0\t2\t0\t0\t0\t0\t0\t1\n\
        3\t0\t3\t16\t0\t0\t0\t0\t50.001\t9.002\t0\t1\n";
    let plan = r#"{"fileType": "Plan", "mission": {"plannedHomePosition": [50.0, 9.0, 3.0], "items": [
        {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, null, 50.001, 9.0, 0]},
        {"type": "SimpleItem", "command": 206, "frame": 2, "params": [0, 2, 0, 0, 0, 0, 0]},
        {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"Items": [
            {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, null, 50.001, 9.002, 0]}]}}]},
        "geoFence": {"circles": [], "polygons": [
            {"inclusion": true, "polygon": [[49.99, 8.99], [49.99, 9.01], [50.01, 9.0]], "version": 1},
            {"inclusion": false, "polygon": [[50.0, 9.0], [50.0, 9.001], [50.0005, 9.0]], "version": 1}]}}"#;
    let line = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry":
        {"type": "LineString", "coordinates": [[9.0, 50.001], [9.002, 50.001, 4.0]]}}]}"#;
    let points = r#"{"type": "FeatureCollection", "features": [
        {"type": "Feature", "geometry": {"type": "Point", "coordinates": [9.0, 50.001]}},
        {"type": "Feature", "geometry": {"type": "Point", "coordinates": [9.002, 50.001]}}]}"#;
    let expected = parse("lat,lon\n50.001,9.0\n50.001,9.002\n").unwrap();
    assert!(expected.points[1][1] > 100.0);
    for text in [wpl, plan, line, points] {
        assert_eq!(parse(text).unwrap(), expected, "{text}");
    }
    let about = |text: &str, purpose| {
        let origin = Some([50.0, 9.0]);
        Waypoints::parse(text.as_bytes(), "route", origin, purpose).map_err(|error| error.to_string())
    };
    let corners = "lat,lon\n49.99,8.99\n49.99,9.01\n50.01,9.0\n";
    let ring = r#"{"type": "Polygon", "coordinates": [[[8.99, 49.99], [9.01, 49.99], [9.0, 50.01], [8.99, 49.99]]]}"#;
    let fence = "QGC WPL 110\n\
        0 0 0 5001 3 0 0 0 49.99 8.99 0 1\n1 0 0 5001 3 0 0 0 49.99 9.01 0 1\n2 0 0 5001 3 0 0 0 50.01 9.0 0 1\n";
    let expected = about(corners, Purpose::KeepIn).unwrap();
    assert_eq!(expected.origin_deg, Some([50.0, 9.0]));
    for text in [plan, ring, fence] {
        assert_eq!(about(text, Purpose::KeepIn).as_ref(), Ok(&expected), "{text}");
    }
    assert_eq!(about(plan, Purpose::KeepOut).unwrap().points[0], [0.0, 0.0]);
    assert!(about(fence, Purpose::KeepOut).unwrap_err().contains("no exclusion polygon"));
    assert!(about(wpl, Purpose::KeepIn).unwrap_err().contains("no inclusion polygon"));
    assert!(about("{\"type\": 3", Purpose::Route).unwrap_err().contains("route: EOF"));
    assert!(about("{\"type\": 3}", Purpose::Route).unwrap_err().contains("no way-points"));
    assert!(about("QGC WPL 110\n0 1 0 16 0 0\n", Purpose::Route).unwrap_err().contains("line 2"));
    // What moves the vessel otherwise than to a way-point is not followed, and not passed over.
    for command in [17, 19, 20, 82, 93, 112, 177, 178, 194, 601] {
        for (text, place) in [
            (wpl.replace("206", &command.to_string()), "line 4"),
            (plan.replace("206", &command.to_string()), "item 2"),
        ] {
            let error = about(&text, Purpose::Route).unwrap_err();
            assert!(
                error.starts_with(&format!("route: {place}: the command {command} of MAVLink, which moves")),
                "{error}"
            );
        }
    }
    let held = wpl.replace("3\t0\t3\t16\t0", "3\t0\t3\t16\t5");
    assert!(
        about(&held, Purpose::Route).unwrap_err().contains("line 5: a time of 5 s to hold, is not followed")
    );
    let local = wpl.replace("3\t0\t3\t16", "3\t0\t1\t16");
    assert!(about(&local, Purpose::Route).unwrap_err().contains("a frame without latitude and longitude"));
    assert!(about(&fence.replace(" 5001 ", " 5003 "), Purpose::KeepIn).unwrap_err().contains("is a circle"));
    let circles = r#"{"fileType": "Plan", "geoFence": {"circles": [{"inclusion": true, "circle": {}}], "polygons": []}}"#;
    assert!(
        about(circles, Purpose::KeepIn)
            .unwrap_err()
            .contains("the inclusion polygon is a circle: draw it as a polygon")
    );
    let two = plan.replace("\"inclusion\": false", "\"inclusion\": true");
    let circle = plan.replace(r#""circles": []"#, r#""circles": [{"inclusion": true, "circle": {}}]"#);
    let hole = ring.replace("]]]", "]], [[9.0, 50.0], [9.0, 50.001], [9.001, 50.0], [9.0, 50.0]]]");
    let apart = format!(r#"{{"type": "GeometryCollection", "geometries": [{ring}, {ring}]}}"#);
    let six = fence.replace(" 5001 3 ", " 5001 6 ");
    for text in [&two, &circle, &hole, &apart, &six] {
        let error = about(text, Purpose::KeepIn).unwrap_err();
        assert!(error.contains("more than one inclusion polygon"), "{error}");
    }
}
