//! How a command is to be trusted.

/// What a controller says of its command: the gravest that holds, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Status {
    /// The command does what the law asks for.
    #[default]
    Tracking,
    /// A command could not change as fast as the law asks for.
    RateLimited,
    /// A command is at its limit.
    Saturated,
    /// The vessel is farther from its reference than the tolerance of the law.
    Lost,
    /// The vessel can hardly be accelerated in some direction (no rudder force at no speed): what is asked for there is
    /// damped, and not reached.
    Singular,
    /// Estimate or reference are no numbers: the last command is held for a while, then brought to rest.
    Blind,
}

impl Status {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Tracking, Self::RateLimited, Self::Saturated, Self::Lost, Self::Singular, Self::Blind];

    /// Its name in reports.
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

    /// The graver of two.
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
