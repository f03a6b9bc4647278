//! Options of equations that the data do not support: messages and warnings.

use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("hydroid").unwrap().current_dir(folder).args(args).output().unwrap()
}

const IDENTIFY: &[&str] = &[
    "identify",
    "log.csv",
    "-o",
    "out",
    "--outputs",
    "u,r",
    "--inputs",
    "n_cmd,d_cmd",
    "--horizon",
    "20",
    "--methods",
    "sindy",
    "--ridge",
    "1e-6",
];

/// Two outputs and two inputs; `change` modifies a row `[u, r, n, d]`.
fn log(folder: &TempDir, rows: usize, change: impl Fn(&mut [f64; 4])) {
    let mut lines = vec![String::from("t [s],u [m/s],r [rad/s],n_cmd [rps],d_cmd [rad]")];
    let (mut u, mut r) = (0.0, 0.0);
    for k in 0..rows {
        let k = k as f64;
        let mut row = [u, r, (k * 0.05).sin() + 0.3 * (k * 0.171).cos(), 0.4 * (k * 0.083).sin()];
        change(&mut row);
        let [shown_u, shown_r, n, d] = row;
        lines.push(format!("{:.1},{shown_u:.6},{shown_r:.6},{n:.6},{d:.6}", k * 0.1));
        u += 0.1 * (-0.4 * u + 0.8 * n);
        r += 0.1 * (-0.9 * r + 0.5 * d);
    }
    fs::write(folder.path().join("log.csv"), lines.join("\n") + "\n").unwrap();
}

fn refused(folder: &TempDir, args: &[&str], words: &[&str]) {
    let output = hydroid(folder.path(), &[IDENTIFY, args].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
    assert!(message.contains("error: ") && !message.contains("panicked"), "{args:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{args:?}: '{word}' is not in: {message}");
    }
    assert!(!folder.path().join("out").exists(), "{args:?} left something behind");
}

/// Runs with status 0, and returns standard error and standard output.
fn done(folder: &TempDir, args: &[&str]) -> (String, String) {
    let output = hydroid(folder.path(), &[IDENTIFY, &["--window", "0.5"], args].concat());
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{args:?}: {message}");
    (message, String::from_utf8(output.stdout).unwrap())
}

#[test]
fn invalid_options_of_equations() {
    let folder = TempDir::new().unwrap();
    log(&folder, 400, |_| ());
    for (args, words) in [
        (&["--library", "marin"][..], &["marin", "did you mean 'marine'"][..]),
        (
            &["--terms", "u", "--terms", "u sin(d_cdm)"],
            &["terms", "character 7", "'d_cdm'", "did you mean 'd_cmd'"],
        ),
        (&["--terms", "lag(n_cmd, 1 s)"], &["lag(n_cmd, 1 s)", "--lag n=1.5"]),
        (&["--constraints", "w: u <= 0"], &["constraints", "no output 'w'", "u, r"]),
        (&["--constraints", "u: u <= -1"], &["'u: u <= -1'", "one coefficient with 0"]),
        (&["--constraints", "u: u^7 <= 0"], &["u: u^7 <= 0", "no library of the search has the term 'u^7'"]),
        (&["--constraints", "u: u < 0"], &["character 6", "<="]),
        (&["--constraints", "u: u = 1", "--constraints", "u: u = 2"], &["no coefficients obey"]),
        (&["--lag", "n_cdm=1"], &["lag", "no input 'n_cdm'", "did you mean 'n_cmd'"]),
        (&["--lag", "u=1"], &["no input 'u'", "n_cmd, d_cmd"]),
        (&["--lag", "n_cmd=-1"], &["n_cmd=-1", "positive number of seconds"]),
        (&["--lag", "soon"], &["soon", "n=1.5,delta=0.3"]),
        (&["--gate", "w=1/5"], &["gate", "no output 'w'", "u, r"]),
        (&["--gate", "u=1/-5"], &["u=1/-5", "positive slope"]),
        (&["--gate", "u=100/5"], &["u=100/5", "above", "--gate auto"]),
        (&["--gate", "u>1"], &["u>1", "u=2.5/12"]),
        (&["--huber", "0"], &["huber", "positive"]),
        (&["--members", "-3"], &["-3"]),
        // Libraries whose size once exhausted memory or caused a division by zero.
        (&["--library", "degree 60"], &["degree 60", "terms", "smaller degree"]),
        (&["--library", "degree 60", "--lag", "none", "--gate", "none"], &["degree 60", "smaller degree"]),
        (&["--library", "degree 0, no constant"], &["no terms", "degree of 1 or more"]),
        (&["--library", "marine", "--degree", "2"], &["--library", "--degree"]),
        (
            &["--terms", "u", "--terms", "ln(r)"],
            &["'ln(r)'", "log.csv", "zero or below", "leave the term out"],
        ),
    ] {
        refused(&folder, args, words);
    }
    // The options of the file, and an unknown key with a similar name.
    fs::write(folder.path().join("hydroid.toml"), "[sindy]\nconstraint = [\"u: u <= 0\"]\n").unwrap();
    refused(&folder, &[], &["hydroid.toml", "line 2", "did you mean constraints"]);
    fs::write(folder.path().join("hydroid.toml"), "[sindy]\nterms = [\"u |q|\"]\n").unwrap();
    refused(&folder, &[], &["terms", "character 4", "'q'"]);
    fs::write(folder.path().join("hydroid.toml"), "[sindy]\nmembers = 4000000000\n").unwrap();
    refused(&folder, &[], &["members", "4000000000", "0 to 1000"]);
}

#[test]
fn too_few_samples_for_the_library() {
    let folder = TempDir::new().unwrap();
    log(&folder, 150, |_| ());
    refused(
        &folder,
        &["--library", "marine cubic", "--window", "5"],
        &["regression rows", "too few", "smaller library"],
    );
}

#[test]
fn the_equations_have_the_terms_of_the_options() {
    let folder = TempDir::new().unwrap();
    log(&folder, 600, |_| ());
    let terms = ["--terms", "u", "--terms", "r", "--terms", "n_cmd", "--terms", "d_cmd"];
    let (_, text) = done(&folder, &[&terms[..], &["--gate", "none", "--lag", "none"]].concat());
    assert!(text.contains("du/dt = -0.4") && text.contains("+ 0.8") && text.contains(" n_cmd"), "{text}");
    // A sign constraint that the data contradict removes the term; a relation ties two equations.
    let (_, text) = done(
        &folder,
        &[&terms[..], &["--gate", "none", "--lag", "none", "--constraints", "u: n_cmd <= 0"]].concat(),
    );
    let surge = text.lines().find(|line| line.contains("du/dt")).unwrap().to_owned();
    assert!(!surge.contains("n_cmd"), "{surge}");
    let tie = ["--gate", "none", "--lag", "none", "--constraints", "u: n_cmd = 2 r: d_cmd", "--dissipative"];
    done(&folder, &[&terms[..], &tie].concat());
    let inspected = hydroid(folder.path(), &["inspect", "out/sindy.safetensors", "--json"]);
    let document: serde_json::Value = serde_json::from_slice(&inspected.stdout).unwrap();
    let of = |output: &str, term: &str| {
        let all = document["coefficients"].as_array().unwrap();
        let found = all.iter().find(|c| c["output"] == output && c["term"] == term);
        found.unwrap_or_else(|| panic!("{output}: {term}"))["value"].as_f64().unwrap()
    };
    assert!((of("u", "n_cmd") - 2.0 * of("r", "d_cmd")).abs() < 1e-9);
    // A given gate and lag are printed once.
    let modes = ["--library", "degree 1", "--gate", "u=0/4", "--lag", "n_cmd=0.3", "--huber", "1.345"];
    let (_, text) = done(&folder, &modes);
    assert!(!text.contains("below("), "{text}");
    if text.contains("s = sigma(") {
        assert_eq!(text.matches("s = sigma(4.000 u)").count(), 1, "{text}");
    }
}

#[test]
fn collinear_inputs_are_reported() {
    let folder = TempDir::new().unwrap();
    log(&folder, 600, |row| row[3] = 0.5 * row[2]);
    let (message, _) = done(&folder, &["--members", "0"]);
    assert!(message.contains("inputs 'n_cmd' and 'd_cmd' move together"), "{message}");
    log(&folder, 600, |row| row[3] = 0.1);
    let (message, _) = done(&folder, &["--members", "0"]);
    assert!(message.contains("'d_cmd' never moves"), "{message}");
}

#[test]
fn band_coverage_is_reported_for_ensembles() {
    let folder = TempDir::new().unwrap();
    log(&folder, 600, |_| ());
    done(&folder, &["--members", "8", "--library", "degree 1"]);
    let evaluate = |args: &[&str]| {
        hydroid(
            folder.path(),
            &[&["evaluate", "out/sindy.safetensors", "log.csv", "--horizon", "20"], args].concat(),
        )
    };
    let text = String::from_utf8(evaluate(&[]).stdout).unwrap();
    assert!(
        text.contains("90 % band of 8 ensemble members") && text.contains("not measurement noise"),
        "{text}"
    );
    let document: serde_json::Value = serde_json::from_slice(&evaluate(&["--json"]).stdout).unwrap();
    assert_eq!(document["band_coverage"]["members"], 8);
    assert_eq!(document["band_coverage"]["share"][0].as_array().unwrap().len(), 2);
    assert!(document["mae"].is_array());
    done(&folder, &["--members", "0", "--library", "degree 1"]);
    let document: serde_json::Value = serde_json::from_slice(&evaluate(&["--json"]).stdout).unwrap();
    assert!(document.get("band_coverage").is_none());
}

/// A decay test: `du/dt = -0.2 u |u|`, `dr/dt = -0.5 r`, without commands.
fn decay(folder: &TempDir, name: &str, start: [f64; 2]) {
    let mut lines = vec![String::from("t [s],u [m/s],r [rad/s]")];
    let [u, r] = start;
    for k in 0..300 {
        let t = 0.1 * f64::from(k);
        lines.push(format!("{t:.1},{:.9},{:.9}", u / (1.0 + 0.2 * u * t), r * (-0.5 * t).exp()));
    }
    fs::write(folder.path().join(name), lines.join("\n")).unwrap();
}

#[test]
fn a_vessel_without_commands() {
    let folder = TempDir::new().unwrap();
    for (name, start) in [("a.csv", [2.0, 0.2]), ("b.csv", [3.0, 0.1]), ("c.csv", [1.5, 0.3])] {
        decay(&folder, name, start);
    }
    let run = |args: &str| hydroid(folder.path(), &args.split(' ').collect::<Vec<_>>());
    let error = run("identify a.csv b.csv --methods sindy -o out");
    assert_eq!(error.status.code(), Some(2));
    let message = String::from_utf8(error.stderr).unwrap();
    assert!(message.contains("write --inputs none if there are no commands"), "{message}");
    let options = "--outputs u,r --inputs none --horizon 20 --methods sindy --lag none --gate none";
    let found = run(&format!("identify a.csv b.csv c.csv {options} -o out -q"));
    assert_eq!(found.status.code(), Some(0), "{}", String::from_utf8_lossy(&found.stderr));
    let model = run("inspect out/sindy.safetensors");
    let text = String::from_utf8(model.stdout).unwrap();
    assert!(text.contains("-0.2000 u |u|"), "{text}");
    assert!(text.contains("-0.5000 r") || text.contains("-0.4999 r"), "{text}");
    for command in ["evaluate", "adapt"] {
        let done = run(&format!("{command} out/sindy.safetensors a.csv"));
        // The equations are exact: an adapted model may be worse, which is status 1.
        assert!(
            matches!(done.status.code(), Some(0 | 1)),
            "{command}: {}",
            String::from_utf8_lossy(&done.stderr)
        );
    }
    let lines = r#"{"t":0.0,"u":2.0,"r":0.1}
{"t":0.1,"u":1.92,"r":0.095}
"#;
    let mut stream = Command::cargo_bin("hydroid").unwrap();
    stream.current_dir(folder.path()).args(["adapt", "out/sindy.safetensors", "-", "--stream"]);
    let answer = stream.write_stdin(lines).output().unwrap();
    let text = String::from_utf8(answer.stdout).unwrap();
    assert_eq!(text.lines().count(), 2, "{text}{}", String::from_utf8_lossy(&answer.stderr));
    assert!(text.lines().all(|line| !line.contains("\"error\"")), "{text}");
}
