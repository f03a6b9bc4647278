//! Excerpts of the training runs.

use crate::log::Trajectory;

/// Maximum number of samples for the score; more samples do not change the choice.
pub(super) const SCORE_SAMPLES: usize = 15_000;

/// The training runs, or evenly spaced excerpts of three horizons, with the warm-up if it exceeds two horizons, of about
/// `most` samples together.
pub(super) fn excerpts(runs: &[&Trajectory], horizon: usize, warm_up: usize, most: usize) -> Vec<Trajectory> {
    let three = 3 * horizon + 1;
    let length = if warm_up + horizon <= three { three } else { warm_up + three };
    let runs: Vec<&&Trajectory> = runs.iter().filter(|run| run.len() > horizon).collect();
    let total: usize = runs.iter().map(|run| run.len()).sum();
    if total <= most.max(2 * length) {
        return runs.into_iter().map(|&run| run.clone()).collect();
    }
    let count = (most / length).max(2);
    let mut parts = Vec::new();
    for run in runs.iter().step_by(runs.len().div_ceil(count)) {
        let length = length.min(run.len());
        let share = (count * run.len()).div_ceil(total);
        let room = run.len() - length;
        for i in 0..share {
            let from = if share == 1 { room / 2 } else { room * i / (share - 1) };
            parts.push(run.slice(from, from + length));
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Channel, Table};

    fn run(samples: usize) -> Trajectory {
        let table = |name| Table::new(vec![Channel::new(name, "")], vec![0.0; samples]);
        let (outputs, inputs) = (table("y"), table("c"));
        Trajectory {
            name: String::from("run"),
            t0: 0.0,
            dt: 0.1,
            outputs,
            inputs,
            truth: None,
            heading: None,
            position: None,
        }
    }

    fn lengths(samples: usize, runs: usize) -> Vec<usize> {
        let runs: Vec<Trajectory> = (0..runs).map(|_| run(samples)).collect();
        excerpts(&runs.iter().collect::<Vec<_>>(), 100, 71, SCORE_SAMPLES)
            .iter()
            .map(Trajectory::len)
            .collect()
    }

    #[test]
    fn excerpts_are_whole_runs_or_parts_of_three_horizons_and_stay_few() {
        assert_eq!(lengths(5_000, 2), [5_000, 5_000]);
        assert_eq!(lengths(100, 3), [0; 0]);
        let long = lengths(72_000, 1);
        assert_eq!((long.len(), long[0]), (49, 301));
        // Excerpts exist for a log that gaps cut into pieces shorter than three horizons.
        let short = excerpts(&[&run(72_000)], 20, 71, SCORE_SAMPLES);
        assert!(short.iter().all(|part| part.len() == 132), "a lag that settles in 7 s, a horizon of 2 s");
        let cut = lengths(200, 2_000);
        assert!(cut.iter().all(|&n| n == 200) && (20..=49).contains(&cut.len()), "{}", cut.len());
    }
}
