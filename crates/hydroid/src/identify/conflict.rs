//! Logs in which an input acts differently than in the other ones: with the opposite sign, in the place of another input, in another
//! unit, or not at all, as after a change of wiring or of settings between two days.
//!
//! # Method
//! Windows of `h` samples give one linear regression in the increments of the outputs,
//!
//! ```text
//! y(k + h) - y(k) = c_i + A phi(y(k), u) + e,    phi = [y, y_a y_b, y_a |y_a|, u, u_j y_a, u_j |u_j|]
//! ```
//!
//! with `u` the mean of the inputs over the window, and a constant `c_i` for each log `i`, which holds its trim and current. `h` is
//! the eighth, quarter, half or whole of the horizon with the largest likelihood ratio against `A = 0`. For each log and each
//! change of its inputs (gain -1, 0, 1/2, 2, 57.3, 100 or their inverses for one input or for all; two inputs exchanged), the regression of all logs is solved anew. The change with the largest likelihood is made, and the next one is
//! looked for, as long as its odds are [`ODDS`] against one for as many changes as were tried (Bonferroni). Gains of 1/2 and 2
//! take up loads and batteries, and are not reported: a change is stated only if these explain less.
//!
//! *Valid* for logs that were recorded separately, with errors that are independent over windows that do not overlap. Therefore, a
//! change is looked for only where its inputs move often and the vessel moves as in other logs, and stated only if it also
//! explains half as much of an output in that log as the inputs do in the others, and the inputs as logged do not. Disturbances and settings are not
//! changed, and vessels with angles beyond 90 degrees, as of azimuth thrusters, not judged: their effect is not linear. Which logs are the wrong ones is not known: those of most windows
//! are taken as right.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;

use crate::boat::{Boat, Role};
use crate::committee::ridge::{Moments, solve};
use crate::key::key;
use crate::log::{Channel, Note, Trajectory};

/// Odds from which on a change counts.
const ODDS: f64 = 1000.0;

/// Ridge penalty, relative to the mean square of each term.
const RIDGE: f64 = 1e-6;

/// Share of an output's variance that the inputs explain in the other logs, and the part of it that a change must explain.
const LEAST: f64 = 0.2;
const SHARE: f64 = 0.5;

/// Fewest moves of an input in a log, by a fifth of its range, from which on a change of it is looked for: the windows
/// between two moves are no evidence of their own.
const MOVES: usize = 6;
const MOVE: f64 = 0.2;

/// Most windows of all logs.
const MOST_WINDOWS: usize = 5000;

/// Most operations of the solutions of a round.
const MOST_WORK: f64 = 2e10;

/// Most changes that are made.
const MOST_CHANGES: usize = 20;

/// A change of the inputs of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Change {
    /// One input, or all, times a number.
    Gain(Option<usize>, f64),
    Swap(usize, usize),
}

impl Change {
    /// The inputs that it changes.
    fn inputs(self, all: usize) -> impl Iterator<Item = usize> {
        (0..all).filter(move |j| match self {
            Self::Gain(which, _) => which.is_none_or(|only| only == *j),
            Self::Swap(a, b) => [a, b].contains(j),
        })
    }
}

/// Increments of the outputs in windows of a log, divided by their spread over all logs, with states and inputs relative to their
/// root mean square.
struct Windows {
    outputs: Vec<Vec<f64>>,
    inputs: Vec<Vec<f64>>,
    increments: Vec<Vec<f64>>,
}

/// Second moments about the means of a log.
#[derive(Clone)]
struct Sums {
    moments: Moments,
    /// Sum of the squares of the increments of each output.
    squares: Vec<f64>,
}

/// Warnings of logs in which inputs act differently than in most others.
pub(super) fn warnings(runs: &[&Trajectory], boat: &Boat, horizon: usize) -> Vec<Note> {
    let Some(first) = runs.first() else { return Vec::new() };
    let mut is_azimuth = false;
    let neutral = |(j, channel): (usize, &Channel)| {
        let values = || runs.iter().flat_map(|run| run.inputs.column(j));
        let seen = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
        is_azimuth |= channel.unit == "rad" && seen.iter().any(|x| x.abs() > FRAC_PI_2);
        let is_other = matches!(boat.role(&channel.name), Some(Role::Disturbance | Role::Setting));
        (boat.value(channel, Some(seen)).map_or(0.0, |value| value.neutral), !is_other)
    };
    let (neutral, changeable): (Vec<f64>, Vec<bool>) =
        first.inputs.channels().iter().enumerate().map(neutral).unzip();
    let mut logs: Vec<(&str, Vec<&Trajectory>)> = Vec::new();
    for run in runs {
        match logs.iter_mut().find(|(name, _)| *name == run.log()) {
            Some((_, parts)) => parts.push(run),
            None => logs.push((run.log(), vec![run])),
        }
    }
    if logs.len() < 2 || is_azimuth {
        return Vec::new();
    }
    let lengths = [8, 4, 2, 1].map(|part| (horizon / part).max(1));
    let problems = lengths.into_iter().filter_map(|h| Problem::new(&logs, &neutral, h));
    let best = problems.max_by(|a, b| a.evidence().total_cmp(&b.evidence()));
    best.map_or_else(Vec::new, |problem| problem.notes(&logs, &changeable))
}

/// The regression over all logs.
struct Problem {
    logs: Vec<Windows>,
    /// Number of windows that do not overlap.
    independent: f64,
    /// Factor of an input to its root mean square.
    scale: Vec<f64>,
}

impl Problem {
    /// Windows of `h` samples; none if they are too few for the terms.
    fn new(logs: &[(&str, Vec<&Trajectory>)], neutral: &[f64], h: usize) -> Option<Self> {
        let samples: usize = logs.iter().flat_map(|(_, parts)| parts).map(|run| run.len()).sum();
        let stride = (h / 2).max(samples / MOST_WINDOWS).max(1);
        let mut all: Vec<Windows> =
            logs.iter().map(|(_, parts)| Windows::new(parts, neutral, h, stride)).collect();
        let count: usize = all.iter().map(|windows| windows.inputs.len()).sum();
        let (outputs, inputs) = (all.iter().find_map(|w| w.outputs.first())?.len(), neutral.len());
        let independent = (count * stride.min(h)) as f64 / h as f64;
        if inputs == 0 || independent < 4.0 * terms(outputs, inputs) as f64 {
            return None;
        }
        normalize(&mut all, |w| &mut w.outputs);
        normalize(&mut all, |w| &mut w.increments);
        let scale = normalize(&mut all, |w| &mut w.inputs);
        Some(Self { logs: all, independent, scale })
    }

    /// Logarithm of the likelihood ratio against no effect.
    fn evidence(&self) -> f64 {
        let sums: Vec<Sums> = self.logs.iter().map(|windows| windows.sums(<[f64]>::to_vec)).collect();
        let total = Sums::total(&sums);
        total.residuals().map_or(0.0, |residuals| self.log_ratio(&total.squares, &residuals))
    }

    /// Whether half of the windows of a log begin within the outputs of other logs: a vessel that sails astern in one log alone is no
    /// conflict.
    fn is_usual(&self, log: usize) -> bool {
        let others = || self.logs.iter().enumerate().filter(|(i, _)| *i != log).flat_map(|(_, w)| &w.outputs);
        let outputs = others().next().map_or(0, Vec::len);
        let range = |o: usize| {
            others().map(|y| y[o]).fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
        };
        let ranges: Vec<[f64; 2]> = (0..outputs).map(range).collect();
        let is_inside =
            |y: &&Vec<f64>| y.iter().zip(&ranges).all(|(x, [low, high])| (low..=high).contains(&x));
        let own = &self.logs[log].outputs;
        2 * own.iter().filter(is_inside).count() > own.len()
    }

    /// Inputs of each log that move often.
    fn moving(&self) -> Vec<Vec<bool>> {
        let moves = |windows: &Windows, j: usize| {
            let all = || windows.inputs.iter().map(|u| u[j]);
            let range = all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min);
            let (mut level, mut moves) = (f64::NAN, 0);
            for x in all() {
                if level.is_nan() || (x - level).abs() > MOVE * range {
                    level = x;
                    moves += 1;
                }
            }
            moves > MOVES
        };
        let of = |windows: &Windows| (0..self.scale.len()).map(|j| moves(windows, j)).collect();
        self.logs.iter().map(of).collect()
    }

    fn log_ratio(&self, before: &[f64], after: &[f64]) -> f64 {
        let each = before.iter().zip(after).map(|(b, a)| (b / a.max(f64::MIN_POSITIVE)).ln());
        0.5 * self.independent * each.filter(|x| x.is_finite()).sum::<f64>()
    }

    /// Inputs of a log with a change, in their scale.
    fn changed(&self, windows: &Windows, change: Change) -> Sums {
        windows.sums(|u| {
            let mut u = u.to_vec();
            match change {
                Change::Gain(_, gain) => {
                    for j in change.inputs(u.len()) {
                        u[j] *= gain;
                    }
                }
                Change::Swap(a, b) => {
                    let (of_a, of_b) = (u[a] * self.scale[a], u[b] * self.scale[b]);
                    (u[a], u[b]) = (of_b / self.scale[a], of_a / self.scale[b]);
                }
            }
            u
        })
    }

    fn notes(&self, names: &[(&str, Vec<&Trajectory>)], changeable: &[bool]) -> Vec<Note> {
        let changes = changes(self.scale.len());
        let mut current: Vec<Sums> = self.logs.iter().map(|windows| windows.sums(<[f64]>::to_vec)).collect();
        let logged = current.clone();
        let moving = self.moving();
        let is_open = |(i, change): &(usize, Change)| {
            self.is_usual(*i) && change.inputs(self.scale.len()).all(|j| changeable[j] && moving[*i][j])
        };
        let all = (0..self.logs.len()).flat_map(|i| changes.iter().map(move |change| (i, *change)));
        let mut open: Vec<(usize, Change)> = all.filter(is_open).collect();
        let size = terms(self.logs[0].outputs.first().map_or(0, Vec::len), self.scale.len());
        if open.len() as f64 * (size as f64).powi(3) > MOST_WORK {
            return Vec::new();
        }
        let mut made: Vec<(usize, Vec<Change>)> = Vec::new();
        let threshold = (ODDS * (changes.len() * self.logs.len()) as f64).ln();
        for _ in 0..MOST_CHANGES.min(self.logs.len()) {
            let total = Sums::total(&current);
            let Some(before) = total.residuals() else { break };
            let odds = |&(i, change): &(usize, Change)| {
                let mut trial = total.clone();
                trial.add(&current[i], -1.0);
                trial.add(&self.changed(&self.logs[i], change), 1.0);
                let after = trial.residuals()?;
                Some((self.log_ratio(&before, &after), i, change))
            };
            let found: Vec<(f64, usize, Change)> = open.par_iter().filter_map(odds).collect();
            let most = found.iter().map(|one| one.0).fold(f64::NEG_INFINITY, f64::max);
            if most < threshold {
                break;
            }
            // Of logs whose changes explain the same, the shortest.
            let alike = |other: &&(f64, usize, Change)| most - other.0 < ODDS.ln();
            let length = |i: usize| self.logs[i].inputs.len();
            let Some(i) = found.iter().filter(alike).map(|one| one.1).min_by_key(|i| length(*i)) else {
                break;
            };
            let own: Vec<_> = found.iter().filter(alike).filter(|one| one.1 == i).collect();
            let best = own.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map(|one| one.2);
            current[i] =
                best.map_or_else(|| current[i].clone(), |change| self.changed(&self.logs[i], change));
            made.push((i, own.iter().map(|one| one.2).collect()));
            // What does not count at first is not tried again.
            let counts = |pair: &(usize, Change)| {
                pair.0 != i && found.iter().any(|one| (one.1, one.2) == *pair && one.0 > 0.5 * threshold)
            };
            open.retain(counts);
        }
        let Some(coefficients) = Sums::total(&current).coefficients() else { return Vec::new() };
        let note = |(i, alike): &(usize, Vec<Change>)| {
            if alike.iter().any(|change| matches!(change, Change::Gain(_, gain) if [0.5, 2.0].contains(gain)))
            {
                return None;
            }
            let mut others = Sums::total(&current);
            others.add(&current[*i], -1.0);
            let [logged, after, elsewhere] =
                [&logged[*i], &current[*i], &others].map(|sums| sums.explained(&coefficients));
            let gain = |o: &usize| after[*o] - logged[*o].max(0.0);
            let o = (0..after.len())
                .filter(|o| elsewhere[*o] >= LEAST && gain(o) >= SHARE * elsewhere[*o])
                .max_by(|a, b| gain(a).total_cmp(&gain(b)))?;
            let shares = [logged[o], after[o], elsewhere[o]].map(|share| 100.0 * share.max(0.0));
            Some(text(&names[*i], alike, o, shares, names.len()))
        };
        made.iter().filter_map(note).collect()
    }
}

fn text(
    (name, parts): &(&str, Vec<&Trajectory>),
    alike: &[Change],
    output: usize,
    shares: [f64; 3],
    logs: usize,
) -> Note {
    let inputs = parts[0].inputs.channels();
    let of = |change: &Change| match *change {
        Change::Gain(which, gain) => {
            let who = which.map_or_else(|| "all inputs".to_owned(), |j| format!("'{}'", inputs[j].name));
            match gain {
                -1.0 => format!("{who} with the opposite sign"),
                0.0 => format!("{who} without effect"),
                _ => format!("{who} times {gain:.3}, as in another unit"),
            }
        }
        Change::Swap(a, b) => format!("'{}' and '{}' exchanged", inputs[a].name, inputs[b].name),
    };
    // A very small gain is none.
    let is_none = |change: &&Change| matches!(change, Change::Gain(_, 0.0));
    let is_any = alike.iter().any(|change| is_none(&change));
    let words: Vec<String> = alike.iter().filter(|change| !is_any || is_none(change)).map(of).collect();
    let [logged, after, elsewhere] = shares;
    let y = &parts[0].outputs.channels()[output].name;
    let others = if logs == 2 { "the other log" } else { "the other logs" };
    let which = if logs == 2 { "one of both" } else { "this log" };
    Note::warning(format!(
        "{name}: the inputs act differently than in {others}: {}. With the coefficients of {others}, they explain {after:.0} % of the variance of the increments of {y} in this log with this change, and {logged:.0} % as logged; in {others}, they explain {elsewhere:.0} %",
        words.join(", or "),
    ))
    .with_remedy(format!(
        "if {which} is wrong, mend its columns or leave it out ({}): a model of all of them describes no vessel",
        key("exclude")
    ))
}

/// Changes that are tried in each log.
fn changes(inputs: usize) -> Vec<Change> {
    let degrees = 1f64.to_degrees();
    let gains = [-1.0, 0.0, 0.5, 2.0, degrees, 1.0 / degrees, 100.0, 0.01];
    let one = (0..inputs).flat_map(|j| gains.map(|gain| Change::Gain(Some(j), gain)));
    let all = gains.into_iter().map(|gain| Change::Gain(None, gain)).filter(|_| inputs > 1);
    let swaps = (0..inputs).flat_map(|a| (a + 1..inputs).map(move |b| Change::Swap(a, b)));
    one.chain(all).chain(swaps).collect()
}

/// Number of terms, with the constant.
fn terms(outputs: usize, inputs: usize) -> usize {
    1 + outputs + outputs * (outputs + 1) / 2 + outputs + inputs * (outputs + 2)
}

/// Terms about zero; the first one is that of the constant, which is zero.
fn features(y: &[f64], u: &[f64], into: &mut Vec<f64>) {
    into.clear();
    into.push(0.0);
    into.extend(y);
    for (a, y_a) in y.iter().enumerate() {
        into.extend(y[a..].iter().map(|y_b| y_a * y_b));
        into.push(y_a * y_a.abs());
    }
    for u in u {
        into.push(*u);
        into.extend(y.iter().map(|y| u * y));
        into.push(u * u.abs());
    }
}

/// Divides a quantity of all logs by its root mean square, which is returned.
fn normalize(logs: &mut [Windows], of: impl Fn(&mut Windows) -> &mut Vec<Vec<f64>>) -> Vec<f64> {
    let (mut squares, mut count) = (Vec::new(), 0usize);
    for row in logs.iter_mut().flat_map(|windows| of(windows).iter()) {
        squares.resize(row.len(), 0.0);
        squares.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * x);
        count += 1;
    }
    let root = |sum: &f64| {
        let root = (sum / count as f64).sqrt();
        if root > 0.0 { root } else { 1.0 }
    };
    let scale: Vec<f64> = squares.iter().map(root).collect();
    for row in logs.iter_mut().flat_map(|windows| of(windows).iter_mut()) {
        row.iter_mut().zip(&scale).for_each(|(x, s)| *x /= s);
    }
    scale
}

impl Windows {
    /// Windows without missing values.
    fn new(parts: &[&Trajectory], neutral: &[f64], h: usize, stride: usize) -> Self {
        let mut all = Self { outputs: Vec::new(), inputs: Vec::new(), increments: Vec::new() };
        for run in parts {
            for k in (0..run.len().saturating_sub(h)).step_by(stride) {
                let (y, end) = (run.outputs.row(k), run.outputs.row(k + h));
                if !y.iter().chain(end).all(|x| x.is_finite()) {
                    continue;
                }
                let mean = |(j, neutral): (usize, &f64)| {
                    (k..k + h).map(|i| run.inputs.row(i)[j]).sum::<f64>() / h as f64 - neutral
                };
                all.outputs.push(y.to_vec());
                all.inputs.push(neutral.iter().enumerate().map(mean).collect());
                all.increments.push(end.iter().zip(y).map(|(end, y)| end - y).collect());
            }
        }
        all
    }

    /// Moments of the terms with changed inputs.
    fn sums(&self, change: impl Fn(&[f64]) -> Vec<f64>) -> Sums {
        let outputs = self.outputs.first().map_or(0, Vec::len);
        let count = self.inputs.len() as f64;
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(self.inputs.len());
        for (y, u) in self.outputs.iter().zip(&self.inputs) {
            let mut row = Vec::new();
            features(y, &change(u), &mut row);
            rows.push(row);
        }
        let width = rows.first().map_or(0, Vec::len);
        let mean_of = |rows: &[Vec<f64>], width: usize| {
            let sum = |j: usize| rows.iter().map(|row| row[j]).sum::<f64>() / count;
            (0..width).map(sum).collect::<Vec<f64>>()
        };
        let (mean, level) = (mean_of(&rows, width), mean_of(&self.increments, outputs));
        let mut sums = Sums::zero(width, outputs);
        for (row, increment) in rows.iter_mut().zip(&self.increments) {
            row.iter_mut().zip(&mean).for_each(|(x, m)| *x -= m);
            for (i, x) in row.iter().enumerate() {
                for (into, z) in sums.moments.gram[i * width..].iter_mut().zip(row.iter()) {
                    *into += x * z;
                }
            }
            for (o, (x, m)) in increment.iter().zip(&level).enumerate() {
                let d = x - m;
                sums.squares[o] += d * d;
                for (into, z) in sums.moments.right[o * width..].iter_mut().zip(row.iter()) {
                    *into += d * z;
                }
            }
        }
        if let Some(first) = sums.moments.gram.first_mut() {
            *first = count;
        }
        sums
    }
}

impl Sums {
    fn zero(terms: usize, outputs: usize) -> Self {
        Self { moments: Moments::zero(terms, outputs), squares: vec![0.0; outputs] }
    }

    fn total(all: &[Self]) -> Self {
        let largest = all.iter().max_by_key(|sums| sums.squares.len());
        let mut total = largest.map_or_else(
            || Self::zero(0, 0),
            |sums| {
                let outputs = sums.squares.len();
                Self::zero(sums.moments.right.len() / outputs.max(1), outputs)
            },
        );
        for sums in all {
            total.add(sums, 1.0);
        }
        total
    }

    fn add(&mut self, other: &Self, factor: f64) {
        let add = |into: &mut [f64], from: &[f64]| {
            into.iter_mut().zip(from).for_each(|(a, b)| *a += factor * b);
        };
        add(&mut self.moments.gram, &other.moments.gram);
        add(&mut self.moments.right, &other.moments.right);
        add(&mut self.squares, &other.squares);
    }

    fn terms(&self) -> usize {
        self.moments.right.len() / self.squares.len().max(1)
    }

    fn coefficients(&self) -> Option<Vec<f64>> {
        (self.terms() > 0).then(|| solve(&self.moments, self.terms(), RIDGE))?.map(|fit| fit.coefficients)
    }

    fn residuals(&self) -> Option<Vec<f64>> {
        self.coefficients().map(|coefficients| self.residuals_of(&coefficients))
    }

    /// Sums of squared residuals.
    fn residuals_of(&self, coefficients: &[f64]) -> Vec<f64> {
        let n = self.terms();
        let of = |(o, square): (usize, &f64)| {
            let c = &coefficients[o * n..(o + 1) * n];
            let right: f64 = c.iter().zip(&self.moments.right[o * n..]).map(|(c, r)| c * r).sum();
            let both =
                |i: usize| -> f64 { c.iter().zip(&self.moments.gram[i * n..]).map(|(c, g)| c * g).sum() };
            square - 2.0 * right + (0..n).map(|i| c[i] * both(i)).sum::<f64>()
        };
        self.squares.iter().enumerate().map(of).collect()
    }

    /// Share of the variance of each output that the coefficients explain.
    fn explained(&self, coefficients: &[f64]) -> Vec<f64> {
        let residuals = self.residuals_of(coefficients);
        residuals.iter().zip(&self.squares).map(|(r, s)| if *s > 0.0 { 1.0 - r / s } else { 0.0 }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{self, Table};

    type Change = fn(&mut [f64], &mut [f64]);

    /// Four logs of a boat with two thrusters and noise, with a change of the third one: of the inputs as logged, and of the thrust.
    fn logs(change: impl Fn(&mut [f64], &mut [f64])) -> Vec<Trajectory> {
        let mut state = 1u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let mut log = |i: usize| {
            let (mut y, mut n) = ([0.0f64; 2], [0.0f64; 2]);
            let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
            for k in 0..1500 {
                if k % 40 == 0 {
                    n = [random() * 2.0 + 0.3, random() * 2.0 + 0.3];
                }
                outputs.extend(y.map(|y| y + 0.01 * random()));
                let (mut logged, mut thrust) = (n.to_vec(), n.map(|n| n * n.abs()));
                if i == 2 {
                    change(&mut logged, &mut thrust);
                }
                inputs.extend(logged);
                y[0] += 0.1 * (0.5 * (thrust[0] + thrust[1]) - 0.4 * y[0] * y[0].abs());
                y[1] += 0.1 * (0.6 * (thrust[0] - thrust[1]) - 0.8 * y[1]);
            }
            let channels = |names: [&str; 2]| names.map(|name| Channel::new(name, "")).to_vec();
            Trajectory {
                name: format!("day{i}.csv (0.0 s to 150.0 s)"),
                t0: 0.0,
                dt: 0.1,
                outputs: Table::new(channels(["u", "r"]), outputs),
                inputs: Table::new(channels(["port", "starboard"]), inputs),
                truth: None,
                heading: None,
                position: None,
            }
        };
        (0..4).map(&mut log).collect()
    }

    fn messages(change: impl Fn(&mut [f64], &mut [f64]), from: usize) -> Vec<String> {
        let logs = logs(change);
        let runs: Vec<&Trajectory> = logs[from..].iter().collect();
        warnings(&runs, &Boat::default(), 100).into_iter().map(|note| note.message).collect()
    }

    #[test]
    fn a_log_whose_inputs_act_differently_is_named_with_the_change() {
        assert_eq!(messages(|_, _| (), 0), Vec::<String>::new());
        let cases: [(Change, &str); 5] = [
            (|n, _| n[1] = -n[1], "'starboard' with the opposite sign"),
            (|n, _| n.swap(0, 1), "'port' and 'starboard' exchanged"),
            (|n, _| n.iter_mut().for_each(|n| *n = -*n), "all inputs with the opposite sign"),
            (|n, _| n[0] *= 100.0, "'port' times 0.010, as in another unit"),
            (|_, thrust| thrust[0] = 0.0, "'port' without effect"),
        ];
        for (change, expected) in cases {
            let all = messages(change, 0);
            assert_eq!(all.len(), 1, "{expected}: {all:?}");
            assert!(all[0].starts_with("day2.csv: ") && all[0].contains(expected), "{all:?}");
        }
    }

    #[test]
    fn of_two_logs_one_is_named_and_one_log_is_none() {
        let all = messages(|n, _| n[0] = -n[0], 2);
        assert!(
            all.len() == 1 && all[0].contains("than in the other log: 'port' with the opposite sign"),
            "{all:?}"
        );
        assert_eq!(messages(|n, _| n[0] = -n[0], 3), Vec::<String>::new());
    }

    /// The runs of a vessel in `HYDROID_DATA`, or none.
    fn data(folder: &str, outputs: &str, inputs: &str) -> Option<Vec<Trajectory>> {
        let folder = std::path::PathBuf::from(std::env::var_os("HYDROID_DATA")?).join(folder);
        let mut files: Vec<_> =
            std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.retain(|file| file.extension().is_some_and(|e| e == "csv"));
        files.sort();
        let logs: Vec<_> = files.iter().map(|file| log::read(file).unwrap()).collect();
        let selection = log::Selection::of(outputs, inputs).unwrap();
        let options = log::PrepareOptions::default();
        Some(log::prepare(&logs, &selection, &options).unwrap().runs)
    }

    /// `run` with one input times a number.
    fn with_gain(run: &Trajectory, input: usize, gain: f64) -> Trajectory {
        let of = |k: usize| {
            let mut row = run.inputs.row(k).to_vec();
            row[input] *= gain;
            row
        };
        let inputs = Table::new(run.inputs.channels().to_vec(), (0..run.len()).flat_map(of).collect());
        Trajectory { inputs, ..run.clone() }
    }

    #[test]
    fn logs_of_vessels_agree_unless_the_sign_of_one_is_changed() {
        let cases = [
            ("fleet/otter/rates", "u,v,r", "n_left,n_right", 0),
            ("fleet/tanker/rates", "u,v,r", "rpm,rudder", 1),
            ("fleet/clarke83/rates", "u,v,r", "thrust,delta", 1),
            ("fleet/transit/rates", "u,v,r", "throttle,delta_cmd", 1),
            ("fleet/zefakkel/rates", "u,v,r", "speed_order,rudder", 1),
            ("esso-osaka", "u=u_velo,v=vm_velo,r=r_angvelo", "n=n_prop,delta=delta_rudder", 1),
            (
                "cybership-enterprise1",
                "u=u_mps,v=v_mps,r=r_radps",
                "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster",
                4,
            ),
            ("usv-asw", "u=u_mps,v=v_mps,r=r_radps", "left=pwm_left_us,right=pwm_right_us", 0),
        ];
        for (folder, outputs, inputs, changed) in cases {
            let Some(runs) = data(folder, outputs, inputs) else {
                return println!("skipped: no HYDROID_DATA");
            };
            let messages = |runs: &[Trajectory]| -> Vec<String> {
                let all: Vec<&Trajectory> = runs.iter().collect();
                warnings(&all, &Boat::default(), 100).into_iter().map(|note| note.message).collect()
            };
            for count in [2, 3, runs.len()] {
                let few = &runs[..count.min(runs.len())];
                assert_eq!(messages(few), Vec::<String>::new(), "{folder}, {count}");
            }
            if folder == "usv-asw" {
                continue;
            }
            let mut runs = runs;
            // The log of most samples is taken as right.
            let at = if folder.starts_with("cybership") { 3 } else { 1 };
            runs[at] = with_gain(&runs[at], changed, -1.0);
            let all = messages(&runs);
            let named = format!("{}: ", runs[at].log());
            let said = all.iter().any(|m| m.starts_with(&named) && m.contains("with the opposite sign"));
            assert!(said && all.len() == 1, "{folder}: {all:?}");
        }
    }
}
