//! `hydroid study guard`.

use std::fs;

use serde_json::Value;

use crate::common::{MODEL, run, simple_vessel, text};

/// Each day depends on its seed alone, whatever the number of threads and the other seeds.
#[test]
fn a_day_depends_on_its_seed_alone() {
    let at = simple_vessel();
    let days = |seeds: &str, threads: usize, folder: &str| {
        let output = run(
            at,
            &format!(
                "study guard --seeds {seeds} --model {MODEL} --log c.csv -o {folder} --threads {threads} --json"
            ),
        );
        // Exit status 1: a day exceeds the guarantee.
        assert!(matches!(output.status.code(), Some(0 | 1)), "{}", text(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        (report, fs::read_to_string(at.join(folder).join("days.csv")).unwrap())
    };
    let (report, all) = days("1..13", 2, "days");
    assert_eq!(report["summary"]["bad_days"], 12);
    assert_eq!(report["days"]["clean"].as_array().unwrap().len(), 1);
    assert_eq!(all, days("1..13", 1, "days_of_one_thread").1);
    let (_, some) = days("5..9", 2, "some_days");
    let rows = |table: &str| table.lines().map(String::from).collect::<Vec<_>>();
    assert_eq!(rows(&some)[1..5], rows(&all)[5..9]);
    // The learner follows a vessel with more drag, the guard costs little there, and every day has errors.
    let clean = &report["days"]["clean"][0];
    let error = |which: usize| clean["errors"][which].as_f64().unwrap();
    assert!(error(1) < 0.7 * error(0), "{clean}");
    assert!(clean["cost"].as_f64().unwrap() < 1.05, "{clean}");
    for day in report["days"]["bad"].as_array().unwrap() {
        assert!((0..3).all(|which| day["errors"][which].as_f64().unwrap() > 0.0), "{day}");
        assert!(day["excess"][1].is_number() && !day["faults"].as_str().unwrap().is_empty(), "{day}");
    }
}

#[test]
fn days_that_cannot_be_drawn_are_refused_with_a_remedy() {
    let at = simple_vessel();
    let log = fs::read_to_string(at.join("d.csv")).unwrap();
    let short: Vec<&str> = log.lines().take(300).collect();
    fs::write(at.join("short_day.csv"), short.join("\n")).unwrap();
    for (args, words) in [
        (format!("--model {MODEL} --log short_day.csv -o short_days"), "give a longer log"),
        (format!("--model {MODEL}"), "--log"),
        ("--log d.csv".to_owned(), "--model"),
        (format!("--seeds 4..4 --model {MODEL} --log d.csv"), "1..101"),
        (format!("--seeds 4 --model {MODEL} --log d.csv"), "1..101"),
        (format!("--model {MODEL} --log none.csv -o no_days"), "none.csv"),
    ] {
        let output = run(at, &format!("study guard {args}"));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args}: {message}");
        assert!(message.contains(words) && !message.contains("panicked"), "{args}: {message}");
    }
}
