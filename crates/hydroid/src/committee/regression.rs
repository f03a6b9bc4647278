//! Rows of a regression over a clock step, and their second moments.

use hydroid_core::adapt::increment_stride;
use hydroid_core::model::committee::{DifferenceEquations, Shape};
use hydroid_core::model::sparse::{EquationsError, Program, Term};
use pulp::{Arch, Simd, WithSimd};

use super::folds::{Fold, Segment};

/// Points evaluated side by side.
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
pub(super) struct Moments {
    pub(super) gram: Vec<f64>,
    pub(super) right: Vec<f64>,
}

impl Moments {
    pub(super) fn zero(terms: usize, outputs: usize) -> Self {
        Self { gram: vec![0.0; terms * terms], right: vec![0.0; terms * outputs] }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.gram.iter_mut().zip(&other.gram).for_each(|(a, b)| *a += b);
        self.right.iter_mut().zip(&other.right).for_each(|(a, b)| *a += b);
    }
}

/// Averaged rows of a segment, in the order of time.
pub(super) struct Rows {
    pub(super) terms: usize,
    outputs: usize,
    /// Sample of the end of each row, within the segment.
    pub(super) ends: Vec<usize>,
    phi: Vec<f64>,
    z: Vec<f64>,
}

impl Rows {
    pub(super) fn phi(&self, row: usize) -> &[f64] {
        &self.phi[row * self.terms..][..self.terms]
    }

    pub(super) fn z(&self, row: usize) -> &[f64] {
        &self.z[row * self.outputs..][..self.outputs]
    }
}

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

    /// Moments of all overlapping rows of a fold.
    pub(super) fn moments(&self, fold: &Fold<'_>) -> Moments {
        let mut moments = Moments::zero(self.terms.len(), self.shape.outputs);
        let (stride, _) = self.increments();
        let weight = stride as f64 / self.shape.clock as f64;
        for segment in &fold.segments {
            let rows = self.rows(segment, true);
            Arch::new().dispatch(AddMoments { rows: &rows, weight, into: &mut moments });
        }
        moments
    }

    /// Averaged rows of a segment, overlapping or one after the other. Rows with a missing value are left out.
    pub(super) fn rows(&self, segment: &Segment<'_>, overlapping: bool) -> Rows {
        let Shape { outputs: n, clock, dt, .. } = self.shape;
        let terms = self.terms.len();
        let (stride, increments) = self.increments();
        let clock_s = clock as f64 * dt;
        let mut rows = Rows { terms, outputs: n, ends: Vec::new(), phi: Vec::new(), z: Vec::new() };
        let first = self.shape.span();
        let starts: Vec<usize> = (first..segment.len().saturating_sub(clock)).step_by(stride).collect();
        let mut slots = vec![0.0; self.program.slots() * BLOCK];
        // The last `increments` increments, each with its terms and its rate.
        let width = terms + n;
        let mut ring = vec![0.0; increments * width];
        let mut sum = vec![0.0; width];
        let mut filled = 0;
        for block in starts.chunks(BLOCK) {
            for (lane, &start) in block.iter().enumerate() {
                segment.load(&self.shape, start, None, &mut slots[BLOCK + lane..], BLOCK);
            }
            self.program.evaluate_block(&mut slots, BLOCK);
            for (lane, &start) in block.iter().enumerate() {
                let place = &mut ring[(filled % increments) * width..][..width];
                for (t, value) in place[..terms].iter_mut().enumerate() {
                    *value = slots[self.program.slot(t) * BLOCK + lane];
                }
                let (now, before) = (segment.output(start + clock), segment.output(start));
                for ((value, now), before) in place[terms..].iter_mut().zip(now).zip(before) {
                    *value = (now - before) / clock_s;
                }
                if !place.iter().all(|x| x.is_finite()) {
                    filled = 0;
                    continue;
                }
                filled += 1;
                let due = if overlapping { filled >= increments } else { filled.is_multiple_of(increments) };
                if !due {
                    continue;
                }
                sum.fill(0.0);
                for part in ring.chunks_exact(width) {
                    sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
                }
                let share = 1.0 / increments as f64;
                rows.phi.extend(sum[..terms].iter().map(|x| x * share));
                rows.z.extend(sum[terms..].iter().map(|x| x * share));
                rows.ends.push(start + clock);
            }
        }
        rows
    }
}

struct AddMoments<'a> {
    rows: &'a Rows,
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
        let Self { rows, weight, into } = self;
        let terms = rows.terms;
        for row in 0..rows.ends.len() {
            let (phi, z) = (rows.phi(row), rows.z(row));
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
