//! Parser of terms and constraints in the notation of `Term::name` and `Signal::name`.

mod constraint;
mod error;
mod scanner;
mod term;

use hydroid_core::model::sparse::{Signal, Term};

use crate::log::Trajectory;

pub use constraint::{Coefficient, Constraint, Relation};
pub use error::ExpressionError;
pub(crate) use error::{list, nearest};

use scanner::Scanner;

/// Parser with its channels and the signals that parsed expressions require.
///
/// A term is a product, written with spaces or `*`, with an optional division: `1`, `u`, `u^2`, `u v`, `u |u|`,
/// `sin(delta)`, `cos(delta)`, `ln(u)`, `sgn(u)`, `v r/u`, `above(u, 2.5, 12)` and `below(u, 2.5, 12)` for the two
/// modes of a gate at 2.5 with slope 12. A lag state, `lag(n, 1.5 s)`, or a past value, `u(-0.5 s)`, can replace a
/// channel; times have a resolution of one millisecond.
///
/// ```
/// use hydroid::sindy::expression::ExpressionParser;
///
/// let mut parser = ExpressionParser::new(["u", "v", "r", "n", "delta"], 3, 0.1);
/// let term = parser.term("u |u| sin(lag(delta, 1.5 s))").unwrap();
/// assert_eq!(parser.signals().len(), 1);
/// assert_eq!(term.name(&parser.names()), "u |u| sin(lag(delta, 1.5 s))");
/// let wrong = parser.term("u sin(delt)").unwrap_err();
/// assert_eq!(
///     wrong.to_string(),
///     "'u sin(delt)', character 7: there is no channel 'delt', did you mean 'delta'? There are u, v, r, n, delta"
/// );
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ExpressionParser {
    channels: Vec<String>,
    outputs: usize,
    dt: f64,
    signals: Vec<Signal>,
}

impl ExpressionParser {
    /// Names of outputs, then inputs; the number of outputs; and the sample time \[s\] of past values.
    pub fn new(channels: impl IntoIterator<Item = impl Into<String>>, outputs: usize, dt: f64) -> Self {
        let channels = channels.into_iter().map(Into::into).collect();
        Self { channels, outputs, dt, signals: Vec::new() }
    }

    /// The channels and the sample time of a run.
    pub fn of(run: &Trajectory) -> Self {
        let (outputs, inputs) = (run.outputs.channels(), run.inputs.channels());
        Self::new(outputs.iter().chain(inputs).map(|channel| channel.name.clone()), outputs.len(), run.dt)
    }

    /// Adds existing signals.
    pub fn with_signals(self, signals: Vec<Signal>) -> Self {
        Self { signals, ..self }
    }

    /// The signals of the parsed expressions, in the order of their variables.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// Names of all variables: outputs, inputs, signals.
    pub fn names(&self) -> Vec<String> {
        let signals = self.signals.iter().map(|signal| signal.name(&self.channels, self.dt));
        self.channels.iter().cloned().chain(signals).collect()
    }

    /// Parses a term and adds its new signals.
    ///
    /// # Errors
    /// If the text is not a term of these channels; the error has the position, and no signal is added.
    pub fn term(&mut self, text: &str) -> Result<Term, ExpressionError> {
        self.parse_all(text, Self::product)
    }

    /// Parses a constraint on coefficients. `OUTPUT: TERM` denotes the coefficient of a term in the equation of an
    /// output: `u: u |u| <= 0`, `v: u r = u: v r`, `v: r - 2 r: v >= 0.1`.
    ///
    /// # Errors
    /// As [`term`](Self::term).
    pub fn constraint(&mut self, text: &str) -> Result<Constraint, ExpressionError> {
        self.parse_all(text, constraint::read)
    }

    fn parse_all<T>(
        &mut self,
        text: &str,
        read: impl FnOnce(&mut Self, &mut Scanner<'_>) -> Result<T, ExpressionError>,
    ) -> Result<T, ExpressionError> {
        let known = self.signals.len();
        let mut scanner = Scanner::new(text);
        let done = read(self, &mut scanner).and_then(|done| {
            scanner.skip_space();
            if scanner.is_at_end() { Ok(done) } else { Err(scanner.expected("the end, or one more factor")) }
        });
        if done.is_err() {
            self.signals.truncate(known);
        }
        done
    }
}
