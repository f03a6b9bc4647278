//! Encoding of guard events as numbers.

use hydroid_core::adapt::guard::{Action, Cause, Expert};

/// Numbers of an event: its code, then its values.
pub const WORDS: usize = 5;

const CAUSES: [Cause; 4] = [Cause::Record, Cause::Test, Cause::Guarantee, Cause::NotFinite];

pub fn encode(action: &Action) -> [f64; WORDS] {
    let expert = |expert: Expert| expert.index() as f64;
    match *action {
        Action::Spike { output, deviations } => [0.0, output as f64, deviations, 0.0, 0.0],
        Action::Inflated { output, deviations, factor } => [1.0, output as f64, deviations, factor, 0.0],
        Action::Stuck { output, repeats } => [2.0, output as f64, repeats as f64, 0.0, 0.0],
        Action::Offset { output, offset } => [3.0, output as f64, offset, 0.0, 0.0],
        Action::Believed { output, deviations } => [4.0, output as f64, deviations, 0.0, 0.0],
        Action::Back { output, missing } => [5.0, output as f64, missing as f64, 0.0, 0.0],
        Action::Outside { channel, distance } => [6.0, channel as f64, distance, 0.0, 0.0],
        Action::Inside => [7.0, 0.0, 0.0, 0.0, 0.0],
        Action::Switched { to, cause, errors: [used, reference] } => {
            let cause = CAUSES.iter().position(|c| *c == cause).unwrap_or(CAUSES.len());
            [8.0, expert(to), cause as f64, used, reference]
        }
        Action::RolledBack { to, errors: [learner, better] } => [9.0, expert(to), learner, better, 0.0],
        Action::Restarted => [10.0, 0.0, 0.0, 0.0, 0.0],
        Action::SnapshotTaken { error } => [11.0, error, 0.0, 0.0, 0.0],
    }
}

/// Decodes an event of an untrusted file; `None` for invalid numbers.
pub fn decode(words: &[f64]) -> Option<Action> {
    let &[code, a, b, c, d] = words else { return None };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // counts were written as numbers; a cast saturates
    let count = |x: f64| x as usize;
    let expert = |x: f64| Expert::ALL.get(count(x)).copied();
    let output = count(a);
    Some(match count(code) {
        0 => Action::Spike { output, deviations: b },
        1 => Action::Inflated { output, deviations: b, factor: c },
        2 => Action::Stuck { output, repeats: count(b) },
        3 => Action::Offset { output, offset: b },
        4 => Action::Believed { output, deviations: b },
        5 => Action::Back { output, missing: count(b) },
        6 => Action::Outside { channel: output, distance: b },
        7 => Action::Inside,
        8 => Action::Switched { to: expert(a)?, cause: *CAUSES.get(count(b))?, errors: [c, d] },
        9 => Action::RolledBack { to: expert(a)?, errors: [b, c] },
        10 => Action::Restarted,
        11 => Action::SnapshotTaken { error: a },
        _ => return None,
    })
}
