//! Sentences on actuator lags and gates of the equations.

use hydroid_core::model::sparse::Signal;
use maud::{Markup, html};

use super::equations::Sparse;
use super::formula::variable;
use super::number::{self, seconds_text};
use hydroid::identify::Candidate;
use hydroid::log::Trajectory;
use hydroid::model::NamedGate;

/// A sentence for each lag and gate in the equations; `runs` are the training runs.
pub(super) fn sentences(sparse: Sparse<'_>, names: &[&str], runs: &[Trajectory]) -> Markup {
    let Sparse { candidate, motion, .. } = sparse;
    let equations = motion.equations();
    let first = equations.outputs() + equations.inputs();
    let used = |variable: usize| {
        let terms = equations.terms().iter().enumerate();
        let active = |j: usize| (0..equations.outputs()).any(|i| equations.coefficient(i, j) != 0.0);
        terms
            .filter(|(j, _)| active(*j))
            .any(|(_, term)| term.factors().iter().any(|f| usize::from(f.variable) == variable))
    };
    let lags: Vec<(usize, f64)> = (first..)
        .zip(equations.signals())
        .filter(|(place, _)| used(*place))
        .filter_map(|(_, signal)| match *signal {
            Signal::Lag { input, time_constant_s } => Some((usize::from(input), time_constant_s.0)),
            Signal::Past { .. } => None,
        })
        .collect();
    let modes = motion.modes();
    let gates = modes.gates();
    html! {
        @if !(lags.is_empty() && gates.is_empty()) {
            ul.hidden {
                @for (input, time_constant_s) in lags {
                    li {
                        (variable(names[input])) " acts through a first-order lag of " b { (number::text(time_constant_s, 3)) " s" }
                        ", " (origin(candidate, "lag")) ". The state of the actuator is not measured; the model simulates it."
                    }
                }
                @for named in gates { li { (gate(candidate, named, names, runs)) } }
            }
        }
    }
}

fn gate(candidate: &Candidate, named: &NamedGate, names: &[&str], runs: &[Trajectory]) -> Markup {
    let port = &candidate.model.description.outputs.get(named.variable);
    let unit = port.map_or("", |port| port.channel.unit.as_str());
    let unit = if unit.is_empty() { String::new() } else { format!("\u{a0}{}", number::unit(unit)) };
    let share = port.and_then(|_| share_above(named, runs));
    html! {
        "The equations change at " (variable(names[named.variable])) " = " b { (number::text(named.gate.centre.0, 3)) (unit) }
        ", over about ±" (number::text(named.half_width(), 1)) (unit) " (10 to 90 %), " (origin(candidate, "gate")) "."
        @if let Some(share) = share {
            " In the training runs the vessel is " (seconds_text((100.0 * share).round())) " % of the time above and "
            (seconds_text((100.0 - 100.0 * share).round())) " % below."
        }
    }
}

fn share_above(named: &NamedGate, runs: &[Trajectory]) -> Option<f64> {
    let (mut above, mut all) = (0usize, 0usize);
    for value in runs.iter().flat_map(|run| run.outputs.column(named.variable)).filter(|v| v.is_finite()) {
        above += usize::from(value > named.gate.centre.0);
        all += 1;
    }
    (all > 0).then(|| above as f64 / all as f64)
}

/// Whether a setting was identified or given, as the model description states.
fn origin(candidate: &Candidate, key: &str) -> &'static str {
    let asked = &candidate.model.description.provenance.settings["asked"][key];
    if asked.is_object() { "as given" } else { "found in these logs" }
}
