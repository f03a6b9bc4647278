//! Events of a guard, with causes and values.

/// A model of the guard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Expert {
    /// The adapted model.
    #[default]
    Adapted,
    /// The reference model: the delivered weights with a state filter.
    Reference,
    /// The unguarded learner: the adapted model as it would be without a guard.
    Unguarded,
}

impl Expert {
    /// All experts.
    pub const ALL: [Self; 3] = [Self::Adapted, Self::Reference, Self::Unguarded];

    /// Index in [`ALL`](Self::ALL).
    pub fn index(self) -> usize {
        self as usize
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Adapted => "adapted",
            Self::Reference => "reference",
            Self::Unguarded => "unguarded",
        }
    }
}

/// An action of the guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Number of samples observed before this one, since construction.
    pub sample: u64,
    /// The action.
    pub action: Action,
}

/// Why a measurement is trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The unguarded learner predicts what is measured.
    Evidence,
    /// The budget of dead reckoning is spent.
    Budget,
}

/// Errors are means over the outputs of the absolute prediction error, each in half the width of its design
/// range, over [`horizon`](super::GuardOptions::horizon) samples: those of the unguarded learner against all measurements, the
/// others against the used ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// A hold begins with a jump: the measurement is not used until it agrees with the adapted model, or is trusted.
    Spike {
        /// The output.
        output: usize,
        /// Deviation, relative to the usual one.
        deviations: f64,
    },
    /// A hold begins with a value that the sensor repeats to the last bit.
    Stuck {
        /// The output.
        output: usize,
        /// Number of repetitions.
        repeats: usize,
    },
    /// A hold ends against the check: the measurement is used again.
    Trusted {
        /// The output.
        output: usize,
        /// Why.
        cause: Cause,
    },
    /// A hold ends: the measurement agrees with the adapted model again.
    Back {
        /// The output.
        output: usize,
        /// Number of samples that were not used.
        missing: usize,
    },
    /// Another model predicts.
    Switched {
        /// The active model.
        to: Expert,
        /// Errors in the last test, in the order of [`Expert::ALL`].
        errors: [f64; 3],
    },
    /// The adapted model starts again from the weights of the reference model.
    RolledBack {
        /// Errors in the last test, in the order of [`Expert::ALL`].
        errors: [f64; 3],
    },
    /// The memory of the adapted model was not sound and has been reset.
    Restarted,
}

impl Action {
    /// Name in reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Spike { .. } => "spike",
            Self::Stuck { .. } => "stuck",
            Self::Trusted { .. } => "trusted",
            Self::Back { .. } => "back",
            Self::Switched { .. } => "switched",
            Self::RolledBack { .. } => "rolled_back",
            Self::Restarted => "restarted",
        }
    }
}
