//! `hydroid thesis`: the quick version with its verdicts, resumption after a kill, edited experiments.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn hydroid(folder: &Path, args: &[&str]) -> Output {
    Command::cargo_bin("hydroid").unwrap().current_dir(folder).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// All files in a folder except the cache.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for part in ["figures", "data"] {
        for entry in fs::read_dir(folder.join(part)).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{part}/{}", path.file_name().unwrap().to_string_lossy());
            found.insert(name, fs::read(&path).unwrap());
        }
    }
    found.insert("index.html".into(), fs::read(folder.join("index.html")).unwrap());
    found
}

/// The small version of the study: claims with a clear outcome have it here, every reason has its values, documents are
/// complete, and a second run changes nothing.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn the_quick_study_writes_all_results() {
    let folder = TempDir::new().unwrap();
    let output = hydroid(folder.path(), &["thesis", "--quick", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let claims = document["claims"].as_array().unwrap();
    let verdict = |words: &str| {
        let of = |claim: &&Value| claim["claim"].as_str().unwrap().contains(words);
        claims.iter().find(of).unwrap_or_else(|| panic!("no claim of '{words}'"))
    };
    for (words, expected) in [
        ("SINDy identifies the simple vessel", "reproduced"),
        ("Feedback linearization with the equations that SINDy identified", "reproduced"),
        ("The error of C0 grows", "reproduced"),
        ("Over several epochs the filter diverges", "not_reproduced"),
        ("The memory of the filter grows", "reproduced"),
    ] {
        let claim = verdict(words);
        assert_eq!(claim["verdict"], expected, "{claim}");
    }
    for claim in claims {
        for key in ["claim", "experiment", "because"] {
            assert!(claim[key].as_str().is_some_and(|words| !words.is_empty()), "{key} of {claim}");
        }
        // Every value of a reason was measured.
        let because = claim["because"].as_str().unwrap();
        assert!(!because.contains(['{', '}', '–']) && !because.contains("NaN"), "{because}");
        let measures = claim["measures"].as_array().unwrap();
        for measure in measures {
            assert!(measure["figure"].as_f64().is_some_and(f64::is_finite), "{claim}");
            for key in ["measure", "measured", "over"] {
                assert!(measure[key].as_str().is_some_and(|words| !words.is_empty()), "{key} of {claim}");
            }
        }
        let verdicts = ["reproduced", "in_part", "not_reproduced"];
        let rank = |of: &Value| verdicts.iter().position(|word| of["verdict"] == *word).unwrap();
        assert_eq!(Some(rank(claim)), measures.iter().map(rank).max(), "{claim}");
    }
    let report = folder.path().join("report");
    let first = files(&report);
    let names: Vec<&String> = document["measures"].as_object().unwrap().keys().collect();
    for name in names {
        let data: Value = serde_json::from_slice(&first[&format!("data/{name}.json")]).unwrap();
        assert!(data["experiment"]["title"].is_string() && data["measures"].is_object(), "{name}");
        for table in data["tables"].as_array().unwrap() {
            let columns = table["columns"].as_array().unwrap().len();
            let rows = table["rows"].as_array().unwrap();
            assert!(!rows.is_empty(), "{name}: {}", table["name"]);
            assert!(rows.iter().all(|row| row.as_array().unwrap().len() == columns), "{name}");
        }
    }
    let kept: Value = serde_json::from_slice(&first["data/claims.json"]).unwrap();
    assert_eq!(&kept, &document["claims"]);
    for (name, bytes) in &first {
        let content = text(bytes);
        if name.starts_with("figures/") {
            assert!(
                content.starts_with("<svg ") && content.contains("xmlns="),
                "{name} is not a file of its own"
            );
        }
        if Path::new(name).extension().is_some_and(|e| e == "csv") {
            assert!(!content.contains("NaN") && !content.contains(",inf"), "{name}");
        }
    }
    let page = text(&first["index.html"]);
    for figure in 1..=9 {
        assert!(page.contains(&format!("Figure {figure}: ")), "figure {figure}");
    }
    assert!(page.contains("Table 1") && !page.contains("NaN") && !page.contains("http://localhost"));
    // The page loads no external resources.
    assert!(!page.contains("src=") && page.matches("<script").count() == 1 && !page.contains("<link"));

    let again = hydroid(folder.path(), &["thesis", "--quick"]);
    assert_eq!(again.status.code(), Some(0), "{}", text(&again.stderr));
    let second = files(&report);
    let changed: Vec<&String> = first.keys().filter(|name| first[*name] != second[*name]).collect();
    assert!(changed.is_empty(), "{changed:?}");
}

/// Custom experiments, small enough to run three times.
fn own(folder: &Path) {
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    fs::create_dir_all(folder).unwrap();
    let mut records = String::new();
    for (name, drive, duration, seed) in
        [("train", "mixed", 200, 1), ("validate", "mixed", 100, 2), ("test", "mixed", 120, 3)]
    {
        let _ = write!(
            records,
            "[{name}]\nplant = \"hydrofoil\"\nexcitation = \"{drive}\"\nduration_s = {duration}\nseed = {seed}\n"
        );
    }
    write("records.toml", &records);
    write(
        "models.toml",
        r#"
[direct]
method = "direct"
train = "train"
validate = "validate"
test = "test"
seeds = [0, 1]
horizon = 20
network = { base = "nothing", hidden = 16, epochs = 20 }
[lstm]
method = "lstm"
train = "train"
validate = "validate"
test = "test"
seeds = [0, 1, 2]
horizon = 100
network = { feedback = false, base = "nothing", hidden = 6, epochs = 20 }
"#,
    );
    write("claims.toml", "claim = []\n");
    write(
        "fig5.toml",
        "title = \"a\"\ntext = \"b\"\n[run.blocks]\nmodels = [\"direct\"]\nrecord = \"test\"\n",
    );
    write(
        "fig6.toml",
        "title = \"c\"\ntext = \"d\"\n[run.horizons]\nmodels = [\"lstm\"]\nrecords = [\"test\"]\nerror = \"mean\"\n",
    );
}

/// A killed and resumed study writes the same bytes as an uninterrupted one.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_killed_study_resumes() {
    let folder = TempDir::new().unwrap();
    own(&folder.path().join("mine"));
    let args = ["thesis", "--experiments", "../mine"];
    let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
    fs::create_dir_all(&whole).unwrap();
    fs::create_dir_all(&killed).unwrap();
    let output = hydroid(&whole, &args);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));

    let program = assert_cmd::cargo::cargo_bin("hydroid");
    let mut child = std::process::Command::new(program)
        .current_dir(&killed)
        .args(args)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let cache = killed.join("report/cache");
    let clock = Instant::now();
    // Stored results with their time of writing: `NAME.json` is written after its model.
    let kept = || -> BTreeMap<PathBuf, SystemTime> {
        let entries = fs::read_dir(&cache).into_iter().flatten().flatten().map(|entry| entry.path());
        let whole = entries.filter(|path| path.extension().is_some_and(|e| e == "json"));
        whole.map(|path| (path.clone(), fs::metadata(path).unwrap().modified().unwrap())).collect()
    };
    // A model is stored, and the page does not exist.
    while kept().is_empty() && clock.elapsed() < Duration::from_mins(2) {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!killed.join("report/index.html").exists(), "it was too fast to be killed");
    let before = kept();
    assert!(!before.is_empty(), "nothing was made within two minutes");

    let output = hydroid(&killed, &args);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let after = kept();
    for (path, time) in &before {
        assert_eq!(time, &after[path], "{} was made again", path.display());
    }
    assert!(after.len() > before.len());
    let (whole, killed) = (files(&whole.join("report")), files(&killed.join("report")));
    assert_eq!(whole.keys().collect::<Vec<_>>(), killed.keys().collect::<Vec<_>>());
    for (name, bytes) in &whole {
        assert!(bytes == &killed[name], "{name} is another");
    }
}

#[test]
fn invalid_values_are_refused_with_their_place() {
    let folder = TempDir::new().unwrap();
    let mine = folder.path().join("mine");
    let refused = |args: &[&str], words: &[&str]| {
        let output = hydroid(folder.path(), args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        let message = text(&output.stderr);
        for word in words {
            assert!(message.contains(word), "{args:?}: {message}");
        }
    };
    refused(&["thesis", "fig55"], &["fig55", "did you mean 'fig5'"]);
    refused(&["thesis", "--experiments", "nowhere"], &["nowhere", "--write-experiments"]);
    let study = ["thesis", "--experiments", "mine", "-o", "out"];
    own(&mine);
    fs::write(mine.join("fig6.toml"), "title = \"c\"\ntext = \"d\"\n[run.horizon]\nmodels = []\n").unwrap();
    refused(&study, &["fig6.toml", "horizon"]);
    own(&mine);
    let none =
        "title = \"c\"\ntext = \"d\"\n[run.horizons]\nmodels = []\nrecords = [\"test\"]\nerror = \"mean\"\n";
    fs::write(mine.join("fig6.toml"), none).unwrap();
    refused(&study, &["fig6", "no models"]);
    own(&mine);
    let records = fs::read_to_string(mine.join("records.toml")).unwrap();
    fs::write(mine.join("records.toml"), records.replace("[test]", "[toast]")).unwrap();
    refused(&study, &["'test'", "toast"]);
    own(&mine);
    fs::write(mine.join("records.toml"), records.replace("seed = 3", "sed = 3")).unwrap();
    refused(&study, &["records.toml, line", "'test'", "sed"]);
}

#[test]
fn built_in_experiments_are_files() {
    let folder = TempDir::new().unwrap();
    let output = hydroid(folder.path(), &["thesis", "--write-experiments", "mine"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    // Edited files are kept.
    fs::write(folder.path().join("mine/fig5.toml"), "mine").unwrap();
    let refused = hydroid(folder.path(), &["thesis", "--write-experiments", "mine"]);
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(fs::read_to_string(folder.path().join("mine/fig5.toml")).unwrap(), "mine");
    fs::remove_file(folder.path().join("mine/fig5.toml")).unwrap();
    assert_eq!(hydroid(folder.path(), &["thesis", "--write-experiments", "mine"]).status.code(), Some(0));
    for args in [vec!["thesis", "--list"], vec!["thesis", "--list", "--experiments", "mine", "--quick"]] {
        let listed = hydroid(folder.path(), &args);
        assert_eq!(listed.status.code(), Some(0), "{}", text(&listed.stderr));
        assert_eq!(text(&listed.stdout), text(&hydroid(folder.path(), &["thesis", "--list"]).stdout));
    }
}
