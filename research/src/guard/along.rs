//! A session along a day, with its errors and the events of its guard.

use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::guard::{Action, Event, GuardOptions};
use hydroid_core::predict::Workspace;

use super::day::{Day, Kind};

/// Errors of the predictions over the horizon of the guard, and what its sensor check did.
#[derive(Clone, Debug, Default)]
pub(super) struct Along {
    /// Error of the prediction from each sample against the truth: mean over the outputs, in half design ranges.
    pub(super) errors: Vec<f64>,
    /// Mean error of each output.
    pub(super) by_output: Vec<f64>,
    pub(super) detections: Detections,
}

impl Along {
    /// Mean error from some samples of the day; NaN if one has none.
    pub(super) fn mean(&self, samples: std::ops::Range<usize>) -> f64 {
        let place = |k: usize| k.checked_sub(SETTLING);
        let range = place(samples.start).zip(place(samples.end)).map(|(from, to)| from..to);
        let part = range.and_then(|range| self.errors.get(range)).unwrap_or_default();
        part.iter().sum::<f64>() / part.len() as f64
    }
}

/// Counts of the sensor check.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Detections {
    /// Samples of outputs without a fault, and those that were not used.
    pub(super) sound: usize,
    pub(super) false_alarms: usize,
    /// Spikes, and those that were not used.
    pub(super) spikes: [usize; 2],
    /// Jumps to an offset, and those that were held back within 2 s; the same for stuck outputs.
    pub(super) jumps: [usize; 2],
    pub(super) stuck: [usize; 2],
    /// Longest stretch of samples with a held output, and number of outputs that were trusted against the gate.
    pub(super) longest_hold: usize,
    pub(super) trusts: usize,
}

/// Samples before the first judged prediction.
const SETTLING: usize = 100;

/// Follows a day. With `used`, the session receives these measurements (rows) in place of those of the day; a guard appends
/// those that it used to `seen`.
pub(super) fn along(
    session: &mut dyn Adapter,
    day: &Day,
    scale: &[f64],
    options: &GuardOptions,
    used: Option<&[f64]>,
    seen: &mut Vec<f64>,
) -> Along {
    let (n, m, horizon) = (scale.len(), session.inputs(), options.horizon);
    let run = &day.run;
    let commands = run.inputs.rows(0, run.len());
    let (mut work, mut y) = (Workspace::new(), vec![0.0; n * horizon]);
    let mut own = Along { by_output: vec![0.0; n], ..Along::default() };
    // Samples and outputs of measurements that were not used.
    let mut unused: Vec<(usize, usize)> = Vec::new();
    let (mut held, mut longest_hold, mut trusts) = (0, 0, 0);
    session.reset();
    for k in 0..run.len().saturating_sub(horizon) {
        if day.resets.contains(&k) {
            session.reset();
        }
        session.observe(used.map_or_else(|| run.outputs.row(k), |used| &used[k * n..(k + 1) * n]));
        if let Some(guard) = session.guard() {
            seen.extend(guard.used());
            let row = run.outputs.row(k).iter().zip(guard.used()).enumerate();
            unused.extend(row.filter(|(_, (y, used))| used.is_nan() && !y.is_nan()).map(|(i, _)| (k, i)));
            held = if guard.is_held() { held + 1 } else { 0 };
            longest_hold = longest_hold.max(held);
            let is_trust = |event: &&Event| matches!(event.action, Action::Trusted { .. });
            trusts += guard.events().iter().filter(is_trust).count();
        }
        if k >= SETTLING {
            session.rollout(&commands[m * k..m * (k + horizon)], &mut work, &mut y);
            let truth = &day.truth[(k + horizon) * n..(k + horizon + 1) * n];
            let mut sum = 0.0;
            for (((p, t), scale), by) in
                y[n * (horizon - 1)..].iter().zip(truth).zip(scale).zip(&mut own.by_output)
            {
                let error = (p - t).abs() / scale;
                // A diverged prediction counts with ten times the range.
                let error = if error < 20.0 { error } else { 20.0 };
                *by += error;
                sum += error;
            }
            own.errors.push(sum / n as f64);
        }
        session.advance(run.inputs.row(k));
    }
    let count = own.errors.len().max(1) as f64;
    own.by_output.iter_mut().for_each(|sum| *sum /= count);
    own.detections = Detections { longest_hold, trusts, ..detections(day, &unused, n, options) };
    own
}

fn detections(day: &Day, unused: &[(usize, usize)], n: usize, options: &GuardOptions) -> Detections {
    let mut own = Detections::default();
    let end = day.run.len().saturating_sub(options.horizon);
    // The sensor check begins after 100 samples, and the last faults are not answered.
    let judged = |from: usize| from > 2 * SETTLING && from + options.horizon < end;
    let near = |output: usize, k: usize| {
        // The rest of a hold after a fault belongs to it.
        let belongs = |from: usize, to: usize| (from..to + options.horizon).contains(&k);
        day.faults.iter().any(|fault| fault.output == output && belongs(fault.from, fault.to))
    };
    let found = |output: usize, from: usize, to: usize| {
        unused.iter().any(|&(k, o)| o == output && (from..to).contains(&k))
    };
    for fault in day.faults.iter().filter(|fault| judged(fault.from)) {
        let (count, hit) = match fault.kind {
            Kind::Spikes => (&mut own.spikes, found(fault.output, fault.from, fault.to)),
            Kind::Jump => {
                let to = fault.from + options.horizon;
                (&mut own.jumps, found(fault.output, fault.from, to))
            }
            Kind::Stuck if fault.to > fault.from + options.repeats => {
                (&mut own.stuck, found(fault.output, fault.from, fault.to))
            }
            _ => continue,
        };
        count[0] += 1;
        count[1] += usize::from(hit);
    }
    let faulty: usize = day.faults.iter().map(|fault| fault.to.min(end).saturating_sub(fault.from)).sum();
    own.sound = (n * end).saturating_sub(faulty);
    own.false_alarms = unused.iter().filter(|&&(k, output)| !near(output, k)).count();
    own
}
