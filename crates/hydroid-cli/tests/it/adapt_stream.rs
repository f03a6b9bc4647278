//! `hydroid adapt MODEL -`: a live stream from end to end.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::common::{MODEL, Service, hydroid, simple_vessel, text};

fn done(folder: &Path, args: &[&str]) -> Output {
    let output = hydroid(folder, args).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    output
}

fn lines(file: &str) -> Vec<String> {
    fs::read_to_string(simple_vessel().join(file)).unwrap().lines().map(str::to_owned).collect()
}

fn value(line: &str) -> Value {
    serde_json::from_str(line).unwrap()
}

#[test]
fn a_streamed_log_gives_the_same_model_as_a_complete_log() {
    let at = simple_vessel();
    done(at, &["adapt", MODEL, "c.csv", "-o", "batch.safetensors", "--json"]);
    let streamed = done(at, &["adapt", MODEL, "c.csv", "--stream", "-o", "streamed.safetensors"]);
    let read = |file: &str| fs::read(at.join(file)).unwrap();
    assert!(read("batch.safetensors") == read("streamed.safetensors"));
    let answers = text(&streamed.stdout);
    assert_eq!(answers.lines().count(), lines("c.csv").len() - 1);
    let last = value(answers.lines().last().unwrap());
    for key in ["line", "t", "status", "estimate", "prediction", "band_80", "band_95"] {
        assert!(!last[key].is_null(), "{key}");
    }
    assert_eq!(last["prediction"]["horizons"], serde_json::json!([1, 10, 50, 100]));
    assert!(last["us"].is_null(), "answers are the same twice");
    let summary = text(&streamed.stderr);
    let share = |from: &str| -> f64 {
        let rest = &summary[summary.find(from).unwrap() + from.len()..];
        rest[..rest.find(" %").unwrap()].parse().unwrap()
    };
    assert!((70.0..90.0).contains(&share("80 %: ")) && (90.0..99.0).contains(&share("95 %: ")), "{summary}");
    for words in ["lines: ", "accepted", "from line to answer"] {
        assert!(summary.contains(words), "{summary}");
    }
}

#[test]
fn bands_cover_the_measurements_under_planned_commands() {
    const AHEAD: usize = 50;
    // Same vessel as in the training logs: bands do not cover model error.
    let lines = lines("d.csv");
    let names: Vec<&str> = lines[0].split(',').map(|cell| cell.split(" [").next().unwrap()).collect();
    let rows: Vec<Vec<f64>> =
        lines[1..].iter().map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let at = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let commands = [at("PP_cmd"), at("RD_cmd")];
    let mut text_of = String::new();
    for k in 0..rows.len() - AHEAD {
        let mut sample = serde_json::Map::new();
        for name in ["t", "u", "v", "r", "P_f", "PP_cmd", "RD_cmd"] {
            sample.insert(name.to_owned(), rows[k][at(name)].into());
        }
        let plan: Vec<_> = rows[k..k + AHEAD].iter().map(|row| commands.map(|c| row[c])).collect();
        sample.insert("commands".to_owned(), serde_json::json!(plan));
        text_of += &Value::Object(sample).to_string();
        text_of.push('\n');
    }
    fs::write(simple_vessel().join("planned.jsonl"), text_of).unwrap();
    let output =
        done(simple_vessel(), &["adapt", MODEL, "planned.jsonl", "--stream", "--horizons", "1,10,50", "-q"]);
    let answers: Vec<Value> = text(&output.stdout).lines().map(value).collect();
    for (index, horizon) in [1, 10, 50].into_iter().enumerate() {
        let (mut of_80, mut of_95, mut all) = (0.0, 0.0, 0.0);
        for (now, then) in answers[500..].iter().zip(&answers[500 + horizon..]) {
            for channel in ["u", "v", "r", "P_f"] {
                let number = |part: &str| now[part][channel][index].as_f64().unwrap();
                let miss = (then["estimate"][channel].as_f64().unwrap() - number("prediction")).abs();
                of_80 += f64::from(u8::from(miss <= number("band_80")));
                of_95 += f64::from(u8::from(miss <= number("band_95")));
                all += 1.0;
            }
        }
        let shares = (of_80 / all, of_95 / all);
        assert!(
            (0.73..0.87).contains(&shares.0) && (0.91..0.98).contains(&shares.1),
            "{horizon}: {shares:?}"
        );
    }
}

#[test]
fn an_answer_comes_before_the_next_line_is_sent() {
    let mut service =
        Service::start(simple_vessel(), &["adapt", MODEL, "-", "--horizons", "1,20", "--timing"]);
    for (k, line) in lines("c.csv").iter().take(50).enumerate() {
        service.send(line);
        if k > 0 {
            let answer = value(&service.answer());
            assert_eq!(answer["line"], k + 1);
            assert!(answer["us"].as_f64().unwrap() > 0.0);
            assert_eq!(answer["prediction"]["u"].as_array().unwrap().len(), 2);
        }
    }
    // An invalid line is answered, and the stream continues.
    service.send("4.9,oops");
    assert_eq!(value(&service.answer())["status"], "error");
    drop(service.child.stdin.take());
    let (code, notes) = service.end();
    assert_eq!(code, Some(0), "{notes}");
    assert!(notes.contains("1 error"));
}

#[test]
fn a_killed_service_resumes_with_the_same_answers_and_model() {
    let at = simple_vessel();
    let lines = lines("c.csv");
    let whole = done(at, &["adapt", MODEL, "c.csv", "--stream", "-o", "whole.safetensors"]);
    let expected: Vec<String> = text(&whole.stdout).lines().map(str::to_owned).collect();
    for (killed, state) in [(3, "early.state"), (1234, "late.state")] {
        let mut service = Service::start(simple_vessel(), &["adapt", MODEL, "-", "--state", state]);
        service.send(&lines[0]);
        for (line, expected) in lines[1..killed].iter().zip(&expected) {
            service.send(line);
            assert_eq!(service.answer().trim_end(), expected);
        }
        // At an arbitrary time: a line may be unanswered.
        service.send(&lines[killed]);
        service.child.kill().unwrap();
        service.child.wait().unwrap();
        let model = format!("{state}.safetensors");
        let again = done(at, &["adapt", MODEL, "c.csv", "--stream", "--state", state, "-o", &model]);
        let all = text(&again.stdout);
        let (repeated, answers): (Vec<&str>, Vec<&str>) =
            all.lines().partition(|line| line.contains("\"status\":\"repeated\""));
        assert_eq!(repeated.len() + answers.len(), expected.len(), "each line has an answer");
        let lost = killed + answers.len() - (expected.len());
        assert!(lost <= 12, "more than the last second was lost: {lost} lines");
        assert!(text(&again.stderr).contains("resuming from"));
        assert_eq!(answers, expected[expected.len() - answers.len()..]);
        let read = |file: &str| fs::read(at.join(file)).unwrap();
        assert!(read(&model) == read("whole.safetensors"), "killed after {killed}");
    }
}

#[cfg(unix)]
#[test]
fn an_interruption_leaves_state_and_model() {
    let at = simple_vessel();
    for (signal, name) in [("-TERM", "term"), ("-INT", "int")] {
        let (state, model) = (format!("{name}.state"), format!("{name}.safetensors"));
        let mut service =
            Service::start(simple_vessel(), &["adapt", MODEL, "-", "--state", &state, "-o", &model]);
        for line in lines("c.csv").iter().take(105) {
            service.send(line);
        }
        for _ in 0..104 {
            service.answer();
        }
        let kill = Command::new("kill").args([signal, &service.child.id().to_string()]).status();
        assert!(kill.unwrap().success());
        // The service waits for a line.
        let stdin = service.child.stdin.take();
        let (code, notes) = service.end();
        drop(stdin);
        assert_eq!(code, Some(130), "{notes}");
        assert!(notes.contains("lines: "));
        assert!(at.join(&model).exists());
        // No line was lost.
        let again = hydroid(at, &["adapt", MODEL, "c.csv", "--stream", "--state", &state]).output().unwrap();
        let first =
            text(&again.stdout).lines().map(value).find(|answer| answer["status"] != "repeated").unwrap();
        assert_eq!(first["line"], 106);
    }
}

#[test]
fn invalid_streams_are_refused_with_a_remedy() {
    let at = simple_vessel();
    let refused = |args: &[&str], input: &str, words: &str| {
        let mut child = hydroid(at, args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // The service may end without reading.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", text(&output.stdout));
        assert!(text(&output.stderr).contains(words), "{args:?}: {}", text(&output.stderr));
    };
    refused(&["adapt", MODEL, "-"], "", "standard input is empty");
    refused(&["adapt", MODEL, "-"], "1,2,3\n", "not column names");
    refused(&["adapt", MODEL, "-"], "t,u,v\n", "no column `r`");
    refused(&["adapt", MODEL, "-", "--horizons", "5,1"], "", "must be ascending");
    refused(&["adapt", MODEL, "-", "--horizons", "0"], "", "must be ascending");
    refused(&["adapt", MODEL, "-", "--horizon", "5s"], "", "--horizons");
    refused(&["adapt", MODEL, "-", "--input-delay=-3"], "", "must be known when the next sample comes");
    refused(&["adapt", MODEL, "none.csv", "--stream"], "", "none.csv");
    refused(&["adapt", MODEL, "c.csv", "--timing"], "", "--stream");
    refused(&["adapt", MODEL, "-", "--state", "."], "", "name a file");
    // States of other models or options and truncated states are not overwritten.
    let header = lines("c.csv")[..30].join("\n");
    fs::write(at.join("thirty.csv"), header).unwrap();
    done(at, &["adapt", MODEL, "thirty.csv", "--stream", "--state", "kept.state", "-o", "other.safetensors"]);
    let kept = fs::read(at.join("kept.state")).unwrap();
    refused(&["adapt", "other.safetensors", "-", "--state", "kept.state"], "", "another model");
    refused(
        &["adapt", MODEL, "-", "--state", "kept.state", "--prior", "5"],
        "",
        "prior_s: 10.0 in the file, 5.0 given",
    );
    assert_eq!(fs::read(at.join("kept.state")).unwrap(), kept);
    fs::write(at.join("kept.state"), &kept[..kept.len() - 9]).unwrap();
    refused(&["adapt", MODEL, "-", "--state", "kept.state"], "", "damaged");
    assert_eq!(fs::read(at.join("kept.state")).unwrap().len(), kept.len() - 9);
}
