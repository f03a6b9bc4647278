//! Text form of libraries in tables and on the command line.

use std::fmt;
use std::str::FromStr;

use super::{Family, Library};

/// Families with their short names, in display order.
const NAMES: [(&str, Family); 8] = [
    ("marine", Family::Marine),
    ("marine cubic", Family::MarineCubic),
    ("x|x|", Family::SignedSquares),
    ("x|y|", Family::SignedProducts),
    ("trigonometric", Family::Trigonometric),
    ("inputs x outputs", Family::InputsTimesOutputs),
    ("rational", Family::Rational),
    ("constant", Family::Constant),
];

/// Unknown library.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "there is no library '{word}'{}: write one or several of degree N, marine, marine cubic, x|x|, x|y|, trigonometric, inputs x outputs, rational, joined by +, and optionally ', no constant' at the end",
    nearest.as_ref().map_or_else(String::new, |name| format!(", did you mean '{name}'?"))
)]
pub struct UnknownLibrary {
    /// The unknown part.
    pub word: String,
    /// The most similar known name, if any.
    pub nearest: Option<String>,
}

impl fmt::Display for Library {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut words: Vec<String> = Vec::new();
        for family in &self.families {
            if let Family::Polynomial { degree } = family {
                words.push(format!("degree {degree}"));
            }
        }
        let constant = self.families.contains(&Family::Constant);
        for (name, family) in NAMES {
            if family != Family::Constant && self.families.contains(&family) {
                words.push(name.to_owned());
            }
        }
        let mut listed = 0;
        for family in &self.families {
            if let Family::Listed(terms) = family {
                listed += terms.len();
            }
        }
        match (words.is_empty(), listed) {
            (true, 0) => return f.write_str(if constant { "constant" } else { "empty" }),
            (_, 0) => {}
            (_, 1) => words.push(String::from("1 listed term")),
            _ => words.push(format!("{listed} listed terms")),
        }
        let only_listed = words.len() == 1 && listed > 0;
        f.write_str(&words.join(" + "))?;
        match (only_listed, constant) {
            (true, true) => f.write_str(" + constant"),
            (false, false) => f.write_str(", no constant"),
            _ => Ok(()),
        }
    }
}

impl FromStr for Library {
    type Err = UnknownLibrary;

    /// Parses the output of `Display` without listed terms; `-` and `_` replace spaces: `marine-cubic`.
    fn from_str(text: &str) -> Result<Self, UnknownLibrary> {
        let plain = text.to_lowercase().replace(['-', '_'], " ");
        let (families, constant) = match plain.split_once(',') {
            Some((families, "no constant" | " no constant")) => (families, false),
            Some((_, other)) => {
                let nearest = Some(String::from("no constant"));
                return Err(UnknownLibrary { word: other.trim().to_owned(), nearest });
            }
            None => (plain.as_str(), true),
        };
        let mut library = Self::default();
        if constant {
            library = library.with(Family::Constant);
        }
        for part in families.split('+') {
            library = library.with(family(part)?);
        }
        Ok(library)
    }
}

fn family(part: &str) -> Result<Family, UnknownLibrary> {
    let word = part.split_whitespace().collect::<Vec<_>>().join(" ");
    let squeezed = word.replace(' ', "");
    if let Some((_, family)) = NAMES.iter().find(|(name, _)| name.replace(' ', "") == squeezed) {
        return Ok(family.clone());
    }
    for start in ["degree", "polynomial"] {
        if let Some(degree) = squeezed.strip_prefix(start).and_then(|degree| degree.parse().ok()) {
            return Ok(Family::Polynomial { degree });
        }
    }
    let known = NAMES.iter().map(|(name, _)| *name).chain(["degree 1", "degree 2", "degree 3"]);
    let nearest = known
        .map(|name| (strsim::jaro_winkler(name, &word), name))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned());
    Err(UnknownLibrary { word, nearest })
}
