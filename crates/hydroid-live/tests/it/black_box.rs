//! The black box of an adapter: replay bit for bit, and files damaged by a kill or a full disk.

use std::fs;
use std::path::{Path, PathBuf};

use crate::boat::{filter, lines, model, settings};
use hydroid::adapt::{self, Method, adapter};
use hydroid_live::black_box::{BlackBox, Recorder, Replayed, Source, Step, event, replay};
use hydroid_live::stream::{Line, Options, Stream};
use proptest::prelude::*;
use serde_json::Value;
use tempfile::TempDir;

/// All adapters.
fn learners() -> Vec<(&'static str, adapt::Options)> {
    let squares = adapt::Options::default();
    let filter = filter();
    vec![
        ("least squares, guarded", squares.clone().guarded(&model())),
        ("filter, guarded", filter.clone().guarded(&model())),
        ("least squares", squares),
        ("filter", filter),
    ]
}

fn stream(path: &Path, options: &adapt::Options, name: &str) -> Result<Stream, String> {
    let model = model();
    let (mut adapter, used) = adapter(&model, options, &[]).unwrap();
    let source = Source::Stream(name);
    let described = serde_json::json!({ "learning": used });
    let recorder = Recorder::new(&settings(path), &model, adapter.as_mut(), options, &described, source)
        .map_err(|error| error.to_string())?;
    let serving = Options {
        name: name.to_owned(),
        reading: model.description.reading.clone(),
        horizons: vec![1, 20],
        timing: false,
    };
    let mut stream = Stream::new(&model, adapter, serving).unwrap();
    stream.record(recorder);
    Ok(stream)
}

/// Serves lines and returns the answers.
fn serve(stream: &mut Stream, lines: &[String]) -> Vec<Value> {
    let mut out = Vec::new();
    for line in lines {
        stream.serve(Line::Whole(line.as_bytes()), &mut out).unwrap();
    }
    let text = String::from_utf8(out).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn played(path: &Path) -> (Replayed, Vec<Value>) {
    let mut steps = Vec::new();
    let black_box = BlackBox::read(path).unwrap();
    let replayed = replay(&model(), "boat", &black_box, |step| {
        if step.is_sample() {
            steps.push(step.json());
        }
    })
    .unwrap();
    (replayed, steps)
}

fn place() -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("boat.box");
    (folder, path)
}

#[test]
fn every_adapter_is_replayed_bit_for_bit() {
    for (name, options) in learners() {
        let (_folder, path) = place();
        let mut stream = stream(&path, &options, "test").unwrap();
        let answers = serve(&mut stream, &lines(900));
        stream.finish().unwrap();
        let (replayed, steps) = played(&path);
        assert_eq!(replayed.first, None, "{name}");
        let mut compared = 0;
        for answer in answers.iter().filter(|a| !["late", "ahead", "between", "error"].contains(&told(a))) {
            // Grid points without a sample have no answer.
            let step = steps.iter().find(|step| step["t"] == answer["t"]).unwrap();
            for key in ["estimate", "prediction", "innovation", "nis"] {
                assert_eq!(step[key], answer[key], "{name}: {key} of {answer}");
            }
            assert!(told(answer) == "reset" || step["status"] == answer["status"]);
            compared += 1;
        }
        assert!(compared > 800 && replayed.samples > compared, "{name}: {compared}");
        let black_box = BlackBox::read(&path).unwrap();
        let summary = black_box.summary();
        assert_eq!((summary.samples, summary.sessions, summary.torn), (replayed.samples, 1, 0));
        let outcomes = summary.outcomes;
        assert!(outcomes.accepted > 200 && outcomes.waiting > 0, "{name}: {outcomes:?}");
        assert_eq!(summary.events.is_empty(), options.guard.is_none(), "{name}");
        if options.guard.is_some() {
            assert!(
                summary
                    .events
                    .iter()
                    .any(|event| event.action == "spike" && event.text.contains("u deviates"))
            );
            assert_eq!(summary.predicted_by.iter().sum::<usize>(), summary.samples);
        }
        assert_eq!(summary.min_s_over_r.is_nan(), options.method == Method::LeastSquares, "{name}");
    }
}

fn told(answer: &Value) -> &str {
    answer["status"].as_str().unwrap()
}

#[test]
fn the_ring_buffer_holds_the_last_minutes() {
    let (_folder, path) = place();
    let options = adapt::Options::default().guarded(&model());
    let mut stream = stream(&path, &options, "test").unwrap();
    let lines = lines(6000);
    let mut longest = 0;
    for part in lines.chunks(700) {
        serve(&mut stream, part);
        longest = longest.max(fs::metadata(&path).unwrap().len());
    }
    stream.finish().unwrap();
    let (replayed, steps) = played(&path);
    // Includes segment boundaries, where the state of the adapter is compared.
    assert_eq!(replayed.first, None);
    let [from, to] = [steps.first(), steps.last()].map(|step| step.unwrap()["t"].as_f64().unwrap());
    assert!(to > 599.0 && to - from > 119.0, "{from} {to}");
    assert!(replayed.samples <= 2400, "a ring of four minutes");
    assert_eq!(fs::metadata(&path).unwrap().len(), longest, "it does not grow");
    assert_eq!(BlackBox::read(&path).unwrap().summary().sessions, 1);
}

#[test]
fn a_killed_recording_loses_one_second_and_a_restart_appends() {
    let (_folder, path) = place();
    let options = adapt::Options::default().guarded(&model());
    let lines = lines(300);
    let mut killed = stream(&path, &options, "test").unwrap();
    for n in [1, 2, 11, 37, 145] {
        killed = stream(&path, &options, "test").unwrap();
        let answers = serve(&mut killed, &lines[..=n]);
        let black_box = BlackBox::read(&path).unwrap();
        let last = black_box.steps().filter(|step| step.is_sample()).last().unwrap().t();
        let lost = answers.last().unwrap()["t"].as_f64().unwrap() - last;
        assert!((0.0..1.05).contains(&lost), "{n}: {lost}");
    }
    drop(killed);
    let summary = BlackBox::read(&path).unwrap().summary();
    assert_eq!(summary.sessions, 4, "five sessions in a ring of four segments");
    assert_eq!(played(&path).0.first, None);
    // A recording with other settings is refused and leaves the file unchanged.
    let kept = fs::read(&path).unwrap();
    let reason = stream(&path, &adapt::Options::default(), "test").err().unwrap();
    assert!(reason.contains("other settings") && reason.contains("move it"), "{reason}");
    fs::write(&path, "t,u\n0,1\n").unwrap();
    let reason = stream(&path, &options, "test").err().unwrap();
    assert!(reason.contains("not a black box"), "{reason}");
    assert_eq!(fs::read(&path).unwrap().len(), 8);
    fs::write(&path, kept).unwrap();
}

/// Numbers of a step with its sum, for two outputs, inputs and horizons: calls, run, time, command, measured, held,
/// estimate, predictions, outcome, innovations, health, guard, events.
const ROW: usize = 3 + 2 + 2 + 1 + 2 + 2 + 4 + 3 + 5 + 2 + 6 + (1 + 7 * 5) + 1;

#[test]
fn invalid_recordings_are_refused_with_a_reason() {
    let (_folder, path) = place();
    let mut stream = stream(&path, &adapt::Options::default(), "test").unwrap();
    serve(&mut stream, &lines(200));
    stream.finish().unwrap();
    let why = |black_box: &BlackBox, fingerprint: &str| {
        replay(&model(), fingerprint, black_box, |_| {}).unwrap_err().to_string()
    };
    let mut black_box = BlackBox::read(&path).unwrap();
    assert!(
        why(&black_box, "other")
            .contains("another model; give the unchanged model file with which it was written, boat.sa")
    );
    black_box.head.hydroid = "0.0.1".to_owned();
    assert!(why(&black_box, "boat").contains("hydroid 0.0.1 wrote the file"));
    let bytes = fs::read(&path).unwrap();
    // In the middle of the file, where a kill cannot cause damage.
    let mut damaged = bytes.clone();
    let at = bytes.len() - 8 * ROW * 100;
    damaged[at] ^= 1;
    let black_box = BlackBox::decode(&damaged).unwrap();
    assert!(black_box.is_damaged() && black_box.summary().damaged);
    assert!(black_box.summary().samples > 50);
    assert!(why(&black_box, "boat").contains("damaged; copy the file again"));
    let mut other = bytes.clone();
    other[8] = 9;
    assert!(BlackBox::decode(&other).unwrap_err().contains("format 9"));
    other = bytes;
    other[40] ^= 1;
    assert!(BlackBox::decode(&other).unwrap_err().contains("copy the file again"));
    assert!(BlackBox::decode(b"t,u,v").unwrap_err().contains("not a black box"));
}

/// XXH3 of the words, as in the format.
fn sum_of(words: impl Iterator<Item = u64>) -> u64 {
    let mut hash = hydroid::fingerprint::Fingerprint::new();
    words.for_each(|word| hash.word(word));
    hash.value()
}

#[test]
fn a_replay_reports_the_first_different_bit() {
    let (_folder, path) = place();
    let mut stream = stream(&path, &adapt::Options::default(), "test").unwrap();
    serve(&mut stream, &lines(200));
    stream.finish().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let row = ROW;
    let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let head: Value = serde_json::from_slice(&bytes[24..24 + json]).unwrap();
    let memory = usize::try_from(head["memory"].as_u64().unwrap()).unwrap();
    let step = 120;
    let at = 24 + json + 8 * (6 + memory + row * step);
    let word = |bytes: &[u8], i: usize| u64::from_le_bytes(bytes[at + 8 * i..][..8].try_into().unwrap());
    let sum = |bytes: &[u8]| sum_of([1, step as u64].into_iter().chain((0..row - 1).map(|i| word(bytes, i))));
    assert_eq!(sum(&bytes), word(&bytes, row - 1), "the format is as it is written down");
    bytes[at + 8 * 11] ^= 1;
    let anew = sum(&bytes).to_le_bytes();
    bytes[at + 8 * (row - 1)..][..8].copy_from_slice(&anew);
    let black_box = BlackBox::decode(&bytes).unwrap();
    let replayed = replay(&model(), "boat", &black_box, |_| {}).unwrap();
    let first = replayed.first.unwrap();
    assert_eq!((replayed.different, first.what.as_str()), (1, "the estimate of r"));
    assert!(first.recorded != first.replayed && (first.recorded - first.replayed).abs() < 1e-12);
}

#[test]
fn every_event_comes_back() {
    let mut known = 0;
    for code in 0..32 {
        if let Some(action) = event::decode(&[f64::from(code), 1.0, 2.0, 0.25, -3.5]) {
            assert_eq!(event::decode(&event::encode(&action)), Some(action));
            known += 1;
        }
    }
    assert_eq!(known, 7);
    assert_eq!(event::decode(&[4.0, 9.0, 0.0, 0.0, 0.0]), None, "there is no such expert");
    assert_eq!(event::decode(&[7.0]), None);
}

#[test]
fn the_settings_come_back_from_the_file() {
    let infinite = f64::INFINITY;
    for (name, options) in learners() {
        let mut options = options;
        options.least_squares.forgetting_s = infinite;
        options.least_squares.gate = adapt::InnovationGate::OPEN;
        options.kalman.weight_noise_per_s = 0.1 + 0.2;
        options.kalman.covariance = "blocks:7".parse().unwrap();
        let text = toml::to_string(&options).unwrap();
        assert_eq!(toml::from_str::<adapt::Options>(&text).unwrap(), options, "{name}");
    }
}

/// Interrupted writes: of steps, and of a segment that replaces the oldest.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn incomplete_segments_are_skipped() {
    let (_folder, path) = place();
    let options = adapt::Options::default().guarded(&model());
    let mut stream = stream(&path, &options, "test").unwrap();
    let lines = lines(3700);
    let mut seen: Vec<Vec<u8>> = Vec::new();
    let mut turned = 0;
    for (k, line) in lines.iter().enumerate() {
        serve(&mut stream, std::slice::from_ref(line));
        if k > 2700 {
            let now = fs::read(&path).unwrap();
            let changed = seen.last().is_none_or(|before| *before != now);
            if changed {
                seen.push(now);
            }
            if seen.len() > 2 {
                seen.remove(0);
            }
            let [before, after] = &seen[..] else { continue };
            assert_eq!(before.len(), after.len(), "the ring is full");
            let differ: Vec<usize> = (0..after.len()).filter(|&i| before.get(i) != after.get(i)).collect();
            let (Some(&first), Some(&last)) = (differ.first(), differ.last()) else { continue };
            // Replacing the oldest segment changes more than a second of steps.
            let turns = last - first > 8 * ROW * 12;
            if !changed || (!turns && k % 50 > 9) {
                continue;
            }
            turned += usize::from(turns);
            for part in 1..6 {
                let cut = first + (last - first) * part / 6;
                for [a, b] in [[before, after], [after, before]] {
                    let mut torn = after.clone();
                    torn[..cut].copy_from_slice(&b[..cut]);
                    torn[cut..].copy_from_slice(&a[cut..]);
                    let black_box = BlackBox::decode(&torn).unwrap();
                    assert!(!black_box.is_damaged());
                    let replayed = replay(&model(), "boat", &black_box, |_| {}).unwrap();
                    assert_eq!(replayed.first, None);
                    assert!(replayed.samples > 1190, "{}", replayed.samples);
                }
            }
        }
    }
    assert!(turned > 0, "a segment was overwritten on the way");
}

fn recorded() -> &'static (Vec<u8>, BlackBox) {
    static FILE: std::sync::OnceLock<(Vec<u8>, BlackBox)> = std::sync::OnceLock::new();
    FILE.get_or_init(|| {
        let (_folder, path) = place();
        let options = adapt::Options::default().guarded(&model());
        let mut stream = stream(&path, &options, "test").unwrap();
        serve(&mut stream, &lines(150));
        stream.finish().unwrap();
        let bytes = fs::read(&path).unwrap();
        let whole = BlackBox::decode(&bytes).unwrap();
        (bytes, whole)
    })
}

fn rows(black_box: &BlackBox) -> Vec<String> {
    black_box.steps().map(|step| step.json().to_string()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_truncated_file_is_read_up_to_its_end(cut in 0.0..1.0f64) {
        let (bytes, whole) = recorded();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cut = (cut * bytes.len() as f64) as usize;
        if let Ok(read) = BlackBox::decode(&bytes[..cut]) {
            let (read_rows, rows) = (rows(&read), rows(whole));
            prop_assert!(!read.is_damaged());
            prop_assert_eq!(&read_rows[..], &rows[..read_rows.len()]);
            if !read_rows.is_empty() {
                let replayed = replay(&model(), "boat", &read, |_| {}).unwrap();
                prop_assert!(replayed.first.is_none());
            }
        }
    }

    #[test]
    fn a_changed_byte_is_detected(at in 0.0..1.0f64, flip in 1..=255u8) {
        let (bytes, whole) = recorded();
        let mut bytes = bytes.clone();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let at = (at * bytes.len() as f64) as usize;
        bytes[at] ^= flip;
        if let Ok(read) = BlackBox::decode(&bytes) {
            let (read_rows, rows) = (rows(&read), rows(whole));
            prop_assert!(read_rows.len() <= rows.len());
            prop_assert_eq!(&read_rows[..], &rows[..read_rows.len()]);
            let _ = read.summary();
        }
    }

    #[test]
    fn bytes_never_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..200), magic in any::<bool>()) {
        if magic {
            bytes.splice(0..0, b"HYDROBOX\x01\0\0\0".iter().copied());
        }
        prop_assert!(BlackBox::decode(&bytes).is_err());
    }
}

/// Hostile story 3: a service that was killed again and again had overwritten what led to the first kill.
#[test]
fn a_crash_loop_keeps_what_led_to_the_first_kill() {
    let folder = TempDir::new().unwrap();
    for first in [1_000, 3_000] {
        let path = folder.path().join(format!("{first}.box"));
        let options = adapt::Options::default();
        let all: Vec<String> = lines(first);
        let sail = |from: usize, to: usize| {
            let mut own = stream(&path, &options, "test").unwrap();
            let lines: Vec<String> = [&all[..1], &all[from.min(all.len() - 9)..to.min(all.len())]].concat();
            serve(&mut own, &lines);
            // Killed: the rest of the last second is lost.
        };
        sail(1, first);
        let end = |path: &Path| BlackBox::read(path).unwrap().steps().map(Step::t).fold(0.0, f64::max);
        let killed_at = end(&path);
        for restart in 0..15 {
            // Nine lines are less than a second: only a longer session leaves any.
            sail(1, if restart % 3 == 0 { 10 } else { 60 });
        }
        let found = BlackBox::read(&path).unwrap();
        let before: Vec<f64> = found.steps().map(Step::t).filter(|t| *t <= killed_at && *t > 10.0).collect();
        let least = if first == 1_000 { 800 } else { 1_100 };
        assert!(before.len() > least, "{} steps of {first}", before.len());
        assert!((end(&path) - killed_at).abs() < 1e-9);
        let (replayed, _) = played(&path);
        assert_eq!((replayed.first.is_none(), replayed.samples > least), (true, true), "{replayed:?}");
    }
}
