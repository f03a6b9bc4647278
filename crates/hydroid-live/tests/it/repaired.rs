//! Files with right checksums and wrong numbers: states and black boxes of the current formats, altered by the test.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use hydroid::adapt::{self, adapter};
use hydroid::fingerprint::Fingerprint;
use hydroid_live::black_box::{BlackBox, Recorder, Source, replay};
use hydroid_live::stream::{Line, Options, Stream};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde_json::Value;

use crate::boat::{filter, lines, model, settings};

fn learners() -> Vec<(&'static str, adapt::Options)> {
    let squares = adapt::Options::default();
    let filter = filter();
    vec![
        ("least squares", squares.clone()),
        ("filter", filter.clone()),
        ("least squares, guarded", squares.guarded(&model())),
        ("filter, guarded", filter.guarded(&model())),
    ]
}

fn stream(options: &adapt::Options) -> Stream {
    let model = model();
    let (adapter, _) = adapter(&model, options, &[]).unwrap();
    let reading = model.description.reading.clone();
    let options = Options { name: "test".to_owned(), reading, horizons: vec![1, 10], timing: false };
    Stream::new(&model, adapter, options).unwrap()
}

/// A state file after 300 lines.
fn state(options: &adapt::Options, path: &Path) -> Vec<u8> {
    let mut stream = stream(options);
    stream.persist_in(path, "m".to_owned(), &1).unwrap();
    for line in lines(300) {
        stream.serve(Line::Whole(line.as_bytes()), &mut Vec::new()).unwrap();
    }
    stream.finish().unwrap();
    fs::read(path).unwrap()
}

/// The state with altered numbers and the right checksum.
fn altered(bytes: &[u8], alter: impl FnOnce(&mut HashMap<&str, Vec<f64>>)) -> Vec<u8> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).unwrap();
    let json = &metadata.metadata().as_ref().unwrap()["hydroid_stream"];
    let mut head: Value = serde_json::from_str(json).unwrap();
    let tensors = SafeTensors::deserialize(bytes).unwrap();
    let mut parts = HashMap::new();
    for name in ["clock", "commands", "memory"] {
        let data = tensors.tensor(name).unwrap();
        let (numbers, _) = data.data().as_chunks::<8>();
        parts.insert(name, numbers.iter().map(|x| f64::from_le_bytes(*x)).collect::<Vec<f64>>());
    }
    alter(&mut parts);
    let mut hash = Fingerprint::new();
    hash.bytes(head["first"].as_str().unwrap().as_bytes());
    hash.word(head["rows"].as_u64().unwrap());
    for name in ["clock", "commands", "memory"] {
        hash.word(parts[name].len() as u64);
        hash.numbers(&parts[name]);
    }
    head["sum"] = hash.hex().into();
    let raw: Vec<(&str, Vec<u8>)> =
        parts.iter().map(|(name, x)| (*name, x.iter().flat_map(|x| x.to_le_bytes()).collect())).collect();
    let views = raw
        .iter()
        .map(|(name, bytes)| (*name, TensorView::new(Dtype::F64, vec![bytes.len() / 8], bytes).unwrap()));
    let metadata = HashMap::from([("hydroid_stream".to_owned(), head.to_string())]);
    safetensors::serialize(views, Some(metadata)).unwrap()
}

/// Resumes from a file. `None` if it is refused; else the answers to 200 further lines.
fn resumed(options: &adapt::Options, path: &Path) -> Option<Vec<Value>> {
    let mut stream = stream(options);
    if let Err(error) = stream.persist_in(path, "m".to_owned(), &1) {
        assert!(error.to_string().contains("remove it to start again"), "{error}");
        return None;
    }
    let all = lines(520);
    let rest = all[..1].iter().chain(&all[310..]);
    let mut answers = Vec::new();
    for line in rest {
        let mut out = Vec::new();
        stream.serve(Line::Whole(line.as_bytes()), &mut out).unwrap();
        if !out.is_empty() {
            answers.push(serde_json::from_slice(&out).unwrap());
        }
    }
    Some(answers)
}

/// Hostile story 5: a variance below zero in a file made the service panic.
#[test]
fn a_state_of_numbers_that_no_service_has_is_refused_or_recovered_from() {
    let folder = tempfile::tempdir().unwrap();
    for (name, options) in learners() {
        let path = folder.path().join("boat.state");
        let _ = fs::remove_file(&path);
        let bytes = state(&options, &path);
        fs::write(&path, altered(&bytes, |_| {})).unwrap();
        assert!(resumed(&options, &path).is_some(), "{name}: the test builds a valid file");
        let mut len = 0;
        altered(&bytes, |parts| len = parts["memory"].len());
        let mut refused = 0;
        // Numbers all over the memory, with one of the values in turn.
        let values = [-1.0, f64::NAN, f64::INFINITY, 1e300, -1e300, 0.0];
        for at in (0..len).step_by(len.div_ceil(100)) {
            let value = values[at % values.len()];
            fs::write(&path, altered(&bytes, |parts| parts.get_mut("memory").unwrap()[at] = value)).unwrap();
            let Some(answers) = resumed(&options, &path) else {
                refused += 1;
                continue;
            };
            for answer in answers.iter().skip(12).filter(|answer| answer.get("prediction").is_some()) {
                let finite =
                    |name: &str| answer["prediction"][name].as_array().unwrap().iter().all(Value::is_f64);
                let said = answer["note"].as_str().is_some_and(|note| note.contains("no finite prediction"));
                assert!(finite("u") && finite("r") || said, "{name}: number {at} = {value}: {answer}");
            }
        }
        assert!(refused > 0, "{name}: some of them are refused");
    }
}

#[test]
fn a_state_with_an_impossible_clock_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("boat.state");
    let (_, options) = learners().remove(0);
    let bytes = state(&options, &path);
    for (at, value) in
        [(0, f64::NAN), (1, f64::INFINITY), (2, -1e9), (3, 0.0), (3, f64::NAN), (4, -1.0), (0, 1e6)]
    {
        fs::write(&path, altered(&bytes, |parts| parts.get_mut("clock").unwrap()[at] = value)).unwrap();
        assert!(resumed(&options, &path).is_none(), "{at} = {value}");
    }
}

struct Parts {
    /// Offset of the first segment, length of the memory and of a row.
    start: usize,
    memory: usize,
    row: usize,
}

fn word(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn numbers(bytes: &[u8], at: usize, count: usize) -> Vec<f64> {
    (0..count).map(|i| f64::from_bits(word(bytes, at + 8 * i))).collect()
}

fn step_sum(sequence: u64, place: u64, row: &[f64]) -> u64 {
    let mut hash = Fingerprint::new();
    hash.word(sequence);
    hash.word(place);
    hash.numbers(row);
    hash.value()
}

impl Parts {
    fn of(bytes: &[u8]) -> Self {
        let len = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let head: Value = serde_json::from_slice(&bytes[24..24 + len]).unwrap();
        let memory = usize::try_from(head["memory"].as_u64().unwrap()).unwrap();
        let start = 24 + len;
        let rows = start + 8 * (6 + memory);
        let is_row = |row: &usize| word(bytes, rows + 8 * row) == step_sum(1, 0, &numbers(bytes, rows, *row));
        let row = (1..500).find(is_row).unwrap();
        Self { start, memory, row }
    }

    /// Sets a number of the first state, with the sums of the segment.
    fn set_memory(&self, bytes: &mut [u8], at: usize, value: f64) {
        let memory = self.start + 48;
        bytes[memory + 8 * at..][..8].copy_from_slice(&value.to_le_bytes());
        let mut hash = Fingerprint::new();
        hash.numbers(&numbers(bytes, memory, self.memory));
        bytes[self.start + 32..][..8].copy_from_slice(&hash.value().to_le_bytes());
        let mut hash = Fingerprint::new();
        (0..5).for_each(|i| hash.word(word(bytes, self.start + 8 * i)));
        bytes[self.start + 40..][..8].copy_from_slice(&hash.value().to_le_bytes());
    }

    fn row_at(&self, step: usize) -> usize {
        self.start + 8 * (6 + self.memory + step * (self.row + 1))
    }
}

fn recorded(options: &adapt::Options, path: &Path) -> Vec<u8> {
    let model = model();
    let (mut adapter, used) = adapter(&model, options, &[]).unwrap();
    let described = serde_json::json!({ "learning": used });
    let source = Source::Stream("test");
    let recorder =
        Recorder::new(&settings(path), &model, adapter.as_mut(), options, &described, source).unwrap();
    let mut stream = stream(options);
    stream.record(recorder);
    for line in lines(200) {
        stream.serve(Line::Whole(line.as_bytes()), &mut Vec::new()).unwrap();
    }
    stream.finish().unwrap();
    fs::read(path).unwrap()
}

/// Hostile stories 5 and 9, with right checksums: altered states and steps of a black box.
#[test]
fn an_altered_black_box_is_refused_or_differs() {
    let folder = tempfile::tempdir().unwrap();
    for (name, options) in learners() {
        let path = folder.path().join("boat.box");
        let _ = fs::remove_file(&path);
        let bytes = recorded(&options, &path);
        let parts = Parts::of(&bytes);
        let played = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            replay(&model(), "boat", &BlackBox::read(&path).unwrap(), |_| {})
        };
        assert_eq!(played(&bytes).unwrap().first, None, "{name}");
        let mut refused = 0;
        for at in (0..parts.memory).step_by(parts.memory.div_ceil(50)) {
            let value = [-1.0, f64::NAN, f64::INFINITY, 1e300][at % 4];
            let mut bytes = bytes.clone();
            parts.set_memory(&mut bytes, at, value);
            refused += usize::from(played(&bytes).is_err());
        }
        assert!(refused > 0, "{name}");
        // A measurement of the first steps, whose sum is right.
        for step in [0, 20] {
            let mut bytes = bytes.clone();
            let at = parts.row_at(step);
            for i in 0..parts.row {
                let x = f64::from_bits(word(&bytes, at + 8 * i));
                let changed = if x.is_finite() { x + 0.5 } else { x };
                bytes[at + 8 * i..][..8].copy_from_slice(&changed.to_le_bytes());
            }
            let sum = step_sum(1, step as u64, &numbers(&bytes, at, parts.row));
            bytes[at + 8 * parts.row..][..8].copy_from_slice(&sum.to_le_bytes());
            let replayed = played(&bytes).unwrap();
            assert!(replayed.first.is_some(), "{name}: step {step}");
        }
        // Without its sum, the first step ends its segment: nothing can be compared.
        let mut bytes = bytes.clone();
        bytes[parts.row_at(0)] ^= 1;
        match played(&bytes) {
            Ok(replayed) => assert_eq!(replayed.samples, 0, "{name}"),
            Err(error) => assert!(error.to_string().contains("damaged"), "{name}: {error}"),
        }
    }
}
