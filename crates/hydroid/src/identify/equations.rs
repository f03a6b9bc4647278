//! Searches for memoryless equations and for equations with past values.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::control_affine;
use super::options::{intervals, reference};
use super::{IdentifyError, Job, Parts, SEARCH_ORIGINS, data_summary};
use crate::evaluate;
use crate::log::Trajectory;
use crate::progress::Progress;
use crate::sindy::{
    Library, Optimizer, RegressionForm, SearchError, SearchGrid, SearchOptions, SearchResult, Structure,
    StructureSpec, Variables, noise_ratio, search, structure_search,
};

/// Largest number of samples for the refinement of delivered equations.
pub(super) const REFINE_SAMPLES: usize = 100_000;

/// Largest number of samples for the refinement of equations that are fitted again.
pub(super) const DRAFT_REFINE_SAMPLES: usize = 30_000;

pub(super) fn quick(job: &Job, parts: &Parts<'_>) -> evaluate::Options {
    let longest = parts.validation.iter().map(|run| run.len()).max().unwrap_or(0);
    evaluate::Options {
        horizon: job.horizon,
        origin_stride: (longest / SEARCH_ORIGINS).max(job.origin_stride),
        ..evaluate::Options::default()
    }
}

/// The libraries of the search; an error before any terms are made if all are too large.
fn libraries(job: &Job, run: &Trajectory) -> Result<Vec<Library>, IdentifyError> {
    let variables = Variables::of(run);
    let mut refusal = SearchError::Empty;
    let mut good = Vec::new();
    for library in job.sindy.libraries(run)? {
        match Structure::from(library.clone()).check_size(&variables) {
            Ok(()) => good.push(library),
            Err(error) => refusal = error,
        }
    }
    if good.is_empty() { Err(refusal.into()) } else { Ok(good) }
}

pub(super) fn memoryless(
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<Arc<SearchResult>, IdentifyError> {
    let train = &parts.train;
    // A window of a fifth of the horizon averages the noise and keeps the dynamics of actuators.
    let regression = RegressionForm::Weak { intervals: intervals(0.2 * job.horizon as f64).max(4) };
    let (lags, gate) = (job.sindy.lags(train[0])?, job.sindy.gate(train)?);
    // A structure given by the user is kept; a structure that was found competes with equations without it.
    let said = matches!(lags, StructureSpec::Fixed(_)) || matches!(gate, StructureSpec::Fixed(_));
    let all = libraries(job, train[0])?;
    if !said && let Some(found) = sparsest(job, parts, &all, progress)? {
        return Ok(found);
    }
    // One search for each form of the commands: equations combined from two searches could not be inverted.
    let searches: Vec<Vec<Library>> = if job.sindy.for_control {
        control_affine::libraries(&all, &Variables::of(train[0]))
            .into_iter()
            .map(|library| vec![library])
            .collect()
    } else {
        vec![all]
    };
    let share = 1.0 / searches.len() as f64;
    let mut best: Result<Arc<SearchResult>, IdentifyError> = Err(SearchError::Empty.into());
    for (libraries, index) in searches.iter().zip(0_u32..) {
        let mut part = |f: f64| progress(share * (f64::from(index) + f));
        let structures =
            structure_search(train, &reference(libraries), regression, &lags, &gate, &mut |f| part(0.3 * f))
                .map_err(SearchError::Cancelled)?;
        match run(job, parts, libraries, &structures, !said, &mut |f| part(0.3 + 0.7 * f)) {
            Err(IdentifyError::Sindy(SearchError::Cancelled(cancelled))) => {
                return Err(SearchError::Cancelled(cancelled).into());
            }
            Ok(found) if best.as_ref().is_ok_and(|best| best.score <= found.score) => {}
            Err(_) if best.is_ok() => {}
            found => best = found,
        }
    }
    best
}

/// Data are explained if at most half of the mean squared residual is not their noise, and the residual is at least half of it.
const NOISE_RATIOS: RangeInclusive<f64> = 0.5..=2.0;

/// Most terms of a library for the search for the best subset.
const SUBSET_TERMS: usize = 100;

pub(super) fn is_explained(ratios: &[f64]) -> bool {
    ratios.iter().all(|ratio| NOISE_RATIOS.contains(ratio))
}

/// The best subsets of the richest library, if they explain the data to within their noise (discrepancy principle: Morozov,
/// Soviet Math. Dokl. 7 (1966) 414). Rollouts cannot select here: the noise of their first samples covers the differences.
fn sparsest(
    job: &Job,
    parts: &Parts<'_>,
    libraries: &[Library],
    progress: Progress<'_>,
) -> Result<Option<Arc<SearchResult>>, IdentifyError> {
    let train = &parts.train;
    let grid = libraries.last().and_then(|library| job.sindy.sparsest(train, job.horizon, library));
    let Some(grid) = grid else { return Ok(None) };
    let is_small = grid.structures.iter().all(|s| s.terms(&Variables::of(train[0])).len() <= SUBSET_TERMS);
    if !is_small || !noise_ratio(train, &grid, None).is_ok_and(|ratios| is_explained(&ratios)) {
        return Ok(None);
    }
    let mut found = searched(job, parts, &grid, progress)?;
    let has_terms = |equation: &[f64]| equation.iter().any(|c| *c != 0.0);
    let equations = &found.fit.equations;
    if !equations.coefficients().chunks(equations.terms().len()).all(has_terms) {
        return Ok(None);
    }
    found.noise_ratio =
        noise_ratio(train, &grid, Some(&found.fit)).ok().filter(|ratios| is_explained(ratios));
    Ok(found.noise_ratio.is_some().then(|| Arc::new(found)))
}

pub(super) fn lagged(
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<Arc<SearchResult>, IdentifyError> {
    let dt = parts.train[0].dt;
    let samples = |share: f64| u16::try_from(intervals(share * job.horizon as f64)).unwrap_or(u16::MAX);
    let pasts: Vec<Vec<u16>> = match job.sindy.past {
        Some(seconds) => vec![vec![u16::try_from(intervals(seconds / dt)).unwrap_or(u16::MAX)]],
        None => vec![vec![samples(0.05)], vec![samples(0.1)], vec![samples(0.2)]],
    };
    let libraries = libraries(job, parts.train[0])?;
    let structures: Vec<Structure> =
        pasts.into_iter().map(|past| Structure { past, ..Structure::from(reference(&libraries)) }).collect();
    run(job, parts, &libraries, &structures, false, progress)
}

/// Equations with all terms of the richest library and delayed inputs, with the smallest ridge without divergence.
pub(super) fn whole(
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<Arc<SearchResult>, IdentifyError> {
    let run = parts.train[0];
    let share = |share: f64| intervals(share * job.horizon as f64);
    let past =
        u16::try_from(job.sindy.past.map_or(share(0.1), |s| intervals(s / run.dt))).unwrap_or(u16::MAX);
    let libraries: Vec<Library> = libraries(job, run)?.pop().into_iter().collect();
    let mut grid = job.sindy.grid(&parts.train, job.horizon, &libraries, &[], true);
    for structure in &mut grid.structures {
        structure.past = vec![past];
        structure.past_inputs_only = true;
    }
    if !job.sindy.central_differences && job.sindy.window.is_none() {
        grid.regressions = vec![RegressionForm::Weak { intervals: share(0.2) }];
    }
    grid.optimizers = vec![Optimizer::Stepwise(0.0)];
    grid.refine = None;
    grid.constraints = job.sindy.coefficient_constraints(run, &libraries)?;
    let ridges = job.sindy.ridge.map_or_else(|| vec![0.1, 1.0, 10.0], |ridge| vec![ridge]);
    let mut outcome = Err(IdentifyError::Sindy(SearchError::Empty));
    for ridge in ridges {
        outcome = searched(job, parts, &SearchGrid { ridges: vec![ridge], ..grid.clone() }, progress);
        if !matches!(outcome, Err(IdentifyError::Sindy(SearchError::AllDiverged(_)))) {
            break;
        }
    }
    outcome.map(Arc::new)
}

fn run(
    job: &Job,
    parts: &Parts<'_>,
    libraries: &[Library],
    structures: &[Structure],
    plain: bool,
    progress: Progress<'_>,
) -> Result<Arc<SearchResult>, IdentifyError> {
    let train = &parts.train;
    let mut grid = job.sindy.grid(train, job.horizon, libraries, structures, plain);
    grid.constraints = job.sindy.coefficient_constraints(train[0], libraries)?;
    searched(job, parts, &grid, progress).map(Arc::new)
}

fn searched(
    job: &Job,
    parts: &Parts<'_>,
    grid: &SearchGrid,
    progress: Progress<'_>,
) -> Result<SearchResult, IdentifyError> {
    let train = &parts.train;
    let inputs = data_summary::input_ranges(train);
    let judge = SearchOptions {
        validation: &parts.validation,
        outputs: &parts.training_ranges,
        inputs: &inputs,
        evaluation: quick(job, parts),
        seed: job.seed,
        ensemble_size: job.sindy.members.unwrap_or(super::options::MEMBERS),
        refine_samples: if parts.draft { DRAFT_REFINE_SAMPLES } else { REFINE_SAMPLES },
    };
    Ok(search(train, &judge, grid, progress)?)
}
