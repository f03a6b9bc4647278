//! A live stream: each line gets a JSON answer.

use std::sync::OnceLock;

use crate::boat::model;
use hydroid::adapt::{self, adapter};
use hydroid::log::{ChannelSpec, CommandTiming, Wind};
use hydroid::model::Reading;
use hydroid_live::stream::{Line, Options, State, Stream, StreamError};
use proptest::prelude::*;
use serde_json::Value;

fn stream_reading(reading: Reading) -> Result<Stream, StreamError> {
    let model = model();
    let (adapter, _) = adapter(&model, &adapt::Options::default(), &[]).unwrap();
    let options = Options { name: "test".to_owned(), reading, horizons: vec![1, 5], timing: false };
    Stream::new(&model, adapter, options)
}

fn stream() -> Stream {
    stream_reading(model().description.reading).unwrap()
}

/// The answer to a line, if any.
fn ask(stream: &mut Stream, line: &str) -> Option<Value> {
    let mut out = Vec::new();
    stream.serve(Line::Whole(line.as_bytes()), &mut out).unwrap();
    let text = String::from_utf8(out).unwrap();
    assert!(text.matches('\n').count() <= 1, "{text}");
    (!text.is_empty()).then(|| serde_json::from_str(&text).unwrap())
}

/// Status, and note or message.
fn told(answer: Option<&Value>) -> (&str, &str) {
    let answer = answer.unwrap();
    let note = answer["note"].as_str().or(answer["message"].as_str());
    (answer["status"].as_str().unwrap(), note.unwrap_or(""))
}

#[test]
fn every_kind_of_line_has_its_answer() {
    let mut stream = stream();
    assert!(ask(&mut stream, "\u{feff}t [s],u [m/s],r [deg/s],n,delta [deg]").is_none());
    assert!(ask(&mut stream, "  ").is_none());
    let first = ask(&mut stream, "0,1.0,5.0,1.0,10").unwrap();
    assert_eq!(first["status"], "waiting");
    assert_eq!(first["line"], 3);
    assert!((first["estimate"]["r"].as_f64().unwrap() - 5.0_f64.to_radians()).abs() < 1e-15);
    assert_eq!(first["prediction"]["horizons"], serde_json::json!([1, 5]));
    assert!(first["band_80"]["u"][0].is_null() && first["band_95"]["r"][1].is_null());
    for (line, status, words) in [
        ("0.1,1.1,5,1,10", "waiting", ""),
        ("0.12,1.1,5,1,10", "between", ""),
        ("0.1,1.1,5,1,10", "late", "0.000 s before the last used one"),
        ("0.2,,5,,10", "waiting", "a missing command was replaced by the last one"),
        ("0.3,1.1,five,1,10", "error", "test, line 8, column `r`: `five` is not a number"),
        ("0.3,1.1,5,1", "error", "4 cells where the header names 5 columns"),
        (",1.1,5,1,10", "error", "column `t`: the time is missing"),
        ("0.3,1e300,5,1,10", "error", "more than any vessel does"),
        ("0.3,inf,5,1,10", "error", "is infinite"),
        ("0.5,1.1,5,1,10", "waiting", "2 missing samples were predicted"),
        ("1.6,1.1,5,1,10", "ahead", "1.100 s after the last used one"),
        ("1.7,1.1,5,1,10", "ahead", ""),
        ("1.8,1.1,5,1,10", "reset", "no sample for 1.300 s"),
        ("1.9,\"1.1\",5,1,10", "waiting", ""),
    ] {
        let answer = ask(&mut stream, line);
        let (found, note) = told(answer.as_ref());
        assert!(found == status && note.contains(words), "{line}: {answer:?}");
    }
    let mut out = Vec::new();
    stream.serve(Line::TooLong, &mut out).unwrap();
    stream.serve(Line::Whole(b"2.0,\xff"), &mut out).unwrap();
    let out = String::from_utf8(out).unwrap();
    assert!(out.contains("is an end of line missing?") && out.contains("UTF-8"), "{out}");
    let lines = stream.summary().lines;
    assert_eq!((lines.waiting, lines.error, lines.late, lines.between, lines.reset), (5, 7, 1, 1, 1));
}

#[test]
fn objects_and_cells_are_answered_alike() {
    let mut cells = stream();
    let mut objects = stream();
    assert!(ask(&mut cells, "t,u,r,n,delta").is_none());
    let mut learned = 0;
    for k in 0..600 {
        let x = f64::from(k);
        let (t, u, r) = (0.1 * x, 1.0 + 0.3 * (0.2 * x).sin(), 0.2 * (0.13 * x).cos());
        let (n, delta) = (1.0 + (0.05 * x).sin(), 0.3 * (0.11 * x).sin());
        let missing = k % 50 == 49;
        let cell = if missing { String::new() } else { u.to_string() };
        let mut a = ask(&mut cells, &format!("{t},{cell},{r},{n},{delta}")).unwrap();
        let object = if missing && k % 100 == 99 {
            serde_json::json!({ "t": t, "delta": delta, "r": r, "n": n })
        } else {
            serde_json::json!({ "delta": delta, "n": n, "r": r, "u": if missing { Value::Null } else { u.into() }, "t": t })
        };
        let b = ask(&mut objects, &object.to_string()).unwrap();
        a["line"] = (a["line"].as_u64().unwrap() - 1).into();
        assert_eq!(a, b);
        if b["status"] == "accepted" {
            learned += 1;
            assert_eq!(b["innovation"].as_array().unwrap().len(), 2);
        }
        if k == 599 {
            assert!(b["band_80"]["u"][1].as_f64().unwrap() > 0.0);
            let ratio = b["band_95"]["r"][0].as_f64().unwrap() / b["band_80"]["r"][0].as_f64().unwrap();
            assert!((ratio - 1.96 / 1.2816).abs() < 1e-3);
        }
    }
    assert!(learned > 100, "{learned}");
    assert!(cells.weights() == objects.weights());
}

#[test]
fn planned_commands_change_the_prediction_and_nothing_else() {
    let answer = |plan: &str| {
        let mut stream = stream();
        ask(&mut stream, &format!(r#"{{"t":0,"u":1,"r":0,"n":1,"delta":0{plan}}}"#)).unwrap()
    };
    let held = answer("");
    assert_eq!(answer(r#","commands":[[1,0]]"#), held);
    assert_eq!(answer(r#","commands":[[null,0],[1,null]]"#), held);
    assert_eq!(answer(r#","commands":null"#), held);
    let planned = answer(r#","commands":[[1,0],[2,0.5]]"#);
    assert_eq!(planned["estimate"], held["estimate"]);
    assert_eq!(planned["prediction"]["u"][0], held["prediction"]["u"][0]);
    assert!(planned["prediction"]["u"][1].as_f64() > held["prediction"]["u"][1].as_f64());
    for bad in [r#","commands":[[1]]"#, r#","commands":[1,0]"#, r#","commands":[["a",0]]"#] {
        let answer = answer(bad);
        assert_eq!(answer["status"], "error");
        assert!(answer["message"].as_str().unwrap().contains("rows of 2 finite numbers (n, delta)"));
    }
}

#[test]
fn the_first_line_decides_and_nonsense_there_is_an_error() {
    let fails = |line: &str, words: &str| {
        let mut stream = stream();
        let error = stream.serve(Line::Whole(line.as_bytes()), &mut Vec::new()).unwrap_err().to_string();
        assert!(error.contains(words), "{line}: {error}");
    };
    fails("0,1,2,3,4", "not column names");
    fails("hello", "no column");
    fails("t,u,n,delta", "no column `r`");
    fails("t,u,u,r,n,delta", "both called `u`");
    fails("t,u [kg],r,n,delta", "in kg");
    fails("{", "none");
    fails("{\"t\":0}", "no column `u`");
    fails("{\"t\":0,\"u\":0,\"r\":0,\"n\":0}", "no column `delta`");
    fails("\u{0}\u{1}", "no column");
    // An output that appears later gives a note.
    let mut stream = stream();
    assert!(ask(&mut stream, r#"{"t":0,"u":0,"n":0,"delta":0}"#).is_some());
    assert!(stream.take_notes().iter().any(|note| note.message.contains("no `r`")));
}

#[test]
fn times_may_be_stamps_and_wind_an_input() {
    let mut stream = stream();
    ask(&mut stream, "t;u;r;n;delta");
    for (k, status) in ["waiting", "waiting", "late"].iter().enumerate() {
        let stamp =
            ["2020-08-03T11:04:37.125Z", "2020-08-03T11:04:37.225Z", "2020-08-03T13:04:37.125+02:00"][k];
        let answer = ask(&mut stream, &format!("{stamp};0,5;0;0;0"));
        assert_eq!(told(answer.as_ref()).0, *status, "{answer:?}");
        assert!(*status == "late" || answer.unwrap()["estimate"]["u"] == 0.5);
    }
    let mut reading = model().description.reading;
    reading.selection.inputs = Vec::new();
    reading.selection.wind =
        Some(Wind { speed: ChannelSpec::named("w"), direction: ChannelSpec::named("a") });
    let mut stream = stream_reading(reading).unwrap();
    let error = stream.serve(Line::Whole(b"t,u,r,w,a"), &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("wind_x, wind_y"), "the model has other inputs: {error}");
}

#[test]
fn commands_that_are_not_known_in_time_are_refused() {
    let mut reading = model().description.reading;
    reading.options.input_delay = "-3".parse().unwrap();
    assert!(stream_reading(reading.clone()).is_err());
    reading.options.command_timing = CommandTiming::After;
    reading.options.input_delay = "0".parse().unwrap();
    assert!(stream_reading(reading.clone()).is_ok());
    reading.options.max_gap_s = Some(-1.0);
    assert!(stream_reading(reading).is_err());
}

/// A run with all kinds of lines.
fn lines(count: usize) -> Vec<String> {
    let mut lines = vec!["t,u,r,n,delta".to_owned()];
    for k in 0..count {
        let x = k as f64;
        let t = 0.1 * x + if k > count / 2 { 7.0 } else { 0.0 };
        let (u, r) = (1.0 + 0.3 * (0.2 * x).sin(), 0.2 * (0.13 * x).cos());
        let (n, delta) = (1.0 + (0.05 * x).sin(), 0.3 * (0.11 * x).sin());
        match k % 37 {
            5 => lines.push(format!("{t},,{r},{n},{delta}")),
            11 => lines.push(format!("{t},{u},{r},,{delta}")),
            17 => lines.push(format!("{t},{u},{r},{n},x")),
            23 => lines.push(format!("{},{u},{r},{n},{delta}", t - 0.35)),
            _ => lines.push(format!("{t},{u},{r},{n},{delta}")),
        }
    }
    lines
}

#[test]
fn a_stream_resumes_from_its_state_after_any_line() {
    let folder = tempfile::tempdir().unwrap();
    let lines = lines(400);
    let serve = |stream: &mut Stream, lines: &[String]| {
        lines
            .iter()
            .map(|line| {
                let mut out = Vec::new();
                stream.serve(Line::Whole(line.as_bytes()), &mut out).unwrap();
                String::from_utf8(out).unwrap()
            })
            .collect::<Vec<_>>()
    };
    let mut whole = stream();
    let expected = serve(&mut whole, &lines);
    for killed in [1, 2, 3, 30, 31, 77, 200, 201, 202, 203, 204, 399] {
        let path = folder.path().join(format!("{killed}.state"));
        let mut first = stream();
        assert_eq!(first.persist_in(&path, "m".to_owned(), &1).unwrap(), None);
        serve(&mut first, &lines[..killed]);
        drop(first);
        let mut second = stream();
        let from = second.persist_in(&path, "m".to_owned(), &1).unwrap();
        let answers = serve(&mut second, &lines);
        let time = |answer: &str| serde_json::from_str::<Value>(answer).ok().and_then(|a| a["t"].as_f64());
        let used = expected[..killed].iter().filter(|answer| answer.contains("prediction"));
        let last = used.filter_map(|answer| time(answer)).fold(f64::NAN, f64::max);
        assert!(killed < 2 || last - from.unwrap() <= 1.0 + 1e-9, "{killed}: {last} {from:?}");
        for (answer, expected) in answers.iter().zip(&expected) {
            // The lines up to the state are answered again, without effect; the others as before.
            let repeated = answer.contains("\"status\":\"repeated\"");
            assert!(if repeated { from.is_some() } else { answer == expected }, "{killed}: {answer}");
        }
        assert!(second.weights() == whole.weights(), "{killed}");
    }
}

#[test]
fn a_state_of_another_model_is_refused_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.state");
    let mut first = stream();
    first.persist_in(&path, "m".to_owned(), &1).unwrap();
    for line in lines(30) {
        first.serve(Line::Whole(line.as_bytes()), &mut Vec::new()).unwrap();
    }
    first.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert!(State::decode(&bytes).is_ok());
    let refused = |reading: Reading, model: &str, settings: i32, words: &str| {
        let mut second = stream_reading(reading).unwrap();
        let error = second.persist_in(&path, model.to_owned(), &settings).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    let reading = model().description.reading;
    refused(reading.clone(), "n", 1, "another model");
    refused(reading.clone(), "m", 2, "learning: 1 in the file, 2 given");
    let mut other = reading.clone();
    other.options.max_gap_s = Some(2.0);
    refused(other, "m", 1, "reading.options.max_gap_s");
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
    for cut in [0, 7, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        refused(reading.clone(), "m", 1, "damaged");
        assert_eq!(std::fs::read(&path).unwrap().len(), cut);
    }
}

/// The state of a stream after all kinds of lines.
fn state() -> &'static [u8] {
    static STATE: OnceLock<Vec<u8>> = OnceLock::new();
    STATE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.state");
        let mut stream = stream();
        stream.persist_in(&path, "m".to_owned(), &1).unwrap();
        for line in lines(60) {
            stream.serve(Line::Whole(line.as_bytes()), &mut Vec::new()).unwrap();
        }
        stream.finish().unwrap();
        std::fs::read(&path).unwrap()
    })
}

/// The numbers of a state, which follow the header.
fn numbers(state: &[u8]) -> &[u8] {
    let header = u64::from_le_bytes(state[..8].try_into().unwrap());
    &state[8 + usize::try_from(header).unwrap()..]
}

#[test]
fn a_state_is_encoded_exactly_and_another_format_is_named() {
    let bytes = state();
    assert_eq!(State::decode(bytes).unwrap().encode().unwrap(), bytes);
    let text = String::from_utf8_lossy(bytes);
    let mut changed = bytes.to_vec();
    let version = "version\\\":";
    changed[text.find(version).unwrap() + version.len()] = b'7';
    assert!(State::decode(&changed).unwrap_err().contains("format 7"));
}

/// Nearly valid lines.
fn nearly() -> impl Strategy<Value = Vec<u8>> {
    let cell = prop_oneof![
        "-?[0-9]{1,3}(\\.[0-9]{1,3})?(e[0-9]{1,3})?",
        Just(String::new()),
        "[ -~]{0,6}",
        Just("2020-08-03T11:04:37Z".to_owned()),
        Just("\"".to_owned()),
    ];
    let csv = prop::collection::vec(cell.clone(), 0..7).prop_map(|cells| cells.join(",").into_bytes());
    let json = prop::collection::vec(("(t|u|r|n|delta|commands|x)", cell), 0..7).prop_map(|pairs| {
        let pairs: Vec<String> = pairs.iter().map(|(key, value)| format!("\"{key}\":{value}")).collect();
        format!("{{{}}}", pairs.join(",")).into_bytes()
    });
    prop_oneof![csv, json, prop::collection::vec(any::<u8>(), 0..40)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn arbitrary_lines_are_answered(
        object in any::<bool>(),
        lines in prop::collection::vec(nearly(), 0..30),
    ) {
        let mut stream = stream();
        let header: &[u8] = if object { br#"{"t":0,"u":0,"r":0,"n":0,"delta":0}"# } else { b"t,u,r,n,delta" };
        stream.serve(Line::Whole(header), &mut Vec::new()).unwrap();
        for line in lines {
            let mut out = Vec::new();
            stream.serve(Line::Whole(&line), &mut out).unwrap();
            let blank = std::str::from_utf8(&line).is_ok_and(|line| line.trim().is_empty());
            if blank {
                prop_assert!(out.is_empty());
            } else {
                prop_assert!(serde_json::from_slice::<Value>(&out).unwrap()["status"].is_string());
            }
        }
    }

    #[test]
    fn a_truncated_or_changed_state_is_refused(cut in 0.0..1.0f64, at in 0.0..1.0f64, to in any::<u8>()) {
        let bytes = state();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let place = |share: f64| (share * bytes.len() as f64) as usize;
        prop_assert!(State::decode(&bytes[..place(cut)]).is_err());
        let mut changed = bytes.to_vec();
        changed[place(at)] = to;
        // Or the change does not concern the numbers.
        if let Ok(back) = State::decode(&changed) {
            let back = back.encode().unwrap();
            prop_assert_eq!(numbers(&back), numbers(bytes));
        }
    }

    #[test]
    fn bytes_are_no_state(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(State::decode(&bytes).is_err());
    }

    #[test]
    fn any_first_line_begins_or_is_refused(line in nearly()) {
        let _ = stream().serve(Line::Whole(&line), &mut Vec::new());
    }
}

#[test]
fn offsets_and_scales_apply_to_measurements_and_commands() {
    let mut reading = model().description.reading;
    reading.selection.outputs = vec!["u=(u - 1) * 2".parse().unwrap(), "r".parse().unwrap()];
    reading.selection.inputs = vec!["n=(pwm - 1500) / 400".parse().unwrap(), "delta".parse().unwrap()];
    let mut stream = stream_reading(reading).unwrap();
    assert!(ask(&mut stream, "t [s],u [m/s],r [rad/s],pwm,delta [rad]").is_none());
    let answer = ask(&mut stream, "0,1.5,0.1,1700,0").unwrap();
    assert_eq!(answer["estimate"]["u"], 1.0, "{answer}");
    // du/dt = -0.3 u |u| + 0.5 n with n = 0.5.
    let next = answer["prediction"]["u"][0].as_f64().unwrap();
    assert!((next - (1.0 + 0.1 * (-0.3 + 0.25))).abs() < 1e-3, "{answer}");
}

/// Answers to lines of the boat at 10 Hz from a time on; `t` gives the stamp of a sample.
fn sail(stream: &mut Stream, from: usize, to: usize, t: impl Fn(usize) -> f64) -> Vec<Value> {
    let line = |k: usize| {
        let ([n, delta], [u, r]) = crate::boat::sample(k);
        format!("{},{u},{r},{n},{delta}", t(k))
    };
    (from..to).map(|k| ask(stream, &line(k)).unwrap()).collect()
}

fn statuses(answers: &[Value]) -> Vec<&str> {
    answers.iter().map(|answer| answer["status"].as_str().unwrap()).collect()
}

/// Hostile story 1: one command of 1e200 made all later predictions null.
#[test]
fn one_absurd_command_is_refused_and_the_last_one_is_held() {
    for absurd in ["1e200", "-1e60", "1e9"] {
        let ([_, delta], [u, r]) = crate::boat::sample(100);
        let mut hurt = begun();
        let answer = ask(&mut hurt, &format!("10,{u},{r},{absurd},{delta}")).unwrap();
        let (status, note) = told(Some(&answer));
        assert!(note.contains("the command n = ") && note.contains("was refused"), "{answer}");
        assert!(status == "accepted" || status == "waiting", "{answer}");
        for answer in std::iter::once(answer).chain(sail(&mut hurt, 101, 200, |k| 0.1 * k as f64)) {
            for name in ["u", "r"] {
                assert!(answer["prediction"][name].as_array().unwrap().iter().all(Value::is_f64), "{answer}");
            }
        }
    }
}

/// A stream that has seen a hundred samples.
fn begun() -> Stream {
    let mut stream = stream();
    ask(&mut stream, "t,u,r,n,delta");
    sail(&mut stream, 0, 100, |k| 0.1 * k as f64);
    stream
}

/// Hostile story 2: one stamp of 5e7 silenced the service, and one that was wrong by seconds cost ten lines.
#[test]
fn one_wrong_time_stamp_costs_one_line() {
    for by in [1.5, 30.0, 3_000.0, 5e7, -1.5, -30.0, -3_000.0] {
        let mut stream = begun();
        let wrong = sail(&mut stream, 100, 101, |k| 0.1 * k as f64 + by);
        assert_eq!(statuses(&wrong), [if by > 0.0 { "ahead" } else { "late" }], "{by}");
        let note = wrong[0]["note"].as_str().unwrap();
        assert!(note.contains("the last used one"), "{note}");
        let after = sail(&mut stream, 101, 130, |k| 0.1 * k as f64);
        let expected = ["accepted", "waiting", "inflated"];
        assert!(statuses(&after).iter().all(|status| expected.contains(status)), "{by}: {after:?}");
        assert!(after[0]["note"].as_str().unwrap().contains("1 missing samples were predicted"), "{by}");
    }
}

/// Hostile story 2: a gap, or a clock that was set, is followed with the third line.
#[test]
fn a_clock_that_is_set_is_followed_with_the_third_line() {
    for by in [-3_600.0, -40.0, -2.0, 1.5, 7_200.0, 1e6] {
        let mut stream = begun();
        let answers = sail(&mut stream, 100, 200, |k| 0.1 * k as f64 + by);
        let told = statuses(&answers);
        let aside = if by > 0.0 { "ahead" } else { "late" };
        assert_eq!(told[..3], [aside, aside, "reset"], "{by}");
        let note = answers[2]["note"].as_str().unwrap();
        assert!(note.contains("a new run begins, the weights are kept"), "{by}: {note}");
        assert_eq!(note.contains("the clock was set back"), by < 0.0, "{by}: {note}");
        let expected = ["accepted", "waiting", "inflated"];
        assert!(told[3..].iter().all(|status| expected.contains(status)), "{by}: {told:?}");
    }
    // Lines that come twice confirm nothing.
    let mut stream = begun();
    let again = sail(&mut stream, 50, 90, |_| 9.9);
    assert!(statuses(&again).iter().all(|status| *status == "late"));
}

/// Stamps of whole seconds at ten lines a second.
#[test]
fn stamps_of_coarse_resolution_confirm_a_clock_that_was_set() {
    let mut stream = stream();
    ask(&mut stream, "t,u,r,n,delta");
    let before = sail(&mut stream, 0, 100, |k| (k / 10) as f64);
    assert_eq!(statuses(&before).iter().filter(|status| **status == "late").count(), 90);
    let after = sail(&mut stream, 100, 200, |k| (k / 10) as f64 - 500.0);
    assert_eq!(statuses(&after)[..3], ["late", "late", "reset"]);
    let used = statuses(&after).iter().filter(|status| **status == "waiting").count();
    assert_eq!(used, 9, "one sample of each later second");
}

/// Lines that come more rarely than the longest gap.
#[test]
fn rare_lines_are_used() {
    let mut stream = stream();
    ask(&mut stream, "t,u,r,n,delta");
    let told = sail(&mut stream, 0, 50, |k| 2.5 * k as f64);
    let told = statuses(&told);
    assert_eq!(told[..4], ["waiting", "ahead", "ahead", "reset"]);
    assert!(told[4..].iter().all(|status| *status == "reset"), "{told:?}");
    // They may also be set.
    let told = sail(&mut stream, 50, 60, |k| 2.5 * k as f64 - 1e5);
    let told = statuses(&told);
    assert_eq!(told[..4], ["late", "late", "reset", "reset"]);
}

/// A stream with a state, and the time from which it resumes; a header was sent.
fn kept(path: &std::path::Path) -> (Stream, Option<f64>) {
    let mut stream = stream();
    let from = stream.persist_in(path, "m".to_owned(), &1).unwrap();
    ask(&mut stream, "t,u,r,n,delta");
    (stream, from)
}

/// Hostile story 2: after a restart with the state, a clock that was set back had no answers at all.
#[test]
fn the_first_line_after_a_restart_is_believed() {
    for by in [-3_600.0, 3_600.0] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("boat.state");
        let (mut first, _) = kept(&path);
        sail(&mut first, 0, 100, |k| 5_000.0 + 0.1 * k as f64);
        drop(first);
        let (mut second, from) = kept(&path);
        assert!(from.unwrap() > 5_008.0);
        let told = sail(&mut second, 100, 150, |k| 5_000.0 + by + 0.1 * k as f64);
        let told = statuses(&told);
        assert_eq!(told[0], "reset", "{by}");
        assert!(told[1..].iter().all(|status| ["accepted", "waiting"].contains(status)), "{told:?}");
        // The state follows the clock.
        second.finish().unwrap();
        let (_, from) = kept(&path);
        assert!((from.unwrap() - (5_014.9 + by)).abs() < 0.06, "{from:?}");
    }
}

/// A log that is sent again after a restart is not learned twice, whatever the earlier sessions were.
#[test]
fn a_log_that_is_sent_again_is_answered_and_not_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("boat.state");
    let (mut monday, _) = kept(&path);
    sail(&mut monday, 0, 200, |k| 90_000.0 + 0.1 * k as f64);
    monday.finish().unwrap();
    // The log of an earlier day follows; the service is killed in it.
    let sunday = |k: usize| 0.1 * k as f64;
    let (mut second, _) = kept(&path);
    let expected = sail(&mut second, 0, 150, sunday);
    drop(second);
    let (mut third, from) = kept(&path);
    let from = from.unwrap();
    assert!(from > 13.0 && from < 15.0, "{from}");
    let answers = sail(&mut third, 0, 150, sunday);
    let repeated = statuses(&answers).iter().filter(|status| **status == "repeated").count();
    assert!((repeated as f64 - (10.0 * from + 1.0)).abs() < 1.5, "{repeated}");
    assert!(answers[0]["note"].as_str().unwrap().contains("answered before the restart"));
    assert_eq!(answers[repeated..], expected[repeated..], "the rest as without the kill");
    assert_eq!(third.summary().lines.repeated, repeated as u64);
}

/// A client that does not know what was answered sends its last second again.
#[test]
fn the_last_second_may_be_sent_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("boat.state");
    let time = |k: usize| 0.1 * k as f64;
    let (mut first, _) = kept(&path);
    sail(&mut first, 0, 100, time);
    first.finish().unwrap();
    let (mut second, _) = kept(&path);
    let told = sail(&mut second, 90, 130, time);
    let told = statuses(&told);
    assert!(told[..10].iter().all(|status| *status == "repeated"), "{told:?}");
    assert!(told[10..].iter().all(|status| ["accepted", "waiting"].contains(status)), "{told:?}");
}

/// Noise on the line before the first sample is not a sign that the source begins again.
#[test]
fn unreadable_first_lines_do_not_tell_where_the_source_begins() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("boat.state");
    let time = |k: usize| 0.1 * k as f64;
    let session = |from: usize, to: usize| {
        let (mut stream, _) = kept(&path);
        let answer = ask(&mut stream, "\u{7}").unwrap();
        assert_eq!(answer["status"], "error");
        let answers = sail(&mut stream, from, to, time);
        stream.finish().unwrap();
        answers
    };
    session(0, 100);
    let told = session(100, 110);
    assert!(statuses(&told).iter().all(|status| ["accepted", "waiting"].contains(status)), "{told:?}");
    let told = session(100, 130);
    assert!(statuses(&told[..10]).iter().all(|status| *status == "repeated"), "{told:?}");
    assert!(statuses(&told[10..]).iter().all(|status| ["accepted", "waiting"].contains(status)), "{told:?}");
}
