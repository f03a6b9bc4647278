use alloc::vec;

use super::*;

/// Blocks of every width, with loops of their own or not, are passed over as plain sums say.
fn check<T: Scalar>(blocks: &[usize], split: fn(usize) -> Option<usize>, vectors: usize) {
    let rows = 2;
    let each = blocks.iter().enumerate().map(|(b, &len)| (len, b * rows, split(len)));
    let mut triangle = Triangle::<T>::new(each);
    let (width, spans) = (triangle.width(), triangle.spans().to_vec());
    let rank = Triangle::<T>::rank(vectors);
    let number = |k: usize| (0.37 * k as f64 + 0.2).sin();
    // Where a weight stands in a row, of its block and of all.
    let columns: Vec<(usize, usize)> =
        spans.iter().enumerate().flat_map(|(b, span)| (0..span.len).map(move |k| (b, k))).collect();
    let put = |matrix: &mut [T], of: usize, row: usize, (b, k): (usize, usize), x: f64| {
        matrix[spans[b].panel(of).start + row * spans[b].padded + k] = T::of(x);
    };
    let m = columns.len();
    let (mut downdate, mut local) = (vec![T::zero(); rank * width], vec![T::zero(); rows * width]);
    let (mut w, mut l) = (vec![vec![0.0; m]; vectors], vec![vec![0.0; m]; rows]);
    for (c, &(b, k)) in columns.iter().enumerate() {
        for (q, w) in w.iter_mut().enumerate() {
            w[c] = number(7 * c + q);
            put(&mut downdate, rank, q, (b, k), w[c]);
        }
        let own = split(spans[b].len).map(|split| usize::from(k >= split));
        for (r, l) in l.iter_mut().enumerate().filter(|(r, _)| own.is_none_or(|own| own == *r)) {
            l[c] = number(5 * c + r + 100);
            put(&mut local, rows, r, (b, k), l[c]);
        }
    }
    let diagonal: Vec<T> = (0..width).map(|c| T::of(2.0 + number(c))).collect();
    triangle.set_diagonal(&diagonal);
    let smallest = columns.iter().map(|&(b, k)| diagonal[spans[b].start + k]).fold(T::of(1e9), T::min);
    assert_eq!(triangle.least(), smallest);
    let mut p = vec![vec![0.0; m]; m];
    for (c, &(b, k)) in columns.iter().enumerate() {
        p[c][c] = diagonal[spans[b].start + k].wide();
    }
    let noise = vec![T::of(0.5); width];
    let all_rows = blocks.len() * rows;
    let mut products = vec![T::zero(); all_rows * width];
    for _ in 0..2 {
        triangle.pass(&mut Pass {
            downdate: Some(&downdate),
            rank,
            scale: T::of(0.9),
            noise: &noise,
            local: &local,
            rows,
            products: &mut products,
            all_rows,
        });
        for i in 0..m {
            for j in 0..m {
                p[i][j] -= w.iter().map(|w| w[i] * w[j]).sum::<f64>();
            }
        }
        for (b, r) in (0..blocks.len()).flat_map(|b| (0..rows).map(move |r| (b, r))) {
            for (j, &(of, k)) in columns.iter().enumerate() {
                let own = (0..m).filter(|&i| columns[i].0 == b);
                let plain: f64 = own.map(|i| l[r][i] * p[i][j]).sum();
                let at = spans[of].panel(all_rows).start + (b * rows + r) * spans[of].padded + k;
                let ours = products[at].wide();
                assert!((ours - plain).abs() < 1e-3, "{blocks:?}, row {r} of {b}: {ours}, not {plain}");
            }
        }
        for i in 0..m {
            (0..m).for_each(|j| p[i][j] *= 0.9);
            p[i][i] += 0.5;
        }
    }
    let mut ours = vec![T::zero(); width];
    triangle.diagonal(&mut ours);
    for (c, &(b, k)) in columns.iter().enumerate() {
        assert!((ours[spans[b].start + k].wide() - p[c][c]).abs() < 1e-3, "{blocks:?}");
    }
}

#[test]
fn a_pass_is_what_plain_sums_say() {
    let splits: [fn(usize) -> Option<usize>; 4] =
        [|_| None, Some, |len| Some(len / 4 * 3), |len| Some(if len == 18 { len } else { len / 2 })];
    for len in [1, 4, 8, 12, 16, 20, 24, 28, 36, 44, 52] {
        for split in splits {
            for vectors in [1, 3, 5] {
                check::<f64>(&[len, 28, 18, 7], split, vectors);
                check::<f32>(&[len, 28, 18, 7], split, vectors);
            }
        }
    }
}
