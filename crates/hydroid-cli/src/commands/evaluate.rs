//! `hydroid evaluate`.

use anyhow::Context;
use hydroid::evaluate::{self, BandCoverage, Evaluation, Options, PredictionCoverage};
use hydroid::identify::{Grade, verdicts};
use hydroid::log::Trajectory;
use hydroid::model::{self, Model};
use serde::Serialize;

use super::{Outcome, table};
use crate::args::{Against, Evaluate, EvaluationArgs, Global, Origin};
use crate::{logs, ui};

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    evaluation: &'a Evaluation,
    /// For models with an ensemble.
    #[serde(skip_serializing_if = "Option::is_none")]
    band_coverage: Option<&'a BandCoverage>,
    /// For models with prediction bands.
    #[serde(skip_serializing_if = "Option::is_none")]
    prediction_bands: Option<&'a PredictionCoverage>,
}

pub fn run(args: &Evaluate, global: Global) -> anyhow::Result<Outcome> {
    let model = model::read(&args.model)?;
    let mut reading = args.log.clone().over(model.description.reading.clone(), &model.description.boat)?;
    let (_, prepared) = logs::prepare(&args.logs, &mut reading, global)
        .with_context(|| logs::cannot_use(&args.model, &model))?;
    ui::print_notes(&prepared.notes, global);
    let model = logs::with_step_of(model, &prepared.runs)?;
    model.check(&prepared.runs)?;
    let model = logs::with_current(model, args.estimate_current, &prepared.runs)?;
    ui::print_notes(model.outside(&prepared.runs).as_slice(), global);
    let mut options = options(args.evaluation, model.description.dt);
    let bands = model.description.bands.as_ref();
    if bands.is_some() {
        options.errors_at = quarters(options.horizon);
    }
    let runs: Vec<_> = prepared.runs.iter().collect();
    let evaluation = judge(&model, &runs, &options, global)?;
    let horizons = table::horizons(&evaluation);
    let band = evaluate::band_coverage(&model.member_sessions(), &runs, &options, &horizons);
    let coverage = bands.map(|bands| bands.coverage(&evaluation));
    let verdicts = verdicts(&evaluation, &runs);
    if global.json {
        super::print_json(&Document {
            evaluation: &evaluation,
            band_coverage: band.as_ref(),
            prediction_bands: coverage.as_ref(),
        })?;
    } else {
        ui::write_out(format_args!("{}", table::errors(&evaluation)));
        if let Some(coverage) = &coverage {
            ui::write_out(format_args!("\n{}", table::coverage(coverage, &evaluation)));
        }
        if let Some(band) = &band {
            ui::write_out(format_args!("\n{}", table::band(band, &evaluation)));
        }
        outln!("");
        table::show_verdicts(&verdicts);
    }
    let sound = verdicts.iter().all(|v| matches!(v.grade, Grade::Good | Grade::Usable));
    Ok(if sound && evaluation.diverged == 0 { Outcome::Done } else { Outcome::Missed })
}

/// The errors of a model on runs.
pub fn judge(
    model: &Model,
    runs: &[&Trajectory],
    options: &Options,
    global: Global,
) -> anyhow::Result<Evaluation> {
    let bar = ui::Bar::new("evaluating", global);
    evaluate::evaluate(
        &model.description.name,
        model.session().as_mut(),
        &model.output_ranges(),
        runs,
        options,
        &mut bar.callback(),
    )
    .context("the logs cannot be evaluated")
}

/// The quarters of a horizon \[samples\].
fn quarters(horizon: usize) -> Vec<usize> {
    let mut quarters: Vec<usize> = (1..=4).map(|i| (horizon * i / 4).max(1)).collect();
    quarters.dedup();
    quarters
}

pub fn options(evaluation: EvaluationArgs, dt: f64) -> Options {
    Options {
        horizon: evaluation.horizon.samples(dt),
        origin_stride: evaluation.origin_stride,
        origin: match evaluation.origin {
            Origin::Measured => evaluate::Origin::Measured,
            Origin::True => evaluate::Origin::True,
        },
        against: match evaluation.against {
            Against::Measurement => evaluate::Against::Measurement,
            Against::Truth => evaluate::Against::Truth,
        },
        ..Options::default()
    }
}
