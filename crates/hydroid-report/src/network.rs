//! Networks: what each is, and how its training went.

use maud::{Markup, html};

use super::figure::{Dash, Figure, Key, Line, Mark, Panel, Points, Sign, Stroke};
use super::number::{self, fixed};
use super::page::{Section, cell, columns, figure, table};
use super::{ReportError, Subject, style};
use hydroid::identify::Candidate;
use hydroid::train::{Ending, Refit, Trained};

/// The section; nothing where no network was trained.
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
        "The loss on training windows and the validation error after each epoch, of the restart that was kept; both axes are logarithmic upwards. "
        "The ring marks the epoch whose weights the model has. A validation error that rises while the loss falls is a network that learns the training runs by heart."
    };
    let chart = figure(&chart(&networks).svg()?, &caption);
    let body = html! {
        p {
            "A network learns from the training runs how the vessel moves, without equations. In a recurrent one a state of its own, "
            "which it carries from sample to sample, stands for what is not measured; a direct predictor sees the last samples, "
            "and gives all of its horizon at once."
        }
        (columns(&[chart, html! { @for (candidate, trained) in &networks { (about(candidate, trained)) } }]))
        (summary(&networks))
        (ranges(subject))
    };
    Ok(Some(Section::new("networks", "Networks", body)))
}

/// What a network is, in a list.
fn about(candidate: &Candidate, trained: &Trained) -> Markup {
    html! {
        h4 { (candidate.model.description.name) }
        ul {
            @for line in candidate.model.network_text() { li { (line) } }
            li {
                (number::count(candidate.model.weights())) " weights, of " (ending(trained))
                @if learned_from_all(trained) { ", then trained again on training and validation runs together" }
            }
        }
    }
}

/// Whether the model has learned from the validation runs as well.
fn learned_from_all(trained: &Trained) -> bool {
    trained.refit.as_ref().is_some_and(Refit::is_taken)
}

fn ending(trained: &Trained) -> String {
    let epochs = number::count(trained.history.len());
    let why = match trained.ending {
        Ending::Done => "all that were planned",
        Ending::Patience => "after which validation had long not improved",
        Ending::Budget => "when the time was over",
    };
    format!("epoch {} of {epochs}, {why}", number::count(trained.best_epoch))
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
            "Loss: root mean square error over the compared part of the training windows, 1 being the standard deviation of an output, in the mean over outputs. "
            "Validation: mean NRMSE of rollouts over all outputs and horizons. "
            "Restarts: the same training from other first weights; the least validation error of each, the one that was kept in bold."
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

/// Which ranges were stated.
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
                "Taken from the training runs, because none was stated (--range): " (inferred.join(", ")) "."
            }
        }
    }
}

/// How a network was chosen, in place of the trials of a search.
pub(super) fn choice(trained: &Trained) -> Markup {
    html! {
        p {
            "The weights are those of " (ending(trained)) ": after each epoch the network was rolled out on the validation runs, "
            "and the epoch with the least mean NRMSE over all outputs and horizons was kept. The test runs had no say. "
            "A window sees, or lets the state find itself over, " (number::count(trained.wash_out)) " samples before its origin, and compares "
            (number::count(trained.window)) "."
            @if learned_from_all(trained) {
                " Then the same training was made once more on training and validation runs together, to its end: the model "
                "has the weights of that. Its errors on the validation runs are those of the network before, which had not "
                "learned from them."
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
