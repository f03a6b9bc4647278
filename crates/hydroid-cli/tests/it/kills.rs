//! `kill -9` at random moments of long-running commands. After the restart, files and answers are those of a run that was not
//! killed, at most a second is repeated, and no file is left over.
//!
//! `HYDROID_KILLS` is the number of kills of each command, in place of a dozen:
//! `HYDROID_KILLS=334 cargo test -p hydroid-cli --test it kills -- --ignored`.

use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::common::{Limit, MODEL, command, hydroid, output, run, simple_vessel, text};

fn kills(default: u64) -> u64 {
    std::env::var("HYDROID_KILLS").map_or(default, |count| count.parse().unwrap())
}

/// Uniform numbers in 0..1 (`SplitMix64`).
struct Moments(u64);

impl Moments {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let number = (self.next() * count as f64) as usize;
        number
    }
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Kills a child after a time. False if it ended before.
fn kill_after(mut child: Child, time: Duration) -> bool {
    std::thread::sleep(time);
    let ended = child.try_wait().unwrap().is_some();
    child.kill().unwrap();
    child.wait().unwrap();
    !ended
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_training_survives_kills() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (seed, file, duration) in [("1", "a.csv", "120"), ("2", "b.csv", "40"), ("3", "c.csv", "40")] {
        let args = ["simulate", "simple", "--seed", seed, "--duration", duration, "-o", file, "-q"];
        assert!(output(&mut hydroid(at, &args)).status.success());
    }
    let small = "[network]\nhidden = 4\nbatch = 8\nwash_out_s = 1\nwindow_s = 4\n";
    fs::write(at.join("small.toml"), small).unwrap();
    let job = "identify a.csv --validate b.csv --test c.csv --outputs u,v,r --inputs PP_cmd,RD_cmd --horizon 10 --origin-stride 4 -c small.toml --methods gru --epochs 3000 -q -o";
    let begun = Instant::now();
    assert!(matches!(run(at, &format!("{job} whole")).status.code(), Some(0 | 1)));
    let whole_s = begun.elapsed().as_secs_f64();
    let read = |folder: &str| fs::read(at.join(folder).join("gru.safetensors")).unwrap();
    let mut moments = Moments(1);
    let (mut killed, mut chain) = (0, 0);
    let mut resumes = 0;
    while killed < kills(12) {
        let into = at.join("killed");
        let checkpoint = into.join("gru.checkpoint");
        let resume = if checkpoint.exists() { " --resume" } else { "" };
        resumes += u64::from(!resume.is_empty());
        let mut job = command(at, &format!("{job} killed{resume}"));
        if chain < 4 {
            chain += 1;
            let child = job.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
            if kill_after(child, Duration::from_secs_f64(moments.next() * 0.6 * whole_s)) {
                killed += 1;
                continue;
            }
        } else {
            let done = output(&mut job);
            assert!(matches!(done.status.code(), Some(0 | 1)), "{resume}: {}", text(&done.stderr));
        }
        assert!(read("whole") == read("killed"), "after {killed} kills");
        assert_eq!(files(&into), files(&at.join("whole")), "after {killed} kills");
        fs::remove_dir_all(&into).unwrap();
        chain = 0;
    }
    assert!(killed < 8 || resumes > 0, "some of the kills leave a checkpoint");
}

/// A service that gets a whole file of lines, and is killed and restarted with the same file.
struct Job<'a> {
    at: &'a Path,
    args: Vec<&'a str>,
    lines: Vec<String>,
    expected: Vec<String>,
}

impl Job<'_> {
    fn start(&self) -> Child {
        let mut child = hydroid(self.at, &self.args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (mut stdin, text) = (child.stdin.take().unwrap(), self.lines.join("\n") + "\n");
        // The service may be killed.
        std::thread::spawn(move || stdin.write_all(text.as_bytes()));
        child
    }

    /// Kills after `count` answers and a time; returns the whole answers.
    fn killed(&self, count: usize, more: Duration) -> Vec<String> {
        let mut child = self.start();
        let _limit = Limit::of(&child);
        let mut out = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut answers: Vec<String> = out.by_ref().take(count).map(Result::unwrap).collect();
        std::thread::sleep(more);
        child.kill().unwrap();
        child.wait().unwrap();
        answers.extend(out.map_while(Result::ok).filter(|line| line.ends_with('}') && is_answer(line)));
        answers
    }

    /// Checks the answers of a session that began with the first line. Returns the number of repeated ones.
    fn check(&self, answers: &[String]) -> usize {
        let is_repeated = |line: &String| line.contains("\"status\":\"repeated\"");
        let repeated = answers.iter().take_while(|line| is_repeated(line)).count();
        for (answer, expected) in answers.iter().zip(&self.expected).skip(repeated) {
            assert_eq!(answer, expected);
        }
        repeated
    }

    /// Kills until `count` are done; `finished` checks the files at the end of each series.
    fn run(&self, count: u64, seed: u64, finished: impl Fn()) {
        let mut moments = Moments(seed);
        let all = self.expected.len();
        let (mut killed, mut answered) = (0, 0);
        while killed < count {
            for _ in 0..=moments.below(5) {
                let answers =
                    self.killed(moments.below(all), Duration::from_micros(moments.below(3_000) as u64));
                let repeated = self.check(&answers);
                assert!(answers.len() < repeated + 1 || answered <= repeated + 12, "{answered} {repeated}");
                answered = answered.max(answers.len());
                killed += 1;
            }
            let mut child = self.start();
            let _limit = Limit::of(&child);
            let answers: Vec<String> = BufReader::new(child.stdout.take().unwrap())
                .lines()
                .map(Result::unwrap)
                .filter(|line| is_answer(line))
                .collect();
            assert_eq!(child.wait().unwrap().code(), Some(0));
            assert_eq!(answers.len(), all, "each line has an answer");
            let repeated = self.check(&answers);
            assert!(answered <= repeated + 12, "more than a second is repeated: {answered} {repeated}");
            finished();
            answered = 0;
        }
    }
}

fn whole(at: &Path, args: &[&str], lines: &[String]) -> Vec<String> {
    let job = Job { at, args: args.to_vec(), lines: lines.to_vec(), expected: Vec::new() };
    let child = job.start();
    let _limit = Limit::of(&child);
    let done = child.wait_with_output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    text(&done.stdout).lines().map(str::to_owned).filter(|line| is_answer(line)).collect()
}

/// The neutral commands after the end of the input answer no line.
fn is_answer(line: &str) -> bool {
    !line.contains("the input has ended")
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn an_adaptation_survives_kills() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let model = simple_vessel().join(MODEL);
    let model = model.to_str().unwrap();
    let log = fs::read_to_string(simple_vessel().join("c.csv")).unwrap();
    let lines: Vec<String> = log.lines().take(400).map(str::to_owned).collect();
    let args = |name: &'static [&'static str; 3]| {
        let [state, record, learned] = *name;
        vec![
            "adapt",
            model,
            "-",
            "--state",
            state,
            "--black-box",
            record,
            "-o",
            learned,
            "--horizons",
            "1,20",
        ]
    };
    let expected = whole(at, &args(&["w.state", "w.box", "w.safetensors"]), &lines);
    assert_eq!(expected.len(), lines.len() - 1);
    let read = |file: &str| fs::read(at.join(file)).unwrap();
    let job = Job { at, args: args(&["k.state", "k.box", "k.safetensors"]), lines, expected };
    job.run(kills(60), 2, || {
        assert!(read("k.safetensors") == read("w.safetensors"));
        assert!(read("k.state") == read("w.state"));
        let replay = output(&mut hydroid(at, &["adapt", model, "--replay", "k.box"]));
        assert_eq!(replay.status.code(), Some(0), "{}{}", text(&replay.stdout), text(&replay.stderr));
        for file in ["k.state", "k.box", "k.safetensors"] {
            fs::remove_file(at.join(file)).unwrap();
        }
        assert_eq!(files(at), ["w.box", "w.safetensors", "w.state"]);
    });
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_control_service_survives_kills() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let lines: Vec<String> = (0..300)
        .map(|k| {
            let t = 0.1 * f64::from(k);
            let (x, y, psi) = (1.5 * t, 0.5 * (0.3 * t).cos(), 0.05 * (0.3 * t).sin());
            format!(r#"{{"t":{t},"x":{x},"y":{y},"psi":{psi},"u":1.5,"v":0.01,"r":{}}}"#, 0.1 * psi)
        })
        .collect();
    let args = |state: &'static str| {
        let args = "control hydrofoil --controller fl --task lawn-mower --horizons 10 --adapt - --state";
        args.split(' ').chain([state]).collect::<Vec<_>>()
    };
    let expected = whole(at, &args("w.state"), &lines);
    assert_eq!(expected.len(), lines.len());
    let job = Job { at, args: args("k.state"), lines, expected };
    job.run(kills(60), 3, || {
        assert!(fs::read(at.join("k.state")).unwrap() == fs::read(at.join("w.state")).unwrap());
        fs::remove_file(at.join("k.state")).unwrap();
        assert_eq!(files(at), ["w.state"]);
    });
}
