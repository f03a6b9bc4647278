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
pub(super) fn weight_average(models: &[ControlAffine]) -> Option<ControlAffine> {
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use hydroid_core::actuator::Map;
    use hydroid_core::control::{Affine as _, AffineNetwork, Motion};
    use hydroid_core::model::affine::Effector;
    use hydroid_core::model::recurrent::Scaling;

    use super::*;

    fn network(hidden: &[usize], seed: usize) -> ControlAffine {
        let network = Perceptron { inputs: 3, hidden: hidden.to_vec(), outputs: 9 };
        let weights = (0..network.weights()).map(|k| 0.5 * ((k * (seed + 3)) as f64).sin()).collect();
        let lag = |factor: f64| factor * (1.0 + seed as f64);
        ControlAffine {
            weights,
            scaling: Scaling {
                output_mean: vec![1.0, 0.1, 0.0],
                output_scale: vec![2.0, 0.5, 0.3],
                input_mean: vec![0.0; 2],
                input_scale: vec![1.0; 2],
                correction_scale: vec![0.7, 0.3, 0.4],
            },
            effectors: vec![
                Effector { map: Map::Identity, time_constant_s: lag(1.0), unit: 100.0 },
                Effector { map: Map::Sine, time_constant_s: lag(0.1), unit: 0.5 },
            ],
            dt: 0.1,
            wash_out: 10,
            network,
        }
    }

    #[test]
    fn f_and_g_of_the_mean_are_the_means() {
        for hidden in [&[4][..], &[4, 3]] {
            let models: Vec<ControlAffine> = (0..3).map(|seed| network(hidden, seed)).collect();
            let mean = weight_average(&models).unwrap();
            assert_eq!(mean.check(), Ok(()));
            assert!((mean.effectors[1].time_constant_s - 0.1 * 6.0_f64.cbrt()).abs() < 1e-12);
            let at = |model: &ControlAffine| {
                let mut motion = Motion::new(2);
                AffineNetwork::new(Arc::new(model.clone())).unwrap().evaluate([1.7, -0.2, 0.1], &mut motion);
                motion
            };
            let (ours, each) = (at(&mean), models.iter().map(at).collect::<Vec<Motion>>());
            for j in 0..3 {
                let of = |value: fn(&Motion, usize) -> f64| {
                    (value(&ours, j), each.iter().map(|m| value(m, j)).sum::<f64>() / 3.0)
                };
                for (ours, theirs) in [of(|m, j| m.f[j]), of(|m, j| m.g[0][j]), of(|m, j| m.g[1][j])] {
                    assert!((ours - theirs).abs() < 1e-14, "{hidden:?} {j}: {ours} {theirs}");
                }
            }
        }
        assert_eq!(weight_average(&[]), None);
    }
}
