//! Limits of the rates of actuators: stated, or found by cross-validation.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::evaluation::MIN_IMPROVEMENT;
use super::expressions::channel_index;
use super::options::{Keyword, keyword_or_list};
use super::through_water::in_water;
use super::training::train_by;
use super::{CrossValidation, IdentifyError, Job, Method, Parts};
use crate::boat::Role;
use crate::committee::currents::Currents;
use crate::committee::rate_limits;
use crate::evaluate::{self, evaluate_each};
use crate::key::key;
use crate::log::units::Unit;
use crate::log::{Channel, Note, Split, Trajectory, shortest_change};
use crate::progress::Progress;
use crate::sindy::{BlockLosses, SearchError};

/// Limits of the rates at which actuators follow their commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "rate_limit is \"auto\", \"none\", or rates per second by input: rate_limit = { delta = \"4 [deg]\" }"
)]
pub enum RateLimitOption {
    /// Search, or none.
    Keyword(Keyword),
    /// Rates by the name of the input.
    Fixed(BTreeMap<String, GivenRate>),
}

impl Default for RateLimitOption {
    fn default() -> Self {
        Self::Keyword(Keyword::Auto)
    }
}

/// A stated rate: `0.07`, or `4 [deg]` per second in another unit than that of the channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct GivenRate {
    /// Largest change in a second.
    pub rate: f64,
    /// Its unit; that of the channel if none is given.
    pub unit: Option<String>,
}

/// Form in a configuration file: a number, or text as on the command line.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "a rate is a number per second, or text like \"4 [deg]\"")]
enum Written {
    Number(f64),
    Text(String),
}

impl TryFrom<Written> for GivenRate {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        match written {
            Written::Number(rate) => Ok(Self { rate, unit: None }),
            Written::Text(text) => text.parse(),
        }
    }
}

impl From<GivenRate> for Written {
    fn from(GivenRate { rate, unit }: GivenRate) -> Self {
        match unit {
            None => Self::Number(rate),
            Some(unit) => Self::Text(format!("{rate} [{unit}]")),
        }
    }
}

impl std::str::FromStr for GivenRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is not a rate: write a number per second, as in 0.07, or 4 [deg]");
        let (number, unit) = match text.split_once('[') {
            None => (text, None),
            Some((number, unit)) => {
                (number, Some(unit.trim().strip_suffix(']').ok_or_else(wrong)?.trim().to_owned()))
            }
        };
        Ok(Self { rate: number.trim().parse().map_err(|_| wrong())?, unit })
    }
}

impl std::str::FromStr for RateLimitOption {
    type Err = String;

    /// `auto`, `none`, or `delta=4 [deg],n=10`.
    fn from_str(text: &str) -> Result<Self, String> {
        let found = keyword_or_list(text, |rate| rate.parse().ok());
        let found = found.map(|found| found.map_or_else(Self::Keyword, Self::Fixed));
        found.ok_or_else(|| {
            format!("'{text}' is not auto, none, or a list like 'delta=4 [deg],n=10' (per second)")
        })
    }
}

/// A rate limit for each input \[unit/s\]. `found` are the currents of the training runs, if they matter.
pub(super) fn find(
    job: &Job,
    parts: &Parts<'_>,
    found: Option<&Currents>,
    notes: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<Vec<Option<f64>>, IdentifyError> {
    let channels = parts.train[0].inputs.channels();
    match &job.rate_limits {
        RateLimitOption::Keyword(Keyword::None) => Ok(vec![None; channels.len()]),
        RateLimitOption::Keyword(Keyword::Auto) => {
            let gears = gears(job, &parts.train, channels);
            notes.extend(note_of_gears(channels, &gears));
            // Few training runs beside validation runs are not enough for the choice.
            if parts.folds.is_none() {
                return Ok(gears);
            }
            let of_training = Split { validation: Vec::new(), test: Vec::new(), ..job.split.clone() };
            let job = job.with_split(of_training);
            let job = found.map_or_else(|| Ok(job.clone()), |found| in_water(&job, found))?;
            let rates = search(&job, parts, progress)?;
            let rates: Vec<Option<f64>> =
                rates.into_iter().zip(&gears).map(|(rate, gear)| rate.filter(|_| gear.is_none())).collect();
            notes.extend(note(channels, &rates));
            Ok(rates.into_iter().zip(gears).map(|(rate, gear)| gear.or(rate)).collect())
        }
        RateLimitOption::Fixed(given) => {
            let mut rates = vec![None; channels.len()];
            for (name, given) in given {
                let place = channel_index("rate limit", "input", name, channels)?;
                rates[place] = Some(rate(name, given, &channels[place])?);
            }
            Ok(rates)
        }
    }
}

/// Part of its range over which the rate of an input is measured, so that noise does not count.
const PART: f64 = 0.25;

/// Samples in which an order passes this part of the range, if it was averaged over the samples.
const STEP: usize = 2;

/// The fastest rates \[unit/s\] of inputs that steer and never step: measured angles of steering gears. Steps of a trial would
/// be faster than anything in the logs.
fn gears(job: &Job, train: &[&Trajectory], channels: &[Channel]) -> Vec<Option<f64>> {
    let mut boat = job.boat.clone();
    boat.find(channels);
    let rate = |c: usize| {
        let values = || train.iter().flat_map(|run| run.inputs.column(c));
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let part = PART * (high - low);
        let shortest = train.iter().filter_map(|run| shortest_change(run.inputs.column(c), part)).min()?;
        let fastest = train.iter().flat_map(|run| {
            let values: Vec<f64> = run.inputs.column(c).collect();
            let changes = values.iter().zip(values.iter().skip(shortest)).map(|(a, b)| (b - a).abs());
            changes.collect::<Vec<_>>()
        });
        let change = fastest.fold(0.0, f64::max);
        (shortest > STEP && part > 0.0).then(|| change / (shortest as f64 * train[0].dt))
    };
    let steers = |channel: &Channel| boat.role(&channel.name) == Some(Role::Steering);
    channels.iter().enumerate().map(|(c, channel)| rate(c).filter(|_| steers(channel))).collect()
}

/// The limits that a single regression suggests, of which each must reduce the cross-validated error of a committee by more
/// than one standard error, and by [`MIN_IMPROVEMENT`]. They are tried all together first, because those of a rudder and of a
/// propeller may only show together, and then without or with each.
fn search(job: &Job, parts: &Parts<'_>, progress: Progress<'_>) -> Result<Vec<Option<f64>>, IdentifyError> {
    let runs: Vec<&Trajectory> = job.split.train.iter().collect();
    // The wind is an input without an actuator.
    let wind = if job.reading.selection.wind.is_some() { 2 } else { 0 };
    let actuators = runs[0].inputs.width().saturating_sub(wind);
    let suggested = rate_limits::suggest(&runs, actuators, job.horizon, progress);
    let suggested = suggested.map_err(SearchError::Cancelled)?;
    let mut rates = vec![None; suggested.len()];
    if suggested.iter().all(Option::is_none) {
        return Ok(rates);
    }
    let Some(mut least) = losses(job, parts)? else { return Ok(rates) };
    let none = least.clone();
    let of = |rates: &[Option<f64>]| match limited(job, rates) {
        Some(limited) => losses(&limited, parts),
        None => Ok(Some(none.clone())),
    };
    // Losses are squares of errors.
    let is_better = |one: &BlockLosses, other: &BlockLosses| {
        one.mean() < (1.0 - MIN_IMPROVEMENT).powi(2) * other.mean() && one.is_significantly_better(other)
    };
    let count = suggested.iter().flatten().count();
    if let Some(all) = if count > 1 { of(&suggested)? } else { None }
        && is_better(&all, &least)
    {
        (rates, least) = (suggested.clone(), all);
    }
    for (c, rate) in suggested.into_iter().enumerate().filter(|(_, rate)| rate.is_some()) {
        let mut other = rates.clone();
        other[c] = rate.filter(|_| rates[c].is_none());
        let Some(next) = of(&other)? else { continue };
        let accepted = match other[c] {
            Some(_) => is_better(&next, &least),
            None => !is_better(&least, &next),
        };
        if accepted {
            (rates, least) = (other, next);
        }
    }
    Ok(rates)
}

/// Losses of committees on the runs that were left out; `None` if there is no committee, or one diverges.
fn losses(job: &Job, parts: &Parts<'_>) -> Result<Option<BlockLosses>, IdentifyError> {
    let folds = CrossValidation::new(&job.split.train);
    let parts = parts.in_positions(job, Some(&folds), Vec::new());
    let silent = &mut |_: f64, _: Option<&_>| ControlFlow::Continue(());
    let trained = match train_by(Method::Committee, job, &parts, &[], (0.0, 0), &mut Vec::new(), silent) {
        Ok(trained) => trained,
        Err(error) if error.is_method_specific() => return Ok(None),
        Err(error) => return Err(error),
    };
    let sessions = folds.runs(&job.split.train).into_iter().map(|(fold, _)| trained.left_out[fold].session());
    let options = evaluate::Options {
        horizon: job.horizon,
        origin_stride: job.origin_stride,
        ..evaluate::Options::default()
    };
    let errors = evaluate_each(
        "committee",
        &mut sessions.collect::<Vec<_>>(),
        &parts.ranges,
        &parts.validation,
        &options,
        &mut crate::progress::silent(),
    );
    let sound = errors.ok().filter(|errors| errors.diverged == 0);
    Ok(sound.map(|errors| BlockLosses { validation: errors.blocks, training: Vec::new() }))
}

/// A stated rate in the unit of its channel, per second.
fn rate(name: &str, given: &GivenRate, channel: &Channel) -> Result<f64, IdentifyError> {
    let wrong = |why: String| IdentifyError::RateLimit { channel: name.to_owned(), why };
    let factor = match &given.unit {
        None => 1.0,
        Some(unit) => {
            let unit = unit.trim_end_matches("/s").trim();
            let to = Unit::parse(&channel.unit).map_err(|e| wrong(e.to_string()))?;
            let from = Unit::parse(unit).map_err(|e| wrong(e.to_string()))?;
            from.to(&to).map_err(|e| wrong(e.to_string()))?
        }
    };
    let rate = factor * given.rate;
    if rate.is_finite() && rate > 0.0 {
        return Ok(rate);
    }
    Err(wrong(format!("{} is not a positive number", given.rate)))
}

/// The job with the positions of the actuators in place of the commands of its training and validation runs; `None` if
/// nothing is limited.
pub(super) fn limited(job: &Job, rates: &[Option<f64>]) -> Option<Job> {
    rates.iter().any(Option::is_some).then(|| {
        let positions = |runs: &[Trajectory]| {
            runs.iter().map(|run| rate_limits::positions(run, rates)).collect::<Vec<_>>()
        };
        let Split { train, validation, .. } = &job.split;
        let (train, validation) = (positions(train), positions(validation));
        job.with_split(Split { train, validation, test: Vec::new(), notes: Vec::new() })
    })
}

/// What is said about measured angles.
fn note_of_gears(channels: &[Channel], rates: &[Option<f64>]) -> Option<Note> {
    let found = listed(channels, rates)?;
    let message = format!(
        "an input that steers never steps, as the measured angle of a steering gear: in trials and simulations it turns at the \
         fastest rate of the logs, {found}"
    );
    let rate_limit = || key("rate_limit");
    let remedy = format!("state the rate of the gear with {}, or {}", rate_limit(), rate_limit().is("none"));
    Some(Note::info(message).with_remedy(remedy))
}

/// What was found, for the user.
fn note(channels: &[Channel], rates: &[Option<f64>]) -> Option<Note> {
    let found = listed(channels, rates)?;
    let message = format!("limits of the rates of actuators reduce the cross-validated error: {found}");
    let rate_limit = || key("rate_limit");
    let remedy = format!("state the true limits with {}, or {}", rate_limit(), rate_limit().is("none"));
    Some(Note::info(message).with_remedy(remedy))
}

/// Rates by name; `None` without one.
fn listed(channels: &[Channel], rates: &[Option<f64>]) -> Option<String> {
    let limit = |(channel, rate): (&Channel, &Option<f64>)| {
        let (rate, unit) = match ((*rate)?, channel.unit.as_str()) {
            (rate, "rad") => (rate.to_degrees(), "deg"),
            (rate, "") => (rate, "1"),
            other => other,
        };
        Some(format!("{} {rate:.3} {unit}/s", channel.name))
    };
    let found: Vec<String> = channels.iter().zip(rates).filter_map(limit).collect();
    (!found.is_empty()).then(|| found.join(", "))
}
