//! The recent motion of the vessel, extrapolated as a third expectation of the measurements.

/// Value and change per sample of each output; NaN where an output was not measured.
pub(super) type Motion = [[f64; 2]];

/// Estimates the motion from measurements (rows of all outputs, oldest first) by the means of the two halves. An output
/// keeps its motion if it is missing in the last row or in more than half of either half.
pub(super) fn estimate_motion(rows: &[f64], motion: &mut Motion) {
    let n = motion.len();
    let count = rows.len() / n / 2;
    let (before, late) = rows.split_at(count * n);
    for (i, into) in motion.iter_mut().enumerate() {
        let mean = |rows: &[f64]| {
            let (mut value, mut time, mut measured) = (0.0, 0.0, 0_usize);
            for (k, y) in rows.iter().skip(i).step_by(n).enumerate().filter(|(_, y)| !y.is_nan()) {
                (value, time, measured) = (value + y, time + k as f64, measured + 1);
            }
            (2 * measured >= count).then(|| (value / measured as f64, time / measured as f64))
        };
        let is_last_measured = !rows[rows.len() - n + i].is_nan();
        if let (true, Some((y0, t0)), Some((y1, t1))) = (is_last_measured, mean(before), mean(late)) {
            let dy = (y1 - y0) / (count as f64 + t1 - t0);
            if dy.is_finite() {
                *into = [y1 + ((count - 1) as f64 - t1) * dy, dy];
            }
        }
    }
}

pub(super) fn extrapolate(motion: &mut Motion) {
    for [y, dy] in motion {
        *y += *dy;
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    #[test]
    fn motion_is_estimated_from_two_halves() {
        let mut motion = [[f64::NAN; 2], [f64::NAN; 2], [7.0, 1.0], [7.0, 1.0]];
        // The second output is measured in half of each half, the third in less, the fourth not at the end.
        let row = |k: u32| {
            let line = 2.0 + 0.1 * f64::from(k);
            let with = |measured: bool| if measured { line } else { f64::NAN };
            [line, with([1, 2, 4, 7].contains(&k)), with([0, 1, 2, 3, 7].contains(&k)), with(k < 7)]
        };
        estimate_motion(&(0..8).flat_map(row).collect::<Vec<_>>(), &mut motion);
        extrapolate(&mut motion);
        let [all, some, less, ended] = motion;
        for [y, dy] in [all, some] {
            assert!((y - 2.8).abs() < 1e-12 && (dy - 0.1).abs() < 1e-12, "{motion:?}");
        }
        assert_eq!([less, ended], [[8.0, 1.0]; 2]);
    }
}
