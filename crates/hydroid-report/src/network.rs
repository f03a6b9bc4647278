//! The section on the networks and their training.

use maud::{Markup, html};

use super::figure::{Dash, Figure, Key, Line, Mark, Panel, Points, Sign, Stroke};
use super::number::{self, fixed};
use super::page::{Section, cell, columns, figure, table};
use super::{ReportError, Subject, style};
use hydroid::identify::Candidate;
use hydroid::train::{Ending, Refit, Trained};

pub(super) fn section(subject: &Subject<'_>) -> Result<Option<Section>, ReportError> {
    let networks: Vec<(&Candidate, &Trained)> = subject
        .result
        .candidates
        .iter()
        .filter_map(|candidate| Some((candidate, candidate.training.network()?.as_ref())))
        .collect();
    if networks.is_empty() {
        return Ok(None);
    }
    let caption = html! {
        "Loss on training windows and validation error, mean over all outputs, after each epoch of the chosen restart. Both vertical axes are logarithmic. "
        "The ring marks the epoch of the chosen weights. A rising validation error with a falling loss means overfitting."
    };
    let chart = figure(&chart(&networks).svg()?, &caption);
    let body = html! {
        p {
            "A network is trained on the training runs and needs no equations. A recurrent network has a hidden state, which represents "
            "unmeasured quantities. A direct predictor receives the last samples and predicts its whole horizon at once."
        }
        (columns(&[chart, html! { @for (candidate, trained) in &networks { (about(candidate, trained)) } }]))
        (summary(&networks))
        (ranges(subject))
    };
    Ok(Some(Section::new("networks", "Networks", body)))
}

fn about(candidate: &Candidate, trained: &Trained) -> Markup {
    html! {
        h4 { (candidate.model.description.name) }
        ul {
            @for line in candidate.model.network_text() { li { (line) } }
            li {
                (number::count(candidate.model.weights())) " weights, from " (ending(trained))
                @if learned_from_all(trained) { "; then trained again on training and validation runs together" }
            }
        }
    }
}

/// Whether the delivered model was also trained on the validation runs.
fn learned_from_all(trained: &Trained) -> bool {
    trained.refit.as_ref().is_some_and(Refit::is_taken)
}

fn ending(trained: &Trained) -> String {
    let epochs = number::count(trained.history.len());
    let why = match trained.ending {
        Ending::Done => "all planned epochs",
        Ending::Patience => "stopped because the validation error no longer improved",
        Ending::Budget => "stopped by the time limit",
    };
    format!("epoch {} of {epochs} ({why})", number::count(trained.best_epoch))
}

fn summary(networks: &[(&Candidate, &Trained)]) -> Markup {
    let heads =
        ["network", "weights", "epochs", "best epoch", "loss there", "validation", "restarts"].map(cell);
    let rows: Vec<Vec<Markup>> = networks
        .iter()
        .map(|(candidate, trained)| {
            let best = trained.history.get(trained.best_epoch.saturating_sub(1));
            vec![
                cell(&candidate.model.description.name),
                cell(number::count(candidate.model.weights())),
                cell(number::count(trained.history.len())),
                cell(number::count(trained.best_epoch)),
                cell(number::text(best.map_or(f64::NAN, |epoch| epoch.train_loss), 3)),
                cell(fixed(trained.validation, 4)),
                restarts(trained),
            ]
        })
        .collect();
    html! {
        (table(&heads, &rows, 1))
        p.small {
            "Loss: root mean square error over the compared part of the training windows, in standard deviations of the output, mean over outputs. "
            "Validation: mean NRMSE of rollouts over all outputs and horizons. "
            "Restarts: trainings from different initial weights, each with its smallest validation error; the chosen one is bold."
        }
    }
}

fn restarts(trained: &Trained) -> Markup {
    html! {
        @for (i, value) in trained.restarts.iter().enumerate() {
            @if i > 0 { ", " }
            @if i == trained.restart && trained.restarts.len() > 1 { b { (fixed(*value, 4)) } }
            @else { (fixed(*value, 4)) }
        }
    }
}

fn ranges(subject: &Subject<'_>) -> Markup {
    let of = |given: bool| -> Vec<&str> {
        let all = subject.result.ranges.iter();
        all.filter(|range| range.given == given).map(|range| range.channel.name.as_str()).collect()
    };
    let (given, inferred) = (of(true), of(false));
    html! {
        p.small {
            "Networks are scaled by design ranges. "
            @if !given.is_empty() { "Stated: " (given.join(", ")) ". " }
            @if !inferred.is_empty() {
                "Not stated, and therefore taken from the training runs: " (inferred.join(", ")) "."
            }
        }
    }
}

pub(super) fn choice(trained: &Trained) -> Markup {
    html! {
        p {
            "The weights are those of " (ending(trained)) ". After each epoch the network was rolled out on the validation runs. "
            "The epoch with the smallest mean NRMSE over all outputs and horizons was chosen. The test runs did not influence the choice. "
            "A training window contains " (number::count(trained.wash_out)) " samples before its origin, for the history or the hidden state, and "
            (number::count(trained.window)) " samples that are compared."
            @if learned_from_all(trained) {
                " The model was then trained again on training and validation runs together, and has the final weights of this training. "
                "The stated validation errors are those of the network before, which was not trained on the validation runs."
            }
        }
    }
}

fn chart(networks: &[(&Candidate, &Trained)]) -> Figure {
    let stroke =
        |i: usize| Stroke { colour: style::SERIES[i % style::SERIES.len()], width: 1.8, dash: Dash::Solid };
    let mut figure = Figure::new("Training of the networks, epoch by epoch", "epoch");
    for (label, of) in [
        ("loss", (|epoch| epoch.train_loss) as fn(&hydroid::train::Epoch) -> f64),
        ("validation NRMSE", |epoch| epoch.validation),
    ] {
        let mut panel = Panel::new(label).height(150.0).decades();
        for (i, (_, trained)) in networks.iter().enumerate() {
            let points: Vec<(f64, f64)> = trained
                .history
                .iter()
                .enumerate()
                .map(|(k, epoch)| ((k + 1) as f64, of(epoch).log10()))
                .map(|(x, y)| (x, if y.is_finite() { y } else { f64::NAN }))
                .collect();
            let best = points.get(trained.best_epoch.saturating_sub(1)).copied();
            panel = panel.mark(Mark::Line(Line::new(points, stroke(i))));
            panel = panel.mark(Mark::Points(Points {
                points: best.into_iter().filter(|(_, y)| y.is_finite()).collect(),
                sign: Sign::Ring,
                colour: stroke(i).colour,
                radius: 5.0,
                label: None,
            }));
        }
        figure = figure.panel(panel);
    }
    for (i, (candidate, _)) in networks.iter().enumerate() {
        figure = figure.key(Key::Line(stroke(i)), candidate.model.description.name.clone());
    }
    figure
}
