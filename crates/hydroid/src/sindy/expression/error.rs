//! What is wrong with an expression, and where.

/// Text that is not an expression.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{text}', character {position}: {reason}")]
pub struct ExpressionError {
    /// The whole text.
    pub text: String,
    /// Where the reader stopped, in characters from 1 on.
    pub position: usize,
    /// What is wrong there, with what was expected and what there is.
    pub reason: String,
    /// The known name that is most like an unknown one, if one is like it.
    pub nearest: Option<String>,
}

/// The known name that is most like a word, if one is like it at all.
pub(crate) fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    let lower = word.to_lowercase();
    known
        .map(|name| (strsim::jaro_winkler(&name.to_lowercase(), &lower), name))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned())
}

/// Names for a message, the first of very many.
pub(crate) fn list(names: &[String]) -> String {
    const SHOWN: usize = 20;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} ... ({} in all)", names.len()) } else { shown }
}
