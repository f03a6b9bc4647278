//! Values that stand for a missing measurement, such as 99.99 or 65535.

use super::note::{Note, count};

/// Distance of such a value from all others, in ranges of the others.
const FAR: f64 = 10.0;
/// Most such values at an end of a channel.
const MOST: usize = 2;

/// The values at an end of a channel, the outermost first, with their numbers.
#[derive(Clone, Copy, Default)]
struct End {
    found: [(f64, usize); MOST + 1],
    length: usize,
}

impl End {
    /// Adds a value; `order` is 1 for the highest and -1 for the lowest ones.
    fn add(&mut self, x: f64, order: f64) {
        let at = self.found[..self.length].partition_point(|(of, _)| order * of > order * x);
        if at < self.length && self.found[at].0 == x {
            self.found[at].1 += 1;
        } else if at <= MOST {
            self.length = (self.length + 1).min(MOST + 1);
            self.found[at..self.length].rotate_right(1);
            self.found[at] = (x, 1);
        }
    }
}

/// What a channel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A measurement.
    Measured,
    /// An angle, with its full turn in [`find`].
    Angle,
    /// A command: it has steps, so that only numbers without meaning stand for a missing value.
    Command,
}

/// The repeated values at the ends of a channel that are farther from all other values than ten times their range, with their numbers.
/// Zero is a rest. An angle of more than a `turn` needs no distance. `raw` gives the number in the log.
pub(crate) fn find(
    values: impl Iterator<Item = f64>,
    kind: Kind,
    turn: f64,
    raw: impl Fn(f64) -> f64,
) -> Vec<(f64, usize)> {
    let (mut lowest, mut highest) = (End::default(), End::default());
    for x in values.filter(|x| x.is_finite()) {
        lowest.add(x, -1.0);
        highest.add(x, 1.0);
    }
    let is_none = |&(x, n): &(f64, usize)| {
        n > 1 && shown(raw(x)) != 0.0 && (kind != Kind::Command || is_without_meaning(shown(raw(x))))
    };
    let mut choices: Vec<(usize, usize)> = (0..=MOST)
        .flat_map(|low| (0..=MOST).map(move |high| (low, high)))
        .filter(|(a, b)| a + b > 0)
        .collect();
    choices.sort_by_key(|(low, high)| low + high);
    for (low, high) in choices {
        if low >= lowest.length || high >= highest.length {
            continue;
        }
        let (below, above) = (&lowest.found[..low], &highest.found[..high]);
        let (from, to) = (lowest.found[low].0, highest.found[high].0);
        let gap = |inner: f64, outer: &[(f64, usize)]| {
            outer.last().map_or(f64::INFINITY, |(x, _)| (x - inner).abs())
        };
        let is_beyond = kind == Kind::Angle
            && from >= -turn
            && to <= turn
            && below.iter().chain(above).all(|(x, _)| x.abs() > turn);
        let is_far = to > from && gap(from, below).min(gap(to, above)) > FAR * (to - from);
        if (is_far || is_beyond) && below.iter().chain(above).all(is_none) {
            return below.iter().chain(above).copied().collect();
        }
    }
    Vec::new()
}

/// A number of a log without the rounding of its conversion.
fn shown(x: f64) -> f64 {
    format!("{x:.8e}").parse().unwrap_or(x)
}

/// Whether a number has no digit but 9, two or more, or is the largest or smallest of an integer type or a bit field.
fn is_without_meaning(x: f64) -> bool {
    let text = x.abs().to_string();
    let nines = text.bytes().filter(|b| *b == b'9').count();
    let is_power = |x: f64| x >= 511.0 && x < 2f64.powi(64) && x.log2().fract() == 0.0;
    (nines > 1 && text.bytes().all(|b| b == b'9' || b == b'.')) || is_power(x.abs() + 1.0) || is_power(-x)
}

/// A note on values that are read as missing.
pub(crate) fn note(
    path: &str,
    column: &str,
    found: &[(f64, usize)],
    raw: impl Fn(f64) -> f64,
) -> Option<Note> {
    if found.is_empty() {
        return None;
    }
    let values: Vec<String> =
        found.iter().map(|(x, n)| format!("{} in {}", shown(raw(*x)), count(*n, "row"))).collect();
    Some(
        Note::warning(format!(
            "{path}: `{column}` is {}, far from all its other values: it stands for a missing value, and is read as one",
            values.join(" and ")
        ))
        .with_remedy("leave the cells of missing values blank"),
    )
}
