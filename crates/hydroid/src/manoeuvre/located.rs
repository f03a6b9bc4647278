//! Positions in a log as the path of a measured trial.
//!
//! The path by velocities and heading is `p_k`; the positions, turned into its frame, are `p_k + d_k` with white noise. The error
//! `d_k` of the velocities is a random walk whose rate is a random walk as well. Its spectral density and the variance of the noise
//! have the largest likelihood (concentrated form: de Jong 1988), and the errors of figures are those over draws of `d_k` given the
//! positions (Durbin and Koopman 2002).

use std::f64::consts::{FRAC_PI_2, TAU};

use hydroid_core::current::in_body;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::measured::{line, output};
use super::track::Track;
use super::walk::{Complex, Walk, middle};
use crate::log::Trajectory;
use crate::model::MOTION;

/// Positions that a measured trial was taken from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Located {
    /// Number of positions.
    pub fixes: usize,
    /// Outliers that were left out.
    pub outliers: usize,
    /// Standard deviation of the noise of a position \[m\], per axis.
    pub deviation_m: f64,
    /// Whether the first axis is east, and the second one north.
    pub east_first: bool,
    /// Angle from north to their axis of north, clockwise, where the motion shows one \[deg\].
    pub turned_deg: f64,
    /// Course of the approach by the positions relative to the heading \[deg\], positive to starboard, if the path is turned by it.
    pub aside_deg: Option<f64>,
    /// Way by the positions relative to that by the velocities.
    pub rate: f64,
    /// Time by which they seem to be later than the velocities \[s\].
    pub late_s: Option<f64>,
    /// Mean velocity of the positions less that of the velocities, north and east \[m/s\].
    pub drift: [f64; 2],
}

/// Least part of the motion of the positions that the velocities explain.
const EXPLAINED: f64 = 0.8;

/// Least number of parts of a run whose motions are compared.
const LEAST_PARTS: usize = 8;

/// Standard errors of an angle that may be chance, and least angle between two frames \[rad\]: a smaller one is an error of the
/// heading or of the sway velocity.
const CERTAIN: f64 = 3.0;
const TURNED: f64 = 0.17;

/// Largest standard deviation of a course that counts \[rad\].
const KNOWN: f64 = 0.017;

/// Positions on either side of one that is compared with their median, and deviations of an outlier (Hampel 1974).
const BESIDE: usize = 3;
const OUTLIER: f64 = 6.0;

/// Number of draws from the distribution of a path.
const DRAWS: usize = 100;

/// Errors of positions relative to those of an integral of the noise of the velocities, below which they have the same noise.
const INTEGRAL: f64 = 0.2;

/// `a` times the conjugate of `b`.
fn times_conjugate(a: Complex, b: Complex) -> Complex {
    [a[0] * b[0] + a[1] * b[1], a[1] * b[0] - a[0] * b[1]]
}

/// The frame of the positions of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    exchanged: bool,
    /// Angle from the frame of the heading to the first axis \[rad\].
    turned: f64,
    rate: f64,
}

impl Frame {
    /// The frame in which the positions move with the velocities of a track, which has the same samples. The axes are north and
    /// east, or east and north, unless the motion shows another angle with certainty: a constant drift is no angle.
    fn of(track: &Track, positions: &[[f64; 2]]) -> Result<Self, String> {
        let known = new_fixes(positions);
        let lengths = (0..usize::BITS).map(|k| 1_usize << k);
        let lengths = lengths.take_while(|length| length * LEAST_PARTS < known.len());
        let fits = lengths.flat_map(|length| {
            let at: Vec<usize> = known.iter().copied().step_by(length).collect();
            [false, true].map(|exchanged| Fit::of(track, positions, &at, exchanged))
        });
        let mut best: Option<Fit> = None;
        for fit in fits.flatten() {
            if best.as_ref().is_none_or(|best| fit.explained > best.explained) {
                best = Some(fit);
            }
        }
        let fit = best.ok_or("there are too few of them")?;
        // Ratios beyond those of noise are those of another unit.
        if !(0.1..=10.0).contains(&fit.ratio) {
            return Err(faster(fit.ratio));
        }
        if fit.explained < EXPLAINED {
            return Err(format!(
                "the velocities explain {:.0} % of their motion",
                100.0 * fit.explained.max(0.0)
            ));
        }
        if !(0.5..=2.0).contains(&fit.frame.rate) {
            return Err(faster(fit.frame.rate));
        }
        Ok(fit.frame)
    }

    /// A position in the frame of the heading.
    fn turn_back(self, position: [f64; 2]) -> [f64; 2] {
        let [x, y] = if self.exchanged { [position[1], position[0]] } else { position };
        in_body([x, y], self.turned)
    }
}

fn faster(rate: f64) -> String {
    format!("they move {rate:.3} times as fast as the velocities say")
}

struct Fit {
    frame: Frame,
    explained: f64,
    /// Median of the ratios of the ways.
    ratio: f64,
}

impl Fit {
    /// Regression of the ways by positions, from sample to sample, on the ways by velocities, with a constant drift.
    fn of(track: &Track, positions: &[[f64; 2]], at: &[usize], exchanged: bool) -> Option<Self> {
        let way = |from: [f64; 2], to: [f64; 2]| [to[0] - from[0], to[1] - from[1]];
        let mut parts: Vec<(Complex, Complex)> = at
            .windows(2)
            .map(|pair| {
                let [a, b] = [pair[0], pair[1]].map(|k| [track.eta[k][0], track.eta[k][1]]);
                let [x, y] = way(positions[pair[0]], positions[pair[1]]);
                (way(a, b), if exchanged { [y, x] } else { [x, y] })
            })
            .collect();
        let ratio = middle(parts.iter().map(|(d, f)| f[0].hypot(f[1]) / d[0].hypot(d[1])));
        // The way of another datum, or of an outlier, is none of the vessel.
        let apart = |(d, f): &(Complex, Complex)| (f[0].hypot(f[1]) - d[0].hypot(d[1])).abs();
        let usual = 1.4826 * middle(parts.iter().map(apart));
        parts.retain(|part| apart(part) <= part.0[0].hypot(part.0[1]) + OUTLIER * usual);
        let count = parts.len() as f64;
        if parts.len() < LEAST_PARTS {
            return None;
        }
        let sum = |of: &dyn Fn(&(Complex, Complex)) -> f64| parts.iter().map(of).sum::<f64>();
        let [dx, dy] = [0, 1].map(|i| sum(&|part| part.0[i]) / count);
        let [fx, fy] = [0, 1].map(|i| sum(&|part| part.1[i]) / count);
        let centred =
            |part: &(Complex, Complex)| ([part.0[0] - dx, part.0[1] - dy], [part.1[0] - fx, part.1[1] - fy]);
        let squares = sum(&|part| {
            let (d, _) = centred(part);
            d[0] * d[0] + d[1] * d[1]
        });
        let product = [0, 1].map(|i| {
            sum(&|part| {
                let (d, f) = centred(part);
                times_conjugate(f, d)[i]
            })
        });
        let total = sum(&|part| part.1[0] * part.1[0] + part.1[1] * part.1[1]);
        let least = f64::EPSILON * total;
        // Residuals with a factor that is complex, and with one that only stretches.
        let residual = |factor: Complex| {
            sum(&|part| {
                let (d, f) = centred(part);
                let e =
                    [f[0] - factor[0] * d[0] + factor[1] * d[1], f[1] - factor[0] * d[1] - factor[1] * d[0]];
                e[0] * e[0] + e[1] * e[1]
            })
        };
        let free = [product[0] / squares.max(least), product[1] / squares.max(least)];
        let angle = free[1].atan2(free[0]);
        let deviation = (residual(free) / (2.0 * count - 4.0) / squares.max(least)).sqrt();
        let is_certain = angle.abs() > TURNED
            && angle.abs() * free[0].hypot(free[1]) > CERTAIN * deviation
            && squares > least;
        let without_drift = || {
            let all = |i: usize| sum(&|part| times_conjugate(part.1, part.0)[i]);
            let squares = sum(&|part| part.0[0] * part.0[0] + part.0[1] * part.0[1]);
            [all(0) / squares.max(least), all(1) / squares.max(least)]
        };
        // On one course the drift and the factor are not told apart: the factor alone, and no angle.
        let (turned, rate, left) = if is_certain {
            (angle, free[0].hypot(free[1]), residual(free))
        } else {
            let factor = without_drift();
            let rate = factor[0].max(0.0);
            let left = sum(&|(d, f)| {
                let e = [f[0] - rate * d[0], f[1] - rate * d[1]];
                e[0] * e[0] + e[1] * e[1]
            });
            (0.0, rate, left)
        };
        let explained = 1.0 - left / total;
        (total > 0.0).then_some(Self { frame: Frame { exchanged, turned, rate }, explained, ratio })
    }
}

/// A measured trial by its positions: the track, what it was taken from, and draws from its distribution.
pub(super) struct Path {
    /// Whether the axes of the positions only follow from the course of the approach.
    pub(super) is_turned: bool,
    pub(super) track: Track,
    pub(super) located: Located,
    pub(super) draws: Vec<Track>,
}

/// The motion from one sample of a run to another by its positions; why they cannot be used. `None` without positions.
pub(super) fn path(run: &Trajectory, from: usize, to: usize) -> Option<Result<Path, String>> {
    let positions = run.position.as_ref()?;
    let whole = Track::measured(run, 0, run.len() - 1)?;
    let frame = if run.heading.is_some() {
        Frame::of(&whole, positions)
    } else {
        // The heading by the yaw rate drifts over the run.
        let own = Track::measured(run, from, to)?;
        Frame::of(&own, &positions[from..=to])
    };
    // Without the sway velocity, the drift in turns is no angle of the axes.
    let has_sway = output(run, MOTION[1]).is_some();
    Some(frame.and_then(|frame| {
        let is_turned = !has_sway && frame.turned != 0.0;
        let turned = if is_turned { 0.0 } else { frame.turned };
        let path = by_positions(run, positions, Frame { turned, ..frame }, from, to)?;
        Ok(Path { is_turned, ..path })
    }))
}

fn by_positions(
    run: &Trajectory,
    positions: &[[f64; 2]],
    frame: Frame,
    from: usize,
    to: usize,
) -> Result<Path, String> {
    // The approach and what follows also show the errors of the velocities.
    let beside = (to - from) / 2;
    let (first, last) = (from.saturating_sub(beside), (to + beside).min(run.len() - 1));
    let track = Track::measured(run, first, last).ok_or("there is no motion")?;
    let mut errors: Vec<Option<[f64; 2]>> = vec![None; track.len()];
    for k in new_fixes(positions).into_iter().filter(|k| (first..=last).contains(k)) {
        let ([x, y], eta) = (frame.turn_back(positions[k]), track.eta[k - first]);
        errors[k - first] = Some([x - eta[0], y - eta[1]]);
    }
    let outliers = leave_outliers(&mut errors, &track);
    check_jumps(&track, &errors)?;
    let fixes = errors.iter().flatten().count();
    if fixes < LEAST_PARTS {
        return Err("there are too few of them".to_owned());
    }
    if are_integral(&track, &errors) {
        return Err("they are the integral of the velocities".to_owned());
    }
    let walk = Walk::most_likely(&errors);
    let means = walk.smoothed(&errors);
    let is_finite = |means: &[Complex; 2]| means.iter().flatten().all(|x| x.is_finite());
    if !means.iter().all(is_finite) {
        return Err("they are too far apart in time".to_owned());
    }
    let moved = |means: &[[Complex; 2]]| {
        let mut moved = track.clone();
        let dt = track.dt;
        for ((eta, nu), [error, rate]) in moved.eta.iter_mut().zip(&mut moved.nu).zip(means) {
            let [surge, sway] = in_body(rate.map(|rate| rate / dt), eta[2]);
            (nu[0], nu[1]) = (nu[0] + surge, nu[1] + sway);
            (eta[0], eta[1]) = (eta[0] + error[0], eta[1] + error[1]);
        }
        moved.keep(from - first, to - first);
        moved
    };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let heading = HeadingNoise::of(run, &track, first);
    let draws = (0..DRAWS).map(|_| {
        let drawn = walk.draw(&errors, &mut rng);
        let turns = heading.draw(track.len(), &mut rng);
        let all: Vec<[Complex; 2]> = means
            .iter()
            .zip(&drawn)
            .map(|(mean, drawn)| {
                [0, 1].map(|state| [0, 1].map(|axis| mean[state][axis] + drawn[state][axis]))
            })
            .collect();
        let mut draw = moved(&all);
        draw.eta.iter_mut().zip(&turns[from - first..]).for_each(|(eta, turn)| eta[2] += turn);
        draw
    });
    let draws = draws.collect();
    let located = Located {
        fixes,
        outliers,
        deviation_m: walk.deviation,
        east_first: frame.exchanged,
        turned_deg: if run.heading.is_some() { -frame.turned.to_degrees() } else { 0.0 },
        aside_deg: None,
        rate: frame.rate,
        late_s: late_s(&track, &errors, walk.deviation),
        drift: {
            let duration = (to - from).max(1) as f64 * track.dt;
            [0, 1].map(|axis| (means[to - first][0][axis] - means[from - first][0][axis]) / duration)
        },
    };
    Ok(Path { is_turned: false, track: moved(&means), located, draws })
}

/// Samples with a position that is not that of an earlier one, repeated.
fn new_fixes(positions: &[[f64; 2]]) -> Vec<usize> {
    let mut before = [f64::NAN; 2];
    let is_new = |(_, position): &(usize, &[f64; 2])| {
        let is_new = **position != before && position.iter().all(|x| x.is_finite());
        if is_new {
            before = **position;
        }
        is_new
    };
    positions.iter().enumerate().filter(is_new).map(|(k, _)| k).collect()
}

/// Turns a path, and draws from its distribution, so that the course of the approach through the water is the heading: advance and
/// transfer are along and across the original course, and an error of the heading is not in them.
/// An angle that may be chance, or is not known within a degree, is none, as is that of a vessel that goes astern; where the axes only
/// follow from it, a large one is theirs. Whether the path was turned.
pub(super) fn align(path: &mut Path, order: usize, current: [f64; 2]) -> bool {
    let Path { is_turned, track, located, draws } = path;
    if order < 2 {
        return false;
    }
    let are_axes = |angle: f64| *is_turned && angle.abs() > TURNED;
    let aside = |track: &Track| {
        let way =
            [0, 1].map(|i| track.eta[order][i] - track.eta[0][i] - current[i] * order as f64 * track.dt);
        let mean = track.eta[..=order].iter().map(|eta| eta[2]).sum::<f64>() / (order + 1) as f64;
        let [ahead, across] = in_body(way, mean);
        across.atan2(ahead)
    };
    let own = aside(track);
    let near = |angle: f64| angle - TAU * (angle / TAU).round();
    let squares: f64 = draws.iter().map(|draw| near(aside(draw) - own).powi(2)).sum();
    let deviation = (squares / draws.len() as f64).sqrt();
    let is_astern = own.abs() > FRAC_PI_2 && !are_axes(own);
    if !(deviation < KNOWN && own.abs() > CERTAIN * deviation) || is_astern {
        return false;
    }
    for track in draws.iter_mut().chain([track]) {
        let angle = aside(track);
        for eta in &mut track.eta {
            [eta[0], eta[1]] = in_body([eta[0], eta[1]], angle);
        }
        for nu in track.nu.iter_mut().filter(|_| are_axes(own)) {
            [nu[0], nu[1]] = in_body([nu[0], nu[1]], angle);
        }
    }
    if are_axes(own) {
        located.turned_deg = -own.to_degrees();
    } else {
        located.aside_deg = Some(own.to_degrees());
    }
    true
}

/// Whether positions have the noise of the velocities: their errors do not grow as the integral of this noise does.
fn are_integral(track: &Track, errors: &[Option<[f64; 2]>]) -> bool {
    let second = track.nu.windows(3).map(|nu| (nu[2][0] - 2.0 * nu[1][0] + nu[0][0]).abs());
    let noise = 1.4826 * middle(second) / 6.0_f64.sqrt() * track.dt;
    let known: Vec<(usize, [f64; 2])> =
        errors.iter().enumerate().filter_map(|(k, error)| Some((k, (*error)?))).collect();
    let apart = known.len() / 8;
    let growth = known.iter().zip(&known[apart..]).map(|((k, before), (later, after))| {
        let growth = (after[0] - before[0]).abs().max((after[1] - before[1]).abs());
        growth / ((later - k).max(1) as f64).sqrt()
    });
    apart > 0 && 1.4826 * middle(growth) < INTEGRAL * noise
}

/// By how much positions are late \[s\]: regression of their errors on the velocity over ground, beside a part of the path, which is a
/// scale of the velocities. `None` if that does not explain most of the errors, or the delay is within their noise.
fn late_s(track: &Track, errors: &[Option<[f64; 2]>], deviation: f64) -> Option<f64> {
    // Velocity, place and error.
    let mut known: Vec<[Complex; 3]> = errors
        .iter()
        .enumerate()
        .filter_map(|(k, error)| {
            let ([u, v, _], [x, y, psi]) = (track.nu[k], track.eta[k]);
            let (sin, cos) = psi.sin_cos();
            Some([[u * cos - v * sin, u * sin + v * cos], [x, y], (*error)?])
        })
        .collect();
    let count = known.len() as f64;
    let sums = known.iter().fold([[0.0; 2]; 3], |sums, row| {
        [0, 1, 2].map(|of| [0, 1].map(|axis| sums[of][axis] + row[of][axis] / count))
    });
    for row in &mut known {
        *row = [0, 1, 2].map(|of| [0, 1].map(|axis| row[of][axis] - sums[of][axis]));
    }
    let product = |a: usize, b: usize| {
        known.iter().map(|row| row[a][0] * row[b][0] + row[a][1] * row[b][1]).sum::<f64>()
    };
    let [vv, vp, pp, ve, pe, ee] =
        [product(0, 0), product(0, 1), product(1, 1), product(0, 2), product(1, 2), product(2, 2)];
    let determinant = vv * pp - vp * vp;
    let [late, scale] = [(ve * pp - pe * vp) / determinant, (pe * vv - ve * vp) / determinant];
    let left = ee - late * ve - scale * pe;
    let without = ee - pe * pe / pp;
    let is_most = left < 0.2 * ee && left < 0.5 * without;
    let is_beyond = late.abs() * (vv / count).sqrt() > deviation && late.abs() > track.dt;
    (is_most && is_beyond).then_some(-late)
}

/// Leaves out errors far from the median of their neighbours, and counts them.
fn leave_outliers(errors: &mut [Option<[f64; 2]>], track: &Track) -> usize {
    let known: Vec<(usize, [f64; 2])> =
        errors.iter().enumerate().filter_map(|(k, error)| Some((k, (*error)?))).collect();
    let apart: Vec<[f64; 2]> = (0..known.len())
        .map(|i| {
            let near = &known[i.saturating_sub(BESIDE)..(i + BESIDE + 1).min(known.len())];
            [0, 1].map(|axis| known[i].1[axis] - middle(near.iter().map(|(_, error)| error[axis])))
        })
        .collect();
    let usual = [0, 1].map(|axis| 1.4826 * middle(apart.iter().map(|apart| apart[axis].abs())));
    // Velocities may be wrong by half of the speed, as without sway.
    let way = middle((0..track.len()).map(|k| track.speed(k))) * track.dt;
    let steps = middle(known.windows(2).map(|pair| (pair[1].0 - pair[0].0) as f64));
    let slope = 0.5 * way * steps * BESIDE as f64;
    let mut count = 0;
    for ((k, _), apart) in known.iter().zip(&apart) {
        if (0..2).any(|axis| apart[axis].abs() > OUTLIER * usual[axis] + slope) {
            errors[*k] = None;
            count += 1;
        }
    }
    count
}

/// An error that changes by more than the way in the same time, and by more than its noise, is that of another datum.
fn check_jumps(track: &Track, errors: &[Option<[f64; 2]>]) -> Result<(), String> {
    let known: Vec<(usize, [f64; 2])> =
        errors.iter().enumerate().filter_map(|(k, error)| Some((k, (*error)?))).collect();
    let steps: Vec<f64> = known
        .windows(2)
        .map(|pair| (pair[1].1[0] - pair[0].1[0]).hypot(pair[1].1[1] - pair[0].1[1]))
        .collect();
    let usual = 1.4826 * middle(steps.iter().copied());
    for (pair, step) in known.windows(2).zip(&steps) {
        let (a, b) = (pair[0].0, pair[1].0);
        let way: f64 = (a..b).map(|k| track.speed(k).max(track.speed(k + 1)) * track.dt).sum();
        if *step > way + OUTLIER * usual {
            return Err(format!("they jump by {step:.1} m in the log"));
        }
    }
    Ok(())
}

/// Noise of the yaw rate in a step, and of the measured heading \[rad\].
struct HeadingNoise {
    rate: f64,
    heading: Option<f64>,
}

impl HeadingNoise {
    fn of(run: &Trajectory, track: &Track, first: usize) -> Self {
        // Second differences of white noise have six times its variance.
        let second = track.nu.windows(3).map(|nu| (nu[2][2] - 2.0 * nu[1][2] + nu[0][2]).abs());
        let rate = 1.4826 * middle(second) / 6.0_f64.sqrt() * track.dt;
        let apart = |(eta, measured): (&[f64; 3], &f64)| {
            let apart = measured - eta[2];
            (apart - TAU * (apart / TAU).round()).abs()
        };
        let of = |measured: &Vec<f64>| {
            let apart = track.eta.iter().zip(&measured[first..]).map(apart);
            1.4826 * middle(apart.filter(|apart| apart.is_finite()))
        };
        Self { rate, heading: run.heading.as_ref().map(of) }
    }

    /// A draw of the error of the heading: that of the integral, less its straight line to the measured heading.
    fn draw(&self, samples: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut error = 0.0;
        let mut errors: Vec<f64> = (0..samples)
            .map(|_| {
                error += self.rate * normal();
                error
            })
            .collect();
        if let Some(noise) = self.heading {
            let [start, slope] = line(
                errors
                    .iter()
                    .enumerate()
                    .map(|(k, error)| (k as f64, noise * normal() - error))
                    .collect::<Vec<_>>()
                    .into_iter(),
            );
            errors.iter_mut().enumerate().for_each(|(k, error)| *error += start + slope * k as f64);
        }
        errors
    }
}
