//! How long a measurement may be missing, and where a run is cut because it was missing longer.

use super::clock::median;
use super::columns::Columns;
use super::note::Note;

/// The gap limit in samples where none is given.
const SAMPLES: f64 = 10.0;
/// The least gap limit \[s\] where none is given.
const SECONDS: f64 = 1.0;

/// The gap limit of a log where the user gives none: 1 s or 10 samples, whichever is longer. The samples
/// are those of the slowest output if it has a value in less than half of the rows.
pub(crate) fn default_limit(columns: &Columns, step: f64, notes: &mut Vec<Note>) -> f64 {
    let mut spacing = step;
    for (channel, values) in columns.output_channels.iter().zip(&columns.outputs) {
        let times: Vec<f64> =
            values.iter().zip(&columns.t).filter(|(x, _)| !x.is_nan()).map(|(_, t)| *t).collect();
        if 2 * times.len() >= values.len() {
            continue;
        }
        // A sensor that fell silent half-way is dense where it has values: that is no slow sensor.
        let own = median(times.windows(2).map(|p| p[1] - p[0]).collect()).unwrap_or(step);
        if own < 1.5 * step {
            continue;
        }
        notes.push(
            Note::info(format!(
                "{}: `{}` has values in {} of {} rows, about every {own:.3} s",
                columns.path,
                channel.name,
                times.len(),
                values.len(),
            ))
            .with_remedy(format!("--dt {own:.3} puts all channels on the clock of the slowest")),
        );
        spacing = spacing.max(own);
    }
    SECONDS.max(SAMPLES * spacing)
}

/// Parts `from..to` of rows on a regular clock that can be used.
///
/// Between two neighbouring values of an output that lie farther apart than the limit nothing is known: the
/// rows between them are cut out. Each part begins where the last output has its first value and ends where
/// the first output has its last.
pub(crate) fn usable(outputs: &[Vec<f64>], rows: usize, dt: f64, max_gap_s: f64) -> Vec<(usize, usize)> {
    let mut cut = vec![false; rows];
    for values in outputs {
        let mut last: Option<usize> = None;
        for k in (0..rows).filter(|&k| !values[k].is_nan()) {
            if let Some(last) = last
                && (k - last) as f64 * dt > max_gap_s * (1.0 + 1e-9)
            {
                cut[last + 1..k].fill(true);
            }
            last = Some(k);
        }
    }
    let mut parts = Vec::new();
    let mut k = 0;
    while k < rows {
        let end = (k..rows).find(|&i| cut[i]).unwrap_or(rows);
        if let Some(part) = trim(outputs, k, end) {
            parts.push(part);
        }
        k = (end..rows).find(|&i| !cut[i]).unwrap_or(rows);
    }
    parts
}

/// The part of `from..to` in which every output has begun and none has ended.
fn trim(outputs: &[Vec<f64>], from: usize, to: usize) -> Option<(usize, usize)> {
    let (mut first, mut last) = (from, to);
    for values in outputs {
        let part = &values[from..to];
        first = first.max(from + part.iter().position(|x| !x.is_nan())?);
        last = last.min(from + part.iter().rposition(|x| !x.is_nan())? + 1);
    }
    (first < last).then_some((first, last))
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: f64 = f64::NAN;

    #[test]
    fn long_stretches_cut_and_short_ones_stay() {
        let u = vec![1.0, N, 1.0, N, N, N, 1.0, 1.0];
        assert_eq!(usable(std::slice::from_ref(&u), 8, 1.0, 3.0), [(0, 3), (6, 8)]);
        assert_eq!(usable(&[u], 8, 1.0, 4.0), [(0, 8)]);
    }

    #[test]
    fn ends_are_trimmed() {
        let u = vec![N, 1.0, 1.0, 1.0, N, N];
        let v = vec![1.0, N, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(usable(&[u, v], 6, 1.0, 10.0), [(1, 4)]);
    }

    #[test]
    fn a_slow_sensor_is_no_gap() {
        let slow: Vec<f64> = (0..40).map(|k| if k % 10 == 0 { 1.0 } else { N }).collect();
        let fast = vec![1.0; 40];
        assert_eq!(usable(&[slow, fast], 40, 0.1, 10.0), [(0, 31)]);
    }

    #[test]
    fn nothing_measured_leaves_nothing() {
        assert!(usable(&[vec![N; 5]], 5, 1.0, 1.0).is_empty());
        assert!(usable(&[vec![N, N, 1.0], vec![1.0, N, N]], 3, 1.0, 9.0).is_empty());
    }
}
