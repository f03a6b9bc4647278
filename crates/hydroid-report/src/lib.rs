//! Reports: self-contained HTML pages with figures.
//!
//! [`identification`] writes the page of an identification, [`closed_loop`](fn@closed_loop) that of a closed-loop run,
//! [`manoeuvres`] that of manoeuvring trials, [`model_report()`] that of a model, in which the model can be driven.
//! [`driving`] is what a page needs to drive a model.
//! A page loads no external resources; an inline script shows the values of curves. The same input gives the same
//! bytes: date and duration are on the page only if the [`Context`] contains them.
//!
//! [`figure`] draws, [`style`] holds colours and line styles, and each other module is a section of a page.

#![allow(missing_docs, clippy::missing_errors_doc, reason = "its users are the programs of hydroid")]

pub mod figure;
pub mod style;

mod closed_loop;
mod coefficients;
mod comparison;
mod currents;
mod data;
pub mod driving;
mod equations;
#[doc(hidden)]
pub mod formula;
#[doc(hidden)]
pub mod front;
mod growth;
mod hidden;
mod manoeuvre;
mod methods;
mod model_report;
mod network;
pub mod number;
pub mod page;
mod predicted;
#[doc(hidden)]
pub mod residuals;
mod rollouts;
mod selection;
mod series;
mod settings;
mod summary;

use equations::Sparse;
use figure::FigureError;
use hydroid::atomic::WriteError;
use hydroid::identify::{Candidate, IdentifyResult};
use hydroid::log::{Note, Split, Trajectory};

pub use closed_loop::{ClosedLoopReport, closed_loop};
pub use comparison::{ComparisonReport, comparisons};
pub use manoeuvre::{ManoeuvreReport, manoeuvres, simulated_track};
pub use model_report::{ModelReport, model_report};

/// Content of a report in addition to the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Context {
    /// Heading of the page.
    pub title: String,
    /// Command line that reproduces the page.
    pub command: String,
    /// Names of the logs.
    pub sources: Vec<String>,
    /// Notes from reading the logs.
    pub notes: Vec<Note>,
    pub hydroid: String,
    /// Seed of the run.
    pub seed: u64,
    /// Settings, name and value.
    pub settings: Vec<(String, String)>,
    /// Date and place for the page, if any.
    pub made: Option<String>,
}

impl Default for Context {
    fn default() -> Self {
        Self {
            title: String::from("Identification"),
            command: String::new(),
            sources: Vec::new(),
            notes: Vec::new(),
            hydroid: env!("CARGO_PKG_VERSION").to_owned(),
            seed: 0,
            settings: Vec::new(),
            made: None,
        }
    }
}

/// Errors of a report.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    #[error(transparent)]
    Figure(#[from] FigureError),
    #[error("run '{run}' has other channels than the model: a report needs the runs that were identified")]
    OtherRuns { run: String },
}

/// Errors of writing a report with its data into a folder.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Write(#[from] WriteError),
}

struct Subject<'a> {
    result: &'a IdentifyResult,
    split: &'a Split,
    context: &'a Context,
    /// The best candidate, or the first.
    candidate: Option<&'a Candidate>,
}

impl<'a> Subject<'a> {
    fn new(result: &'a IdentifyResult, split: &'a Split, context: &'a Context) -> Result<Self, ReportError> {
        let candidate = result.best.and_then(|i| result.candidates.get(i)).or(result.candidates.first());
        if let Some(candidate) = candidate {
            let description = &candidate.model.description;
            let fits = |run: &&Trajectory| {
                run.outputs.width() == description.outputs.len()
                    && run.inputs.width() == description.inputs.len()
            };
            if let Some(other) = runs(split).find(|run| !fits(run)) {
                return Err(ReportError::OtherRuns { run: other.name.clone() });
            }
        }
        Ok(Self { result, split, context, candidate })
    }
}

fn runs(split: &Split) -> impl Iterator<Item = &Trajectory> {
    split.train.iter().chain(&split.validation).chain(&split.test)
}

/// The runs on which a model is judged.
fn judged_on(candidate: &Candidate) -> &'static str {
    if candidate.test.is_some() { "the test runs" } else { "runs that were left out" }
}

/// The page of an identification: `result` and the `split` it came from.
///
/// # Errors
/// If the split is not the one of the result, or a figure cannot be written.
pub fn identification(
    result: &IdentifyResult,
    split: &Split,
    context: &Context,
) -> Result<String, ReportError> {
    let subject = Subject::new(result, split, context)?;
    let mut sections = vec![summary::section(&subject)];
    sections.extend(methods::section(&subject));
    sections.extend(network::section(&subject)?);
    if let Some(candidate) = subject.candidate {
        let rollouts = rollouts::roll_out(candidate, result, split);
        sections.extend(Sparse::of(candidate).map(|sparse| equations::section(sparse, &split.train)));
        sections.push(growth::section(candidate)?);
        sections.push(predicted::section(candidate, &rollouts)?);
        sections.push(residuals::section(candidate, &rollouts)?);
    }
    sections.push(data::section(&subject)?);
    sections.push(selection::section(&subject)?);
    sections.push(settings::section(&subject));
    Ok(page::page(&context.title, &sections))
}
