//! Successive halving: all trials are scored on few origins, and the best ones on more.

use super::judge::{Judge, TrialScore};
use super::{EvaluatedTrial, Fitted, Search, SearchError, Trial, TrialSettings};
use crate::progress::Progress;
use crate::sindy::fit::Fit;
use crate::sindy::parsimony::BlockLosses;

/// Of the trials of a round, one in `HALVING` is scored again on `HALVING` times as many origins.
const HALVING: usize = 4;

/// Rounds before the last one, which uses all origins.
const ROUNDS: u32 = 2;

impl EvaluatedTrial {
    fn take(&mut self, judged: TrialScore, finalist: bool) {
        let finite = |x: f64| x.is_finite().then_some(x);
        self.trial.score = finite(judged.score);
        self.trial.validation = finite(judged.validation);
        self.trial.training = judged.training.and_then(finite);
        self.trial.diverged = judged.diverged;
        self.trial.finalist = finalist;
        self.losses = judged.losses;
    }
}

impl Fitted<'_> {
    fn tried(self, judged: TrialScore, finalist: bool) -> EvaluatedTrial {
        let TrialSettings { structure, regression, optimizer, ridge } = self.settings;
        let trial = Trial {
            structure: structure.clone(),
            regression,
            optimizer,
            ridge,
            terms: self.fit.equations.active_terms(),
            score: None,
            validation: None,
            training: None,
            diverged: 0,
            finalist,
        };
        let losses = BlockLosses::default();
        let mut tried = EvaluatedTrial { trial, fit: self.fit, losses, prepared: self.prepared };
        tried.take(judged, finalist);
        tried
    }
}

impl Search<'_> {
    /// Scores all trials on few origins and the best ones on more (successive halving: Jamieson and Talwalkar, AISTATS
    /// 2016, PMLR 51:240).
    pub(super) fn halve(
        &mut self,
        fitted: Vec<Fitted<'_>>,
        progress: Progress<'_>,
    ) -> Result<(), SearchError> {
        let mut left: Vec<(usize, Fitted<'_>)> = fitted.into_iter().enumerate().collect();
        let mut tried = Vec::with_capacity(left.len());
        for round in 0..=ROUNDS {
            let mut tell = |f: f64| progress((f64::from(round) + f) / f64::from(ROUNDS + 1));
            let fits: Vec<&Fit> = left.iter().map(|(_, fitted)| &fitted.fit).collect();
            let scores = match HALVING.pow(ROUNDS - round) {
                1 => self.judge.score_all(&fits, &mut tell)?,
                thinning => Judge::new(self.options, self.excerpts, thinning)?.score_all(&fits, &mut tell)?,
            };
            let mut order: Vec<usize> = (0..left.len()).collect();
            order.sort_by(|&a, &b| scores[a].score.total_cmp(&scores[b].score));
            let bounded = scores.iter().filter(|score| score.score.is_finite()).count();
            let kept = if round == ROUNDS { 0 } else { order.len().div_ceil(HALVING).min(bounded) };
            let mut goes_on = vec![false; left.len()];
            order.iter().take(kept).for_each(|&i| goes_on[i] = true);
            let mut next = Vec::with_capacity(kept);
            for (((index, fitted), score), goes_on) in left.into_iter().zip(scores).zip(goes_on) {
                if goes_on {
                    next.push((index, fitted));
                } else {
                    tried.push((index, fitted.tried(score, round == ROUNDS)));
                }
            }
            left = next;
        }
        tried.sort_by_key(|(index, _)| *index);
        self.tried = tried.into_iter().map(|(_, tried)| tried).collect();
        if self.finalists().next().is_none() {
            self.score_the_others(progress)?;
        }
        Ok(())
    }

    /// Scores the trials on all origins that did not diverge on a part of them.
    fn score_the_others(&mut self, progress: Progress<'_>) -> Result<(), SearchError> {
        let others: Vec<usize> =
            (0..self.tried.len()).filter(|&i| self.tried[i].trial.score.is_some()).collect();
        let fits: Vec<&Fit> = others.iter().map(|&i| &self.tried[i].fit).collect();
        let scores = self.judge.score_all(&fits, progress)?;
        for (i, score) in others.into_iter().zip(scores) {
            self.tried[i].take(score, true);
        }
        Ok(())
    }
}
