//! An adversary of the guard: a search for the faults of sensors under which it is worst.
//!
//! A seed draws a case and the first 150 s of a log. For each of two goals, the guarded error over the unguarded one during the
//! faults, and from 20 to 40 s after the last of them, two searches with the same number of days look for one to three faults:
//! one draws all of them, the other one is genetic. Its generation has [`POPULATION`] days: the best quarter of the one before,
//! and days with parts of two of them, of which it draws some faults anew.

use std::ops::Range;

use hydroid::log::Trajectory;
use hydroid_core::adapt::guard::GuardOptions;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::day::{Day, Gene};
use super::{Case, DayResult, judge, noise_of, start, with_noise};

/// Days of a generation.
const POPULATION: usize = 16;

/// Days that are kept.
const KEPT: usize = POPULATION / 4;

/// Length of a log \[s\].
const LENGTH_S: f64 = 150.0;

/// Largest number of faults of a day.
const MOST_FAULTS: usize = 3;

#[derive(Clone, Copy, Debug)]
enum Goal {
    During,
    Later,
}

impl Goal {
    /// How far the guard is worse than no guard, relative; 0 where the day has no such time.
    fn of(self, day: &DayResult) -> f64 {
        let [alone, guarded] = match self {
            Self::During => day.during,
            Self::Later => day.later,
        };
        let ratio = guarded / alone;
        if ratio.is_finite() { ratio } else { 0.0 }
    }
}

/// The worst days that the searches of a seed find, after a number of generations.
pub(super) fn search(cases: &[Case], seed: u64, generations: usize) -> anyhow::Result<Vec<DayResult>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let case = &cases[rng.random_range(0..cases.len())];
    let log = &case.logs[rng.random_range(0..case.logs.len())];
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousand samples
    let run = start(log, (LENGTH_S / log.dt) as usize);
    let noise = noise_of(&case.model, &run);
    let options = with_noise(&case.model, &noise);
    // Predictions and the sensor check settle before, and the errors after the longest fault are within the log.
    let horizon = GuardOptions::new(run.dt).horizon;
    let begins =
        15 * horizon..(25 * horizon).min(run.len().saturating_sub(30 * horizon)).max(15 * horizon + 1);
    let draw = |rng: &mut ChaCha8Rng| -> Vec<Gene> {
        let count = rng.random_range(1..=MOST_FAULTS);
        (0..count).map(|_| Gene::draw(&run, &begins, rng)).collect()
    };
    let judged = |all: Vec<Vec<Gene>>| -> anyhow::Result<Vec<(Vec<Gene>, DayResult)>> {
        let one = |genes: Vec<Gene>| {
            let day = Day::with(&run, &noise, &genes);
            Ok((genes, judge(case, &case.model, &day, &noise, &options, Some(seed), &run.name)?))
        };
        all.into_par_iter().map(one).collect()
    };
    let mut worst = Vec::new();
    for (goal, name) in [(Goal::During, "during"), (Goal::Later, "later")] {
        for genetic in [false, true] {
            let mut best: Vec<(Vec<Gene>, DayResult)> = Vec::new();
            for _ in 0..generations {
                let child = |rng: &mut ChaCha8Rng| {
                    if genetic && !best.is_empty() { child(&best, &run, &begins, rng) } else { draw(rng) }
                };
                let all = (0..POPULATION).map(|_| child(&mut rng)).collect();
                best.extend(judged(all)?);
                best.sort_by(|(_, a), (_, b)| goal.of(b).total_cmp(&goal.of(a)));
                best.truncate(KEPT);
            }
            let search = if genetic { "genetic" } else { "random" };
            worst.extend(
                best.into_iter()
                    .next()
                    .map(|(_, day)| DayResult { faults: format!("{name}, {search}: {}", day.faults), ..day }),
            );
        }
    }
    Ok(worst)
}

/// Faults of two days, of which one in three is drawn anew or takes a part of a new one.
fn child(
    parents: &[(Vec<Gene>, DayResult)],
    run: &Trajectory,
    begins: &Range<usize>,
    rng: &mut ChaCha8Rng,
) -> Vec<Gene> {
    let [mother, father] = [0, 1].map(|_| &parents[rng.random_range(0..parents.len())].0);
    let mut genes: Vec<Gene> = mother.iter().chain(father).copied().filter(|_| rng.random()).collect();
    genes.truncate(MOST_FAULTS);
    if genes.is_empty() {
        genes.clone_from(mother);
    }
    for gene in &mut genes {
        let new = Gene::draw(run, begins, rng);
        match rng.random_range(0..6) {
            0 => *gene = new,
            1 | 2 => *gene = gene.with_part_of(new, rng),
            _ => {}
        }
    }
    genes
}
