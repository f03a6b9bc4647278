//! A model that runs on its own predictions.

use hydroid_core::model::committee::{CommitteeSimulation, Past};
use hydroid_core::predict::Predictor;
use hydroid_core::rate_limit::RateLimiter;

use crate::model::Model;

/// A model of any kind that predicts its next outputs from its own, sample by sample, behind the rate limits of its inputs.
///
/// Outputs are those of the model with constant weights: for a model with an estimate of the current, the motion through the
/// water. A [`Simulation`](super::Simulation) adds the pose.
#[derive(Debug)]
pub struct FreeRun {
    session: Session,
    /// Actuators in front of the model.
    limiter: Option<RateLimiter>,
    dt: f64,
    y: Vec<f64>,
    /// Positions of the actuators.
    positions: Vec<f64>,
    /// Samples that a session observes at the start.
    warm_up: usize,
}

enum Session {
    Predictor(Box<dyn Predictor>),
    Committee(CommitteeSimulation),
}

impl Session {
    fn snapshot_len(&self) -> usize {
        match self {
            Self::Predictor(session) => session.snapshot_len(),
            Self::Committee(committee) => committee.snapshot_len(),
        }
    }
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Predictor(_) => f.write_str("Predictor"),
            Self::Committee(committee) => committee.fmt(f),
        }
    }
}

impl Clone for FreeRun {
    fn clone(&self) -> Self {
        let session = match &self.session {
            Session::Predictor(session) => Session::Predictor(session.fork()),
            Session::Committee(committee) => Session::Committee(committee.clone()),
        };
        let Self { limiter, y, positions, .. } = self;
        Self { session, limiter: limiter.clone(), y: y.clone(), positions: positions.clone(), ..*self }
    }
}

impl FreeRun {
    /// A run of a model with constant weights. [`start`](Self::start) or [`start_after`](Self::start_after) begins it.
    pub fn new(model: &Model) -> Self {
        match model.committee() {
            Some(committee) => Self::of_committee(model, CommitteeSimulation::new(committee)),
            None => Self::of_session(model, model.motion_session()),
        }
    }

    /// A run for each member of the model's ensemble or committee.
    pub(super) fn of_members(model: &Model) -> Vec<Self> {
        if let Some(committee) = model.committee() {
            let members = CommitteeSimulation::members_of(committee).into_iter();
            return members.map(|simulation| Self::of_committee(model, simulation)).collect();
        }
        model.member_motion_sessions().into_iter().map(|session| Self::of_session(model, session)).collect()
    }

    fn of_committee(model: &Model, simulation: CommitteeSimulation) -> Self {
        // Its members have constant coefficients: others than those that adapt, with other pasts.
        let warm_up = simulation.committee().span() + 1;
        Self::with(model, Session::Committee(simulation), warm_up)
    }

    fn of_session(model: &Model, session: Box<dyn Predictor>) -> Self {
        let warm_up = session.warm_up().max(1);
        Self::with(model, Session::Predictor(session), warm_up)
    }

    fn with(model: &Model, session: Session, warm_up: usize) -> Self {
        Self {
            session,
            limiter: model.rate_limiter(),
            positions: vec![f64::NAN; model.description.inputs.len()],
            dt: model.description.dt,
            y: vec![f64::NAN; model.description.outputs.len()],
            warm_up,
        }
    }

    /// Sample time \[s\].
    pub const fn dt(&self) -> f64 {
        self.dt
    }

    /// Number of samples on which predictions depend at least, the present one included.
    pub const fn warm_up(&self) -> usize {
        self.warm_up
    }

    /// Present outputs.
    pub fn outputs(&self) -> &[f64] {
        &self.y
    }

    /// Starts in a steady motion with the outputs `y`: the command `c` has been held for a long time.
    ///
    /// # Panics
    /// If `y` or `c` have another length than outputs and inputs.
    pub fn start(&mut self, y: &[f64], c: &[f64]) {
        let rows = self.warm_up;
        self.start_after(&y.repeat(rows), &c.repeat(rows - 1));
        if let Some(limiter) = &mut self.limiter {
            limiter.advance(&mut c.to_vec());
        }
    }

    /// Starts after a past: rows of outputs, the last of which is the present, and the commands between them.
    ///
    /// # Panics
    /// If there are fewer rows than [`warm_up`](Self::warm_up), or one command too many or too few.
    pub fn start_after(&mut self, outputs: &[f64], commands: &[f64]) {
        let n = self.y.len();
        let rows = outputs.len() / n;
        assert!(rows >= self.warm_up, "a past of {} samples is needed", self.warm_up);
        self.y.copy_from_slice(&outputs[(rows - 1) * n..]);
        let mut positions = commands.to_vec();
        if let Some(limiter) = &mut self.limiter {
            limiter.reset();
            positions.chunks_exact_mut(self.positions.len()).for_each(|row| limiter.advance(row));
        }
        let commands = &positions[..];
        match &mut self.session {
            Session::Committee(committee) => committee.start(Past { outputs, inputs: commands }),
            Session::Predictor(session) => {
                let inputs = session.inputs();
                assert_eq!(commands.len(), (rows - 1) * inputs, "a command between two samples");
                session.reset();
                for (k, y) in outputs.chunks_exact(n).enumerate() {
                    session.observe(y);
                    if k + 1 < rows {
                        session.advance(&commands[k * inputs..][..inputs]);
                    }
                }
            }
        }
    }

    /// The next sample, with the command `c` held up to it.
    ///
    /// # Panics
    /// If `c` has another length than the inputs.
    pub fn advance(&mut self, c: &[f64]) {
        self.positions.copy_from_slice(c);
        if let Some(limiter) = &mut self.limiter {
            limiter.advance(&mut self.positions);
        }
        match &mut self.session {
            Session::Committee(committee) => committee.advance(&self.positions, &mut self.y),
            Session::Predictor(session) => {
                session.advance(&self.positions);
                session.output(&mut self.y);
            }
        }
    }

    /// Adds a disturbance to the outputs.
    pub(super) fn shift(&mut self, by: &[f64]) {
        self.y.iter_mut().zip(by).for_each(|(y, by)| *y += by);
        match &mut self.session {
            Session::Predictor(session) => session.observe(&self.y),
            Session::Committee(committee) => committee.shift(by),
        }
    }

    /// Length of a snapshot; constant over the life of a run.
    pub fn snapshot_len(&self) -> usize {
        let limited = self.limiter.as_ref().map_or(0, |limiter| limiter.positions().len());
        self.session.snapshot_len() + limited + self.y.len()
    }

    /// Copies all numbers on which predictions depend into `into`: the snapshot of the model's session first, then the
    /// positions of actuators with a limited rate, then the outputs.
    ///
    /// # Panics
    /// If `into` has not [`snapshot_len`](Self::snapshot_len) numbers.
    pub fn snapshot(&self, into: &mut [f64]) {
        let (session, rest) = into.split_at_mut(self.session.snapshot_len());
        match &self.session {
            Session::Predictor(of) => of.snapshot(session),
            Session::Committee(of) => of.snapshot(session),
        }
        let (limited, y) = rest.split_at_mut(rest.len() - self.y.len());
        if let Some(limiter) = &self.limiter {
            limited.copy_from_slice(limiter.positions());
        }
        y.copy_from_slice(&self.y);
    }

    /// Restores a snapshot of a run of the same model.
    ///
    /// # Panics
    /// If `from` has not [`snapshot_len`](Self::snapshot_len) numbers.
    pub fn restore(&mut self, from: &[f64]) {
        let (session, rest) = from.split_at(self.session.snapshot_len());
        match &mut self.session {
            Session::Predictor(of) => of.restore(session),
            Session::Committee(of) => of.restore(session),
        }
        let (limited, y) = rest.split_at(rest.len() - self.y.len());
        if let Some(limiter) = &mut self.limiter {
            limiter.restore(limited);
        }
        self.y.copy_from_slice(y);
    }
}
