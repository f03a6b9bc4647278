//! Properties of the service on random streams with mixed faults, a restart in the middle, and clean input afterwards:
//!
//! - every data line has one answer, also lines that were answered before the restart;
//! - a used answer with an unknown number says why, and no number is infinite;
//! - a second after clean input has returned, all lines are used. With a guard, their predictions are finite, and from ten
//!   seconds on the errors at its horizon are at most 1.5 times those of a service that saw no fault, plus three deviations of
//!   the noise. Without a guard, nothing bounds what was learned from faults.

use std::sync::OnceLock;

use hydroid::adapt::{self, adapter};
use hydroid_core::model::sparse::EquationsSession;
use hydroid_core::predict::Predictor;
use hydroid_live::stream::{Line, Options, Stream};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use serde_json::{Value, json};

use crate::boat;

const HOSTILE: usize = 200;
const CLEAN: usize = 200;
/// Lines of a second.
const SECOND: usize = 10;
/// The second is the horizon of the guard.
const HORIZONS: [usize; 2] = [1, 20];

/// Commands, outputs and measurements of the boat.
struct Voyage {
    commands: Vec<[f64; 2]>,
    truth: Vec<[f64; 2]>,
    measured: Vec<[f64; 2]>,
}

fn voyage() -> &'static Voyage {
    static VOYAGE: OnceLock<Voyage> = OnceLock::new();
    VOYAGE.get_or_init(|| {
        let model = boat::model();
        let mut session = EquationsSession::new(model.equations().unwrap().equations().clone());
        session.observe(&[1.0, 0.0]);
        let mut own = Voyage { commands: Vec::new(), truth: Vec::new(), measured: Vec::new() };
        for k in 0..=HOSTILE + CLEAN + HORIZONS[1] {
            let x = k as f64;
            let mut y = [0.0; 2];
            session.output(&mut y);
            let noise = 0.01 * (x * x * 0.37).sin();
            let commands = [1.0 + (0.05 * x).sin(), 0.3 * (0.11 * x).sin()];
            own.commands.push(commands);
            own.truth.push(y);
            own.measured.push([y[0] + noise, y[1] - noise]);
            session.advance(&commands);
        }
        own
    })
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Learner {
    Guarded,
    GuardedFilter,
    Squares,
    Filter,
}

impl Learner {
    fn options(self) -> adapt::Options {
        let squares = adapt::Options::default();
        let filter = boat::filter();
        match self {
            Self::Guarded => squares.guarded(&boat::model()),
            Self::GuardedFilter => filter.guarded(&boat::model()),
            Self::Squares => squares,
            Self::Filter => filter,
        }
    }

    fn stream(self) -> Stream {
        let model = boat::model();
        let (adapter, _) = adapter(&model, &self.options(), &[]).unwrap();
        let reading = model.description.reading.clone();
        let options = Options { name: "test".to_owned(), reading, horizons: HORIZONS.into(), timing: false };
        Stream::new(&model, adapter, options).unwrap()
    }
}

/// What happens to a line.
#[derive(Clone, Debug)]
enum Fault {
    None,
    /// A cell (t, u, r, n, delta) has another value.
    Value(usize, f64),
    Both(f64, f64),
    Missing(usize),
    /// Text in a cell.
    Text(usize, &'static str),
    /// One stamp is wrong.
    Stamp(f64),
    /// The clock is set.
    Clock(f64),
    RepeatedStamp,
    Twice,
    Swapped,
    Dropped(usize),
    Garbage(Vec<u8>),
    TooLong,
    Quoted(bool),
    OtherFormat,
    Plan(f64),
}

fn size() -> impl Strategy<Value = f64> {
    (prop::bool::ANY, -3.0..300.0f64, 0.0..4.0f64, prop::bool::ANY).prop_map(
        |(minus, large, small, is_large)| {
            let size = 10f64.powf(if is_large { large } else { small });
            if minus { -size } else { size }
        },
    )
}

fn shift() -> impl Strategy<Value = f64> {
    (prop::bool::ANY, -1.0..11.0f64).prop_map(|(back, x)| if back { -(10f64.powf(x)) } else { 10f64.powf(x) })
}

fn fault() -> impl Strategy<Value = Fault> {
    let texts = ["x", "NaN", "inf", "-inf", "1e999", "\u{7}", "1;2", "0x10", "--1", "\"", "'", "1,5"];
    prop_oneof![
        30 => Just(Fault::None),
        4 => (1..5usize, size()).prop_map(|(cell, x)| Fault::Value(cell, x)),
        2 => (size(), size()).prop_map(|(u, r)| Fault::Both(u, r)),
        4 => (0..5usize).prop_map(Fault::Missing),
        2 => (0..5usize, prop::sample::select(texts.to_vec())).prop_map(|(cell, text)| Fault::Text(cell, text)),
        3 => shift().prop_map(Fault::Stamp),
        1 => shift().prop_map(Fault::Clock),
        2 => Just(Fault::RepeatedStamp),
        2 => Just(Fault::Twice),
        2 => Just(Fault::Swapped),
        2 => (1..30usize).prop_map(Fault::Dropped),
        2 => prop::collection::vec(any::<u8>(), 0..60).prop_map(Fault::Garbage),
        1 => Just(Fault::TooLong),
        1 => prop::bool::ANY.prop_map(Fault::Quoted),
        1 => Just(Fault::OtherFormat),
        1 => size().prop_map(Fault::Plan),
    ]
}

#[derive(Clone, Copy, Debug)]
struct Restart {
    at: usize,
    /// Whether the source is sent again from its start.
    again: bool,
}

#[derive(Clone, Debug)]
struct Case {
    learner: Learner,
    json: bool,
    faults: Vec<Fault>,
    restart: Option<Restart>,
}

fn case() -> impl Strategy<Value = Case> {
    let learners = [Learner::Guarded, Learner::GuardedFilter, Learner::Squares, Learner::Filter];
    let restart = (1..HOSTILE, prop::bool::ANY).prop_map(|(at, again)| Restart { at, again });
    (
        prop::sample::select(learners.to_vec()),
        prop::bool::ANY,
        prop::collection::vec(fault(), HOSTILE),
        prop::option::of(restart),
    )
        .prop_map(|(learner, json, faults, restart)| {
            // The first line of objects is also a header: a restarted service needs a whole one.
            let restart = restart.map(|Restart { at, again }| Restart { at, again: again || json });
            Case { learner, json, faults, restart }
        })
}

#[derive(Clone, Debug, PartialEq)]
enum Sent {
    Line(Vec<u8>),
    TooLong,
}

const NAMES: [&str; 5] = ["t", "u", "r", "n", "delta"];

/// A line from the text of its cells; blank cells are missing.
fn line(cells: &[String; 5], json: bool, plan: Option<f64>) -> Vec<u8> {
    if !json {
        return cells.join(",").into_bytes();
    }
    let mut object = serde_json::Map::new();
    for (name, cell) in NAMES.iter().zip(cells).filter(|(_, cell)| !cell.is_empty()) {
        let value = cell.parse::<f64>().ok().filter(|x| x.is_finite()).map_or(json!(cell), |x| json!(x));
        object.insert((*name).to_owned(), value);
    }
    if let Some(x) = plan {
        object.insert("commands".to_owned(), json!([[x, 0.0], [1.0, x]]));
    }
    Value::Object(object).to_string().into_bytes()
}

fn clean(k: usize, offset: f64) -> [String; 5] {
    let own = voyage();
    let ([n, delta], [u, r]) = (own.commands[k], own.measured[k]);
    [0.1 * k as f64 + offset, u, r, n, delta].map(|x| x.to_string())
}

impl Case {
    fn first(&self) -> Vec<u8> {
        if self.json { line(&clean(0, 0.0), true, None) } else { NAMES.join(",").into_bytes() }
    }

    /// The hostile lines, and the offset of the clock after them.
    fn hostile(&self) -> (Vec<Sent>, f64) {
        let (mut sent, mut offset, mut dropped) = (vec![Sent::Line(self.first())], 0.0, 0);
        let mut swaps = Vec::new();
        for (k, fault) in self.faults.iter().enumerate().skip(usize::from(self.json)) {
            if dropped > 0 {
                dropped -= 1;
                continue;
            }
            let mut cells = clean(k, offset);
            let (mut json, mut plan) = (self.json, None);
            match fault {
                Fault::None => {}
                Fault::Value(cell, x) => cells[*cell] = x.to_string(),
                Fault::Both(u, r) => (cells[1], cells[2]) = (u.to_string(), r.to_string()),
                Fault::Missing(cell) => cells[*cell].clear(),
                Fault::Text(cell, text) => (*text).clone_into(&mut cells[*cell]),
                Fault::Stamp(by) => cells[0] = (0.1 * k as f64 + offset + by).to_string(),
                Fault::Clock(by) => {
                    offset += by;
                    cells = clean(k, offset);
                }
                Fault::RepeatedStamp => cells[0] = (0.1 * k.saturating_sub(1) as f64 + offset).to_string(),
                Fault::Twice => sent.push(Sent::Line(line(&cells, json, None))),
                Fault::Swapped => swaps.push(sent.len()),
                Fault::Dropped(count) => {
                    dropped = *count;
                    continue;
                }
                Fault::Garbage(bytes) => {
                    let bytes = bytes.iter().map(|byte| if *byte == b'\n' { b' ' } else { *byte }).collect();
                    sent.push(Sent::Line(bytes));
                    continue;
                }
                Fault::TooLong => {
                    sent.push(Sent::TooLong);
                    continue;
                }
                Fault::Quoted(open) => {
                    cells[2] = format!("\"{}{}", cells[2], if *open { "" } else { "\"" });
                }
                Fault::OtherFormat => json = !json,
                Fault::Plan(x) => plan = Some(*x),
            }
            sent.push(Sent::Line(line(&cells, json, plan)));
        }
        let last = sent.len() - 1;
        swaps.into_iter().filter(|at| *at < last).for_each(|at| sent.swap(at, at + 1));
        (sent, offset)
    }
}

/// The answer to a line, if any.
fn ask(stream: &mut Stream, sent: &Sent) -> Option<String> {
    let mut out = Vec::new();
    let line = match sent {
        Sent::Line(bytes) => Line::Whole(bytes),
        Sent::TooLong => Line::TooLong,
    };
    stream.serve(line, &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    assert!(text.matches('\n').count() <= 1 && (text.is_empty() || text.ends_with('\n')), "{text}");
    (!text.is_empty()).then_some(text)
}

fn has_null(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(values) => values.iter().any(has_null),
        Value::Object(values) => values.values().any(has_null),
        _ => false,
    }
}

fn is_used(answer: &Value) -> bool {
    answer.get("prediction").is_some()
}

/// Squared prediction error of a clean line at the horizon of the guard, the sum over both outputs.
fn error(answer: &Value, k: usize) -> f64 {
    let truth = voyage().truth[k + HORIZONS[1]];
    let error = |i: usize, name: &str| answer["prediction"][name][1].as_f64().unwrap() - truth[i];
    error(0, "u").powi(2) + error(1, "r").powi(2)
}

/// Error ten seconds after a beginning without faults; no service is more accurate later.
fn unhurt(learner: Learner) -> f64 {
    static ERRORS: [OnceLock<f64>; 4] = [const { OnceLock::new() }; 4];
    *ERRORS[learner as usize].get_or_init(|| {
        let mut stream = learner.stream();
        ask(&mut stream, &Sent::Line(NAMES.join(",").into_bytes()));
        rms(&serve_clean(&mut stream, HOSTILE, 0.0, false))
    })
}

fn serve_clean(stream: &mut Stream, from: usize, offset: f64, json: bool) -> Vec<Value> {
    (from..from + CLEAN)
        .map(|k| {
            let text = ask(stream, &Sent::Line(line(&clean(k, offset), json, None))).expect("an answer");
            serde_json::from_str(&text).unwrap()
        })
        .collect()
}

fn rms(answers: &[Value]) -> f64 {
    let from = 10 * SECOND;
    let errors = answers.iter().enumerate().skip(from).map(|(i, answer)| error(answer, HOSTILE + i));
    (errors.sum::<f64>() / (CLEAN - from) as f64).sqrt()
}

fn check_answer(text: &str) -> Result<Value, TestCaseError> {
    let answer: Value =
        serde_json::from_str(text).map_err(|e| TestCaseError::fail(format!("{e}: {text}")))?;
    let says = |key: &str| answer[key].as_str().is_some_and(|words| !words.is_empty());
    match answer["status"].as_str() {
        Some("error") => prop_assert!(says("message"), "{}", text),
        Some("repeated" | "late" | "ahead" | "between") => prop_assert!(!is_used(&answer), "{}", text),
        Some(_) => prop_assert!(is_used(&answer) && (!has_null(&answer) || says("note")), "{}", text),
        None => prop_assert!(false, "no status: {}", text),
    }
    Ok(answer)
}

fn check(case: &Case) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("boat.state");
    let start = || {
        let mut stream = case.learner.stream();
        if case.restart.is_some() {
            stream.persist_in(&state, "m".to_owned(), &1).unwrap();
        }
        stream
    };
    let mut stream = start();
    let (sent, offset) = case.hostile();
    let mut answers: Vec<Option<String>> = Vec::new();
    for (i, line) in sent.iter().enumerate() {
        if let Some(Restart { again, .. }) = case.restart.filter(|restart| restart.at == i) {
            stream = start();
            if again {
                for (line, before) in sent[..i].iter().zip(&answers) {
                    let text = ask(&mut stream, line);
                    prop_assert_eq!(text.is_some(), before.is_some());
                    let Some(text) = text else { continue };
                    let answer = check_answer(&text)?;
                    prop_assert!(
                        answer["status"] == "repeated" || Some(&text) == before.as_ref(),
                        "{}",
                        text
                    );
                }
            } else {
                ask(&mut stream, &sent[0]);
            }
        }
        let answer = ask(&mut stream, line);
        let blank = matches!(line, Sent::Line(bytes) if std::str::from_utf8(bytes).is_ok_and(|text| text.trim().is_empty()));
        let header = i == 0 && !case.json;
        prop_assert_eq!(answer.is_none(), blank || header, "line {}: {:?}", i, line);
        if let Some(text) = &answer {
            check_answer(text)?;
        }
        answers.push(answer);
    }
    let answers = serve_clean(&mut stream, HOSTILE, offset, case.json);
    for answer in &answers {
        check_answer(&answer.to_string())?;
    }
    let guarded = matches!(case.learner, Learner::Guarded | Learner::GuardedFilter);
    for answer in &answers[SECOND..] {
        prop_assert!(is_used(answer) && (!guarded || !has_null(&answer["prediction"])), "{}", answer);
    }
    if !guarded {
        return Ok(());
    }
    let (hurt, unhurt) = (rms(&answers), unhurt(case.learner));
    prop_assert!(hurt <= 1.5 * unhurt + 0.03, "{} against {}", hurt, unhurt);
    Ok(())
}

fn run(cases: u32) {
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    TestRunner::new(config).run(&case(), |case| check(&case)).unwrap();
}

#[test]
fn no_stream_disables_the_service() {
    run(40);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn many_streams_do_not_disable_the_service() {
    run(crate::streams(2000));
}
