//! Parts of a stream: lines, time grid, alignment of commands, response times.

use std::io::BufReader;

use hydroid::log::{CommandTiming, InputDelay};
use hydroid_core::memory::Memory;
use hydroid_live::stream::clock::{Arrival, Clock};
use hydroid_live::stream::commands::Commands;
use hydroid_live::stream::latency::Latency;
use hydroid_live::stream::{LONGEST_LINE, Line, Lines};

#[test]
fn lines_end_anywhere_and_have_bounded_memory() {
    let mut text = b"a\r\n\nb".to_vec();
    text.extend(vec![b'x'; LONGEST_LINE]);
    text.extend(b"\nc");
    let mut lines = Lines::new(BufReader::with_capacity(7, &text[..]));
    for line in
        [Some(Line::Whole(b"a")), Some(Line::Whole(b"")), Some(Line::TooLong), Some(Line::Whole(b"c")), None]
    {
        assert_eq!(lines.next_line().unwrap(), line);
    }
    assert!(lines.capacity() <= 2 * LONGEST_LINE);
}

fn clock() -> Clock {
    Clock::new(0.1, 1.0).unwrap()
}

fn arrivals(times: impl IntoIterator<Item = f64>) -> Vec<Arrival> {
    let mut clock = clock();
    times.into_iter().map(|t| clock.arrive(t)).collect()
}

#[test]
fn samples_are_assigned_to_the_nearest_grid_point() {
    use Arrival::{Between, First, Next};
    let found = arrivals([5.0, 5.1, 5.24, 5.26, 5.5, 5.53]);
    assert_eq!(found, [First, Next(1), Next(1), Next(1), Next(2), Between]);
    let found = arrivals([5.0, 5.1, 5.1, 5.05, 6.2]);
    assert_eq!(found[..3], [First, Next(1), Arrival::Late(0.0)]);
    assert!(matches!(found[3], Arrival::Late(by) if (by - 0.05).abs() < 1e-9), "{found:?}");
    assert!(matches!(found[4], Arrival::Ahead(by) if (by - 1.1).abs() < 1e-9), "{found:?}");
    let found = arrivals([5.0, 5.1, 6.2, 6.3, 6.4]);
    assert!(matches!(found[4], Arrival::Gap(by) if (by - 1.3).abs() < 1e-9), "{found:?}");
    assert_eq!(arrivals([5.0, 6.0])[1], Next(10), "as long as the limit");
    for limit in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        assert!(Clock::new(0.1, limit).is_err(), "{limit}");
    }
}

#[test]
fn faster_streams_are_thinned_and_clock_drift_is_followed() {
    let mut clock = clock();
    for k in 0..1000 {
        let used = matches!(clock.arrive(f64::from(k) * 0.01), Arrival::Next(_));
        assert!(k < 30 || used == (k % 10 == 0), "{k}");
    }
    for step in [0.099, 0.1, 0.101] {
        let jitter = |x: f64| 0.02 * (x * 12.9898).sin();
        let found = arrivals((0..5000).map(f64::from).map(|x| x * step + jitter(x)));
        assert!(found.iter().skip(1).all(|a| *a == Arrival::Next(1)), "{step}");
    }
}

/// Commands of each interval, for commands 1, 2, .. at samples 0, 1, 2, 5, 6.
fn acts(timing: CommandTiming, delay: i64) -> Vec<f64> {
    let mut commands = Commands::new(1, 0.1, timing, InputDelay::Samples(delay)).unwrap();
    let mut acted = Vec::new();
    commands.begin(&[1.0]);
    for (steps, command) in [(1, 2.0), (1, f64::NAN), (3, 4.0), (1, 5.0)] {
        let held = commands.advance_to(steps, &[command], |_, c| acted.push(c[0]));
        assert_eq!(held, command.is_nan());
    }
    acted.iter().map(|c| if c.is_nan() { -1.0 } else { *c }).collect()
}

/// The alignment is that of logs (`log::grid`).
#[test]
fn commands_act_as_in_a_log() {
    use CommandTiming::{After, Before};
    assert_eq!(acts(Before, 0), [1.0, 2.0, 2.0, 2.0, 2.0, 4.0]);
    assert_eq!(acts(After, 0), [2.0, 2.0, 4.0, 4.0, 4.0, 5.0]);
    assert_eq!(acts(Before, 2), [-1.0, -1.0, 1.0, 2.0, 2.0, 2.0]);
    assert_eq!(acts(After, 1), [1.0, 2.0, 2.0, 4.0, 4.0, 4.0]);
    assert_eq!(acts(Before, -1), [2.0, 2.0, 2.0, 2.0, 4.0, 5.0]);
    for delay in [InputDelay::Samples(-2), InputDelay::Seconds(1e8)] {
        assert!(Commands::new(1, 0.1, Before, delay).is_err());
    }
}

#[test]
fn future_commands_are_delayed_then_planned_or_held() {
    let mut commands = Commands::new(1, 0.1, CommandTiming::Before, InputDelay::Samples(2)).unwrap();
    commands.begin(&[1.0]);
    assert!(!commands.known());
    commands.advance_to(2, &[2.0], |_, _| {});
    assert!(commands.known());
    let ahead = |plan: &[f64]| {
        let mut into = [0.0; 6];
        commands.ahead(plan, &mut into);
        into
    };
    assert_eq!(ahead(&[]), [1.0, 1.0, 2.0, 2.0, 2.0, 2.0]);
    assert_eq!(ahead(&[7.0, f64::NAN, 9.0]), [1.0, 1.0, 7.0, 2.0, 9.0, 9.0]);
}

#[test]
fn commands_are_restored_from_any_position_of_the_ring() {
    let new = || Commands::new(2, 0.1, CommandTiming::Before, InputDelay::Samples(3)).unwrap();
    let (mut commands, mut other) = (new(), new());
    commands.begin(&[1.0, 2.0]);
    commands.advance_to(5, &[3.0, f64::NAN], |_, _| {});
    let memory = Memory::saved(|memory| commands.visit_state(memory));
    other.visit_state(&mut Memory::Loading(&memory));
    for command in [[4.0, 5.0], [6.0, 7.0], [8.0, 9.0]] {
        let acted = |commands: &mut Commands| {
            let mut acted = Vec::new();
            commands.advance_to(2, &command, |_, c| acted.extend_from_slice(c));
            acted
        };
        assert_eq!(acted(&mut commands), acted(&mut other));
    }
}

#[test]
fn quantiles_of_response_times_are_right_to_two_percent() {
    let mut latency = Latency::default();
    assert!(latency.times().median.is_nan() && latency.times().max.is_nan());
    (1..=1000).for_each(|us| latency.add(f64::from(us)));
    let times = latency.times();
    assert!((times.median / 500.0 - 1.0).abs() < 0.021, "{times:?}");
    assert!((times.p99 / 990.0 - 1.0).abs() < 0.021, "{times:?}");
    assert_eq!(times.max, 1000.0);
    latency.add(0.0);
    latency.add(1e300);
    assert_eq!(latency.times().max, 1e300);
}
