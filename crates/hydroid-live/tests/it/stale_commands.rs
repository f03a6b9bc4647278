//! No command stays in force when the measurements on which it depends are too old, whatever arrives or does not arrive:
//! lines, bytes, silence, clocks. The time is virtual.

use std::sync::OnceLock;

use hydroid::closed_loop::{ControlMethod, QUANTITIES};
use hydroid::config::Duration;
use hydroid::config::control::{ClosedLoopOptions, NamedModel, Setup};
use hydroid::evaluate::PredictionBands;
use hydroid_live::stream::{Line, Options, Position, Stream};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use serde_json::{Value, json};

/// The hydrofoil on a lawn-mower, with samples of 0.1 s.
fn setup() -> &'static Setup {
    static SETUP: OnceLock<Setup> = OnceLock::new();
    SETUP.get_or_init(|| steered(None))
}

fn steered(max_age_s: Option<f64>) -> Setup {
    let options = ClosedLoopOptions {
        controller: ControlMethod::FeedbackLinearization,
        task: hydroid::config::control::TaskKind::LawnMower,
        max_age: max_age_s.map(Duration),
        ..ClosedLoopOptions::default()
    };
    let model = NamedModel::read("hydrofoil".as_ref()).unwrap();
    Setup::new(options, Some(model), None).unwrap()
}

/// What is wrong with the rudder.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    Lost,
    Reversed,
}

/// A service, its virtual time, and what an observer of it knows.
struct Watch {
    stream: Stream,
    limit_s: f64,
    now: f64,
    /// Time of the last line, or at which the program last stopped to wait for one.
    heard: f64,
    /// Times at which each quantity was last measured in a line that was used.
    measured: [f64; 5],
    /// Whether the last command was neutral.
    is_neutral: bool,
    /// Time of the last output, and the output.
    said: f64,
    last: Value,
}

impl Watch {
    fn new(setup: &Setup) -> Self {
        let (adapter, _) = setup.adapter().unwrap();
        let pilot = setup.pilot(adapter.as_ref(), None).unwrap();
        let reading = setup.model.description.reading.clone();
        let options = Options { name: "test".to_owned(), reading, horizons: vec![1], timing: false };
        let mut stream = Stream::new(&setup.model, adapter, options).unwrap();
        stream.steer(pilot, Position::default()).unwrap();
        Self {
            stream,
            limit_s: setup.controller.max_age_s,
            now: 0.0,
            heard: 0.0,
            measured: [f64::NEG_INFINITY; 5],
            is_neutral: true,
            said: 0.0,
            last: Value::Null,
        }
    }

    /// The age of the oldest quantity.
    fn age(&self) -> f64 {
        self.now - self.measured.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Checks an output; `line` is what was sent.
    fn hear(&mut self, out: &[u8], line: Option<&[u8]>) -> Result<Option<Value>, TestCaseError> {
        if out.is_empty() {
            return Ok(None);
        }
        let answer: Value = serde_json::from_slice(out).map_err(|e| TestCaseError::fail(e.to_string()))?;
        let was_used = answer.get("prediction").is_some();
        if was_used && let Some(line) = line {
            let sent: Value = serde_json::from_slice(line).unwrap();
            for (at, keys) in
                self.measured.iter_mut().zip([&["x", "y"][..], &["psi"], &["u"], &["v"], &["r"]])
            {
                if keys.iter().all(|key| sent[key].is_number()) {
                    *at = self.now;
                }
            }
        }
        self.said = self.now;
        self.last = answer.clone();
        self.is_neutral = answer["command"].as_object().unwrap().values().all(|value| value == 0.0);
        let is_lost = answer.get("lost").is_some();
        prop_assert!(
            !is_lost
                || self.is_neutral
                    && answer["note"]
                        .as_str()
                        .or(answer["message"].as_str())
                        .unwrap()
                        .contains("the commands rest"),
            "{}",
            answer
        );
        prop_assert_eq!(answer["status"] == "lost", line.is_none(), "{}", answer);
        self.check(&answer)?;
        Ok(Some(answer))
    }

    /// The property.
    fn check(&self, last: &Value) -> Result<(), TestCaseError> {
        prop_assert!(
            self.is_neutral || self.age() <= self.limit_s * (1.0 + 1e-6) + 2e-3,
            "a command of {} s: {}",
            self.age(),
            last
        );
        Ok(())
    }

    fn send(&mut self, line: Line<'_>) -> Result<Option<Value>, TestCaseError> {
        self.stream.arrive_after(self.now - self.heard);
        self.heard = self.now;
        let mut out = Vec::new();
        let sent = match line {
            Line::Whole(bytes) => bytes.to_vec(),
            Line::TooLong => Vec::new(),
        };
        self.stream.serve(line, &mut out).map_err(|e| TestCaseError::fail(e.to_string()))?;
        self.hear(&out, Some(&sent))
    }

    /// Nothing arrives for some time, and the program waits until something is due, as it does for a pipe. Number of lines
    /// that are written meanwhile.
    fn wait(&mut self, seconds: f64) -> Result<usize, TestCaseError> {
        let (end, mut lines) = (self.now + seconds, 0);
        while let Some(due) = self.stream.due_s()
            && self.heard + due < end
        {
            self.now = self.heard + due;
            self.heard = self.now;
            let mut out = Vec::new();
            self.stream.wait(due, &mut out).map_err(|e| TestCaseError::fail(e.to_string()))?;
            lines += usize::from(self.hear(&out, None)?.is_some());
            self.check(&Value::Null)?;
        }
        self.now = end;
        if self.stream.due_s().is_some() {
            self.check(&Value::Null)?;
            prop_assert!(self.age() <= self.limit_s + 2e-3 || self.now - self.said <= 1.0 + 2e-3);
        }
        Ok(lines)
    }
}

/// A line of a vessel that sails north.
fn line(t: f64) -> Value {
    json!({ "t": t, "x": 1.5 * t, "y": 0.4, "psi": 0.01, "u": 1.5, "v": 0.0, "r": 0.0 })
}

fn sail(watch: &mut Watch, from: u32, to: u32) -> Value {
    let mut last = Value::Null;
    for k in from..to {
        watch.wait(0.1).unwrap();
        last = watch.send(Line::Whole(line(0.1 * f64::from(k)).to_string().as_bytes())).unwrap().unwrap();
    }
    last
}

/// After 310 good lines, 600 broken ones were answered with full thrust and full rudder.
#[test]
fn lines_that_cannot_be_used_do_not_keep_a_command() {
    let broken = |k: u32| match k % 4 {
        0 => "{broken".to_owned(),
        1 => json!({ "t": null, "x": 1.0 }).to_string(),
        2 => json!({ "t": 4.0 + 0.1 * f64::from(k), "x": "north" }).to_string(),
        _ => "\u{1}".to_owned(),
    };
    let heading = |k: u32| {
        let mut sent = line(4.0 + 0.1 * f64::from(k));
        sent["psi"] = 90.0.into();
        sent.to_string()
    };
    let rate = |k: u32| {
        let mut sent = line(4.0 + 0.1 * f64::from(k));
        sent["r"] = 45.0.into();
        sent.to_string()
    };
    let repeated = |_: u32| line(0.1 * 39.0).to_string();
    let unstamped =
        |_: u32| json!({ "x": 1.0, "y": 0.0, "psi": 0.0, "u": 1.0, "v": 0.0, "r": 0.0 }).to_string();
    let hasty = |k: u32| line(3.9 + 1e-4 * f64::from(k)).to_string();
    let kinds: [&dyn Fn(u32) -> String; 6] = [&broken, &heading, &rate, &repeated, &unstamped, &hasty];
    for (kind, sent) in kinds.iter().enumerate() {
        // In real time, and faster.
        for pause in [0.1, 0.0] {
            let mut watch = Watch::new(setup());
            let before = sail(&mut watch, 0, 40);
            assert_ne!(before["command"]["PP_cmd"], 0.0, "{before}");
            let mut first_lost = None;
            for k in 0..60 {
                watch.wait(pause).unwrap();
                let answer = watch.send(Line::Whole(sent(k).as_bytes())).unwrap().unwrap();
                if let Some(lost) = answer.get("lost") {
                    first_lost.get_or_insert(k);
                    assert_eq!(lost.as_object().unwrap().len(), QUANTITIES.len(), "{answer}");
                    assert_eq!(answer["control"], "blind", "{answer}");
                    assert_eq!(answer["command"], json!({ "PP_cmd": 0.0, "RD_ang": 0.0 }), "{answer}");
                }
            }
            // Stamps that hardly advance count as what they state unless the time is measured.
            let expected = if kind == 5 && pause == 0.0 { None } else { Some(10) };
            assert_eq!(first_lost, expected, "kind {kind}, pause {pause}");
            // With good lines the vessel is steered again.
            let again = sail(&mut watch, 110, 115);
            assert!(again.get("lost").is_none() && again["command"]["PP_cmd"] != 0.0, "{again}");
        }
    }
}

/// After silence, the service said and did nothing.
#[test]
fn silence_is_answered_once_per_second() {
    for (max_age_s, lines) in [(None, 4), (Some(2.5), 3), (Some(0.3), 5)] {
        let own;
        let setup = if max_age_s.is_none() {
            setup()
        } else {
            own = steered(max_age_s);
            &own
        };
        let mut watch = Watch::new(setup);
        assert_eq!(watch.stream.due_s(), None, "nothing was commanded yet");
        watch.wait(10.0).unwrap();
        sail(&mut watch, 0, 20);
        assert_eq!(watch.wait(4.9).unwrap(), lines, "{max_age_s:?}");
        assert_eq!(watch.stream.summary().lines.lost, lines as u64);
        let said = watch.last.clone();
        assert_eq!((&said["line"], &said["t"], &said["status"]), (&json!(20), &Value::Null, &json!("lost")));
        let age = said["lost"]["heading"].as_f64().unwrap();
        let expected = setup.controller.max_age_s + (lines - 1) as f64;
        assert!((age - expected).abs() < 2e-3, "{said}");
        assert!(said["note"].as_str().unwrap().contains("no measurement of position, heading, u, v, r for "));
    }
}

/// A heading that is always missing was replaced by its prediction for ten seconds, and an absent sway for ever.
#[test]
fn each_quantity_has_its_age() {
    for (keys, name) in [
        (&["x"][..], "position"),
        (&["x", "y"], "position"),
        (&["psi"], "heading"),
        (&["u"], "u"),
        (&["v"], "v"),
        (&["r"], "r"),
    ] {
        let mut watch = Watch::new(setup());
        sail(&mut watch, 0, 20);
        for k in 20..40 {
            let mut sent = line(0.1 * f64::from(k));
            for key in keys {
                sent[key] = Value::Null;
            }
            let answer = watch.send(Line::Whole(sent.to_string().as_bytes())).unwrap().unwrap();
            let lost: Vec<&String> = answer["lost"].as_object().map_or(vec![], |lost| lost.keys().collect());
            assert_eq!(lost, if k < 30 { vec![] } else { vec![name] }, "{k}: {answer}");
        }
        assert!(sail(&mut watch, 40, 41).get("lost").is_none());
    }
}

/// A receiver that froze repeated its position with velocities of zero, and the vessel left at full speed for a minute and more.
#[test]
fn a_position_that_repeats_under_commands_is_not_steered_by() {
    for (noise, is_stuck) in [(0.0, true), (0.01, false)] {
        let mut watch = Watch::new(setup());
        let before = sail(&mut watch, 0, 40);
        assert_ne!(before["command"]["PP_cmd"], 0.0, "{before}");
        let mut rested = None;
        for k in 0..100 {
            let mut sent = line(3.9);
            sent["t"] = (4.0 + 0.1 * f64::from(k)).into();
            sent["x"] = (1.5 * 3.9 + noise * f64::from(k % 3)).into();
            (sent["u"], sent["r"]) = (0.0.into(), (1e-3 * f64::from(k % 5)).into());
            watch.wait(0.1).unwrap();
            let answer = watch.send(Line::Whole(sent.to_string().as_bytes())).unwrap().unwrap();
            if answer["note"].as_str().is_some_and(|note| note.contains("the same to the last digit")) {
                rested.get_or_insert(k);
            }
            let found = rested.is_some_and(|since| k > since + 11);
            assert!(!found || watch.is_neutral && answer["control"] == "blind", "{k}: {answer}");
        }
        assert_eq!(rested.is_some_and(|k| k < 33), is_stuck, "{noise}: {rested:?}");
    }
}

/// A thruster that was lost or reversed was named by nothing; the vessel drove round until it had lost its path.
#[test]
fn a_vessel_that_does_not_answer_to_its_commands_is_stopped_and_the_input_named() {
    let mut named = NamedModel::read("hydrofoil".as_ref()).unwrap();
    let bands = PredictionBands {
        levels: vec![0.5, 0.8, 0.9],
        horizons: vec![1, 100],
        half_widths: vec![vec![vec![0.05, 0.05, 0.02, 0.05]; 2]; 3],
    };
    named.model.description.bands = Some(bands);
    let options = ClosedLoopOptions {
        controller: ControlMethod::FeedbackLinearization,
        task: hydroid::config::control::TaskKind::LawnMower,
        ..ClosedLoopOptions::default()
    };
    let setup = Setup::new(options, Some(named), None).unwrap();
    for (of, as_if) in [
        (Fault::None, ""),
        (Fault::Lost, "RD_ang acts as if it had no effect"),
        (Fault::Reversed, "RD_ang acts as if it were reversed"),
    ] {
        let mut watch = Watch::new(&setup);
        let mut vessel = setup.model.session();
        let mut y = vec![0.0; vessel.outputs()];
        vessel.observe(&y);
        let (mut eta, mut named) = ([0.0, 3.0, 0.5], None);
        for k in 0..600 {
            vessel.output(&mut y);
            let [u, v, r] = [y[0], y[1], y[2]];
            let sent = json!({ "t": 0.1 * f64::from(k), "x": eta[0], "y": eta[1], "psi": eta[2], "u": u, "v": v, "r": r });
            watch.wait(0.1).unwrap();
            let answer = watch.send(Line::Whole(sent.to_string().as_bytes())).unwrap().unwrap();
            let command = &answer["command"];
            if answer["control"] == "stopped" {
                assert!(watch.is_neutral, "{answer}");
                named.get_or_insert((k, answer["note"].as_str().unwrap().to_owned()));
            }
            let [push, mut rudder] = ["PP_cmd", "RD_ang"].map(|name| command[name].as_f64().unwrap());
            if k >= 150 {
                rudder *= match of {
                    Fault::None => 1.0,
                    Fault::Lost => 0.0,
                    Fault::Reversed => -1.0,
                };
            }
            vessel.advance(&[push, rudder]);
            let (sin, cos) = (eta[2] + 0.05 * r).sin_cos();
            eta = [eta[0] + 0.1 * (u * cos - v * sin), eta[1] + 0.1 * (u * sin + v * cos), eta[2] + 0.1 * r];
        }
        match named {
            None => assert_eq!(of, Fault::None),
            Some((k, note)) => assert!((150..300).contains(&k) && note.contains(as_if), "{k}: {note}"),
        }
    }
}

/// At the end of the input the last command stayed in force.
#[test]
fn the_end_of_the_input_leaves_neutral_commands() {
    let mut watch = Watch::new(setup());
    let before = sail(&mut watch, 0, 40);
    assert_ne!(before["command"]["PP_cmd"], 0.0, "{before}");
    let mut out = Vec::new();
    assert_eq!(watch.stream.end("the input has ended", &mut out).unwrap(), None);
    let last: Value = serde_json::from_slice(&out).unwrap();
    assert_eq!((&last["status"], &last["command"]["PP_cmd"]), (&json!("lost"), &json!(0.0)), "{last}");
    assert!(last["note"].as_str().unwrap().contains("the input has ended: the commands rest"), "{last}");
    out.clear();
    assert_eq!(watch.stream.end("the input has ended", &mut out).unwrap(), None);
    assert!(out.is_empty());
}

/// A single wrong yaw rate turned the dead reckoning for good, and ended the mission.
#[test]
fn one_wrong_velocity_does_not_end_the_mission() {
    for key in ["u", "v", "r"] {
        let port = setup().model.description.outputs.iter().find(|port| port.channel.name == key).unwrap();
        let range = port.training_range.unwrap_or(port.range);
        let value = line(4.0)[key].as_f64().unwrap() + 1.1 * (range.high - range.low);
        let mut watch = Watch::new(setup());
        sail(&mut watch, 0, 40);
        let mut sent = line(4.0);
        sent[key] = value.into();
        watch.wait(0.1).unwrap();
        let answer = watch.send(Line::Whole(sent.to_string().as_bytes())).unwrap().unwrap();
        let note = answer["note"].as_str().unwrap_or_default();
        assert!(note.contains("by more than the range of the model"), "{key} = {value}: {answer}");
        for k in 41..300 {
            let answer = sail(&mut watch, k, k + 1);
            assert!(answer.get("lost").is_none() && answer["control"] != "blind", "{key}, {k}: {answer}");
            assert_ne!(answer["control"], "stopped", "{key}, {k}: {answer}");
        }
    }
}

/// A log that is sent faster than real time has the same answers each time.
#[test]
fn a_log_in_a_pipe_has_answers_of_its_own() {
    let lines: Vec<String> = (0..300)
        .map(|k| {
            let mut sent = line(0.1 * f64::from(k));
            match k % 71 {
                20..35 => "{".to_owned(),
                40..55 => {
                    sent["psi"] = Value::Null;
                    sent.to_string()
                }
                _ => sent.to_string(),
            }
        })
        .collect();
    let answers = |wait: &dyn Fn(usize) -> f64| -> Vec<Value> {
        let mut watch = Watch::new(setup());
        let all = lines.iter().enumerate().map(|(k, sent)| {
            watch.wait(wait(k)).unwrap();
            watch.send(Line::Whole(sent.as_bytes())).unwrap().unwrap()
        });
        all.collect()
    };
    let at_once = answers(&|_| 0.0);
    assert!(at_once.iter().any(|answer| answer.get("lost").is_some()));
    for pace in [1e-6, 1e-5, 9e-4] {
        assert!(at_once == answers(&|k| pace * (k as f64).sin().abs()), "{pace}");
    }
}

/// What happens next.
#[derive(Clone, Debug)]
enum Next {
    Good,
    Missing(u8),
    Stamp(f64),
    /// The clock of the lines is set.
    Clock(f64),
    Repeated,
    Bytes(Vec<u8>),
    TooLong,
    Wrong(&'static str),
    Blank,
    Silence(f64),
}

fn next() -> impl Strategy<Value = Next> {
    let shift = prop_oneof![-3.0..3.0f64, -1e5..1e5f64, -1e-3..1e-3f64];
    let wrong = [
        r#"{"t":null,"x":1,"y":0,"psi":0,"u":1,"v":0,"r":0}"#,
        r#"{"t":1e300,"x":1,"y":0,"psi":0,"u":1,"v":0,"r":0}"#,
        r#"{"x":1,"y":0,"psi":0,"u":1,"v":0,"r":0}"#,
        "{broken",
        "[]",
        "t,x,y",
    ];
    prop_oneof![
        20 => Just(Next::Good),
        6 => any::<u8>().prop_map(Next::Missing),
        3 => shift.clone().prop_map(Next::Stamp),
        1 => shift.prop_map(Next::Clock),
        4 => Just(Next::Repeated),
        2 => prop::collection::vec(any::<u8>(), 1..40).prop_map(Next::Bytes),
        1 => Just(Next::TooLong),
        6 => prop::sample::select(wrong.to_vec()).prop_map(Next::Wrong),
        1 => Just(Next::Blank),
        3 => (0.0..4.0f64).prop_map(Next::Silence),
    ]
}

/// Pace of the lines against their stamps, and stretches of the same event.
fn case() -> impl Strategy<Value = (f64, Vec<(Next, usize)>)> {
    let pace = prop_oneof![Just(0.1), Just(0.0), 0.0..1.5f64, Just(0.01)];
    (pace, prop::collection::vec((next(), prop_oneof![Just(1usize), 1..20usize]), 1..12))
}

fn check(pace: f64, events: &[(Next, usize)]) -> Result<(), TestCaseError> {
    let mut watch = Watch::new(setup());
    let (mut t, mut offset, mut last) = (0.0, 0.0, line(0.0).to_string());
    watch.send(Line::Whole(last.as_bytes()))?;
    for (next, times) in events {
        for _ in 0..*times {
            watch.wait(pace)?;
            t += 0.1;
            let mut sent = line(t + offset);
            match next {
                Next::Good => {}
                Next::Missing(which) => {
                    for (i, key) in ["x", "y", "psi", "u", "v", "r"].iter().enumerate() {
                        if which >> i & 1 == 1 {
                            sent[key] = Value::Null;
                        }
                    }
                }
                Next::Stamp(by) => sent["t"] = (t + offset + by).into(),
                Next::Clock(by) => {
                    offset += by;
                    sent["t"] = (t + offset).into();
                }
                Next::Repeated => {
                    watch.send(Line::Whole(last.as_bytes()))?;
                    continue;
                }
                Next::Bytes(bytes) => {
                    let bytes: Vec<u8> = bytes.iter().map(|b| if *b == b'\n' { b' ' } else { *b }).collect();
                    watch.send(Line::Whole(&bytes))?;
                    continue;
                }
                Next::TooLong => {
                    watch.send(Line::TooLong)?;
                    continue;
                }
                Next::Wrong(text) => {
                    watch.send(Line::Whole(text.as_bytes()))?;
                    continue;
                }
                Next::Blank => {
                    watch.send(Line::Whole(b"  "))?;
                    continue;
                }
                Next::Silence(seconds) => {
                    watch.wait(*seconds)?;
                    continue;
                }
            }
            last = sent.to_string();
            watch.send(Line::Whole(last.as_bytes()))?;
        }
    }
    Ok(())
}

fn run(cases: u32) {
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    TestRunner::new(config).run(&case(), |(pace, events)| check(pace, &events)).unwrap();
}

#[test]
fn no_stream_leaves_a_command_older_than_its_limit() {
    run(300);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn many_streams_leave_no_command_older_than_its_limit() {
    run(crate::streams(10_000));
}
