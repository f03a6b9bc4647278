//! Summary of a campaign on the guard.

use std::collections::BTreeMap;
use std::fmt;

use hydroid_core::adapt::guard::GuardOptions;
use serde::Serialize;

use super::{Campaign, DayResult};

/// Figures of a campaign.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Number of bad days.
    pub bad_days: usize,
    /// Bad days on which the unguarded model exceeds the guarantee, and on which the guarded one does.
    pub exceeded: [usize; 2],
    /// Bad days on which the guarded model exceeds the guarantee by more than the noise of the measurements explains.
    pub beyond_noise: usize,
    /// Largest excess of the guarded model, relative to the constant of the guarantee.
    pub largest_excess: f64,
    /// The same on clean days: number, exceeded, largest excess.
    pub clean_days: (usize, usize, f64),
    /// Guarded over unguarded error on clean days, for each kind of model: geometric mean, and of each output.
    pub cost: BTreeMap<&'static str, (f64, Vec<f64>)>,
    /// Error on bad days: guarded over unguarded, and guarded over reference; geometric means.
    pub bad_ratio: [f64; 2],
    /// False alarms among the sound samples of all days, and of clean days.
    pub false_alarms: [f64; 2],
    /// Spikes, jumps and stuck outputs: number and those detected.
    pub spikes: [usize; 2],
    /// Jumps; held back within 2 s.
    pub jumps_held: [usize; 2],
    /// Stuck outputs.
    pub stuck: [usize; 2],
    /// Bad days with a time from 20 to 40 s after the last fault of a sensor has ended: their number, those on which the
    /// guarded error is then at most 1.5 times the unguarded one, and the largest ratio.
    pub later: (usize, usize, f64),
    /// The same during the faults, with 1.2.
    pub during: (usize, usize, f64),
    /// Bad days on which the guarded error is at most 1.2 times the unguarded one, and the largest ratio.
    pub whole: (usize, f64),
    /// Longest stretch of samples with a held output.
    pub longest_hold: usize,
}

fn geometric(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, n), x| (sum + x.ln(), n + 1));
    (sum / f64::from(count)).exp()
}

/// Mean of `|x|` of a normal deviate: what the measurements add to the error of the reference model against the truth, at
/// most, in noise floors.
const MEAN_ABSOLUTE: f64 = 0.798;

/// Summary of the days.
pub fn summary(campaign: &Campaign) -> Summary {
    let Campaign { bad, clean } = campaign;
    let exceeded =
        |days: &[DayResult], which: usize| days.iter().filter(|day| day.excess[which] > 0.0).count();
    let GuardOptions { factor, floors, .. } = GuardOptions::new(1.0);
    let by_noise = factor * MEAN_ABSOLUTE / floors;
    let largest = |days: &[DayResult]| days.iter().map(|day| day.excess[1]).fold(f64::NEG_INFINITY, f64::max);
    let mut kinds: BTreeMap<&'static str, Vec<&DayResult>> = BTreeMap::new();
    for day in clean {
        kinds.entry(day.kind).or_default().push(day);
    }
    let cost = |days: &[&DayResult]| {
        let outputs = days[0].cost_by_output.len();
        let by = |i: usize| geometric(days.iter().filter_map(|day| day.cost_by_output.get(i).copied()));
        (geometric(days.iter().map(|day| day.cost)), (0..outputs).map(by).collect())
    };
    let total = |of: fn(&DayResult) -> [usize; 2], days: &[DayResult]| {
        days.iter().map(of).fold([0, 0], |[a, b], [c, d]| [a + c, b + d])
    };
    let share = |[all, some]: [usize; 2]| some as f64 / all.max(1) as f64;
    let ratios = |of: fn(&DayResult) -> [f64; 2], most: f64| {
        let ratios = bad.iter().map(|day| of(day)[1] / of(day)[0]).filter(|ratio| ratio.is_finite());
        ratios.fold((0, 0, 0.0), |(all, near, largest), ratio| {
            (all + 1, near + usize::from(ratio <= most), f64::max(largest, ratio))
        })
    };
    let (_, near, whole) = ratios(|day| [day.errors[1], day.errors[2]], 1.2);
    let (later, during) = (ratios(|day| day.later, 1.5), ratios(|day| day.during, 1.2));
    let alarms_clean = total(|day| day.false_alarms, clean);
    let alarms_bad = total(|day| day.false_alarms, bad);
    Summary {
        bad_days: bad.len(),
        exceeded: [exceeded(bad, 0), exceeded(bad, 1)],
        beyond_noise: bad.iter().filter(|day| day.excess[1] > by_noise).count(),
        largest_excess: largest(bad),
        clean_days: (clean.len(), exceeded(clean, 1), largest(clean)),
        cost: kinds.iter().map(|(kind, days)| (*kind, cost(days))).collect(),
        bad_ratio: [
            geometric(bad.iter().map(|day| day.errors[2] / day.errors[1])),
            geometric(bad.iter().map(|day| day.errors[2] / day.errors[0])),
        ],
        false_alarms: [
            share([alarms_clean[0] + alarms_bad[0], alarms_clean[1] + alarms_bad[1]]),
            share(alarms_clean),
        ],
        spikes: total(|day| day.spikes, bad),
        jumps_held: total(|day| day.jumps_held, bad),
        stuck: total(|day| day.stuck, bad),
        later,
        during,
        whole: (near, whole),
        longest_hold: bad.iter().chain(clean).map(|day| day.longest_hold).max().unwrap_or(0),
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [alone, guarded] = self.exceeded;
        writeln!(
            f,
            "bad days: {}; the unguarded model exceeds the guarantee on {alone}, the guarded one on {guarded}, and on {} by more than the noise explains (largest excess {:.2} of the constant)",
            self.bad_days, self.beyond_noise, self.largest_excess
        )?;
        let (clean, over, largest) = self.clean_days;
        if clean > 0 {
            writeln!(
                f,
                "clean days: {clean}; the guarded model exceeds the guarantee on {over} (largest {largest:.2})"
            )?;
        }
        for (kind, (cost, by)) in &self.cost {
            let by: Vec<String> = by.iter().map(|x| format!("{x:.3}")).collect();
            writeln!(f, "  {kind}: guarded over unguarded error {cost:.3} (outputs {})", by.join(", "))?;
        }
        let [over_alone, over_reference] = self.bad_ratio;
        writeln!(
            f,
            "bad days: guarded over unguarded error {over_alone:.3}, over that of the reference model {over_reference:.3}"
        )?;
        let [all, of_clean] = self.false_alarms.map(|share| 100.0 * share);
        let of_clean = if clean > 0 { format!(", {of_clean:.3} % on clean days") } else { String::new() };
        writeln!(f, "false alarms: {all:.3} % of the sound samples{of_clean}")?;
        let share = |[all, some]: [usize; 2]| format!("{some} of {all}");
        let (near, largest) = self.whole;
        writeln!(
            f,
            "at most 1.2 times the unguarded error on {near} of {} bad days (largest {largest:.2})",
            self.bad_days
        )?;
        let (all, near, largest) = self.during;
        writeln!(f, "during the faults, the same on {near} of {all} days (largest {largest:.2})")?;
        let (all, near, largest) = self.later;
        writeln!(
            f,
            "20 to 40 s after the last fault has ended: at most 1.5 times the unguarded error on {near} of {all} days (largest {largest:.2}); longest hold {} samples",
            self.longest_hold
        )?;
        write!(
            f,
            "not used: {} spikes, {} jumps within 2 s, {} stuck outputs",
            share(self.spikes),
            share(self.jumps_held),
            share(self.stuck)
        )
    }
}
