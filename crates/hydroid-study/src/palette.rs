//! Titles, colours and line styles of the models.

use plotters::style::RGBColor;

use hydroid_report::figure::{Dash, Stroke};
use hydroid_report::style;

/// Prefix of the name, title and colour (Okabe and Ito 2008) of each kind of model.
const MODELS: [(&str, &str, RGBColor); 7] = [
    ("affine", "control-affine network", RGBColor(0x56, 0xb4, 0xe9)),
    ("lstm", "LSTM", RGBColor(0x00, 0x72, 0xb2)),
    ("gru", "GRU", RGBColor(0x00, 0x9e, 0x73)),
    ("rnn", "vanilla RNN", RGBColor(0xcc, 0x79, 0xa7)),
    ("polynomial", "SINDy (polynomials, differences)", RGBColor(0x86, 0x8e, 0x96)),
    ("direct", "direct predictor", RGBColor(0xd5, 0x5e, 0x00)),
    ("sindy", "SINDy (hydroid)", RGBColor(0xe6, 0x9f, 0x00)),
];

fn kind(model: &str) -> Option<&'static (&'static str, &'static str, RGBColor)> {
    MODELS.iter().find(|(start, ..)| model.starts_with(start))
}

pub(super) fn title(model: &str) -> String {
    kind(model).map_or_else(|| model.to_owned(), |(_, title, _)| (*title).to_owned())
}

pub(super) fn colour(model: &str) -> RGBColor {
    kind(model).map_or(style::MODEL, |(.., colour)| *colour)
}

pub(super) fn line(model: &str) -> Stroke {
    Stroke { colour: colour(model), width: 2.0, dash: Dash::Solid }
}

/// Line of a frozen, filtered or adapted model.
pub(super) fn way(way: &str, model: &str) -> Stroke {
    match way {
        "frozen" => style::PERSISTENCE_LINE,
        "state filtered" => Stroke { colour: style::MUTED, width: 1.4, dash: Dash::Dotted },
        _ => line(model),
    }
}
