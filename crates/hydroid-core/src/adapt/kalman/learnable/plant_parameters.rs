//! The map from weights to the parameters of a vessel.

use alloc::vec::Vec;

use num_traits::Float;

use crate::vessel::{Form, Numbers, PARAMETER, is_solvable};

/// The largest weight: a parameter of fixed sign stays between a tenth and ten times its initial value, the change of
/// others below 2.3 times it.
const LARGEST: f64 = core::f64::consts::LN_10;

/// Halvings of a change of the weights that leaves the set of physical vessels, before it is rejected.
const HALVINGS: usize = 20;

/// Weights as relative changes of the parameters: they start at zero, and one set of options suits all vessels.
///
/// ```text
/// p = p_0 exp(w)      parameters of fixed sign: masses, added masses, diagonal damping, gains, time constants
/// p = p_0 (1 + w)     parameters of either sign: x_g, the coupling of sway and yaw
/// ```
///
/// Both agree to first order. Parameters that are zero are not learned.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct PlantParameters {
    form: Form,
    given: Numbers,
    places: Vec<usize>,
}

impl PlantParameters {
    pub(in super::super) fn new(form: Form, given: &Numbers) -> Self {
        let flying = |place: usize| PARAMETER[place].path.starts_with("flying.");
        let places = (0..given.len()).filter(|&place| given[place] != 0.0 && (form.flying || !flying(place)));
        Self { form, given: *given, places: places.collect() }
    }

    pub(in super::super) fn form(&self) -> Form {
        self.form
    }

    pub(in super::super) fn places(&self) -> &[usize] {
        &self.places
    }

    pub(in super::super) fn value(&self, index: usize, w: f64) -> (f64, f64) {
        let place = self.places[index];
        let given = self.given[place];
        if PARAMETER[place].signed {
            return (given * (1.0 + w), given);
        }
        let value = given * Float::exp(w);
        (value, value)
    }

    pub(in super::super) fn numbers(&self, weights: &[f64]) -> Numbers {
        let mut numbers = self.given;
        for (index, (&place, &w)) in self.places.iter().zip(weights).enumerate() {
            numbers[place] = self.value(index, w).0;
        }
        numbers
    }

    /// Projects `to` onto the set of physical vessels: clamps each weight, then halves the distance to the valid
    /// weights `from` until the mass matrix of each mode is positive definite.
    pub(in super::super) fn project(&self, from: &[f64], to: &mut [f64]) {
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
