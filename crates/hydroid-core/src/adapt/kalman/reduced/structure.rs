//! What is kept of the covariance of the weights.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use pulp::{Arch, Simd, WithSimd};

use super::super::tuning::Memory;
use super::blocks::Blocks;
use super::diagonal::Diagonal;
use super::low_rank::LowRank;
use super::panels::Panel;
use crate::math::Scalar;

/// `P_tt`, one structure or another. Matrices with a column for each weight are in panels.
#[derive(Clone, Debug)]
pub(super) enum Structure<T> {
    Blocks(Blocks<T>),
    Diagonal(Diagonal<T>),
    LowRank(Box<LowRank<T>>),
}

impl<T: Scalar> Structure<T> {
    /// All zero. Blocks are the panels.
    pub(super) fn new(memory: Memory, panels: &[Panel], outputs: usize) -> Self {
        match memory {
            Memory::Full | Memory::Blocks { .. } => Self::Blocks(Blocks::new(panels)),
            Memory::Diagonal => Self::Diagonal(Diagonal::new(panels.iter().map(|panel| panel.width).sum())),
            Memory::LowRank { rank } => Self::LowRank(Box::new(LowRank::new(panels, rank, outputs))),
        }
    }

    /// A diagonal covariance.
    pub(super) fn set_diagonal(&mut self, panels: &[Panel], diagonal: &[T]) {
        match self {
            Self::Blocks(blocks) => {
                blocks.numbers.fill(T::zero());
                blocks.each_diagonal(panels, |at, p| *p = diagonal[at]);
            }
            Self::Diagonal(own) => own.p.copy_from_slice(diagonal),
            Self::LowRank(low_rank) => low_rank.set_diagonal(diagonal),
        }
    }

    /// Its diagonal.
    pub(super) fn diagonal(&self, panels: &[Panel]) -> Vec<T> {
        match self {
            Self::Blocks(blocks) => {
                let mut diagonal = vec![T::zero(); panels.iter().map(|panel| panel.width).sum()];
                blocks.clone().each_diagonal(panels, |at, p| diagonal[at] = *p);
                diagonal
            }
            Self::Diagonal(own) => own.p.clone(),
            Self::LowRank(low_rank) => low_rank.diagonal(panels),
        }
    }

    /// `P <- grows^2 P + diag(noise)`.
    pub(super) fn advance(&mut self, panels: &[Panel], grows: T, noise: &[T]) {
        T::reduced_advance(Arch::new(), Advance { structure: self, panels, grows, noise });
    }

    /// `out = rows P`; of each, `count` rows, no more than there are outputs.
    pub(super) fn times(&mut self, panels: &[Panel], count: usize, rows: &[T], out: &mut [T]) {
        T::reduced_times(Arch::new(), Times { structure: self, panels, count, rows, out });
    }

    /// What a measurement takes: `P <- P - w w'`, or `P^-1 <- P^-1 + h h'`, which is the same before the structure is
    /// kept; of both, the first `count` of `rows` rows.
    #[inline(always)]
    pub(super) fn correct(&mut self, panels: &[Panel], count: (usize, usize), w: &[T], h: &[T]) {
        match self {
            Self::Blocks(blocks) => blocks.correct(panels, count, w),
            Self::Diagonal(diagonal) => diagonal.correct(panels, count, w),
            Self::LowRank(low_rank) => low_rank.correct(panels, count, h),
        }
    }

    /// All that is kept.
    pub(super) fn parts(&self) -> [&[T]; 2] {
        match self {
            Self::Blocks(blocks) => [&blocks.numbers, &[]],
            Self::Diagonal(diagonal) => [&diagonal.p, &[]],
            Self::LowRank(low_rank) => [&low_rank.v, &low_rank.directions],
        }
    }

    /// The same, to put it back.
    pub(super) fn parts_mut(&mut self) -> [&mut [T]; 2] {
        match self {
            Self::Blocks(blocks) => [&mut blocks.numbers, &mut []],
            Self::Diagonal(diagonal) => [&mut diagonal.p, &mut []],
            Self::LowRank(low_rank) => [&mut low_rank.v, &mut low_rank.directions],
        }
    }
}

/// [`Structure::advance`] for whatever vectors there are.
pub struct Advance<'a, T> {
    structure: &'a mut Structure<T>,
    panels: &'a [Panel],
    grows: T,
    noise: &'a [T],
}

impl<T: Scalar> WithSimd for Advance<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { structure, panels, grows, noise } = self;
        match structure {
            Structure::Blocks(blocks) => blocks.advance(panels, grows, noise),
            Structure::Diagonal(diagonal) => diagonal.advance(grows, noise),
            Structure::LowRank(low_rank) => low_rank.advance(panels, grows, noise),
        }
    }
}

/// [`Structure::times`] for whatever vectors there are.
pub struct Times<'a, T> {
    structure: &'a mut Structure<T>,
    panels: &'a [Panel],
    count: usize,
    rows: &'a [T],
    out: &'a mut [T],
}

impl<T: Scalar> WithSimd for Times<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { structure, panels, count, rows, out } = self;
        match structure {
            Structure::Blocks(blocks) => blocks.times(simd, panels, count, rows, out),
            Structure::Diagonal(diagonal) => diagonal.times(panels, count, rows, out),
            Structure::LowRank(low_rank) => low_rank.times(panels, count, rows, out),
        }
    }
}
