//! The parameters of a vessel as weights.

use alloc::vec::Vec;

use num_traits::Float;

use crate::vessel::{Form, Numbers, PARAMETER, is_solvable};

/// The largest weight: a parameter of one sign stays within a tenth and ten times of what was given, others within 2.3 times
/// of it away from it.
const LARGEST: f64 = core::f64::consts::LN_10;

/// Halvings of a step that leads to parameters that no vessel has, before it is not made at all.
const HALVINGS: usize = 20;

/// How weights stand for parameters: the relative change, so that each begins at zero and one tuning suits all vessels.
///
/// ```text
/// p = p_0 exp(w)      parameters whose sign is given: masses, added masses, damping of a motion by itself, gains, times
/// p = p_0 (1 + w)     parameters of either sign: x_g, the coupling of sway and yaw
/// ```
///
/// To first order both are the same. Parameters that are zero are not among them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlantWeights {
    form: Form,
    given: Numbers,
    places: Vec<usize>,
}

impl PlantWeights {
    pub(super) fn new(form: Form, given: &Numbers) -> Self {
        let flying = |place: usize| PARAMETER[place].path.starts_with("flying.");
        let places = (0..given.len()).filter(|&place| given[place] != 0.0 && (form.flying || !flying(place)));
        Self { form, given: *given, places: places.collect() }
    }

    pub(super) fn form(&self) -> Form {
        self.form
    }

    /// Where the parameters stand among [`PARAMETER`].
    pub(super) fn places(&self) -> &[usize] {
        &self.places
    }

    /// The parameter that a weight stands for, and how fast it changes with it.
    pub(super) fn value(&self, index: usize, w: f64) -> (f64, f64) {
        let place = self.places[index];
        let given = self.given[place];
        if PARAMETER[place].signed {
            return (given * (1.0 + w), given);
        }
        let value = given * Float::exp(w);
        (value, value)
    }

    /// All parameters with these weights.
    pub(super) fn numbers(&self, weights: &[f64]) -> Numbers {
        let mut numbers = self.given;
        for (index, (&place, &w)) in self.places.iter().zip(weights).enumerate() {
            numbers[place] = self.value(index, w).0;
        }
        numbers
    }

    /// Brings `to` back to what a vessel can have: each weight within its bounds, and then so far towards `from`, which are
    /// such weights, that the mass matrix of each mode is positive definite.
    pub(super) fn admit(&self, from: &[f64], to: &mut [f64]) {
        for (to, from) in to.iter_mut().zip(from) {
            *to = if to.is_nan() { *from } else { to.clamp(-LARGEST, LARGEST) };
        }
        for _ in 0..HALVINGS {
            if is_solvable(self.form, &self.numbers(to)) {
                return;
            }
            to.iter_mut().zip(from).for_each(|(to, from)| *to = 0.5 * (*to + from));
        }
        to.copy_from_slice(from);
    }
}
