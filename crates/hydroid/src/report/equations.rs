//! The equations, set as formulas, as a table and as text to copy.

use std::collections::HashSet;
use std::fmt::Write as _;

use hydroid_core::model::sparse::{Gate, Shape, Term};
use maud::{Markup, html};

use super::number;
use super::page::{Section, cell, nothing, table};
use crate::identify::Candidate;

/// Terms of an equation that are shown without a click.
const SHOWN: usize = 10;
/// Significant digits of a coefficient in a formula.
const DIGITS: usize = 3;
/// Width of a line of the text to copy.
const LINE: usize = 92;

/// A term of one equation.
struct Part<'a> {
    term: &'a Term,
    coefficient: f64,
    /// Share in the sum of all contributions to this equation.
    share: f64,
}

pub(super) fn section(candidate: &Candidate) -> Section {
    let outputs = &candidate.model.description.outputs;
    let names = candidate.model.variable_names();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let text = (0..outputs.len()).map(|i| plain(&names, i, &parts(candidate, i))).collect::<String>();
    let signals = candidate.model.signals_text();
    let body = html! {
        p { (where_clause(candidate)) }
        div.equations {
            @for i in 0..outputs.len() { (formula(&names, i, &parts(candidate, i))) }
        }
        @if !signals.is_empty() { p { "Where " (signals.join("; ")) "." } }
        (unidentifiable(candidate, &names))
        details.printed {
            summary { "Coefficients and what each term contributes" }
            p.small {
                "Contribution: root mean square of the term over the training runs, in standard deviations of the output per second; "
                "share: of the sum over the equation. Terms can cancel, so that a small share of a small sum may matter."
            }
            div.columns {
                @for (i, port) in outputs.iter().enumerate() {
                    div { (coefficients(&names, &port.channel.name, &parts(candidate, i), candidate, i)) }
                }
            }
        }
        details {
            summary { "Equations as text, to copy" }
            pre.copy { (text) @for line in &signals { (line) "\n" } }
        }
        details {
            summary { "Equations in LaTeX, to copy" }
            pre.copy { (candidate.model.equations_latex()) (candidate.model.units_latex()) }
        }
    };
    Section { id: "equations", heading: "Equations", body }
}

/// Terms of an equation, the largest contribution first.
fn parts(candidate: &Candidate, output: usize) -> Vec<Part<'_>> {
    let equations = &candidate.found().fit.equations;
    let terms = equations.terms();
    let scaled =
        |j: usize| candidate.found().fit.scaled.get(output * terms.len() + j).map_or(0.0, |s| s.abs());
    let total: f64 = (0..terms.len()).map(scaled).sum();
    let mut parts: Vec<Part<'_>> = terms
        .iter()
        .enumerate()
        .map(|(j, term)| Part {
            term,
            coefficient: equations.coefficient(output, j),
            share: if total > 0.0 { scaled(j) / total } else { 0.0 },
        })
        .filter(|part| part.coefficient != 0.0)
        .collect();
    parts.sort_by(|a, b| b.share.total_cmp(&a.share));
    parts
}

/// Units, each with the channels that have it.
fn where_clause(candidate: &Candidate) -> Markup {
    let description = &candidate.model.description;
    let mut units: Vec<(&str, Vec<&str>)> = Vec::new();
    for channel in description.outputs.iter().chain(&description.inputs).map(|port| &port.channel) {
        match units.iter_mut().find(|(unit, _)| *unit == channel.unit) {
            Some((_, names)) => names.push(&channel.name),
            None => units.push((&channel.unit, vec![&channel.name])),
        }
    }
    html! {
        "Time in seconds"
        @for (unit, names) in units {
            "; "
            @for (i, name) in names.iter().enumerate() { @if i > 0 { ", " } (variable(name)) }
            @if unit.is_empty() { " without a stated unit" } @else { " in " (number::unit(unit)) }
        }
        ". Commands are held over a sample of " (number::duration(description.dt))
        "; the largest contribution stands first."
    }
}

/// `d u / d t = ...`, the smaller terms behind a click where there are many.
fn formula(names: &[&str], output: usize, parts: &[Part<'_>]) -> Markup {
    let cut = if parts.len() > SHOWN + 2 { SHOWN } else { parts.len() };
    let rest = &parts[cut..];
    let name = names.get(output).copied().unwrap_or("?");
    let left: f64 = rest.iter().map(|part| part.share).sum();
    html! {
        div.equation {
            span.lhs {
                span.frac { span { "d" @if name.chars().nth(1).is_some_and(|c| c != '_') { "\u{202f}" } (variable(name)) } span { "d" i { "t" } } }
                span.eq { "=" }
            }
            div.rhs {
                @if parts.is_empty() { span.term { "0" } }
                @for (i, part) in parts[..cut].iter().enumerate() { (signed(names, part, i == 0)) }
                @if !rest.is_empty() {
                    details {
                        summary { "+ " (rest.len()) " smaller terms (" (number::fixed(100.0 * left, 0)) " % of the contributions)" }
                        @for part in rest { (signed(names, part, false)) }
                    }
                }
            }
        }
    }
}

fn signed(names: &[&str], part: &Part<'_>, first: bool) -> Markup {
    let sign = if part.coefficient < 0.0 {
        "−"
    } else if first {
        ""
    } else {
        "+"
    };
    html! {
        span.term {
            @if !sign.is_empty() { span.sign { (sign) } }
            (number::magnitude(part.coefficient, DIGITS))
            @if !part.term.factors().is_empty() { " " (term(names, part.term)) }
        }
        " "
    }
}

/// A term as a formula; the constant is 1.
fn term(names: &[&str], term: &Term) -> Markup {
    html! {
        @if term.factors().is_empty() { "1" }
        @for (i, factor) in term.factors().iter().enumerate() {
            @let name = names.get(usize::from(factor.variable)).unwrap_or(&"?");
            @if i > 0 { "\u{2009}" }
            @match factor.shape {
                Shape::Power(1) => (variable(name)),
                Shape::Power(n) => { (variable(name)) sup { (n) } },
                Shape::Abs => { "|" (variable(name)) "|" },
                Shape::Sign => { "sgn " (variable(name)) },
                Shape::Sin => { "sin " (variable(name)) },
                Shape::Cos => { "cos " (variable(name)) },
                Shape::Reciprocal => { (variable(name)) sup { "−1" } },
                Shape::Log => { "ln " (variable(name)) },
                Shape::Above(gate) => { "σ(" (gate_argument(name, gate)) ")" },
                Shape::Below(gate) => { "(1 − σ(" (gate_argument(name, gate)) "))" },
            }
        }
    }
}

/// `k (x - s0)`.
fn gate_argument(name: &str, gate: Gate) -> Markup {
    let centre = gate.centre.0;
    html! {
        (number::text(gate.slope.0, DIGITS)) "(" (variable(name))
        @if centre != 0.0 { @if centre < 0.0 { " + " } @else { " − " } (number::magnitude(centre, DIGITS)) } ")"
    }
}

/// A name as a symbol: what follows the first underscore (or the digits after a single letter) is an index.
/// Names of signals, `lag(n_cmd, 1.5 s)`, stay as they are.
fn variable(name: &str) -> Markup {
    let (base, index) = match name.split_once('_') {
        Some((base, index)) if !base.is_empty() && !index.is_empty() && !name.contains('(') => (base, index),
        _ => (name, ""),
    };
    let letters = base.trim_end_matches(|c: char| c.is_ascii_digit());
    let (base, digits) = if letters.chars().count() == 1 { base.split_at(letters.len()) } else { (base, "") };
    let index = match (digits, index) {
        ("", index) => index.to_owned(),
        (digits, "") => digits.to_owned(),
        (digits, index) => format!("{digits} {index}"),
    };
    let base = greek(base).unwrap_or(base);
    html! {
        span.v {
            @if base.chars().count() == 1 { i { (base) } } @else { (base) }
            @if !index.is_empty() { sub { (index) } }
        }
    }
}

/// The letter that a word means in a formula.
fn greek(word: &str) -> Option<&'static str> {
    Some(match word {
        "alpha" => "α",
        "beta" => "β",
        "gamma" => "γ",
        "delta" => "δ",
        "theta" => "θ",
        "rho" => "ρ",
        "tau" => "τ",
        "phi" => "φ",
        "psi" => "ψ",
        "omega" => "ω",
        _ => return None,
    })
}

fn coefficients(
    names: &[&str],
    output: &str,
    parts: &[Part<'_>],
    candidate: &Candidate,
    index: usize,
) -> Markup {
    if parts.is_empty() {
        return nothing(&format!("The equation of {output} has no terms."));
    }
    let residual = candidate.found().fit.residual_rms.get(index).copied().unwrap_or(f64::NAN);
    let unit = &candidate.model.description.outputs[index].channel.unit;
    let rate = if unit.is_empty() { "1/s".to_owned() } else { format!("{} per second", number::unit(unit)) };
    let largest = parts.first().map_or(1.0, |part| part.share).max(f64::MIN_POSITIVE);
    let rows: Vec<Vec<Markup>> = parts
        .iter()
        .map(|part| {
            let percent = 100.0 * part.share;
            let bar = 100.0 * part.share / largest;
            vec![
                html! { span.name { (term(names, part.term)) } },
                cell(number::text(part.coefficient, 4)),
                cell(number::unit(&candidate.model.coefficient_unit(index, part.term).to_string())),
                html! { span.share { span style={ "width:" (format!("{bar:.0}")) "%" } {} } (number::fixed(percent, 1)) " %" },
            ]
        })
        .collect();
    html! {
        h4 { "d" (variable(output)) "/d" i { "t" } }
        (table(&[cell("term"), cell("coefficient"), cell("unit"), cell("share")], &rows, 1))
        p.small { "Residual of the regression: " (number::text(residual, 3)) " " (rate) " (RMS)." }
    }
}

/// What nobody can tell from these runs.
fn unidentifiable(candidate: &Candidate, names: &[&str]) -> Markup {
    let lost: Vec<&Term> = candidate.found().unidentifiable.iter().collect();
    let equations = &candidate.found().fit.equations;
    let visible = equations.outputs() + equations.inputs();
    // An input is used as well where a signal that is made from it is.
    let source = |variable: u16| {
        usize::from(variable).checked_sub(visible).map_or(variable, |s| equations.signals()[s].source())
    };
    let used: HashSet<u16> = (0..equations.outputs())
        .flat_map(|i| parts(candidate, i))
        .flat_map(|part| part.term.factors().iter().map(|f| source(f.variable)).collect::<Vec<_>>())
        .collect();
    let inputs = equations.outputs()..visible;
    let idle: Vec<&str> =
        inputs.filter(|&i| !u16::try_from(i).is_ok_and(|i| used.contains(&i))).map(|i| names[i]).collect();
    html! {
        @if !lost.is_empty() {
            p.caution {
                "These runs cannot tell some terms from others, because they never move or move together: "
                @for (i, lost) in lost.iter().enumerate() { @if i > 0 { ", " } (term(names, lost)) }
                ". Where one of them stands in an equation, its coefficient is not its own."
            }
        }
        @if !idle.is_empty() {
            p.caution { "No equation uses the " @if idle.len() == 1 { "input " } @else { "inputs " }
                @for (i, name) in idle.iter().enumerate() { @if i > 0 { ", " } (variable(name)) } "." }
        }
    }
}

/// `du/dt = ...` for programs, in lines that fit a page.
fn plain(names: &[&str], output: usize, parts: &[Part<'_>]) -> String {
    let name = names.get(output).unwrap_or(&"?");
    let mut text = format!("d({name})/dt =");
    let mut used = text.len();
    if parts.is_empty() {
        text.push_str(" 0");
    }
    for (i, part) in parts.iter().enumerate() {
        let number = number::plain(part.coefficient.abs(), 5);
        let sign = if part.coefficient < 0.0 {
            "-"
        } else if i > 0 {
            "+"
        } else {
            ""
        };
        let mut piece = if sign.is_empty() { format!(" {number}") } else { format!(" {sign} {number}") };
        if !part.term.factors().is_empty() {
            // Writing to a String cannot fail.
            let _ = write!(piece, " {}", part.term.name(names));
        }
        if used + piece.len() > LINE {
            text.push_str("\n   ");
            used = 3;
        }
        used += piece.len();
        text.push_str(&piece);
    }
    text.push_str("\n\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_symbols() {
        assert_eq!(variable("u").0, "<span class=\"v\"><i>u</i></span>");
        assert_eq!(variable("wind_x").0, "<span class=\"v\">wind<sub>x</sub></span>");
        assert_eq!(variable("u5_bow").0, "<span class=\"v\"><i>u</i><sub>5 bow</sub></span>");
        assert_eq!(variable("<b>").0, "<span class=\"v\">&lt;b&gt;</span>");
        assert_eq!(variable("delta_2").0, "<span class=\"v\"><i>δ</i><sub>2</sub></span>");
        assert_eq!(variable("lag(n_c, 1 s)").0, "<span class=\"v\">lag(n_c, 1 s)</span>");
        assert_eq!(variable("_").0, "<span class=\"v\"><i>_</i></span>");
        assert_eq!(variable("").0, "<span class=\"v\"></span>");
    }
}
