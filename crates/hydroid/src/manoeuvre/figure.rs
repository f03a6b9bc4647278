//! Results of trials as named figures, with intervals and criteria.

use serde::Serialize;

use super::pull_out::PullOut;
use super::speed_trials::{Acceleration, Stopping};
use super::spiral::Spiral;
use super::turning_circle::TurningCircle;
use super::zigzag::Zigzag;

/// A figure of a trial.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// Name with its unit: `advance_m`.
    pub name: String,
    /// Value predicted by the model; `None` if the trial does not reach it, or is not valid before.
    pub value: Option<f64>,
    /// Why the figure is not valid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_valid: Option<String>,
    /// Whether the model extrapolates before the trial reaches the figure: an output has left its training range.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub extrapolated: bool,
    /// Time since the order at which the figure is known \[s\]; `None` for the end of the trial.
    #[serde(skip)]
    pub(super) at_s: Option<f64>,
    /// 5 % and 95 % quantile over the members of the ensemble or committee, joined with the errors of trials that were left out;
    /// of a measured figure, over draws of the path given the positions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<[f64; 2]>,
    /// Number of trials that were left out of the fit, whose errors are in the interval.
    #[serde(skip_serializing_if = "is_zero")]
    pub left_out_trials: usize,
    /// Why there is none, although there are members.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_interval: Option<String>,
    /// Criterion of IMO resolution MSC.137(76).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub criterion: Option<Criterion>,
    /// The limit of a criterion that is not judged, because the figure has no value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_judged: Option<f64>,
}

/// An upper limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Criterion {
    /// Largest permitted value.
    pub limit: f64,
    /// Whether the value is within the limit.
    pub passed: bool,
    /// Whether the whole interval is on the same side of the limit; `None` without an interval that holds the errors of trials, and
    /// where the model extrapolates.
    #[serde(rename = "certain")]
    pub is_certain: Option<bool>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature of serde")]
const fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Criterion {
    /// Whether the limit is kept, in words.
    pub const fn words(&self) -> &'static str {
        match (self.passed, self.is_certain) {
            (true, Some(true)) => "passed",
            (true, Some(false)) => "passed, but the interval reaches beyond it",
            (true, None) => "passed, by an estimate whose error is not known",
            (false, Some(true)) => "missed",
            (false, Some(false)) => "missed, but the interval reaches within it",
            (false, None) => "missed, by an estimate whose error is not known",
        }
    }
}

impl Figure {
    pub(super) fn new(name: impl Into<String>, value: impl Into<Option<f64>>) -> Self {
        let (name, value): (_, Option<f64>) = (name.into(), value.into());
        let value = value.filter(|value| value.is_finite());
        Self {
            name,
            value,
            not_valid: None,
            extrapolated: false,
            at_s: None,
            interval: None,
            left_out_trials: 0,
            no_interval: None,
            criterion: None,
            not_judged: None,
        }
    }

    fn at(self, at_s: Option<f64>) -> Self {
        Self { at_s, ..self }
    }

    /// The figure of a trial that is not valid for a reason: what it had not reached before has no value.
    pub(super) fn unless(self, reason: Option<&str>) -> Self {
        let Some(reason) = reason else { return self };
        match self.value.and(self.at_s) {
            Some(_) => self,
            None => Self { value: None, not_valid: Some(reason.to_owned()), ..self },
        }
    }

    /// Without a value, if it is one of those that the sway velocity decides, which is not known for a reason.
    pub(super) fn without_sway(&mut self, names: &[&str], reason: &str) {
        if names.contains(&self.name.as_ref()) && self.not_valid.is_none() {
            self.withdraw(reason);
        }
    }

    /// Without a value, for a reason.
    pub(super) fn withdraw(&mut self, reason: &str) {
        (self.value, self.interval, self.no_interval, self.left_out_trials) = (None, None, None, 0);
        self.not_valid = Some(reason.to_owned());
    }

    /// What stands in place of a value.
    pub const fn missing(&self) -> &'static str {
        if self.not_valid.is_some() { "not valid" } else { "not reached" }
    }

    /// The figure with an upper limit.
    pub(super) fn limit(&mut self, limit: f64) {
        self.not_judged = self.value.is_none().then_some(limit);
        self.criterion = self.value.map(|value| {
            let passed = value <= limit;
            let known = self.interval.filter(|_| self.left_out_trials > 0 && !self.extrapolated);
            let is_certain = known.map(|ends| ends.iter().all(|end| (*end <= limit) == passed));
            Criterion { limit, passed, is_certain }
        });
    }

    /// The figure of a ship whose lengths are `scale` times those of the vessel, by Froude's law.
    pub(super) fn scale(&mut self, scale: f64) {
        let root = scale.sqrt();
        let factor = match self.name_and_unit().1 {
            "m" => scale,
            "m/s" | "s" | "min" => root,
            "deg/s" => 1.0 / root,
            _ => 1.0,
        };
        self.value = self.value.map(|value| factor * value);
        self.interval = self.interval.map(|ends| ends.map(|end| factor * end));
        self.at_s = self.at_s.map(|at| root * at);
    }

    /// Name and unit apart: `advance`, `m`.
    pub fn name_and_unit(&self) -> (String, &'static str) {
        const UNITS: [(&str, &str); 7] = [
            ("_m_s", "m/s"),
            ("_deg_s", "deg/s"),
            ("_percent", "%"),
            ("_deg", "deg"),
            ("_min", "min"),
            ("_s", "s"),
            ("_m", "m"),
        ];
        let (stem, unit) = UNITS
            .iter()
            .find_map(|(suffix, unit)| self.name.strip_suffix(suffix).map(|stem| (stem, *unit)))
            .unwrap_or((&self.name, ""));
        (stem.replace('_', " "), unit)
    }
}

/// Figures without a value where the sway velocity is not known; a simulation without sway has all but the first.
pub(super) const NO_SWAY_FIGURES: [&str; 7] = [
    "drift_angle_deg",
    "advance_m",
    "transfer_m",
    "tactical_diameter_m",
    "initial_turning_distance_m",
    "steady_radius_m",
    "speed_loss_percent",
];

/// Why a log has none.
pub(super) const NO_SWAY: &str = "there is no sway velocity v";

/// Least number of members for an interval.
const LEAST_MEMBERS: usize = 5;

/// Quantiles of an interval.
const QUANTILES: [f64; 2] = [0.05, 0.95];

/// Sets the intervals of figures from those of members, and gives the number of members; 0 if they are too few. Members that do
/// not reach a figure may lie beyond either end: the quantiles are farther out by their share, and more of them than lie beyond
/// an end leave no interval. `all` counts the members with those that have no such trial.
pub(super) fn set_intervals(figures: &mut [Figure], members: &[&[Figure]], all: usize) -> usize {
    if members.len() < LEAST_MEMBERS {
        return 0;
    }
    for (i, figure) in figures.iter_mut().enumerate() {
        let mut values: Vec<f64> = members.iter().filter_map(|other| other[i].value).collect();
        let Some(value) = figure.value else { continue };
        let missing = (all - values.len()) as f64 / all as f64;
        if missing > QUANTILES[0] {
            let (missing, words) = (all - values.len(), if all - values.len() == 1 { "does" } else { "do" });
            figure.no_interval = Some(format!("{missing} of {all} members {words} not reach it"));
            continue;
        }
        values.sort_unstable_by(f64::total_cmp);
        let [low, high] = [QUANTILES[0] - missing, QUANTILES[1] + missing].map(|q| quantile(&values, q));
        // The estimate is not that of a member, and may lie beside all of them.
        figure.interval = Some([low.min(value), high.max(value)]);
    }
    members.len()
}

/// Quantile of sorted values, linear between order statistics.
fn quantile(sorted: &[f64], q: f64) -> f64 {
    let place = q * (sorted.len() - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index of the slice")]
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - place.floor()) * (sorted[above] - sorted[below])
}

/// Results that can be listed as figures.
pub(super) trait Figures {
    fn figures(&self) -> Vec<Figure>;
}

impl Figures for TurningCircle {
    fn figures(&self) -> Vec<Figure> {
        let steady = |value: fn(&super::SteadyTurn) -> f64| self.steady.as_ref().map(value);
        vec![
            Figure::new("advance_m", self.advance_m).at(self.time_90_s),
            Figure::new("transfer_m", self.transfer_m).at(self.time_90_s),
            Figure::new("tactical_diameter_m", self.tactical_diameter_m).at(self.time_180_s),
            Figure::new("time_to_90_degrees_s", self.time_90_s).at(self.time_90_s),
            Figure::new("time_to_180_degrees_s", self.time_180_s).at(self.time_180_s),
            Figure::new("steady_radius_m", steady(|turn| turn.radius_m)),
            Figure::new("steady_yaw_rate_deg_s", steady(|turn| turn.yaw_rate_deg_s)),
            Figure::new("drift_angle_deg", steady(|turn| turn.drift_deg)),
            Figure::new("speed_loss_percent", steady(|turn| 100.0 * turn.speed_loss)),
        ]
    }
}

impl Figures for Zigzag {
    fn figures(&self) -> Vec<Figure> {
        const ORDINALS: [&str; 3] = ["first", "second", "third"];
        let overshoot = |(i, ordinal): (usize, &&str)| {
            Figure::new(format!("{ordinal}_overshoot_deg"), self.overshoots_deg.get(i).copied())
                .at(self.peaks_s.get(i).copied())
        };
        let mut figures: Vec<Figure> = ORDINALS.iter().enumerate().map(overshoot).collect();
        figures.extend([
            Figure::new("initial_turning_time_s", self.initial_turning_time_s)
                .at(self.initial_turning_time_s),
            Figure::new("initial_turning_distance_m", self.initial_turning_distance_m)
                .at(self.initial_turning_time_s),
            Figure::new("reach_s", self.reach_s).at(self.reach_s),
            Figure::new("period_s", self.period_s).at(self.period_s),
        ]);
        figures
    }
}

impl Figures for PullOut {
    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::new("residual_yaw_rate_starboard_deg_s", self.residual_deg_s[0]),
            Figure::new("residual_yaw_rate_port_deg_s", self.residual_deg_s[1]),
            Figure::new("decay_time_starboard_s", self.decay_s[0]),
            Figure::new("decay_time_port_s", self.decay_s[1]),
        ]
    }
}

impl Figures for Spiral {
    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::new("loop_width_percent", self.loop_width.map(|width| 100.0 * width)),
            Figure::new("loop_height_deg_s", self.loop_height_deg_s),
        ]
    }
}

impl Figures for Acceleration {
    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::new("speed_m_s", self.speed_m_s),
            Figure::new("time_to_63_percent_s", self.time_63_s),
            Figure::new("time_to_95_percent_s", self.time_95_s),
            Figure::new("distance_to_95_percent_m", self.distance_95_m),
        ]
    }
}

impl Figures for Stopping {
    fn figures(&self) -> Vec<Figure> {
        vec![
            Figure::new("end_speed_m_s", self.time_s.map(|_| self.end_speed_m_s)),
            Figure::new("stopping_time_s", self.time_s),
            Figure::new("track_reach_m", self.track_reach_m),
            Figure::new("head_reach_m", self.head_reach_m),
            Figure::new("lateral_deviation_m", self.lateral_deviation_m),
            Figure::new("heading_change_deg", self.heading_change_deg),
        ]
    }
}

/// Directional stability of a vessel: that of its model, if as many members agree as an interval holds. Else why it is not decided.
pub(super) fn stability(
    own: Option<bool>,
    members: &[Option<bool>],
    all: usize,
) -> (Option<bool>, Option<String>) {
    let Some(stable) = own else { return (None, None) };
    let agree = members.iter().filter(|other| **other == own).count();
    if members.len() < LEAST_MEMBERS || agree as f64 >= QUANTILES[1] * all as f64 {
        return (own, None);
    }
    let is = if stable { "is" } else { "is not" };
    (None, Some(format!("the model {is} directionally stable, and {agree} of {all} members agree")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_that_do_not_reach_a_figure_widen_its_interval_or_leave_none() {
        let of = |value: Option<f64>| vec![Figure::new("advance_m", value)];
        let interval = |missing: usize, without_trial: usize| {
            let members: Vec<Vec<Figure>> =
                (0..=100).map(|k| of((k >= missing).then_some(k as f64))).collect();
            let members: Vec<&[Figure]> = members.iter().map(|figures| &figures[..]).collect();
            let mut figures = of(Some(50.0));
            let count = set_intervals(&mut figures, &members[without_trial..], 101);
            (count, figures[0].interval, figures[0].no_interval.clone())
        };
        assert_eq!(interval(0, 0), (101, Some([5.0, 95.0]), None));
        let (_, widened, _) = interval(2, 0);
        assert!(widened.is_some_and(|[low, high]| low < 5.1 && high > 96.0), "{widened:?}");
        let reason = || Some("20 of 101 members do not reach it".to_owned());
        assert_eq!(interval(20, 0), (101, None, reason()));
        assert_eq!(interval(0, 20), (81, None, reason()));
    }

    #[test]
    fn stability_is_decided_if_the_members_agree() {
        let members = |stable: usize| -> Vec<Option<bool>> { (0..100).map(|k| Some(k < stable)).collect() };
        assert_eq!(stability(Some(true), &members(97), 100), (Some(true), None));
        assert_eq!(stability(Some(false), &[], 0), (Some(false), None));
        let (stable, reason) = stability(Some(false), &members(60), 100);
        assert_eq!(stable, None);
        assert_eq!(reason.unwrap(), "the model is not directionally stable, and 40 of 100 members agree");
    }

    #[test]
    fn a_criterion_is_certain_if_the_whole_interval_is_on_one_side() {
        let judged = |value: f64, interval: Option<[f64; 2]>| {
            let mut figure =
                Figure { interval, left_out_trials: 9, ..Figure::new("first_overshoot_deg", value) };
            figure.limit(25.0);
            figure.criterion.unwrap().words()
        };
        assert_eq!(judged(20.0, None), "passed, by an estimate whose error is not known");
        let mut of_members =
            Figure { interval: Some([18.0, 24.9]), ..Figure::new("first_overshoot_deg", 20.0) };
        of_members.limit(25.0);
        assert_eq!(of_members.criterion.unwrap().is_certain, None);
        let mut beyond = Figure { left_out_trials: 9, extrapolated: true, ..of_members };
        beyond.limit(25.0);
        assert_eq!(beyond.criterion.unwrap().is_certain, None);
        assert_eq!(judged(20.0, Some([18.0, 24.9])), "passed");
        assert_eq!(judged(20.0, Some([18.0, 25.1])), "passed, but the interval reaches beyond it");
        assert_eq!(judged(26.0, Some([24.0, 28.0])), "missed, but the interval reaches within it");
        assert_eq!(judged(26.0, Some([25.5, 28.0])), "missed");
    }
}
