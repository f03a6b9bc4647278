//! What was found, as one self-contained HTML page with figures.
//!
//! [`identification`] makes the page of an identification, [`steering`](fn@steering) that of a voyage. A page loads nothing from outside, needs no script,
//! and the same input gives the same bytes: what changes from run to run (a date, a duration) is in the
//! page only if the [`Context`] says so.
//!
//! [`figure`] draws, [`style`] holds what things look like; the other modules are the sections of the page,
//! in the order in which they stand there.

pub mod figure;
pub mod style;

mod coefficients;
mod data;
mod equations;
mod formula;
mod front;
mod growth;
mod hidden;
mod methods;
mod network;
pub mod number;
pub mod page;
mod predicted;
mod residuals;
mod rollouts;
mod selection;
mod series;
mod settings;
mod steering;
mod summary;

use equations::Sparse;
use figure::FigureError;
use hydroid::identify::{Candidate, IdentifyResult};
use hydroid::log::{Note, Split, Trajectory};

pub use steering::{Steered, steering};

/// What a report says beside the result itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Context {
    /// Heading of the page: the vessel, the occasion.
    pub title: String,
    /// The command line that makes the page again.
    pub command: String,
    /// The logs, as they were named.
    pub sources: Vec<String>,
    /// What was done to the logs when they were read.
    pub notes: Vec<Note>,
    /// Version of hydroid.
    pub hydroid: String,
    /// Seed of the run.
    pub seed: u64,
    /// Settings to be told, name and value, in this order.
    pub settings: Vec<(String, String)>,
    /// When and where the page was made, if that is to be told.
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

/// Why a page could not be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// A figure could not be written.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The runs are not those of the result.
    #[error("run '{run}' has other channels than the model: a report needs the runs that were identified")]
    OtherRuns {
        /// The run.
        run: String,
    },
}

/// What all sections are made from.
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

/// All runs of a split.
fn runs(split: &Split) -> impl Iterator<Item = &Trajectory> {
    split.train.iter().chain(&split.validation).chain(&split.test)
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
        let walks = rollouts::walk(candidate, &split.test);
        sections.extend(Sparse::of(candidate).map(|sparse| equations::section(sparse, &split.train)));
        sections.push(growth::section(candidate)?);
        sections.push(predicted::section(candidate, &walks)?);
        sections.push(residuals::section(candidate, &walks)?);
    }
    sections.push(data::section(&subject)?);
    sections.push(selection::section(&subject)?);
    sections.push(settings::section(&subject));
    Ok(page::page(&context.title, &sections))
}

#[cfg(test)]
mod tests;
