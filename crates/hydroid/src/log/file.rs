//! One log on its way to runs: the clock, the parts between jumps, and the tables of each part.

use super::clock::Clock;
use super::columns::Columns;
use super::error::LogError;
use super::gaps;
use super::grid::Part;
use super::note::{Note, count};
use super::prepare::{FEWEST_SAMPLES, PrepareOptions};
use super::resample::Resampling;
use super::trajectory::Trajectory;
use crate::key::key;

/// Longest usual step \[s\] of a clock without a unit.
const LONGEST_UNSTATED_S: f64 = 30.0;
/// Shortest one: a log of a vessel has less than a thousand samples per second. Days of a spreadsheet are below it.
const SHORTEST_UNSTATED_S: f64 = 5e-4;
/// A step below this share of the step of the log causes a warning.
const FINER: f64 = 0.99;
/// A step below this share of the step of the log (one half, with a margin for rounding) is an error.
const FINEST: f64 = 0.4999;

/// The columns of one log, with its clock.
pub(super) struct File<'a> {
    pub(super) columns: Columns<'a>,
    pub(super) clock: Clock,
    max_gap_s: f64,
}

impl<'a> File<'a> {
    pub(super) fn new(
        columns: Columns<'a>,
        options: &PrepareOptions,
        notes: &mut Vec<Note>,
    ) -> Result<Self, LogError> {
        let too_short = |columns: &Columns<'_>| LogError::TooShort {
            path: columns.path.clone(),
            found: columns.rows(),
            needed: FEWEST_SAMPLES,
            remedy: "record for longer".to_owned(),
        };
        if columns.rows() < FEWEST_SAMPLES {
            return Err(too_short(&columns));
        }
        let usual = Clock::usual_step(&columns.t).ok_or_else(|| too_short(&columns))?;
        if let Some(column) =
            columns.unstated.clone().filter(|_| !(SHORTEST_UNSTATED_S..=LONGEST_UNSTATED_S).contains(&usual))
        {
            return Err(LogError::SlowClock { path: columns.path.clone(), column, step: usual });
        }
        let default_s = gaps::default_limit(&columns, usual, options.dt, notes);
        let max_gap_s = options.max_gap_s.unwrap_or(default_s);
        let clock = Clock::with_usual_step(&columns.t, usual, max_gap_s);
        check_step(&columns, &clock, options)?;
        Ok(Self { columns, clock, max_gap_s })
    }

    /// The usable parts between jumps in time, with step `dt`. Values are moved out of the columns where possible.
    pub(super) fn runs(
        &mut self,
        name: &str,
        dt: f64,
        options: &PrepareOptions,
        notes: &mut Vec<Note>,
    ) -> Result<Vec<Trajectory>, LogError> {
        let path = self.columns.path.clone();
        let path = path.as_str();
        let native = self.clock.regular && (dt - self.clock.step_s).abs() <= 1e-3 * dt;
        let resampling = Resampling {
            dt,
            step: self.clock.step_s,
            max_gap_s: self.max_gap_s,
            timing: options.command_timing,
            delay: options.input_delay,
        };
        self.note_resampling(native, dt, notes);
        self.note_finer(dt, notes);
        let parts = self.parts(notes);
        let mut runs: Vec<Trajectory> = Vec::new();
        let mut held = vec![0; self.columns.inputs.len()];
        let (mut front, mut back, mut absent, mut short, mut pieces) = (0, 0, 0, 0, 0);
        for part in parts {
            if part.1 - part.0 < FEWEST_SAMPLES {
                short += part.1 - part.0;
                continue;
            }
            let mut part = if native {
                Part::native(&mut self.columns, part, dt, options.command_timing, options.input_delay)?
            } else {
                resampling.run(&self.columns, part)?
            };
            for (sum, n) in held.iter_mut().zip(&part.held) {
                *sum += n;
            }
            absent += part.absent;
            let dropped = part.drop_without_command();
            front += dropped.0;
            back += dropped.1;
            let mut usable = gaps::usable(&part.run, self.max_gap_s);
            let before: usize = usable.iter().map(|p| p.1 - p.0).sum();
            usable.retain(|p| p.1 - p.0 >= FEWEST_SAMPLES);
            short += before - usable.iter().map(|p| p.1 - p.0).sum::<usize>();
            note_cuts(path, &part.run, &usable, notes);
            pieces += 1;
            cut(name, part.run, &usable, &mut runs);
        }
        for (channel, n) in self.columns.input_channels.iter().zip(&held) {
            if *n > 0 {
                let cells = count(*n, "blank cell");
                notes.push(Note::info(format!(
                    "{path}: {cells} of the command `{}` hold the previous value",
                    channel.name
                )));
            }
        }
        let mut add_note = |n: usize, what: &str| {
            if n > 0 {
                notes.push(Note::info(format!("{path}: {} {what}", count(n, "sample"))));
            }
        };
        add_note(absent, "without a row in the log count as missing measurements");
        add_note(front, "dropped at the beginning, before the first command is known");
        add_note(back, "dropped at the end, where the shifted command is unknown");
        add_note(short, "dropped in pieces of fewer than 3 samples");
        if let ([run], 1) = (&mut runs[..], pieces) {
            name.clone_into(&mut run.name);
        }
        self.note_missing(&runs, notes);
        Ok(runs)
    }

    /// Splits rows at jumps in time longer than the gap limit.
    fn parts(&self, notes: &mut Vec<Note>) -> Vec<(usize, usize)> {
        let t = &self.columns.t;
        let jumps: Vec<usize> = (1..t.len()).filter(|&k| t[k] - t[k - 1] > self.max_gap_s).collect();
        if let Some(&k) = jumps.first() {
            let longest = jumps.iter().map(|&k| t[k] - t[k - 1]).fold(0.0, f64::max);
            notes.push(Note::warning(format!(
                "{}: split at {} in time longer than {:.3} s (the first before line {}, the longest {longest:.3} s)",
                self.columns.path,
                count(jumps.len(), "jump"),
                self.max_gap_s,
                self.columns.lines.get(k),
            )));
        }
        let starts = std::iter::once(0).chain(jumps.iter().copied());
        starts.zip(jumps.iter().copied().chain([t.len()])).collect()
    }

    fn note_resampling(&self, native: bool, dt: f64, notes: &mut Vec<Note>) {
        let Clock { step_s, shortest_s, longest_s, regular } = self.clock;
        let path = &self.columns.path;
        if !regular {
            notes.push(
                Note::warning(format!(
                    "{path}: the clock is irregular (steps of {shortest_s:.4} s to {longest_s:.4} s, usually {step_s:.4} s); \
                     resampled to {dt:.4} s with interpolated measurements"
                ))
                .with_remedy(format!("record the time of each measurement; set the step with {}", key("dt"))),
            );
        } else if !native {
            notes.push(Note::info(format!("{path}: resampled from {step_s} s to {dt} s")));
        }
    }

    /// Warns of a step below the step of the log: interpolated samples depend on later measurements.
    fn note_finer(&self, dt: f64, notes: &mut Vec<Note>) {
        let (path, step) = (&self.columns.path, self.clock.step_s);
        if dt < FINER * step {
            notes.push(
                Note::warning(format!(
                    "{path}: the step of {dt} s is shorter than the step of the log ({step} s): values between samples are interpolated with the next measurement, \
                     and errors of predictions over less than {step} s are underestimated"
                ))
                .with_remedy(format!(
                    "set {} to {step} or more, or evaluate only horizons of {step} s or longer",
                    key("dt")
                )),
            );
        }
    }

    fn note_missing(&self, runs: &[Trajectory], notes: &mut Vec<Note>) {
        for (i, channel) in self.columns.output_channels.iter().enumerate() {
            let missing: usize =
                runs.iter().map(|r| r.outputs.column(i).filter(|x| x.is_nan()).count()).sum();
            if missing > 0 {
                let all: usize = runs.iter().map(Trajectory::len).sum();
                notes.push(Note::info(format!(
                    "{}: `{}` is missing in {missing} of {all} samples; missing values are not filled in",
                    self.columns.path, channel.name
                )));
            }
        }
    }
}

/// Rejects a step for which most samples would be interpolated.
fn check_step(columns: &Columns<'_>, clock: &Clock, options: &PrepareOptions) -> Result<(), LogError> {
    let step = clock.step_s;
    match options.dt {
        Some(dt) if dt < FINEST * step => Err(LogError::BadOption {
            what: "a step",
            value: format!("{dt} s"),
            reason: format!(
                "{} has a sample every {step} s, and most of the samples would only be interpolated between measurements; \
                 leave {} out or give {} at least",
                columns.path,
                key("dt"),
                0.5 * step
            ),
        }),
        _ => Ok(()),
    }
}

/// Adds the usable parts of a run, each named after the part.
fn cut(name: &str, run: Trajectory, usable: &[(usize, usize)], runs: &mut Vec<Trajectory>) {
    let name_of = |from: usize, to: usize| {
        let time = |k: usize| run.t0 + k as f64 * run.dt;
        format!("{name} ({:.1} s to {:.1} s)", time(from), time(to - 1))
    };
    if let &[(0, to)] = usable
        && to == run.len()
    {
        runs.push(Trajectory { name: name_of(0, to), ..run });
    } else {
        runs.extend(usable.iter().map(|&(from, to)| run.named_slice(from, to, name_of(from, to))));
    }
}

/// Number of cuts of one part with a note of their own.
const SHOWN_CUTS: usize = 5;

/// Adds notes on the cuts between and around the usable parts.
fn note_cuts(path: &str, run: &Trajectory, usable: &[(usize, usize)], notes: &mut Vec<Note>) {
    let time = |k: usize| run.t0 + k as f64 * run.dt;
    let mut note_cut = |from: usize, to: usize, place: &str| {
        if from < to {
            notes.push(Note::warning(format!(
                "{path}: {} {place} cut out, {:.2} s to {:.2} s: an output is missing there",
                count(to - from, "sample"),
                time(from),
                time(to - 1),
            )));
        }
    };
    let (Some(first), Some(last)) = (usable.first(), usable.last()) else {
        note_cut(0, run.len(), "");
        return;
    };
    note_cut(0, first.0, "at the beginning");
    for pair in usable.windows(2).take(SHOWN_CUTS) {
        note_cut(pair[0].1, pair[1].0, "in the middle");
    }
    if usable.len() > SHOWN_CUTS + 1 {
        let (from, to) = (usable[SHOWN_CUTS].1, last.0);
        note_cut(from, to, &format!("in further cuts ({} in total)", count(usable.len() - 1, "cut")));
    }
    note_cut(last.1, run.len(), "at the end");
}
