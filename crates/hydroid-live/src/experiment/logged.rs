//! What a log tells of the commands, what it lacks for identification, and an experiment that adds that.

use hydroid::boat::{Boat, Role};
use hydroid::log::{Channel, Trajectory};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::explored::Explored;
use super::part::Hold;
use super::response::Response;
use crate::Axis;

/// Lags at which commands and velocities are compared, as multiples of the step: up to a quarter of a run.
const LAGS: usize = 40;
/// Share of the variance of a velocity that the inputs must explain, so that their signs are known.
const EXPLAINED: f64 = 0.05;
/// Samples for a regression: more of them change little.
const ENOUGH: usize = 50_000;
/// Share of its other effect from which an input has an effect.
const LESS: f64 = 0.5;
/// Share of the time scale after which the commands of a plan may change.
const FINE: f64 = 0.1;
/// Longest plan, in times that identification needs.
const LONGEST: f64 = 4.0;
/// Part of the largest speed below which a vessel rests.
const AT_REST: f64 = 0.1;

/// What a log tells of the commands.
#[derive(Clone, Debug)]
pub struct Logged {
    /// Time in each part of each range, and changes per time scale.
    pub explored: Explored,
    /// Time scales of speed and yaw rate \[s\], if commands were held until the response had settled.
    pub time_scales_s: [Option<f64>; 2],
    /// The inputs that are commanded.
    pub inputs: Vec<Channel>,
    /// What the log lacks, one sentence each.
    pub lacks: Vec<String>,
}

impl Logged {
    /// Counts the commands of runs with the outputs `u` and `r`. Roles, neutral values and limits are those of the boat; limits that
    /// it does not have are those of the runs. The sides to which inputs push and turn are those of the regression of u and r on them.
    ///
    /// # Errors
    /// If it is not known which inputs push and turn.
    pub fn of(runs: &[Trajectory], boat: &Boat) -> Result<Self, String> {
        let first = runs.first().ok_or("there is no run")?;
        let place = |name: &str| {
            let found = first.outputs.channels().iter().position(|channel| channel.name == name);
            found.ok_or_else(|| format!("there is no output {name}"))
        };
        let (u, r) = (place("u")?, place("r")?);
        let channels = first.inputs.channels();
        let role = |i: usize| boat.role(&channels[i].name);
        let unknown: Vec<usize> = (0..channels.len()).filter(|&i| role(i).is_none()).collect();
        let effects = [u, r].map(|output| effects_of(runs, &unknown, output).unwrap_or_default());
        // An input whose role is not known does what it explains more of.
        let does = |i: usize, by_role: fn(Role) -> bool, [own, other]: [&Vec<f64>; 2]| match role(i) {
            Some(role) => by_role(role),
            None => unknown.iter().position(|of| *of == i).is_some_and(|k| {
                let [own, other] = [own, other].map(|of| of.get(k).map_or(0.0, |effect| effect.abs()));
                own > 0.0 && own >= LESS * other
            }),
        };
        let commanded: Vec<usize> =
            (0..channels.len()).filter(|&i| role(i).is_none_or(Role::is_commanded)).collect();
        let axes = commanded.iter().map(|&i| axis(runs, i, boat)).collect::<Result<Vec<_>, _>>()?;
        let weights = |does: &dyn Fn(usize) -> bool, output: usize, what: &str| {
            let own: Vec<usize> = commanded.iter().copied().filter(|&i| does(i)).collect();
            let effects = effects_of(runs, &own, output).ok_or_else(|| {
                format!("it is not known which inputs {what} the vessel, and to which side")
            })?;
            let place = |i: &usize| commanded.iter().position(|of| of == i).unwrap_or_default();
            let signs = effects.into_iter().map(f64::signum);
            Ok::<_, String>(own.iter().map(place).zip(signs).collect::<Vec<_>>())
        };
        let [of_u, of_r] = [&effects[0], &effects[1]];
        let push = weights(&|i| does(i, Role::pushes, [of_u, of_r]), u, "push")?;
        let turn = weights(&|i| does(i, Role::turns, [of_r, of_u]), r, "turn")?;
        let mut explored = Explored::new(&axes, &push, &turn)?;
        let commands = |run: &Trajectory, k: usize| -> Vec<f64> {
            commanded.iter().map(|&i| run.inputs.row(k)[i]).collect()
        };
        let speeds = || runs.iter().flat_map(|run| run.outputs.column(u)).filter(|u| u.is_finite());
        let fastest = speeds().fold(0.0, |fastest: f64, u| fastest.max(u.abs()));
        let mut response = Response::new(fastest.max(f64::MIN_POSITIVE));
        for run in runs {
            for k in 0..run.len() {
                let ([push, turn], output) =
                    (explored.allocation().demand(&commands(run, k)), run.outputs.row(k));
                if output[u].is_finite() && output[r].is_finite() {
                    response.add(run.dt, push, turn, output[u], output[r]);
                }
            }
        }
        let time_scales_s = [response.push_s(), response.turn_s()];
        // The slower one stands for the one that is not known.
        let known = || time_scales_s.iter().flatten().copied();
        if let [push_s, turn_s] = time_scales_s
            && let Some(other) = known().reduce(f64::max)
        {
            explored.set_time_scales(push_s.unwrap_or(other), turn_s.unwrap_or(other));
        }
        for run in runs {
            for k in 0..run.len() {
                explored.see(run.dt, &commands(run, k));
            }
            // A run does not go on in the next one.
            explored.see(f64::INFINITY, &[]);
        }
        let mut lacks = explored.missing();
        if known().next().is_none() {
            lacks.insert(
                0,
                "no command was held until speed and yaw rate had settled: their time scales are not known, and 3 s are assumed"
                    .to_owned(),
            );
        }
        lacks.extend(missing_headings(runs));
        if !speeds().any(|u| u.abs() < AT_REST * fastest) {
            lacks.push("the vessel never rests: start from rest, and stop".to_owned());
        }
        let inputs = commanded.iter().map(|&i| channels[i].clone()).collect();
        Ok(Self { explored, time_scales_s, inputs, lacks })
    }

    /// An experiment that adds what the log lacks of the commands: times \[s\], from which on commands are held, and the
    /// commands. Levels are drawn from the least explored parts of push and turn, and held for half to four time scales. It
    /// ends at rest.
    pub fn plan(&self, seed: u64) -> Vec<(f64, Vec<f64>)> {
        let mut explored = self.explored.clone();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let [push_s, turn_s] = explored.scales();
        let dt = FINE * push_s.min(turn_s);
        let (mut push, mut turn) = (Hold::default(), Hold::default());
        let mut rows: Vec<(f64, Vec<f64>)> = Vec::new();
        let mut step = 0_u32;
        while !explored.is_sufficient() && f64::from(step) * dt < LONGEST * explored.needed_s() {
            let t = f64::from(step) * dt;
            let (astern, most) = (explored.allocation().astern, explored.allocation().turn);
            let pushed = push.demand(dt, push_s, &mut rng, |rng| {
                explored.least_explored_push([astern, 1.0], |_| false, rng)
            });
            let turned =
                turn.demand(dt, turn_s, &mut rng, |rng| explored.least_explored_turn(most, |_| false, rng));
            let commands = explored.allocation().commands(pushed, turned);
            explored.see(dt, &commands);
            if rows.last().is_none_or(|(_, last)| *last != commands) {
                rows.push((t, commands));
            }
            step += 1;
        }
        if !rows.is_empty() {
            rows.push((f64::from(step) * dt, explored.allocation().commands(0.0, 0.0)));
        }
        rows
    }
}

/// An input with its limits and its neutral value.
fn axis(runs: &[Trajectory], input: usize, boat: &Boat) -> Result<Axis, String> {
    let values = runs.iter().flat_map(|run| run.inputs.column(input)).filter(|x| x.is_finite());
    let seen = values.fold(None, |seen: Option<[f64; 2]>, x| {
        let [low, high] = seen.unwrap_or([x, x]);
        Some([low.min(x), high.max(x)])
    });
    let channel = &runs[0].inputs.channels()[input];
    let value = boat.value(channel, seen).map_err(|error| error.to_string())?;
    Ok(Axis::new(channel.name.clone(), value.limits, value.neutral))
}

/// Effects of inputs on an output: the coefficients of its regression on them, times their deviations, over its own, at the lag that
/// explains most of it; none if it explains too little.
fn effects_of(runs: &[Trajectory], inputs: &[usize], output: usize) -> Option<Vec<f64>> {
    let shortest = runs.iter().map(Trajectory::len).max().unwrap_or(0) / 4;
    let stride = (runs.iter().map(Trajectory::len).sum::<usize>() / ENOUGH).max(1);
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut lag = 0;
    while !inputs.is_empty() && lag <= shortest {
        let n = inputs.len() + 1;
        let mut normal = vec![vec![0.0; n + 1]; n];
        let (mut count, mut sum, mut square) = (0.0, 0.0, 0.0);
        for run in runs {
            for k in (lag..run.len()).step_by(stride) {
                let (row, y) = (run.inputs.row(k - lag), run.outputs.row(k)[output]);
                let x: Vec<f64> = inputs.iter().map(|&i| row[i]).chain([1.0, y]).collect();
                if x.iter().all(|x| x.is_finite()) {
                    (count, sum, square) = (count + 1.0, sum + y, square + y * y);
                    for i in 0..n {
                        for j in 0..=n {
                            normal[i][j] += x[i] * x[j];
                        }
                    }
                }
            }
        }
        let variance = square - sum * sum / count;
        let right: Vec<f64> = normal.iter().map(|row| row[n]).collect();
        let moments = normal.clone();
        if let Some(solution) = solved(normal) {
            let explained = solution.iter().zip(&right).map(|(a, b)| a * b).sum::<f64>() - sum * sum / count;
            let share = explained / variance;
            if share > best.as_ref().map_or(EXPLAINED, |(share, _)| *share) {
                let deviation = |i: usize, mean: f64, square: f64| {
                    solution[i] * ((square - mean * mean / count) / variance).max(0.0).sqrt()
                };
                let effect = |i: usize| deviation(i, moments[i][n - 1], moments[i][i]);
                best = Some((share, (0..n - 1).map(effect).collect()));
            }
        }
        lag += (shortest / LAGS).max(1);
    }
    best.map(|(_, effects)| effects)
}

/// The solution of linear equations, each with its right side at the end; none of singular ones.
fn solved(mut rows: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let n = rows.len();
    let scale: Vec<f64> = (0..n).map(|i| rows[i][i].abs()).collect();
    for i in 0..n {
        let pivot = rows[i].clone();
        if pivot[i].is_nan() || pivot[i] <= 1e-9 * scale[i] {
            return None;
        }
        for row in rows.iter_mut().skip(i + 1) {
            let factor = row[i] / pivot[i];
            row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
        }
    }
    let mut solution = vec![0.0; n];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| rows[i][j] * solution[j]).sum();
        solution[i] = (rows[i][n] - known) / rows[i][i];
    }
    Some(solution)
}

/// What is missing of the headings: a current, and a compass that is not aligned, look like sway on courses to one side.
fn missing_headings(runs: &[Trajectory]) -> Option<String> {
    let turn = std::f64::consts::TAU;
    let all: Option<Vec<&Vec<f64>>> = runs.iter().map(|run| run.heading.as_ref()).collect();
    let mut headings: Vec<f64> =
        all?.into_iter().flatten().filter(|psi| psi.is_finite()).map(|psi| psi.rem_euclid(turn)).collect();
    headings.sort_by(f64::total_cmp);
    let next = headings.iter().skip(1).copied().chain(headings.first().map(|psi| psi + turn));
    let largest = headings.iter().zip(next).map(|(a, b)| b - a).fold(0.0, f64::max);
    (largest > 0.5 * turn).then(|| {
        format!(
            "all headings lie within {:.0} deg: only opposite courses distinguish a current and a misalignment of the compass from sway",
            (turn - largest).to_degrees()
        )
    })
}
