//! Reading and preparing a two-hour record of 72,000 rows and 11 columns.
//!
//! `cargo bench -p hydroid --bench log`. The record is made here; `HYDROID_RECORD` names another file.

use std::fmt::Write as _;

use hydroid::log::{PrepareOptions, RawLog, Selection, inspect, prepare, read_from};

fn main() {
    divan::main();
}

fn text() -> Vec<u8> {
    if let Some(path) = std::env::var_os("HYDROID_RECORD") {
        return std::fs::read(path).expect("HYDROID_RECORD names a readable file");
    }
    let mut text =
        "t [s],PP_cmd [N],RD_ang [rad],u [m/s],v [m/s],r [rad/s],u_true [m/s],v_true [m/s],r_true [rad/s],\
                    P_f_true [N]\n"
            .to_owned();
    for k in 0..72_000 {
        let t = f64::from(k) * 0.1;
        let (a, b) = ((0.37 * t).sin(), (1.13 * t).cos());
        let _ = writeln!(
            text,
            "{t:.1},{:.6},{:.7},{:.10},{:.11},{:.11},{:.10},{:.11},{:.12},{:.6}",
            270.0 * a,
            0.3 * b,
            2.0 + a,
            0.1 * b,
            0.2 * a * b,
            2.0 + a,
            0.1 * b,
            0.2 * a * b,
            250.0 * a
        );
    }
    text.into_bytes()
}

fn record() -> RawLog {
    read_from(&text()[..], "record.csv").expect("the record is well formed")
}

#[divan::bench]
fn read(bencher: divan::Bencher<'_, '_>) {
    let text = text();
    bencher
        .counter(divan::counter::BytesCount::new(text.len()))
        .bench_local(|| read_from(&text[..], "record.csv"));
}

#[divan::bench]
fn prepared(bencher: divan::Bencher<'_, '_>) {
    let logs = [record()];
    bencher.bench_local(|| prepare(&logs, &Selection::default(), &PrepareOptions::default()));
}

#[divan::bench]
fn resampled(bencher: divan::Bencher<'_, '_>) {
    let logs = [record()];
    let options = PrepareOptions { dt: Some(0.25), ..PrepareOptions::default() };
    bencher.bench_local(|| prepare(&logs, &Selection::default(), &options));
}

#[divan::bench]
fn inspected(bencher: divan::Bencher<'_, '_>) {
    let log = record();
    bencher.bench_local(|| inspect(&log, &Selection::default(), &PrepareOptions::default()));
}
