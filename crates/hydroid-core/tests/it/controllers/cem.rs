//! Plans by the cross-entropy method: known optimum, time limits, command limits, and the true plants.

use std::sync::Arc;

use hydroid_core::actuator::Limits;
use hydroid_core::control::cem::{Cost, Planner, PlannerOptions, SoftLimit};
use hydroid_core::control::{AffinePlant, Status};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{Path, Reference, Side, SpeedLimits, SpeedProfile, TimedReference};
use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::{BATCH, Predictor, Workspace};
use hydroid_core::vessel::{Command, State};

use crate::plant::Plant;
use proptest::prelude::*;

use crate::controllers::helm::{DT, under_way};

/// `du/dt = c_0 - u`, with `v = 0` and `dr/dt = c_1 - r`.
fn linear() -> EquationsSession {
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[2]), Term::monomial(&[3]), Term::monomial(&[4])];
    let mut coefficients = vec![0.0; 12];
    (coefficients[0], coefficients[2], coefficients[9], coefficients[11]) = (-1.0, 1.0, -1.0, 1.0);
    let mut session =
        EquationsSession::new(Arc::new(Equations::new(terms, coefficients, 3, 2, DT, 1).unwrap()));
    session.observe(&[0.0; 3]);
    session
}

fn at_speed(speed: f64) -> Reference {
    Reference {
        s: 0.0,
        position: [0.0; 2],
        velocity: [speed, 0.0],
        acceleration: [0.0; 2],
        course: 0.0,
        curvature: 0.0,
        speed,
    }
}

/// Only speed, effort and change of the first command.
fn quadratic() -> Cost {
    Cost {
        position: 0.0,
        heading: 0.0,
        speed: 1.0,
        effort: vec![0.02, 0.0],
        rate: vec![0.5, 0.0],
        ..Cost::tracking(2)
    }
}

/// A search alone, without the help of Gauss-Newton steps, needs more candidates than the defaults.
fn thorough(seed: u64) -> PlannerOptions {
    PlannerOptions { candidates: 350, elites: 35, iterations: 5, ..PlannerOptions::new(seed) }
}

fn planner(settings: PlannerOptions, cost: Cost, limits: &[Limits]) -> Planner {
    Planner::new(settings, cost, limits, 3, DT, 5.0).unwrap()
}

const WIDE: [Limits; 2] = [Limits::between([-4.0, 4.0]), Limits::between([-1.0, 1.0])];

/// The minimum of a quadratic form in the first commands by its normal equations, with `u_{k+1} = a u_k + b c_k`
/// exactly as in RK4.
fn optimum(horizon: usize, target: f64) -> f64 {
    let a = 1.0 - DT + DT * DT / 2.0 - DT.powi(3) / 6.0 + DT.powi(4) / 24.0;
    let (b, half, effort, rate) = (1.0 - a, 4.0, 0.02, 0.5);
    let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
    for k in 0..horizon {
        let answer: Vec<f64> = (0..horizon)
            .map(|j| if j <= k { b * a.powi(i32::try_from(k - j).unwrap()) } else { 0.0 })
            .collect();
        rows.push((answer, target));
        let one = |j: usize, value: f64| if j == k { value } else { 0.0 };
        rows.push(((0..horizon).map(|j| one(j, f64::sqrt(effort) / half)).collect(), 0.0));
        let change = |j: usize| if k > 0 && j == k - 1 { -1.0 } else { one(j, 1.0) };
        rows.push(((0..horizon).map(|j| f64::sqrt(rate) / half * change(j)).collect(), 0.0));
    }
    let mut normal = vec![vec![0.0; horizon + 1]; horizon];
    for (row, right) in &rows {
        for i in 0..horizon {
            for j in 0..horizon {
                normal[i][j] += row[i] * row[j];
            }
            normal[i][horizon] += row[i] * right;
        }
    }
    for i in 0..horizon {
        for k in i + 1..horizon {
            let factor = normal[k][i] / normal[i][i];
            for j in i..=horizon {
                normal[k][j] -= factor * normal[i][j];
            }
        }
    }
    let mut c = vec![0.0; horizon];
    for i in (0..horizon).rev() {
        let known: f64 = (i + 1..horizon).map(|j| normal[i][j] * c[j]).sum();
        c[i] = (normal[i][horizon] - known) / normal[i][i];
    }
    let residual = |(row, right): &(Vec<f64>, f64)| {
        (row.iter().zip(&c).map(|(r, c)| r * c).sum::<f64>() - right).powi(2)
    };
    rows.iter().map(residual).sum::<f64>() / horizon as f64
}

#[test]
fn the_plan_is_the_optimum_of_a_linear_vessel() {
    let best = optimum(20, 1.0);
    let cost = |iterations: usize, gauss_newton_steps: usize, seed: u64| {
        let settings = PlannerOptions { iterations, gauss_newton_steps, ..thorough(seed) };
        let mut planner = planner(settings, quadratic(), &WIDE);
        let (session, mut command) = (linear(), [0.0; 2]);
        planner.command(&session, [0.0; 3], &[at_speed(1.0); 20], &mut || false, &mut command).cost
    };
    for seed in 0..3 {
        let (few, many) = (cost(5, 0, seed), cost(40, 0, seed));
        let (once, twice) = (cost(1, 1, seed), cost(1, 2, seed));
        println!(
            "optimum {best:.4}, 5 iterations {few:.4}, 40 {many:.4}; 1 and a step {once:.6}, two {twice:.6}"
        );
        let rounding = 1.0 - 1e-9;
        assert!([few, many, once, twice].iter().all(|cost| *cost >= rounding * best), "nothing is better");
        assert!(few < 1.7 * best && many < 1.02 * best);
        // The residuals are linear in the commands: one step suffices, except for its limits.
        assert!(once < 1.001 * best && twice < 1.00001 * best);
    }
}

#[test]
fn a_plan_depends_on_its_seed_only_and_a_time_limit_returns_the_best_plan() {
    let session = linear();
    let run = |seed: u64, chunks: usize| {
        let mut planner = planner(thorough(seed), quadratic(), &WIDE);
        let (mut command, mut asked) = ([0.0; 2], 0);
        let mut stop = || {
            asked += 1;
            asked >= chunks
        };
        let plan = planner.command(&session, [0.0; 3], &[at_speed(1.0); 20], &mut stop, &mut command);
        (plan, planner.plan().to_vec())
    };
    assert_eq!(run(3, 99), run(3, 99));
    assert_ne!(run(3, 99).1, run(4, 99).1);
    let mut before = f64::INFINITY;
    for chunks in 1..=30 {
        let (plan, _) = run(3, chunks);
        // Five whole chunks and 30 candidates are an iteration.
        let (whole, rest) = (chunks / 6, chunks % 6);
        assert_eq!((plan.tried, plan.iterations), (350 * whole + BATCH * rest, whole));
        assert!(plan.cost <= before, "more time is never worse");
        before = plan.cost;
    }
}

/// If the time suffices for a few candidates only, and none of them is better, the command is from the last plan,
/// shifted by one sample with its last row repeated.
#[test]
fn the_shifted_plan_is_where_the_next_search_starts() {
    let mut session = linear();
    let (mut work, mut command) = (Workspace::new(), [0.0; 2]);
    // A converged search: samples with a deviation of 0.01 % hardly improve it.
    let settings = PlannerOptions { iterations: 60, least_deviation: 1e-4, ..thorough(1) };
    let mut planner = planner(settings, quadratic(), &WIDE);
    // The reference accelerates, so that the rows of the plan differ.
    let ramp =
        |from: i32| -> Vec<Reference> { (from..from + 20).map(|k| at_speed(0.05 * f64::from(k))).collect() };
    planner.command(&session, [0.0; 3], &ramp(1), &mut || false, &mut command);
    let old = planner.plan().to_vec();
    assert!((old[2] - old[0]).abs() > 0.05, "rows that can be told apart: {old:?}");
    session.advance(&command);
    let mut alone = planner.clone();
    let plan = planner.command(&session, [0.0; 3], &ramp(2), &mut || true, &mut command);
    assert_eq!(plan.tried, BATCH);
    let mut shifted = [0.0; 2];
    let nowhere = [f64::NAN, 0.0, 0.0];
    let blind = alone.command(&session, nowhere, &ramp(2), &mut || true, &mut shifted);
    assert_eq!(blind.status, Status::Blind);
    assert_eq!(alone.plan()[..38], old[2..]);
    assert_eq!(alone.plan()[38..], old[38..]);
    // It is the first candidate: the result costs no more, and equals it if no sample is better.
    let mut y = [0.0; 60];
    let mut cost = |plan: &[f64]| {
        session.rollout(plan, &mut work, &mut y);
        let speeds = y.chunks_exact(3).zip(ramp(2)).map(|(y, at)| (y[0].hypot(y[1]) - at.speed).powi(2));
        let efforts = plan.chunks_exact(2).map(|c| 0.02 * (c[0] / 4.0).powi(2));
        let before = std::iter::once(old[0]).chain(plan.chunks_exact(2).map(|c| c[0]));
        let changes = plan.chunks_exact(2).zip(before).map(|(c, b)| 0.5 * ((c[0] - b) / 4.0).powi(2));
        (speeds.sum::<f64>() + efforts.sum::<f64>() + changes.sum::<f64>()) / 20.0
    };
    let (start, unshifted) = (cost(alone.plan()), cost(&old));
    assert!(plan.cost <= start * (1.0 + 1e-12), "{} of {start}", plan.cost);
    assert!(start < 0.9 * unshifted, "{start} beside {unshifted}");
}

/// A held plan of a model with samples of `DT` is the plan of the same model with samples of `hold DT`, whose step is exact.
#[test]
fn held_commands_are_planned_as_in_longer_samples() {
    const HOLD: usize = 4;
    // `x_{k+1} = x_k + DT c` in each output, with one stage of Runge-Kutta: exact for any sample time.
    let integrators = |dt: f64| {
        let terms = vec![Term::monomial(&[3]), Term::monomial(&[4])];
        let equations = Equations::new(terms, vec![1.0, 0.0, 0.0, 0.0, 0.0, 1.0], 3, 2, dt, 1).unwrap();
        let mut session = EquationsSession::new(Arc::new(equations));
        session.observe(&[0.0; 3]);
        session
    };
    let long = HOLD as f64 * DT;
    let settings = PlannerOptions { horizon: 5, ..PlannerOptions::new(9) };
    let held = PlannerOptions { hold: HOLD, ..settings };
    let target: Vec<Reference> = (1..=5).map(|k| at_speed(0.3 * f64::from(k))).collect();
    let mut coarse = Planner::new(settings, quadratic(), &WIDE, 3, long, 5.0).unwrap();
    let mut fine = Planner::new(held, quadratic(), &WIDE, 3, DT, 5.0).unwrap();
    let (mut one, mut other) = ([0.0; 2], [0.0; 2]);
    coarse.command(&integrators(long), [0.0; 3], &target, &mut || false, &mut one);
    let mut session = integrators(DT);
    let plan = fine.command(&session, [0.0; 3], &target, &mut || false, &mut other);
    assert!(plan.tried > 100);
    for (a, b) in coarse.plan().iter().zip(fine.plan()) {
        assert!((a - b).abs() < 1e-9, "{:?} {:?}", coarse.plan(), fine.plan());
    }
    // The command lasts for HOLD samples, and nothing is planned between.
    for k in 1..=HOLD {
        session.advance(&other);
        let before = other;
        let next = fine.command(&session, [0.0; 3], &target, &mut || false, &mut other);
        assert_eq!((next.tried == 0, before == other), (k < HOLD, k < HOLD), "{k}");
    }
    // Without a position the command goes on, and the status says so.
    fine.reset();
    fine.command(&session, [0.0; 3], &target, &mut || false, &mut other);
    let blind = fine.command(&session, [f64::NAN, 0.0, 0.0], &target, &mut || false, &mut other);
    assert_eq!(blind.status, Status::Blind);
}

/// A command that is held begins with a ramp at the limit of its rate.
#[test]
fn held_commands_keep_the_limit_of_their_rate() {
    let limits = WIDE.map(|limits| limits.with_rate(2.0));
    let settings = PlannerOptions { hold: 5, horizon: 6, ..PlannerOptions::new(4) };
    let mut planner = planner(settings, Cost { rate: vec![0.0; 2], ..quadratic() }, &limits);
    let mut session = linear();
    let (mut command, mut before) = ([0.0; 2], [0.0; 2]);
    let mut most = 0.0_f64;
    for _ in 0..40 {
        let plan = planner.command(&session, [0.0; 3], &[at_speed(2.0); 6], &mut || false, &mut command);
        assert!(plan.cost.is_finite());
        for (now, last) in command.iter().zip(&before) {
            most = most.max((now - last).abs());
        }
        before = command;
        session.advance(&command);
    }
    assert!(most <= 2.0 * DT * (1.0 + 1e-9) && most > 1.99 * DT, "{most}");
    let mut y = [0.0; 3];
    session.output(&mut y);
    assert!(y[0] > 1.5, "{y:?}");
}

#[test]
fn soft_limits_are_kept_with_large_weights() {
    let session = linear();
    let top = |weight: f64| {
        let limit = SoftLimit { output: 0, range: [-1.0, 0.3], weight };
        let cost = Cost { soft_limits: vec![limit], ..quadratic() };
        let settings = PlannerOptions { iterations: 20, ..PlannerOptions::new(2) };
        let mut planner = planner(settings, cost, &WIDE);
        let (mut work, mut command, mut y) = (Workspace::new(), [0.0; 2], [0.0; 60]);
        planner.command(&session, [0.0; 3], &[at_speed(1.0); 20], &mut || false, &mut command);
        session.rollout(planner.plan(), &mut work, &mut y);
        y.chunks_exact(3).map(|row| row[0]).fold(0.0, f64::max)
    };
    let (cheap, dear) = (top(0.0), top(1e3));
    assert!(cheap > 0.6 && dear < 0.32, "{cheap} and {dear}");
}

/// At an optimum on a limit, the step keeps the limit and moves the free commands.
#[test]
fn a_gauss_newton_step_keeps_limits_and_never_raises_the_cost() {
    let session = linear();
    let narrow = [Limits::between([-0.5, 0.6]).with_rate(2.0), Limits::between([-1.0, 1.0])];
    let run = |gauss_newton_steps: usize| {
        let settings = PlannerOptions { iterations: 2, gauss_newton_steps, ..PlannerOptions::new(5) };
        let mut planner = planner(settings, quadratic(), &narrow);
        let mut command = [0.0; 2];
        let plan = planner.command(&session, [0.0; 3], &[at_speed(1.0); 20], &mut || false, &mut command);
        (plan.cost, planner.plan().iter().step_by(2).copied().collect::<Vec<f64>>())
    };
    let mut before = f64::INFINITY;
    for gauss_newton_steps in 0..5 {
        let (cost, speeds) = run(gauss_newton_steps);
        println!("{gauss_newton_steps} steps: {cost:.6}");
        assert!(cost <= before);
        before = cost;
        let changes = speeds.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!(changes.chain([speeds[0].abs()]).all(|change| change <= 2.0 * DT * (1.0 + 1e-9)));
        assert!(speeds.iter().all(|c| (-0.5..=0.6).contains(c)));
    }
    let (_, speeds) = run(4);
    // 1 m/s is out of reach: the largest command, at the rate limit.
    assert!((speeds[0] - 0.2).abs() < 1e-9 && (speeds[10] - 0.6).abs() < 1e-9, "{speeds:?}");
}

/// A vessel that drifts to starboard and steers against it follows its path without cost.
#[test]
fn the_cost_uses_the_course_over_ground() {
    // du/dt = dv/dt = 0, dr/dt = c_1 - r.
    let terms = vec![Term::monomial(&[2]), Term::monomial(&[3]), Term::monomial(&[4])];
    let mut coefficients = vec![0.0; 9];
    (coefficients[6], coefficients[8]) = (-1.0, 1.0);
    let equations = Arc::new(Equations::new(terms, coefficients, 3, 2, DT, 1).unwrap());
    let plan = |v: f64, heading: f64| {
        let mut session = EquationsSession::new(Arc::clone(&equations));
        session.observe(&[(1.0 - v * v).sqrt(), v, 0.0]);
        let cost = Cost { position: 0.0, ..Cost::tracking(2) };
        let mut planner = planner(PlannerOptions::new(3), cost, &WIDE);
        let mut command = [0.0; 2];
        let pose = [0.0, 0.0, heading];
        (planner.command(&session, pose, &[at_speed(1.0); 20], &mut || false, &mut command).cost, command)
    };
    let (along, command) = plan(0.3, -0.3_f64.asin());
    assert!(along < 1e-9 && command[1].abs() < 1e-3, "{along} {command:?}");
    let (heading, _) = plan(0.3, 0.0);
    assert!(heading > 1e-3, "{heading}");
    // At zero speed the course is not defined, and the heading counts.
    let (still, _) = plan(0.0, 0.0);
    assert!(still < 1e-9);
}

/// With the plants themselves as models: circles in all modes, with a known state.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn cem_controls_the_hydrofoil() {
    for (speed, radius) in [(1.5, 15.0), (4.0, 30.0)] {
        let drawn = circled(speed, radius, 0);
        let descended = circled(speed, radius, 2);
        println!("{speed} m/s: {drawn:.3} m, with steps downhill {descended:.4} m");
        assert!(drawn < 0.15 && descended < 0.2 * drawn, "{speed} m/s: {drawn} {descended}");
    }
}

/// Root mean square distance from the reference on a circle \[m\].
fn circled(speed: f64, radius: f64, gauss_newton_steps: usize) -> f64 {
    let vessel = Craft::hydrofoil();
    let limits = AffinePlant::limits(&vessel)
        .into_iter()
        .map(|l| l.with_rate(2.0 * (l.high - l.low)))
        .collect::<Vec<_>>();
    let model = CraftModel::new(vessel.clone(), DT).unwrap();
    let path = Path::circle([0.0, 0.0], radius, Side::Starboard, 0.0).unwrap();
    let profile = SpeedProfile::new(&path, &SpeedLimits::cruise(speed)).unwrap();
    let settings = PlannerOptions {
        candidates: 60,
        elites: 8,
        iterations: 3,
        gauss_newton_steps,
        ..PlannerOptions::new(7)
    };
    let mut planner = planner(settings, Cost::tracking(2), &limits);
    let mut session = CraftSession::new(&model);
    let mut state = under_way(&vessel, &path, &profile, 0.0, 0.5);
    let plant = Plant::new(&vessel);
    let (mut walker, mut command) = (TimedReference::new(&profile), [0.0; 2]);
    let (mut squares, mut count) = (0.0, 0.0);
    for k in 0..160 {
        session.observe(&state.nu());
        let mut ahead = walker;
        let references: Vec<Reference> = (0..20)
            .map(|_| {
                ahead.advance(&profile, DT);
                ahead.reference(&path, &profile)
            })
            .collect();
        let pose = [state.x, state.y, state.psi];
        let plan = planner.command(&session, pose, &references, &mut || false, &mut command);
        assert!(plan.status < Status::Lost, "{k}: {plan:?}");
        if k >= 80 {
            let here = walker.reference(&path, &profile);
            squares += (state.x - here.position[0]).powi(2) + (state.y - here.position[1]).powi(2);
            count += 1.0;
        }
        session.advance(&command);
        let held = Command { pp: command[0], rd: command[1] };
        for _ in 0..10 {
            state = plant.advance(&state, &held, 0.01);
        }
        walker.advance(&profile, DT);
    }
    f64::sqrt(squares / count)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn commands_keep_their_limits_for_any_observation(
        seed in 0u64..100, low in -3.0..0.5f64, wide in 0.1..3.0f64, rate in 0.05..10.0f64,
        seen in prop::collection::vec(prop_oneof![4 => -3.0..3.0f64, 1 => Just(f64::NAN), 1 => -1e200..1e200f64], 12),
    ) {
        let limits = [Limits::between([low, low + wide]).with_rate(rate), Limits::between([-0.5, 0.4]).with_rate(rate)];
        let settings = PlannerOptions { candidates: 60, elites: 6, iterations: 2, horizon: 6, ..PlannerOptions::new(seed) };
        let mut planner = planner(settings, Cost::tracking(2), &limits);
        let mut session = CraftSession::new(&CraftModel::new(Craft::simple(), DT).unwrap());
        session.observe(&[1.0, 0.0, 0.0]);
        let mut command = [0.0; 2];
        let mut last = [0.0f64.clamp(low, low + wide), 0.0];
        for seen in seen.chunks_exact(4) {
            session.observe(&seen[..3]);
            let pose = [seen[3], 0.1, 0.2];
            let plan = planner.command(&session, pose, &[at_speed(1.0); 6], &mut || false, &mut command);
            for i in 0..2 {
                prop_assert!((limits[i].low..=limits[i].high).contains(&command[i]));
                prop_assert!((command[i] - last[i]).abs() <= rate * DT * (1.0 + 1e-9));
            }
            prop_assert!(plan.cost.is_finite() || plan.status == Status::Blind);
            prop_assert!(pose[0].is_finite() || plan.status == Status::Blind);
            prop_assert!(pose[0].abs() < 5.0 || plan.status >= Status::Lost);
            last = command;
            session.advance(&command);
        }
    }
}

#[test]
fn invalid_options_are_refused() {
    let make =
        |settings, cost| Planner::new(settings, cost, &WIDE, 3, DT, 1.0).map(|_| ()).unwrap_err().to_string();
    let good = PlannerOptions::new(0);
    assert_eq!(
        make(PlannerOptions { elites: 400, ..good }, quadratic()),
        "the number of candidates is 60: 2 more than elites are needed"
    );
    assert_eq!(
        make(PlannerOptions { momentum: 1.0, ..good }, quadratic()),
        "the momentum is 1: 0 or more and less than 1 is needed"
    );
    assert_eq!(
        make(good, Cost { effort: vec![0.0], ..quadratic() }),
        "2 commands need as many limits, and there are 1"
    );
    let limit = SoftLimit { output: 3, range: [0.0, 1.0], weight: 1.0 };
    assert_eq!(
        make(good, Cost { soft_limits: vec![limit], ..quadratic() }),
        "the output of a limit is 3: the model has fewer outputs"
    );
    assert!(Planner::new(good, quadratic(), &WIDE, 2, DT, 1.0).is_err());
    let upside_down = [WIDE[0], Limits::between([1.0, 0.0])];
    assert!(Planner::new(good, quadratic(), &upside_down, 3, DT, 1.0).is_err());
    let session = CraftSession::new(&CraftModel::new(Craft::simple(), DT).unwrap());
    let mut command = [9.0; 2];
    let mut planner = planner(good, quadratic(), &WIDE);
    let start = State::REST;
    let pose = [start.x, start.y, start.psi];
    let plan = planner.command(&session, pose, &[at_speed(1.0); 20], &mut || false, &mut command);
    assert_eq!((plan.status, plan.tried, command), (Status::Blind, 0, [0.0; 2]));
}
