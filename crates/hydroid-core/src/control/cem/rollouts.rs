//! What candidates do, as a model predicts it.

use crate::control::cem::Room;
use crate::predict::{Predictor, Workspace};

/// Predictions for many command sequences from one moment.
pub trait Rollouts {
    /// Number of outputs.
    fn outputs(&self) -> usize;

    /// Number of commands.
    fn inputs(&self) -> usize;

    /// The outputs of the moment \[units of the model\].
    fn now(&self, y: &mut [f64]);

    /// Predicts `count` candidates side by side: `commands` are `count x horizon x inputs`, `y` are `count x horizon x
    /// outputs`. What blows up gives numbers that are not finite, never a panic.
    fn rollouts(&mut self, count: usize, commands: &[f64], y: &mut [f64]);
}

/// One candidate after the other, of any [`Predictor`].
#[derive(Debug)]
pub struct Each<'a, P: ?Sized> {
    session: &'a P,
    work: &'a mut Workspace,
}

impl<'a, P: Predictor + ?Sized> Each<'a, P> {
    /// Of a session as it stands; the workspace is kept by the caller, so that nothing is allocated from plan to plan.
    pub fn new(session: &'a P, work: &'a mut Workspace) -> Self {
        Self { session, work }
    }
}

impl<P: Predictor + ?Sized> Rollouts for Each<'_, P> {
    fn outputs(&self) -> usize {
        self.session.outputs()
    }

    fn inputs(&self) -> usize {
        self.session.inputs()
    }

    fn now(&self, y: &mut [f64]) {
        self.session.output(y);
    }

    fn rollouts(&mut self, count: usize, commands: &[f64], y: &mut [f64]) {
        let (of_commands, of_outputs) = (commands.len() / count, y.len() / count);
        for (commands, y) in commands.chunks_exact(of_commands).zip(y.chunks_exact_mut(of_outputs)) {
            self.session.rollout(commands, self.work, y);
        }
    }
}

/// Candidates side by side, of any [`Predictor`]: those whose rollouts are made by equations, recurrent networks or direct
/// predictors with the state and the weights of the moment, sessions that learn and a guard among them. What cannot be rolled
/// out so comes one after the other ([`Room::is_side_by_side`]).
pub struct Abreast<'a> {
    session: &'a dyn Predictor,
    room: &'a mut Room,
}

impl<'a> Abreast<'a> {
    /// Of a session as it stands; the room is kept by the caller, so that nothing is allocated from plan to plan.
    pub fn new(session: &'a dyn Predictor, room: &'a mut Room) -> Self {
        room.begin(session);
        Self { session, room }
    }
}

impl core::fmt::Debug for Abreast<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Abreast").field("room", &self.room).finish_non_exhaustive()
    }
}

impl Rollouts for Abreast<'_> {
    fn outputs(&self) -> usize {
        self.session.outputs()
    }

    fn inputs(&self) -> usize {
        self.session.inputs()
    }

    fn now(&self, y: &mut [f64]) {
        self.session.output(y);
    }

    fn rollouts(&mut self, count: usize, commands: &[f64], y: &mut [f64]) {
        let (of_commands, of_outputs) = (commands.len() / count, y.len() / count);
        let room = self.room.sequences();
        let pieces = commands.chunks(room * of_commands).zip(y.chunks_mut(room * of_outputs));
        for (commands, y) in pieces {
            self.room.rollouts(self.session, y.len() / of_outputs, commands, y);
        }
    }
}
