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
