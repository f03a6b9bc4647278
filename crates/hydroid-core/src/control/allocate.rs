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
    let (x, y) = ((c * p - b * q) / determinant, (a * q - b * p) / determinant);
    for ((effort, column), span) in efforts.iter_mut().zip(columns).zip(spans) {
        *effort = span * span * (column[0] * x + column[1] * y);
    }
    Float::sqrt(lesser)
}
