//! Ridge regression with a fixed list of terms, the baseline of the identified equations, on the splits of the real ships.
//!
//! ```text
//! HYDROID_DATA=... cargo run --release -p hydroid-research --bin ridge_baseline -- [keep-towed]
//! ```
//!
//! Towed ends of a log are removed, as for the equations; `keep-towed` keeps them. The tests of `hydroid` compare with the
//! same baseline.

#[path = "../../../crates/hydroid/tests/it/ridge_baseline.rs"]
mod baseline;

use std::path::PathBuf;

use baseline::{CYBERSHIP, ESSO, Ship, baseline, chosen, last};

fn main() {
    let Some(data) = std::env::var_os("HYDROID_DATA").map(PathBuf::from) else {
        println!("skipped: no HYDROID_DATA");
        return;
    };
    let keep_towed = std::env::args().any(|argument| argument == "keep-towed");
    for ship in [CYBERSHIP, ESSO].map(|ship| Ship { keep_towed, ..ship }) {
        println!("\n{}: ridge on a fixed list, NRMSE on the test run at {} samples", ship.name, ship.horizon);
        println!(
            "{:>8} {:>8} {:>12} {:>30} {:>8} {:>9}",
            "command", "lambda", "validation", "u v r", "mean", "diverged"
        );
        let rows = baseline(&ship, &data);
        for row in &rows {
            let (nrmse, mean) = last(&row.test);
            let text: Vec<String> = nrmse.iter().map(|x| format!("{x:.3}")).collect();
            println!(
                "{:>8} {:>8} {:>12.3} {:>30} {mean:>8.3} {:>9}",
                format!("{:?}", row.held),
                row.lambda,
                row.validation,
                text.join(" "),
                row.test.diverged
            );
        }
        let row = chosen(&rows);
        println!(
            "chosen by validation: {:?}, lambda {}, mean {:.3}",
            row.held,
            row.lambda,
            last(&row.test).1
        );
    }
}
