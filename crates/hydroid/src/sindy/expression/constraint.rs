//! Constraints on coefficients, from text.

use std::fmt::Write as _;

use hydroid_core::model::sparse::Term;

use super::ExpressionParser;
use super::error::{ExpressionError, list, nearest};
use super::scanner::Scanner;

/// The coefficient of a term in the equation of an output.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Coefficient {
    /// Output of the equation.
    pub output: usize,
    /// Term of the coefficient.
    pub term: Term,
}

/// Relation of a sum of coefficients to its bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// `<=`
    AtMost,
    /// `>=`
    AtLeast,
    /// `=`
    Equal,
}

/// `sum factor x coefficient <= bound`, or `>=`, or `=`, on coefficients in physical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// Coefficients without duplicates, with non-zero factors; at least one.
    pub sum: Vec<(f64, Coefficient)>,
    /// Relation of the sum to the bound.
    pub relation: Relation,
    /// The bound.
    pub bound: f64,
}

impl Constraint {
    /// In the notation of the parser; `names` are the names of all variables.
    pub fn text(&self, names: &[impl AsRef<str>]) -> String {
        let mut text = String::new();
        for (i, (factor, Coefficient { output, term })) in self.sum.iter().enumerate() {
            let sign = match (*factor < 0.0, i) {
                (false, 0) => "",
                (true, 0) => "-",
                (false, _) => " + ",
                (true, _) => " - ",
            };
            text.push_str(sign);
            // Writing to a String cannot fail.
            if factor.abs() != 1.0 {
                let _ = write!(text, "{} ", factor.abs());
            }
            let output = names.get(*output).map_or("?", AsRef::as_ref);
            let _ = write!(text, "{output}: {}", term.name(names));
        }
        let relation = match self.relation {
            Relation::AtMost => "<=",
            Relation::AtLeast => ">=",
            Relation::Equal => "=",
        };
        let _ = write!(text, " {relation} {}", self.bound);
        text
    }
}

pub(super) fn read(
    parser: &mut ExpressionParser,
    scanner: &mut Scanner<'_>,
) -> Result<Constraint, ExpressionError> {
    let mut whole = Constraint { sum: Vec::new(), relation: Relation::Equal, bound: 0.0 };
    side(parser, scanner, 1.0, &mut whole)?;
    scanner.skip_space();
    let relations = [
        ("<=", Relation::AtMost),
        ("≤", Relation::AtMost),
        (">=", Relation::AtLeast),
        ("≥", Relation::AtLeast),
        ("=", Relation::Equal),
    ];
    let found = relations.into_iter().find(|(sign, _)| scanner.eat(sign));
    let Some((_, relation)) = found else { return Err(scanner.expected("one more factor, or <=, >= or =")) };
    whole.relation = relation;
    side(parser, scanner, -1.0, &mut whole)?;
    whole.sum.retain(|(factor, _)| *factor != 0.0);
    // The bound is on the right; negative zero is normalized.
    whole.bound = 0.0 - whole.bound;
    let finite = whole.bound.is_finite() && whole.sum.iter().all(|(factor, _)| factor.is_finite());
    if whole.sum.is_empty() || !finite {
        let reason = "no coefficient is left to constrain: write one, as in u: u |u| <= 0";
        return Err(scanner.error(reason.to_owned(), None));
    }
    Ok(whole)
}

/// Moves one side to the left: numbers to the bound, coefficients to the sum.
fn side(
    parser: &mut ExpressionParser,
    scanner: &mut Scanner<'_>,
    side: f64,
    whole: &mut Constraint,
) -> Result<(), ExpressionError> {
    let mut first = true;
    loop {
        scanner.skip_space();
        let negative = scanner.peek() == Some('-');
        if negative || scanner.peek() == Some('+') {
            scanner.eat(if negative { "-" } else { "+" });
            scanner.skip_space();
        } else if !first {
            return Ok(());
        }
        let sign = if negative { -1.0 } else { 1.0 };
        first = false;
        if let Some(output) = output(parser, scanner) {
            add(parser, scanner, side * sign, output, whole)?;
            continue;
        }
        let Some(number) = scanner.eat_number() else { return Err(no_coefficient(parser, scanner)) };
        let before = scanner.mark();
        scanner.skip_space();
        let times = scanner.eat("*");
        scanner.skip_space();
        if let Some(output) = output(parser, scanner) {
            add(parser, scanner, side * sign * number, output, whole)?;
        } else if times || scanner.peek().is_some_and(char::is_alphabetic) {
            return Err(no_coefficient(parser, scanner));
        } else {
            scanner.back_to(before);
            whole.bound += side * sign * number;
        }
    }
}

/// `OUTPUT:`, if it is next.
fn output(parser: &ExpressionParser, scanner: &mut Scanner<'_>) -> Option<usize> {
    let before = scanner.mark();
    let outputs = &parser.channels[..parser.outputs.min(parser.channels.len())];
    let found = scanner.eat_name(outputs);
    scanner.skip_space();
    if found.is_some() && scanner.eat(":") {
        return found;
    }
    scanner.back_to(before);
    None
}

fn add(
    parser: &mut ExpressionParser,
    scanner: &mut Scanner<'_>,
    factor: f64,
    output: usize,
    whole: &mut Constraint,
) -> Result<(), ExpressionError> {
    let coefficient = Coefficient { output, term: parser.product(scanner)? };
    match whole.sum.iter_mut().find(|(_, known)| *known == coefficient) {
        Some((known, _)) => *known += factor,
        None => whole.sum.push((factor, coefficient)),
    }
    Ok(())
}

fn no_coefficient(parser: &ExpressionParser, scanner: &Scanner<'_>) -> ExpressionError {
    let outputs = &parser.channels[..parser.outputs.min(parser.channels.len())];
    let word = scanner.word();
    if !word.is_empty() && !outputs.iter().any(|name| name == word) {
        let near = nearest(word, outputs.iter().map(String::as_str));
        let hint =
            near.as_ref().map_or_else(|| String::from("."), |name| format!(", did you mean '{name}'?"));
        let reason = format!("there is no output '{word}'{hint} There are {}", list(outputs));
        return scanner.error(reason, near);
    }
    if word.is_empty() {
        scanner.expected("a number, or a coefficient such as u: u |u|")
    } else {
        scanner.error(format!("expected '{word}:' and a term of its equation, found no ':'"), None)
    }
}
