//! Average of control-affine networks.

use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::direct::Perceptron;

/// Average of networks of one shape and scaling: one network whose layers are the layers of all, side by side.
///
/// ```text
/// f = 1/R sum_k f_k,     g_i = 1/R sum_k g_ik,     ln T_i = 1/R sum_k ln T_ik
/// ```
///
/// The average is control-affine as well. It reduces the variance due to initial weights and the order of windows.
/// Source: L. K. Hansen and P. Salamon, *Neural network ensembles*, IEEE PAMI, 1990.
pub fn weight_average(models: &[ControlAffine]) -> Option<ControlAffine> {
    let first = models.first()?;
    let (count, deep) = (models.len(), first.network.hidden.len());
    if deep == 0 {
        return (count == 1).then(|| first.clone());
    }
    let hidden: Vec<usize> = first.network.hidden.iter().map(|units| count * units).collect();
    let network = Perceptron { hidden, ..first.network.clone() };
    network.check().ok()?;
    let mut weights = vec![0.0; network.weights()];
    let (wide, narrow) = (network.tensors(), first.network.tensors());
    for (index, (into, from)) in wide.iter().zip(&narrow).enumerate() {
        let (layer, is_bias) = (index / 2, index % 2 == 1);
        for (k, model) in models.iter().enumerate() {
            let given = &model.weights[from.range()];
            let rows = if layer == deep { 0 } else { k * from.rows };
            // The first layer reads the common outputs, each other layer the previous layer of its own network.
            let columns = if layer == 0 { 0 } else { k * from.columns };
            let share = if layer == deep { 1.0 / count as f64 } else { 1.0 };
            let (wide, place) = (&mut weights[into.range()], |r: usize, c: usize| {
                if is_bias { rows + r } else { (rows + r) * into.columns + columns + c }
            });
            let width = if is_bias { 1 } else { from.columns };
            for (at, value) in given.iter().enumerate() {
                wide[place(at / width, at % width)] += share * value;
            }
        }
    }
    let mut effectors = first.effectors.clone();
    for (i, effector) in effectors.iter_mut().enumerate() {
        let logarithm: f64 = models.iter().map(|model| model.effectors[i].time_constant_s.ln()).sum();
        effector.time_constant_s = (logarithm / count as f64).exp();
    }
    Some(ControlAffine { network, weights, effectors, ..first.clone() })
}
