//! How fast a channel changes.

use std::collections::VecDeque;

/// The fewest samples in which values change by `change`; `None` if they never do.
pub(crate) fn shortest_change(values: impl Iterator<Item = f64>, change: f64) -> Option<usize> {
    // The values since `from` whose later ones are all lower, and all higher: the first of each is the extreme one.
    let (mut highest, mut lowest) = (VecDeque::<(usize, f64)>::new(), VecDeque::<(usize, f64)>::new());
    let mut shortest = None;
    for (k, x) in values.enumerate() {
        while highest.pop_back_if(|(_, high)| *high <= x).is_some() {}
        while lowest.pop_back_if(|(_, low)| *low >= x).is_some() {}
        highest.push_back((k, x));
        lowest.push_back((k, x));
        while let (Some(high), Some(low)) = (highest.front(), lowest.front()) {
            if high.1 - low.1 < change {
                break;
            }
            let taken = high.0.abs_diff(low.0);
            shortest = Some(shortest.map_or(taken, |least: usize| least.min(taken)));
            let oldest = if high.0 < low.0 { &mut highest } else { &mut lowest };
            oldest.pop_front();
            if highest.is_empty() || lowest.is_empty() {
                break;
            }
        }
    }
    shortest
}
