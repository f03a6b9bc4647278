//! Committees of difference equations against naive references: rollout, median, session and learning.

use std::sync::Arc;

use hydroid_core::adapt::{Adapter, CommitteeSession, Learning, Outcome, Rejection, increment_stride};
use hydroid_core::model::committee::{
    Committee, CommitteeError, CommitteeSimulation, DifferenceEquations, Limits, MOST_MEMBERS, Member, Past,
    Prior, Shape, weighted_median,
};
use hydroid_core::model::sparse::{EquationsError, Term};
use hydroid_core::predict::{Predictor, Workspace};
use proptest::prelude::*;

const DT: f64 = 0.1;

const UNLIMITED: Limits<'static> = Limits { low: &[f64::NEG_INFINITY; 2], high: &[f64::INFINITY; 2] };

/// White noise between -1 and 1, the same on every machine.
fn noise(k: usize, channel: usize) -> f64 {
    let x = (k as f64 * 12.9898 + channel as f64 * 78.233).sin() * 43_758.545_3;
    2.0 * (x - x.floor() - 0.5)
}

fn shape(lags: usize, clock: usize) -> Shape {
    Shape { outputs: 2, inputs: 1, lags, clock, dt: DT }
}

/// Terms over two lags, `z = [y0, y1, c, y0', y1', c', y0'', y1'', c'']`.
fn terms() -> Vec<Term> {
    vec![
        Term::constant(),
        Term::monomial(&[0, 1]),
        Term::signed_square(2, 2),
        Term::monomial(&[3]),
        Term::monomial(&[5]),
        Term::monomial(&[0, 8]),
        Term::monomial(&[6, 6]),
        Term::monomial(&[2, 4]),
        Term::signed_square(1, 7),
    ]
}

/// The same terms in plain arithmetic.
fn theta(z: &[f64]) -> [f64; 9] {
    [
        1.0,
        z[0] * z[1],
        z[2] * z[2].abs(),
        z[3],
        z[5],
        z[0] * z[8],
        z[6] * z[6],
        z[2] * z[4],
        z[1] * z[7].abs(),
    ]
}

#[rustfmt::skip]
const XI: [f64; 18] = [
    0.05, -0.3, 0.4, -0.5, 0.2,  0.1, -0.2, 0.3, 0.15,
    -0.1, 0.2,  0.1, 0.3,  0.5, -0.2, 0.1, -0.4, -0.6,
];

fn equations(clock: usize) -> DifferenceEquations {
    DifferenceEquations::new(terms(), XI.to_vec(), shape(2, clock)).unwrap()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Variables of two outputs and one input at the sample `at`, where the present command is the mean up to `until`.
fn variables(
    y: &[[f64; 2]],
    c: &[f64],
    at: usize,
    until: usize,
    Shape { lags, clock, .. }: Shape,
) -> Vec<f64> {
    let mut z = Vec::new();
    for lag in 0..=lags {
        let from = at - lag * clock;
        let to = if lag == 0 { until } else { from + clock };
        z.extend(y[from]);
        z.push(mean(&c[from..to]));
    }
    z
}

/// Appends `horizon` predictions to the outputs `y`; `c` has the commands of the past and of the horizon.
fn naive_rollout(mut y: Vec<[f64; 2]>, c: &[f64], horizon: usize, clock: usize) -> Vec<[f64; 2]> {
    let present = y.len() - 1;
    for ahead in 1..=horizon {
        let instant = present + (ahead - 1) / clock * clock;
        let to = present + ahead;
        let theta = theta(&variables(&y, c, instant, to, shape(2, clock)));
        let elapsed_s = (to - instant) as f64 * DT;
        let rate = |i: usize| theta.iter().zip(&XI[9 * i..]).map(|(t, xi)| t * xi).sum::<f64>();
        y.push([0, 1].map(|i| y[instant][i] + elapsed_s * rate(i)));
    }
    y.split_off(present + 1)
}

fn measured(k: usize) -> [f64; 2] {
    [0.6 + 0.3 * (0.2 * k as f64).sin(), 0.4 * noise(k, 1)]
}

/// Commands that vary, and stay constant for some time.
fn command(k: usize) -> f64 {
    if (k / 10).is_multiple_of(2) { 0.5 * noise(k, 7) } else { [0.8, -0.4][(k / 20) % 2] }
}

#[test]
fn a_rollout_follows_the_documented_equation() {
    for clock in [1, 3, 5] {
        let of = equations(clock);
        for horizon in [1, 2, 3, 7, 13, 31] {
            for present in [of.shape().span(), of.shape().span() + 9] {
                let y: Vec<_> = (0..=present).map(measured).collect();
                let c: Vec<_> = (0..present + horizon).map(command).collect();
                let (past, future) = c.split_at(present);
                let outputs = y.concat();
                let past = Past { outputs: &outputs, inputs: past };
                // Scratch memory has arbitrary content.
                let mut scratch = vec![f64::NAN; of.scratch()];
                let mut found = vec![f64::NAN; 2 * horizon];
                of.rollout(&XI, past, future, UNLIMITED, &mut scratch, &mut found);
                let expected = naive_rollout(y, &c, horizon, clock).concat();
                for (found, expected) in found.iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e-12, "clock {clock}: {found} for {expected}");
                }
            }
        }
    }
}

#[test]
fn equations_without_inputs_roll_out() {
    // y(t + T) = y(t) + T (-0.5 y(t - T)), clock step 2.
    let only = Shape { outputs: 1, inputs: 0, lags: 1, clock: 2, dt: DT };
    let of = DifferenceEquations::new(vec![Term::monomial(&[1])], vec![-0.5], only).unwrap();
    let prior = Prior { averaging: 1, information: 1.0, r_factor: vec![1.0] };
    let member = Member { equations: of, votes: 1, prior: Some(prior) };
    let mut session = CommitteeSession::new(Arc::new(Committee::new(vec![member]).unwrap())).unwrap();
    for y in [1.0, 2.0, 3.0] {
        session.observe(&[y]);
        session.advance(&[]);
    }
    session.observe(&[4.0]);
    let mut y = [0.0; 3];
    session.rollout(&[], &mut Workspace::new(), &mut y);
    for (found, expected) in y.iter().zip([4.0 - 0.1, 4.0 - 0.2, 3.8 - 0.1 * 0.5 * 4.0]) {
        assert!((found - expected).abs() < 1e-12, "{y:?}");
    }
}

/// Without terms the outputs stay, and there is nothing to learn.
#[test]
fn equations_without_terms_are_persistence() {
    let of = DifferenceEquations::new(Vec::new(), Vec::new(), shape(1, 3)).unwrap();
    let past = Past { outputs: &[0.5, -2.0].repeat(4), inputs: &[0.1; 3] };
    let mut y = [f64::NAN; 10];
    of.rollout(&[], past, &[0.3; 5], UNLIMITED, &mut vec![f64::NAN; of.scratch()], &mut y);
    assert_eq!(y.as_slice(), [0.5, -2.0].repeat(5));
    let prior = Prior { averaging: 1, information: 1.0, r_factor: Vec::new() };
    let member = Member { equations: of, votes: 1, prior: Some(prior) };
    assert_eq!(Committee::new(vec![member]).map(|_| ()), Err(CommitteeError::Prior { member: 0 }));
}

fn member(clock: usize, scale: f64, votes: u32) -> Member {
    let coefficients = XI.map(|xi| scale * xi).to_vec();
    let equations = DifferenceEquations::new(terms(), coefficients, shape(2, clock)).unwrap();
    Member { equations, votes, prior: None }
}

fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|at| f64::from(u8::from(at % n == at / n))).collect()
}

fn learning(clock: usize, scale: f64, votes: u32) -> Member {
    let prior = Prior { averaging: 2, information: 5.0, r_factor: identity(9) };
    Member { prior: Some(prior), ..member(clock, scale, votes) }
}

fn session(members: Vec<Member>) -> CommitteeSession {
    CommitteeSession::new(Arc::new(Committee::new(members).unwrap())).unwrap()
}

fn rolled(session: &dyn Predictor, commands: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; commands.len() / session.inputs() * session.outputs()];
    session.rollout(commands, &mut Workspace::new(), &mut y);
    y
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_prediction_does_not_depend_on_later_commands(
        commands in prop::collection::vec(prop_oneof![Just(0.5), -1.0..1.0], 24),
        change in prop::collection::vec(-2.0..2.0f64, 24),
        from in 0usize..24,
        clock in 1usize..7,
    ) {
        let mut session = session(vec![member(clock, 1.0, 2), learning(4, 0.9, 2), member(5, 1.1, 1)]);
        for k in 0..40 {
            session.observe(&measured(k));
            session.advance(&[command(k)]);
        }
        session.observe(&measured(40));
        let mut other = commands.clone();
        other.splice(from.., change[from..].iter().copied());
        let (first, second) = (rolled(&session, &commands), rolled(&session, &other));
        prop_assert_eq!(bits(&first[..2 * from]), bits(&second[..2 * from]));
        // The first changed command acts on the next sample.
        let same = other[from] == commands[from];
        prop_assert!(same || first[2 * from..2 * from + 2] != second[2 * from..2 * from + 2]);
    }

    #[test]
    fn the_median_is_that_of_single_votes(
        values in prop::collection::vec((-3i8..4, 1u32..6), 1..12),
    ) {
        let mut values: Vec<(f64, u32)> = values.iter().map(|&(x, votes)| (0.3 * f64::from(x), votes)).collect();
        let mut single: Vec<f64> =
            values.iter().flat_map(|&(x, votes)| std::iter::repeat_n(x, votes as usize)).collect();
        single.sort_by(f64::total_cmp);
        let middle = single.len() / 2;
        let expected =
            if single.len() % 2 == 1 { single[middle] } else { 0.5 * (single[middle - 1] + single[middle]) };
        prop_assert_eq!(weighted_median(&mut values), expected);
    }

    /// Runaway values on either side leave the median within the values of the majority.
    #[test]
    fn a_runaway_minority_has_no_effect(
        majority in prop::collection::vec((-5.0..5.0f64, 1u32..6), 1..8),
        minority in prop::collection::vec((0usize..3, 1u32..6), 0..8),
        rotation in 0usize..16,
    ) {
        let total: u32 = majority.iter().map(|value| value.1).sum();
        let mut left = total - 1;
        let mut values = majority.clone();
        for (kind, votes) in minority {
            let votes = votes.min(left);
            left -= votes;
            if votes > 0 {
                values.push(([f64::NAN, f64::INFINITY, f64::NEG_INFINITY][kind], votes));
            }
        }
        let turn = rotation % values.len();
        values.rotate_left(turn);
        // A large finite value in the place of an infinite one does not change the median.
        let finite = |x: f64| match x {
            x if x.is_nan() || x == f64::INFINITY => 1e9,
            f64::NEG_INFINITY => -1e9,
            x => x,
        };
        let mut bounded: Vec<_> = values.iter().map(|&(x, votes)| (finite(x), votes)).collect();
        let found = weighted_median(&mut values);
        prop_assert_eq!(found, weighted_median(&mut bounded));
        let range = majority.iter().fold((5.0f64, -5.0f64), |(l, h), &(x, _)| (l.min(x), h.max(x)));
        prop_assert!((range.0..=range.1).contains(&found));
    }
}

/// The median of single votes.
fn naive_median(votes: &[(f64, u32)]) -> f64 {
    let mut single: Vec<f64> =
        votes.iter().flat_map(|&(x, votes)| std::iter::repeat_n(x, votes as usize)).collect();
    single.sort_by(f64::total_cmp);
    let (low, high) = (single[(single.len() - 1) / 2], single[single.len() / 2]);
    if low == high { low } else { 0.5 * (low + high) }
}

#[test]
fn a_simulation_predicts_what_a_rollout_predicts() {
    let committee = Committee::new(vec![member(2, 0.9, 3), member(3, 1.1, 1), member(4, 0.8, 2)]).unwrap();
    let committee = Arc::new(committee.with_ranges(vec![(-1.0, 1.0), (-0.2, 0.3)]).unwrap());
    let (span, steps) = (committee.span(), 50);
    let outputs: Vec<f64> = (0..2 * (span + 1)).map(|i| 0.3 * noise(i, 0)).collect();
    let inputs: Vec<f64> = (0..span).map(|k| noise(k, 1)).collect();
    let commands: Vec<f64> = (0..steps).map(|k| noise(k / 3, 2)).collect();
    let mut session = CommitteeSession::new(Arc::clone(&committee)).unwrap();
    for (k, y) in outputs.chunks(2).enumerate() {
        session.observe(y);
        if k < span {
            session.advance(&inputs[k..=k]);
        }
    }
    let mut expected = vec![0.0; 2 * steps];
    session.rollout(&commands, &mut Workspace::new(), &mut expected);
    let mut simulation = CommitteeSimulation::new(&committee);
    let mut each = CommitteeSimulation::members_of(&committee);
    for _ in 0..2 {
        let past = Past { outputs: &outputs, inputs: &inputs };
        simulation.start(past);
        for member in &mut each {
            member.start(past);
        }
        for (c, expected) in commands.iter().zip(expected.chunks(2)) {
            let mut y = [0.0; 2];
            simulation.advance(&[*c], &mut y);
            assert_eq!(y, expected);
            let mut votes = [[(0.0, 0); 3]; 2];
            for (i, (member, of)) in each.iter_mut().zip(committee.constant_members()).enumerate() {
                member.advance(&[*c], &mut y);
                votes.iter_mut().zip(y).for_each(|(votes, y)| votes[i] = (y, of.votes));
            }
            assert_eq!(votes.map(|mut votes| weighted_median(&mut votes)), expected);
        }
    }
}

#[test]
fn a_committee_predicts_the_weighted_median_of_its_members() {
    // A member runs away: its quadratic growth overflows within the horizon.
    let wild = DifferenceEquations::new(vec![Term::monomial(&[0, 0])], vec![1e6, -1e6], shape(0, 1)).unwrap();
    let wild = Member { equations: wild, votes: 3, prior: None };
    let members = vec![member(3, 1.0, 2), learning(2, 0.9, 3), wild, member(5, 1.3, 1), learning(4, 1.1, 1)];
    let votes: Vec<u32> = members.iter().map(|member| member.votes).collect();
    let mut whole = session(members.clone());
    let mut own: Vec<_> = members.into_iter().map(|member| session(vec![member])).collect();
    assert_eq!(whole.warm_up(), 11);
    let commands: Vec<f64> = (0..23).map(|k| command(k + 500)).collect();
    for k in 0..150 {
        whole.observe(&measured(k));
        for own in &mut own {
            own.observe(&measured(k));
        }
        let alone: Vec<_> = own.iter().map(|own| rolled(own, &commands)).collect();
        for (i, found) in rolled(&whole, &commands).into_iter().enumerate() {
            let values: Vec<_> = alone.iter().zip(&votes).map(|(own, votes)| (own[i], *votes)).collect();
            assert!(found.is_finite());
            assert_eq!(found, naive_median(&values), "sample {k}");
        }
        assert!(!alone[2].iter().all(|y| y.is_finite()), "the third member runs away");
        whole.advance(&[command(k)]);
        for own in &mut own {
            own.advance(&[command(k)]);
        }
    }
    let learned: Vec<f64> = [1, 4].iter().flat_map(|&i: &usize| own[i].weights()).copied().collect();
    assert_eq!(whole.weights(), learned);
}

#[test]
fn the_frozen_form_may_have_other_members() {
    let committee = Committee::new(vec![learning(2, 0.9, 3)]).unwrap();
    assert_eq!(committee.frozen(), Committee::new(vec![member(2, 0.9, 3)]).unwrap());
    let other = committee.clone().with_constant(vec![learning(3, 1.1, 1), member(4, 0.8, 2)]).unwrap();
    assert_eq!(other.members(), committee.members());
    let frozen = Committee::new(vec![member(3, 1.1, 1), member(4, 0.8, 2)]).unwrap();
    assert_eq!(other.frozen(), frozen);
    assert_eq!(frozen.learned(), 0);
    let doubled: Vec<f64> = other.members()[0].equations.coefficients().iter().map(|xi| 2.0 * xi).collect();
    let learned = other.with_learned(&doubled).unwrap();
    assert_eq!(learned.members()[0].equations.coefficients(), doubled);
    assert_eq!(learned.frozen().members()[0].equations.coefficients(), doubled);
    let slow = Shape { dt: 0.2, ..shape(2, 3) };
    let slow = DifferenceEquations::new(terms(), equations(3).coefficients().to_vec(), slow).unwrap();
    let slow = Member { equations: slow, votes: 1, prior: None };
    assert_eq!(committee.clone().with_constant(vec![slow]), Err(CommitteeError::Channels));
    assert_eq!(committee.with_constant(Vec::new()), Err(CommitteeError::Members));
}

#[test]
fn a_missing_value_is_replaced_by_the_prediction() {
    let new = || session(vec![member(3, 1.0, 2), learning(2, 0.9, 1)]);
    let (mut gaps, mut filled) = (new(), new());
    filled.freeze(true);
    gaps.freeze(true);
    let commands: Vec<f64> = (0..11).map(|k| command(k + 300)).collect();
    let mut predicted = [0.0; 2];
    for k in 0..120 {
        let mut y = measured(k);
        // One value, both values, or two advances without a measurement.
        let missing = match k {
            30..33 | 70 => [true, false],
            45..60 => [false, true],
            80..90 | 95 => [true, true],
            _ => [false; 2],
        };
        for i in 0..2 {
            if missing[i] {
                y[i] = f64::NAN;
            }
        }
        if k != 95 {
            gaps.observe(&y);
        }
        for i in 0..2 {
            if missing[i] {
                y[i] = predicted[i];
            }
        }
        filled.observe(&y);
        let mut now = [0.0; 2];
        gaps.output(&mut now);
        assert_eq!(bits(&now), bits(&y), "sample {k}");
        assert_eq!(bits(&rolled(&gaps, &commands)), bits(&rolled(&filled, &commands)), "sample {k}");
        predicted = rolled(&gaps, &[command(k)]).try_into().unwrap();
        gaps.advance(&[command(k)]);
        filled.advance(&[command(k)]);
    }
}

/// Until an output is measured it is unknown; then its past is its first value.
#[test]
fn the_unknown_past_of_an_output_is_its_first_value() {
    let new = || session(vec![member(3, 1.0, 2), learning(2, 0.9, 1)]);
    let commands: Vec<f64> = (0..11).map(|k| command(k + 300)).collect();
    let mut late = new();
    for k in 0..4 {
        late.observe(&[measured(k)[0], f64::NAN]);
        let mut now = [0.0; 2];
        late.output(&mut now);
        assert_eq!(now[0], measured(k)[0]);
        assert!(now[1].is_nan());
        late.advance(&[0.3]);
    }
    let mut known = new();
    for k in 0..4 {
        known.observe(&[measured(k)[0], 0.25]);
        known.advance(&[0.3]);
    }
    for session in [&mut late, &mut known] {
        session.observe(&[0.5, 0.25]);
    }
    assert_eq!(bits(&rolled(&late, &commands)), bits(&rolled(&known, &commands)));

    // At the first sample the past is constant, and the commands before the run are its first one.
    let mut first = session(vec![member(3, 1.0, 2)]);
    first.observe(&[0.5, 0.25]);
    first.advance(&[0.3]);
    first.observe(&[0.6, 0.2]);
    let y: Vec<_> = [[[0.5, 0.25]; 11].as_slice(), &[[0.6, 0.2]]].concat();
    let c = [[0.3; 11].as_slice(), &commands].concat();
    let expected = naive_rollout(y, &c, 11, 3).concat();
    for (found, expected) in rolled(&first, &commands).iter().zip(&expected) {
        assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
    }
}

#[test]
fn faulty_measurements_have_no_lasting_effect() {
    let mut session = session(vec![learning(3, 1.0, 2), learning(2, 0.9, 1), member(4, 1.1, 2)]);
    let commands: Vec<f64> = (0..20).map(command).collect();
    let mut not_finite = 0;
    for k in 0..400 {
        let mut y = measured(k);
        match k {
            0..5 => y = [f64::NAN; 2],
            5..9 => y[1] = f64::NAN,
            100 => y[0] = f64::INFINITY,
            150 => y = [f64::NEG_INFINITY, f64::INFINITY],
            200..203 => y[1] = 1e200,
            250 => y[0] = f64::MAX,
            _ => (),
        }
        if k % 37 != 36 {
            session.observe(&y);
        }
        not_finite += usize::from(session.outcome() == Outcome::Rejected(Rejection::NotFinite));
        session.advance(&[command(k)]);
        let _ = rolled(&session, &commands);
        assert!(session.weights().iter().all(|w| w.is_finite()), "sample {k}");
    }
    assert!(not_finite > 0);
    session.observe(&measured(400));
    assert!(rolled(&session, &commands).iter().all(|y| y.is_finite()));
    session.reset();
    assert_eq!(session.outcome(), Outcome::Waiting);
    let mut now = [0.0; 2];
    session.output(&mut now);
    assert!(now.iter().all(|y| y.is_nan()));
}

/// `A x = b` by Gaussian elimination with partial pivoting.
fn eliminate(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                a[i][j] -= factor * a[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

/// Rows of a run: averages of the terms and of the rates over `averaging` clock steps, one after the other, from
/// increments at the documented stride. A missing value ends the row, and the next one begins behind it.
fn naive_rows(y: &[[f64; 2]], c: &[f64], of: Shape, averaging: usize) -> Vec<([f64; 9], [f64; 2])> {
    let stride = increment_stride(averaging * of.clock);
    let count = (averaging * of.clock).div_ceil(stride);
    let complete = |k: usize| y[k].iter().all(|y| !y.is_nan());
    let mut rows = Vec::new();
    let mut k = 0;
    while k < y.len() {
        let Some(end) = (k..y.len()).find(|&k| !complete(k)).or(Some(y.len())).filter(|&end| end > k) else {
            k += 1;
            continue;
        };
        let starts: Vec<_> = (k + of.span()..end.saturating_sub(of.clock)).step_by(stride).collect();
        for row in starts.chunks_exact(count) {
            let (mut phi, mut z) = ([0.0; 9], [0.0; 2]);
            for &start in row {
                let t = theta(&variables(y, c, start, start + of.clock, of));
                phi.iter_mut().zip(t).for_each(|(phi, t)| *phi += t / count as f64);
                for i in 0..2 {
                    let rate = (y[start + of.clock][i] - y[start][i]) / (of.clock as f64 * DT);
                    z[i] += rate / count as f64;
                }
            }
            rows.push((phi, z));
        }
        k = end;
    }
    rows
}

fn batch_ridge(rows: &[([f64; 9], [f64; 2])], weight: f64, prior: &Prior, start: &[f64]) -> Vec<f64> {
    let r = |i: usize, j: usize| prior.r_factor[9 * i + j];
    let mut a = vec![vec![0.0; 9]; 9];
    for (i, line) in a.iter_mut().enumerate() {
        for (j, a) in line.iter_mut().enumerate() {
            *a = prior.information * (0..9).map(|k| r(k, i) * r(k, j)).sum::<f64>();
        }
    }
    let mut right: Vec<Vec<f64>> = start
        .chunks_exact(9)
        .map(|start| a.iter().map(|a| a.iter().zip(start).map(|(a, s)| a * s).sum()).collect())
        .collect();
    for (phi, z) in rows {
        for i in 0..9 {
            for j in 0..9 {
                a[i][j] += weight * phi[i] * phi[j];
            }
            right.iter_mut().zip(z).for_each(|(right, z)| right[i] += weight * phi[i] * z);
        }
    }
    right.into_iter().flat_map(|right| eliminate(a.clone(), right)).collect()
}

/// An upper triangle with columns of different sizes.
fn triangle() -> Vec<f64> {
    let entry = |i: usize, j: usize| match i.cmp(&j) {
        std::cmp::Ordering::Less => 0.4 * noise(9 * i + j, 3),
        std::cmp::Ordering::Equal => 1.0 + 0.5 * noise(i, 4),
        std::cmp::Ordering::Greater => 0.0,
    };
    (0..81).map(|at| entry(at / 9, at % 9) * [1.0, 3.0, 0.2][at % 3]).collect()
}

/// The learned weights equal batch ridge regression on the rows of all runs. The gate accepts the first thirty rows
/// whatever they are.
#[test]
fn learning_equals_ridge_regression_on_averaged_increments() {
    // Strides of 1, 1, 2 and 2 samples; 1, 4, 4 and 5 increments in a row.
    for (clock, averaging, samples, stride) in [(1, 1, 20, 1), (4, 1, 60, 1), (4, 2, 100, 2), (3, 3, 110, 2)]
    {
        assert_eq!(increment_stride(clock * averaging), stride);
        let prior = Prior { averaging, information: 0.7, r_factor: triangle() };
        let of = member(clock, 1.0, 1).equations;
        let learner = Member { prior: Some(prior.clone()), equations: of.clone(), votes: 1 };
        let mut session = session(vec![member(2, 1.0, 2), learner]);
        let mut rows = Vec::new();
        let mut accepted = 0;
        for run in [0, 1000] {
            session.reset();
            let c: Vec<f64> = (run..run + samples).map(command).collect();
            let y: Vec<_> = (run..run + samples)
                .map(|k| {
                    let missing = k % 1000 == samples / 2;
                    [measured(k)[0] + 0.1 * noise(k, 2), if missing { f64::NAN } else { measured(k)[1] }]
                })
                .collect();
            for (y, c) in y.iter().zip(&c) {
                // In the second run the missing sample is not observed at all.
                if run == 0 || !y[1].is_nan() {
                    session.observe(y);
                    match session.outcome() {
                        Outcome::Waiting => assert!(session.innovations().is_empty()),
                        Outcome::Accepted => {
                            assert_eq!(session.innovations().len(), 2);
                            accepted += 1;
                        }
                        other => panic!("{other:?}"),
                    }
                }
                session.advance(&[*c]);
            }
            rows.extend(naive_rows(&y, &c, *of.shape(), averaging));
            assert_eq!(accepted, rows.len(), "clock {clock}");
        }
        assert!((5..=30).contains(&rows.len()), "{} rows", rows.len());
        let expected = batch_ridge(&rows, averaging as f64, &prior, of.coefficients());
        let moved = expected.iter().zip(of.coefficients()).fold(0.0f64, |m, (x, xi)| m.max((x - xi).abs()));
        assert!(moved > 0.1, "{moved}");
        for (found, expected) in session.weights().iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-9, "clock {clock}: {found} for {expected}");
        }
        // A restart weighs the prior anew, around the present coefficients; so does a new session with the snapshot.
        let start = session.weights().to_vec();
        let mut snapshot = vec![0.0; session.snapshot_len()];
        session.snapshot(&mut snapshot);
        let mut other = CommitteeSession::new(Arc::clone(session.committee())).unwrap();
        other.restore(&snapshot);
        session.restart();
        let c: Vec<f64> = (2000..2000 + samples).map(command).collect();
        let y: Vec<_> = (2000..2000 + samples).map(measured).collect();
        let mut rows = naive_rows(&y, &c, *of.shape(), averaging);
        rows.truncate(4);
        let expected = batch_ridge(&rows, averaging as f64, &prior, &start);
        for session in [&mut session, &mut other] {
            session.reset();
            accepted = 0;
            for (y, c) in y.iter().zip(&c) {
                session.observe(y);
                accepted += usize::from(session.outcome() != Outcome::Waiting);
                session.advance(&[*c]);
                session.freeze(accepted == rows.len());
            }
            assert_eq!(accepted, rows.len());
            for (found, expected) in session.weights().iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-9, "clock {clock}: {found} for {expected}");
            }
        }
    }
}

/// Without noise the coefficients of the vessel are found. Its clock step is a sample: a longer one restarts at every
/// origin of a prediction.
#[test]
fn a_member_learns_the_changed_vessel() {
    let mut plant = session(vec![member(1, 1.0, 1)]);
    let prior = Prior { averaging: 1, information: 1e-6, r_factor: identity(9) };
    let mut learning = session(vec![Member { prior: Some(prior), ..member(1, 0.5, 1) }]);
    for run in 0..60 {
        plant.reset();
        learning.reset();
        for k in 0..25 {
            let at = 31 * run + k;
            let mut y = [noise(at, 8), noise(at, 9)];
            if k > plant.committee().span() {
                plant.output(&mut y);
            }
            plant.observe(&y);
            learning.observe(&y);
            plant.advance(&[noise(at, 5)]);
            learning.advance(&[noise(at, 5)]);
        }
    }
    for (found, truth) in learning.weights().iter().zip(XI) {
        assert!((found - truth).abs() < 1e-3, "{found} for {truth}");
    }
    let frozen = Committee::frozen(learning.committee());
    assert_eq!((frozen.learned(), learning.committee().learned()), (0, 18));
    let kept = learning.committee().with_learned(learning.weights()).unwrap();
    assert_eq!(kept.members()[0].equations.coefficients(), learning.weights());
    assert_eq!(kept.members()[0].prior, learning.committee().members()[0].prior);
    assert!(learning.committee().with_learned(&learning.weights()[1..]).is_err());
    assert!(learning.committee().with_learned(&[f64::NAN; 18]).is_err());
}

#[test]
fn a_snapshot_restores_predictions_and_coefficients() {
    let new = || session(vec![learning(3, 1.0, 2), learning(2, 0.9, 1), member(4, 1.1, 1)]);
    let mut adapter = new();
    let commands: Vec<f64> = (0..20).map(|k| command(k + 300)).collect();
    let mut snapshot = vec![0.0; adapter.snapshot_len()];
    let mut before = Vec::new();
    let mut weights = Vec::new();
    for k in 0..200 {
        adapter.observe(&measured(k));
        if k == 73 {
            adapter.snapshot(&mut snapshot);
            before = rolled(&adapter, &commands);
            weights = adapter.weights().to_vec();
        }
        adapter.advance(&[command(k)]);
    }
    assert!(snapshot.ends_with(&weights));
    assert_ne!(adapter.weights(), weights);
    let mut fork = adapter.fork();
    fork.restore(&snapshot);
    assert_eq!(bits(&rolled(fork.as_ref(), &commands)), bits(&before));
    // Twins continue identically while nothing is learned.
    let mut other = new();
    adapter.restore(&snapshot);
    other.restore(&snapshot);
    assert_eq!(adapter.weights(), weights);
    for session in [&mut adapter, &mut other] {
        session.freeze(true);
    }
    for k in 73..120 {
        assert_eq!(bits(&rolled(&adapter, &commands)), bits(&rolled(&other, &commands)));
        for session in [&mut adapter, &mut other] {
            session.advance(&[command(k)]);
            session.observe(&measured(k + 1));
            assert_eq!(session.outcome(), Outcome::Waiting);
        }
    }
    assert_eq!(adapter.weights(), weights);
    let _: &dyn Adapter = &adapter;
}

#[test]
fn invalid_equations_are_refused() {
    let new = |terms: Vec<Term>, xi: Vec<f64>, shape| DifferenceEquations::new(terms, xi, shape).map(|_| ());
    let one = |shape: Shape| new(vec![Term::constant()], vec![0.0; shape.outputs], shape);
    assert_eq!(one(shape(0, 1)), Ok(()));
    for (lags, clock) in
        [(0, 0), (2, 0), (0, usize::MAX), (usize::MAX, 1), (1 << 40, 1 << 40), (3, 1 << 19), (1 << 21, 1)]
    {
        assert_eq!(one(shape(lags, clock)), Err(EquationsError::Step), "{lags} {clock}");
    }
    for dt in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        assert_eq!(one(Shape { dt, ..shape(0, 1) }), Err(EquationsError::Step));
    }
    // More variables than an index holds.
    assert!(matches!(one(shape(30_000, 1)), Err(EquationsError::Program(_))));
    let wrong = new(terms(), vec![0.0; 17], shape(2, 3));
    assert_eq!(wrong, Err(EquationsError::Shape { expected: 18, given: 17 }));
    let mut xi = XI.to_vec();
    xi[11] = f64::NAN;
    assert_eq!(new(terms(), xi, shape(2, 3)), Err(EquationsError::NotFinite { output: 1, term: 2 }));
    // The terms name variables of two lags.
    assert!(matches!(new(terms(), XI.to_vec(), shape(1, 3)), Err(EquationsError::Program(_))));
}

#[test]
fn invalid_committees_are_refused() {
    let new = |members| Committee::new(members).map(|_| ());
    assert_eq!(new(Vec::new()), Err(CommitteeError::Members));
    assert_eq!(new(vec![member(1, 1.0, 1), member(1, 1.0, 0)]), Err(CommitteeError::Members));
    assert_eq!(new(vec![member(1, 1.0, 1); MOST_MEMBERS]), Ok(()));
    assert_eq!(new(vec![member(1, 1.0, 1); MOST_MEMBERS + 1]), Err(CommitteeError::Members));
    for other in [
        Shape { outputs: 1, inputs: 2, ..shape(0, 1) },
        Shape { inputs: 2, ..shape(0, 1) },
        Shape { dt: 0.2, ..shape(0, 1) },
    ] {
        let equations =
            DifferenceEquations::new(vec![Term::constant()], vec![0.0; other.outputs], other).unwrap();
        let other = Member { equations, votes: 1, prior: None };
        assert_eq!(new(vec![member(1, 1.0, 1), other]), Err(CommitteeError::Channels));
    }
    let nothing = Shape { outputs: 0, ..shape(0, 1) };
    if let Ok(equations) = DifferenceEquations::new(vec![Term::constant()], Vec::new(), nothing) {
        assert_eq!(new(vec![Member { equations, votes: 1, prior: None }]), Err(CommitteeError::Channels));
    }
    let good = Prior { averaging: 2, information: 1.0, r_factor: identity(9) };
    let with = |prior| vec![member(1, 1.0, 1), Member { prior: Some(prior), ..member(3, 1.0, 1) }];
    assert_eq!(new(with(good.clone())), Ok(()));
    for bad in [
        Prior { averaging: 0, ..good.clone() },
        Prior { averaging: usize::MAX, ..good.clone() },
        Prior { averaging: 1 << 40, ..good.clone() },
        Prior { information: 0.0, ..good.clone() },
        Prior { information: -1.0, ..good.clone() },
        Prior { information: f64::NAN, ..good.clone() },
        Prior { information: f64::INFINITY, ..good.clone() },
        Prior { r_factor: identity(8), ..good.clone() },
        Prior { r_factor: Vec::new(), ..good.clone() },
    ] {
        assert_eq!(new(with(bad)), Err(CommitteeError::Prior { member: 1 }));
    }
    // The session finds a singular prior.
    let refused = |change: &dyn Fn(&mut [f64])| {
        let mut r_factor = identity(9);
        change(&mut r_factor);
        let committee = Arc::new(Committee::new(with(Prior { r_factor, ..good.clone() })).unwrap());
        assert_eq!(CommitteeSession::new(committee).map(|_| ()), Err(CommitteeError::Prior { member: 1 }));
    };
    refused(&|r| r[40] = 0.0);
    refused(&|r| r[80] = 1e-200);
    refused(&|r| r[5] = f64::NAN);
    refused(&|r| r[5] = f64::INFINITY);
    refused(&|r| r[9] = 0.1);
    assert!(CommitteeError::Prior { member: 1 }.to_string().contains("member 1"));
}

/// An unstable member in a committee with ranges stays within one width of the range, or of the present value where that
/// is farther; without ranges it does not.
#[test]
fn rollouts_outside_the_training_data_stay_bounded() {
    let shape = Shape { outputs: 1, inputs: 1, lags: 1, clock: 3, dt: DT };
    let terms = vec![Term::monomial(&[0]), Term::monomial(&[0, 0, 0]), Term::monomial(&[1])];
    let member = || {
        let equations = DifferenceEquations::new(terms.clone(), vec![2.0, 5.0, 1.0], shape).unwrap();
        Member { equations, votes: 1, prior: None }
    };
    let rolled_out = |committee: Committee, from: f64, command: f64| {
        let mut session = CommitteeSession::new(Arc::new(committee)).unwrap();
        for _ in 0..8 {
            session.observe(&[from]);
            session.advance(&[command]);
        }
        session.observe(&[from]);
        let mut y = [0.0; 200];
        session.rollout(&[command; 200], &mut Workspace::new(), &mut y);
        y
    };
    let free = Committee::new(vec![member()]).unwrap();
    assert!(rolled_out(free.clone(), 0.5, 1.0).iter().any(|y| !y.is_finite() || y.abs() > 1e6));
    let limited = free.clone().with_ranges(vec![(-1.0, 1.0)]).unwrap();
    for (from, command, last) in [(0.5, 1.0, 3.0), (-0.5, -1.0, -3.0), (4.0, 1.0, 6.0), (-4.0, 1.0, -6.0)] {
        for committee in [limited.clone(), limited.frozen(), limited.with_learned(&[]).unwrap()] {
            let y = rolled_out(committee, from, command);
            assert_eq!(y[199], last, "from {from}");
            assert!(y.iter().all(|y| y.abs() <= last.abs()));
        }
    }
    for wrong in [vec![], vec![(1.0, 1.0)], vec![(0.0, f64::NAN)], vec![(0.0, 1.0); 2]] {
        assert_eq!(free.clone().with_ranges(wrong), Err(CommitteeError::Ranges));
    }
}
