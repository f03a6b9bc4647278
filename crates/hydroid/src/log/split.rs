//! Split of runs into training, validation and test.
//!
//! Neighbouring samples of a run are strongly correlated. Complete runs are therefore held out if there are at
//! least three, otherwise contiguous blocks of a run; samples are never drawn at random.

use super::error::LogError;
use super::note::Note;
use super::prepare::FEWEST_SAMPLES;
use super::trajectory::Trajectory;
use crate::key::key;

/// Training, validation and test runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// Runs that fit the models.
    pub train: Vec<Trajectory>,
    /// Runs that select among fitted models (thresholds, degrees, early stopping).
    pub validation: Vec<Trajectory>,
    /// Runs that evaluate the selected model once.
    pub test: Vec<Trajectory>,
    /// Notes on the split.
    pub notes: Vec<Note>,
}

/// The first `seconds` of the runs of a log.
pub fn beginning(runs: &[Trajectory], seconds: f64) -> Vec<Trajectory> {
    let (mut left, mut begun) = (seconds, Vec::new());
    for run in runs {
        // A number of samples, rounded; a cast saturates.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = ((left / run.dt).round() as usize).min(run.len());
        begun.extend((samples > 0).then(|| run.slice(0, samples)));
        left -= samples as f64 * run.dt;
    }
    begun
}

/// Ends of the training and the validation block of a single run, as shares of its length.
const BLOCKS: [f64; 2] = [0.6, 0.8];
/// Smallest and largest share of all samples in a run for validation or test.
const SANE: std::ops::RangeInclusive<f64> = 0.04..=0.5;

/// Splits runs into training, validation and test.
///
/// Three runs and more: the last run is the test, the one before it the validation, all others the training. Runs of
/// suitable length replace very short or very long ones. Two runs: the second is the test, the last quarter of the
/// first the validation. A single or dominant run is split into contiguous blocks of 60, 20 and 20 %; all others are
/// training.
///
/// # Errors
/// If there are no runs or too few samples for three parts.
pub fn split_runs(runs: Vec<Trajectory>) -> Result<Split, LogError> {
    let total: usize = runs.iter().map(Trajectory::len).sum();
    let share = |run: &Trajectory| run.len() as f64 / total.max(1) as f64;
    let sane = |run: &Trajectory| SANE.contains(&share(run));
    match runs.len() {
        0 => Err(LogError::NoFiles),
        1 => blocks(&runs, 0),
        2 if sane(&runs[1]) => halves(&runs),
        2 => blocks_of_longest(&runs),
        n if sane(&runs[n - 1]) && sane(&runs[n - 2]) => {
            let note = format!(
                "split by run: test on {}, validation on {}, training on {} others",
                runs[n - 1].name,
                runs[n - 2].name,
                n - 2
            );
            Ok(take(runs, n - 2, n - 1, Note::info(note)))
        }
        _ => {
            let mut fit = (0..runs.len()).rev().filter(|&i| sane(&runs[i]));
            if let (Some(test), Some(validation)) = (fit.next(), fit.next()) {
                let note = format!(
                    "split by run: test on {}, validation on {}; the last runs are too short or too long for validation and test",
                    runs[test].name, runs[validation].name
                );
                Ok(take(runs, validation, test, Note::info(note)))
            } else {
                blocks_of_longest(&runs)
            }
        }
    }
}

/// The run on which a search among at least three runs chooses its settings: the last one of suitable length. `None` if
/// there are fewer runs, or none is suitable.
pub(crate) fn validation_run(runs: &[Trajectory]) -> Option<usize> {
    let total: usize = runs.iter().map(Trajectory::len).sum();
    let sane = |i: &usize| SANE.contains(&(runs[*i].len() as f64 / total.max(1) as f64));
    (0..runs.len()).rev().find(sane).filter(|_| runs.len() >= 3)
}

/// Splits runs with given roles. Without test runs, all runs are split as by [`split_runs`] (there must be no
/// validation runs); without validation runs, the validation is the last quarter of the longest training run.
///
/// # Errors
/// If there is no training or no test run, or too few samples.
pub fn split_named(
    mut train: Vec<Trajectory>,
    validation: Vec<Trajectory>,
    test: Vec<Trajectory>,
) -> Result<Split, LogError> {
    match (validation.is_empty(), test.is_empty()) {
        (true, true) => split_runs(train),
        (false, true) => Err(LogError::NoTest),
        (false, false) if train.is_empty() => Err(LogError::NoFiles),
        (false, false) => Ok(Split { train, validation, test, notes: Vec::new() }),
        (true, false) => {
            let longest = (0..train.len()).max_by_key(|&i| train[i].len()).ok_or(LogError::NoFiles)?;
            let run = train.remove(longest);
            let at = run.len() * 3 / 4;
            long_enough(std::slice::from_ref(&run), &[at, run.len() - at])?;
            let note = format!("no validation log is given: validation on the last quarter of {}", run.name);
            train.insert(longest, run.slice(0, at));
            let validation = vec![run.slice(at, run.len())];
            let remedy = format!("give separate validation logs with {}", key("validate"));
            let notes = vec![Note::info(note).with_remedy(remedy)];
            Ok(Split { train, validation, test, notes })
        }
    }
}

fn take(runs: Vec<Trajectory>, validation: usize, test: usize, note: Note) -> Split {
    let mut split = Split { train: Vec::new(), validation: Vec::new(), test: Vec::new(), notes: vec![note] };
    for (i, run) in runs.into_iter().enumerate() {
        let part = if i == test {
            &mut split.test
        } else if i == validation {
            &mut split.validation
        } else {
            &mut split.train
        };
        part.push(run);
    }
    split
}

fn halves(runs: &[Trajectory]) -> Result<Split, LogError> {
    let at = runs[0].len() * 3 / 4;
    long_enough(runs, &[at, runs[0].len() - at, runs[1].len()])?;
    let note =
        format!("two runs: test on {}, validation on the last quarter of {}", runs[1].name, runs[0].name);
    let remedy = "a third run would make the validation independent of the training";
    Ok(Split {
        train: vec![runs[0].slice(0, at)],
        validation: vec![runs[0].slice(at, runs[0].len())],
        test: runs[1..].to_vec(),
        notes: vec![Note::info(note).with_remedy(remedy)],
    })
}

fn blocks_of_longest(runs: &[Trajectory]) -> Result<Split, LogError> {
    let longest = (0..runs.len()).max_by_key(|&i| runs[i].len()).unwrap_or(0);
    blocks(runs, longest)
}

/// Splits the run `longest` into three contiguous blocks; all other runs are training.
fn blocks(runs: &[Trajectory], longest: usize) -> Result<Split, LogError> {
    let run = &runs[longest];
    let [a, b] = BLOCKS.map(|share| super::grid::truncate(run.len() as f64 * share));
    long_enough(runs, &[a, b - a, run.len() - b])?;
    let note =
        format!("{} is split into contiguous blocks: 60 % training, 20 % validation, 20 % test", run.name);
    let remedy =
        "separate runs are a stricter test, because wind, load and sensors are the same within one run";
    let (validation, test) = (vec![run.slice(a, b)], vec![run.slice(b, run.len())]);
    let train =
        runs.iter().enumerate().map(|(i, r)| if i == longest { r.slice(0, a) } else { r.clone() }).collect();
    Ok(Split { train, validation, test, notes: vec![Note::warning(note).with_remedy(remedy)] })
}

fn long_enough(runs: &[Trajectory], parts: &[usize]) -> Result<(), LogError> {
    match parts.iter().min() {
        Some(&shortest) if shortest < FEWEST_SAMPLES => Err(LogError::TooShort {
            path: runs.iter().map(|r| r.name.as_str()).take(3).collect::<Vec<_>>().join(", "),
            found: runs.iter().map(Trajectory::len).sum(),
            needed: 5 * FEWEST_SAMPLES,
            remedy: "the samples are too few for training, validation and test: record for longer".to_owned(),
        }),
        _ => Ok(()),
    }
}
