//! Allocation of a push and a turn to the inputs.
//!
//! A push of 1 is full ahead, a turn of 1 full to starboard. An input receives the weighted sum of both, in shares of its
//! range on that side of rest. Where the sum exceeds a range, the turn is kept and the push is reduced: the turn brings
//! the boat back into its fence.

use crate::Axis;

/// An input with its weights.
#[derive(Clone, Debug, PartialEq)]
struct Share {
    input: Axis,
    push: f64,
    turn: f64,
    /// Limits in shares of the range: 0 where there is none on that side of rest.
    limits: [f64; 2],
}

/// Push and turn, and the inputs that make them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Allocation {
    shares: Vec<Share>,
    /// Smallest push: below zero if the boat can go astern.
    pub(super) astern: f64,
    /// Largest turn to either side.
    pub(super) turn: f64,
}

/// Part of a range below which it is considered missing.
const NOTHING: f64 = 1e-9;
/// Smallest turn that the inputs must be able to make.
const WEAKEST_TURN: f64 = 0.2;

impl Allocation {
    pub(super) fn new(inputs: &[Axis], push: &[(usize, f64)], turn: &[(usize, f64)]) -> Result<Self, String> {
        let mut shares = inputs.iter().map(Share::new).collect::<Result<Vec<_>, String>>()?;
        for (what, weights) in [("push", push), ("turn", turn)] {
            if weights.is_empty() {
                return Err(format!("no input has a weight in `{what}`: an experiment must push and turn"));
            }
            for &(index, weight) in weights {
                let count = shares.len();
                let Some(share) = shares.get_mut(index) else {
                    return Err(format!("`{what}` names input {index}, but there are {count}, from 0"));
                };
                if !(weight.is_finite() && weight != 0.0 && weight.abs() <= 1.0) {
                    return Err(format!(
                        "`{what}` has the weight {weight} for {}; give 1, or -1 for a reversed input",
                        share.input.name
                    ));
                }
                let place = if what == "push" { &mut share.push } else { &mut share.turn };
                if *place != 0.0 {
                    return Err(format!("`{what}` names {} twice", share.input.name));
                }
                *place = weight;
            }
        }
        let mut allocation = Self { shares, astern: 0.0, turn: 1.0 };
        let [astern, ahead] = allocation.push_interval(0.0);
        if ahead < 1.0 {
            return Err(
                "the inputs in `push` cannot push fully ahead: check which of them are reversed, and whether \
                        rest lies below the upper limit"
                    .into(),
            );
        }
        allocation.astern = if astern <= -1.0 { -1.0 } else { 0.0 };
        allocation.turn = (1..=20)
            .rev()
            .map(|k| f64::from(k) / 20.0)
            .find(|&turn| {
                [turn, -turn].into_iter().all(|turn| {
                    let [low, high] = allocation.push_interval(turn);
                    let [_, made] = allocation.demand(&allocation.commands(0.0, turn));
                    low <= high && made * turn.signum() >= WEAKEST_TURN.min(0.5 * turn.abs())
                })
            })
            .filter(|&turn| turn >= WEAKEST_TURN)
            .ok_or("the inputs in `turn` cannot turn to both sides: check which of them are reversed, and their limits")?;
        Ok(allocation)
    }

    /// The interval of pushes that keep the inputs within their limits at a turn; empty (reversed) where there is none.
    fn push_interval(&self, turn: f64) -> [f64; 2] {
        let mut interval = [-1.0_f64, 1.0_f64];
        for share in self.shares.iter().filter(|share| share.push != 0.0) {
            let bound = share.limits.map(|limit| (limit - share.turn * turn) / share.push);
            interval = [interval[0].max(bound[0].min(bound[1])), interval[1].min(bound[0].max(bound[1]))];
        }
        interval
    }

    /// Largest turn that does not lower a push: with a rudder each turn, with two thrusters what the push leaves of them.
    pub(super) fn turn_beside(&self, push: f64) -> f64 {
        (1..=20)
            .rev()
            .map(|k| self.turn * f64::from(k) / 20.0)
            .find(|&turn| self.push_beside(turn) >= push - NOTHING)
            .unwrap_or(0.0)
    }

    /// Largest push beside a turn.
    pub(super) fn push_beside(&self, turn: f64) -> f64 {
        let [_, starboard] = self.push_interval(turn);
        let [_, port] = self.push_interval(-turn);
        starboard.min(port)
    }

    /// Least push beside a turn to either side: above zero with two thrusters that only push ahead.
    pub(super) fn least_push_beside(&self, turn: f64) -> f64 {
        let [starboard, _] = self.push_interval(turn);
        let [port, _] = self.push_interval(-turn);
        starboard.max(port).max(0.0)
    }

    /// The commands of a push and a turn, within the limits of the inputs.
    pub(super) fn commands(&self, push: f64, turn: f64) -> Vec<f64> {
        let turn = if turn.is_finite() { turn.clamp(-self.turn, self.turn) } else { 0.0 };
        let push = if push.is_finite() { push } else { 0.0 };
        let [low, high] = self.push_interval(turn);
        let push = if low <= high { push.clamp(low, high) } else { 0.5 * (low + high) };
        self.shares.iter().map(|share| share.command(share.push * push + share.turn * turn)).collect()
    }

    /// The push and the turn that commands make, by least squares.
    pub(super) fn demand(&self, commands: &[f64]) -> [f64; 2] {
        let (mut pp, mut pt, mut tt, mut pz, mut tz) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (share, &command) in self.shares.iter().zip(commands) {
            let z = share.share(command);
            pp += share.push * share.push;
            pt += share.push * share.turn;
            tt += share.turn * share.turn;
            pz += share.push * z;
            tz += share.turn * z;
        }
        let det = pp * tt - pt * pt;
        if det > NOTHING {
            [(tt * pz - pt * tz) / det, (pp * tz - pt * pz) / det]
        } else {
            [pz / pp.max(NOTHING), 0.0]
        }
    }

    /// Whether each input pushes or turns.
    pub(super) fn is_used(&self) -> impl Iterator<Item = bool> {
        self.shares.iter().map(|share| share.push != 0.0 || share.turn != 0.0)
    }
}

impl Share {
    fn new(input: &Axis) -> Result<Self, String> {
        let Axis { name, low, high, rest, .. } = input;
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(format!("the limits of {name} are [{low}, {high}]; give two ascending numbers"));
        }
        if !(low..=high).contains(&rest) {
            return Err(format!("the rest of {name} is {rest}, outside of its limits [{low}, {high}]"));
        }
        let range = high - low;
        let limits = [
            if rest - low > NOTHING * range { -1.0 } else { 0.0 },
            if high - rest > NOTHING * range { 1.0 } else { 0.0 },
        ];
        Ok(Self { input: input.clone(), push: 0.0, turn: 0.0, limits })
    }

    fn command(&self, share: f64) -> f64 {
        let Axis { low, high, rest, .. } = self.input;
        let side = if share >= 0.0 { high - rest } else { rest - low };
        (rest + share * side).clamp(low, high)
    }

    fn share(&self, command: f64) -> f64 {
        let Axis { low, high, rest, .. } = self.input;
        let side = if command >= rest { high - rest } else { rest - low };
        if side > NOTHING * (high - low) { ((command - rest) / side).clamp(-1.0, 1.0) } else { 0.0 }
    }
}
