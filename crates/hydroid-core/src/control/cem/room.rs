//! Memory for candidates side by side, whatever predicts them.

use alloc::boxed::Box;

use super::rollouts::{Each, Rollouts};
use crate::model::{direct, recurrent, sparse};
use crate::predict::{Predictor, Source, Workspace};

/// Memory in which the candidates of a session, or of others of the same model, are rolled out side by side.
#[derive(Clone, Debug)]
pub struct Room {
    sequences: usize,
    kind: Kind,
    /// Whether the session of the moment is one that it was made for.
    fits: bool,
    work: Workspace,
}

#[derive(Clone, Debug)]
enum Kind {
    Equations(Box<sparse::SideBySide>),
    Recurrent(Box<recurrent::SideBySide>),
    Direct(Box<direct::SideBySide>),
    /// Of the model that learned, and of the one from shore.
    Guarded(Box<[Room; 2]>),
    /// One after the other: vessels, control-affine networks, equations with past values and networks on them.
    Each,
}

impl Room {
    /// Room for so many candidates of a session at a time. A [`Planner`](super::Planner) asks for
    /// [`AT_A_TIME`](Self::AT_A_TIME).
    ///
    /// # Panics
    /// If it is for none.
    pub fn new(session: &dyn Predictor, sequences: usize) -> Self {
        assert!(sequences > 0, "room for no candidate: give one at least");
        let kind = match session.source() {
            Source::Equations(session) => sparse::SideBySide::new(session.equations(), sequences)
                .map(|room| Kind::Equations(Box::new(room))),
            Source::Recurrent(session) => {
                recurrent::SideBySide::new(session, sequences).map(|room| Kind::Recurrent(Box::new(room)))
            }
            Source::Direct(session) => {
                direct::SideBySide::new(session, sequences).map(|room| Kind::Direct(Box::new(room)))
            }
            Source::Guarded(guarded) => {
                Some(Kind::Guarded(Box::new(guarded.models().map(|model| Self::new(model, sequences)))))
            }
            Source::Own => None,
        };
        Self { sequences, kind: kind.unwrap_or(Kind::Each), fits: true, work: Workspace::new() }
    }

    /// Candidates that a planner rolls out at a time.
    pub const AT_A_TIME: usize = 64;

    /// Candidates that there is room for.
    pub const fn sequences(&self) -> usize {
        self.sequences
    }

    /// Whether candidates of the session that it was made for are rolled out side by side: not those of vessels with given
    /// parameters, of control-affine networks, of equations with past values, and of networks on such equations.
    pub fn is_side_by_side(&self) -> bool {
        match &self.kind {
            Kind::Each => false,
            Kind::Guarded(rooms) => rooms.iter().all(Self::is_side_by_side),
            _ => true,
        }
    }

    /// Takes the moment of a session. One of another model is rolled out one by one, rather than as another.
    pub(super) fn begin(&mut self, session: &dyn Predictor) {
        self.fits = match (&mut self.kind, session.source()) {
            (Kind::Equations(room), Source::Equations(session)) => room.fits(session.equations()),
            (Kind::Recurrent(room), Source::Recurrent(session)) => room.begin(session),
            (Kind::Direct(room), Source::Direct(session)) => room.begin(session),
            (Kind::Guarded(rooms), Source::Guarded(guarded)) => {
                rooms.iter_mut().zip(guarded.models()).for_each(|(room, model)| room.begin(model));
                true
            }
            _ => false,
        };
    }

    /// Rolls out `count` candidates of the session that was begun with.
    pub(super) fn rollouts(
        &mut self,
        session: &dyn Predictor,
        count: usize,
        commands: &[f64],
        y: &mut [f64],
    ) {
        match (&mut self.kind, session.source()) {
            (Kind::Equations(room), Source::Equations(session)) if self.fits => {
                room.rollout(session.equations(), session.state(), count, commands, y);
            }
            (Kind::Recurrent(room), Source::Recurrent(_)) if self.fits => room.rollout(count, commands, y),
            (Kind::Direct(room), Source::Direct(_)) if self.fits => room.rollout(count, commands, y),
            (Kind::Guarded(rooms), Source::Guarded(guarded)) => {
                let ([learned, shore], [of_learned, of_shore]) = (guarded.models(), rooms.each_mut());
                if guarded.is_shore() {
                    return of_shore.rollouts(shore, count, commands, y);
                }
                let beside = self.work.take(y.len());
                of_learned.rollouts(learned, count, commands, y);
                of_shore.rollouts(shore, count, commands, beside);
                let len = y.len() / count;
                for (y, beside) in y.chunks_exact_mut(len).zip(beside.chunks_exact(len)) {
                    guarded.draw(y, beside);
                }
            }
            _ => Each::new(session, &mut self.work).rollouts(count, commands, y),
        }
    }
}
