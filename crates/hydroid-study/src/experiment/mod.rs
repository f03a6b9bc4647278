//! Kinds of experiments.

mod adaptation;
mod along;
mod amount;
mod blocks;
mod circles;
mod cost;
mod forgetting;
mod horizons;
mod recipe;
mod schematic;
mod table;

use serde::{Deserialize, Serialize};

use super::StudyError;
use super::outcome::Outcome;
use super::runner::Runner;

/// Kind of an experiment, with its options.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    Schematic(schematic::Schematic),
    /// Circles under feedback linearization.
    Circles(circles::Circles),
    /// Error(k) of direct predictors and of C0.
    Blocks(blocks::Blocks),
    /// Errors of networks against the horizon, frozen and adapted.
    Horizons(horizons::Horizons),
    /// Errors along a record.
    Along(along::Along),
    /// Settings of sparse regression in the thesis.
    Recipe(recipe::Recipe),
    Forgetting(forgetting::Forgetting),
    /// Accuracy against the amount of data.
    Amount(amount::Amount),
    /// Accuracy against the computing time of a filter step.
    Cost(cost::Cost),
    /// All methods in one table.
    Table(table::Comparison),
}

impl Kind {
    pub(super) fn uses(&self) -> (Vec<&String>, Vec<&String>) {
        match self {
            Self::Schematic(_) => (Vec::new(), Vec::new()),
            Self::Circles(circles) => circles.uses(),
            Self::Blocks(blocks) => (vec![&blocks.record], blocks.models.iter().collect()),
            Self::Horizons(horizons) => (horizons.records.iter().collect(), horizons.models.iter().collect()),
            Self::Along(along) => (along.records.iter().collect(), vec![&along.model]),
            Self::Recipe(recipe) => (vec![&recipe.train, &recipe.test], vec![&recipe.ours]),
            Self::Forgetting(forgetting) => forgetting.uses(),
            Self::Amount(amount) => amount.uses(),
            Self::Cost(cost) => (vec![&cost.record], cost.models.iter().collect()),
            Self::Table(table) => table.uses(),
        }
    }

    pub(super) fn check(&self) -> Result<(), String> {
        let some = |what: &str, given: usize| {
            if given > 0 { Ok(()) } else { Err(format!("it has no {what}: give at least one")) }
        };
        match self {
            Self::Schematic(_) | Self::Recipe(_) | Self::Table(_) => Ok(()),
            Self::Circles(circles) => {
                some("circles", circles.circles.len())?;
                some("seeds", circles.seeds.len())
            }
            Self::Blocks(blocks) => some("models", blocks.models.len()),
            Self::Horizons(horizons) => {
                some("models", horizons.models.len())?;
                some("records", horizons.records.len())?;
                horizons.check()
            }
            Self::Along(along) => {
                some("records", along.records.len())?;
                some("steps", along.steps)
            }
            Self::Forgetting(forgetting) => {
                some("models", forgetting.models.len())?;
                some("records", forgetting.seas.len())?;
                some("epochs", forgetting.epochs)
            }
            Self::Amount(amount) => {
                some("series", amount.series.len())?;
                amount.series.iter().try_for_each(|series| some("models", series.models.len()))
            }
            Self::Cost(cost) => some("models", cost.models.len()),
        }
    }

    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        match self {
            Self::Schematic(schematic) => Ok(schematic.run()),
            Self::Circles(circles) => circles.run(runner),
            Self::Blocks(blocks) => blocks.run(runner),
            Self::Horizons(horizons) => horizons.run(runner),
            Self::Along(along) => along.run(runner),
            Self::Recipe(recipe) => recipe.run(runner),
            Self::Forgetting(forgetting) => forgetting.run(runner),
            Self::Amount(amount) => amount.run(runner),
            Self::Cost(cost) => cost.run(runner),
            Self::Table(table) => table.run(runner),
        }
    }
}

const OUTPUTS: [(&str, &str); 3] = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];

/// Median; NaN without values.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[n / 2] + values[(n - 1) / 2]) }
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)))
}
