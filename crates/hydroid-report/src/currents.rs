//! Currents of the training runs, and what models of the motion through the water gain.

use maud::{Markup, html};

use super::number::ratio;
use super::page::{cell, readable, table};
use hydroid::identify::{Candidate, CurrentsFound, FrameErrors, IdentifyResult, RunCurrent};

/// Half-width of an interval of 90 % of a normal distribution, in standard deviations.
const INTERVAL_90: f64 = 1.645;

/// The table of the currents with a remark on each method; nothing if models of the motion through the water were not
/// tried.
pub(super) fn currents(result: &IdentifyResult) -> Markup {
    let tried = |found: &&CurrentsFound| {
        let in_water = |candidate: &Candidate| candidate.model.description.current.is_some();
        !found.methods.is_empty() || result.candidates.iter().any(in_water)
    };
    let Some(found) = result.currents.as_ref().filter(tried) else { return html! {} };
    // No negative zero.
    let rounded = |x: f64| format!("{:.2}", (100.0 * x).round() / 100.0 + 0.0).replace('-', "−");
    let component =
        |value: f64, deviation: f64| cell(format!("{} ± {:.2}", rounded(value), INTERVAL_90 * deviation));
    let row = |run: &RunCurrent| {
        let [north, east] = run.deviations_m_s;
        let name = html! { span.name { (readable(&run.run)) } };
        vec![name, component(run.north_m_s, north), component(run.east_m_s, east)]
    };
    let rows: Vec<Vec<Markup>> = found.runs.iter().map(row).collect();
    html! {
        h3 { "Currents" }
        (table(&[cell("run"), cell("north [m/s]"), cell("east [m/s]")], &rows, 1))
        p.small {
            "One current for each run, estimated along with a model of the motion through the water, with intervals of 90 %. "
            @for FrameErrors { method, over_ground, through_water, taken } in &found.methods {
                "The model " span.name { (method) }
                @if *taken { " predicts the motion through the water" } @else { " stays over ground" }
                ": its cross-validated error is " (ratio(*through_water)) " through the water and " (ratio(*over_ground)) " over ground. "
            }
        }
    }
}
