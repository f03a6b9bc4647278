//! Networks from end to end: training, evaluation, inspection, interruption, resumption.

use std::fs;
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::Command;
use serde_json::{Value, json};
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("hydroid").unwrap().current_dir(folder).args(args).output().unwrap()
}

fn done(folder: &Path, args: &[&str], status: &[i32]) -> Output {
    let output = hydroid(folder, args);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code().is_some_and(|code| status.contains(&code)), "{args:?}: {told}");
    assert!(!told.contains("panicked"), "{told}");
    output
}

/// Short logs of the simple vessel, and small networks.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    for (seed, file, duration) in [("1", "a.csv", "120"), ("2", "b.csv", "40"), ("3", "c.csv", "40")] {
        let args = ["simulate", "simple", "--seed", seed, "--duration", duration, "-o", file, "-q"];
        done(folder.path(), &args, &[0]);
    }
    fs::write(
        folder.path().join("small.toml"),
        "[network]\nhidden = 4\nepochs = 3\nbatch = 8\nwash_out_s = 1\nwindow_s = 4\n[rnn]\nlayers = 1\n",
    )
    .unwrap();
    folder
}

const JOB: [&str; 14] = [
    "identify",
    "a.csv",
    "--validate",
    "b.csv",
    "--test",
    "c.csv",
    "--outputs",
    "u,v,r",
    "--inputs",
    "PP_cmd,RD_cmd",
    "--horizon",
    "10",
    "--origin-stride",
    "4",
];

fn job<'a>(rest: &[&'a str]) -> Vec<&'a str> {
    JOB.iter().copied().chain(rest.iter().copied()).collect()
}

#[test]
fn networks_stand_beside_equations_and_are_used_like_them() {
    let folder = folder();
    let path = folder.path();
    // The number of weights of a given formulation is known.
    let settings = fs::read_to_string(path.join("small.toml")).unwrap();
    fs::write(path.join("small.toml"), settings.replace("[network]", "[network]\nfeedback = false")).unwrap();
    let rest = ["-c", "small.toml", "--methods", "lstm,sindy,gru,rnn", "--degree", "1", "--lag", "none"];
    let more = [
        "--gate",
        "none",
        "--members",
        "0",
        "--ranges",
        "u=-1:12 [kn],PP_cmd=-100:400",
        "-o",
        "out",
        "--json",
    ];
    let output = done(path, &job(&[&rest[..], &more].concat()), &[0, 1]);
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let models = document["models"].as_array().unwrap();
    let names: Vec<&str> = models.iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["sindy", "lstm", "gru", "rnn"]);
    for (model, weights) in
        models[1..].iter().zip([4 * 4 * (2 + 4 + 2) + 15, 3 * 4 * (2 + 4 + 2) + 15, 4 * (2 + 4 + 2) + 15])
    {
        assert_eq!((&model["kind"], &model["weights"]), (&json!("recurrent"), &json!(weights)));
        assert!(model["train_seconds"].is_number() && model["file"].is_string());
        assert_eq!(model["training"]["history"].as_array().unwrap().len(), 3);
        for part in ["validation", "test"] {
            assert_eq!(model[part]["horizons"].as_array().unwrap().len(), 10);
        }
    }
    let range = |name: &str| {
        let all = document["ranges"].as_array().unwrap();
        all.iter().find(|range| range["channel"]["name"] == name).unwrap().clone()
    };
    assert!((range("u")["high"].as_f64().unwrap() - 12.0 * 1852.0 / 3600.0).abs() < 1e-12);
    assert_eq!((&range("u")["given"], &range("v")["given"]), (&json!(true), &json!(false)));
    // The output folder contains the expected files only.
    let mut files: Vec<String> = fs::read_dir(path.join("out"))
        .unwrap()
        .map(|f| f.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    let written = [
        "gru.safetensors",
        "identify.json",
        "lstm.safetensors",
        "report.html",
        "rnn.safetensors",
        "sindy.safetensors",
    ];
    assert_eq!(files, written);
    let page = fs::read_to_string(path.join("out/report.html")).unwrap();
    assert!(page.contains("<h2>Networks</h2>") && page.contains("recurrent network"));

    let shown = done(path, &["inspect", "out/gru.safetensors"], &[0]);
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    for part in [
        "GRU with 4 cells",
        "inputs: the model's inputs only",
        "wash-out: 10 samples, 1.000 s",
        "design range",
        ", training range",
        "trained for 3 epochs",
    ] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    let shown = done(path, &["inspect", "out/lstm.safetensors", "--json"], &[0]);
    let shown: Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!(shown["network"]["network"]["cell"], json!({"cell": "lstm", "hidden": 4}));
    assert!(shown["equations"].is_null() && shown["network"]["scaling"]["input_mean"].is_array());
    let refused = done(path, &["inspect", "out/lstm.safetensors", "--latex"], &[2]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("without equations"));
    let learned =
        done(path, &["adapt", "out/rnn.safetensors", "c.csv", "--horizon", "10", "--json"], &[0, 1]);
    let learned: Value = serde_json::from_slice(&learned.stdout).unwrap();
    assert_eq!(learned["settings"]["method"], "kalman");
    let judged =
        done(path, &["evaluate", "out/rnn.safetensors", "c.csv", "--horizon", "10", "--json"], &[0, 1]);
    let judged: Value = serde_json::from_slice(&judged.stdout).unwrap();
    assert_eq!(judged["horizons"].as_array().unwrap().len(), 10);
}

/// The direct predictor uses its own section, has the band of its restarts, and does not adapt.
#[test]
fn a_direct_predictor_is_identified_evaluated_and_inspected() {
    let folder = folder();
    let path = folder.path();
    let table = "[network]\nfeedback = false\n[direct]\nhidden = 8\nlayers = 2\nhistory_s = 0.6\nwindow_s = 0.5\n\
        epochs = 4\nbase = \"hold\"\nrestarts = 3\nensemble = true\n";
    fs::write(path.join("direct.toml"), table).unwrap();
    done(path, &job(&["-c", "direct.toml", "--methods", "direct", "-o", "out", "-q"]), &[0, 1]);
    let page = fs::read_to_string(path.join("out/report.html")).unwrap();
    assert!(page.contains("<h2>Networks</h2>") && page.contains("whole horizon at once"));
    let shown = done(path, &["inspect", "out/direct.safetensors"], &[0]);
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    for part in [
        "direct model 'direct'",
        "feed-forward network 38-8-8-15",
        "the last 6 samples (0.600 s)",
        "the next 5 samples (0.500 s) at once, as differences",
        "trained for 4 epochs",
    ] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    let json =
        |args: &[&str]| -> Value { serde_json::from_slice(&done(path, args, &[0, 1]).stdout).unwrap() };
    let shown = json(&["inspect", "out/direct.safetensors", "--json"]);
    assert_eq!((&shown["network"]["horizon"], &shown["network"]["members"]), (&json!(5), &json!(3)));
    let judged = json(&["evaluate", "out/direct.safetensors", "c.csv", "--horizon", "12", "--json"]);
    assert_eq!(judged["horizons"].as_array().unwrap().len(), 12);
    assert_eq!(judged["band_coverage"]["members"], json!(3));
}

/// The summary without computing times.
fn result(path: &Path, out: &str, names: &[&str]) -> (Vec<Vec<u8>>, Value) {
    let file = |name: &&str| fs::read(path.join(out).join(format!("{name}.safetensors"))).unwrap();
    let text = fs::read_to_string(path.join(out).join("identify.json")).unwrap();
    let mut summary: Value = serde_json::from_str(&text).unwrap();
    for model in summary["models"].as_array_mut().unwrap() {
        let model = model.as_object_mut().unwrap();
        model.remove("train_seconds");
        model.remove("file");
    }
    (names.iter().map(file).collect(), summary)
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = folder();
    let path = folder.path();
    let networks = ["lstm", "gru"];
    for (threads, out) in [("1", "one"), ("2", "two")] {
        let rest = ["-c", "small.toml", "--methods", "lstm,gru", "--restarts", "2", "--seed", "5"];
        done(path, &job(&[&rest[..], &["--threads", threads, "-o", out]].concat()), &[0, 1]);
    }
    assert_eq!(result(path, "one", &networks), result(path, "two", &networks));
}

#[test]
fn a_refit_is_reported_and_leaves_no_checkpoint() {
    let folder = folder();
    let path = folder.path();
    let config = fs::read_to_string(path.join("small.toml")).unwrap();
    fs::write(path.join("refit.toml"), config.replacen("[network]", "[network]\nrefit = true", 1)).unwrap();
    let rest = ["-c", "refit.toml", "--methods", "gru", "--epochs", "60", "-o", "out"];
    done(path, &job(&rest), &[0, 1]);
    let (_, summary) = result(path, "out", &["gru"]);
    assert_eq!(summary["models"][0]["training"]["refit"], "taken", "{}", summary["warnings"]);
    let page = fs::read_to_string(path.join("out/report.html")).unwrap();
    assert!(page.contains("trained again on training and validation runs together"));
    let names = fs::read_dir(path.join("out")).unwrap().map(|file| file.unwrap().file_name());
    let names: Vec<_> = names.filter(|name| name.to_string_lossy().contains("checkpoint")).collect();
    assert!(names.is_empty(), "{names:?}");
}

fn start(path: &Path, args: &[&str]) -> Child {
    std::process::Command::new(assert_cmd::cargo::cargo_bin!("hydroid"))
        .current_dir(path)
        .args(args)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Waits for the checkpoint (true) or the end of the process (false).
fn kept(child: &mut Child, file: &Path) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_mins(5) {
        if file.exists() {
            return true;
        }
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("neither done nor kept in five minutes");
}

/// Completed and planned epochs of a checkpoint.
fn epochs(checkpoint: &Path) -> [u64; 2] {
    let bytes = fs::read(checkpoint).unwrap();
    let (length, rest) = bytes.split_first_chunk().unwrap();
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap();
    let header: Value = serde_json::from_slice(&rest[..length]).unwrap();
    let head = header["__metadata__"]["hydroid_training"].as_str().unwrap();
    let head: Value = serde_json::from_str(head).unwrap();
    ["epoch", "epochs"].map(|key| head[key].as_u64().unwrap())
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_training_that_was_killed_goes_on_to_the_same_model() {
    let folder = folder();
    let path = folder.path();
    // Training takes seconds; the first checkpoint is written after half a second.
    let rest = ["-c", "small.toml", "--methods", "gru", "--epochs", "4000", "-o"];
    done(path, &job(&[&rest[..], &["whole"]].concat()), &[0, 1]);
    let again = [&rest[..], &["killed"]].concat();
    let checkpoint = path.join("killed/gru.checkpoint");
    let mut child = start(path, &job(&again));
    assert!(kept(&mut child, &checkpoint), "the training was over before it could be killed");
    child.kill().unwrap();
    child.wait().unwrap();
    let [epoch, planned] = epochs(&checkpoint);
    assert!(0 < epoch && epoch < planned, "killed after {epoch} of {planned} epochs");
    assert!(!path.join("killed/identify.json").exists());
    // A checkpoint of other options is refused.
    let refused = done(path, &job(&[&again[..], &["--resume", "--seed", "9"]].concat()), &[2]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("other settings"));
    done(path, &job(&[&again[..], &["--resume"]].concat()), &[0, 1]);
    assert!(!checkpoint.exists());
    let refused = done(path, &job(&[&again[..], &["--resume"]].concat()), &[2]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("no interrupted training in killed"));
    // Only the uninterrupted run reports the short trainings of the formulation search.
    let (whole, mut summary) = result(path, "whole", &["gru"]);
    let warnings = summary["warnings"].as_array_mut().unwrap();
    let before = warnings.len();
    warnings.retain(|warning| !warning["message"].as_str().unwrap().contains("short trainings"));
    assert_eq!(warnings.len() + 1, before);
    assert_eq!((whole, summary), result(path, "killed", &["gru"]));
}

#[cfg(unix)]
#[test]
fn ctrl_c_explains_how_to_resume() {
    let folder = folder();
    let path = folder.path();
    let args = job(&["-c", "small.toml", "--methods", "gru", "--epochs", "100000", "-o", "out"]);
    let mut child = start(path, &args);
    assert!(kept(&mut child, &path.join("out/gru.checkpoint")));
    let interrupt = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupt.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("--resume"), "{told}");
}

#[test]
fn a_time_limit_ends_the_training() {
    let folder = folder();
    let rest =
        ["-c", "small.toml", "--methods", "gru,lstm", "--epochs", "1000000", "--budget", "2s", "-o", "out"];
    done(folder.path(), &job(&rest), &[0, 1]);
    let (_, summary) = result(folder.path(), "out", &["gru", "lstm"]);
    for model in summary["models"].as_array().unwrap() {
        assert!(model["training"]["epochs"].as_u64().unwrap() < 1_000_000);
    }
}

#[test]
fn a_failed_method_keeps_the_other_methods() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("long.toml"), "[gru]\nwindow_s = 500\n").unwrap();
    let rest = [
        "-c",
        "long.toml",
        "--degree",
        "1",
        "--lag",
        "none",
        "--gate",
        "none",
        "--members",
        "0",
        "-o",
        "out",
    ];
    // A model of an earlier job would pass for one of this job.
    fs::create_dir(path.join("out")).unwrap();
    fs::write(path.join("out/gru.safetensors"), "of an earlier job").unwrap();
    let both = done(path, &job(&[&rest[..], &["--methods", "gru,sindy"]].concat()), &[0, 1]);
    let told = String::from_utf8_lossy(&both.stderr);
    assert!(
        told.contains("warning: no model by the method gru: no training run") && told.contains("window_s"),
        "{told}"
    );
    assert!(told.contains("renamed to out/gru.safetensors.old"), "{told}");
    assert_eq!(fs::read_to_string(path.join("out/gru.safetensors.old")).unwrap(), "of an earlier job");
    assert!(path.join("out/sindy.safetensors").exists() && !path.join("out/gru.safetensors").exists());
    let alone = done(path, &job(&[&rest[..], &["--methods", "gru"]].concat()), &[2]);
    assert!(String::from_utf8_lossy(&alone.stderr).contains("window_s"));
}

#[test]
fn grey_boxes_use_the_equations_of_the_same_job() {
    let folder = folder();
    let path = folder.path();
    fs::write(
        path.join("grey.toml"),
        "[network]\nbase = \"equations\"\nfeedback = true\nhidden = 4\nepochs = 1\nwash_out_s = 1\nwindow_s = 4\n\
         [direct]\nbase = \"equations\"\nhidden = 4\nepochs = 1\nhistory_s = 1\nwindow_s = 1\n",
    )
    .unwrap();
    let rest = [
        "-c",
        "grey.toml",
        "--degree",
        "1",
        "--lag",
        "none",
        "--gate",
        "none",
        "--members",
        "0",
        "-o",
        "out",
    ];
    for method in ["gru", "direct"] {
        let alone = done(path, &job(&[&rest[..], &["--methods", method]].concat()), &[2]);
        assert!(String::from_utf8_lossy(&alone.stderr).contains("add sindy or lagged"));
    }
    done(path, &job(&[&rest[..], &["--methods", "sindy,gru,direct"]].concat()), &[0, 1]);
    for file in ["out/gru.safetensors", "out/direct.safetensors"] {
        let shown = done(path, &["inspect", file], &[0]);
        let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
        assert!(shown.contains("a grey box") && shown.contains("base equations"), "{shown}");
        let latex = done(path, &["inspect", file, "--latex"], &[0]);
        let latex = String::from_utf8_lossy(&latex.stdout).into_owned();
        assert!(latex.starts_with("% Base equations of the model"), "{latex}");
    }
}

#[test]
fn wrong_options_are_refused_with_line_and_remedy() {
    let folder = folder();
    let path = folder.path();
    for (text, words) in [
        ("[network]\nhiden = 3\n", ["line 2", "did you mean hidden?"]),
        ("[gru]\nbase = \"holt\"\n", ["line 2", "did you mean \"hold\"?"]),
        ("\n[rangs]\nu = [0, 1]\n", ["line 2", "did you mean ranges?"]),
        ("[ranges]\nv = [0, 1]\nu = [3, 1]\n", ["line 3", "the lower one first"]),
        ("[identify]\nbudget = \"soon\"\n", ["line 2", "5m"]),
        ("[ranges]\nw = [0, 1]\n", ["'w'", "PP_cmd"]),
        ("[network]\nhidden = 0\n", ["gru", "at least 1"]),
        ("[network]\nlearning_rate = -1\n", ["gru", "learning_rate"]),
    ] {
        fs::write(path.join("wrong.toml"), text).unwrap();
        let refused = done(path, &job(&["-c", "wrong.toml", "--methods", "gru", "-o", "out"]), &[2]);
        let told = String::from_utf8_lossy(&refused.stderr);
        assert!(words.iter().all(|word| told.contains(word)), "{text}: {told}");
        assert!(!path.join("out").exists(), "{text}");
    }
    for (option, value, word) in [
        ("--ranges", "u=3:1", "the lower one first"),
        ("--ranges", "u", "NAME=LOW:HIGH"),
        ("--ranges", "u=0:1 [deg]", "deg"),
        ("--ranges", "u=0:1,u=0:2", "twice"),
        ("--budget", "0", "5m"),
        ("--budget", "-3s", "5m"),
        ("--epochs", "0", "epochs"),
    ] {
        let option = format!("{option}={value}");
        let refused = done(path, &job(&["--methods", "gru", &option, "-o", "out"]), &[2]);
        let told = String::from_utf8_lossy(&refused.stderr);
        assert!(told.contains(word), "{option}: {told}");
    }
}
