//! Decimation of curves for drawing.

/// At most about `2 bins` points: minimum and maximum of each bin, in their order. Gaps remain gaps.
pub fn envelope(points: impl ExactSizeIterator<Item = (f64, f64)>, bins: usize) -> Vec<(f64, f64)> {
    let size = points.len().div_ceil(bins.max(1)).max(1);
    if size <= 2 {
        return points.collect();
    }
    let all: Vec<(f64, f64)> = points.collect();
    let mut kept = Vec::with_capacity(2 * bins + 2);
    for bin in all.chunks(size) {
        for part in bin.split(|p| p.1.is_nan()) {
            let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
            if let (Some(&low), Some(&high)) = (part.iter().min_by(by_value), part.iter().max_by(by_value)) {
                if low.0 < high.0 {
                    kept.extend([low, high]);
                } else if high.0 < low.0 {
                    kept.extend([high, low]);
                } else {
                    kept.push(low);
                }
            }
            let gap = kept.last().is_some_and(|p| p.1.is_nan());
            if !gap && part.len() < bin.len() {
                kept.push((bin[0].0, f64::NAN));
            }
        }
    }
    kept
}

/// The corners of a staircase of values held over `dt`. Equal neighbours form one step.
pub fn steps(values: impl Iterator<Item = f64>, t0: f64, dt: f64) -> Vec<(f64, f64)> {
    let mut corners: Vec<(f64, f64)> = Vec::new();
    let mut end = t0;
    for (k, value) in values.enumerate() {
        let t = t0 + k as f64 * dt;
        end = t + dt;
        match corners.last().copied() {
            Some((_, last)) if last == value => {}
            Some((_, last)) => corners.extend([(t, last), (t, value)]),
            None => corners.push((t, value)),
        }
    }
    if let Some(&(_, last)) = corners.last() {
        corners.push((end, last));
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_envelope_keeps_extremes_and_gaps() {
        let value = |k: usize| match k {
            500 => 9.0,
            700..800 => f64::NAN,
            _ => (k as f64 * 0.01).sin(),
        };
        let thin = envelope((0..1000).map(|k| (k as f64, value(k))), 50);
        assert!(thin.len() <= 110, "{}", thin.len());
        assert!(thin.contains(&(500.0, 9.0)));
        assert!(thin.iter().any(|p| p.1.is_nan()));
        assert!(thin.windows(2).all(|p| p[0].0 <= p[1].0));
        assert_eq!(envelope((0..3).map(|k| (f64::from(k), 0.0)), 50).len(), 3);
        assert!(envelope(std::iter::empty::<(f64, f64)>().collect::<Vec<_>>().into_iter(), 0).is_empty());
    }

    #[test]
    fn held_values_are_stairs() {
        let stairs = steps([1.0, 1.0, 2.0].into_iter(), 0.0, 0.5);
        assert_eq!(stairs, [(0.0, 1.0), (1.0, 1.0), (1.0, 2.0), (1.5, 2.0)]);
        assert!(steps(std::iter::empty(), 0.0, 1.0).is_empty());
    }
}
