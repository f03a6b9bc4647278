//! Simulated records: reproducibility and properties of the excitation.

use std::ops::ControlFlow;

use hydroid::excitation::{Circle, Excitation, LawnMower, LowSpeed, Turn};
use hydroid::log;
use hydroid::simulate::{Options, SimulateError, Simulated, simulate};
use hydroid_core::craft::Craft;
use hydroid_core::vessel::{Command, State};

fn run(options: &Options) -> Simulated {
    simulate(options, &mut |_| ControlFlow::Continue(())).unwrap_or_else(|e| panic!("{e}"))
}

fn hydrofoil(excitation: Excitation) -> Options {
    Options::new(Craft::hydrofoil(), excitation)
}

fn csv(record: &Simulated) -> Vec<u8> {
    let mut bytes = Vec::new();
    record.write_csv(&mut bytes).expect("memory does not fail");
    bytes
}

fn short(excitation: Excitation, seed: u64) -> Options {
    Options { duration_s: 120.0, seed, ..hydrofoil(excitation) }
}

fn speeds(record: &Simulated) -> impl Iterator<Item = f64> + '_ {
    record.states().iter().map(|state| state.u)
}

fn top(record: &Simulated) -> f64 {
    speeds(record).fold(f64::NEG_INFINITY, f64::max)
}

fn share_above(record: &Simulated, level: f64) -> f64 {
    speeds(record).filter(|u| *u > level).count() as f64 / record.len() as f64
}

#[test]
fn a_record_is_the_log_that_is_read_from_its_file() {
    for vessel in [Craft::hydrofoil(), Craft::simple()] {
        let record = run(&Options { duration_s: 5.0, ..Options::new(vessel, Excitation::Mixed) });
        let log = record.to_log("run.csv");
        assert_eq!(log, log::read_from(&csv(&record)[..], "run.csv").unwrap());
        let mut bytes = Vec::new();
        log.write_csv(&mut bytes).unwrap();
        assert_eq!(bytes, csv(&record));
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    for excitation in [
        Excitation::Mixed,
        Excitation::LowSpeed(LowSpeed::default()),
        Excitation::LawnMower(LawnMower::default()),
    ] {
        let first = csv(&run(&short(excitation.clone(), 3)));
        assert_eq!(first, csv(&run(&short(excitation.clone(), 3))));
        assert_ne!(first, csv(&run(&short(excitation, 4))));
    }
}

#[test]
fn noise_leaves_commands_and_truth_alone() {
    let noisy = run(&short(Excitation::Mixed, 3));
    let quiet = run(&Options { noise_scale: 0.0, ..short(Excitation::Mixed, 3) });
    assert_eq!(noisy.commands(), quiet.commands());
    assert_eq!(noisy.states(), quiet.states());
    assert_ne!(noisy.measured(), quiet.measured());
    for (state, measured) in quiet.states().iter().zip(quiet.measured()) {
        assert_eq!(&state.nu(), &measured[..3]);
    }
}

#[test]
fn mixed_goes_through_both_modes_over_and_over() {
    for seed in [0, 1, 2] {
        let record = run(&Options { seed, ..hydrofoil(Excitation::Mixed) });
        assert_eq!(record.len(), 72_000);
        assert!(record.crossings(2.5) > 300, "{} crossings", record.crossings(2.5));
        let flown = share_above(&record, 2.5);
        assert!((0.4..0.65).contains(&flown), "{flown}");
        assert!(top(&record) > 5.3 && speeds(&record).fold(0.0, f64::min) < -1.7);
        let turned = record.states().iter().map(|s| s.r.abs()).fold(0.0, f64::max);
        assert!(turned > 0.6, "{turned}");
    }
}

#[test]
fn low_speed_stays_below_the_transition() {
    for vessel in [Craft::simple(), Craft::hydrofoil(), Craft::hydrofoil_low_speed()] {
        for seed in 0..5 {
            let options =
                Options { seed, ..Options::new(vessel.clone(), Excitation::LowSpeed(LowSpeed::default())) };
            let record = run(&options);
            assert!(top(&record) < 2.1, "{} m/s with {}", top(&record), vessel.name);
            assert!(top(&record) > 1.8, "it should not be idle: {} m/s", top(&record));
            assert!(speeds(&record).any(|u| u < -0.5), "astern as well");
        }
    }
}

#[test]
fn low_speed_stays_below_any_ceiling() {
    for ceiling in [0.5, 1.0, 10.0] {
        let record =
            run(&Options { duration_s: 1_200.0, ..hydrofoil(Excitation::LowSpeed(LowSpeed { ceiling })) });
        assert!(top(&record) < f64::min(ceiling, 2.5), "{} of {ceiling}", top(&record));
    }
}

/// Whether the vessel passed within `tolerance` of a point.
fn passed(record: &Simulated, x: f64, y: f64, tolerance: f64) -> bool {
    record.states().iter().any(|s| (s.x - x).hypot(s.y - y) < tolerance)
}

#[test]
fn a_lawn_mower_covers_its_legs_and_ends() {
    let legs = [1.8, 4.2, 1.5, 4.9, 3.0];
    for turn in [Turn::Arc, Turn::Sharp { speed: Some(1.4) }] {
        let plan = LawnMower { leg: Some(120.0), spacing: Some(30.0), turn, speeds: legs.to_vec() };
        let record = run(&hydrofoil(Excitation::LawnMower(plan)));
        assert!(record.len() < 72_000, "it ends after the last leg");
        for (k, speed) in legs.iter().enumerate() {
            let east = k as f64 * 30.0;
            for north in [20.0, 60.0, 100.0] {
                assert!(passed(&record, north, east, 6.0), "{turn:?}: leg {k} at {north} m");
            }
            // In the last third, speed and track are held.
            let going = record.states().iter().filter(|s| {
                let along = if k % 2 == 0 { s.x } else { 120.0 - s.x };
                (s.y - east).abs() < 10.0 && (65.0..85.0).contains(&along)
            });
            for state in going {
                assert!((state.u - speed).abs() < 0.35, "{turn:?}: leg {k}: {} of {speed} m/s", state.u);
                assert!((state.y - east).abs() < 2.0, "{turn:?}: leg {k}: {} m off", state.y - east);
            }
        }
        assert!(record.crossings(2.5) >= 3, "{}", record.crossings(2.5));
        assert!(share_above(&record, 2.5) > 0.1);
    }
}

#[test]
fn a_lawn_mower_without_speeds_lasts_and_visits_both_modes() {
    for seed in [0, 1, 2] {
        let record = run(&Options { seed, ..hydrofoil(Excitation::LawnMower(LawnMower::default())) });
        assert_eq!(record.len(), 72_000);
        let flown = share_above(&record, 2.5);
        assert!((0.15..0.6).contains(&flown), "{flown}");
        assert!(record.crossings(2.5) >= 10);
    }
}

/// Seen from the water, the commands of an open loop move the vessel as in still water; a path is held over ground.
#[test]
fn a_current_moves_the_vessel_over_ground() {
    let current = [0.3, -0.4];
    let options = Options { duration_s: 60.0, ..hydrofoil(Excitation::Mixed) };
    let (still, moved) = (run(&options), run(&Options { current, ..options.clone() }));
    assert_eq!(still.commands(), moved.commands());
    for (k, (a, b)) in still.states().iter().zip(moved.states()).enumerate() {
        let t = 0.1 * k as f64;
        assert!((b.x - a.x - 0.3 * t).abs() < 1e-9 && (b.y - a.y + 0.4 * t).abs() < 1e-9);
        let (sin, cos) = b.psi.sin_cos();
        assert!((b.u - a.u - 0.3 * cos + 0.4 * sin).abs() < 1e-12);
        assert!((b.v - a.v + 0.3 * sin + 0.4 * cos).abs() < 1e-12);
        assert!((a.r - b.r).abs() < 1e-12 && (a.psi - b.psi).abs() < 1e-12);
    }
    let plan = LawnMower { leg: Some(120.0), spacing: Some(30.0), turn: Turn::Arc, speeds: vec![2.0; 3] };
    let record = run(&Options { current, ..hydrofoil(Excitation::LawnMower(plan)) });
    for east in [0.0, 30.0, 60.0] {
        assert!(passed(&record, 60.0, east, 6.0), "leg at {east} m");
    }
    let wrong =
        simulate(&Options { current: [f64::NAN, 0.0], ..options }, &mut |_| ControlFlow::Continue(()))
            .unwrap_err();
    assert!(wrong.to_string().contains("the current"), "{wrong}");
}

#[test]
fn a_circle_is_held() {
    for (vessel, radius, speed) in
        [(Craft::hydrofoil(), 25.0, 4.0), (Craft::hydrofoil(), 15.0, 1.5), (Craft::simple(), 15.0, 2.0)]
    {
        let plan = Circle { radius: Some(radius), speed: Some(speed) };
        let record = run(&Options { duration_s: 300.0, ..Options::new(vessel, Excitation::Circle(plan)) });
        for state in &record.states()[600..] {
            let off = state.x.hypot(state.y - radius) - radius;
            assert!(off.abs() < 0.01 * radius, "{off} m at {speed} m/s");
            assert!((state.u - speed).abs() < 0.05 * speed, "{} of {speed} m/s", state.u);
        }
    }
}

#[test]
fn noise_has_the_stated_deviation_and_no_memory() {
    let record = run(&Options { noise_scale: 2.0, ..Options::new(Craft::simple(), Excitation::Mixed) });
    let ([u, v, r], force) = (Craft::simple().noise, Craft::simple().thrusters[0].force_noise);
    for (i, std) in [u, v, r, force.unwrap()].into_iter().enumerate() {
        let error = |k: usize| {
            let state = &record.states()[k];
            record.measured()[k][i] - [state.u, state.v, state.r, state.p_f][i]
        };
        let n = record.len();
        let mean = (0..n).map(error).sum::<f64>() / n as f64;
        let variance = (0..n).map(|k| error(k).powi(2)).sum::<f64>() / n as f64;
        let lag = (1..n).map(|k| error(k) * error(k - 1)).sum::<f64>() / n as f64 / variance;
        assert!((variance.sqrt() / (2.0 * std) - 1.0).abs() < 0.015, "{} of {}", variance.sqrt(), 2.0 * std);
        assert!(mean.abs() < 0.015 * 2.0 * std && lag.abs() < 0.015, "{mean} {lag}");
    }
}

#[test]
fn simulate_reproduces_the_golden_trajectories() {
    for (file, vessel) in [
        ("simple", Craft::simple()),
        ("hydrofoil", Craft::hydrofoil()),
        ("hydrofoil_low_speed_model", Craft::hydrofoil_low_speed()),
    ] {
        let path = format!("{}/../../tests/golden/golden_{file}.csv", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
            .collect();
        let given = Excitation::Given(rows.iter().map(|r| (r[0], Command { pp: r[1], rd: r[2] })).collect());
        let duration_s = given.natural_duration_s(0.1).expect("given commands have an end");
        let record = run(&Options { duration_s, ..Options::new(vessel, given) });
        assert_eq!(record.len(), rows.len());
        for (k, row) in rows.iter().enumerate() {
            assert!((record.time(k) - row[0]).abs() < 1e-12);
            let state: [f64; State::LEN] = record.states()[k].into();
            // The lag of the propeller is exact here, and integrated by the Runge-Kutta method in the reference.
            for (column, (ours, theirs)) in state.iter().zip(&row[3..]).enumerate() {
                let largest = rows.iter().map(|row| row[3 + column].abs()).fold(0.0, f64::max);
                assert!((ours - theirs).abs() < 1e-8 * largest, "{file}, row {k}: {ours} and {theirs}");
            }
        }
    }
}

#[test]
fn the_csv_has_the_columns_of_the_contract_and_reads_back() {
    let record = run(&short(Excitation::Mixed, 0));
    let text = String::from_utf8(csv(&record)).expect("text");
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some(
            "t [s],PP_cmd [N],RD_ang [rad],x [m],y [m],psi [rad],u [m/s],v [m/s],r [rad/s],\
             u_true [m/s],v_true [m/s],r_true [rad/s],P_f_true [N]"
        )
    );
    for (k, line) in lines.enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        let (state, measured) = (&record.states()[k], &record.measured()[k]);
        assert_eq!(cells[3..6], [state.x, state.y, state.psi]);
        assert_eq!(cells[6..9], measured[..3]);
        assert_eq!(cells[9..], [state.u, state.v, state.r, state.p_f]);
    }
    assert!(text.lines().nth(4).expect("a fourth row").starts_with("0.3,"));

    let simple = run(&Options { duration_s: 10.0, ..Options::new(Craft::simple(), Excitation::Mixed) });
    let text = String::from_utf8(csv(&simple)).expect("text");
    let header = text.lines().next().expect("a header");
    assert!(header.contains("RD_cmd [N s],") && header.ends_with(",P_f_true [N],P_f [N]"), "{header}");
    assert!(text.lines().all(|line| line.split(',').count() == 14));
}

#[test]
fn a_trajectory_has_outputs_inputs_and_truth() {
    let options = Options { duration_s: 30.0, ..Options::new(Craft::simple(), Excitation::Mixed) };
    let record = run(&options);
    let run = record.to_trajectory(&["r", "P_f", "psi"]).expect("measured columns");
    assert_eq!((run.len(), run.t0, run.dt), (300, 0.0, 0.1));
    let names: Vec<_> = run.outputs.channels().iter().map(|c| (c.name.as_str(), c.unit.as_str())).collect();
    assert_eq!(names, [("r", "rad/s"), ("P_f", "N"), ("psi", "rad")]);
    assert_eq!(run.inputs.channels()[1].unit, "N s");
    let truth = run.truth.expect("a simulated run");
    let (state, measured, command) = (&record.states()[99], &record.measured()[99], &record.commands()[99]);
    assert_eq!(run.outputs.row(99), [measured[2], measured[3], state.psi]);
    assert_eq!(truth.row(99), [state.r, state.p_f, state.psi]);
    assert_eq!(run.inputs.row(99), [command.pp, command.rd]);
}

#[test]
fn an_unknown_output_names_the_nearest() {
    let record = run(&short(Excitation::Mixed, 0));
    let error = record.to_trajectory(&["u", "ps"]).expect_err("not a column").to_string();
    assert!(error.contains("ps (did you mean psi?)"), "{error}");
    // The hydrofoil does not measure its propeller force.
    assert!(record.to_trajectory(&["P_f"]).is_err());
}

#[test]
fn progress_rises_to_one_and_may_break_off() {
    let mut seen = Vec::new();
    simulate(&hydrofoil(Excitation::Mixed), &mut |fraction| {
        seen.push(fraction);
        ControlFlow::Continue(())
    })
    .expect("a reference plant");
    assert!(seen.len() > 50 && seen.is_sorted() && seen.last() == Some(&1.0));

    let mut calls = 0;
    let stopped = simulate(&hydrofoil(Excitation::Mixed), &mut |_| {
        calls += 1;
        if calls == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(stopped, Err(SimulateError::Cancelled));
    assert_eq!(calls, 3);
}
