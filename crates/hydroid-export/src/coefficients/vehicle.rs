//! Data of the templates of MSS.

use super::literal::Literal;
use super::numbers::short;
use crate::name::comment;

/// The data of the templates by their names there.
pub(super) struct Vehicle {
    pub(super) title: String,
    pub(super) commands: Vec<String>,
    pub(super) positions: Vec<String>,
    pub(super) data: Vec<(&'static str, Literal)>,
    /// Equations of motion in Python and MATLAB; none for a vessel.
    pub(super) accelerations: Option<[String; 2]>,
}

impl Vehicle {
    /// A template in Python (0) or MATLAB (1) with the data.
    pub(super) fn fill(&self, template: &str, name: &str, language: usize) -> String {
        let literal = [Literal::python, Literal::matlab][language];
        let prefix = ["", "%  "][language];
        let lines = |lines: &[String]| {
            let lines: Vec<String> = lines.iter().map(|line| format!("{prefix}  {line}")).collect();
            lines.join("\n")
        };
        let mut text = String::new();
        let mut rest = template;
        // Names in the inserted text are not replaced.
        while let Some((before, after)) = rest.split_once('@') {
            text.push_str(before);
            let Some((key, after)) = after.split_once('@') else { break };
            match key {
                "CLASS" => text.push_str(name),
                "TITLE" => text.push_str(&self.title),
                "VERSION" => text.push_str(env!("CARGO_PKG_VERSION")),
                "COMMANDS" => text.push_str(&lines(&self.commands)),
                "POSITIONS" => text.push_str(&lines(&self.positions)),
                "ACCELERATIONS" => text.extend(self.accelerations.as_ref().map(|of| of[language].as_str())),
                key => {
                    let found = self.data.iter().find(|(known, _)| *known == key);
                    text.push_str(&found.map(|(_, value)| literal(value)).unwrap_or_default());
                }
            }
            rest = after;
        }
        text.push_str(rest);
        text
    }
}

/// A command.
pub(super) struct Channel<'a> {
    pub(super) name: &'a str,
    pub(super) unit: &'a str,
    pub(super) limits: [f64; 2],
    pub(super) neutral: f64,
}

/// Adds the commands to the data, and describes them line by line.
pub(super) fn describe<'a>(
    channels: impl Iterator<Item = Channel<'a>>,
    data: &mut Vec<(&'static str, Literal)>,
) -> Vec<String> {
    let (mut lines, mut records) = (Vec::new(), Vec::new());
    for Channel { name, unit, limits: [low, high], neutral } in channels {
        let (name, unit) = (comment(name), comment(unit));
        let (low_text, high_text, neutral_text) = (short(low), short(high), short(neutral));
        lines.push(format!("{name} ({unit}, {low_text} to {high_text}, {neutral_text})"));
        records.push(Literal::Record(vec![
            ("name", Literal::Text(name)),
            ("unit", Literal::Text(unit)),
            ("low", Literal::Number(low)),
            ("high", Literal::Number(high)),
            ("neutral", Literal::Number(neutral)),
        ]));
    }
    data.push(("INPUTS", Literal::Number(lines.len() as f64)));
    data.push(("COMMAND_DATA", Literal::List(records)));
    lines
}
