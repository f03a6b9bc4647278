//! A committee: difference equations whose predictions are combined by a weighted median.
//!
//! Each member is a set of [`DifferenceEquations`] with a number of votes. A prediction of the committee is, for each
//! output and sample, the weighted median of the rollouts of the members, so that a member that runs away has no effect
//! as long as the other members hold more than half of the votes. Members are chosen with replacement (Caruana,
//! Niculescu-Mizil, Crew and Ksikes, *Ensemble selection from libraries of models*, ICML 2004).
//!
//! A rollout stays sane outside the training data: it leaves neither the training range of an output nor its present value
//! by more than one width of that range, because the polynomials of a member can grow without bound there.
//!
//! A member may continue to learn along a run; see [`CommitteeSession`](crate::adapt::CommitteeSession).

mod difference;
mod simulation;

use alloc::vec::Vec;

use difference::MOST_PAST;
pub use difference::{DifferenceEquations, Limits, Past, Shape};
pub use simulation::CommitteeSimulation;

/// A member of a [`Committee`].
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Its equations.
    pub equations: DifferenceEquations,
    /// Number of votes.
    pub votes: u32,
    /// Prior of a member that learns along a run; `None` for constant coefficients.
    pub prior: Option<Prior>,
}

/// Prior of a member that learns: the training rows as information about its coefficients.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Clock steps over which a row is averaged.
    pub averaging: usize,
    /// Weight of the training rows relative to rows of the run.
    pub information: f64,
    /// Upper triangle `R` (`terms x terms`, row by row) with `R'R` the second moments of the terms over the training
    /// rows, ridge included.
    pub r_factor: Vec<f64>,
}

/// Largest number of members.
pub const MOST_MEMBERS: usize = 64;

/// A committee; see the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct Committee {
    members: Vec<Member>,
    /// Members of the frozen committee.
    constant: Vec<Member>,
    /// Training ranges of the outputs (low, high); without limits if empty.
    ranges: Vec<(f64, f64)>,
}

/// Reasons why a committee is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum CommitteeError {
    #[error("a committee has 1 to {MOST_MEMBERS} members, each with a vote")]
    Members,
    #[error("the members have different outputs, inputs or sample times")]
    Channels,
    /// Not one finite range of positive width for each output.
    #[error("the ranges of a committee are finite, one for each output")]
    Ranges,
    #[error("the prior of member {member} does not fit its terms, or is singular")]
    Prior { member: usize },
}

impl Committee {
    /// A committee of members. The [frozen](Self::frozen) committee has the same members without priors.
    ///
    /// # Errors
    /// If there are too few or too many members, one has no vote, or they do not fit together.
    pub fn new(members: Vec<Member>) -> Result<Self, CommitteeError> {
        let Some(first) = members.first() else { return Err(CommitteeError::Members) };
        if members.len() > MOST_MEMBERS || members.iter().any(|member| member.votes == 0) {
            return Err(CommitteeError::Members);
        }
        let channels = |member: &Member| {
            let shape = member.equations.shape();
            (shape.outputs, shape.inputs, shape.dt.to_bits())
        };
        if members.iter().any(|member| channels(member) != channels(first)) || channels(first).0 == 0 {
            return Err(CommitteeError::Channels);
        }
        let sound = |member: &Member| {
            let (terms, clock) = (member.equations.terms().len(), member.equations.shape().clock);
            member.prior.as_ref().is_none_or(|prior| {
                let samples = prior.averaging.saturating_mul(clock);
                terms > 0
                    && prior.r_factor.len() == terms * terms
                    && (1..=MOST_PAST).contains(&samples)
                    && prior.information.is_finite()
                    && prior.information > 0.0
            })
        };
        if let Some(member) = members.iter().position(|member| !sound(member)) {
            Err(CommitteeError::Prior { member })
        } else {
            let constant = members.iter().map(|member| Member { prior: None, ..member.clone() }).collect();
            Ok(Self { members, constant, ranges: Vec::new() })
        }
    }

    /// The committee with limited predictions: a rollout from the outputs `y` stays between `min(low, y) - (high - low)` and
    /// `max(high, y) + (high - low)` of the range (low, high) of each output.
    ///
    /// # Errors
    /// If there is not one finite range of positive width for each output.
    pub fn with_ranges(self, ranges: Vec<(f64, f64)>) -> Result<Self, CommitteeError> {
        let sound = |&(low, high): &(f64, f64)| low.is_finite() && high.is_finite() && low < high;
        if ranges.len() == self.outputs() && ranges.iter().all(sound) {
            Ok(Self { ranges, ..self })
        } else {
            Err(CommitteeError::Ranges)
        }
    }

    /// Training ranges of the outputs (low, high); empty if predictions have no limits.
    pub fn ranges(&self) -> &[(f64, f64)] {
        &self.ranges
    }

    /// Writes the limits of rollouts from the outputs `y`.
    pub(crate) fn limits(&self, y: &[f64], low: &mut [f64], high: &mut [f64]) {
        low.fill(f64::NEG_INFINITY);
        high.fill(f64::INFINITY);
        for (((low, high), range), y) in low.iter_mut().zip(high).zip(&self.ranges).zip(y) {
            let width = range.1 - range.0;
            *low = range.0.min(*y) - width;
            *high = range.1.max(*y) + width;
        }
    }

    /// The committee with other members for its [frozen](Self::frozen) form: equations that predict best with learned
    /// coefficients need not predict best with constant ones. Priors of the members are dropped.
    ///
    /// # Errors
    /// As [`new`](Self::new); if outputs, inputs or sample time differ from those of the members.
    pub fn with_constant(self, members: Vec<Member>) -> Result<Self, CommitteeError> {
        let other = Self::new(members)?;
        let channels = |of: &Self| (of.outputs(), of.inputs(), of.dt().to_bits());
        if channels(&self) != channels(&other) {
            return Err(CommitteeError::Channels);
        }
        Ok(Self { constant: other.constant, ..self })
    }

    /// The members.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.members[0].equations.shape().outputs
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.members[0].equations.shape().inputs
    }

    /// Sample time \[s\].
    pub fn dt(&self) -> f64 {
        self.members[0].equations.shape().dt
    }

    /// Samples before the present one on which predictions depend.
    pub fn span(&self) -> usize {
        self.members.iter().map(|member| member.equations.shape().span()).max().unwrap_or(0)
    }

    /// The committee of the members with constant coefficients.
    #[must_use]
    pub fn frozen(&self) -> Self {
        Self { members: self.constant.clone(), constant: self.constant.clone(), ranges: self.ranges.clone() }
    }

    /// The members of the [frozen](Self::frozen) committee.
    pub fn constant_members(&self) -> &[Member] {
        &self.constant
    }

    /// The committee with other coefficients of the members that learn, in their order. Its [frozen](Self::frozen) form
    /// has the same members, because the learned coefficients hold what the run showed.
    ///
    /// # Errors
    /// If the number of coefficients is wrong, or one is not finite.
    pub fn with_learned(&self, coefficients: &[f64]) -> Result<Self, crate::model::sparse::EquationsError> {
        let mut rest = coefficients;
        let expected = self.learned();
        if coefficients.len() != expected {
            return Err(crate::model::sparse::EquationsError::Shape { expected, given: coefficients.len() });
        }
        let mut members = self.members.clone();
        for member in members.iter_mut().filter(|member| member.prior.is_some()) {
            let of = &member.equations;
            let (own, others) = rest.split_at(of.coefficients().len());
            rest = others;
            member.equations = DifferenceEquations::new(of.terms().to_vec(), own.to_vec(), *of.shape())?;
        }
        let constant = members.iter().map(|member| Member { prior: None, ..member.clone() }).collect();
        Ok(Self { members, constant, ranges: self.ranges.clone() })
    }

    /// Number of coefficients of the members that learn.
    pub fn learned(&self) -> usize {
        let learning = self.members.iter().filter(|member| member.prior.is_some());
        learning.map(|member| member.equations.coefficients().len()).sum()
    }
}

/// The weighted median of `values`: half of the votes are below it, half above. The slice is sorted; values that are not
/// finite count as infinite.
pub fn weighted_median(values: &mut [(f64, u32)]) -> f64 {
    values.iter_mut().filter(|value| value.0.is_nan()).for_each(|value| value.0 = f64::INFINITY);
    values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let all: u64 = values.iter().map(|value| u64::from(value.1)).sum();
    let mut below = 0;
    for (i, &(value, votes)) in values.iter().enumerate() {
        below += u64::from(votes);
        if 2 * below > all {
            return value;
        }
        if 2 * below == all {
            return values.get(i + 1).map_or(value, |next| 0.5 * (value + next.0));
        }
    }
    f64::NAN
}
