//! Replay: the adapter is rebuilt, gets the recorded calls, and its results are compared bit by bit.

use hydroid_core::adapt::Adapter;
use serde::Serialize;

use super::record::{ADVANCE, OBSERVE, PREDICTED, Part, RESET, RowBuilder, calls};
use super::{BlackBox, BlackBoxError, Step};
use hydroid::model::Model;

/// First difference between replay and recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Time of the sample \[s\].
    pub t: f64,
    /// Description of the value.
    pub what: String,
    /// Recorded value.
    pub recorded: f64,
    /// Value of the replay.
    pub replayed: f64,
}

/// Result of a replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Replayed {
    /// Samples observed.
    pub samples: usize,
    /// Samples with a difference.
    pub different: usize,
    pub first: Option<Difference>,
}

/// Replays a black box with its model, whose file has the given fingerprint; `each` gets every computed step.
///
/// # Errors
/// If the black box belongs to another model or version, is damaged, or is empty.
pub fn replay(
    model: &Model,
    fingerprint: &str,
    black_box: &BlackBox,
    mut each: impl FnMut(Step<'_>),
) -> Result<Replayed, BlackBoxError> {
    let head = &black_box.head;
    let wrong = |reason: String| BlackBoxError::unusable(&black_box.path, reason);
    if head.model.fingerprint != fingerprint {
        return Err(wrong(format!(
            "it belongs to another model; give the unchanged model file with which it was written, {}",
            head.model.file
        )));
    }
    let this = env!("CARGO_PKG_VERSION");
    if head.hydroid != this {
        return Err(wrong(format!(
            "hydroid {} wrote the file, and the results of this version ({this}) may differ: replay it with the version that wrote it",
            head.hydroid
        )));
    }
    if black_box.is_damaged() {
        return Err(wrong(
            "steps in the middle of the file are damaged; copy the file again from its origin (`hydroid inspect` shows the readable steps)"
                .to_owned(),
        ));
    }
    if black_box.segments.is_empty() {
        return Err(wrong("the file contains no samples yet".to_owned()));
    }
    let mut adapter = head.adapter(model).map_err(|reason| {
        wrong(format!("the adapter cannot be rebuilt ({reason}); copy the file again from its origin"))
    })?;
    let mut player = Player {
        black_box,
        builder: RowBuilder::new(head),
        row: vec![f64::NAN; head.layout().len()],
        replayed: Replayed::default(),
        t: f64::NAN,
    };
    let mut end = None;
    let mut memory = vec![0.0; head.memory];
    for segment in &black_box.segments {
        if segment.continues && end == Some((segment.sequence, segment.before)) {
            adapter.save(&mut memory);
            player.compare_memory(&segment.memory, &memory);
        }
        adapter.load(&segment.memory);
        if !adapter.is_sound() {
            return Err(wrong(
                "a recorded state has weights that are not finite or variances below zero: the file is damaged; copy it again from its origin"
                    .to_owned(),
            ));
        }
        let rows = segment.rows.chunks_exact(player.row.len());
        end = segment.before.checked_add(rows.len() as u64).map(|before| (segment.sequence + 1, before));
        for row in rows {
            player.play(adapter.as_mut(), row);
            each(Step::new(head, &player.row));
        }
    }
    Ok(player.replayed)
}

struct Player<'a> {
    black_box: &'a BlackBox,
    builder: RowBuilder,
    row: Vec<f64>,
    replayed: Replayed,
    t: f64,
}

impl Player<'_> {
    fn play(&mut self, adapter: &mut dyn Adapter, recorded: &[f64]) {
        let layout = self.builder.layout;
        let results = layout.results();
        self.row[..results].copy_from_slice(&recorded[..results]);
        self.row[results..].fill(f64::NAN);
        let calls = calls(recorded);
        if calls & RESET != 0 {
            adapter.reset();
        }
        if calls & ADVANCE != 0 {
            adapter.advance(&recorded[layout.range(Part::Command)]);
        }
        if calls & OBSERVE != 0 {
            adapter.observe_heading(recorded[layout.range(Part::Heading)][0]);
            adapter.observe(&recorded[layout.range(Part::Measured)]);
            self.builder.observed(adapter, &mut self.row);
            self.replayed.samples += 1;
            self.t = recorded[layout.range(Part::Time)][0];
        }
        if calls & PREDICTED != 0 {
            self.builder.predicted(adapter, &recorded[layout.range(Part::Held)], &mut self.row);
        }
        let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits() && !(a.is_nan() && b.is_nan());
        let mut pairs = recorded[results..].iter().zip(&self.row[results..]);
        if let Some(place) = pairs.position(differs) {
            let what = layout.name(results + place, &self.black_box.head);
            self.note(what, recorded[results + place], self.row[results + place]);
        }
    }

    fn compare_memory(&mut self, recorded: &[f64], made: &[f64]) {
        let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits() && !(a.is_nan() && b.is_nan());
        if let Some(place) = recorded.iter().zip(made).position(differs) {
            self.note(
                format!("value {place} of the state of the adapter after it"),
                recorded[place],
                made[place],
            );
        }
    }

    fn note(&mut self, what: String, recorded: f64, replayed: f64) {
        self.replayed.different += 1;
        let difference = Difference { t: self.t, what, recorded, replayed };
        self.replayed.first.get_or_insert(difference);
    }
}
