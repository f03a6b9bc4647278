//! Driving a model on a page: what the scripts of `hydroid-web` need of it, and the section with the driving view.

use hydroid::manoeuvre::{Comparison, Figure, Track, Trial, Trials};
use hydroid::model::Model;
use hydroid::plant::{self, InputMap, Motion};
use maud::{PreEscaped, html};
use serde_json::{Value, json};

use super::model_report::ModelReport;
use super::number::text;
use super::page::Section;

/// Points of a track on a page.
const POINTS: usize = 600;

/// A model for the driving view: name, length, channels with ranges, functions, and the commands that push and turn the vessel.
///
/// `motion` contains the places of surge, sway and yaw rate in the outputs, and is `null`, with the reason in `not_driven`, for a
/// model that predicts no motion. `map` is `null`, with the reason in `not_steered`, if no inputs push and turn the vessel.
pub fn vessel(model: &Model, map: Result<&InputMap, &str>, length_m: Option<f64>) -> Value {
    let d = &model.description;
    let motion = Motion::of(model);
    let rest: Vec<f64> = plant::rest(model);
    let zero = || {
        let values = plant::input_values(model).unwrap_or_default();
        values.iter().map(|value| value.neutral).collect()
    };
    let at_rest: Vec<f64> = map.map_or_else(|_| zero(), |map| map.command(0.0, 0.0));
    json!({
        "name": d.name,
        "title": model.title(),
        "dt": d.dt,
        "length_m": length_m
            .or_else(|| d.boat.particulars.length_in_logs())
            .or_else(|| model.craft()?.hull.size.map(|[length, ..]| length)),
        "judged_s": d.bands.as_ref().and_then(|bands| bands.horizons.last()).map(|&steps| steps as f64 * d.dt),
        "outputs": d.outputs,
        "inputs": d.inputs,
        "motion": motion.as_ref().ok().map(Motion::places),
        "rest": rest,
        "neutral": at_rest,
        "map": map.ok(),
        "notes": map.map_or_else(|_| Vec::new(), InputMap::notes),
        "functions": hydroid_export::functions(model),
        "not_driven": motion.err().map(|error| error.to_string()),
        "not_steered": map.err(),
    })
}

/// A trial for the driving view: title, speed and propulsion of the approach, figures with names and units, and the track;
/// `None` for a trial without a track.
pub fn trial(trial: &Trial, of: &Trials) -> Option<Value> {
    Some(json!({
        "title": trial.kind.title(&of.inputs),
        "approach_m_s": of.approach_speed_m_s,
        "approach_percent": of.propulsion.map(|propulsion| 100.0 * propulsion),
        "not_valid": trial.not_valid,
        "figures": trial.figures.iter().map(figure).collect::<Vec<Value>>(),
        "track": track(trial.tracks.first()?),
    }))
}

/// A trial in a log beside its prediction, for the driving view.
pub fn comparison(comparison: &Comparison) -> Value {
    let Comparison { run, at_s, trial, measured, predicted, in_training, current: [north, east], .. } =
        comparison;
    let figures = measured.iter().zip(predicted).filter(|(measured, _)| measured.value.is_some());
    let figures = figures.map(|(measured, predicted)| {
        let (label, unit) = measured.name_and_unit();
        json!({ "label": label, "unit": unit, "measured": measured.value, "predicted": predicted.value, "interval": predicted.interval })
    });
    let mut notes = Vec::new();
    if *in_training {
        notes.push(String::from("The model was fitted to a run of this name."));
    }
    if let Some(reason) = &comparison.tracks[1].not_valid {
        notes.push(format!("The prediction is not valid: {reason}."));
    }
    if [*north, *east] != [0.0; 2] {
        let (north, east) = (text(*north, 2), text(*east, 2));
        notes.push(format!("In an estimated current of {north} m/s north and {east} m/s east."));
    }
    json!({
        "title": format!("{run}, {at_s:.0} s: {}", trial.title()),
        "figures": figures.collect::<Vec<Value>>(),
        "tracks": comparison.tracks.each_ref().map(track),
        "note": notes.join(" "),
    })
}

fn figure(figure: &Figure) -> Value {
    let (label, unit) = figure.name_and_unit();
    json!({
        "label": label,
        "unit": unit,
        "value": figure.value,
        "missing": figure.missing(),
        "interval": figure.interval,
        "extrapolated": figure.extrapolated && figure.value.is_some(),
    })
}

/// Times since the order \[s\], positions, north and east \[m\], and velocities over ground, `u` and `v` \[m/s\] and `r` \[rad/s\].
fn track(track: &Track) -> Value {
    let step = track.len().div_ceil(POINTS).max(1);
    let point = |k: usize| {
        let ([x, y, _], [u, v, r]) = (track.eta[k], track.nu[k]);
        [track.time_s(k), x, y, u, v, r]
    };
    let last = track.len().saturating_sub(1);
    (0..last).step_by(step).chain([last]).filter(|&k| k < track.len()).map(|k| json!(point(k))).collect()
}

/// The section with the driving view, and the script that starts it.
pub(super) fn section(subject: &ModelReport<'_>) -> Section {
    let ModelReport { model, trials, comparisons, map, .. } = *subject;
    let stated = trials.ok().map(|trials| &trials.options);
    let length_m = stated.and_then(|options| Some(options.length_m? / options.scale));
    // Tracks of a ship have no place beside its model.
    let is_scaled = model.description.boat.particulars.scale.unwrap_or(1.0) != 1.0;
    let shown = |trials: &Trials| trials.trials.iter().filter_map(|one| trial(one, trials)).collect();
    let document = json!({
        "vessel": vessel(model, map, length_m),
        "trials": trials.ok().filter(|trials| trials.options.scale == 1.0).map_or_else(Vec::new, shown),
        "comparisons": comparisons.iter().filter(|_| !is_scaled).map(comparison).collect::<Vec<Value>>(),
    });
    // A text of the model cannot end the element.
    let document = document.to_string().replace('<', "\\u003c");
    let body = html! {
        div #driving {}
        script #vessel type="application/json" { (PreEscaped(document)) }
    };
    Section::new("drive", "Drive it", body)
}

/// The scripts of a page with the driving view.
pub(super) fn script() -> String {
    let mut script = String::from("\"use strict\";\n");
    script.extend(hydroid_web::DRIVING);
    script.push_str(include_str!("driving.js"));
    script
}

/// Its styles.
pub(super) fn style() -> String {
    [hydroid_web::UPLOT_STYLE, include_str!("driving.css"), hydroid_web::DRIVE_STYLE].concat()
}
