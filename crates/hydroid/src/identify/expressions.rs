//! Terms, constraints and channel names in the options.

use hydroid_core::model::sparse::{Shape, Term};

use super::{IdentifyError, SindyOptions};
use crate::key::key;
use crate::log::{Channel, Trajectory};
use crate::sindy::expression::{list, nearest};
use crate::sindy::{Constraint, ExpressionParser, Library, Variables, dissipative, is_supported};

impl SindyOptions {
    /// The listed terms.
    ///
    /// # Errors
    /// If a text is not a term of the outputs and inputs of a run.
    pub fn listed(&self, run: &Trajectory) -> Result<Vec<Term>, IdentifyError> {
        let mut parser = parser_for(run);
        let mut terms = Vec::new();
        for text in &self.terms {
            let term =
                parser.term(text).map_err(|error| IdentifyError::Expression { key: "terms", error })?;
            refuse_signals(&parser, "terms", text)?;
            if !terms.contains(&term) {
                terms.push(term);
            }
        }
        Ok(terms)
    }

    pub(super) fn lists_gates(&self, run: &Trajectory) -> Result<bool, IdentifyError> {
        let is_gate = |shape: Shape| matches!(shape, Shape::Above(_) | Shape::Below(_));
        Ok(self.listed(run)?.iter().any(|term| term.factors().iter().any(|f| is_gate(f.shape))))
    }

    /// Constraints on the coefficients.
    ///
    /// # Errors
    /// If a text is not a constraint, the solver does not support it, or no library has its term.
    pub fn coefficient_constraints(
        &self,
        run: &Trajectory,
        libraries: &[Library],
    ) -> Result<Vec<Constraint>, IdentifyError> {
        let (mut parser, variables) = (parser_for(run), Variables::of(run));
        let mut known: Vec<Term> = Vec::new();
        if !self.constraints.is_empty() {
            // Libraries that are too large to search are skipped.
            let small = libraries.iter().filter(|library| library.count(&variables) < 2_000);
            known = small.flat_map(|library| library.terms(&variables)).collect();
        }
        let mut rules = Vec::new();
        for text in &self.constraints {
            let rule = parser
                .constraint(text)
                .map_err(|error| IdentifyError::Expression { key: "constraints", error })?;
            refuse_signals(&parser, "constraints", text)?;
            let of = |why: String| IdentifyError::Constraint { text: text.clone(), why };
            if !is_supported(&rule) {
                return Err(of(String::from(
                    "an inequality must compare one coefficient with 0, as in u: u |u| <= 0; several coefficients and other numbers require =",
                )));
            }
            if let Some((_, lost)) = rule.sum.iter().find(|(_, at)| !known.contains(&at.term)) {
                let names = parser.names();
                let name = lost.term.name(&names);
                let all: Vec<String> = known.iter().map(|term| term.name(&names)).collect();
                let near = nearest(&name, all.iter().map(String::as_str));
                let hint = near.map_or_else(String::new, |near| format!(", did you mean '{near}'?"));
                return Err(of(format!(
                    "no library of the search has the term '{name}'{hint} Choose a library with this term (library), or list it (terms)"
                )));
            }
            rules.push(rule);
        }
        if self.dissipative {
            rules.extend(dissipative(&variables));
        }
        Ok(rules)
    }
}

fn parser_for(run: &Trajectory) -> ExpressionParser {
    let channels = run.outputs.channels().iter().chain(run.inputs.channels());
    ExpressionParser::new(channels.map(|c| c.name.clone()), run.outputs.width(), run.dt)
}

/// Refuses lag states and past values, which have separate options.
fn refuse_signals(parser: &ExpressionParser, option: &'static str, text: &str) -> Result<(), IdentifyError> {
    if parser.signals().is_empty() {
        return Ok(());
    }
    let why = format!(
        "{option} may contain outputs and inputs only. A lag is set separately, as in {}, and replaces its input in every term; past values are not supported",
        key("lag").is("n=1.5")
    );
    Err(IdentifyError::Constraint { text: text.to_owned(), why })
}

pub(super) fn channel_index(
    key: &'static str,
    what: &'static str,
    name: &str,
    channels: &[Channel],
) -> Result<usize, IdentifyError> {
    channels.iter().position(|channel| channel.name == name).ok_or_else(|| {
        let names: Vec<String> = channels.iter().map(|channel| channel.name.clone()).collect();
        let near = nearest(name, names.iter().map(String::as_str));
        IdentifyError::NoChannel {
            key,
            what,
            name: name.to_owned(),
            hint: near.map_or_else(|| String::from("."), |near| format!(", did you mean '{near}'?")),
            known: list(&names),
        }
    })
}
