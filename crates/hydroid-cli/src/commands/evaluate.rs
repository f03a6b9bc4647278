//! `hydroid evaluate`.

use anyhow::Context;
use hydroid::evaluate::{self, BandCoverage, Evaluation, Options};
use hydroid::identify::{Grade, verdicts};
use hydroid::model;
use serde::Serialize;

use super::{Outcome, table};
use crate::args::{Against, Evaluate, Global, Judging, Origin};
use crate::{logs, ui};

/// What `--json` prints.
#[derive(Serialize)]
struct Judged<'a> {
    #[serde(flatten)]
    evaluation: &'a Evaluation,
    /// Only where the model has an ensemble.
    #[serde(skip_serializing_if = "Option::is_none")]
    band_coverage: Option<&'a BandCoverage>,
}

pub fn run(args: &Evaluate, global: Global) -> anyhow::Result<Outcome> {
    let model = model::read(&args.model)?;
    let reading = logs::reading(model.description.reading.clone(), &args.log)?;
    let (_, prepared) =
        logs::prepare(&args.logs, &reading).with_context(|| logs::unusable(&args.model, &model))?;
    ui::tell(&prepared.notes, global);
    let model = logs::at_their_step(model, &prepared.runs)?;
    model.check(&prepared.runs)?;
    ui::tell(model.outside(&prepared.runs).as_slice(), global);
    let options = options(args.judging, model.description.dt);
    let runs: Vec<_> = prepared.runs.iter().collect();
    let bar = ui::Bar::new("evaluating", global);
    let evaluation = evaluate::evaluate(
        &model.description.name,
        model.session().as_mut(),
        &model.output_ranges(),
        &runs,
        &options,
        &mut bar.callback(),
    )
    .context("the logs cannot be evaluated")?;
    drop(bar);
    let horizons = table::horizons(&evaluation);
    let band = evaluate::band_coverage(&model.member_sessions(), &runs, &options, &horizons);
    let verdicts = verdicts(&evaluation);
    if global.json {
        super::print_json(&Judged { evaluation: &evaluation, band_coverage: band.as_ref() })?;
    } else {
        ui::write_out(format_args!("{}", table::errors(&evaluation)));
        if let Some(band) = &band {
            ui::write_out(format_args!("\n{}", table::band(band, &evaluation)));
        }
        outln!("");
        table::show_verdicts(&verdicts);
    }
    let sound = verdicts.iter().all(|v| v.grade != Grade::NotIdentified);
    Ok(if sound && evaluation.diverged == 0 { Outcome::Done } else { Outcome::Missed })
}

/// What the command line says about judging, for a model that steps `dt` seconds.
pub fn options(judging: Judging, dt: f64) -> Options {
    Options {
        horizon: judging.horizon.samples(dt),
        origin_stride: judging.origin_stride,
        origin: match judging.origin {
            Origin::Measured => evaluate::Origin::Measured,
            Origin::True => evaluate::Origin::True,
        },
        against: match judging.against {
            Against::Measurement => evaluate::Against::Measurement,
            Against::Truth => evaluate::Against::Truth,
        },
        ..Options::default()
    }
}
