//! Data leakage: no sample may be in two parts of the split.

use super::IdentifyError;
use crate::log::Trajectory;

/// Number of identical rows from which on two runs share data.
const MIN_ROWS: usize = 50;

/// Maximum number of comparisons per pair of runs; only periodic runs need more.
const MAX_COMPARISONS: usize = 20_000_000;

/// Refuses runs of different parts that share a sequence of measurements, whatever their names are.
pub(super) fn check(parts: &[&[&Trajectory]]) -> Result<(), IdentifyError> {
    for (i, part) in parts.iter().enumerate() {
        for a in *part {
            for b in parts[i + 1..].iter().copied().flatten() {
                if overlap(a, b) || overlap(b, a) {
                    return Err(IdentifyError::DataLeakage { first: a.name.clone(), second: b.name.clone() });
                }
            }
        }
    }
    Ok(())
}

/// Whether the first rows of `a` that are not constant occur in `b`.
fn overlap(a: &Trajectory, b: &Trajectory) -> bool {
    let same = |i: usize, j: usize, other: &Trajectory| {
        a.outputs.row(i).iter().zip(other.outputs.row(j)).all(|(x, y)| x.to_bits() == y.to_bits())
    };
    // A vessel at rest without noise repeats its measurements: the comparison starts at the first change.
    let Some(start) = (1..a.len()).find(|&i| !same(i, 0, a)) else { return false };
    let rows = MIN_ROWS.min(a.len() - start);
    if a.outputs.width() != b.outputs.width() || rows < MIN_ROWS.min(a.len() / 2) {
        return false;
    }
    let mut left = MAX_COMPARISONS;
    (0..(b.len() + 1).saturating_sub(rows)).any(|j| {
        let alike = (0..rows).take_while(|&k| same(start + k, j + k, b)).count();
        left = left.saturating_sub(alike + 1);
        left > 0 && alike == rows
    })
}
