//! Classical Runge-Kutta method of order 4, fixed step, no allocation.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use super::number::Number;

/// The right-hand side of `dx/dt = f(x)`. Closures are right-hand sides; a type of its own is always inlined.
pub trait Rate<T, const N: usize> {
    /// `f(x)`.
    fn rate(&self, x: &[T; N]) -> [T; N];
}

impl<T, const N: usize, F: Fn(&[T; N]) -> [T; N]> Rate<T, N> for F {
    #[inline(always)]
    fn rate(&self, x: &[T; N]) -> [T; N] {
        self(x)
    }
}

/// `x` after one step of `h` seconds along `dx/dt = f(x)`.
///
/// ```text
/// k1 = f(x)              k2 = f(x + h/2 k1)
/// k3 = f(x + h/2 k2)     k4 = f(x + h k3)
/// x+ = x + h/6 (k1 + 2 k2 + 2 k3 + k4)
/// ```
///
/// `f` does not depend on time, because the command is held. The local error is of order `h^5`, the global one `h^4`.
#[inline(always)]
#[expect(clippy::needless_pass_by_value, reason = "closures are passed as they are written")]
pub fn step<T: Number, const N: usize>(f: impl Rate<T, N>, x: &[T; N], h: f64) -> [T; N] {
    let half = 0.5 * h;
    let k1 = f.rate(x);
    let k2 = f.rate(&along(x, &k1, half));
    let k3 = f.rate(&along(x, &k2, half));
    let k4 = f.rate(&along(x, &k3, h));
    let sixth = h / 6.0;
    let mut next = *x;
    for i in 0..N {
        next[i] = x[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * sixth;
    }
    next
}

#[inline(always)]
fn along<T: Number, const N: usize>(x: &[T; N], k: &[T; N], a: f64) -> [T; N] {
    let mut moved = *x;
    for (moved, k) in moved.iter_mut().zip(k) {
        *moved = *moved + *k * a;
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::step;

    #[test]
    fn exact_for_a_cubic_in_time() {
        // Time is the first state; RK4 integrates polynomials up to degree 3 exactly.
        let mut x = [0.0, 0.0];
        for _ in 0..10 {
            x = step(|s: &[f64; 2]| [1.0, 4.0 * s[0] * s[0] * s[0]], &x, 0.1);
        }
        assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 1.0).abs() < 1e-14);
    }
}
