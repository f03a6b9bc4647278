//! Verdicts on the claims of the thesis, with reasons that contain the measured values.

use std::collections::BTreeMap;

use serde::Serialize;

use super::claim::{Bound, Claim};
use super::outcome::Outcome;
use hydroid_report::number;

/// Verdict on a claim; the worst is the largest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Holds {
    /// Within the bound of *reproduced*.
    Reproduced,
    /// Within the bound of *in part*.
    InPart,
    /// Outside both bounds.
    NotReproduced,
    /// The experiment did not produce the value.
    NotMeasured,
}

impl Holds {
    /// The verdict in words.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::InPart => "in part",
            Self::NotReproduced => "not reproduced",
            Self::NotMeasured => "not measured",
        }
    }
}

/// A measured value of a claim with its verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Name of the value.
    pub measure: String,
    /// Description of the value.
    pub measured: String,
    /// What the value belongs to: an output of the vessel, a network, or both; may be empty.
    pub of: String,
    /// Seeds and records.
    pub over: String,
    /// The value, if the experiment produced it.
    pub figure: Option<f64>,
    pub verdict: Holds,
    /// Ratio of the value to the bound of *reproduced*, at least 1 if the bound holds.
    pub margin: Option<f64>,
    /// Bounds of *reproduced* and *in part*.
    pub bounds: [Bound; 2],
}

/// A claim with its verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Text of the claim.
    pub claim: String,
    /// Name of the experiment.
    pub experiment: String,
    /// The worst verdict of the measured values.
    pub verdict: Holds,
    pub measures: Vec<Measured>,
    /// Reason for the verdict.
    pub because: String,
}

impl Judged {
    /// The value that decides: that of the worst verdict, with the smallest margin.
    pub fn deciding(&self) -> Option<&Measured> {
        let margin = |one: &Measured| one.margin.unwrap_or(f64::NAN);
        let worst = self.measures.iter().filter(|one| one.verdict == self.verdict);
        worst.min_by(|a, b| margin(a).total_cmp(&margin(b)))
    }
}

/// Verdicts on the claims whose experiment was run.
pub(super) fn judge(claims: &[Claim], outcomes: &BTreeMap<&str, &Outcome>) -> Vec<Judged> {
    let one = |claim: &Claim| Some(judged(claim, outcomes.get(claim.experiment.as_str())?));
    claims.iter().filter_map(one).collect()
}

fn judged(claim: &Claim, outcome: &Outcome) -> Judged {
    let measures: Vec<Measured> = claim
        .measures
        .iter()
        .flat_map(|group| {
            group
                .names()
                .into_iter()
                .map(|(output, name)| {
                    let figure = outcome.measures.get(&name).copied().filter(|figure| !figure.is_nan());
                    let verdict = match figure {
                        None => Holds::NotMeasured,
                        Some(figure) if group.reproduced.holds(figure) => Holds::Reproduced,
                        Some(figure) if group.partly.holds(figure) => Holds::InPart,
                        Some(_) => Holds::NotReproduced,
                    };
                    Measured {
                        measured: group.measured.clone(),
                        of: [group.of.as_str(), output]
                            .into_iter()
                            .filter(|part| !part.is_empty())
                            .collect::<Vec<_>>()
                            .join(", "),
                        over: outcome.over.get(&name).cloned().unwrap_or_default(),
                        figure,
                        verdict,
                        margin: figure.map(|figure| group.reproduced.margin(figure)),
                        bounds: [group.reproduced, group.partly],
                        measure: name,
                    }
                })
                .collect::<Vec<_>>()
        })
        .collect();
    let verdict = measures.iter().map(|one| one.verdict).max().unwrap_or(Holds::NotMeasured);
    let template = match verdict {
        Holds::Reproduced => &claim.because.reproduced,
        Holds::InPart => &claim.because.partly,
        Holds::NotReproduced => &claim.because.not,
        Holds::NotMeasured => "",
    };
    let because = [reason(template, outcome), missed(&measures)];
    let because = because.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ");
    Judged { claim: claim.claim.clone(), experiment: claim.experiment.clone(), verdict, measures, because }
}

/// The values beyond the bound of *reproduced*, if there are several values.
fn missed(measures: &[Measured]) -> String {
    let missed: Vec<String> = measures
        .iter()
        .filter(|one| one.verdict != Holds::Reproduced && (measures.len() > 1 || one.figure.is_none()))
        .map(|one| {
            let name = if one.of.is_empty() { format!("{}:", one.measured) } else { one.of.clone() };
            let figure = one.figure.map_or_else(|| "not measured".to_owned(), |x| number::text(x, 3));
            format!("{name} {figure} ({} is required)", one.bounds[0].words())
        })
        .collect();
    if missed.is_empty() { String::new() } else { format!("Beyond the bound: {}.", missed.join("; ")) }
}

/// A reason with the values in place of their names.
fn reason(template: &str, outcome: &Outcome) -> String {
    let mut text = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once('{') {
        let Some((name, after)) = after.split_once('}') else { break };
        text.push_str(before);
        text.push_str(&value(name, outcome));
        rest = after;
    }
    text.push_str(rest);
    text
}

fn value(name: &str, outcome: &Outcome) -> String {
    let (name, percent) = name.strip_suffix(" %").map_or((name, false), |name| (name, true));
    if name.contains('*') {
        let each = ["u", "v", "r"]
            .map(|output| format!("{} ({output})", one_value(&name.replace('*', output), percent, outcome)));
        return format!("{}, {} and {}", each[0], each[1], each[2]);
    }
    one_value(name, percent, outcome)
}

fn one_value(name: &str, percent: bool, outcome: &Outcome) -> String {
    if let Some(words) = outcome.words.get(name) {
        return words.clone();
    }
    match outcome.measures.get(name) {
        Some(figure) if percent => format!("{} %", number::shortest(100.0 * figure, 3)),
        Some(figure) => number::text(*figure, 3),
        None => number::NONE.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::claim::Measure;
    use crate::plan::Plan;

    /// A value of each kind: within *reproduced*, within *in part* alone, beyond both.
    fn figures(of: &Measure) -> [f64; 3] {
        let [inside, outside] = [of.reproduced, of.partly].map(|bound| match bound {
            Bound::AtMost(most) => [most, 1.001 * most + 1e-6],
            Bound::AtLeast(least) => [least, 0.999 * least - 1e-6],
            Bound::Between(least, most) => [0.5 * (least + most), 1.001 * most],
        });
        [inside[0], inside[1], outside[1]]
    }

    const VERDICTS: [Holds; 3] = [Holds::Reproduced, Holds::InPart, Holds::NotReproduced];

    fn alone(claim: &Claim, outcome: &Outcome) -> Judged {
        judge(std::slice::from_ref(claim), &BTreeMap::from([(claim.experiment.as_str(), outcome)])).remove(0)
    }

    /// Every claim, with each of its values in turn at each verdict and the others reproduced: the verdict of the value
    /// is that of the claim, the reason is the one of this verdict, and it has the value.
    #[test]
    fn the_reason_of_a_claim_has_the_verdict_and_the_values_that_were_measured() {
        let plan = Plan::built_in(false).unwrap();
        assert!(plan.claims.len() >= 17);
        for claim in &plan.claims {
            let all: Vec<(String, [f64; 3])> = claim
                .measures
                .iter()
                .flat_map(|of| of.names().into_iter().map(|(_, name)| (name, figures(of))))
                .collect();
            for (worst, figures) in &all {
                for (i, expected) in VERDICTS.into_iter().enumerate() {
                    let mut outcome = Outcome::default();
                    outcome.basis(3, &["lawn_1", "lawn_2"]);
                    for (name, [inside, ..]) in &all {
                        outcome.measure(name, *inside);
                    }
                    outcome.measure(worst, figures[i]);
                    let judged = alone(claim, &outcome);
                    let whose = format!("{worst} = {}: {}", figures[i], judged.because);
                    assert_eq!(judged.verdict, expected, "{whose}");
                    let deciding = judged.deciding().unwrap();
                    assert!(expected == Holds::Reproduced || &deciding.measure == worst, "{whose}");
                    assert_eq!(deciding.over, "3 seeds, 2 records (lawn_1, lawn_2)");
                    assert!((deciding.margin.unwrap() >= 1.0) == (expected == Holds::Reproduced), "{whose}");
                    let [plain, percent] = [false, true].map(|percent| one_value(worst, percent, &outcome));
                    let states = judged.because.contains(&plain) || judged.because.contains(&percent);
                    assert!(states, "{whose}");
                    let misses = judged.because.contains("Beyond the bound");
                    assert_eq!(misses, expected != Holds::Reproduced && all.len() > 1, "{whose}");
                    assert!(!judged.because.contains(['{', '}']), "{whose}");
                }
            }
        }
    }

    /// A reason that is the same for several verdicts states values and no judgement; one that judges differs from those
    /// of the other verdicts.
    #[test]
    fn a_reason_for_several_verdicts_judges_nothing() {
        for claim in Plan::built_in(false).unwrap().claims {
            let because = [&claim.because.reproduced, &claim.because.partly, &claim.because.not];
            for (i, reason) in because.iter().enumerate() {
                assert!(reason.contains('{'), "{}: {reason}", claim.claim);
                if because.iter().enumerate().any(|(j, other)| i != j && reason == other) {
                    for word in
                        [" not ", " fail", " loses", " gains", " better ", " worse ", " little", " well"]
                    {
                        let quoted = reason
                            .replace("hardly better than persistence", "")
                            .replace("of the settings fail:", "");
                        assert!(!quoted.contains(word), "{}: '{word}' in {reason}", claim.claim);
                    }
                }
            }
        }
    }

    #[test]
    fn a_value_without_a_number_is_not_measured() {
        let plan = Plan::built_in(true).unwrap();
        let claim = plan.claims.iter().find(|claim| claim.experiment == "fig6").unwrap();
        let mut outcome = Outcome::default();
        for (output, value) in [("u", 1.0), ("v", f64::NAN)] {
            outcome.measure(&format!("lstm_low_{output}_better"), value);
        }
        let judged = alone(claim, &outcome);
        assert_eq!(judged.verdict, Holds::NotMeasured);
        let verdicts: Vec<Holds> = judged.measures.iter().map(|one| one.verdict).collect();
        assert_eq!(verdicts, [Holds::Reproduced, Holds::NotMeasured, Holds::NotMeasured]);
        assert!(judged.because.contains("v not measured") && !judged.because.contains("u 1"), "{judged:?}");
    }

    #[test]
    fn a_template_takes_values_percentages_outputs_and_words() {
        let mut outcome = Outcome::default();
        for (name, value) in [("u_x", 0.25), ("v_x", 1.0), ("r_x", 2.0)] {
            outcome.measure(name, value);
        }
        outcome.words.insert("which".to_owned(), "97 to 99".to_owned());
        let text = reason("a {u_x %}, {*_x}, {which}, {none}.", &outcome);
        assert_eq!(text, "a 25 %, 0.250 (u), 1.00 (v) and 2.00 (r), 97 to 99, –.");
    }
}
