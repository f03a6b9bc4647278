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

/// What a compass shows of a heading, and of the one at which it failed.
type Fault = fn(f64, f64) -> f64;

/// A compass that freezes, or jumps, contradicts gyro and track, whatever it showed before; a good one never does.
#[test]
fn a_compass_that_freezes_or_jumps_contradicts_the_other_sensors() {
    const GYRO: [(&str, &str); 1] = [("r", "rad/s")];
    let topics = LiveTopics::new("link", [("gps", FIELDS.to_vec()), ("imu", GYRO.to_vec())]);
    let with_gyro = Sensors { yaw_rate: Some("imu.r".parse().unwrap()), antenna_m: [0.0; 3], ..sensors() };
    let faults: [(&str, f64, Fault); 3] = [
        ("sound", f64::INFINITY, |psi, _| psi),
        ("frozen", 5.0, |_, first| first),
        ("jumps", 1.3, |psi, _| psi + 1.57),
    ];
    for (name, within_s, fault) in faults {
        let mut motion = LiveMotion::new(&topics, &with_gyro).unwrap();
        let mut random = 5_u64;
        let mut noise = move |of: f64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            of * 3.46 * ((random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
        };
        let (mut place, mut psi, mut r, mut first, mut found) = ([0.0; 2], 0.0_f64, 0.0, f64::NAN, None);
        for k in 0..6_000 {
            let t = f64::from(k) * 0.1;
            // A lawn-mower: legs of 20 s, turns of 9 s.
            let (in_turn, side) = (t % 29.0 > 20.0, if t % 58.0 < 29.0 { 1.0 } else { -1.0 });
            r += 0.1 * ((if in_turn { side * 0.35 } else { 0.0 }) - r);
            let speed = 1.2;
            psi += 0.1 * r;
            place = [place[0] + 0.1 * speed * psi.cos(), place[1] + 0.1 * speed * psi.sin()];
            if t > 10.0 * 29.0 + 22.0 && first.is_nan() {
                first = psi;
            }
            let shown = if first.is_nan() { psi } else { fault(psi, first) };
            let (vn, ve) = (speed * psi.cos() + noise(0.1), speed * psi.sin() + noise(0.1));
            let row = [place[0] + noise(0.3), place[1] + noise(0.3), vn, ve, shown + noise(0.03)];
            motion.row(0, t, &row);
            motion.row(1, t + 0.05, &[r + noise(0.01)]);
            let is_fresh = motion.is_fresh(t, None, None);
            assert!(is_fresh || !first.is_nan(), "{name}: {t} s, {:?}", motion.health());
            if !is_fresh && found.is_none() {
                found = Some(t - (10.0 * 29.0 + 22.0));
                assert!(motion.is_contradicted(None), "{name}: {:?}", motion.health());
            }
        }
        let is_right = found.map_or(within_s.is_infinite(), |after_s| after_s < within_s);
        assert!(is_right, "{name}: {found:?}, {:?}", motion.health());
    }
}
