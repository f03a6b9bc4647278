//! A committee from end to end: identified, inspected, evaluated and adapted.

use std::fs;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::common::{done, run, text};

const MODEL: &str = "out/committee.safetensors";

#[test]
fn a_committee_is_identified_evaluated_and_adapted() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let vessel = text(&done(at, "simulate simple --print-vessel").stdout);
    fs::write(at.join("fouled.toml"), vessel.replace("77.55", "124.0").replace("162.5", "260.0")).unwrap();
    for (plant, seed, file) in
        [("simple", 1, "a.csv"), ("simple", 2, "b.csv"), ("simple", 3, "c.csv"), ("fouled.toml", 4, "d.csv")]
    {
        done(at, &format!("simulate {plant} --seed {seed} --duration 90 -o {file}"));
    }
    let document = |args: &str| -> Value { serde_json::from_slice(&done(at, args).stdout).unwrap() };
    let identified = document(
        "identify a.csv --validate b.csv --test c.csv --outputs u,r --methods committee --horizon 20 -o out --json -q",
    );
    assert_eq!(identified["best"], "committee");
    let model = &identified["models"][0];
    assert_eq!((&model["kind"], &model["file"]), (&json!("committee"), &json!(MODEL)));
    for part in ["validation", "test"] {
        assert_eq!((&model[part]["diverged"], &model[part]["channels"]), (&json!(0), &json!(["u", "r"])));
        for c in 0..2 {
            let at_end = |of: &Value| of["nrmse"][19][c].as_f64().unwrap();
            let (own, kept) = (at_end(&model[part]), at_end(&model[part]["persistence"]));
            assert!(own < 0.6 * kept, "{part} {c}: {own} {kept}");
        }
    }

    let shown = text(&done(at, &format!("inspect {MODEL}")).stdout);
    for words in ["committee", "with 20 votes", "past values, clock step", "prediction bands of 80 %"] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    let inspected = document(&format!("inspect {MODEL} --json"));
    assert_eq!(inspected["kind"], "committee");
    let members = inspected["members"].as_array().unwrap();
    let votes: u64 = members.iter().map(|member| member["votes"].as_u64().unwrap()).sum();
    assert_eq!(votes, 20);
    for member in members {
        let terms = member["terms"].as_array().unwrap();
        assert!(terms.contains(&json!("1")) && terms.contains(&json!("u")), "{terms:?}");
        assert_eq!(member["coefficients"][1].as_array().unwrap().len(), terms.len());
    }
    let provenance = &inspected["description"]["provenance"];
    assert_eq!(provenance["training"], json!(["a.csv", "b.csv"]));
    let nrmse = provenance["settings"]["cross_validated_nrmse"].as_f64().unwrap();
    assert!((0.001..1.0).contains(&nrmse), "{nrmse}");

    let mut evaluated = document(&format!("evaluate {MODEL} c.csv --horizon 20 --json"));
    let bands = evaluated.as_object_mut().unwrap().remove("prediction_bands").unwrap();
    assert_eq!(evaluated, model["test"]);
    assert_eq!((&bands["levels"], &bands["horizons"]), (&json!([0.5, 0.8, 0.9]), &json!([5, 10, 15, 20])));
    for h in 0..4 {
        for c in 0..2 {
            let shares = [0, 1, 2].map(|level: usize| bands["share"][level][h][c].as_f64().unwrap());
            assert!(0.0 <= shares[0] && shares[0] <= shares[1] && shares[1] <= shares[2], "{shares:?}");
        }
    }
    let shown = text(&done(at, &format!("evaluate {MODEL} c.csv --horizon 20")).stdout);
    assert!(shown.contains("inside the prediction bands of 50 %, 80 %, 90 %"), "{shown}");

    // A committee has no options of adaptation.
    for option in ["--forgetting 60", "--prior 60", "--noise-factor 2", "--learner kalman"] {
        let args = format!("adapt {MODEL} c.csv {option}");
        let refused = run(at, &args);
        assert_eq!(refused.status.code(), Some(2), "{option}");
        assert!(text(&refused.stderr).contains("a committee has no options of adaptation"), "{option}");
    }

    let args = format!("adapt {MODEL} d.csv --horizon 20 -o adapted.safetensors --json");
    let report = document(&args);
    assert_eq!(report["settings"]["method"], "committee");
    let votes = report["settings"]["learning_votes"].as_f64().unwrap();
    assert!((0.0..=1.0).contains(&votes));
    let score = |part: &str, c: usize| report[part]["nrmse"][19][c].as_f64().unwrap();
    // Members that learn follow the vessel with more drag.
    let better = score("adapted", 0) + score("adapted", 1) < score("frozen", 0) + score("frozen", 1);
    assert!(better || votes == 0.0, "{votes}");
    let adapted = document("inspect adapted.safetensors --json");
    assert_eq!(adapted["kind"], "committee");
    assert_eq!(adapted["description"]["provenance"]["settings"]["adapted"][0]["runs"], json!(["d.csv"]));

    let log = fs::read_to_string(at.join("d.csv")).unwrap();
    let lines: Vec<&str> = log.lines().take(101).collect();
    fs::write(at.join("few.csv"), lines.join("\n")).unwrap();
    let streamed = done(at, &format!("adapt {MODEL} few.csv --stream --horizons 1,20 -q"));
    let answers: Vec<Value> =
        text(&streamed.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(answers.len(), 100);
    for answer in &answers[60..] {
        for channel in ["u", "r"] {
            let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{answer}"));
            let now = number(&answer["estimate"][channel]);
            let ahead = number(&answer["prediction"][channel][1]);
            assert!((ahead - now).abs() < 1.0, "{answer}");
            // The bands are those of the model file.
            let [near, far] = [0, 1].map(|at| number(&answer["band_80"][channel][at]));
            assert!(0.0 < near && 0.0 < far, "{answer}");
        }
        assert_ne!(answer["status"], "error", "{answer}");
    }
}

#[test]
fn every_log_enters_the_model_and_is_judged_without_it() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (seed, file) in [(1, "a.csv"), (2, "b.csv"), (3, "c.csv")] {
        done(at, &format!("simulate simple --seed {seed} --duration 90 -o {file}"));
    }
    let identify =
        "identify a.csv b.csv c.csv --outputs u,r --horizon 20 --lag none --gate none --members 0 -o out";
    let document: Value = serde_json::from_slice(&done(at, &format!("{identify} --json -q")).stdout).unwrap();
    assert_eq!(document["cross_validated"], true);
    for model in document["models"].as_array().unwrap() {
        assert!(model["test"].is_null());
        let runs: Vec<&str> = model["validation"]["by_run"]
            .as_array()
            .unwrap()
            .iter()
            .map(|run| run["run"].as_str().unwrap())
            .collect();
        assert_eq!(runs, ["a.csv", "b.csv", "c.csv"]);
        let inspected = done(at, &format!("inspect {} --json", model["file"].as_str().unwrap()));
        let inspected: Value = serde_json::from_slice(&inspected.stdout).unwrap();
        let provenance = &inspected["description"]["provenance"];
        assert_eq!(provenance["training"], json!(["a.csv", "b.csv", "c.csv"]));
        assert_eq!(provenance["validation"], json!([]));
    }
    let page = fs::read_to_string(at.join("out/report.html")).unwrap();
    for words in ["was fitted to all runs", "by cross-validation", "Error of each run", "Range of use"] {
        assert!(page.contains(words), "{words}");
    }
    let shown = text(&done(at, &format!("{identify} --methods committee")).stdout);
    assert!(shown.contains("each run, 2 s ahead") && shown.contains("  b.csv: u "), "{shown}");
}
