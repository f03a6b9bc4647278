//! Colours and line styles of all figures and pages. The colours are those of Okabe and Ito (2008), which remain
//! distinct under colour vision deficiency.

use plotters::style::RGBColor;

use super::figure::{Dash, Stroke};
use hydroid::identify::Grade;

/// Text and measurements.
pub const INK: RGBColor = RGBColor(0x2b, 0x2f, 0x33);
/// Secondary text.
pub const MUTED: RGBColor = RGBColor(0x5b, 0x64, 0x6e);
/// Grid lines.
pub const GRID: RGBColor = RGBColor(0xe3, 0xe7, 0xeb);
/// Axes and zero lines.
pub const AXIS: RGBColor = RGBColor(0xa9, 0xb2, 0xba);
/// Model.
pub const MODEL: RGBColor = RGBColor(0x00, 0x72, 0xb2);
/// Band of the model.
pub const BAND: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
/// Persistence.
pub const PERSISTENCE: RGBColor = RGBColor(0x86, 0x8e, 0x96);
/// Commands.
pub const COMMAND: RGBColor = RGBColor(0xc4, 0x7f, 0x00);
/// Warnings.
pub const ALARM: RGBColor = RGBColor(0xd5, 0x5e, 0x00);

/// Series that are neither model nor measurement.
pub const SERIES: [RGBColor; 6] = [
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x99, 0x99, 0x99),
];

/// Parts of a split: training, validation, test.
pub const PARTS: [RGBColor; 3] = [PERSISTENCE, RGBColor(0x56, 0xb4, 0xe9), MODEL];

/// Width of a figure \[px\]: half of a desktop page, legible on a phone.
pub const WIDTH: f64 = 480.0;
/// Text size in figures \[px\].
pub const TEXT: f64 = 14.0;
/// Size of tick labels \[px\].
pub const SMALL: f64 = 13.0;

/// Measurements.
pub const MEASURED_LINE: Stroke = Stroke { colour: INK, width: 1.3, dash: Dash::Solid };
/// Model on test runs.
pub const MODEL_LINE: Stroke = Stroke { colour: MODEL, width: 2.0, dash: Dash::Solid };
/// Model on validation runs.
pub const VALIDATION_LINE: Stroke = Stroke { colour: MODEL, width: 1.6, dash: Dash::Dotted };
/// Persistence.
pub const PERSISTENCE_LINE: Stroke = Stroke { colour: PERSISTENCE, width: 1.8, dash: Dash::Dashed };
/// Commands.
pub const COMMAND_LINE: Stroke = Stroke { colour: COMMAND, width: 1.2, dash: Dash::Solid };

/// Word, symbol and style class of a grade.
pub const fn grade(grade: Grade) -> (&'static str, &'static str, &'static str) {
    match grade {
        Grade::Good => ("Good", "✓", "good"),
        Grade::Usable => ("Usable", "○", "usable"),
        Grade::NotIdentified => ("Not identified", "✕", "bad"),
        Grade::NotJudged => ("Not judged", "–", "bad"),
    }
}

/// Style sheet of a page.
pub const SHEET: &str = include_str!("style.css");

/// Script of the pages: values of curves under the pointer.
pub const SCRIPT: &str = include_str!("hover.js");
