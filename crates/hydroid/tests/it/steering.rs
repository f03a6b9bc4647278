//! Vessels that are steered from where they are: from rest, from any heading, beside the path, in a current; and vessels that
//! cannot come to their path.

use hydroid::closed_loop::{ControlMethod, Elapsed, ModelSession, Pilot, Seen};
use hydroid::config::control::{ClosedLoopOptions, NamedModel, Setup, TaskKind};
use hydroid_core::control::Mode;
use hydroid_core::guidance::{Border, Fence};

fn setup(vessel: &str, controller: ControlMethod, task: TaskKind) -> Setup {
    let options = ClosedLoopOptions { controller, task, legs: Some(2), ..ClosedLoopOptions::default() };
    let model = NamedModel::read(vessel.as_ref()).unwrap();
    let mut setup = Setup::new(options, Some(model), None).unwrap();
    setup.tune(&mut hydroid::progress::silent()).unwrap();
    setup
}

/// How the vessel follows its commands.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Vessel {
    Sound,
    /// Its first actuator acts the other way.
    Reversed,
    /// It does not move.
    Moored,
}

/// A sample of a voyage.
#[derive(Clone, Debug)]
struct Row {
    t_s: f64,
    eta: [f64; 3],
    mode: Mode,
    status: &'static str,
    command: Vec<f64>,
    cross_track: f64,
}

/// Steers a vessel from a pose, at rest, in a current, until its task has ended.
fn sail(setup: &Setup, start: [f64; 3], current: [f64; 2], of: Vessel, most_s: f64) -> Vec<Row> {
    sail_by(setup, start, current, of, most_s, |_, _, _| ())
}

/// As [`sail`], by sensors that change pose and outputs at a time.
fn sail_by(
    setup: &Setup,
    start: [f64; 3],
    current: [f64; 2],
    of: Vessel,
    most_s: f64,
    sensors: impl FnMut(f64, &mut [f64; 3], &mut [f64]),
) -> Vec<Row> {
    sail_as(setup, |pilot| pilot, (start, current), of, most_s, sensors)
}

/// As [`sail_by`], with a pilot of another kind.
fn sail_as(
    setup: &Setup,
    kind: fn(Pilot) -> Pilot,
    (start, current): ([f64; 3], [f64; 2]),
    of: Vessel,
    most_s: f64,
    mut sensors: impl FnMut(f64, &mut [f64; 3], &mut [f64]),
) -> Vec<Row> {
    let dt = setup.scenario.dt_s;
    let (mut adapter, _) = setup.adapter().unwrap();
    let mut pilot: Pilot = kind(setup.pilot(adapter.as_ref(), None).unwrap());
    let mut vessel = setup.model.session();
    let outputs = vessel.outputs();
    let mut y = vec![0.0; outputs];
    vessel.observe(&y);
    let (mut eta, mut rows) = (start, Vec::new());
    let mut t_s = 0.0;
    while t_s < most_s {
        vessel.output(&mut y);
        if of == Vessel::Moored {
            y.fill(0.0);
        }
        let (sin, cos) = eta[2].sin_cos();
        let mut measured = vec![f64::NAN; outputs];
        measured[..3].copy_from_slice(&y[..3]);
        if of != Vessel::Moored {
            measured[0] += current[0] * cos + current[1] * sin;
            measured[1] += current[1] * cos - current[0] * sin;
        }
        let [u, v, r] = [measured[0], measured[1], measured[2]];
        let mut pose = eta;
        sensors(t_s, &mut pose, &mut measured);
        adapter.observe(&measured);
        let mut estimate = vec![0.0; outputs];
        adapter.output(&mut estimate);
        let session = ModelSession { predictor: &*adapter, weights: None };
        let elapsed = if rows.is_empty() { Elapsed::Start } else { Elapsed::Steps(1) };
        pilot.steer(elapsed, &Seen { pose, outputs: &measured, estimate: &estimate, session });
        rows.push(Row {
            t_s,
            eta,
            mode: pilot.mode(),
            status: pilot.status(),
            command: pilot.command().to_vec(),
            cross_track: pilot.guided().map_or(f64::NAN, |guided| guided.cross_track),
        });
        if pilot.mode().is_final()
            && rows.iter().rev().take(20).all(|row| row.mode.is_final())
            && rows.len() > 20
        {
            break;
        }
        let mut acting = pilot.command().to_vec();
        adapter.advance(&acting);
        if of == Vessel::Reversed {
            acting[0] = -acting[0];
        }
        vessel.advance(&acting);
        let (sin, cos) = (eta[2] + 0.5 * dt * r).sin_cos();
        eta = [eta[0] + dt * (u * cos - v * sin), eta[1] + dt * (u * sin + v * cos), eta[2] + dt * r];
        t_s += dt;
    }
    rows
}

/// Commands are within their limits and rates, from the neutral ones, unless they return to these at once.
fn check_commands(setup: &Setup, rows: &[Row]) {
    let limits = &setup.controller.limits;
    let mut last: Vec<f64> = limits.iter().map(|limits| limits.rest).collect();
    for row in rows {
        for ((limits, command), last) in limits.iter().zip(&row.command).zip(&last) {
            assert!((limits.low..=limits.high).contains(command), "{row:?}");
            let most = limits.rate * setup.scenario.dt_s * (1.0 + 1e-9) + 1e-9;
            assert!((command - last).abs() <= most || *command == limits.rest, "{row:?} after {last}");
            assert!(row.mode.steers() || *command == limits.rest, "{row:?}");
        }
        last.clone_from(&row.command);
    }
}

const METHODS: [ControlMethod; 4] = [
    ControlMethod::FeedbackLinearization,
    ControlMethod::Backstepping,
    ControlMethod::Autopilot,
    ControlMethod::CrossEntropy,
];

/// Starts in lengths of the vessel's tolerance: ahead of the start of the path, to starboard, heading.
const STARTS: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 3.1],
    [0.0, 15.0, 1.57],
    [0.0, -15.0, -1.57],
    [100.0, 30.0, 0.5],
    [-100.0, 0.0, 1.57],
    [1.5, 0.7, 0.4],
];

fn reaches_its_path(vessel: &str, method: ControlMethod, starts: &[[f64; 3]]) {
    let setup = setup(vessel, method, TaskKind::LawnMower);
    let tolerance = setup.controller.tolerance;
    let cruise = setup.scenario.track.cruise;
    let task_s = setup.scenario.track.duration_s().unwrap();
    for start in starts {
        let eta = [tolerance * start[0], tolerance * start[1], start[2]];
        let away_m = eta[0].hypot(eta[1]) + 8.0 * setup.controller.turning_radius;
        let most_s = 2.0 * (task_s + 2.0 * away_m / cruise) + 60.0;
        for current in [[0.0; 2], [0.0, 0.2 * cruise]] {
            let rows = sail(&setup, eta, current, Vessel::Sound, most_s);
            let last = rows.last().unwrap();
            let story = format!(
                "{vessel}, {method:?} from {start:?} in {current:?}: {last:?} of {most_s:.0} s, modes {:?}",
                rows.iter().map(|row| row.mode).fold(Vec::new(), |mut modes, mode| {
                    if modes.last() != Some(&mode) {
                        modes.push(mode);
                    }
                    modes
                })
            );
            check_commands(&setup, &rows);
            assert_eq!(last.mode, Mode::Arrived, "{story}");
            let off = rows.iter().filter(|row| row.mode == Mode::OnTask && row.cross_track.abs() > tolerance);
            assert!(off.count() * 20 < rows.len(), "{story}");
        }
    }
}

#[test]
fn a_control_law_reaches_its_path_from_rest_and_any_heading() {
    for vessel in ["hydrofoil", "simple"] {
        reaches_its_path(vessel, ControlMethod::FeedbackLinearization, &STARTS);
        reaches_its_path(vessel, ControlMethod::Backstepping, &STARTS);
    }
}

#[test]
fn an_autopilot_reaches_its_path_from_rest_and_any_heading() {
    reaches_its_path("hydrofoil", ControlMethod::Autopilot, &STARTS);
    reaches_its_path("../../vessels/otter.toml", ControlMethod::Autopilot, &STARTS[..5]);
}

#[test]
fn a_planner_reaches_its_path_from_rest() {
    reaches_its_path("hydrofoil", ControlMethod::CrossEntropy, &[STARTS[0], STARTS[2]]);
}

/// A vessel that does not do what its model says is stopped near where it was, and its commands are neutral then.
#[test]
fn a_vessel_that_cannot_reach_its_path_is_stopped() {
    for method in METHODS {
        let setup = setup("hydrofoil", method, TaskKind::LawnMower);
        for of in [Vessel::Reversed, Vessel::Moored] {
            let rows = sail(&setup, [0.0, 0.0, 0.0], [0.0; 2], of, 600.0);
            check_commands(&setup, &rows);
            let last = rows.last().unwrap();
            assert_eq!((last.mode, last.status), (Mode::Stopped, "stopped"), "{method:?}, {of:?}: {last:?}");
            let at = rows.iter().position(|row| row.mode == Mode::Stopped).unwrap();
            let far = rows[at].eta[0].hypot(rows[at].eta[1]);
            assert!(rows[at].t_s < 90.0 && far < 100.0, "{method:?}, {of:?}: {:?}", rows[at]);
        }
    }
}

/// A rectangle in the frame of the task, from south-west to north-east.
fn rectangle([south, west]: [f64; 2], [north, east]: [f64; 2]) -> Border {
    Border::Polygon(vec![[south, west], [north, west], [north, east], [south, east]])
}

fn fenced(mut setup: Setup, keep_in: Border, keep_out: Option<Border>) -> Setup {
    let mut fence = Fence::default();
    fence.keep_in(keep_in).unwrap();
    if let Some(border) = keep_out {
        fence.keep_out(border).unwrap();
    }
    setup.scenario.track = setup.scenario.track.within(fence).unwrap();
    setup
}

/// Of the ways to a task, one that stays within the fence is taken; without one the vessel is not steered. A vessel outside is
/// stopped at once, and so is one that a current carries out.
#[test]
fn a_vessel_stays_within_its_fence() {
    let start = [0.0, -4.0, 3.1];
    for method in [ControlMethod::FeedbackLinearization, ControlMethod::Autopilot] {
        let open = setup("hydrofoil", method, TaskKind::LawnMower);
        let radius = open.controller.turning_radius;
        let rows = sail(&open, start, [0.0; 2], Vessel::Sound, 900.0);
        assert_eq!(rows.last().unwrap().mode, Mode::Arrived);
        let corners = |border: f64| [[-border, -border], [400.0, 400.0]];
        // Where the open way goes is closed, on the side to which it turns.
        let far = rows.iter().map(|row| row.eta).min_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
        let side = far[1] - start[1];
        let closed = [start[1] + 0.3 * side, start[1] + 100.0 * side];
        let keep_out = rectangle(
            [-100.0, closed[0].min(closed[1])],
            [start[0] - 0.5 * radius, closed[0].max(closed[1])],
        );
        let [low, high] = corners(12.0 * radius);
        let setup = fenced(open.clone(), rectangle(low, high), Some(keep_out));
        let fence = setup.scenario.track.fence.clone();
        assert!(rows.iter().any(|row| fence.margin([row.eta[0], row.eta[1]]) < 0.0), "{method:?}: {far:?}");
        let rows = sail(&setup, start, [0.0; 2], Vessel::Sound, 900.0);
        check_commands(&setup, &rows);
        let nearest =
            rows.iter().map(|row| fence.margin([row.eta[0], row.eta[1]])).fold(f64::INFINITY, f64::min);
        let last = rows.last().unwrap();
        assert_eq!(last.mode, Mode::Arrived, "{method:?}: {last:?}, {nearest}");
        assert!(nearest >= 0.0, "{method:?}: {nearest}");

        // No room to turn.
        let [low, high] = [[-0.5 * radius, -0.5 * radius], [400.0, 400.0]];
        let narrow = fenced(open.clone(), rectangle(low, high), None);
        let rows = sail(&narrow, [0.0, 0.0, 3.1], [0.0; 2], Vessel::Sound, 60.0);
        assert!(rows.iter().all(|row| row.mode == Mode::Stopped), "{method:?}: {:?}", rows.last());
        check_commands(&narrow, &rows);
        // Outside.
        let rows = sail(&narrow, [-0.6 * radius, 0.0, 0.0], [0.0; 2], Vessel::Sound, 60.0);
        assert!(rows.iter().all(|row| row.mode == Mode::Stopped), "{method:?}: {:?}", rows.last());
        check_commands(&narrow, &rows);
        // Carried out.
        let rows = sail(&setup, start, [0.0, -20.0], Vessel::Sound, 60.0);
        let out = rows.iter().position(|row| fence.margin([row.eta[0], row.eta[1]]) < 0.0).unwrap();
        assert!(rows[out..].iter().all(|row| row.mode == Mode::Stopped), "{method:?}: {:?}", rows[out]);
        check_commands(&setup, &rows);
    }
    let open = setup("hydrofoil", ControlMethod::Autopilot, TaskKind::LawnMower);
    let mut fence = Fence::default();
    fence.keep_in(rectangle([-10.0, -10.0], [30.0, 10.0])).unwrap();
    let error = open.scenario.track.within(fence).unwrap_err().to_string();
    assert!(error.starts_with("the path leaves the fence at 30.0 m north, 0.0 m east"), "{error}");
}

/// A current that is stronger than the vessel carries it away: it is stopped.
#[test]
fn a_vessel_in_a_current_that_is_too_strong_is_stopped() {
    let setup = setup("hydrofoil", ControlMethod::FeedbackLinearization, TaskKind::LawnMower);
    let rows = sail(&setup, [0.0; 3], [-20.0, 0.0], Vessel::Sound, 600.0);
    check_commands(&setup, &rows);
    assert_eq!(rows.last().unwrap().mode, Mode::Stopped);
    assert!(rows.len() < 600, "{}", rows.len());
}

/// A sensor that is wrong from a turn on: what it shows, from what it showed then, for a time since then \[s\].
type Fault = fn(f64, [f64; 3], &mut [f64; 3], &mut [f64]);

/// A vessel whose pose and velocities contradict each other is not steered, whichever is wrong, and goes on when they agree again.
#[test]
fn sensors_that_contradict_each_other_do_not_steer() {
    let faults: [(&str, f64, Fault); 7] = [
        ("frozen compass", 5.0, |_, first, pose, _| pose[2] = first[2]),
        ("compass that jumps", 1.2, |_, _, pose, _| pose[2] += 1.57),
        ("mirrored compass", 5.0, |_, first, pose, _| pose[2] = 2.0 * first[2] - pose[2]),
        ("frozen receiver", 8.0, |_, first, pose, _| pose[..2].copy_from_slice(&first[..2])),
        ("receiver that jumps", 1.2, |_, _, pose, _| pose[0] += 40.0),
        ("receiver that walks", 25.0, |since, _, pose, _| pose[1] += 0.5 * since),
        ("yaw rate in deg/s", 8.0, |_, _, _, outputs| outputs[2] *= 57.3),
    ];
    for vessel in ["hydrofoil", "../../vessels/otter.toml"] {
        let setup = setup(vessel, ControlMethod::Autopilot, TaskKind::LawnMower);
        for (name, most_s, fault) in faults {
            let mut first = None;
            // A sensor that comes back soon is believed again; one that does not is a stop.
            let until_s = if name.contains("frozen") { 8.0 } else { 60.0 };
            let rows = sail_by(&setup, [0.0; 3], [0.0; 2], Vessel::Sound, 900.0, |t, pose, outputs| {
                if first.is_none() && t > 5.0 && outputs[2].abs() > 0.1 {
                    first = Some((t, *pose));
                }
                if let Some((at, seen)) = first.filter(|(at, _)| t < at + until_s) {
                    fault(t - at, seen, pose, outputs);
                }
            });
            check_commands(&setup, &rows);
            let (at, _) = first.unwrap();
            let blind = rows.iter().find(|row| row.t_s > at && row.mode == Mode::Blind);
            let story =
                format!("{vessel}, {name}, from {at:.1} s on: {:?}, at last {:?}", blind, rows.last());
            assert!(blind.is_some_and(|row| row.t_s <= at + most_s), "{story}");
            let expected = if name.contains("frozen") { Mode::Arrived } else { Mode::Stopped };
            assert_eq!(rows.last().unwrap().mode, expected, "{story}");
        }
    }
}

/// Normal numbers, nearly: sums of twelve uniform ones.
fn noise(mut random: u64) -> impl FnMut() -> f64 {
    move || {
        let mut sum = -6.0;
        for _ in 0..12 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (random >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }
}

/// The noise of receiver and compass was steered with: 200 reversals of a thruster in a minute.
#[test]
fn the_noise_of_a_measured_pose_is_not_steered_with() {
    for (vessel, method) in [
        ("hydrofoil", ControlMethod::FeedbackLinearization),
        ("hydrofoil", ControlMethod::Backstepping),
        ("../../vessels/otter.toml", ControlMethod::Autopilot),
    ] {
        let mut setup = setup(vessel, method, TaskKind::LawnMower);
        // A tolerance of six deviations of a position.
        let cruise = setup.scenario.track.cruise;
        setup.controller.tolerance = 3.0 * cruise;
        let (position, heading) = (0.5 * cruise, 0.035);
        let in_noise = |kind: fn(Pilot) -> Pilot| {
            let mut noise = noise(11);
            let rows =
                sail_as(&setup, kind, ([0.0; 3], [0.3 * cruise, 0.0]), Vessel::Sound, 900.0, |_, pose, _| {
                    for (x, deviation) in pose.iter_mut().zip([position, position, heading]) {
                        *x += deviation * noise();
                    }
                });
            assert_eq!(rows.last().unwrap().mode, Mode::Arrived, "{vessel} {method:?}: {:?}", rows.last());
            let limits = &setup.controller.limits;
            let changes = rows.windows(2).flat_map(|rows| {
                let pairs = rows[0].command.iter().zip(&rows[1].command).zip(limits);
                pairs.map(|((a, b), limits)| (b - a).abs() / (limits.high - limits.low)).collect::<Vec<_>>()
            });
            let variation = changes.sum::<f64>() / rows.last().unwrap().t_s;
            let off = rows.iter().map(|row| row.cross_track).filter(|off| off.is_finite());
            let square = off.clone().map(|off| off * off).sum::<f64>() / off.count() as f64;
            (variation, square.sqrt())
        };
        let (filtered, raw) = (in_noise(|pilot| pilot), in_noise(Pilot::of_estimates));
        let story = format!("{vessel} {method:?}: {filtered:?} against {raw:?}");
        assert!(filtered.0 < 0.33 * raw.0 && filtered.1 < 1.2 * raw.1, "{story}");
    }
}

/// Usual errors are no contradiction: noise and slow errors of the receiver, noise, bias and lag of compass and gyro.
#[test]
fn usual_errors_of_sensors_do_not_end_the_steering() {
    for vessel in ["hydrofoil", "../../vessels/otter.toml"] {
        let setup = setup(vessel, ControlMethod::Autopilot, TaskKind::LawnMower);
        let mut noise = noise(7);
        let dt = setup.scenario.dt_s;
        let (mut slow, mut lagged) = ([0.0; 2], 0.0);
        let rows = sail_by(&setup, [0.0; 3], [0.2, -0.1], Vessel::Sound, 900.0, |_, pose, outputs| {
            for (at, slow) in pose.iter_mut().zip(&mut slow) {
                *slow = 0.99 * *slow + 0.1 * noise();
                *at += *slow + 0.15 * noise();
            }
            lagged += dt / 0.3 * (pose[2] - lagged);
            pose[2] = lagged + 0.03 * noise() + 0.05;
            outputs[0] += 0.05 * noise();
            outputs[1] += 0.05 * noise();
            outputs[2] += 0.02 * noise() + 0.005;
        });
        check_commands(&setup, &rows);
        let blind = rows.iter().filter(|row| row.mode == Mode::Blind).count();
        assert_eq!((blind, rows.last().unwrap().mode), (0, Mode::Arrived), "{vessel}: {:?}", rows.last());
    }
}

/// Random vessels, controllers, starts up to 200 tolerances away and currents of up to 40 % of the speed, from rest. Without a
/// fault at least 95 % arrive. Commands are always within limits and rates, and every loop ends. `HYDROID_LOOPS` sets their
/// number.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn random_closed_loops_arrive_or_are_stopped() {
    let count = std::env::var("HYDROID_LOOPS").ok().and_then(|count| count.parse().ok()).unwrap_or(200);
    let otter = "../../vessels/otter.toml";
    let [fl, backstepping, pid, _] = METHODS;
    let kinds = [
        ("hydrofoil", fl),
        ("hydrofoil", backstepping),
        ("hydrofoil", pid),
        ("simple", fl),
        ("simple", backstepping),
        ("simple", pid),
        (otter, pid),
    ];
    let setups: Vec<Setup> =
        kinds.into_iter().map(|(vessel, method)| setup(vessel, method, TaskKind::LawnMower)).collect();
    let mut random = 1_u64;
    let mut uniform = move |low: f64, high: f64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut sound, mut failures) = (0, Vec::new());
    for k in 0..count {
        let setup = &setups[k % setups.len()];
        let (tolerance, cruise) = (setup.controller.tolerance, setup.scenario.track.cruise);
        let [away, bearing] = [tolerance * uniform(0.0, 200.0), uniform(-3.2, 3.2)];
        let start = [away * bearing.cos(), away * bearing.sin(), uniform(-3.2, 3.2)];
        let [speed, towards] = [cruise * uniform(0.0, 0.4), uniform(-3.2, 3.2)];
        let current = [speed * towards.cos(), speed * towards.sin()];
        let of = match uniform(0.0, 1.0) {
            x if x < 0.1 => Vessel::Reversed,
            x if x < 0.2 => Vessel::Moored,
            _ => Vessel::Sound,
        };
        let task_s = setup.scenario.track.duration_s().unwrap();
        let most_s = 8.0 * (task_s + (away + 8.0 * setup.controller.turning_radius) / cruise) + 600.0;
        let rows = sail(setup, start, current, of, most_s);
        check_commands(setup, &rows);
        let last = rows.last().unwrap();
        let story = format!(
            "{k}: {:?} of {}, {start:?}, {current:?}, {of:?}: {last:?}",
            setup.controller.method, setup.plant_name
        );
        assert!(last.mode.is_final(), "{story}");
        if of == Vessel::Sound {
            sound += 1;
            if last.mode != Mode::Arrived {
                println!("{story}");
                failures.push(story);
            }
        }
    }
    assert!(20 * failures.len() <= sound, "{} of {sound} did not arrive", failures.len());
}
