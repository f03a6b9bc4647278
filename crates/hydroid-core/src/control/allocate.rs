//! Control allocation by a damped pseudoinverse.

use num_traits::Float;

/// Computes the smallest efforts `tau` (relative to their `spans`) with `sum_i b_i tau_i = wanted`, and returns the
/// control authority. `columns` are the `b_i`, accelerations \[m/s^2\] per unit of effort. With `B = [b_i s_i]`,
///
/// ```text
/// tau = S B' (B B' + lambda^2 I)^-1 wanted,     lambda^2 = max(0, min_control_authority^2 - sigma^2)
/// ```
///
/// The control authority `sigma` \[m/s^2\] is the least singular value of `B`: the acceleration of all actuators
/// together in their weakest direction. For `sigma >= min_control_authority`, `B tau = wanted` exactly. Otherwise the
/// effort in the weak direction stays below `|wanted| / min_control_authority` spans and vanishes with `sigma`, and the
/// other direction changes in the order of `(min_control_authority / sigma_max)^2`. (Damped least squares: Y. Nakamura
/// and H. Hanafusa, *Inverse kinematic solutions with singularity robustness for robot manipulator control*, 1986;
/// damping near the singularity alone: S. Chiaverini, 1997.)
///
/// # Panics
/// If `spans` or `efforts` have not one number for each column.
pub fn allocate(
    columns: &[[f64; 2]],
    spans: &[f64],
    wanted: [f64; 2],
    min_control_authority: f64,
    efforts: &mut [f64],
) -> f64 {
    assert!(
        spans.len() == columns.len() && efforts.len() == columns.len(),
        "one span and effort for each column"
    );
    let ([x, y], sigma) = multipliers(columns, spans, wanted, min_control_authority);
    for ((effort, column), span) in efforts.iter_mut().zip(columns).zip(spans) {
        *effort = span * span * (column[0] * x + column[1] * y);
    }
    sigma
}

/// [`allocate`] within bounds on the efforts, for more actuators than the two directions need: an effort beyond a bound
/// is fixed at it, and the others take over the rest of the demand (redistributed pseudoinverse; T. A. Johansen and T. I.
/// Fossen, *Control allocation: a survey*, 2013). At least two efforts stay free, so that the result for two actuators is
/// that of [`allocate`]. Columns of fixed efforts are zero afterwards.
///
/// # Panics
/// As [`allocate`], and if `bounds` have not one pair for each column.
pub fn allocate_within(
    columns: &mut [[f64; 2]],
    spans: &[f64],
    bounds: &[[f64; 2]],
    wanted: [f64; 2],
    min_control_authority: f64,
    efforts: &mut [f64],
) -> f64 {
    assert_eq!(bounds.len(), columns.len(), "one pair of bounds for each column");
    let sigma = allocate(columns, spans, wanted, min_control_authority, efforts);
    let mut rest = wanted;
    let mut free = columns.iter().filter(|column| **column != [0.0; 2]).count();
    while free > 2 {
        let excess = |i: usize| {
            let [low, high] = bounds[i];
            (efforts[i] - high).max(low - efforts[i]) / spans[i]
        };
        let beyond = (0..columns.len()).filter(|&i| columns[i] != [0.0; 2] && excess(i) > 0.0);
        let Some(worst) = beyond.max_by(|&a, &b| excess(a).total_cmp(&excess(b))) else { break };
        let [low, high] = bounds[worst];
        efforts[worst] = efforts[worst].max(low).min(high);
        rest = core::array::from_fn(|axis| rest[axis] - columns[worst][axis] * efforts[worst]);
        columns[worst] = [0.0; 2];
        free -= 1;
        let ([x, y], _) = multipliers(columns, spans, rest, min_control_authority);
        for ((effort, column), span) in efforts.iter_mut().zip(&*columns).zip(spans) {
            if *column != [0.0; 2] {
                *effort = span * span * (column[0] * x + column[1] * y);
            }
        }
    }
    sigma
}

/// `(B B' + lambda^2 I)^-1 wanted`, and the control authority.
fn multipliers(
    columns: &[[f64; 2]],
    spans: &[f64],
    wanted: [f64; 2],
    min_control_authority: f64,
) -> ([f64; 2], f64) {
    let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
    for (&[x, y], &span) in columns.iter().zip(spans) {
        let square = span * span;
        a += square * x * x;
        b += square * x * y;
        c += square * y * y;
    }
    // The smaller root, from the product of both, avoids cancellation.
    let greater = 0.5 * (a + c) + Float::hypot(0.5 * (a - c), b);
    let lesser = if greater > 0.0 { ((a * c - b * b) / greater).max(0.0) } else { 0.0 };
    let damping = (min_control_authority * min_control_authority - lesser).max(0.0);
    let (a, c) = (a + damping, c + damping);
    let determinant = a * c - b * b;
    let [p, q] = wanted;
    ([(c * p - b * q) / determinant, (a * q - b * p) / determinant], Float::sqrt(lesser))
}
