//! Many voyages, each with its own seed, current, wind and mass.

use std::f64::consts::TAU;

use rand::RngExt as _;
use rayon::prelude::*;
use serde::Serialize;

use super::error::{SteerError, at_least};
use super::metrics::Metrics;
use super::random::{Purpose, stream};
use super::sail::{Scene, sail};
use super::sea::Conditions;
use super::steering::Steering;
use crate::progress::{Progress, silent};

/// How far conditions vary from voyage to voyage, about those that are given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Mass by up to this share, uniformly.
    pub mass: f64,
    /// Current by up to this speed \[m/s\], from any direction, uniform in both.
    pub current: f64,
    /// Steady wind by up to this force \[N\], likewise; half of what is drawn is the deviation of the gusts.
    pub wind: f64,
}

impl Default for Spread {
    /// 20 % of the mass, 0.3 m/s of current, 15 N of wind.
    fn default() -> Self {
        Self { mass: 0.2, current: 0.3, wind: 15.0 }
    }
}

impl Spread {
    fn check(&self) -> Result<(), SteerError> {
        at_least("the spread of the current", self.current, 0.0)?;
        at_least("the spread of the wind", self.wind, 0.0)?;
        if (0.0..1.0).contains(&self.mass) {
            return Ok(());
        }
        let needed = "a share of 0 or more and less than 1 is needed";
        Err(SteerError::Option { what: "the spread of the mass", value: self.mass, needed })
    }

    /// Conditions of one voyage.
    fn draw(&self, about: &Conditions, index: u64) -> Conditions {
        // Seeds that follow each other are as different as any: they are keys of a cipher.
        let seed = about.seed.wrapping_add(index);
        let mut random = stream(seed, Purpose::Conditions);
        let mut unit = || random.random::<f64>();
        let mass = about.mass * (1.0 + self.mass * (2.0 * unit() - 1.0));
        let mut vector = |most: f64, about: [f64; 2]| {
            let (size, (sin, cos)) = (most * unit(), (TAU * unit()).sin_cos());
            ([about[0] + size * cos, about[1] + size * sin], size)
        };
        let (current, _) = vector(self.current, about.current);
        let (force, size) = vector(self.wind, about.wind.force);
        let mut wind = about.wind;
        (wind.force, wind.gust) = (force, about.wind.gust.hypot(0.5 * size));
        Conditions { seed, current, wind, mass, ..*about }
    }
}

/// One voyage of many.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outing {
    /// What it met.
    pub conditions: Conditions,
    /// What it was worth.
    pub metrics: Metrics,
}

/// A figure over all voyages.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Half of the voyages have less.
    pub median: f64,
    /// 95 of 100 have less.
    pub p95: f64,
    /// The most.
    pub max: f64,
}

/// What became of many voyages.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fleet {
    /// How many.
    pub runs: usize,
    /// How many held their course.
    pub held: usize,
    /// How many diverged.
    pub diverged: usize,
    /// Commands outside of their limits, in all of them.
    pub violations: usize,
    /// Samples farther off than the tolerance without a status that says so, in all of them.
    pub unsaid: usize,
    /// Distance from the reference \[m\].
    pub rms_position: Summary,
    /// Distance from the path \[m\].
    pub rms_cross_track: Summary,
    /// Speed error \[m/s\].
    pub rms_speed: Summary,
    /// Largest distance from the path \[m\].
    pub max_cross_track: Summary,
    /// How far conditions vary.
    pub spread: Spread,
    /// One by one, in the order of their seeds.
    pub outings: Vec<Outing>,
}

/// Sails many times, in parallel; the result does not depend on the number of threads. Voyage `k` has the seed of `about`
/// plus `k`.
///
/// # Errors
/// As [`sail`] and [`Steering::helm`].
pub fn fleet(
    steering: &Steering,
    scene: &Scene,
    about: &Conditions,
    spread: &Spread,
    runs: usize,
    from_s: f64,
    progress: Progress<'_>,
) -> Result<Fleet, SteerError> {
    spread.check()?;
    scene.check_from(from_s)?;
    if runs == 0 {
        let needed = "at least one is needed";
        return Err(SteerError::Option { what: "the number of voyages", value: 0.0, needed });
    }
    let mut outings = Vec::with_capacity(runs);
    // In pieces, between which the caller hears how far it is and may stop.
    let piece = rayon::current_num_threads().max(1);
    for first in (0..runs).step_by(piece) {
        let part = first..(first + piece).min(runs);
        let these: Vec<Outing> = part
            .into_par_iter()
            .map(|index| {
                let conditions = spread.draw(about, index as u64);
                let mut helm = steering.helm(conditions.seed)?;
                let voyage = sail(scene, &conditions, helm.as_mut(), &mut silent())?;
                Ok(Outing { conditions, metrics: Metrics::of(&voyage, from_s) })
            })
            .collect::<Result<_, SteerError>>()?;
        outings.extend(these);
        if progress(outings.len() as f64 / runs as f64).is_break() {
            return Err(SteerError::Cancelled);
        }
    }
    let of = |figure: fn(&Metrics) -> f64| summary(outings.iter().map(|o| figure(&o.metrics)).collect());
    let sum = |figure: fn(&Metrics) -> usize| outings.iter().map(|o| figure(&o.metrics)).sum();
    Ok(Fleet {
        runs,
        held: sum(|m| usize::from(m.held)),
        diverged: sum(|m| usize::from(m.diverged)),
        violations: sum(|m| m.violations),
        unsaid: sum(|m| m.unsaid),
        rms_position: of(|m| m.rms_position),
        rms_cross_track: of(|m| m.rms_cross_track),
        rms_speed: of(|m| m.rms_speed),
        max_cross_track: of(|m| m.max_cross_track),
        spread: *spread,
        outings,
    })
}

/// Nearest ranks; what is no number is last, whatever its sign.
fn summary(mut figures: Vec<f64>) -> Summary {
    for figure in &mut figures {
        *figure = if figure.is_nan() { f64::INFINITY } else { *figure };
    }
    figures.sort_unstable_by(f64::total_cmp);
    let rank = |share: f64| {
        // Between 0 and the length.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let rank = (share * figures.len() as f64).ceil() as usize;
        figures.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
    };
    Summary { median: rank(0.5), p95: rank(0.95), max: rank(1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_is_the_most() {
        let of = |figures: &[f64]| summary(figures.to_vec());
        let [plain, signed] = [f64::NAN, -f64::NAN].map(|nan| of(&[1.0, nan, 3.0, 2.0]));
        assert_eq!((plain.median, plain.p95, plain.max), (2.0, f64::INFINITY, f64::INFINITY));
        assert_eq!(plain, signed);
    }
}
