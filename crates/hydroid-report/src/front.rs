//! Pareto front of the trials: smallest error for each number of terms.

use hydroid::sindy::Trial;

/// Pareto front of score against number of terms, fewest terms first.
pub fn front(trials: &[Trial]) -> Vec<(f64, f64)> {
    let mut points: Vec<(usize, f64)> = trials
        .iter()
        .filter(|t| t.finalist)
        .filter_map(|t| Some((t.terms, t.score.filter(|s| s.is_finite())?)))
        .collect();
    points.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut best = f64::INFINITY;
    points.retain(|(_, score)| {
        let ahead = *score < best;
        best = best.min(*score);
        ahead
    });
    points.into_iter().map(|(terms, score)| (terms as f64, score)).collect()
}

pub fn stairs(front: &[(f64, f64)], end: f64) -> Vec<(f64, f64)> {
    let mut line = Vec::new();
    for (i, &(terms, score)) in front.iter().enumerate() {
        line.push((terms, score));
        line.push((front.get(i + 1).map_or(end, |next| next.0), score));
    }
    line
}
