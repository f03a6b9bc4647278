//! Cross-validation over runs: each fold is predicted by models that were fitted without it.

use std::borrow::Cow;

use crate::committee::folds::{Segment, folds};
use crate::log::{Trajectory, validation_run};

/// The folds of an identification: runs, or contiguous blocks of one or two runs.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossValidation {
    parts: Vec<Part>,
    folds: usize,
    /// Runs on which a search chooses its settings.
    validation: Validation,
}

#[derive(Clone, Debug, PartialEq)]
struct Part {
    run: usize,
    from: usize,
    to: usize,
    fold: usize,
    /// The block; the whole run if there is none.
    block: Option<Trajectory>,
}

#[derive(Clone, Debug, PartialEq)]
enum Validation {
    Run(usize),
    /// The last quarter of the longest run.
    Quarter(Box<Quarter>),
}

#[derive(Clone, Debug, PartialEq)]
struct Quarter {
    run: usize,
    before: Trajectory,
    after: Trajectory,
}

impl CrossValidation {
    pub(crate) fn new(runs: &[Trajectory]) -> Self {
        let all: Vec<&Trajectory> = runs.iter().collect();
        let folds = folds(&all, 0);
        let part = |fold: usize, segment: &Segment<'_>| {
            let Segment { run, from, to } = *segment;
            let block = (from > 0 || to < run.len()).then(|| Trajectory {
                name: format!("{}, {:.0} to {:.0} s", run.name, from as f64 * run.dt, to as f64 * run.dt),
                ..run.slice(from, to)
            });
            let index = all.iter().position(|known| std::ptr::eq(*known, run));
            Part { run: index.unwrap_or(0), from, to, fold, block }
        };
        let mut parts: Vec<Part> = folds
            .iter()
            .enumerate()
            .flat_map(|(fold, of)| of.segments.iter().map(move |segment| part(fold, segment)))
            .collect();
        // Blocks of a run stay in the order of time.
        parts.sort_by_key(|part| (part.run, part.from));
        let quarter = || {
            let run = (0..runs.len()).max_by_key(|&i| runs[i].len()).unwrap_or(0);
            let at = runs[run].len() * 3 / 4;
            let (before, after) = (runs[run].slice(0, at), runs[run].slice(at, runs[run].len()));
            Validation::Quarter(Box::new(Quarter { run, before, after }))
        };
        let validation = validation_run(runs).map_or_else(quarter, Validation::Run);
        Self { parts, folds: folds.len(), validation }
    }

    /// Number of folds.
    pub fn folds(&self) -> usize {
        self.folds
    }

    /// Whether the folds are blocks of one or two runs.
    pub fn has_blocks(&self) -> bool {
        self.parts.iter().any(|part| part.block.is_some())
    }

    /// Runs or blocks, each with its fold; `runs` are those of the identification.
    pub fn runs<'a>(&'a self, runs: &'a [Trajectory]) -> Vec<(usize, &'a Trajectory)> {
        let run = |part: &'a Part| (part.fold, part.block.as_ref().unwrap_or(&runs[part.run]));
        self.parts.iter().map(run).collect()
    }

    /// The runs without one fold. Neighbouring blocks are joined.
    pub(super) fn without<'a>(&self, fold: usize, runs: &'a [Trajectory]) -> Vec<Cow<'a, Trajectory>> {
        let mut joined: Vec<(usize, usize, usize)> = Vec::new();
        for part in self.parts.iter().filter(|part| part.fold != fold) {
            match joined.last_mut() {
                Some((run, _, to)) if *run == part.run && *to == part.from => *to = part.to,
                _ => joined.push((part.run, part.from, part.to)),
            }
        }
        let of = |(run, from, to): (usize, usize, usize)| {
            let whole = from == 0 && to == runs[run].len();
            if whole { Cow::Borrowed(&runs[run]) } else { Cow::Owned(runs[run].slice(from, to)) }
        };
        joined.into_iter().map(of).collect()
    }

    /// Training and validation runs of a search.
    pub(super) fn search<'a>(&'a self, runs: &'a [Trajectory]) -> [Vec<&'a Trajectory>; 2] {
        match &self.validation {
            Validation::Run(validation) => {
                let others = runs.iter().enumerate().filter(|(i, _)| i != validation);
                [others.map(|(_, run)| run).collect(), vec![&runs[*validation]]]
            }
            Validation::Quarter(of) => {
                let Quarter { run, before, after } = &**of;
                let train = runs.iter().enumerate().map(|(i, other)| if i == *run { before } else { other });
                [train.collect(), vec![after]]
            }
        }
    }
}
