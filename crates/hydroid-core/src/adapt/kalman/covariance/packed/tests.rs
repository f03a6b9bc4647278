use alloc::vec;

use super::*;

/// A fused update equals plain sums for blocks of every width, with one and with two local rows.
fn check(blocks: &[usize], rows_of: fn(usize) -> usize, vectors: usize) {
    let rows = 2;
    let each = blocks.iter().enumerate().map(|(b, &len)| (len, b * rows, rows_of(len)));
    let mut matrix = PackedSymmetric::new(each);
    let (width, blocks_of) = (matrix.width(), matrix.blocks().to_vec());
    let rank = PackedSymmetric::rank(vectors);
    let number = |k: usize| (0.37 * k as f64 + 0.2).sin();
    let columns: Vec<(usize, usize)> =
        blocks_of.iter().enumerate().flat_map(|(b, span)| (0..span.len).map(move |k| (b, k))).collect();
    let put = |matrix: &mut [f64], of: usize, row: usize, (b, k): (usize, usize), x: f64| {
        matrix[blocks_of[b].panel(of).start + row * blocks_of[b].padded + k] = x;
    };
    let m = columns.len();
    let (mut downdate, mut local) = (vec![0.0; rank * width], vec![0.0; rows * width]);
    let (mut w, mut l) = (vec![vec![0.0; m]; vectors], vec![vec![0.0; m]; rows]);
    for (c, &(b, k)) in columns.iter().enumerate() {
        for (q, w) in w.iter_mut().enumerate() {
            w[c] = number(7 * c + q);
            put(&mut downdate, rank, q, (b, k), w[c]);
        }
        for (r, l) in l.iter_mut().enumerate().take(blocks_of[b].rows) {
            l[c] = number(5 * c + r + 100);
            put(&mut local, rows, r, (b, k), l[c]);
        }
    }
    let diagonal: Vec<f64> = (0..width).map(|c| 2.0 + number(c)).collect();
    matrix.set_diagonal(&diagonal);
    let smallest = columns.iter().map(|&(b, k)| diagonal[blocks_of[b].start + k]).fold(1e9, f64::min);
    assert_eq!(matrix.least(), smallest);
    let mut p = vec![vec![0.0; m]; m];
    for (c, &(b, k)) in columns.iter().enumerate() {
        p[c][c] = diagonal[blocks_of[b].start + k];
    }
    let noise = vec![0.5; width];
    let all_rows = blocks.len() * rows;
    let mut products = vec![0.0; all_rows * width];
    for _ in 0..2 {
        matrix.update(&mut FusedUpdate {
            downdate: Some(&downdate),
            rank,
            scale: 0.9,
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
                let at = blocks_of[of].panel(all_rows).start + (b * rows + r) * blocks_of[of].padded + k;
                let ours = products[at];
                assert!((ours - plain).abs() < 1e-3, "{blocks:?}, row {r} of {b}: {ours}, not {plain}");
            }
        }
        for i in 0..m {
            (0..m).for_each(|j| p[i][j] *= 0.9);
            p[i][i] += 0.5;
        }
    }
    let mut ours = vec![0.0; width];
    matrix.diagonal(&mut ours);
    for (c, &(b, k)) in columns.iter().enumerate() {
        assert!((ours[blocks_of[b].start + k] - p[c][c]).abs() < 1e-3, "{blocks:?}");
    }
    // Quadratic forms of one to seven vectors.
    let v: Vec<Vec<f64>> = (0..7).map(|f| (0..m).map(|c| number(11 * c + f)).collect()).collect();
    let mut padded = vec![0.0; 7 * width];
    for (f, c) in (0..7).flat_map(|f| (0..m).map(move |c| (f, c))) {
        padded[f * width + blocks_of[columns[c].0].start + columns[c].1] = v[f][c];
    }
    for count in 1..=7 {
        let mut forms = vec![1.0; count];
        matrix.add_quadratic(&padded[..count * width], &mut forms);
        for (form, v) in forms.iter().zip(&v) {
            let plain: f64 =
                (0..m).flat_map(|i| (0..m).map(move |j| (i, j))).map(|(i, j)| v[i] * p[i][j] * v[j]).sum();
            assert!(
                (form - 1.0 - plain).abs() < 1e-9 * (1.0 + plain.abs() + (m * m) as f64),
                "{blocks:?}: {form}, not {plain}"
            );
        }
    }
}

#[test]
fn a_fused_update_equals_plain_sums() {
    let rows_of: [fn(usize) -> usize; 3] = [|_| 2, |_| 1, |len| if len == 18 { 1 } else { 2 }];
    for len in [1, 4, 8, 12, 16, 20, 24, 28, 36, 44, 52] {
        for rows_of in rows_of {
            for vectors in [1, 3, 5] {
                check(&[len, 28, 18, 7], rows_of, vectors);
            }
        }
    }
}
