//! Commands on topics: refusals, ends, and what may never be sent.

use hydroid_live::link::{Axis, HelmEvent};
use hydroid_ros::commander::{Commander, Options};
use proptest::prelude::*;

const MS: i64 = 1_000_000;
const START: i64 = 1_700_000_000_000_000_000;

fn axes() -> Vec<Axis> {
    let axis =
        |name: &str, topic, low| Axis { name: name.to_owned(), place: [topic, 0], low, high: 1.0, rest: 0.0 };
    vec![axis("left", 0, -1.0), axis("right", 1, -0.5)]
}

fn commander(enable: Option<&str>) -> Commander {
    let options = Options { may_command: true, is_dry_run: false, enable: enable.map(str::to_owned) };
    let mut commander = Commander::new(axes(), options).unwrap();
    commander.set_alive(true, START);
    commander
}

/// The reason of the last end.
fn ended(commander: &mut Commander) -> Option<String> {
    let mut last = None;
    while let Some(event) = commander.take_event() {
        if let HelmEvent::HandsOff(reason) = event {
            last = Some(reason);
        }
    }
    last
}

#[test]
fn each_condition_is_a_refusal() {
    let refused = |commander: &Commander, told: &str| {
        let refusals = commander.refusals(START).join("; ");
        assert!(refusals.contains(told), "{refusals}");
    };
    let of = |may_command, is_dry_run| {
        Commander::new(axes(), Options { may_command, is_dry_run, enable: None }).unwrap()
    };
    refused(&of(false, false), "--allow-commands");
    refused(&of(true, true), "dry run");
    refused(&of(true, false), "no messages arrive");
    refused(&commander(Some("/enable")), "no message on /enable");
    let mut one = commander(None);
    assert_eq!(one.refusals(START), Vec::<String>::new());
    one.see(vec!["/left".to_owned()], vec!["/right".to_owned()], None, START);
    refused(&one, "nobody subscribes to /left");
    refused(&one, "another node publishes /right");
    let mut one = commander(None);
    one.see(Vec::new(), Vec::new(), Some("the clock was set: start again".to_owned()), START);
    refused(&one, "the clock was set: start again");
    let mut one = commander(None);
    one.hear_other("/left", START);
    refused(&one, "another node commands /left");
    assert!(one.begin(START).is_err());
    assert!(one.begin(START + 3_000 * MS).is_ok());
}

#[test]
fn another_commander_ends_commands_without_a_neutral_one() {
    let mut one = commander(None);
    one.begin(START).unwrap();
    one.command(&[0.5, 0.5], START + 10 * MS);
    assert_eq!(one.due(START + 10 * MS), Some(&[0.5, 0.5][..]));
    one.hear_other("/left", START + 20 * MS);
    assert!(ended(&mut one).unwrap().contains("another node commands /left"));
    for k in 2..200 {
        assert_eq!(one.due(START + 10 * k * MS), None);
    }
}

#[test]
fn a_driver_that_ends_ends_the_commands() {
    let mut one = commander(None);
    one.begin(START).unwrap();
    one.see(vec!["/left".to_owned()], Vec::new(), None, START + MS);
    assert_eq!(ended(&mut one).as_deref(), Some("nobody subscribes to /left"));
}

#[test]
fn another_commander_ends_a_release() {
    let mut one = commander(Some("/enable"));
    one.permit(true, START);
    one.begin(START).unwrap();
    one.command(&[0.5, 0.5], START);
    assert!(one.due(START).is_some());
    one.permit(false, START + MS);
    assert_eq!(one.due(START + MS), Some(&[0.0, 0.0][..]));
    one.hear_other("/left", START + 2 * MS);
    assert!((2..200).all(|k| one.due(START + 10 * k * MS).is_none()));
}

#[test]
fn a_release_is_neutral_and_then_silent() {
    let mut one = commander(None);
    one.begin(START).unwrap();
    one.command(&[0.5, 0.5], START);
    assert!(one.due(START).is_some());
    one.release(START + MS, "stopped");
    assert_eq!(ended(&mut one).as_deref(), Some("stopped"));
    let sent: Vec<Vec<f64>> =
        (0..100).filter_map(|k| one.due(START + 10 * k * MS).map(<[f64]>::to_vec)).collect();
    assert_eq!(sent, vec![vec![0.0, 0.0]; 3]);
}

#[test]
fn silence_becomes_neutral_and_ends() {
    let mut one = commander(None);
    one.begin(START).unwrap();
    one.command(&[0.5, 0.5], START);
    let mut last = Vec::new();
    for k in 0..150 {
        if let Some(values) = one.due(START + 10 * k * MS) {
            last = values.to_vec();
        }
    }
    assert_eq!(last, [0.0, 0.0]);
    assert!(one.is_commanding());
    let _ = one.due(START + 2_100 * MS);
    assert!(ended(&mut one).unwrap().contains("no new command for 2.1 s"));
}

#[test]
fn impossible_limits_are_refused() {
    let options = Options { may_command: true, is_dry_run: false, enable: None };
    for (low, high, rest) in
        [(1.0, -1.0, 0.0), (0.5, 1.0, 0.0), (f64::NAN, 1.0, 0.0), (0.0, f64::INFINITY, 0.0)]
    {
        let axis = Axis { name: "left".to_owned(), place: [0, 0], low, high, rest };
        assert!(Commander::new(vec![axis], options.clone()).unwrap_err().contains("limits must ascend"));
    }
    assert!(Commander::new(Vec::new(), options).unwrap_err().contains("at least one"));
}

#[derive(Clone, Debug)]
enum Act {
    Begin,
    Command(f64, f64),
    Permit(bool),
    Other,
    Lost,
    Release,
    Wait(i64),
}

fn acts() -> impl Strategy<Value = Vec<Act>> {
    let number = prop_oneof![4 => -3.0..3.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)];
    let act = prop_oneof![
        3 => Just(Act::Begin),
        6 => (number.clone(), number).prop_map(|(a, b)| Act::Command(a, b)),
        3 => any::<bool>().prop_map(Act::Permit),
        1 => Just(Act::Other),
        1 => Just(Act::Lost),
        1 => Just(Act::Release),
        4 => (0_i64..1500).prop_map(Act::Wait),
    ];
    proptest::collection::vec(act, 0..120)
}

proptest! {
    /// Whatever happens: within the limits; nothing but neutral commands without permission; nothing after another node.
    #[test]
    fn nothing_is_sent_that_may_not_be(acts in acts()) {
        let mut one = commander(Some("/enable"));
        let mut now = START;
        let (mut permitted_ns, mut other_ns) = (i64::MIN, i64::MIN);
        let mut began_after_other = true;
        for act in acts {
            match act {
                Act::Begin => began_after_other |= one.begin(now).is_ok(),
                Act::Command(a, b) => one.command(&[a, b], now),
                Act::Permit(is) => {
                    permitted_ns = if is { now } else { i64::MIN };
                    one.permit(is, now);
                }
                Act::Other => {
                    other_ns = now;
                    began_after_other = false;
                    one.hear_other("/left", now);
                }
                Act::Lost => {
                    one.set_alive(false, now);
                    prop_assert!(!one.is_commanding());
                    one.set_alive(true, now);
                }
                Act::Release => one.release(now, "stopped"),
                Act::Wait(ms) => now += ms * MS,
            }
            if let Some(values) = one.due(now) {
                let values = values.to_vec();
                prop_assert!((-1.0..=1.0).contains(&values[0]) && (-0.5..=1.0).contains(&values[1]));
                let is_permitted = now.saturating_sub(permitted_ns) <= 1_000 * MS;
                prop_assert!(is_permitted || values == [0.0, 0.0], "{values:?}");
                prop_assert!(began_after_other, "a command {} ns after another node", now - other_ns);
            }
        }
    }
}
