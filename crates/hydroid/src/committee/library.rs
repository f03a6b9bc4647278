//! Libraries of the candidates.

use hydroid_core::model::committee::Shape;
use hydroid_core::model::sparse::Term;

use crate::log::Trajectory;
use crate::sindy::{self, Family, Variables};

/// Most terms of a library.
const MOST_TERMS: usize = 120;

/// A library over the variables of [`Shape`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Library {
    /// The constant, all variables and their signed squares, and products of two present outputs.
    Plain,
    /// All products of two variables.
    Quadratic,
    /// [`Quadratic`](Self::Quadratic) and the signed squares.
    QuadraticModulus,
    /// All products of three variables.
    Cubic,
    /// The manoeuvring terms of [`Family::Marine`] in the present outputs and commands, and all past values.
    Marine,
}

impl Library {
    pub(super) const ALL: [Self; 5] =
        [Self::Plain, Self::Quadratic, Self::QuadraticModulus, Self::Cubic, Self::Marine];

    /// The terms, the constant first; `None` if there are too many.
    pub(super) fn terms(self, shape: &Shape, run: &Trajectory) -> Option<Vec<Term>> {
        let all = u16::try_from(shape.variables()).ok()?;
        let outputs = u16::try_from(shape.outputs).ok()?;
        let bound = |degree: u32| {
            (1..=degree).fold(1, |count, d| count * (u64::from(all) + u64::from(d)) / u64::from(d))
        };
        let smallest = match self {
            Self::Quadratic | Self::QuadraticModulus => bound(2),
            Self::Cubic => bound(3),
            Self::Plain | Self::Marine => u64::from(all),
        };
        if smallest > MOST_TERMS as u64 {
            return None;
        }
        let mut terms = vec![Term::constant()];
        terms.extend((0..all).map(|a| Term::monomial(&[a])));
        if matches!(self, Self::Plain | Self::QuadraticModulus) {
            terms.extend((0..all).map(|a| Term::signed_square(a, a)));
        }
        match self {
            Self::Plain => {
                terms.extend((0..outputs).flat_map(|a| (0..a).map(move |b| Term::monomial(&[a, b]))));
            }
            Self::Quadratic | Self::QuadraticModulus | Self::Cubic => {
                for a in 0..all {
                    for b in a..all {
                        terms.push(Term::monomial(&[a, b]));
                        if self == Self::Cubic {
                            terms.extend((b..all).map(|c| Term::monomial(&[a, b, c])));
                        }
                    }
                }
            }
            Self::Marine => {
                terms.extend(sindy::Library::default().with(Family::Marine).terms(&Variables::of(run)));
            }
        }
        terms.sort_unstable();
        terms.dedup();
        (terms.len() <= MOST_TERMS).then_some(terms)
    }
}
