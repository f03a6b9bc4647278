//! Mean velocities over windows: of the pose, and of the channels along the heading.
//!
//! With the position $z = x + i y$ and the heading $\psi$, the path over a window satisfies, also while the vessel
//! turns, $\Delta z = \int (u + i v) e^{i\psi}\,dt + l\,\Delta e^{i\psi}$ with the lever arm $l$ of the position sensor.
//! All terms are divided by the duration and rotated by the heading in the middle of the window.

use std::borrow::Cow;

use super::super::super::columns::Columns;

/// Number of windows of the longest length; each further length is half of the one before.
const FEWEST: usize = 20;
/// Number of lengths.
const LENGTHS: i32 = 6;
/// A window is left out if one of its rates is this many times larger than nine tenths of all: a spike.
const SPIKE: f64 = 5.0;

/// A vector in the body frame: forward and lateral, to the side of increasing heading.
pub(super) type Body = [f64; 2];

/// Means over one window.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// Change of the heading \[rad/s\].
    pub(super) turn: f64,
    /// Velocity of the path \[m/s\], with the axes as in the log and exchanged.
    pub(super) path: [Body; 2],
    /// Rate of $e^{i\psi}$ \[1/s\].
    pub(super) lever: Body,
    /// Each channel.
    pub(super) mean: Vec<f64>,
    /// Each channel as a forward velocity in the frame of the window.
    pub(super) forward: Vec<Body>,
}

/// Windows of several lengths, the longest first. The columns are the channels, the heading and, if `position`, x and
/// y. Values missing for at most `limit` seconds are interpolated.
pub(super) fn windows(
    columns: &Columns<'_>,
    channels: usize,
    position: bool,
    limit: f64,
) -> Vec<Vec<Window>> {
    let t = &columns.t[..];
    let mut series: Vec<Cow<[f64]>> =
        columns.outputs.iter().map(|values| Cow::Borrowed(&values[..])).collect();
    unwrap(&mut series[channels]);
    for values in &mut series {
        interpolate(t, values, limit);
    }
    let series: Vec<&[f64]> = series.iter().map(|values| &values[..]).collect();
    let pose = Series {
        t,
        channels: &series[..channels],
        heading: series[channels],
        position: position.then(|| [series[channels + 1], series[channels + 2]]),
        segments: segments(t, &series, limit),
    };
    let covered = pose.segments.iter().map(|(from, to)| t[*to] - t[*from]).sum::<f64>();
    let lengths: Vec<f64> =
        (0..LENGTHS).map(|halvings| covered / FEWEST as f64 * 0.5_f64.powi(halvings)).collect();
    pose.windows(&lengths)
        .into_iter()
        .map(without_spikes)
        // The ends of segments leave some windows out.
        .filter(|found| 2 * found.len() >= FEWEST)
        .collect()
}

/// Removes the jumps of a wrapped angle.
fn unwrap(angle: &mut Cow<[f64]>) {
    let turns = |x: f64, last: f64| ((x - last) / std::f64::consts::TAU).round();
    let mut last = f64::NAN;
    for k in 0..angle.len() {
        let mut x = angle[k];
        if x.is_nan() {
            continue;
        }
        if !last.is_nan() && turns(x, last) != 0.0 {
            x -= std::f64::consts::TAU * turns(x, last);
            angle.to_mut()[k] = x;
        }
        last = x;
    }
}

fn interpolate(t: &[f64], values: &mut Cow<[f64]>, limit: f64) {
    let mut last: Option<usize> = None;
    for k in 0..values.len() {
        if values[k].is_nan() {
            continue;
        }
        if let Some(from) = last.filter(|&from| k - from > 1 && t[k] - t[from] <= limit) {
            let values = values.to_mut();
            let slope = (values[k] - values[from]) / (t[k] - t[from]);
            for j in from + 1..k {
                values[j] = values[from] + slope * (t[j] - t[from]);
            }
        }
        last = Some(k);
    }
}

/// First and last rows of the parts without gaps.
fn segments(t: &[f64], series: &[&[f64]], limit: f64) -> Vec<(usize, usize)> {
    let mut segments: Vec<(usize, usize)> = Vec::new();
    for k in (0..t.len()).filter(|&k| series.iter().all(|values| values[k].is_finite())) {
        match segments.last_mut() {
            Some((_, to)) if *to + 1 == k && t[k] - t[*to] <= limit && t[k] > t[*to] => *to = k,
            _ => segments.push((k, k)),
        }
    }
    segments
}

/// Channels and pose without gaps in the segments.
struct Series<'a> {
    t: &'a [f64],
    channels: &'a [&'a [f64]],
    heading: &'a [f64],
    position: Option<[&'a [f64]; 2]>,
    segments: Vec<(usize, usize)>,
}

/// Integrals of each channel from the first row of a segment on, plain and along the heading: `x`, `x cos psi`,
/// `x sin psi`.
type Integrals = Vec<[f64; 3]>;

impl Series<'_> {
    /// Consecutive windows of at least each length \[s\], in one pass.
    fn windows(&self, lengths: &[f64]) -> Vec<Vec<Window>> {
        let mut found: Vec<Vec<Window>> = lengths.iter().map(|_| Vec::new()).collect();
        for &(first, last) in &self.segments {
            let mut sums: Integrals = vec![[0.0; 3]; self.channels.len()];
            // First row of the present window of each length, and the integrals there.
            let mut begun = vec![(first, sums.clone()); lengths.len()];
            let mut direction = self.heading[first].sin_cos();
            for to in first + 1..=last {
                let half = 0.5 * (self.t[to] - self.t[to - 1]);
                let before = std::mem::replace(&mut direction, self.heading[to].sin_cos());
                for (sums, values) in sums.iter_mut().zip(self.channels) {
                    let parts = |x: f64, (sin, cos): (f64, f64)| [x, x * cos, x * sin];
                    let (before, now) = (parts(values[to - 1], before), parts(values[to], direction));
                    (0..3).for_each(|i| sums[i] += half * (before[i] + now[i]));
                }
                for ((begun, length), found) in begun.iter_mut().zip(lengths).zip(&mut found) {
                    if self.t[to] - self.t[begun.0] >= length * (1.0 - 1e-9) {
                        found.push(self.window(begun, (to, &sums)));
                        begun.0 = to;
                        begun.1.copy_from_slice(&sums);
                    }
                }
            }
        }
        found
    }

    fn window(&self, (from, before): &(usize, Integrals), (to, after): (usize, &Integrals)) -> Window {
        let from = *from;
        let duration = self.t[to] - self.t[from];
        let (sin, cos) = self.heading[usize::midpoint(from, to)].sin_cos();
        let body = |x: f64, y: f64| [(cos * x + sin * y) / duration, (cos * y - sin * x) / duration];
        let [x, y] = self.position.map_or([0.0; 2], |axes| axes.map(|axis| axis[to] - axis[from]));
        let ((s0, c0), (s1, c1)) = (self.heading[from].sin_cos(), self.heading[to].sin_cos());
        let changes = before.iter().zip(after).map(|(a, b)| [b[0] - a[0], b[1] - a[1], b[2] - a[2]]);
        Window {
            turn: (self.heading[to] - self.heading[from]) / duration,
            path: [body(x, y), body(y, x)],
            lever: body(c1 - c0, s1 - s0),
            mean: changes.clone().map(|change| change[0] / duration).collect(),
            forward: changes.map(|change| body(change[1], change[2])).collect(),
        }
    }
}

fn without_spikes(mut windows: Vec<Window>) -> Vec<Window> {
    let sizes = |w: &Window| -> Vec<f64> {
        let pose = [w.path[0][0].hypot(w.path[0][1]), w.turn.abs()];
        pose.into_iter().chain(w.mean.iter().map(|x| x.abs())).collect()
    };
    let all: Vec<Vec<f64>> = windows.iter().map(sizes).collect();
    let rates = all.first().map_or(0, Vec::len);
    let limits: Vec<f64> = (0..rates)
        .map(|i| {
            let mut sizes: Vec<f64> = all.iter().map(|sizes| sizes[i]).collect();
            sizes.sort_by(f64::total_cmp);
            // A rate that is zero nearly everywhere has no usual size.
            let usual = sizes[sizes.len() * 9 / 10];
            if usual > 0.0 { SPIKE * usual } else { f64::INFINITY }
        })
        .collect();
    windows.retain(|w| sizes(w).iter().zip(&limits).all(|(size, limit)| size <= limit));
    windows
}
