//! From a job and settings to all that does not change in a training.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use hydroid_core::control::Map;
use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{Base, Scaling};
use hydroid_core::model::sparse::Equations;

use super::below::Below;
use super::chunk::Net;
use super::judge::Judge;
use super::loss::Loss;
use super::scaling::HALF_RANGE;
use super::team::Plan;
use super::windows::{ScaledRun, Shape};
use super::{BaseKind, CellKind, Job, Settings, TrainError, affine, random, scaling};
use crate::evaluate::DesignRange;
use crate::log::Trajectory;

/// Samples of wash-out and of comparison where the settings say nothing, and the shares of the longest run that they
/// may be.
const WASH_OUT: (usize, usize) = (100, 8);
const WINDOW: (usize, usize) = (200, 4);

/// Samples that a window of a control-affine network compares: long enough that the noise of where it begins is little beside
/// what the motion does, short enough that many of them are in a batch.
const ROLLED: (usize, usize) = (20, 4);

/// Origins on the validation runs: at least as many if they can be had, and at the most. In between judging costs a
/// fraction of learning.
const LEAST_ORIGINS: usize = 64;
const MOST_ORIGINS: usize = 512;

/// Share of its design range by which an output must deviate from its mean: the mean of many equal numbers is off by
/// rounding, and no sensor tells a millionth of its range.
const STILL: f64 = 1e-6;

/// Steps of learning for one of judging.
const JUDGING: usize = 6;

pub(super) fn plan<T: Scalar>(job: &Job<'_>, settings: &Settings) -> Result<Plan<T>, TrainError> {
    let (outputs, inputs) = (job.outputs.len(), job.inputs.len());
    settings.check(outputs)?;
    check(job)?;
    let mut scaling = scaling::from_ranges(job.outputs, job.inputs)?;
    let (net, wash_out, length) = net(job, settings)?;
    let scaled = |runs: &[&Trajectory]| -> Result<Vec<ScaledRun<T>>, TrainError> {
        runs.iter().map(|run| look_along(run, &net, &scaling)).collect()
    };
    let (runs, validation) = (scaled(job.runs)?, scaled(job.validation)?);
    let correction = match &net {
        // Of a control-affine network these are rates: a range in a few seconds.
        Net::Direct { base: Base::Nothing, .. } | Net::Affine(_) => None,
        // As large as changes over half of the horizon.
        Net::Direct { base: Base::Hold, horizon, .. } => {
            let share = 0.5 * *horizon as f64;
            Some(scaling::increments(job.runs).into_iter().map(|size| share.max(1.0) * size).collect())
        }
        Net::Direct { base: Base::Equations(_), .. } => Some(scaling::missed(&runs, &scaling)),
        Net::Recurrent { base, .. } => correction(job, base),
    };
    if let Some(correction) = correction {
        // A network whose output counts for nothing could not learn: what does not move at all keeps a thousandth.
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
    let loss = Loss::new(settings, &scaling, &deviations);
    let shape = Shape {
        outputs,
        inputs,
        wash_out,
        length,
        measured: match &net {
            Net::Recurrent { base, feedback, .. } => *feedback || !matches!(base, Base::Nothing),
            Net::Direct { .. } | Net::Affine(_) => true,
        },
    };
    let windows = if net.everywhere() {
        shape.every(&runs, 1).len()
    } else {
        shape.tiles(&runs, &mut random::stream(settings.seed, random::Purpose::Offsets, 0, 0)).len()
    };
    if windows == 0 {
        return Err(shape.none("training", &runs));
    }
    let judged = Shape { length: job.horizon, ..shape };
    let learning = windows * shape.samples();
    let origins = (learning / JUDGING.saturating_mul(judged.samples())).clamp(LEAST_ORIGINS, MOST_ORIGINS);
    let judge = Judge::new(judged, &validation, &scaling, origins);
    if judge.windows.is_empty() {
        return Err(judged.none("validation", &validation));
    }
    if !judge.can_judge() {
        return Err(TrainError::NoScore { origins: judge.windows.len(), horizon: job.horizon });
    }
    let (settings, epochs) = (settings.clone(), settings.epochs);
    Ok(Plan { settings, net, scaling, shape, runs, validation, judge, loss, epochs })
}

/// A run as the network sees it, with what equations below a direct predictor say of it.
fn look_along<T: Scalar>(run: &Trajectory, net: &Net, scaling: &Scaling) -> Result<ScaledRun<T>, TrainError> {
    let mut scaled = ScaledRun::new(run, scaling);
    if let Net::Direct { base: Base::Equations(equations), horizon, .. } = net {
        let below = Below::new(equations, run, scaling, *horizon).map_err(|t| TrainError::Equations {
            reason: format!(
                "from the sample at {t:.3} s of run '{}' on they run away within the horizon: choose base = \"hold\" or \"nothing\", or a shorter window_s",
                run.name
            ),
        })?;
        scaled.below = Some(below);
    }
    Ok(scaled)
}

/// The network, and the samples of its windows before and after their origins.
fn net(job: &Job<'_>, settings: &Settings) -> Result<(Net, usize, usize), TrainError> {
    let (outputs, inputs) = (job.outputs.len(), job.inputs.len());
    if settings.cell == CellKind::Direct {
        let (history, horizon) = settings.spans(job.runs[0].dt);
        let network = settings.perceptron(inputs, outputs, (history, horizon))?;
        return Ok((Net::Direct { network, horizon, base: base(job, settings)? }, history - 1, horizon));
    }
    if settings.cell == CellKind::Affine {
        let network = settings.control_affine(inputs, outputs)?;
        check_sines(job, settings)?;
        let efforts = job.inputs.iter().zip(&settings.maps);
        // At one of the ends: every map increases over the range.
        let size = |(range, map): (&DesignRange, &Map)| {
            [range.low, range.high].map(|a| map.value(a).abs()).into_iter().fold(0.0, f64::max)
        };
        let units = efforts.map(size).collect();
        let wash_out = samples(job, settings.wash_out_s, WASH_OUT);
        let settle = settings.settle_s.map_or(0, |_| samples(job, settings.settle_s, (1, 1)));
        if settle > wash_out {
            let value = format!("{settle} samples");
            let needed = "no longer than wash_out_s: it is the end of the wash-out";
            return Err(TrainError::Setting { what: "settle_s", value, needed });
        }
        let (maps, dt) = (settings.maps.clone(), job.runs[0].dt);
        let parts = affine::Parts { network, maps, units, dt, settle };
        return Ok((Net::Affine(parts), wash_out, samples(job, settings.window_s, ROLLED)));
    }
    let (network, base) = (settings.network(inputs, outputs)?, base(job, settings)?);
    let wash_out = wash_out(job, settings, &base);
    let length = samples(job, settings.window_s, WINDOW);
    Ok((Net::Recurrent { network, base, feedback: settings.feedback }, wash_out, length))
}

/// Whether every input that acts by its sine stays within a quarter of a turn: beyond, a sine falls again, and no law can tell
/// which angle an effort asks for.
fn check_sines(job: &Job<'_>, settings: &Settings) -> Result<(), TrainError> {
    let within = |range: &DesignRange| range.low.abs().max(range.high.abs()) <= FRAC_PI_2 + 1e-9;
    let efforts = job.inputs.iter().zip(&settings.maps);
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

/// Size of what a recurrent network gives, where that is not the outputs themselves.
fn correction(job: &Job<'_>, base: &Base) -> Option<Vec<f64>> {
    match base {
        Base::Nothing => None,
        Base::Hold => Some(scaling::increments(job.runs)),
        Base::Equations(equations) => Some(scaling::residuals(job.runs, equations)),
    }
}

fn check(job: &Job<'_>) -> Result<(), TrainError> {
    if job.horizon == 0 {
        let needed = "at least 1 sample";
        return Err(TrainError::Setting { what: "horizon", value: String::from("0"), needed });
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

/// Whether two sample times are not the same.
fn differ(a: f64, b: f64) -> bool {
    let ratio = a / b;
    ratio.is_nan() || (ratio - 1.0).abs() > 1e-6
}

fn base(job: &Job<'_>, settings: &Settings) -> Result<Base, TrainError> {
    let wrong = |reason: String| Err(TrainError::Equations { reason });
    let equations = match (settings.base, &job.equations) {
        (BaseKind::Nothing, _) => return Ok(Base::Nothing),
        (BaseKind::Hold, _) => return Ok(Base::Hold),
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
    Ok(Base::Equations(Arc::<Equations>::clone(equations)))
}

/// A time in samples, or a default that leaves room on short runs.
fn samples(job: &Job<'_>, seconds: Option<f64>, (most, share): (usize, usize)) -> usize {
    let longest = job.runs.iter().map(|run| run.len()).max().unwrap_or(0);
    let default = most.min(longest / share);
    // Longer than any run is refused later, with words; the cast saturates.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive, and it saturates")]
    let given = seconds.map(|s| (s / job.runs[0].dt).round().min(1e12) as usize);
    given.unwrap_or(default).max(1)
}

/// The wash-out is as long as the base needs in any case.
fn wash_out(job: &Job<'_>, settings: &Settings, base: &Base) -> usize {
    let least = if let Base::Equations(equations) = base { equations.warm_up() } else { 1 };
    samples(job, settings.wash_out_s, WASH_OUT).max(least)
}
