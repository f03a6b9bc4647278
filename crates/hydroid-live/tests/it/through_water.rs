//! A stream with a heading, for a model of the motion through the water.

use std::sync::Arc;

use crate::boat::{model, settings};
use hydroid::adapt::{self, adapter};
use hydroid::log::{Channel, ChannelSpec};
use hydroid::model::{Body, CurrentEstimate, Model, Port};
use hydroid_core::current::in_body;
use hydroid_core::model::sparse::{Equations, EquationsSession, Term};
use hydroid_core::predict::Predictor;
use hydroid_live::black_box::{BlackBox, Recorder, Source, replay};
use hydroid_live::stream::{Line, Options, Stream};
use serde_json::{Value, json};
use tempfile::TempDir;

const CURRENT: [f64; 2] = [0.3, -0.2];

fn equations() -> Equations {
    // Variables: u, v, r, n, delta.
    let terms = vec![
        Term::monomial(&[0]),
        Term::monomial(&[1]),
        Term::monomial(&[2]),
        Term::monomial(&[3]),
        Term::monomial(&[4]),
    ];
    let coefficients = vec![-0.4, 0.0, 0.0, 0.5, 0.0, 0.0, -0.6, -0.1, 0.0, 0.05, 0.0, 0.1, -1.0, 0.0, 0.8];
    Equations::new(terms, coefficients, 3, 2, 0.1, 1).unwrap()
}

fn model_through_water() -> Model {
    let mut model = model();
    let sway = Port { channel: Channel::new("v", "m/s"), ..model.description.outputs[0].clone() };
    model.description.outputs.insert(1, sway);
    model.description.reading.selection.outputs = ["u", "v", "r"].map(ChannelSpec::named).into();
    model.description.reading.selection.heading = Some(ChannelSpec::named("psi"));
    model.description.current = Some(CurrentEstimate {
        motion: [0, 1, 2],
        window: 30,
        deviations: [0.02; 3],
        initial_m_s: 0.4,
        walk_m_s: 0.005,
    });
    Model { body: Body::Equations(Arc::new(equations())), ..model }
}

/// A header and the lines of a boat in the current; some headings are missing, and one is late.
fn lines() -> Vec<String> {
    let mut boat = EquationsSession::new(Arc::new(equations()));
    boat.observe(&[1.0, 0.0, 0.0]);
    let mut lines = vec!["t,u,v,r,psi [deg],n,delta".to_owned()];
    let (mut heading, mut water) = (0.5_f64, [0.0; 3]);
    for k in 0..600_u32 {
        let x = f64::from(k);
        boat.output(&mut water);
        let [surge, sway] = in_body(CURRENT, heading);
        let (n, delta) = (1.0 + (0.05 * x).sin(), 0.3 * (0.02 * x).sin() + 0.1);
        let noise = 0.005 * (x * x * 0.37).sin();
        let psi = if k % 97 == 96 { String::new() } else { heading.to_degrees().to_string() };
        let [u, v, r] = [water[0] + surge + noise, water[1] + sway - noise, water[2]];
        lines.push(format!("{},{u},{v},{r},{psi},{n},{delta}", 0.1 * x));
        let before = water[2];
        boat.advance(&[n, delta]);
        boat.output(&mut water);
        heading += 0.05 * (before + water[2]);
    }
    lines
}

#[test]
fn answers_state_the_current_and_the_black_box_replays_it() {
    let model = model_through_water();
    for guarded in [false, true] {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("boat.box");
        let options = adapt::Options::of(&model);
        let options = if guarded { options.guarded(&model) } else { options };
        let (mut adapter, used) = adapter(&model, &options, &[]).unwrap();
        let described = json!({ "learning": used });
        let source = Source::Stream("test");
        let recorder =
            Recorder::new(&settings(&path), &model, adapter.as_mut(), &options, &described, source).unwrap();
        let reading = model.description.reading.clone();
        let serving = Options { name: "test".to_owned(), reading, horizons: vec![1, 20], timing: false };
        let mut stream = Stream::new(&model, adapter, serving).unwrap();
        stream.record(recorder);
        let mut out = Vec::new();
        for line in lines() {
            stream.serve(Line::Whole(line.as_bytes()), &mut out).unwrap();
        }
        stream.finish().unwrap();
        let text = String::from_utf8(out).unwrap();
        let answers: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(answers.len(), 600);

        let number = |value: &Value| value.as_f64().unwrap();
        let last = &answers[599];
        for (key, truth) in ["north", "east"].into_iter().zip(CURRENT) {
            assert!((number(&last["current"][key]) - truth).abs() < 0.03, "{}", last["current"]);
        }
        let band = |answer: &Value| number(&answer["current"]["band_80"][0]);
        assert!(band(&answers[0]) > 0.3 && band(last) < 0.1, "{}", last["current"]);
        let surge = number(&last["estimate"]["u"]) - number(&last["through_water"]["u"]);
        let sway = number(&last["estimate"]["v"]) - number(&last["through_water"]["v"]);
        assert!((surge.hypot(sway) - 0.36).abs() < 0.05, "{last}");
        assert_eq!(last["estimate"]["r"], last["through_water"]["r"]);
        let learned = answers.iter().filter(|answer| answer["status"] == "accepted").count();
        assert!(learned > 20, "{learned}");

        let black_box = BlackBox::read(&path).unwrap();
        let mut headings = 0;
        let replayed = replay(&model, "boat", &black_box, |step| {
            headings += usize::from(step.json().get("heading").is_some());
        })
        .unwrap();
        assert_eq!((replayed.first, replayed.samples), (None, 600), "guarded: {guarded}");
        assert_eq!(headings, 594);
    }
}

#[test]
fn objects_may_lack_the_heading_at_first() {
    let model = model_through_water();
    let (adapter, _) = adapter(&model, &adapt::Options::of(&model), &[]).unwrap();
    let reading = model.description.reading.clone();
    let options = Options { name: "test".to_owned(), reading, horizons: vec![1], timing: false };
    let mut stream = Stream::new(&model, adapter, options).unwrap();
    let mut out = Vec::new();
    for line in [
        r#"{"t":0,"u":1,"v":0,"r":0,"n":1,"delta":0}"#,
        r#"{"t":0.1,"u":1,"v":0,"r":0,"n":1,"delta":0,"psi":0.2}"#,
        r#"{"t":0.2,"u":1,"v":0,"r":0,"n":1,"delta":0,"psi":"north"}"#,
    ] {
        stream.serve(Line::Whole(line.as_bytes()), &mut out).unwrap();
    }
    let text = String::from_utf8(out).unwrap();
    let answers: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!([0, 1].map(|k| answers[k]["status"].as_str().unwrap()), ["waiting"; 2]);
    assert!(answers[2]["message"].as_str().unwrap().contains("psi"), "{}", answers[2]);
    let notes = stream.take_notes();
    assert!(notes.iter().any(|note| note.message.contains("`psi`")), "{notes:?}");
}
