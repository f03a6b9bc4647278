//! Derives the constant data of a training from job and options.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use hydroid_core::actuator::Map;
use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{BaseModel, Scaling};
use hydroid_core::model::sparse::Equations;

use super::base_rollout::BaseRollout;
use super::loss::Loss;
use super::mini_batch::Architecture;
use super::restarts::Plan;
use super::scaling::HALF_RANGE;
use super::validation::Validation;
use super::windows::{ScaledRun, Shape};
use super::{BaseKind, CellKind, Job, TrainError, TrainOptions, affine, random, scaling};
use crate::evaluate::DesignRange;
use crate::log::Trajectory;

/// Default samples of wash-out and of comparison, and their upper limit as a share of the longest run.
const WASH_OUT: (usize, usize) = (100, 8);
const WINDOW: (usize, usize) = (200, 4);

/// Default samples compared by a window of a control-affine network.
const ROLLED: (usize, usize) = (20, 4);

/// Least and largest number of validation origins; in between validation costs a fixed share of training.
const LEAST_ORIGINS: usize = 64;
const MOST_ORIGINS: usize = 512;

/// Least standard deviation of an output relative to its design range. Smaller values are rounding errors.
const STILL: f64 = 1e-6;

/// Training steps for each validation step.
const JUDGING: usize = 6;

pub(super) fn plan<T: Scalar>(job: &Job<'_>, options: &TrainOptions) -> Result<Plan<T>, TrainError> {
    let (outputs, inputs) = (job.outputs.len(), job.inputs.len());
    options.check(outputs)?;
    check(job)?;
    let mut scaling = scaling::from_ranges(job.outputs, job.inputs)?;
    let (net, wash_out, length) = net(job, options)?;
    let scaled = |runs: &[&Trajectory]| -> Result<Vec<ScaledRun<T>>, TrainError> {
        runs.iter().map(|run| scaled_run(run, &net, &scaling)).collect()
    };
    let (runs, validation) = (scaled(job.runs)?, scaled(job.validation)?);
    let correction = match &net {
        // The output of a control-affine network is a rate of order range per second.
        Architecture::Direct { base: BaseModel::Nothing, .. } | Architecture::Affine(_) => None,
        // Typical change over half of the horizon.
        Architecture::Direct { base: BaseModel::Hold, horizon, .. } => {
            let share = 0.5 * *horizon as f64;
            Some(scaling::increments(job.runs).into_iter().map(|size| share.max(1.0) * size).collect())
        }
        Architecture::Direct { base: BaseModel::Equations(_), .. } => Some(scaling::missed(&runs, &scaling)),
        Architecture::Recurrent { base, .. } => correction(job, base),
    };
    if let Some(correction) = correction {
        // A scale of zero would make the correction of constant outputs unlearnable.
        let least = scaling.output_scale.iter().map(|scale| 1e-3 * scale);
        scaling.correction_scale =
            correction.iter().zip(least).map(|(size, least)| size.max(least)).collect();
    }
    let deviations = scaling::deviations(job.runs);
    let moves = |(deviation, scale): (&f64, &f64)| *deviation > STILL * 2.0 * HALF_RANGE * scale;
    if let Some(c) = deviations.iter().zip(&scaling.output_scale).position(|pair| !moves(pair)) {
        let channel = job.runs[0].outputs.channels()[c].name.clone();
        return Err(TrainError::Constant { channel });
    }
    let loss = Loss::new(options, &scaling, &deviations);
    let shape = Shape {
        outputs,
        inputs,
        wash_out,
        length,
        measured: match &net {
            Architecture::Recurrent { base, feedback, .. } => {
                *feedback || !matches!(base, BaseModel::Nothing)
            }
            Architecture::Direct { .. } | Architecture::Affine(_) => true,
        },
    };
    let windows = if net.has_overlapping_windows() {
        shape.every(&runs, 1).len()
    } else {
        shape.tiles(&runs, &mut random::stream(options.seed, random::Purpose::Offsets, 0, 0)).len()
    };
    if windows == 0 {
        return Err(shape.none("training", &runs));
    }
    let judged = Shape { length: job.horizon, ..shape };
    let learning = windows * shape.samples();
    let origins = (learning / JUDGING.saturating_mul(judged.samples())).clamp(LEAST_ORIGINS, MOST_ORIGINS);
    let judge = Validation::new(judged, &validation, &scaling, origins);
    if judge.windows.is_empty() {
        return Err(judged.none("validation", &validation));
    }
    if !judge.can_judge() {
        return Err(TrainError::NoScore { origins: judge.windows.len(), horizon: job.horizon });
    }
    let (options, epochs) = (options.clone(), options.epochs);
    Ok(Plan { options, net, scaling, shape, runs, validation, judge, loss, epochs })
}

fn scaled_run<T: Scalar>(
    run: &Trajectory,
    net: &Architecture,
    scaling: &Scaling,
) -> Result<ScaledRun<T>, TrainError> {
    let mut scaled = ScaledRun::new(run, scaling);
    if let Architecture::Direct { base: BaseModel::Equations(equations), horizon, .. } = net {
        let base_rollout = BaseRollout::new(equations, run, scaling, *horizon).map_err(|t| TrainError::Equations {
            reason: format!(
                "from the sample at {t:.3} s of run '{}' on they diverge within the horizon: choose base = \"hold\" or \"nothing\", or a shorter window_s",
                run.name
            ),
        })?;
        scaled.base_rollout = Some(base_rollout);
    }
    Ok(scaled)
}

/// Network and samples of its windows before and after the origin.
fn net(job: &Job<'_>, options: &TrainOptions) -> Result<(Architecture, usize, usize), TrainError> {
    let (outputs, inputs) = (job.outputs.len(), job.inputs.len());
    if options.cell == CellKind::Direct {
        let (history, horizon) = options.spans(job.runs[0].dt);
        let network = options.perceptron(inputs, outputs, (history, horizon))?;
        return Ok((
            Architecture::Direct { network, horizon, base: base(job, options)? },
            history - 1,
            horizon,
        ));
    }
    if options.cell == CellKind::Affine {
        let network = options.control_affine(inputs, outputs)?;
        check_sines(job, options)?;
        let efforts = job.inputs.iter().zip(&options.maps);
        // The maximum is at an end: maps increase over the range.
        let size = |(range, map): (&DesignRange, &Map)| {
            [range.low, range.high].map(|a| map.value(a).abs()).into_iter().fold(0.0, f64::max)
        };
        let units = efforts.map(size).collect();
        let wash_out = samples(job, options.wash_out_s, WASH_OUT);
        let settle = options.settle_s.map_or(0, |_| samples(job, options.settle_s, (1, 1)));
        if settle > wash_out {
            let value = format!("{settle} samples");
            let needed = "no longer than wash_out_s: it is the end of the wash-out";
            return Err(TrainError::InvalidOption { what: "settle_s", value, needed });
        }
        let (maps, dt) = (options.maps.clone(), job.runs[0].dt);
        let parts = affine::Parts { network, maps, units, dt, settle };
        return Ok((Architecture::Affine(parts), wash_out, samples(job, options.window_s, ROLLED)));
    }
    let (network, base) = (options.network(inputs, outputs)?, base(job, options)?);
    let wash_out = wash_out(job, options, &base);
    let length = samples(job, options.window_s, WINDOW);
    Ok((Architecture::Recurrent { network, base, feedback: options.feedback }, wash_out, length))
}

/// Checks that inputs with a sine map stay within +-90 degrees, where the sine can be inverted.
fn check_sines(job: &Job<'_>, options: &TrainOptions) -> Result<(), TrainError> {
    let within = |range: &DesignRange| range.low.abs().max(range.high.abs()) <= FRAC_PI_2 + 1e-9;
    let efforts = job.inputs.iter().zip(&options.maps);
    let Some(input) = efforts.clone().position(|(range, map)| *map == Map::Sine && !within(range)) else {
        return Ok(());
    };
    let names = efforts.enumerate().map(|(i, (_, map))| match map {
        Map::Sine if i != input => "\"sine\"",
        Map::Sine | Map::Identity => "\"identity\"",
        Map::SignedSquare => "\"signed_square\"",
    });
    let DesignRange { low, high, .. } = job.inputs[input];
    Err(TrainError::Sine {
        channel: job.runs[0].inputs.channels()[input].name.clone(),
        low,
        high,
        maps: names.collect::<Vec<_>>().join(", "),
    })
}

/// Scale of the correction of a recurrent network with a base.
fn correction(job: &Job<'_>, base: &BaseModel) -> Option<Vec<f64>> {
    match base {
        BaseModel::Nothing => None,
        BaseModel::Hold => Some(scaling::increments(job.runs)),
        BaseModel::Equations(equations) => Some(scaling::residuals(job.runs, equations)),
    }
}

fn check(job: &Job<'_>) -> Result<(), TrainError> {
    if job.horizon == 0 {
        let needed = "at least 1 sample";
        return Err(TrainError::InvalidOption { what: "horizon", value: String::from("0"), needed });
    }
    for (what, runs) in [("training", job.runs), ("validation", job.validation)] {
        if runs.is_empty() {
            return Err(TrainError::NoRuns { what });
        }
        for run in runs {
            for (what, expected, given) in [
                ("outputs", job.outputs.len(), run.outputs.width()),
                ("inputs", job.inputs.len(), run.inputs.width()),
            ] {
                if expected != given {
                    return Err(TrainError::Channels { run: run.name.clone(), what, expected, given });
                }
            }
            let expected = job.runs[0].dt;
            if differ(run.dt, expected) {
                return Err(TrainError::SampleTime { run: run.name.clone(), expected, given: run.dt });
            }
        }
    }
    Ok(())
}

fn differ(a: f64, b: f64) -> bool {
    let ratio = a / b;
    ratio.is_nan() || (ratio - 1.0).abs() > 1e-6
}

fn base(job: &Job<'_>, options: &TrainOptions) -> Result<BaseModel, TrainError> {
    let wrong = |reason: String| Err(TrainError::Equations { reason });
    let equations = match (options.base, &job.equations) {
        (BaseKind::Nothing, _) => return Ok(BaseModel::Nothing),
        (BaseKind::Hold, _) => return Ok(BaseModel::Hold),
        (BaseKind::Equations, None) => return wrong(String::from("none are given")),
        (BaseKind::Equations, Some(equations)) => equations,
    };
    let (n, m) = (job.outputs.len(), job.inputs.len());
    if (equations.outputs(), equations.inputs()) != (n, m) {
        let (a, b) = (equations.outputs(), equations.inputs());
        return wrong(format!("they have {a} outputs and {b} inputs, the runs {n} and {m}"));
    }
    if differ(equations.dt(), job.runs[0].dt) {
        let (a, b) = (equations.dt(), job.runs[0].dt);
        return wrong(format!("they are for samples of {a} s, the runs have {b} s"));
    }
    Ok(BaseModel::Equations(Arc::<Equations>::clone(equations)))
}

/// Time in samples, or the default limited by the longest run.
fn samples(job: &Job<'_>, seconds: Option<f64>, (most, share): (usize, usize)) -> usize {
    let longest = job.runs.iter().map(|run| run.len()).max().unwrap_or(0);
    let default = most.min(longest / share);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive, and it saturates")]
    let given = seconds.map(|s| (s / job.runs[0].dt).round().min(1e12) as usize);
    given.unwrap_or(default).max(1)
}

/// Samples of wash-out, at least the warm-up of the base.
fn wash_out(job: &Job<'_>, options: &TrainOptions, base: &BaseModel) -> usize {
    let least = if let BaseModel::Equations(equations) = base { equations.warm_up() } else { 1 };
    samples(job, options.wash_out_s, WASH_OUT).max(least)
}
