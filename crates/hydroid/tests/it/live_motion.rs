//! The motion from the rows of a link.

use hydroid::log::Sensors;
use hydroid::recording::{LiveMotion, LiveTopics};

const FIELDS: [(&str, &str); 5] =
    [("north", "m"), ("east", "m"), ("vn", "m/s"), ("ve", "m/s"), ("heading", "rad")];

fn sensors() -> Sensors {
    let spec = |name: &str| Some(format!("gps.{name}").parse().unwrap());
    Sensors {
        north: spec("north"),
        east: spec("east"),
        velocity_north: spec("vn"),
        velocity_east: spec("ve"),
        heading: spec("heading"),
        antenna_m: [3.0, 1.0, 0.0],
        ..Sensors::default()
    }
}

/// Steady turns with an antenna ahead of the origin, in a current to the east.
#[test]
fn place_and_current_go_on_with_other_sensors() {
    let topics = LiveTopics::new("link", [("gps", FIELDS)]);
    let mut motion = LiveMotion::new(&topics, &sensors()).unwrap();
    let (speed, rate, current, [forward, starboard, _]) = (1.5, 0.1, 0.4, sensors().antenna_m);
    let place = |t: f64| {
        let psi = rate * t;
        [speed / rate * psi.sin(), speed / rate * (1.0 - psi.cos()) + current * t, psi]
    };
    let mut t = 0.0;
    for k in 0..1500 {
        t = f64::from(k) * 0.2;
        let [north, east, psi] = place(t);
        let (sine, cosine) = psi.sin_cos();
        let lever = [cosine * forward - sine * starboard, sine * forward + cosine * starboard];
        let velocity = [speed * cosine - rate * lever[1], speed * sine + current + rate * lever[0]];
        motion.row(0, t, &[north + lever[0], east + lever[1], velocity[0], velocity[1], psi]);
    }
    let check = |motion: &LiveMotion, what: &str| {
        let [north, east, _] = place(t);
        let row = motion.at(t).unwrap();
        let distance = (row.pose[0] - north).hypot(row.pose[1] - east);
        let (_, [to_north, to_east], _) = motion.uncertainty().unwrap();
        assert!(distance < 0.5, "{what}: {distance} m from the place");
        assert!(to_north.hypot(to_east - current) < 0.15, "{what}: a current of {to_north}, {to_east}");
        row
    };
    let before = check(&motion, "before");
    motion.change_sensors(&topics, &sensors()).unwrap();
    let after = check(&motion, "after");
    for i in 0..2 {
        assert!((before.pose[i] - after.pose[i]).abs() < 1e-9, "{before:?} {after:?}");
        assert!((before.ground[i] - after.ground[i]).abs() < 0.1, "{before:?} {after:?}");
    }
}
