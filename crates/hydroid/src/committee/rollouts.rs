//! Rollouts from many origins side by side, for the choice of members.

use pulp::{Arch, Simd, WithSimd};

use super::folds::Segment;
use super::regression::Regression;

/// Origins rolled out side by side.
pub(super) const LANES: usize = 32;

/// Coefficients of the origins.
#[derive(Clone, Copy)]
pub(super) enum Coefficients<'a> {
    /// The same for all, `outputs x terms`.
    Shared(&'a [f64]),
    /// One set for each origin.
    Each(&'a [Vec<f64>]),
}

/// Predictions from the origins of a segment at the horizons `marks` \[samples\], `origins x marks x outputs`, limited to
/// `limits` (low, high) of each output.
pub(super) fn predictions(
    of: &Regression,
    coefficients: Coefficients<'_>,
    segment: &Segment<'_>,
    origins: &[usize],
    marks: &[usize],
    limits: &[(f64, f64)],
) -> Vec<f32> {
    let n = of.shape.outputs;
    let mut all = vec![0.0; origins.len() * marks.len() * n];
    let mut slots = vec![0.0; of.program.slots() * LANES];
    let mut table = vec![0.0; of.terms.len() * n * LANES];
    for (block, origins) in origins.chunks(LANES).enumerate() {
        let first = block * LANES;
        for lane in 0..LANES {
            let own = match coefficients {
                Coefficients::Shared(shared) => shared,
                Coefficients::Each(each) => &each[(first + lane).min(each.len() - 1)],
            };
            for (place, xi) in table[lane..].iter_mut().step_by(LANES).zip(own) {
                *place = *xi;
            }
        }
        let into = &mut all[first * marks.len() * n..][..origins.len() * marks.len() * n];
        Arch::new().dispatch(RollOut {
            of,
            table: &table,
            segment,
            origins,
            marks,
            limits,
            slots: &mut slots,
            into,
        });
    }
    all
}

struct RollOut<'a> {
    of: &'a Regression,
    /// Coefficients, `outputs x terms x lanes`.
    table: &'a [f64],
    segment: &'a Segment<'a>,
    origins: &'a [usize],
    marks: &'a [usize],
    limits: &'a [(f64, f64)],
    slots: &'a mut [f64],
    into: &'a mut [f32],
}

impl WithSimd for RollOut<'_> {
    type Output = ();

    #[expect(
        clippy::inline_always,
        reason = "must become a part of the function that was compiled for the processor"
    )]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { of, table, segment, origins, marks, limits, slots, into } = self;
        let (n, m, lags, clock) = (of.shape.outputs, of.shape.inputs, of.shape.lags, of.shape.clock);
        let width = n + m;
        for (lane, &k) in origins.iter().enumerate() {
            segment.load(&of.shape, k, None, &mut slots[LANES + lane..], LANES);
        }
        for lane in origins.len()..LANES {
            // Unused lanes repeat the first one.
            for row in slots.chunks_exact_mut(LANES).skip(1).take(of.shape.variables()) {
                row[lane] = row[0];
            }
        }
        let mut rates = vec![0.0; n * LANES];
        let mut elapsed = 0;
        let mut next = 0;
        while next < marks.len() {
            // Marks within this clock step are reached by a part of it, under the mean command up to them.
            let due = (marks[next] - elapsed).min(clock);
            for (lane, &k) in origins.iter().enumerate() {
                for c in 0..m {
                    slots[(1 + n + c) * LANES + lane] = segment.mean_command(k + elapsed, due, c);
                }
            }
            of.program.evaluate_block(slots, LANES);
            rates.fill(0.0);
            for (rates, table) in
                rates.chunks_exact_mut(LANES).zip(table.chunks_exact(of.terms.len() * LANES))
            {
                for (t, xi) in table.chunks_exact(LANES).enumerate() {
                    let phi = &slots[of.program.slot(t) * LANES..][..LANES];
                    for ((rate, xi), phi) in rates.iter_mut().zip(xi).zip(phi) {
                        *rate += xi * phi;
                    }
                }
            }
            let due_s = due as f64 * of.shape.dt;
            if elapsed + due == marks[next] {
                for lane in 0..origins.len() {
                    for i in 0..n {
                        let y = slots[(1 + i) * LANES + lane] + due_s * rates[i * LANES + lane];
                        let (low, high) = limits[i];
                        // Not a number counts as the upper limit.
                        let y = if y < high { y.max(low) } else { high };
                        #[expect(
                            clippy::cast_possible_truncation,
                            reason = "single precision suffices for the choice"
                        )]
                        let y = y as f32;
                        into[(lane * marks.len() + next) * n + i] = y;
                    }
                }
                next += 1;
            }
            if due < clock {
                continue;
            }
            // The present becomes the past.
            for lag in (1..=lags).rev() {
                let (from, to) = (1 + (lag - 1) * width, 1 + lag * width);
                slots.copy_within(from * LANES..(from + width) * LANES, to * LANES);
            }
            for i in 0..n {
                let (low, high) = limits[i];
                for lane in 0..LANES {
                    let y = slots[(1 + i) * LANES + lane] + due_s * rates[i * LANES + lane];
                    slots[(1 + i) * LANES + lane] = if y < high { y.max(low) } else { high };
                }
            }
            elapsed += clock;
        }
    }
}
