//! Equations as HTML formulas.

use hydroid_core::model::sparse::{Gate, Shape, Term};
use maud::{Markup, html};

use super::equations::Part;
use super::number;
use hydroid::model::{Mode, Modes};

/// Number of terms that are visible without a click, for an equation or a gated group.
const SHOWN: usize = 10;
const DIGITS: usize = 3;

/// `d u / d t = ...`. Small terms of a long equation are folded; gated terms are grouped.
pub(super) fn formula(names: &[&str], modes: &Modes, output: usize, parts: &[Part<'_>]) -> Markup {
    let name = names.get(output).copied().unwrap_or("?");
    let groups = modes.grouped(parts.iter().map(|part| (part, part.term.clone())));
    html! {
        div.equation {
            span.lhs {
                span.frac { span { "d" @if name.chars().nth(1).is_some_and(|c| c != '_') { "\u{202f}" } (variable(name)) } span { "d" i { "t" } } }
                span.eq { "=" }
            }
            div.rhs {
                @if parts.is_empty() { span.term { "0" } }
                @for (i, (mode, terms)) in groups.iter().enumerate() {
                    @if *mode == Mode::All {
                        (sum(names, terms))
                    } @else {
                        div.mode {
                            @if i > 0 { span.sign { "+" } }
                            (weight(modes, *mode)) "\u{2009}" span.bracket { "[" } " "
                            (sum(names, terms)) span.bracket { "]" }
                        }
                    }
                }
            }
        }
    }
}

fn sum(names: &[&str], terms: &[(&Part<'_>, Term)]) -> Markup {
    let cut = if terms.len() > SHOWN + 2 { SHOWN } else { terms.len() };
    let rest = &terms[cut..];
    let left: f64 = rest.iter().map(|(part, _)| part.share).sum();
    html! {
        @for (i, (part, term)) in terms[..cut].iter().enumerate() { (signed(names, part.coefficient, term, i == 0)) }
        @if !rest.is_empty() {
            details {
                summary { "+ " (rest.len()) " smaller terms (" (number::fixed(100.0 * left, 0)) " % of the contributions)" }
                @for (part, term) in rest { (signed(names, part.coefficient, term, false)) }
            }
        }
    }
}

fn signed(names: &[&str], coefficient: f64, own: &Term, first: bool) -> Markup {
    let sign = if coefficient < 0.0 {
        "−"
    } else if first {
        ""
    } else {
        "+"
    };
    html! {
        span.term {
            @if !sign.is_empty() { span.sign { (sign) } }
            (number::magnitude(coefficient, DIGITS))
            @if !own.factors().is_empty() { " " (term(names, own)) }
        }
        " "
    }
}

/// Weight of a mode: `(1 − s)` or `s`.
pub(super) fn weight(modes: &Modes, mode: Mode) -> Markup {
    match mode {
        Mode::All => html! {},
        Mode::Below(g) => html! { "(1 − " (variable(&modes.gates()[g].letter)) ")" },
        Mode::Above(g) => variable(&modes.gates()[g].letter),
    }
}

pub(super) fn in_mode(names: &[&str], modes: &Modes, own: &Term) -> Markup {
    let (mode, rest) = modes.of(own);
    html! {
        (weight(modes, mode))
        @if mode == Mode::All || !rest.factors().is_empty() {
            @if mode != Mode::All { "\u{2009}" }
            (term(names, &rest))
        }
    }
}

/// `s = σ(11.9 (u − 2.50))` for each gate.
pub(super) fn gates(names: &[&str], modes: &Modes) -> Markup {
    html! {
        @for (i, named) in modes.gates().iter().enumerate() {
            @if i > 0 { ", " }
            (variable(&named.letter)) " = σ(" (gate_argument(names.get(named.variable).unwrap_or(&"?"), named.gate)) ")"
        }
        ", σ(" i { "x" } ") = 1 / (1 + e" sup { "−" i { "x" } } ")"
    }
}

/// A term as a formula; the constant is 1.
pub(super) fn term(names: &[&str], term: &Term) -> Markup {
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

/// A name as a symbol: the part after the first underscore, or the digits after a single letter, is an index. Names of
/// signals, `lag(n_cmd, 1.5 s)`, are unchanged.
pub fn variable(name: &str) -> Markup {
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
