//! A block-diagonal covariance of the weights.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::array::from_fn;

use pulp::{Arch, Simd, WithSimd};

use super::panels::Panel;
use crate::math::rows::add_parts;
use crate::math::vectors::{Pack, Vectors};

/// `P = diag(P_1, P_2, ..)`, one matrix for each panel, stored as its lower triangle row by row.
#[derive(Clone, Debug)]
pub(super) struct BlockDiagonal {
    pub(super) numbers: Vec<f64>,
}

const fn triangle(width: usize) -> usize {
    width * (width + 1) / 2
}

impl BlockDiagonal {
    pub(super) fn new(panels: &[Panel]) -> Self {
        Self { numbers: vec![0.0; panels.iter().map(|panel| triangle(panel.width)).sum()] }
    }

    pub(super) fn each_diagonal(&mut self, panels: &[Panel], mut with: impl FnMut(usize, &mut f64)) {
        let (mut begin, mut column) = (0, 0);
        for panel in panels {
            for i in 0..panel.width {
                with(column + i, &mut self.numbers[begin + triangle(i) + i]);
            }
            begin += triangle(panel.width);
            column += panel.width;
        }
    }

    pub(super) fn set_diagonal(&mut self, panels: &[Panel], diagonal: &[f64]) {
        self.numbers.fill(0.0);
        self.each_diagonal(panels, |at, p| *p = diagonal[at]);
    }

    pub(super) fn diagonal(&self, panels: &[Panel]) -> Vec<f64> {
        let mut diagonal = vec![0.0; panels.iter().map(|panel| panel.width).sum()];
        self.clone().each_diagonal(panels, |at, p| diagonal[at] = *p);
        diagonal
    }

    pub(super) fn advance(&mut self, panels: &[Panel], growth: f64, noise: &[f64]) {
        let scale = growth * growth;
        if scale != 1.0 {
            Scale { numbers: &mut self.numbers, by: scale }.run();
        }
        self.each_diagonal(panels, |at, p| *p += noise[at]);
    }

    /// `out = rows P` for `count` rows.
    pub(super) fn times(&self, panels: &[Panel], count: usize, rows: &[f64], out: &mut [f64]) {
        Times { matrix: self, panels, count, rows, out }.run();
    }

    /// The blocks of `P <- P - sum_k w_k w_k'` for the first `count` of the `rows` rows of `w`.
    #[inline(always)]
    pub(super) fn correct(&mut self, panels: &[Panel], (rows, count): (usize, usize), w: &[f64]) {
        let mut begin = 0;
        for panel in panels {
            let w = &w[panel.of(rows)][..count * panel.width];
            for i in 0..panel.width {
                let p = &mut self.numbers[begin..=begin + i];
                begin += i + 1;
                for w in w.chunks(SIDE_BY_SIDE * panel.width) {
                    let minus: [f64; SIDE_BY_SIDE] =
                        from_fn(|k| w.get(k * panel.width + i).map_or(0.0, |&w| -w));
                    add_parts(p, w, panel.width, &minus[..w.len() / panel.width]);
                }
            }
        }
    }
}

struct Scale<'a> {
    numbers: &'a mut [f64],
    by: f64,
}

impl Scale<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Scale<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.numbers.iter_mut().for_each(|p| *p *= self.by);
    }
}

struct Times<'a> {
    matrix: &'a BlockDiagonal,
    panels: &'a [Panel],
    count: usize,
    rows: &'a [f64],
    out: &'a mut [f64],
}

impl Times<'_> {
    #[inline(never)]
    fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Times<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { matrix, panels, count, rows, out } = self;
        let mut begin = 0;
        for panel in panels {
            let (rows, out) = (&rows[panel.of(count)], &mut out[panel.of(count)]);
            out.fill(0.0);
            for i in 0..panel.width {
                let p = &matrix.numbers[begin..=begin + i];
                begin += i + 1;
                let some = SIDE_BY_SIDE * panel.width;
                for (x, out) in rows.chunks(some).zip(out.chunks_mut(some)) {
                    if x.len() == some {
                        row_times::<S, SIDE_BY_SIDE>(simd, p, x, out, panel.width);
                    } else {
                        for (x, out) in x.chunks_exact(panel.width).zip(out.chunks_exact_mut(panel.width)) {
                            row_times::<S, 1>(simd, p, x, out, panel.width);
                        }
                    }
                }
            }
        }
    }
}

/// Number of rows that share the loads of the covariance: the outputs of a vessel.
const SIDE_BY_SIDE: usize = 3;

/// Adds a row `p` of the triangle, up to its diagonal, to `N` products: `out_i += p x` and, mirrored, `out += p x_i`.
#[inline(always)]
fn row_times<S: Simd, const N: usize>(simd: S, p: &[f64], x: &[f64], out: &mut [f64], width: usize) {
    let i = p.len() - 1;
    let (diagonal, p) = (p[i], &p[..i]);
    let x: [&[f64]; N] = from_fn(|n| &x[n * width..(n + 1) * width]);
    let mut rows = out.chunks_exact_mut(width);
    let mut out: [&mut [f64]; N] = from_fn(|_| rows.next().unwrap_or_default());
    let (p_whole, p_rest) = f64::whole::<S>(p);
    let (len, whole) = (p_whole.len(), i - p_rest.len());
    let x_i = x.map(|x| x[i]);
    let x_whole = x.map(|x| &f64::whole::<S>(&x[..i]).0[..len]);
    let out_whole = out.each_mut().map(|out| &mut f64::whole_mut::<S>(&mut out[..i]).0[..len]);
    let by = x_i.map(|x| Pack::<S, f64>::splat(simd, x));
    let mut sums = [Pack::<S, f64>::splat(simd, 0.0); N];
    for c in 0..len {
        let p = Pack::new(simd, p_whole[c]);
        for n in 0..N {
            sums[n] = p.mul_add(Pack::new(simd, x_whole[n][c]), sums[n]);
            out_whole[n][c] = p.mul_add(by[n], Pack::new(simd, out_whole[n][c])).v;
        }
    }
    for n in 0..N {
        let mut sum = sums[n].sum() + diagonal * x_i[n];
        for (&p, (&x, out)) in p_rest.iter().zip(x[n][whole..i].iter().zip(&mut out[n][whole..i])) {
            sum += p * x;
            *out += p * x_i[n];
        }
        out[n][i] += sum;
    }
}
