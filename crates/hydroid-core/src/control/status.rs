//! Status of a command.

/// Status of a command: the most severe condition, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Status {
    /// The command achieves the demand of the law.
    #[default]
    Tracking,
    /// A command is at its rate limit.
    RateLimited,
    /// A command is at its limit.
    Saturated,
    /// The distance from the reference exceeds the tolerance of the law.
    Lost,
    /// The vessel has little control authority in some direction (no rudder force at zero speed).
    Singular,
    /// Estimate or reference are not finite. The last command is held for a while, then brought to rest.
    Blind,
}

impl Status {
    /// All statuses.
    pub const ALL: [Self; 6] =
        [Self::Tracking, Self::RateLimited, Self::Saturated, Self::Lost, Self::Singular, Self::Blind];

    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::RateLimited => "rate_limited",
            Self::Saturated => "saturated",
            Self::Lost => "lost",
            Self::Singular => "singular",
            Self::Blind => "blind",
        }
    }

    /// The more severe status.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        self.max(other)
    }
}

impl core::fmt::Display for Status {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.pad(self.name())
    }
}
