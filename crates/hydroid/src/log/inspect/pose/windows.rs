//! Mean velocities over windows: of the pose, and of the channels along the heading.
//!
//! With the position $z = x + i y$ and the heading $\psi$, the path over a window satisfies, also while the vessel
//! turns, $\Delta z = \int (u + i v) e^{i\psi}\,dt + l\,\Delta e^{i\psi}$ with the lever arm $l$ of the position sensor.
//! All terms are divided by the duration and rotated by the heading in the middle of the window.

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
pub(super) fn windows(columns: &Columns, channels: usize, position: bool, limit: f64) -> Vec<Vec<Window>> {
    let t = &columns.t;
    let mut series: Vec<Vec<f64>> = columns.outputs.clone();
    unwrap(&mut series[channels]);
    for values in &mut series {
        interpolate(t, values, limit);
    }
    if !position {
        let none = vec![0.0; t.len()];
        series.extend([none.clone(), none]);
    }
    let sums = Sums::new(t, &series, channels, limit);
    let covered = sums.segments.iter().map(|(from, to)| t[*to] - t[*from]).sum::<f64>();
    (0..LENGTHS)
        .map(|halvings| covered / FEWEST as f64 * 0.5_f64.powi(halvings))
        .map(|length| without_spikes(sums.windows(length)))
        // The ends of segments leave some windows out.
        .filter(|found| 2 * found.len() >= FEWEST)
        .collect()
}

/// Removes the jumps of a wrapped angle.
fn unwrap(angle: &mut [f64]) {
    let mut last = f64::NAN;
    for x in angle.iter_mut().filter(|x| !x.is_nan()) {
        if !last.is_nan() {
            *x -= std::f64::consts::TAU * ((*x - last) / std::f64::consts::TAU).round();
        }
        last = *x;
    }
}

fn interpolate(t: &[f64], values: &mut [f64], limit: f64) {
    let mut last: Option<usize> = None;
    for k in 0..values.len() {
        if values[k].is_nan() {
            continue;
        }
        if let Some(from) = last.filter(|&from| k - from > 1 && t[k] - t[from] <= limit) {
            let slope = (values[k] - values[from]) / (t[k] - t[from]);
            for j in from + 1..k {
                values[j] = values[from] + slope * (t[j] - t[from]);
            }
        }
        last = Some(k);
    }
}

/// Integrals from the first row on.
struct Sums<'a> {
    t: &'a [f64],
    heading: &'a [f64],
    x: &'a [f64],
    y: &'a [f64],
    /// Of each channel, plain and along the heading: `x`, `x cos psi`, `x sin psi`.
    channels: Vec<Vec<[f64; 3]>>,
    /// First and last rows of the parts without gaps.
    segments: Vec<(usize, usize)>,
}

impl<'a> Sums<'a> {
    fn new(t: &'a [f64], series: &'a [Vec<f64>], channels: usize, limit: f64) -> Self {
        let (heading, x, y) = (&series[channels], &series[channels + 1], &series[channels + 2]);
        let known = |k: usize| series.iter().all(|values| values[k].is_finite());
        let mut segments: Vec<(usize, usize)> = Vec::new();
        for k in (0..t.len()).filter(|&k| known(k)) {
            match segments.last_mut() {
                Some((_, to)) if *to + 1 == k && t[k] - t[*to] <= limit && t[k] > t[*to] => *to = k,
                _ => segments.push((k, k)),
            }
        }
        let direction: Vec<(f64, f64)> = heading.iter().map(|psi| psi.sin_cos()).collect();
        let parts = |values: &[f64], k: usize| {
            let (sin, cos) = direction[k];
            [values[k], values[k] * cos, values[k] * sin]
        };
        let integral = |values: &Vec<f64>| {
            let mut sums = vec![[0.0; 3]; t.len()];
            for &(from, to) in &segments {
                for k in from + 1..=to {
                    let half = 0.5 * (t[k] - t[k - 1]);
                    let (before, now) = (parts(values, k - 1), parts(values, k));
                    sums[k] = std::array::from_fn(|i| sums[k - 1][i] + half * (before[i] + now[i]));
                }
            }
            sums
        };
        let channels = series[..channels].iter().map(integral).collect();
        Self { t, heading, x, y, channels, segments }
    }

    /// Consecutive windows of at least `length` seconds.
    fn windows(&self, length: f64) -> Vec<Window> {
        let mut found = Vec::new();
        for &(first, last) in &self.segments {
            let mut from = first;
            for to in first..=last {
                if to > from && self.t[to] - self.t[from] >= length * (1.0 - 1e-9) {
                    found.push(self.window(from, to));
                    from = to;
                }
            }
        }
        found
    }

    fn window(&self, from: usize, to: usize) -> Window {
        let duration = self.t[to] - self.t[from];
        let (sin, cos) = self.heading[usize::midpoint(from, to)].sin_cos();
        let body = |x: f64, y: f64| [(cos * x + sin * y) / duration, (cos * y - sin * x) / duration];
        let (x, y) = (self.x[to] - self.x[from], self.y[to] - self.y[from]);
        let ((s0, c0), (s1, c1)) = (self.heading[from].sin_cos(), self.heading[to].sin_cos());
        let change = |sums: &Vec<[f64; 3]>, i: usize| sums[to][i] - sums[from][i];
        Window {
            turn: (self.heading[to] - self.heading[from]) / duration,
            path: [body(x, y), body(y, x)],
            lever: body(c1 - c0, s1 - s0),
            mean: self.channels.iter().map(|sums| change(sums, 0) / duration).collect(),
            forward: self.channels.iter().map(|sums| body(change(sums, 1), change(sums, 2))).collect(),
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
