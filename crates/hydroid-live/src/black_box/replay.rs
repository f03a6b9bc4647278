//! The same again: the adapter is made anew, gets the calls that were noted, and has to say the same.

use hydroid_core::adapt::Adapter;
use serde::Serialize;

use super::record::{ADVANCE, FORESEEN, Gatherer, OBSERVE, Part, RESET, calls};
use super::{BlackBox, BlackBoxError, Step};
use hydroid::model::Model;

/// Where a replay first was not what was recorded.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Time of the sample \[s\].
    pub t: f64,
    /// What differs, in words.
    pub what: String,
    /// The number in the box.
    pub recorded: f64,
    /// The number that was made.
    pub replayed: f64,
}

/// What came of a replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Replayed {
    /// Samples observed.
    pub samples: usize,
    /// Samples of which something differs.
    pub different: usize,
    /// The first of them.
    pub first: Option<Difference>,
}

/// Replays a box on the model that it is of, whose file has the given fingerprint; `each` is shown every step as it was made.
///
/// # Errors
/// If the box is of another model or another version, is damaged, or holds nothing.
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
            "it is of another model; give the one that it was written with, {} as it was then",
            head.model.file
        )));
    }
    let this = env!("CARGO_PKG_VERSION");
    if head.hydroid != this {
        return Err(wrong(format!(
            "hydroid {} wrote it, and this is {this}, which may learn otherwise: replay it with that one",
            head.hydroid
        )));
    }
    if black_box.is_damaged() {
        return Err(wrong(
            "steps in the middle of it are damaged; copy it anew from where it was written (`hydroid inspect` shows what can be read)"
                .to_owned(),
        ));
    }
    if black_box.segments.is_empty() {
        return Err(wrong("nothing was written in it yet: it needs a sample at least".to_owned()));
    }
    let mut adapter = head.adapter(model).map_err(|reason| {
        wrong(format!("the adapter cannot be made again ({reason}); copy it anew from where it was written"))
    })?;
    let mut player = Player {
        black_box,
        gatherer: Gatherer::new(head),
        row: vec![f64::NAN; head.places().len()],
        replayed: Replayed::default(),
        t: f64::NAN,
    };
    let mut end = None;
    let mut memory = vec![0.0; head.memory];
    for segment in &black_box.segments {
        if segment.goes_on && end == Some((segment.sequence, segment.before)) {
            adapter.save(&mut memory);
            player.compare_memory(&segment.memory, &memory);
        }
        adapter.load(&segment.memory);
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
    gatherer: Gatherer,
    row: Vec<f64>,
    replayed: Replayed,
    /// Of the last sample.
    t: f64,
}

impl Player<'_> {
    fn play(&mut self, adapter: &mut dyn Adapter, recorded: &[f64]) {
        let places = self.gatherer.places;
        let results = places.results();
        self.row[..results].copy_from_slice(&recorded[..results]);
        self.row[results..].fill(f64::NAN);
        let calls = calls(recorded);
        if calls & RESET != 0 {
            adapter.reset();
        }
        if calls & ADVANCE != 0 {
            adapter.advance(&recorded[places.range(Part::Command)]);
        }
        if calls & OBSERVE != 0 {
            adapter.observe(&recorded[places.range(Part::Measured)]);
            self.gatherer.observed(adapter, &mut self.row);
            self.replayed.samples += 1;
            self.t = recorded[places.range(Part::Time)][0];
        }
        if calls & FORESEEN != 0 {
            self.gatherer.foreseen(adapter, &recorded[places.range(Part::Held)], &mut self.row);
        }
        let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits() && !(a.is_nan() && b.is_nan());
        let mut pairs = recorded[results..].iter().zip(&self.row[results..]);
        if let Some(place) = pairs.position(differs) {
            let what = places.name(results + place, &self.black_box.head);
            self.note(what, recorded[results + place], self.row[results + place]);
        }
    }

    fn compare_memory(&mut self, recorded: &[f64], made: &[f64]) {
        let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits() && !(a.is_nan() && b.is_nan());
        if let Some(place) = recorded.iter().zip(made).position(differs) {
            self.note(format!("number {place} of the memory after it"), recorded[place], made[place]);
        }
    }

    fn note(&mut self, what: String, recorded: f64, replayed: f64) {
        self.replayed.different += 1;
        let difference = Difference { t: self.t, what, recorded, replayed };
        self.replayed.first.get_or_insert(difference);
    }
}
