//! The map from weights to the numbers of a vessel.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use crate::craft::Craft;
use crate::model::CraftModel;

/// The largest weight: a number of fixed sign stays between a tenth and ten times its initial value, the change of
/// others below 2.3 times it.
const LARGEST: f64 = core::f64::consts::LN_10;

/// Halvings of a change of the weights that leaves the set of physical vessels, before it is rejected.
const HALVINGS: usize = 20;

/// Weights as relative changes of the numbers: they start at zero, and one set of options suits all vessels.
///
/// ```text
/// p = p_0 exp(w)      numbers of fixed sign: masses, added masses, diagonal damping, thrust, gains, time constants
/// p = p_0 (1 + w)     numbers of either sign: x_g, the coupling of sway and yaw
/// ```
///
/// Both agree to first order. A weight belongs to one number, or to several that are equal.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct PlantParameters {
    craft: Craft,
    given: Vec<f64>,
    signed: Vec<bool>,
    groups: Vec<Vec<usize>>,
    /// The weight of each number.
    weight_of: Vec<Option<usize>>,
}

impl PlantParameters {
    pub(in super::super) fn new(model: &CraftModel) -> Self {
        let parameters = model.craft().parameters();
        let groups = model.learned().to_vec();
        let mut weight_of = vec![None; parameters.len()];
        for (weight, group) in groups.iter().enumerate() {
            for &place in group {
                weight_of[place] = Some(weight);
            }
        }
        Self {
            craft: model.craft().clone(),
            given: parameters.iter().map(|(_, number)| *number).collect(),
            signed: parameters.iter().map(|(parameter, _)| parameter.signed).collect(),
            groups,
            weight_of,
        }
    }

    pub(in super::super) fn craft(&self) -> &Craft {
        &self.craft
    }

    /// Numbers of each weight.
    pub(in super::super) fn groups(&self) -> &[Vec<usize>] {
        &self.groups
    }

    pub(in super::super) fn weight_of(&self, place: usize) -> Option<usize> {
        self.weight_of[place]
    }

    /// A number under its weight, and its derivative with respect to it.
    pub(in super::super) fn value(&self, place: usize, w: f64) -> (f64, f64) {
        let given = self.given[place];
        if self.signed[place] {
            return (given * (1.0 + w), given);
        }
        let value = given * Float::exp(w);
        (value, value)
    }

    fn number(&self, place: usize, weights: &[f64]) -> f64 {
        self.weight_of[place].map_or(self.given[place], |weight| self.value(place, weights[weight]).0)
    }

    /// All numbers.
    pub(in super::super) fn numbers<'a>(&'a self, weights: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        (0..self.given.len()).map(|place| self.number(place, weights))
    }

    /// Projects `to` onto the set of physical vessels: clamps each weight, then halves the distance to the valid
    /// weights `from` until the mass matrix of each mode is positive definite.
    pub(in super::super) fn project(&self, from: &[f64], to: &mut [f64]) {
        for (to, from) in to.iter_mut().zip(from) {
            *to = if to.is_nan() { *from } else { to.clamp(-LARGEST, LARGEST) };
        }
        for _ in 0..HALVINGS {
            if self.is_solvable(to) {
                return;
            }
            to.iter_mut().zip(from).for_each(|(to, from)| *to = 0.5 * (*to + from));
        }
        to.copy_from_slice(from);
    }

    fn is_solvable(&self, weights: &[f64]) -> bool {
        let (mut hull, mut flying) = (self.craft.hull, self.craft.flying);
        let mut numbers = self.numbers(weights);
        let mut next = |place: &mut f64| *place = numbers.next().unwrap_or(f64::NAN);
        hull.visit_numbers(&mut next);
        if let Some(flying) = &mut flying {
            flying.visit_numbers(&mut next);
        }
        hull.is_solvable(flying.as_ref()) && self.numbers(weights).all(f64::is_finite)
    }
}
