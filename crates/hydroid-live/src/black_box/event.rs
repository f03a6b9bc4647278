//! Encoding of guard events as numbers.

use hydroid_core::adapt::guard::{Action, Cause, Expert};

/// Numbers of an event: its code, then its values.
pub const WORDS: usize = 5;

pub fn encode(action: &Action) -> [f64; WORDS] {
    let expert = |expert: Expert| expert.index() as f64;
    match *action {
        Action::Spike { output, deviations } => [0.0, output as f64, deviations, 0.0, 0.0],
        Action::Stuck { output, repeats } => [1.0, output as f64, repeats as f64, 0.0, 0.0],
        Action::Trusted { output, cause: Cause::Evidence } => [2.0, output as f64, 0.0, 0.0, 0.0],
        Action::Trusted { output, cause: Cause::Budget } => [2.0, output as f64, 1.0, 0.0, 0.0],
        Action::Back { output, missing } => [3.0, output as f64, missing as f64, 0.0, 0.0],
        Action::Switched { to, errors: [a, b, c] } => [4.0, expert(to), a, b, c],
        Action::RolledBack { errors: [a, b, c] } => [5.0, a, b, c, 0.0],
        Action::Restarted => [6.0, 0.0, 0.0, 0.0, 0.0],
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
        1 => Action::Stuck { output, repeats: count(b) },
        2 => Action::Trusted { output, cause: if b == 0.0 { Cause::Evidence } else { Cause::Budget } },
        3 => Action::Back { output, missing: count(b) },
        4 => Action::Switched { to: expert(a)?, errors: [b, c, d] },
        5 => Action::RolledBack { errors: [a, b, c] },
        6 => Action::Restarted,
        _ => return None,
    })
}
