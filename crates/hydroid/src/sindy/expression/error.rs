//! Errors of the expression parser.

/// Invalid expression.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{text}', character {position}: {reason}")]
pub struct ExpressionError {
    /// The whole text.
    pub text: String,
    /// Position of the error in characters, from 1.
    pub position: usize,
    /// Cause, with the expected and the found text.
    pub reason: String,
    /// The known name most similar to an unknown one, if any.
    pub nearest: Option<String>,
}

pub(crate) fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    let lower = word.to_lowercase();
    known
        .map(|name| (strsim::jaro_winkler(&name.to_lowercase(), &lower), name))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned())
}

pub(crate) fn list(names: &[String]) -> String {
    const SHOWN: usize = 20;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} ... ({} in all)", names.len()) } else { shown }
}
