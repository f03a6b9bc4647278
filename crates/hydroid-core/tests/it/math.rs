//! Elementary functions compared with the standard library in double precision, over the whole range.

use hydroid_core::math::{Scalar, exp, sigmoid, tanh};

type OnSlice<T> = fn(&mut [T]);

/// Numbers of either sign and all sizes: special values, and a dense sweep of the bit patterns.
fn singles() -> Vec<f32> {
    let mut x: Vec<f32> = (0..u32::MAX / 1009).map(|k| f32::from_bits(k * 1009)).collect();
    let near = |centre: f32| (0..2000_u32).map(move |k| f32::from_bits(centre.to_bits() - 1000 + k));
    for centre in [0.17328_f32, 0.34657, 0.51986, 1.0, 8.6643, 9.01, 10.0, 87.0, 88.72, 103.97] {
        x.extend(near(centre).flat_map(|x| [x, -x]));
    }
    x.extend([0.0, -0.0, f32::MIN_POSITIVE, f32::MAX, f32::MIN, f32::INFINITY, f32::NEG_INFINITY, f32::NAN]);
    x
}

fn doubles() -> Vec<f64> {
    let mut x: Vec<f64> = (0..4_000_000_u64).map(|k| f64::from_bits(k * 4_611_686_018_427)).collect();
    x.extend((-2_000_000..2_000_000).map(|k| f64::from(k) * 1.1e-5));
    x.extend((-800_000..800_000).map(|k| f64::from(k) * 1.013e-3));
    x.extend([
        0.0,
        -0.0,
        f64::MIN_POSITIVE,
        5e-324,
        f64::MAX,
        f64::MIN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
    ]);
    x
}

/// Largest error of `ours`, relative to the result or, where that is below `tiny`, to `tiny`.
fn error<T: Scalar>(x: &[T], ours: OnSlice<T>, truth: fn(f64) -> f64, tiny: f64) -> f64 {
    let mut y = x.to_vec();
    ours(&mut y);
    let mut worst = (0.0, T::zero());
    for (&x, &y) in x.iter().zip(&y) {
        let truth = truth(x.wide());
        // Infinite beyond the largest number of the type.
        if x.is_nan() || !T::of(truth).is_finite() {
            assert!(y.is_nan() == x.is_nan() && (x.is_nan() || y == T::of(truth)), "{x:?} gives {y:?}");
            continue;
        }
        let error = (y.wide() - truth).abs() / truth.abs().max(tiny);
        assert!(error.is_finite(), "{x:?} gives {y:?}, not {truth}");
        if error > worst.0 {
            worst = (error, x);
        }
    }
    println!("{worst:?}");
    worst.0
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

#[test]
fn errors_stay_below_the_bound_in_single_precision() {
    let x = singles();
    let tiny = f64::from(f32::MIN_POSITIVE);
    assert!(error::<f32>(&x, exp, f64::exp, tiny) <= 1.5e-7);
    assert!(error::<f32>(&x, tanh, f64::tanh, tiny) <= 2.5e-7);
    assert!(error::<f32>(&x, sigmoid, logistic, 1e-30) <= 2.5e-7);
}

#[test]
fn errors_stay_below_the_bound_in_double_precision() {
    let x = doubles();
    assert!(error::<f64>(&x, exp, f64::exp, f64::MIN_POSITIVE) <= 3e-16);
    assert!(error::<f64>(&x, tanh, f64::tanh, f64::MIN_POSITIVE) <= 7e-16);
    assert!(error::<f64>(&x, sigmoid, logistic, 1e-290) <= 5e-16);
}

fn an_element_at_a_time_equals_the_slice<T: Scalar>(x: &[T], bits: fn(T) -> u64) {
    for f in [exp::<T> as OnSlice<T>, tanh, sigmoid] {
        let mut slice = x.to_vec();
        f(&mut slice);
        for (&x, &y) in x.iter().zip(&slice).step_by(37) {
            let mut one = [x];
            f(&mut one);
            assert!(
                bits(one[0]) == bits(y) || one[0].is_nan() && y.is_nan(),
                "{x:?}: {:?} alone, {y:?}",
                one[0]
            );
        }
        for len in 0..70 {
            let mut part = x[x.len() / 3..][..len].to_vec();
            f(&mut part);
            assert!(
                part.iter().zip(&slice[x.len() / 3..]).all(|(&a, &b)| bits(a) == bits(b)),
                "{len} elements"
            );
        }
    }
}

#[test]
fn single_elements_equal_elements_of_a_slice() {
    an_element_at_a_time_equals_the_slice(&singles(), |x: f32| x.to_bits().into());
    an_element_at_a_time_equals_the_slice(&doubles(), f64::to_bits);
}

fn shape<T: Scalar>(mut x: Vec<T>) {
    x.retain(|x| !x.is_nan());
    let mut y = x.clone();
    tanh(&mut y);
    let mut mirrored: Vec<T> = x.iter().map(|&x| -x).collect();
    tanh(&mut mirrored);
    for ((&x, &y), &m) in x.iter().zip(&y).zip(&mirrored) {
        assert!(y == -m && y.is_sign_negative() != m.is_sign_negative(), "odd: {x:?} gives {y:?} and {m:?}");
        assert!(y.abs() <= T::one() && y.abs() <= x.abs() * T::of(1.0 + 1e-6), "{x:?} gives {y:?}");
    }
    for f in [exp::<T> as OnSlice<T>, tanh, sigmoid] {
        let mut y: Vec<T> = (-40_000..40_000).map(|k| T::of(f64::from(k) * 7.3e-4)).collect();
        f(&mut y);
        // Up to the last digit, where the functions are flat.
        let last = T::one() - T::epsilon();
        assert!(
            y.windows(2).all(|pair| if pair[0] > T::zero() {
                pair[0] * last <= pair[1]
            } else {
                pair[0] <= pair[1] * last
            }),
            "rises"
        );
    }
}

#[test]
fn tanh_is_odd_and_bounded_and_none_falls() {
    shape(singles());
    shape(doubles());
}

#[test]
fn ends() {
    let ends = [f64::NEG_INFINITY, -0.0, 0.0, f64::INFINITY];
    let of = |f: OnSlice<f64>| {
        let mut y = ends;
        f(&mut y);
        y
    };
    assert_eq!(of(tanh), [-1.0, 0.0, 0.0, 1.0]);
    assert_eq!(of(exp), [0.0, 1.0, 1.0, f64::INFINITY]);
    assert_eq!(of(sigmoid)[1..], [0.5, 0.5, 1.0]);
    assert!(of(sigmoid)[0] < 1e-300);
}
