//! `hydroid report`.

use std::path::Path;

use anyhow::{Context as _, bail};
use hydroid::atomic;
use hydroid::boat::StatedRoles;
use hydroid::config;
use hydroid::evaluate::Evaluation;
use hydroid::identify::{Verdict, verdicts};
use hydroid::manoeuvre::{self, Comparison};
use hydroid::model::{self, Model};
use hydroid::plant::{InputMap, Motion};
use hydroid_report::{ModelReport, model_report};
use serde_json::json;

use super::{Outcome, evaluate};
use crate::args::{Global, Report};
use crate::{logs, outputs, ui};

pub fn run(args: &Report, global: Global) -> anyhow::Result<Outcome> {
    let mut model = model::read(&args.model)?.with_roles(&StatedRoles::given(&args.role))?;
    let inputs: Vec<&Path> = std::iter::once(&args.model).chain(&args.logs).map(|path| &**path).collect();
    outputs::check(&[("-o", Some(&args.output))], &inputs)?;
    let judged = if args.logs.is_empty() { None } else { Some(judge(args, &mut model, global)?) };
    let settings = config::Manoeuvre {
        push: args.push.clone(),
        turn: args.turn.clone(),
        length: args.length,
        ..config::Manoeuvre::default()
    };
    let bar = ui::Bar::new("trials", global);
    let plan = settings.plan(&model).map_err(anyhow::Error::from);
    let trials = plan.and_then(|plan| Ok(plan.run(&model, &mut bar.callback())?));
    drop(bar);
    let stated =
        args.role.is_some() || !args.push.is_empty() || !args.turn.is_empty() || args.length.is_some();
    let trials = match trials {
        Ok(Some(trials)) => Ok(trials),
        Ok(None) => bail!("cancelled"),
        // What was stated of the trials is an input; a model without trials has a page all the same.
        Err(error) if stated => return Err(error),
        Err(error) => Err(format!("{error:#}")),
    };
    let map = InputMap::with(&model, &args.push, &args.turn).map_err(|error| error.to_string());
    let (evaluation, verdicts, comparisons) = judged
        .map_or_else(Default::default, |(judged, verdicts, trials)| (Some(judged), verdicts, Some(trials)));
    let command = ui::command_line();
    let page = model_report(&ModelReport {
        command: &command,
        model: &model,
        evaluation: evaluation.as_ref(),
        verdicts: &verdicts,
        comparisons: comparisons.as_deref().unwrap_or_default(),
        trials: trials.as_ref().map_err(String::as_str),
        map: map.as_ref().map_err(String::as_str),
        interactive: args.interactive,
    })?;
    atomic::write(&args.output, |out| out.write_all(page.as_bytes()))?;
    if global.json {
        super::print_json(&json!({
            "model": args.model,
            "report": args.output,
            "evaluation": evaluation,
            "comparisons": comparisons,
            "trials": trials.ok(),
        }))?;
    } else {
        outln!("{}", args.output.display());
    }
    Ok(Outcome::Done)
}

/// The errors on the logs, the grades, and the trials of the logs.
fn judge(
    args: &Report,
    model: &mut Model,
    global: Global,
) -> anyhow::Result<(Evaluation, Vec<Verdict>, Vec<Comparison>)> {
    let mut reading = args.log.clone().over(model.description.reading.clone(), &model.description.boat)?;
    let (_, prepared) = logs::prepare(&args.logs, &mut reading, global)
        .with_context(|| logs::cannot_use(&args.model, model))?;
    ui::print_notes(&prepared.notes, global);
    *model = logs::with_step_of(model.clone(), &prepared.runs)?;
    model.check(&prepared.runs)?;
    ui::print_notes(model.outside(&prepared.runs).as_slice(), global);
    let options = evaluate::options(args.evaluation, model.description.dt);
    let runs: Vec<_> = prepared.runs.iter().collect();
    let evaluation = evaluate::judge(model, &runs, &options, global)?;
    let bar = ui::Bar::new("trials of the logs", global);
    // A model without the motion of a vessel has no trials.
    let comparisons = match Motion::of(model) {
        Ok(_) => manoeuvre::compare(model, &prepared.runs, &mut bar.callback())?,
        Err(_) => Vec::new(),
    };
    drop(bar);
    let verdicts = verdicts(&evaluation, &runs);
    Ok((evaluation, verdicts, comparisons))
}
