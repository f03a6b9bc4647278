//! Rows of a regression over a clock step, and their second moments.

use hydroid_core::adapt::increment_stride;
use hydroid_core::model::committee::{DifferenceEquations, Shape};
use hydroid_core::model::sparse::{EquationsError, Program, Term};
use pulp::{Arch, Simd, WithSimd};

use super::folds::{Fold, Segment};

/// Points evaluated side by side, and rows added at a time.
const BLOCK: usize = 64;

/// A library with its clock step and its averaging.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    pub(super) terms: Vec<Term>,
    pub(super) shape: Shape,
    /// Clock steps over which a row is averaged.
    pub(super) averaging: usize,
    pub(super) program: Program,
}

/// Second moments of rows: `gram` (`terms x terms`), `right` (`outputs x terms`), per clock step.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    pub(crate) gram: Vec<f64>,
    pub(crate) right: Vec<f64>,
}

impl Moments {
    pub(crate) fn zero(terms: usize, outputs: usize) -> Self {
        Self { gram: vec![0.0; terms * terms], right: vec![0.0; terms * outputs] }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.gram.iter_mut().zip(&other.gram).for_each(|(a, b)| *a += b);
        self.right.iter_mut().zip(&other.right).for_each(|(a, b)| *a += b);
    }
}

/// Called with the end, the terms and the rates of a row.
type OnRow<'a> = &'a mut dyn FnMut(usize, &[f64], &[f64]);

impl Regression {
    pub(super) fn new(terms: Vec<Term>, shape: Shape, averaging: usize) -> Result<Self, EquationsError> {
        let program = Program::new(&terms, shape.variables()).map_err(EquationsError::Program)?;
        Ok(Self { terms, shape, averaging, program })
    }

    /// Equations with given coefficients, `outputs x terms`.
    pub(super) fn equations(&self, coefficients: Vec<f64>) -> Result<DifferenceEquations, EquationsError> {
        DifferenceEquations::new(self.terms.clone(), coefficients, self.shape)
    }

    /// Samples between two increments, and increments in a row.
    pub(super) fn increments(&self) -> (usize, usize) {
        let samples = self.averaging * self.shape.clock;
        let stride = increment_stride(samples);
        (stride, samples.div_ceil(stride))
    }

    /// Moments of the overlapping rows of a fold, of which every `every`-th is used.
    pub(super) fn moments(&self, fold: &Fold<'_>, every: usize) -> Moments {
        let mut moments = Moments::zero(self.terms.len(), self.shape.outputs);
        let (stride, _) = self.increments();
        let weight = (every * stride) as f64 / self.shape.clock as f64;
        let (terms, outputs, arch) = (self.terms.len(), self.shape.outputs, Arch::new());
        let mut rows = Vec::with_capacity(BLOCK * (terms + outputs));
        for segment in &fold.segments {
            self.for_each_row(segment, every, segment.len(), &mut |_, phi, z| {
                rows.extend_from_slice(phi);
                rows.extend_from_slice(z);
                if rows.len() >= BLOCK * (terms + outputs) {
                    arch.dispatch(AddMoments { rows: &rows, terms, outputs, weight, into: &mut moments });
                    rows.clear();
                }
            });
        }
        arch.dispatch(AddMoments { rows: &rows, terms, outputs, weight, into: &mut moments });
        moments
    }

    /// Calls `add` with the end, the terms and the rates of averaged rows of a segment up to the sample `to`, in the order
    /// of time: `every` increments lie between the first increments of two rows. Rows with a missing value are left out.
    pub(super) fn for_each_row(&self, segment: &Segment<'_>, every: usize, to: usize, add: OnRow<'_>) {
        let Shape { outputs: n, clock, dt, .. } = self.shape;
        let terms = self.terms.len();
        let (stride, increments) = self.increments();
        let clock_s = clock as f64 * dt;
        let end = to.min(segment.len()).saturating_sub(clock);
        // Increments between two rows are skipped.
        let needed = |&index: &usize| index % every < increments || every < increments;
        let starts = (self.shape.span()..end).step_by(stride).enumerate();
        let starts: Vec<(usize, usize)> = starts.filter(|(index, _)| needed(index)).collect();
        let mut slots = vec![0.0; self.program.slots() * BLOCK];
        // The last `increments` increments, each with its terms and its rate.
        let width = terms + n;
        let mut ring = vec![0.0; increments * width];
        let mut sum = vec![0.0; width];
        // Consecutive increments without a missing value.
        let mut filled = 0;
        for block in starts.chunks(BLOCK) {
            for (lane, &(_, start)) in block.iter().enumerate() {
                segment.load(&self.shape, start, None, &mut slots[BLOCK + lane..], BLOCK);
            }
            self.program.evaluate_block(&mut slots, BLOCK);
            for (lane, &(index, start)) in block.iter().enumerate() {
                if every >= increments && index % every == 0 {
                    filled = 0;
                }
                let place = &mut ring[(index % increments) * width..][..width];
                for (t, value) in place[..terms].iter_mut().enumerate() {
                    *value = slots[self.program.slot(t) * BLOCK + lane];
                }
                let (now, before) = (segment.output(start + clock), segment.output(start));
                for ((value, now), before) in place[terms..].iter_mut().zip(now).zip(before) {
                    *value = (now - before) / clock_s;
                }
                filled = if place.iter().all(|x| x.is_finite()) { filled + 1 } else { 0 };
                if filled < increments || !(index + 1 - increments).is_multiple_of(every) {
                    continue;
                }
                sum.fill(0.0);
                for part in ring.chunks_exact(width) {
                    sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
                }
                let share = 1.0 / increments as f64;
                for x in &mut sum {
                    *x *= share;
                }
                add(start + clock, &sum[..terms], &sum[terms..]);
            }
        }
    }
}

struct AddMoments<'a> {
    /// Terms and rates of each row.
    rows: &'a [f64],
    terms: usize,
    outputs: usize,
    weight: f64,
    into: &'a mut Moments,
}

impl WithSimd for AddMoments<'_> {
    type Output = ();

    #[expect(
        clippy::inline_always,
        reason = "must become a part of the function that was compiled for the processor"
    )]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { rows, terms, outputs, weight, into } = self;
        for row in rows.chunks_exact(terms + outputs) {
            let (phi, z) = row.split_at(terms);
            for (i, &a) in phi.iter().enumerate() {
                let a = a * weight;
                let line = &mut into.gram[i * terms + i..(i + 1) * terms];
                line.iter_mut().zip(&phi[i..]).for_each(|(g, b)| *g += a * b);
            }
            for (line, &z) in into.right.chunks_exact_mut(terms).zip(z) {
                let z = z * weight;
                line.iter_mut().zip(phi).for_each(|(g, b)| *g += z * b);
            }
        }
    }
}
