//! Figure 5: Error(k) of direct predictors and of C0, below, across and above the change of mode.

use serde::{Deserialize, Serialize};

use super::super::StudyError;
use super::super::error_k::{self, Block, Record};
use super::super::outcome::{Cell, Outcome, Sheet};
use super::super::palette;
use super::super::runner::Runner;
use super::{OUTPUTS, median};

/// Error(k) along a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blocks {
    /// Predictors; the first seed of the first one is drawn.
    pub models: Vec<String>,
    /// The record, of a hydrofoil.
    pub record: String,
}

impl Blocks {
    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let loaded = runner.record(&self.record)?;
        let record = Record::of(&loaded.simulated)?;
        let mut outcome = Outcome::default();
        let mut table =
            Sheet::new("error_k_means", &["model", "where", "blocks", "u [m/s]", "v [m/s]", "r [rad/s]"]);
        let mut sheet = Sheet::new(
            "error_k",
            &["model", "seed", "k", "mean u [m/s]", "output", "Error(k)", "Error(k) of C0"],
        );
        let mut plants = None;
        for name in &self.models {
            let models = runner.models(name)?;
            let all: Vec<Vec<Block>> = runner.each(&format!("Error(k) of {name}"), &models, |learned| {
                runner.fits(learned, &loaded)?;
                let key = runner.store.key("error_k", &(), &[learned.key, loaded.key]);
                runner
                    .store
                    .get("error_k", key, || Ok(error_k::blocks(&record, learned.model.session().as_mut())))
            })?;
            for (learned, blocks) in models.iter().zip(&all) {
                for block in blocks {
                    for (c, (output, _)) in OUTPUTS.iter().enumerate() {
                        sheet.row(vec![
                            name.clone().into(),
                            Cell::Number(learned.seed as f64),
                            block.k.into(),
                            block.mean_u.into(),
                            (*output).into(),
                            block.model[c].into(),
                            block.c0[c].into(),
                        ]);
                    }
                }
            }
            for (place, word) in error_k::PLACES.iter().enumerate() {
                let chosen: Vec<Vec<&Block>> = all
                    .iter()
                    .map(|blocks| blocks.iter().filter(|b| error_k::is(b, place)).collect())
                    .collect();
                let count = chosen.first().map_or(0, Vec::len);
                let of = |c: usize, of: fn(&Block) -> [f64; 3]| {
                    median(chosen.iter().map(|blocks| mean(blocks.iter().map(|b| of(b)[c]))).collect())
                };
                let mut row = vec![palette::title(name).into(), (*word).into(), count.into()];
                row.extend((0..3).map(|c| Cell::Number(of(c, |b| b.model))));
                table.row(row);
            }
            if name == &self.models[0] {
                outcome.basis(models.len(), &[&self.record]);
                measures(&all, &mut outcome);
            }
            if let (None, Some(blocks)) = (&plants, all.first()) {
                plants = Some(blocks.clone());
                let title = palette::title(name);
                outcome.chart(
                    "error_k",
                    error_k::figure(blocks, &title, palette::line(name), record.run.dt),
                    format!(
                        "Error(k) along {}: mean absolute error of 10 windows of 20 steps from sample k on, for the {title} and for C0. C0 is a perfect model of low speed and starts from the true state. Below the change of mode C0 is better; above it C0 is not valid.",
                        self.record
                    ),
                );
            }
        }
        for (place, word) in error_k::PLACES.iter().enumerate() {
            let Some(blocks) = &plants else { break };
            let chosen: Vec<&Block> = blocks.iter().filter(|block| error_k::is(block, place)).collect();
            let mut row = vec!["C0".into(), (*word).into(), chosen.len().into()];
            row.extend((0..3).map(|c| Cell::Number(mean(chosen.iter().map(|b| b.c0[c])))));
            table.row(row);
        }
        let floor = runner.store.get("floor", runner.store.key("floor", &(), &[loaded.key]), || {
            Ok(error_k::noise_floor(&record).to_vec())
        })?;
        let mut row =
            vec!["noise floor: the true plant from measured velocities".into(), "all".into(), Cell::Nothing];
        row.extend(floor.iter().map(|&x| Cell::Number(x)));
        table.row(row);
        outcome.sheets.push(sheet);
        outcome.table(table, "Mean of Error(k) over the blocks, median over seeds.");
        Ok(outcome)
    }
}

/// Mean errors above the change of mode divided by those below it, of C0 and of the network, and those of C0 above
/// divided by those of the network; medians over seeds.
fn measures(all: &[Vec<Block>], outcome: &mut Outcome) {
    let mean_of = |blocks: &[Block], place: usize, of: &dyn Fn(&Block) -> f64| {
        mean(blocks.iter().filter(|block| error_k::is(block, place)).map(of))
    };
    let middle = |value: &dyn Fn(&Vec<Block>) -> f64| median(all.iter().map(value).collect());
    for (c, (output, _)) in OUTPUTS.iter().enumerate() {
        let (model, c0) = (|block: &Block| block.model[c], |block: &Block| block.c0[c]);
        let above_over_below =
            |of: &dyn Fn(&Block) -> f64| middle(&|blocks| mean_of(blocks, 2, of) / mean_of(blocks, 1, of));
        outcome.measure(&format!("model_{output}_above_over_below"), above_over_below(&model));
        outcome.measure(&format!("c0_{output}_above_over_below"), above_over_below(&c0));
        outcome.measure(&format!("{output}_above"), middle(&|blocks| mean_of(blocks, 2, &model)));
        outcome.measure(&format!("{output}_below"), middle(&|blocks| mean_of(blocks, 1, &model)));
        outcome.measure(
            &format!("c0_over_model_{output}"),
            middle(&|blocks| mean_of(blocks, 2, &c0) / mean_of(blocks, 2, &model)),
        );
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}
