//! Searches for equations: memoryless ones, and ones that also see the past.

use std::sync::Arc;

use super::settings::{intervals, reference};
use super::{IdentifyError, Job, Parts, SEARCH_ORIGINS, overview};
use crate::evaluate;
use crate::progress::Progress;
use crate::sindy::{Found, Judge, Regression, SearchError, Structure, discover, search};

/// Rollouts that settings are compared by.
pub(super) fn quick(job: &Job, parts: &Parts<'_>) -> evaluate::Options {
    let longest = parts.validation.iter().map(|run| run.len()).max().unwrap_or(0);
    evaluate::Options {
        horizon: job.horizon,
        origin_stride: (longest / SEARCH_ORIGINS).max(job.origin_stride),
        ..evaluate::Options::default()
    }
}

/// A search for equations of the present: libraries, lags, modes.
pub(super) fn memoryless(
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<Arc<Found>, IdentifyError> {
    let train = &parts.train;
    // Windows of a fifth of the horizon average the noise and blur no actuator.
    let regression = Regression::Weak { intervals: intervals(0.2 * job.horizon as f64).max(4) };
    let (lags, gate) = (job.sindy.lags(train[0])?, job.sindy.gate(train)?);
    let libraries = job.sindy.libraries()?;
    let structures =
        discover(train, &reference(&libraries), regression, &lags, &gate, &mut |f| progress(0.3 * f))
            .map_err(SearchError::Cancelled)?;
    run(job, parts, &structures, true, &mut |f| progress(0.3 + 0.7 * f))
}

/// A search for equations in which outputs and inputs of some time ago stand as well.
pub(super) fn lagged(
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<Arc<Found>, IdentifyError> {
    let dt = parts.train[0].dt;
    let samples = |share: f64| u16::try_from(intervals(share * job.horizon as f64)).unwrap_or(u16::MAX);
    let pasts: Vec<Vec<u16>> = match job.sindy.past_s {
        Some(seconds) => vec![vec![u16::try_from(intervals(seconds / dt)).unwrap_or(u16::MAX)]],
        None => vec![vec![samples(0.05)], vec![samples(0.1)], vec![samples(0.2)]],
    };
    let libraries = job.sindy.libraries()?;
    let structures: Vec<Structure> =
        pasts.into_iter().map(|past| Structure { past, ..Structure::from(reference(&libraries)) }).collect();
    run(job, parts, &structures, false, progress)
}

fn x(name: &str, default: &str) -> String { std::env::var(name).unwrap_or(default.to_owned()) }
/// all terms
pub(super) fn full(job: &Job, parts: &Parts<'_>, both: bool, past: f64, ridge: f64, progress: Progress<'_>) -> Result<Arc<Found>, IdentifyError> {
    let train = &parts.train;
    let past = if past == 0.0 { vec![] } else { vec![intervals(past * job.horizon as f64) as u16] };
    let structures = vec![Structure { past, past_inputs_only: !both, ..Structure::from(x("X_LIB", "degree 2 + x|x|").parse::<crate::sindy::Library>().unwrap()) }];
    let list = |n: &str, d: &str| x(n, d).split(',').map(|s| s.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let grid = crate::sindy::Grid {
        structures,
        regressions: list("X_WIN", "0.2").into_iter().map(|w| Regression::Weak { intervals: intervals(w * job.horizon as f64) }).collect(),
        optimizers: vec![crate::sindy::Optimizer::Stepwise(0.0)],
        ridges: vec![ridge],
        loss: crate::sindy::Loss::Squares,
        constraints: crate::sindy::Constraints::default(),
    };
    let inputs = overview::input_ranges(train);
    let judge = Judge {
        validation: &parts.validation,
        outputs: &parts.ranges,
        inputs: &inputs,
        options: evaluate::Options { warm_up: grid.warm_up(train[0]), ..quick(job, parts) },
        seed: job.seed,
        members: 0,
    };
    Ok(Arc::new(search(train, &judge, &grid, progress)?))
}

fn run(
    job: &Job,
    parts: &Parts<'_>,
    structures: &[Structure],
    plain: bool,
    progress: Progress<'_>,
) -> Result<Arc<Found>, IdentifyError> {
    let train = &parts.train;
    let libraries = job.sindy.libraries()?;
    let grid = job.sindy.grid(train[0].dt, job.horizon, &libraries, structures, plain);
    let inputs = overview::input_ranges(train);
    let judge = Judge {
        validation: &parts.validation,
        outputs: &parts.ranges,
        inputs: &inputs,
        options: evaluate::Options { warm_up: grid.warm_up(train[0]), ..quick(job, parts) },
        seed: job.seed,
        members: job.sindy.members.0,
    };
    Ok(Arc::new(search(train, &judge, &grid, progress)?))
}
