//! What drives a simulated run.

use hydroid_core::vessel::Command;

/// What drives a simulated run.
#[derive(Clone, Debug, PartialEq)]
pub enum Excitation {
    /// Shapes over the full range of both commands: through both modes of a hydrofoil. See
    /// [`mixed`](super::mixed).
    Mixed,
    /// Shapes over a range of propeller commands that keeps the vessel slow. See
    /// [`low_speed`](super::low_speed).
    LowSpeed(LowSpeed),
    /// Parallel legs at different speeds, steered in closed loop.
    LawnMower(LawnMower),
    /// A circle at constant speed, steered in closed loop.
    Circle(Circle),
    /// Commands given with their times \[s\], each held until the next. See [`held`](super::held).
    Given(Vec<(f64, Command)>),
}

impl Excitation {
    /// How long \[s\] it lasts of itself at sample time `dt` \[s\]: given commands until the last one has
    /// been held for a sample. The others last as long as they are asked to.
    pub fn natural_duration_s(&self, dt: f64) -> Option<f64> {
        match self {
            Self::Given(rows) => Some(rows.last()?.0 - rows.first()?.0 + dt),
            _ => None,
        }
    }
}

/// A run that stays slow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowSpeed {
    /// Speed \[m/s\] that is never reached; the transition speed of a hydrofoil, where that is lower.
    pub ceiling: f64,
}

impl Default for LowSpeed {
    /// Below 2.5 m/s, the transition speed of the reference hydrofoil.
    fn default() -> Self {
        Self { ceiling: 2.5 }
    }
}

/// Parallel legs, north and south by turns, each east of the one before. Starts at the origin, heading
/// north, at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LawnMower {
    /// Length of a leg \[m\]; by default ten times the way that the vessel makes at top speed while it
    /// answers ([`Envelope`](super::Envelope)): some 130 m for the reference hydrofoil.
    pub leg: Option<f64>,
    /// Distance between legs \[m\]; by default a quarter of the leg.
    pub spacing: Option<f64>,
    /// How one leg leads to the next.
    pub turn: Turn,
    /// Speed of each leg \[m/s\]; the run ends after the last. Without any, speeds are drawn, slow and fast
    /// (a hydrofoil: below and above its transition) by turns of chance, for as long as the run lasts.
    pub speeds: Vec<f64>,
}

/// How one leg of a lawn-mower leads to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Turn {
    /// A half circle at the speed of the leg before.
    #[default]
    Arc,
    /// Two turns by 90 degrees, which the vessel brakes for.
    Sharp {
        /// Speed between legs \[m/s\]; by default a quarter of top speed.
        speed: Option<f64>,
    },
}

/// A circle to starboard that starts at the origin, heading north, at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Circle {
    /// Radius \[m\]; by default twice the way that the vessel makes at top speed while it answers.
    pub radius: Option<f64>,
    /// Speed \[m/s\]; by default 60 % of top speed.
    pub speed: Option<f64>,
}
