//! Actuators compared with their differential equation, limits, and control allocation.

use hydroid_core::actuator::{Channel, Lag, Limits, Map};
use hydroid_core::control::{Actuators, ControlError, Status, allocate, allocate_within};
use hydroid_core::vessel::rk4;
use proptest::prelude::*;

fn map() -> impl Strategy<Value = Map> {
    prop_oneof![Just(Map::Identity), Just(Map::Sine), Just(Map::SignedSquare)]
}

fn lag() -> impl Strategy<Value = Lag> {
    let first_order = (-20.0..-0.1f64, 0.9..1.1f64, -0.02..0.02f64)
        .prop_map(|(rate, factor, offset)| Lag::FirstOrder { rate, gain: -rate * factor, offset });
    prop_oneof![Just(Lag::None), first_order]
}

/// Positions over a sample by small steps of the differential equation.
fn followed(lag: Lag, from: f64, command: f64, dt: f64) -> f64 {
    let Lag::FirstOrder { rate, gain, offset } = lag else { return command };
    let mut a = [from];
    for _ in 0..200 {
        a = rk4::step(|a: &[f64; 1]| [rate * a[0] + gain * command + offset], &a, dt / 200.0);
    }
    a[0]
}

/// Arbitrary numbers, including NaN and infinity.
fn anything() -> impl Strategy<Value = f64> {
    prop_oneof![
        -3.0..3.0f64,
        -1e9..1e9f64,
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(0.0)
    ]
}

proptest! {
    #[test]
    fn the_effort_is_reached_at_the_end_of_the_sample(
        map in map(), lag in lag(), dt in 0.02..0.5f64, efforts in prop::collection::vec(-0.8..0.8f64, 1..20),
    ) {
        // Wide limits: the inverse of a lag of many samples needs commands far beyond the effort.
        let limits = if map == Map::Sine && lag == Lag::None { 1.2 } else { 1e4 };
        let channel = Channel { map: if lag == Lag::None { map } else { Map::Identity }, lag };
        let mut actuators = Actuators::new(&[channel], &[Limits::between([-limits, limits])], dt, 0.0).unwrap();
        let mut position = channel.map.inverse(actuators.effort(0));
        for effort in efforts {
            let mut command = [0.0];
            let applied = actuators.apply(&[effort], &mut command);
            position = followed(channel.lag, position, command[0], dt);
            prop_assert!(!applied.saturated && !applied.rate_limited);
            prop_assert!((channel.map.value(position) - effort).abs() < 1e-6, "{} for {effort}", channel.map.value(position));
            prop_assert!((actuators.effort(0) - effort).abs() < 1e-9);
        }
    }

    #[test]
    fn commands_keep_limits_and_rate_limits(
        map in map(), lag in lag(), low in -2.0..0.5f64, wide in 0.05..2.0f64, rate in 0.01..20.0f64, response in 0.0..2.0f64,
        asked in prop::collection::vec((anything(), anything(), 0u8..4), 1..60),
    ) {
        let scale = if map == Map::Sine { 0.3 } else { 1.0 };
        let limits = Limits::between([scale * low, scale * (low + wide)]).with_rate(rate);
        let dt = 0.1;
        let mut actuators = Actuators::new(&[Channel { map, lag }], &[limits], dt, response).unwrap();
        let mut last = 0.0f64.clamp(limits.low, limits.high);
        for (effort, measured, how) in asked {
            let mut command = [effort];
            match how {
                0 => actuators.hold(&mut command),
                1 => { actuators.limit(&mut command); }
                2 => { actuators.observe(&[measured]); actuators.apply(&[effort], &mut command); }
                _ => { actuators.apply(&[effort], &mut command); }
            }
            prop_assert!((limits.low..=limits.high).contains(&command[0]), "{command:?}");
            prop_assert!((command[0] - last).abs() <= rate * dt * (1.0 + 1e-12), "{last} to {command:?}");
            last = command[0];
            prop_assert!(actuators.effort(0).is_finite());
        }
    }

    #[test]
    fn maps_are_inverted(map in map(), a in -1.5..1.5f64) {
        prop_assert!((map.inverse(map.value(a)) - a).abs() < 1e-7);
        prop_assert!(map.value(map.inverse(100.0 * a)).abs() <= 150.0 + 1e-9);
    }

    #[test]
    fn allocated_efforts_give_what_is_wanted_or_stay_small(
        columns in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 2..6), spans in prop::collection::vec(0.1..5.0f64, 6),
        wanted in (-2.0..2.0f64, -2.0..2.0f64), min_control_authority in 0.01..0.5f64,
    ) {
        let columns: Vec<[f64; 2]> = columns.into_iter().map(|(x, y)| [x, y]).collect();
        let spans = &spans[..columns.len()];
        let wanted = [wanted.0, wanted.1];
        let mut efforts = vec![0.0; columns.len()];
        let sigma = allocate(&columns, spans, wanted, min_control_authority, &mut efforts);
        let sum = |i: usize| columns.iter().zip(&efforts).map(|(b, tau)| b[i] * tau).sum::<f64>();
        let size = wanted[0].hypot(wanted[1]);
        let shares = efforts.iter().zip(spans).map(|(tau, span)| (tau / span).powi(2)).sum::<f64>().sqrt();
        prop_assert!(shares <= size / min_control_authority.max(sigma) * (1.0 + 1e-9), "{shares}");
        if sigma >= min_control_authority {
            prop_assert!((sum(0) - wanted[0]).abs() < 1e-9 && (sum(1) - wanted[1]).abs() < 1e-9);
            // The smallest solution: no step along the null space reduces it.
            if columns.len() == 3 {
                let b: Vec<[f64; 2]> = columns.iter().zip(spans).map(|(c, s)| [c[0] * s, c[1] * s]).collect();
                let minor = |i: usize, j: usize| b[i][0] * b[j][1] - b[j][0] * b[i][1];
                let null = [minor(1, 2), minor(2, 0), minor(0, 1)];
                let along: f64 = (0..3).map(|i| null[i] * efforts[i] / spans[i]).sum();
                prop_assert!(along.abs() < 1e-8 * (1.0 + shares));
            }
        }
    }
}

/// Two actuators push, a third one turns. The first can give 0.5 only: the second gives the rest.
#[test]
fn a_third_actuator_takes_over_what_a_bound_takes_away() {
    let columns = [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let mut efforts = [0.0; 3];
    let bounds = [[-0.5, 0.5], [-2.0, 2.0], [-1.0, 1.0]];
    let sigma = allocate_within(&mut columns.clone(), &[1.0; 3], &bounds, [1.8, 0.4], 0.05, &mut efforts);
    assert!((sigma - 1.0).abs() < 1e-12);
    for (effort, expected) in efforts.iter().zip([0.5, 1.3, 0.4]) {
        assert!((effort - expected).abs() < 1e-12, "{efforts:?}");
    }
    // Two actuators stay free, whatever is asked for.
    allocate_within(&mut columns.clone(), &[1.0; 3], &bounds, [9.0, 4.0], 0.05, &mut efforts);
    assert_eq!(efforts[0], 0.5);
    assert!((efforts[1] - 8.5).abs() < 1e-12 && (efforts[2] - 4.0).abs() < 1e-12, "{efforts:?}");
    let (mut two, mut plain) = ([0.0; 2], [0.0; 2]);
    let pair = [[1.0, 0.2], [0.3, 1.0]];
    allocate_within(&mut pair.clone(), &[1.0; 2], &[[-0.1, 0.1]; 2], [2.0, 1.0], 0.05, &mut two);
    allocate(&pair, &[1.0; 2], [2.0, 1.0], 0.05, &mut plain);
    assert_eq!(two, plain);
}

/// The reach of an actuator is what its limits and rate limit allow in a sample.
#[test]
fn the_reach_follows_from_limits_rate_and_lag() {
    let channel = Channel { map: Map::SignedSquare, lag: Lag::of_time_constant(0.5) };
    let limits = [Limits::between([-1.0, 3.0]).with_rate(2.0)];
    let mut actuators = Actuators::new(&[channel], &limits, 0.1, 0.0).unwrap();
    let gain = 1.0 - (-0.2_f64).exp();
    let [low, high] = actuators.reach(0);
    assert!((high - (0.2 * gain).powi(2)).abs() < 1e-12 && (low + high).abs() < 1e-12, "{low} {high}");
    let mut command = [3.0];
    (0..200).for_each(|_| {
        command = [3.0];
        actuators.limit(&mut command);
    });
    let [low, high] = actuators.reach(0);
    assert!((high - 9.0).abs() < 1e-9 && (low - (3.0 - 0.2 * gain).powi(2)).abs() < 1e-9, "{low} {high}");
}

/// At rest, a thruster that takes pulses of 1100 to 1900 us stands at 1500.
#[test]
fn the_value_at_rest_can_be_stated() {
    let limits = [Limits::between([1100.0, 1900.0]).with_rest(1500.0)];
    let mut actuators = Actuators::new(&[Channel::default()], &limits, 0.5, 0.0).unwrap();
    let mut command = [0.0];
    actuators.clone().hold(&mut command);
    assert_eq!(command, [1500.0]);
    command = [1800.0];
    actuators.limit(&mut command);
    let held: Vec<f64> = (0..4)
        .map(|_| {
            actuators.hold(&mut command);
            command[0]
        })
        .collect();
    assert_eq!(held, [1800.0, 1800.0, 1500.0, 1500.0]);
    assert_eq!(Limits::between([1100.0, 1900.0]).rest, 1100.0);
    let outside = [Limits::between([-1.0, 1.0]).with_rest(2.0)];
    let refused = Actuators::new(&[Channel::default()], &outside, 0.5, 0.0).unwrap_err();
    assert_eq!(refused, ControlError::Limits { channel: 0 });
}

/// `T = 1 s`, `dt = 0.1 s`: the inverse demands `1 / (1 - exp(-0.1))`, 10.5 times the step, then the step itself.
#[test]
fn a_lag_is_inverted_in_one_sample_or_in_the_time_given() {
    let channel = Channel { map: Map::Identity, lag: Lag::of_time_constant(1.0) };
    let wide = [Limits::between([-1e3, 1e3])];
    let mut quick = Actuators::new(&[channel], &wide, 0.1, 0.0).unwrap();
    let mut command = [0.0];
    quick.apply(&[10.0], &mut command);
    assert!((command[0] - 10.0 / (1.0 - (-0.1f64).exp())).abs() < 1e-9);
    quick.apply(&[10.0], &mut command);
    assert!((command[0] - 10.0).abs() < 1e-9);
    let mut slow = Actuators::new(&[channel], &wide, 0.1, 0.5).unwrap();
    for k in 1..=10 {
        slow.apply(&[10.0], &mut command);
        let expected = 10.0 * (1.0 - (-0.1 * f64::from(k) / 0.5).exp());
        assert!((slow.effort(0) - expected).abs() < 1e-9, "a first-order answer of half a second");
    }
}

#[test]
fn without_measurements_commands_are_held_and_then_reduced_to_rest() {
    let limits = [Limits::between([-1.0, 1.0]).with_rate(0.5), Limits::between([0.2, 1.0])];
    let mut actuators = Actuators::new(&[Channel::default(); 2], &limits, 0.1, 0.0).unwrap();
    let mut command = [0.0; 2];
    for _ in 0..30 {
        actuators.apply(&[0.7, 0.9], &mut command);
    }
    assert_eq!(command, [0.7, 0.9]);
    for _ in 0..10 {
        actuators.hold(&mut command);
        assert_eq!(command, [0.7, 0.9]);
    }
    actuators.hold(&mut command);
    assert!((command[0] - 0.65).abs() < 1e-12, "at the rate that is allowed");
    assert_eq!(command[1], 0.2, "0 is outside of its limits");
}

#[test]
fn an_adapted_lag_replaces_the_lag_of_the_actuator() {
    let limits = [Limits::between([-100.0, 100.0])];
    let channel = |seconds| Channel { map: Map::Identity, lag: Lag::of_time_constant(seconds) };
    let mut actuators = Actuators::new(&[channel(1.0)], &limits, 0.1, 0.0).unwrap();
    let mut command = [0.0];
    actuators.apply(&[1.0], &mut command);
    actuators.set_channels(&[channel(2.0)]).unwrap();
    actuators.apply(&[2.0], &mut command);
    let e = (-0.05f64).exp();
    assert!((command[0] - (2.0 - e) / (1.0 - e)).abs() < 1e-9);
    let unstable = Channel { map: Map::Identity, lag: Lag::FirstOrder { rate: 0.1, gain: 1.0, offset: 0.0 } };
    assert_eq!(actuators.set_channels(&[unstable]), Err(ControlError::Lag { channel: 0 }));
}

#[test]
fn invalid_actuators_are_refused() {
    let make = |map, lag, limits| Actuators::new(&[Channel { map, lag }], &[limits], 0.1, 0.0).unwrap_err();
    let unit = Limits::between([-1.0, 1.0]);
    assert_eq!(
        make(Map::Identity, Lag::None, Limits::between([1.0, -1.0])),
        ControlError::Limits { channel: 0 }
    );
    assert_eq!(make(Map::Identity, Lag::None, unit.with_rate(0.0)), ControlError::Limits { channel: 0 });
    assert_eq!(make(Map::Identity, Lag::of_time_constant(-1.0), unit), ControlError::Lag { channel: 0 });
    let wide = make(Map::Sine, Lag::None, Limits::between([-2.0, 1.0]));
    assert_eq!(
        wide.to_string(),
        "command 0 acts through its sine, and its limits exceed 90 degrees: give narrower ones"
    );
    let count = Actuators::new(&[Channel::default(); 2], &[unit], 0.1, 0.0).unwrap_err();
    assert_eq!(count, ControlError::Count { expected: 2, given: 1 });
    assert!(Actuators::new(&[Channel::default()], &[unit], f64::NAN, 0.0).is_err());
    assert!(Actuators::new(&[Channel::default()], &[unit], 0.1, -1.0).is_err());
}

#[test]
fn the_more_severe_status_is_reported() {
    assert_eq!(Status::Saturated.and(Status::Singular), Status::Singular);
    assert!(Status::ALL.windows(2).all(|pair| pair[0] < pair[1]));
    assert_eq!(format!("{:>9}", Status::Lost), "     lost");
}
