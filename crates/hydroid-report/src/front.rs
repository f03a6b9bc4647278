//! Pareto front of the trials: smallest error for each number of terms.

use hydroid::sindy::Trial;

/// Pareto front of score against number of terms, fewest terms first.
pub(super) fn front(trials: &[Trial]) -> Vec<(f64, f64)> {
    let mut points: Vec<(usize, f64)> =
        trials.iter().filter_map(|t| t.score.filter(|s| s.is_finite()).map(|s| (t.terms, s))).collect();
    points.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut best = f64::INFINITY;
    points.retain(|(_, score)| {
        let ahead = *score < best;
        best = best.min(*score);
        ahead
    });
    points.into_iter().map(|(terms, score)| (terms as f64, score)).collect()
}

pub(super) fn stairs(front: &[(f64, f64)], end: f64) -> Vec<(f64, f64)> {
    let mut line = Vec::new();
    for (i, &(terms, score)) in front.iter().enumerate() {
        line.push((terms, score));
        line.push((front.get(i + 1).map_or(end, |next| next.0), score));
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroid::sindy::{Library, Optimizer, RegressionForm};

    #[test]
    fn the_front_falls() {
        let trial = |terms, score| Trial {
            structure: Library::polynomial(1).into(),
            regression: RegressionForm::Central,
            optimizer: Optimizer::Stepwise(0.01),
            ridge: 0.0,
            terms,
            score,
            validation: score,
            training: None,
            diverged: 0,
        };
        let trials = [
            trial(5, Some(0.3)),
            trial(2, Some(0.9)),
            trial(2, Some(0.7)),
            trial(3, Some(0.8)),
            trial(9, Some(0.3)),
            trial(1, None),
        ];
        let front = front(&trials);
        assert_eq!(front, [(2.0, 0.7), (5.0, 0.3)]);
        assert_eq!(stairs(&front, 10.0), [(2.0, 0.7), (5.0, 0.7), (5.0, 0.3), (10.0, 0.3)]);
    }
}
