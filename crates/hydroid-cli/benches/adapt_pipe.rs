//! Response time of `hydroid adapt MODEL -` through two pipes: `cargo bench -p hydroid-cli --bench adapt_pipe`. Not
//! with divan, because the result is the 99th percentile.

use std::error::Error;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn hydroid(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hydroid"));
    command.current_dir(folder).args(line.split(' '));
    command
}

fn run(folder: &Path, line: &str) -> Result<(), Box<dyn Error>> {
    let output = hydroid(folder, line).output()?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).into()) }
}

/// Round-trip times of all lines of a log; `pause` is the time between lines.
fn round_trips(folder: &Path, line: &str, log: &str, pause: Duration) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut child =
        hydroid(folder, line).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?;
    let mut to = child.stdin.take().ok_or("no pipe")?;
    let mut from = BufReader::new(child.stdout.take().ok_or("no pipe")?);
    let mut rows = log.lines();
    writeln!(to, "{}", rows.next().ok_or("no header")?)?;
    let (mut times, mut row, mut answer) = (Vec::new(), String::new(), String::new());
    for next in rows {
        std::thread::sleep(pause);
        row.clear();
        row.push_str(next);
        row.push('\n');
        answer.clear();
        let start = Instant::now();
        to.write_all(row.as_bytes())?;
        from.read_line(&mut answer)?;
        times.push(start.elapsed().as_secs_f64() * 1e6);
    }
    drop(to);
    child.wait()?;
    times.sort_by(f64::total_cmp);
    Ok(times)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let at = folder.path();
    for (seed, file) in [("1", "a.csv"), ("2", "b.csv"), ("3", "c.csv")] {
        run(at, &format!("simulate hydrofoil --seed {seed} --duration 600 -o {file}"))?;
    }
    let columns = "--outputs u,v,r --inputs PP_cmd,RD_ang";
    run(at, &format!("identify a.csv --validate b.csv --test c.csv {columns} --methods sindy -o out -q"))?;
    let log = std::fs::read_to_string(at.join("c.csv"))?;
    let short: String = log.lines().take(1000).flat_map(|line| [line, "\n"]).collect();
    println!("{:58} {:>8} {:>8} {:>8}", "response time [us]", "median", "99 %", "maximum");
    let adapt = "adapt out/sindy.safetensors - -q";
    for (what, line, log, pause_ms) in [
        ("horizons 1", format!("{adapt} --horizons 1"), &log, 0),
        ("horizons 1,10,50,100", adapt.to_owned(), &log, 0),
        ("horizons 1,10,50,100, state in a file", format!("{adapt} --state s"), &log, 0),
        ("horizons 1,10,50,100, a line every 5 ms", adapt.to_owned(), &short, 5),
    ] {
        let times = round_trips(at, &line, log, Duration::from_millis(pause_ms))?;
        let (half, most) = (times.len() / 2, times.len() * 99 / 100);
        println!("{what:58} {:8.0} {:8.0} {:8.0}", times[half], times[most], times[times.len() - 1]);
    }
    Ok(())
}
