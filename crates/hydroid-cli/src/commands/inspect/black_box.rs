//! `hydroid inspect` on a black box.

use std::path::Path;

use hydroid::log::Note;
use hydroid_live::black_box::Summary;

use crate::args::Global;
use crate::ui;

const EVENTS_SHOWN: usize = 100;

pub fn json(file: &Path, summary: &Summary) -> anyhow::Result<serde_json::Value> {
    let mut document = serde_json::to_value(summary)?;
    document["file"] = serde_json::to_value(file)?;
    document["kind"] = "black_box".into();
    Ok(document)
}

pub fn show(file: &Path, summary: &Summary, global: Global) {
    let head = &summary.head;
    let [first, last] = summary.t;
    let span = if summary.samples == 0 {
        "empty".to_owned()
    } else {
        format!("{} samples from {first:.2} to {last:.2} s", summary.samples)
    };
    outln!("{}: black box of hydroid {}, {span}", file.display(), head.hydroid);
    if summary.sessions > 1 {
        outln!(
            "{} segments in time: between them the service was restarted or could not write",
            summary.sessions
        );
    }
    let [name, kind] = &head.named;
    outln!("model '{name}' ({kind}), file {}, fingerprint {}", head.model.file, head.model.fingerprint);
    outln!("from {}, sample time {} s", head.runs.join(", "), head.dt);
    let channels = |channels: &[hydroid::log::Channel]| {
        let named = channels.iter().map(|channel| format!("{} [{}]", channel.name, channel.unit));
        named.collect::<Vec<_>>().join(", ")
    };
    outln!("outputs {}; inputs {}", channels(&head.outputs), channels(&head.inputs));
    outln!("settings:");
    if let Some(learning) = head.settings["learning"].as_object() {
        for (key, value) in learning {
            outln!("  {key} {value}");
        }
    }
    let o = summary.outcomes;
    outln!(
        "samples: {} accepted, {} with reduced weight, {} rejected, {} rolled back, {} waiting",
        o.accepted,
        o.inflated,
        o.rejected,
        o.rolled_back,
        o.waiting
    );
    let [adapted, reference, unguarded] = summary.predicted_by;
    if adapted + reference + unguarded > 0 {
        outln!(
            "predictions: {adapted} by the adapted model, {reference} by the reference model, {unguarded} by the unguarded model"
        );
    }
    let known = |x: f64| if x.is_nan() { "unknown".to_owned() } else { format!("{x:.4e}") };
    let [nis, t] = summary.largest_nis;
    let at = if nis.is_nan() { String::new() } else { format!(" at {t:.2} s") };
    outln!(
        "filter: smallest variance {}, smallest ratio S/R {}, largest normalized innovation squared {}{at}",
        known(summary.least_variance),
        known(summary.min_s_over_r),
        known(nis)
    );
    outln!("{}", if summary.events.is_empty() { "no events" } else { "events:" });
    let left = summary.events.len().saturating_sub(EVENTS_SHOWN);
    if left > 0 {
        outln!("  .. {left} earlier events (all with --json)");
    }
    for event in &summary.events[left..] {
        outln!("  {:>10.2} s  {:<11} {}", event.t, event.action, event.text);
    }
    let mut notes = Vec::new();
    if summary.torn > 0 {
        notes.push(Note::info(format!(
            "{} of {} segments skipped: incomplete or damaged",
            summary.torn, head.segments
        )));
    }
    if summary.damaged {
        notes.push(
            Note::warning("the file is damaged: the records after the damage are skipped")
                .with_remedy("copy the file again from its source"),
        );
    }
    ui::print_notes(&notes, global);
}
