//! Paths, speed profiles and line of sight compared with geometry, kinematics and closed forms.

use core::f64::consts::{FRAC_PI_2, PI};

use hydroid_core::guidance::{
    Border, Fence, LineOfSight, LineOfSightOptions, NoArea, Path, PathError, PathReference, Piece, Pose,
    Reference, Side, SpeedLimits, SpeedProfile, TimedReference, dubins,
};
use hydroid_core::vessel::kinematics::wrap;
use proptest::prelude::*;

fn side() -> impl Strategy<Value = Side> {
    prop_oneof![Just(Side::Port), Just(Side::Starboard)]
}

fn paths() -> impl Strategy<Value = Path> {
    let circle = (-50.0..50.0, -50.0..50.0, 2.0..80.0, side(), -7.0..7.0)
        .prop_map(|(x, y, radius, side, bearing)| Path::circle([x, y], radius, side, bearing).unwrap());
    let lawn = (-4.0..4.0, 5.0..80.0, 1.0..20.0, 0.0..10.0, 1usize..6, side()).prop_map(
        |(course, leg, radius, more, legs, side)| {
            Path::lawn_mower([3.0, -8.0], course, leg, 2.0 * radius + more, legs, radius, side).unwrap()
        },
    );
    let points = prop::collection::vec((-2.6..2.6f64, 20.0..60.0f64), 2..7).prop_map(|legs| {
        let (mut at, mut points) = ([0.0, 0.0], vec![[0.0, 0.0]]);
        let mut course = 0.0f64;
        for (turn, length) in legs {
            course += turn;
            at = [at[0] + length * course.cos(), at[1] + length * course.sin()];
            points.push(at);
        }
        // tan(1.3) is 3.6: two such corners fit a leg of 20 m.
        Path::waypoints(&points, 2.7).unwrap()
    });
    prop_oneof![circle, lawn, points]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn a_path_has_unit_speed_its_course_and_its_curvature(path in paths(), share in 0.001..0.999f64) {
        let (s, h) = (share * path.length(), 1e-4);
        let (before, here, after) = (path.at(s - h), path.at(s), path.at(s + h));
        // Except at joints, where the curvature jumps.
        prop_assume!(before.curvature == here.curvature && after.curvature == here.curvature);
        let difference = |i: usize| (after.position[i] - before.position[i]) / (2.0 * h);
        prop_assert!((difference(0) - here.course.cos()).abs() < 1e-7);
        prop_assert!((difference(1) - here.course.sin()).abs() < 1e-7);
        let turned = wrap(after.course - before.course) / (2.0 * h);
        prop_assert!((turned - here.curvature).abs() < 1e-7);
    }

    #[test]
    fn position_and_course_do_not_jump(path in paths()) {
        let ends = path.pieces().windows(2).map(|pair| (pair[0].at(pair[0].length), pair[1].at(0.0)));
        for (end, start) in ends {
            prop_assert!(distance(end.position, start.position) < 1e-9);
            prop_assert!(wrap(end.course - start.course).abs() < 1e-9);
        }
    }

    #[test]
    fn the_foot_of_a_point_beside_the_path_is_where_it_was_put_down(
        path in paths(), share in 0.05..0.95f64, off in -0.9..0.9f64,
    ) {
        let s = share * path.length();
        let pose = path.at(s);
        let point = [pose.position[0] - off * pose.course.sin(), pose.position[1] + off * pose.course.cos()];
        let reach = 1.5;
        let foot = path.project(point, s + 0.4, reach);
        prop_assert!((foot.s - s).abs() < 1e-6, "{} instead of {s}", foot.s);
        prop_assert!((foot.cross_track - off).abs() < 1e-9);
    }

    #[test]
    fn the_projection_is_the_nearest_point_in_its_window(
        path in paths(), near in -0.2..1.2f64, x in -90.0..90.0f64, y in -90.0..90.0f64, reach in 1.0..200.0f64,
    ) {
        let near = near * path.length();
        let foot = path.project([x, y], near, reach);
        let least = distance(foot.pose.position, [x, y]);
        let reach = if path.is_closed() { reach.min(0.5 * path.length()) } else { reach };
        prop_assert!((foot.s - near).abs() <= reach + 1e-9);
        for k in 0..=400 {
            let s = near + reach * (f64::from(k) / 200.0 - 1.0);
            prop_assert!(distance(path.at(s).position, [x, y]) >= least - 1e-9, "nearer at {s} than at {}", foot.s);
        }
    }

    #[test]
    fn speeds_keep_every_limit(
        path in paths(), cruise in 0.5..8.0f64, lateral in 0.05..1.0f64, yaw in 0.05..0.5f64,
        (up, down) in (0.02..0.5f64, 0.02..0.5f64), (start, end) in (0.0..4.0f64, 0.0..4.0f64),
    ) {
        let limits = SpeedLimits {
            cruise, lateral_acceleration: lateral, yaw_rate: yaw, acceleration: up, deceleration: down,
            start, end, corner: f64::INFINITY,
        };
        let profile = SpeedProfile::new(&path, &limits).unwrap();
        let mut before: Option<(f64, f64)> = None;
        for k in 0..=2_000 {
            let s = path.length() * f64::from(k) / 2_000.0;
            let ((speed, rate), kappa) = (profile.at(s), path.at(s).curvature.abs());
            prop_assert!(speed <= cruise + 1e-9 && speed * speed * kappa <= lateral + 1e-6);
            prop_assert!(speed * kappa <= yaw + 1e-6 && (-down - 1e-9..=up + 1e-9).contains(&rate));
            if let Some((s0, speed0)) = before {
                // 2 a ds = d(U^2)
                let change = speed * speed - speed0 * speed0;
                prop_assert!(change <= 2.0 * up * (s - s0) + 1e-9 && -change <= 2.0 * down * (s - s0) + 1e-9);
            }
            before = Some((s, speed));
        }
        if !path.is_closed() {
            prop_assert!(profile.at(0.0).0 <= start && profile.at(path.length()).0 <= end + 1e-6);
        }
    }

    #[test]
    fn a_timed_reference_has_consistent_derivatives(path in paths(), cruise in 0.5..6.0f64, end in 0.2..2.0f64) {
        let limits = SpeedLimits { lateral_acceleration: 0.3, start: 0.0, end, ..SpeedLimits::cruise(cruise) };
        let profile = SpeedProfile::new(&path, &limits).unwrap();
        let h = 1e-3;
        let at = |t: f64| -> Reference {
            let mut walker = TimedReference::new(&profile);
            walker.advance(&profile, t);
            walker.reference(&path, &profile)
        };
        for k in 1..20 {
            let t = profile.duration() * f64::from(k) / 17.3;
            let [before, here, after] = [at(t - h), at(t), at(t + h)];
            prop_assert!((here.velocity[0].hypot(here.velocity[1]) - here.speed).abs() < 1e-12);
            let same = |a: &Reference, b: &Reference| {
                a.curvature == b.curvature && ((a.speed - b.speed) / h).abs() < 0.3 && distance(a.acceleration, b.acceleration) < 1e-2
            };
            // Except at joints, where the acceleration jumps.
            if !(same(&before, &here) && same(&here, &after)) {
                continue;
            }
            for i in 0..2 {
                let velocity = (after.position[i] - before.position[i]) / (2.0 * h);
                let acceleration = (after.velocity[i] - before.velocity[i]) / (2.0 * h);
                prop_assert!((velocity - here.velocity[i]).abs() < 1e-5);
                prop_assert!((acceleration - here.acceleration[i]).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_timed_reference_does_not_depend_on_its_steps(path in paths(), cruise in 0.5..6.0f64, t in 0.0..200.0f64, steps in 1u32..50) {
        let limits = SpeedLimits { lateral_acceleration: 0.3, start: 0.0, ..SpeedLimits::cruise(cruise) };
        let profile = SpeedProfile::new(&path, &limits).unwrap();
        let (mut one, mut many) = (TimedReference::new(&profile), TimedReference::new(&profile));
        one.advance(&profile, t);
        for _ in 0..steps {
            many.advance(&profile, t / f64::from(steps));
        }
        prop_assert!((one.s(&profile) - many.s(&profile)).abs() < 1e-6 * (1.0 + t));
    }

    #[test]
    fn a_timed_reference_continues_from_any_arc_length(path in paths(), cruise in 0.5..6.0f64, t in 0.0..200.0f64) {
        let profile = SpeedProfile::new(&path, &SpeedLimits { lateral_acceleration: 0.3, ..SpeedLimits::cruise(cruise) }).unwrap();
        let mut walker = TimedReference::new(&profile);
        walker.advance(&profile, t);
        let mut placed = TimedReference::at(&profile, walker.s(&profile));
        for _ in 0..2 {
            let (walked, here) = (walker.reference(&path, &profile), placed.reference(&path, &profile));
            prop_assert!((walked.s - here.s).abs() < 1e-6, "{walked:?} {here:?}");
            prop_assert!((walked.speed - here.speed).abs() < 1e-6, "{walked:?} {here:?}");
            walker.advance(&profile, 7.0);
            placed.advance(&profile, 7.0);
        }
    }

    #[test]
    fn the_rate_of_the_desired_course_is_its_derivative(
        radius in 8.0..60.0f64, side in side(), off in -4.0..4.0f64, heading in -3.0..3.0f64, integral in 0.0..0.5f64,
    ) {
        let path = Path::circle([0.0, 0.0], radius, side, 0.3).unwrap();
        let settings = LineOfSightOptions { lookahead: 6.0, integral };
        let velocity = [1.7 * heading.cos(), 1.7 * heading.sin()];
        let pose = path.at(5.0);
        let from = [pose.position[0] - off * pose.course.sin(), pose.position[1] + off * pose.course.cos()];
        let mut guidance = LineOfSight::new(settings).unwrap();
        // Builds up the integral.
        for _ in 0..30 {
            guidance.update(&pose, from, [0.0, 0.0], 0.1);
        }
        let h = 1e-5;
        let mut follower = PathReference::new(5.0, 5.0);
        let foot = follower.project(&path, from);
        let now = guidance.update(&foot.pose, from, velocity, h);
        let later = [from[0] + h * velocity[0], from[1] + h * velocity[1]];
        let foot = follower.project(&path, later);
        let next = guidance.update(&foot.pose, later, velocity, h);
        prop_assert!((wrap(next.heading - now.heading) / h - now.rate).abs() < 1e-3);
    }
}

#[test]
fn a_circle_has_its_radius_and_speed() {
    let path = Path::circle([3.0, -2.0], 10.0, Side::Starboard, 0.0).unwrap();
    assert!((path.length() - 20.0 * PI).abs() < 1e-12 && path.is_closed());
    // Clockwise from the northernmost point: east first.
    assert!(distance(path.at(0.0).position, [13.0, -2.0]) < 1e-12);
    assert!(distance(path.at(5.0 * PI).position, [3.0, 8.0]) < 1e-12);
    assert!(distance(path.at(-5.0 * PI + 60.0 * PI).position, [3.0, -12.0]) < 1e-9, "laps count on");
    let port = Path::circle([0.0, 0.0], 10.0, Side::Port, FRAC_PI_2).unwrap();
    assert!(distance(port.at(5.0 * PI).position, [10.0, 0.0]) < 1e-9);
}

/// Length, end and middle of a corner, from the geometry.
#[test]
fn way_points_are_cut_as_geometry_says() {
    let path = Path::waypoints(&[[0.0, 0.0], [40.0, 0.0], [40.0, 30.0]], 10.0).unwrap();
    assert!((path.length() - (30.0 + 5.0 * PI + 20.0)).abs() < 1e-9);
    assert!(distance(path.at(path.length()).position, [40.0, 30.0]) < 1e-9);
    // In the middle of the arc: R (sqrt(2) - 1) from the way-point.
    let middle = path.at(30.0 + 2.5 * PI);
    assert!((distance(middle.position, [40.0, 0.0]) - 10.0 * (2f64.sqrt() - 1.0)).abs() < 1e-9);
    assert!(middle.curvature > 0.0, "from north to east is to starboard");
    // Beyond the end, the path continues straight on.
    assert!(distance(path.at(path.length() + 7.0).position, [40.0, 37.0]) < 1e-9);
    assert!(distance(path.at(-7.0).position, [-7.0, 0.0]) < 1e-9);
}

#[test]
fn a_lawn_mower_has_the_legs_and_turns_that_were_asked_for() {
    let path = Path::lawn_mower([0.0, 0.0], 0.0, 50.0, 30.0, 4, 10.0, Side::Starboard).unwrap();
    assert!((path.length() - (4.0 * 50.0 + 3.0 * (10.0 * PI + 10.0))).abs() < 1e-9);
    // Four legs, 30 m apart, to the east; the fourth ends at the line of the start.
    assert!(distance(path.at(path.length()).position, [0.0, 90.0]) < 1e-9);
    assert!(wrap(path.at(path.length()).course - PI).abs() < 1e-9);
    let second = path.project([25.0, 30.0], 50.0 + 10.0 * PI + 10.0 + 25.0, 10.0);
    assert!(second.cross_track.abs() < 1e-9, "the second leg lies 30 m to starboard of the first");
    // Legs at a distance of two radii: semicircles.
    let close = Path::lawn_mower([0.0, 0.0], 0.0, 50.0, 20.0, 2, 10.0, Side::Port).unwrap();
    assert!((close.length() - (100.0 + 10.0 * PI)).abs() < 1e-9);
}

#[test]
fn invalid_paths_are_refused() {
    let radius = Path::circle([0.0; 2], -1.0, Side::Port, 0.0).unwrap_err();
    assert_eq!(radius.to_string(), "the radius of the circle must be greater than 0, and is -1");
    assert_eq!(Path::legs(&[[0.0; 2]]).unwrap_err().to_string(), "at least 2 way-points are needed");
    assert_eq!(
        Path::legs(&[[0.0; 2], [1.0, 0.0], [1.0, 0.0]]).unwrap_err(),
        PathError::Coincide { point: 2 }
    );
    let corner = Path::waypoints(&[[0.0, 0.0], [10.0, 0.0], [10.0, 8.0]], 9.0).unwrap_err();
    let PathError::CornerTooSharp { point: 1, fits } = corner else { panic!("{corner}") };
    assert!((fits - 8.0).abs() < 1e-9, "{fits}");
    assert!(Path::waypoints(&[[0.0, 0.0], [10.0, 0.0], [10.0, 8.0]], 7.999).is_ok());
    let back = Path::waypoints(&[[0.0, 0.0], [10.0, 0.0], [0.0, 0.0]], 1.0).unwrap_err();
    assert_eq!(back, PathError::CornerTooSharp { point: 1, fits: 0.0 });
    let close = Path::lawn_mower([0.0; 2], 0.0, 50.0, 10.0, 3, 6.0, Side::Port).unwrap_err();
    assert_eq!(close, PathError::LegsTooClose { spacing: 10.0, radius: 6.0 });
    assert!(matches!(Path::legs(&[[0.0; 2], [f64::NAN, 0.0]]), Err(PathError::NotFinite { .. })));
    let line = |x: f64| Piece { start: [x, 0.0], course: 0.0, curvature: 0.0, length: 5.0 };
    assert_eq!(
        Path::new(vec![line(0.0), line(6.0)], false).unwrap_err(),
        PathError::Gap { piece: 1, distance: 1.0 }
    );
    assert_eq!(Path::new(vec![line(0.0)], true).unwrap_err(), PathError::Gap { piece: 0, distance: 5.0 });
    let path = Path::new(vec![line(0.0), line(5.0)], false).unwrap();
    for limits in [
        SpeedLimits { acceleration: f64::INFINITY, ..SpeedLimits::cruise(1.0) },
        SpeedLimits { yaw_rate: 0.0, ..SpeedLimits::cruise(1.0) },
        SpeedLimits { end: -1.0, ..SpeedLimits::cruise(1.0) },
        SpeedLimits::cruise(f64::NAN),
    ] {
        assert!(matches!(SpeedProfile::new(&path, &limits), Err(PathError::NotPositive { .. })));
    }
    for settings in [
        LineOfSightOptions { lookahead: 0.0, integral: 0.0 },
        LineOfSightOptions { lookahead: 1.0, integral: -1.0 },
    ] {
        assert!(LineOfSight::new(settings).is_err());
    }
}

/// From rest to rest over a line: `L / U + U / (2 a) + U / (2 b)` seconds if the speed is reached, else the time of the
/// triangular profile.
#[test]
fn the_time_from_rest_to_rest_is_that_of_the_text_book() {
    let path = Path::legs(&[[0.0, 0.0], [100.0, 0.0]]).unwrap();
    let limits = SpeedLimits {
        start: 0.0,
        end: 0.0,
        acceleration: 0.5,
        deceleration: 0.25,
        ..SpeedLimits::cruise(4.0)
    };
    let profile = SpeedProfile::new(&path, &limits).unwrap();
    assert!((profile.duration() - (100.0 / 4.0 + 4.0 / 1.0 + 4.0 / 0.5)).abs() < 1e-9);
    // 2 a b L / (a + b) = U^2
    let fast = SpeedProfile::new(&path, &SpeedLimits { cruise: 90.0, ..limits }).unwrap();
    let peak = (2.0 * 0.5 * 0.25 * 100.0 / 0.75f64).sqrt();
    assert!((fast.duration() - (peak / 0.5 + peak / 0.25)).abs() < 1e-9);
    // The reference arrives at that time and stays.
    let mut walker = TimedReference::new(&fast);
    walker.advance(&fast, fast.duration() - 1e-3);
    assert!(!walker.is_done(&fast));
    walker.advance(&fast, 10.0);
    let end = walker.reference(&path, &fast);
    assert!(walker.is_done(&fast) && end.speed == 0.0 && (end.s - 100.0).abs() < 1e-9, "{end:?}");
}

#[test]
fn speed_is_reduced_at_corners() {
    let path = Path::legs(&[[0.0, 0.0], [50.0, 0.0], [50.0, 50.0]]).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits { corner: 0.5, ..SpeedLimits::cruise(3.0) }).unwrap();
    assert_eq!((profile.at(0.0).0, profile.at(50.0).0, profile.at(100.0).0), (3.0, 0.5, 3.0));
}

/// A vessel that heads as demanded, in a cross current: without integral action the error is `Delta V / sqrt(U^2 -
/// V^2)`, with it zero.
#[test]
fn integral_action_removes_the_drift() {
    let path = Path::legs(&[[0.0, 0.0], [1_000.0, 0.0]]).unwrap();
    let (speed, drift, lookahead) = (1.5, 0.4, 8.0);
    let sail = |integral: f64| {
        let mut guidance = LineOfSight::new(LineOfSightOptions { lookahead, integral }).unwrap();
        let mut follower = PathReference::new(0.0, 20.0);
        let (mut position, mut velocity) = ([0.0, 5.0], [speed, drift]);
        for _ in 0..5_000 {
            let foot = follower.project(&path, position);
            let aim = guidance.update(&foot.pose, position, velocity, 0.1);
            velocity = [speed * aim.heading.cos(), speed * aim.heading.sin() + drift];
            position = [position[0] + 0.1 * velocity[0], position[1] + 0.1 * velocity[1]];
        }
        (position[1], guidance.integral())
    };
    let off = lookahead * drift / (speed * speed - drift * drift).sqrt();
    assert!((sail(0.0).0 - off).abs() < 1e-6, "{} instead of {off}", sail(0.0).0);
    let (still, integral) = sail(0.15);
    assert!(still.abs() < 1e-3, "{still}");
    assert!((0.15 * integral - off).abs() < 1e-2, "the integral holds what the error did");
}

#[test]
fn a_path_reference_stays_on_its_leg() {
    // Legs 4 m apart, and a vessel 3 m from its own: the next leg is nearer.
    let path = Path::lawn_mower([0.0, 0.0], 0.0, 60.0, 4.0, 3, 2.0, Side::Starboard).unwrap();
    let mut follower = PathReference::new(0.0, 3.0);
    for k in 0..50 {
        let foot = follower.project(&path, [f64::from(k), 3.0]);
        assert!((foot.s - f64::from(k)).abs() < 1e-9 && (foot.cross_track - 3.0).abs() < 1e-9);
    }
    let lost = follower.project(&path, [f64::NAN, 0.0]);
    assert!((lost.s - 49.0).abs() < 1e-9 && lost.cross_track.is_nan());
}

/// A lap in less than a step: a loop over the laps would take years.
#[test]
fn a_timed_reference_passes_any_number_of_laps_at_once() {
    let path = Path::circle([0.0, 0.0], 10.0, Side::Starboard, 0.0).unwrap();
    for speed in [1e3, 1e17] {
        let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(speed)).unwrap();
        let mut walker = TimedReference::new(&profile);
        walker.advance(&profile, 0.5);
        let s = walker.s(&profile);
        assert!((s / (0.5 * speed) - 1.0).abs() < 1e-9, "{speed} m/s: {s} m");
    }
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(1e300)).unwrap();
    let mut walker = TimedReference::new(&profile);
    walker.advance(&profile, 0.5);
    assert!(!walker.reference(&path, &profile).is_finite());
}

fn pose(x: f64, y: f64, course: f64) -> Pose {
    Pose { position: [x, y], course, curvature: 0.0 }
}

/// The shortest way; empty if the poses are equal.
fn shortest(from: &Pose, to: &Pose, radius: f64) -> Vec<Piece> {
    dubins(from, to, radius).swap_remove(0)
}

fn length(pieces: &[Piece]) -> f64 {
    pieces.iter().map(|piece| piece.length).sum()
}

/// Lengths that follow from the geometry.
#[test]
fn shortest_ways_of_known_length() {
    let way = |x, y, course| shortest(&pose(0.0, 0.0, 0.0), &pose(x, y, course), 2.0);
    assert!(way(0.0, 0.0, 0.0).is_empty() && way(0.0, 0.0, 4.0 * PI).is_empty());
    // Straight on; half a circle; a circle back to the own place; a quarter and a line.
    for (pieces, expected) in [
        (way(7.0, 0.0, 0.0), 7.0),
        (way(0.0, 4.0, PI), 2.0 * PI),
        (way(0.0, -4.0, -PI), 2.0 * PI),
        (way(2.0, 7.0, FRAC_PI_2), PI + 5.0),
        (way(-7.0, 0.0, 0.0), 4.0 * PI + 7.0),
        // Two quarters to different sides.
        (way(4.0, 4.0, 0.0), 2.0 * PI),
        // Three arcs: a place abeam with the same course, closer than two diameters.
        (way(0.0, 0.0, PI), 2.0 * (PI + 2.0 * PI / 3.0 + 2.0 * PI / 3.0)),
    ] {
        assert!((length(&pieces) - expected).abs() < 1e-9, "{} for {expected}: {pieces:?}", length(&pieces));
    }
}

proptest! {
    /// A way begins and ends at its poses without a corner, has the radius, and is no longer than another one: by a place on the
    /// straight line between both, or back in the other direction.
    #[test]
    fn a_shortest_way_joins_its_poses(
        from in (-30.0..30.0f64, -30.0..30.0f64, -9.0..9.0f64), to in (-30.0..30.0f64, -30.0..30.0f64, -9.0..9.0f64),
        radius in 0.5..12.0f64, share in 0.0..1.0f64, course in -3.2..3.2f64,
    ) {
        let (from, to) = (pose(from.0, from.1, from.2), pose(to.0, to.1, to.2));
        let pieces = shortest(&from, &to, radius);
        prop_assert!((1..=3).contains(&pieces.len()));
        let mut at = from;
        for piece in &pieces {
            prop_assert!(distance(piece.start, at.position) < 1e-9 && wrap(piece.course - at.course).abs() < 1e-9);
            prop_assert!(piece.curvature == 0.0 || (piece.curvature.abs() * radius - 1.0).abs() < 1e-12);
            at = piece.at(piece.length);
        }
        prop_assert!(distance(at.position, to.position) < 1e-6 && wrap(at.course - to.course).abs() < 1e-6);
        let middle = pose(
            from.position[0] + share * (to.position[0] - from.position[0]),
            from.position[1] + share * (to.position[1] - from.position[1]),
            course,
        );
        let detour = length(&shortest(&from, &middle, radius)) + length(&shortest(&middle, &to, radius));
        prop_assert!(length(&pieces) <= detour + 1e-6, "{} {detour}", length(&pieces));
        let all = dubins(&from, &to, radius);
        prop_assert!(all.len() <= 8 && all.windows(2).all(|pair| length(&pair[0]) <= length(&pair[1])));
        for way in &all {
            let last = way.last().unwrap();
            let end = last.at(last.length);
            prop_assert!(distance(end.position, to.position) < 1e-6 && wrap(end.course - to.course).abs() < 1e-6);
        }
        let back = |pose: Pose| Pose { course: pose.course + PI, ..pose };
        let reverse = length(&shortest(&back(to), &back(from), radius));
        prop_assert!((length(&pieces) - reverse).abs() < 1e-6, "{} {reverse}", length(&pieces));
    }

    /// What is left of a path from a place has its poses.
    #[test]
    fn the_rest_of_a_path_is_on_it(path in paths(), share in 0.0..1.0f64, later in 0.0..1.0f64) {
        let s = share * path.length();
        let rest = Path::new(path.pieces_from(s), false).unwrap();
        let expected = if path.is_closed() { path.length() } else { path.length() - s };
        prop_assert!((rest.length() - expected).abs() < 1e-9);
        let (here, there) = (rest.at(later * rest.length()), path.at(s + later * rest.length()));
        prop_assert!(distance(here.position, there.position) < 1e-6);
        // At joints the course of waypoints may jump by rounding.
        prop_assert!(wrap(here.course - there.course).abs() < 1e-6);
    }
}

/// An L-shaped area: distances to its nearest side or corner, and from outside.
#[test]
fn a_fence_has_the_distances_of_its_borders() {
    let corners = vec![[0.0, 0.0], [10.0, 0.0], [10.0, 4.0], [4.0, 4.0], [4.0, 10.0], [0.0, 10.0]];
    let reversed = corners.iter().rev().copied().collect();
    for corners in [corners, reversed] {
        let mut fence = Fence::default();
        assert_eq!(fence.margin([1e9, 0.0]), f64::INFINITY);
        fence.keep_in(Border::Polygon(corners)).unwrap();
        for (point, expected) in [
            ([2.0, 2.0], 2.0),
            ([9.5, 2.0], 0.5),
            // The inner corner is nearest.
            ([3.0, 3.0], 2.0_f64.sqrt()),
            ([7.0, 7.0], -3.0),
            ([5.0, 5.0], -1.0),
            ([-3.0, -4.0], -5.0),
            ([12.0, 2.0], -2.0),
        ] {
            assert!((fence.margin(point) - expected).abs() < 1e-12, "{point:?}: {}", fence.margin(point));
        }
        assert!(fence.margin([f64::NAN, 0.0]).is_nan());
        fence.keep_out(Border::Circle { centre: [2.0, 8.0], radius: 1.0 }).unwrap();
        assert!((fence.margin([2.0, 6.0]) - 1.0).abs() < 1e-12 && fence.margin([2.0, 8.5]) == -0.5);
        let line = |course: f64, length| Piece { start: [2.0, 2.0], course, curvature: 0.0, length };
        assert_eq!(fence.leaves(&[line(0.0, 7.9)]), None);
        assert_eq!(fence.leaves(&[line(FRAC_PI_2, 4.9)]), None);
        let at = fence.leaves(&[line(FRAC_PI_2, 20.0)]).unwrap();
        assert!((at[1] - 7.0).abs() < 0.011, "{at:?}");
        assert!(fence.leaves(&[line(f64::NAN, 1.0)]).is_some());
    }
    for (border, expected) in [
        (Border::Polygon(vec![]), NoArea::Corners),
        (Border::Polygon(vec![[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]]), NoArea::Corners),
        (Border::Polygon(vec![[0.0, 0.0], [1.0, 0.0], [f64::NAN, 3.0]]), NoArea::Number),
        (Border::Circle { centre: [0.0; 2], radius: 0.0 }, NoArea::Number),
    ] {
        assert_eq!(Fence::default().keep_in(border), Err(expected));
    }
}
