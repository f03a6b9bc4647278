//! Committees of difference equations. File: for the member `k` the tensors `coefficients.k` (outputs x terms) and, if it
//! learns, `r_factor.k` (terms x terms), for the member `k` of the frozen committee `constant.k`; terms, clock steps and
//! votes are in the head.

use std::sync::Arc;

use hydroid_core::adapt::{Adapter, CommitteeSession};
use hydroid_core::model::committee::{Committee, DifferenceEquations, Member, Prior, Shape};
use hydroid_core::model::sparse::Term;
use hydroid_core::predict::Predictor;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::{Body, Encoded, Kind};
use crate::model::file::{numbers, tensor};
use crate::model::{Description, Members, Model};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::model) struct Structure {
    members: Vec<MemberStructure>,
    /// Members of the frozen committee.
    constant: Vec<MemberStructure>,
    /// Training ranges of the outputs (low, high); predictions have no limits without them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    ranges: Vec<(f64, f64)>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MemberStructure {
    terms: Vec<Term>,
    /// Past clock steps among the variables.
    lags: usize,
    /// Samples of a clock step.
    clock: usize,
    votes: u32,
    /// For a member that learns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    learning: Option<LearningStructure>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LearningStructure {
    /// Clock steps over which a row is averaged.
    averaging: usize,
    /// Weight of the training rows.
    information: f64,
}

/// A member of a committee with the names of its terms.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NamedMember {
    /// Number of votes.
    pub votes: u32,
    /// Clock step \[s\].
    pub clock_s: f64,
    /// Past clock steps among the variables.
    pub past_steps: usize,
    /// Names of the terms; `u(-1 s)` is the output `u` one second ago, and the name of an input its mean over a clock
    /// step.
    pub terms: Vec<String>,
    /// Coefficients \[unit of the output per second\], a row for each output.
    pub coefficients: Vec<Vec<f64>>,
    /// Whether it learns along a run.
    pub learns: bool,
}

impl Model {
    /// The members of a committee; empty for other models.
    #[doc(hidden)]
    pub fn named_members(&self) -> Vec<NamedMember> {
        let Some(committee) = self.committee() else { return Vec::new() };
        let ports = || self.description.outputs.iter().chain(&self.description.inputs);
        let named = |Member { equations, votes, prior }: &Member| {
            let shape = equations.shape();
            let clock_s = shape.clock as f64 * shape.dt;
            let name = |lag: usize, name: &str| match lag {
                0 => name.to_owned(),
                lag => format!("{name}(-{} s)", (lag as f64 * clock_s * 1e3).round() / 1e3),
            };
            let names: Vec<String> = (0..=shape.lags)
                .flat_map(|lag| ports().map(move |port| name(lag, &port.channel.name)))
                .collect();
            NamedMember {
                votes: *votes,
                clock_s,
                past_steps: shape.lags,
                terms: equations.terms().iter().map(|term| term.name(&names)).collect(),
                coefficients: equations
                    .coefficients()
                    .chunks(equations.terms().len().max(1))
                    .map(<[f64]>::to_vec)
                    .collect(),
                learns: prior.is_some(),
            }
        };
        committee.members().iter().map(named).collect()
    }
}

fn coefficients(member: usize) -> String {
    format!("coefficients.{member}")
}

fn constant(member: usize) -> String {
    format!("constant.{member}")
}

fn r_factor(member: usize) -> String {
    format!("r_factor.{member}")
}

impl Structure {
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let (outputs, inputs, dt) = (description.outputs.len(), description.inputs.len(), description.dt);
        let member =
            |name: fn(usize) -> String, k: usize, member: MemberStructure| -> Result<Member, String> {
                let MemberStructure { terms, lags, clock, votes, learning } = member;
                let count = terms.len();
                let own = numbers(tensors, &name(k), &[outputs, count])?;
                let shape = Shape { outputs, inputs, lags, clock, dt };
                let equations =
                    DifferenceEquations::new(terms, own, shape).map_err(|error| error.to_string())?;
                let prior = match learning {
                    Some(LearningStructure { averaging, information }) => {
                        let r_factor = numbers(tensors, &r_factor(k), &[count, count])?;
                        Some(Prior { averaging, information, r_factor })
                    }
                    None => None,
                };
                Ok(Member { equations, votes, prior })
            };
        let read =
            |name: fn(usize) -> String, members: Vec<MemberStructure>| -> Result<Vec<Member>, String> {
                members.into_iter().enumerate().map(|(k, of)| member(name, k, of)).collect()
            };
        let (members, frozen) = (read(coefficients, self.members)?, read(constant, self.constant)?);
        let committee = Committee::new(members).and_then(|committee| committee.with_constant(frozen));
        let committee = committee.and_then(|committee| {
            if self.ranges.is_empty() { Ok(committee) } else { committee.with_ranges(self.ranges) }
        });
        let committee = Arc::new(committee.map_err(|error| error.to_string())?);
        // The session checks the priors.
        CommitteeSession::new(Arc::clone(&committee)).map_err(|error| error.to_string())?;
        Ok(Model {
            description,
            body: Body::Committee(committee),
            members: Members::default(),
            learning: None,
        })
    }
}

/// # Panics
/// If the prior of a member is singular, which reading and training exclude.
fn learner(committee: &Arc<Committee>) -> CommitteeSession {
    CommitteeSession::new(Arc::clone(committee)).unwrap_or_else(|error| panic!("{error}"))
}

impl Kind for Arc<Committee> {
    fn name(&self, _: &Model) -> &'static str {
        "committee"
    }

    fn title(&self, _: &Model) -> &'static str {
        "A committee of difference equations that predicts with their weighted median"
    }

    fn weights(&self) -> usize {
        self.members().iter().map(|member| member.equations.coefficients().len()).sum()
    }

    fn session(&self, _: &Model) -> Box<dyn Predictor> {
        Box::new(learner(self))
    }

    fn learning_session(&self, _: &Model) -> Option<Box<dyn Adapter>> {
        let learns = self.members().iter().any(|member| member.prior.is_some());
        learns.then(|| -> Box<dyn Adapter> { Box::new(learner(self)) })
    }

    fn encode(&self, _: &Model) -> Result<Encoded, String> {
        let mut tensors = Vec::new();
        let mut encode = |name: fn(usize) -> String, all: &[Member]| -> Vec<MemberStructure> {
            let mut members = Vec::new();
            for (k, Member { equations, votes, prior }) in all.iter().enumerate() {
                let (terms, shape) = (equations.terms(), equations.shape());
                let count = terms.len();
                tensors.push(tensor(&name(k), vec![shape.outputs, count], equations.coefficients()));
                if let Some(prior) = prior {
                    tensors.push(tensor(&r_factor(k), vec![count, count], &prior.r_factor));
                }
                let learning = prior.as_ref().map(|&Prior { averaging, information, .. }| {
                    LearningStructure { averaging, information }
                });
                let (lags, clock, votes) = (shape.lags, shape.clock, *votes);
                members.push(MemberStructure { terms: terms.to_vec(), lags, clock, votes, learning });
            }
            members
        };
        let members = encode(coefficients, self.members());
        let constant = encode(constant, self.constant_members());
        let structure = Structure { members, constant, ranges: self.ranges().to_vec() };
        Ok(Encoded::Tensors(super::Structure::Committee(structure), tensors))
    }

    fn network_text(&self, _: &Description) -> Vec<String> {
        let votes: u32 = self.members().iter().map(|member| member.votes).sum();
        let first = format!("{} members with {votes} votes:", self.members().len());
        let member = |Member { equations, votes, prior }: &Member| {
            let shape = equations.shape();
            let learns = match prior {
                Some(prior) => format!(
                    "learns along a run (training rows with weight {}, rows over {:.3} s)",
                    prior.information,
                    (prior.averaging * shape.clock) as f64 * shape.dt
                ),
                None => String::from("constant coefficients"),
            };
            format!(
                "  votes {votes:>2}, {:>3} terms, {} past values, clock step {:.3} s, {learns}",
                equations.terms().len(),
                shape.lags,
                shape.clock as f64 * shape.dt
            )
        };
        let frozen = format!("frozen: {} members with constant coefficients", self.constant_members().len());
        let lines = std::iter::once(first).chain(self.members().iter().map(member));
        lines.chain(std::iter::once(frozen)).collect()
    }
}
