//! What a guard did, and why.

/// Which model a prediction is made with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Expert {
    /// The one that learns.
    #[default]
    Learner,
    /// The last good snapshot of it.
    Kept,
    /// The one from shore, its state filtered.
    Frozen,
}

impl Expert {
    /// All, in the order in which they are preferred.
    pub const ALL: [Self; 3] = [Self::Learner, Self::Kept, Self::Frozen];

    /// Its place among [`ALL`](Self::ALL).
    pub fn index(self) -> usize {
        self as usize
    }

    /// One word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Learner => "adapted",
            Self::Kept => "snapshot",
            Self::Frozen => "frozen",
        }
    }
}

/// Something that a guard did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Samples observed before this one, since the guard was made.
    pub sample: u64,
    /// What.
    pub action: Action,
}

/// Errors are means over the outputs of the absolute difference from what was measured, each in half the width of its design
/// range, over [`horizon`](super::GuardOptions::horizon) samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// An output farther off than anything that was usual: not used.
    Spike {
        /// The output.
        output: usize,
        /// The jump of its innovation, in usual deviations of that.
        deviations: f64,
    },
    /// An output was used as one with so many times the noise variance.
    Inflated {
        /// The output.
        output: usize,
        /// The jump of its innovation, in usual deviations of that.
        deviations: f64,
        /// Of the variance.
        factor: f64,
    },
    /// An output repeats itself to the last bit: not used from here on.
    Stuck {
        /// The output.
        output: usize,
        /// How often it did.
        repeats: usize,
    },
    /// An output jumped and stayed off by the same: the offset is taken from it from here on.
    Offset {
        /// The output.
        output: usize,
        /// In all, in its unit.
        offset: f64,
    },
    /// What was taken for a fault lasted, and moves as a vessel does: it is believed.
    Believed {
        /// The output.
        output: usize,
        /// The jump of its innovation, in usual deviations of that.
        deviations: f64,
    },
    /// An output is used again.
    Back {
        /// The output.
        output: usize,
        /// Samples that it was not.
        missing: usize,
    },
    /// Command or outputs are far outside the design range: nothing is learned there.
    Outside {
        /// Outputs first, then inputs.
        channel: usize,
        /// Distance from the range, in its width.
        distance: f64,
    },
    /// Inside again: learning goes on.
    Inside,
    /// Predictions are made by another model.
    Switched {
        /// From here on.
        to: Expert,
        /// Why.
        cause: Cause,
        /// Error of the model that was used, and of the one from shore.
        errors: [f64; 2],
    },
    /// The weights went back to those of the snapshot, or of the shore.
    RolledBack {
        /// Whose weights.
        to: Expert,
        /// Record of the learner, and of the model that its weights are of now.
        errors: [f64; 2],
    },
    /// The covariance was not sound, and is as at the start.
    Restarted,
    /// A snapshot of the weights was taken.
    Kept {
        /// Record of the learner.
        error: f64,
    },
}

/// Why another model predicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Its predictions were better of late.
    Record,
    /// The one in use has just failed a test.
    Test,
    /// What the guarantee leaves is nearly used up.
    Guarantee,
    /// The one in use gives numbers that are none.
    NotFinite,
}

impl Action {
    /// One word for it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Spike { .. } => "spike",
            Self::Inflated { .. } => "inflated",
            Self::Stuck { .. } => "stuck",
            Self::Offset { .. } => "offset",
            Self::Believed { .. } => "believed",
            Self::Back { .. } => "back",
            Self::Outside { .. } => "outside",
            Self::Inside => "inside",
            Self::Switched { .. } => "switched",
            Self::RolledBack { .. } => "rolled_back",
            Self::Restarted => "restarted",
            Self::Kept { .. } => "kept",
        }
    }
}
