//! Kinds of excitation.

use hydroid_core::vessel::Command;

/// Excitation of a simulated run.
#[derive(Clone, Debug, PartialEq)]
pub enum Excitation {
    /// Random shapes over the full range of both commands. See [`mixed`](super::mixed).
    Mixed,
    /// Random shapes in a range of propeller commands that limits the speed. See [`low_speed`](super::low_speed).
    LowSpeed(LowSpeed),
    /// Parallel legs at different speeds, in closed loop.
    LawnMower(LawnMower),
    /// Circle at constant speed, in closed loop.
    Circle(Circle),
    /// Given commands with times \[s\], each held until the next. See [`held`](super::held).
    Given(Vec<(f64, Command)>),
}

impl Excitation {
    /// Duration \[s\] of given commands at sample time `dt` \[s\]; `None` for the other kinds.
    pub fn natural_duration_s(&self, dt: f64) -> Option<f64> {
        match self {
            Self::Given(rows) => Some(rows.last()?.0 - rows.first()?.0 + dt),
            _ => None,
        }
    }
}

/// Low-speed run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowSpeed {
    /// Upper limit of the speed \[m/s\]; for a hydrofoil at most its transition speed.
    pub ceiling: f64,
}

impl Default for LowSpeed {
    /// 2.5 m/s, the transition speed of the reference hydrofoil.
    fn default() -> Self {
        Self { ceiling: 2.5 }
    }
}

/// Parallel legs, alternately north and south, each east of the previous one, from rest at the origin, heading north.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LawnMower {
    /// Length of a leg \[m\]; default ten times top speed times response time ([`Envelope`](super::Envelope)).
    pub leg: Option<f64>,
    /// Distance of the legs \[m\]; default a quarter of the leg.
    pub spacing: Option<f64>,
    /// Connection of the legs.
    pub turn: Turn,
    /// Speed of each leg \[m/s\]; the run ends after the last. Empty: random speeds, slow and fast (for a hydrofoil
    /// below and above its transition) in alternation, for the duration of the run.
    pub speeds: Vec<f64>,
}

/// Connection of legs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Turn {
    /// Half circle at the speed of the previous leg.
    #[default]
    Arc,
    /// Two turns by 90 degrees at reduced speed.
    Sharp {
        /// Speed between legs \[m/s\]; default a quarter of the top speed.
        speed: Option<f64>,
    },
}

/// Circle to starboard from the origin, heading north, at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Circle {
    /// Radius \[m\]; default twice top speed times response time.
    pub radius: Option<f64>,
    /// Speed \[m/s\]; default 60 % of the top speed.
    pub speed: Option<f64>,
}
