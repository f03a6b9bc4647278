//! Notes to the user on changes and defects of a log.

/// Severity of a note.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// For information: no data is lost.
    Info,
    /// The result may suffer.
    Warning,
}

/// A change or a defect of a log: cut, dropped, converted, resampled or noticed.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Note {
    /// Severity.
    pub severity: Severity,
    /// One sentence that names the file.
    pub message: String,
    /// Remedy for the user.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

impl Note {
    /// A note that needs no action.
    pub fn info(message: impl Into<String>) -> Self {
        Self { severity: Severity::Info, message: message.into(), remedy: None }
    }

    /// A note that the user should read.
    pub fn warning(message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, message: message.into(), remedy: None }
    }

    /// Adds a remedy.
    pub fn with_remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = Some(remedy.into());
        self
    }

    /// Whether the user should read it.
    pub fn is_warning(&self) -> bool {
        self.severity == Severity::Warning
    }
}

/// A number with the singular or plural of its noun.
pub(crate) fn count(n: usize, one: &str) -> String {
    if n == 1 { format!("1 {one}") } else { format!("{n} {one}s") }
}
