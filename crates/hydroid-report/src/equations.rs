//! Identified equations as formulas, as a table and as text to copy.

use std::collections::HashSet;
use std::fmt::Write as _;

use hydroid_core::model::sparse::Term;
use maud::{Markup, html};

use super::coefficients::{about, coefficients};
use super::formula::{formula, gates, in_mode, variable};
use super::page::Section;
use super::{hidden, number};
use hydroid::identify::Candidate;
use hydroid::log::Trajectory;
use hydroid::model::{Mode, Modes, NamedEquations};
use hydroid::sindy::SearchResult;

/// Line width of the text to copy.
const LINE: usize = 92;

/// A candidate that consists of equations.
#[derive(Clone, Copy)]
pub(super) struct Sparse<'a> {
    pub(super) candidate: &'a Candidate,
    pub(super) found: &'a SearchResult,
    pub(super) motion: NamedEquations<'a>,
}

impl<'a> Sparse<'a> {
    /// `None` for a network.
    pub(super) fn of(candidate: &'a Candidate) -> Option<Self> {
        Some(Self { candidate, found: candidate.found()?, motion: candidate.model.equations()? })
    }
}

pub(super) struct Part<'a> {
    pub(super) term: &'a Term,
    pub(super) place: usize,
    pub(super) coefficient: f64,
    /// Share in the sum of all contributions to this equation.
    pub(super) share: f64,
}

pub(super) fn section(sparse: Sparse<'_>, training: &[Trajectory]) -> Section {
    let Sparse { candidate, motion, .. } = sparse;
    let outputs = &candidate.model.description.outputs;
    let names = motion.variable_names();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let modes = motion.modes();
    let text = (0..outputs.len()).map(|i| plain(&names, &modes, i, &parts(sparse, i))).collect::<String>();
    let (letters, signals) = (motion.gates_text(), motion.signals_text());
    let body = html! {
        p { (where_clause(candidate)) }
        div.equations {
            @for i in 0..outputs.len() { (formula(&names, &modes, i, &parts(sparse, i))) }
        }
        @if !(modes.gates().is_empty() && signals.is_empty()) {
            p {
                "Where "
                @if !modes.gates().is_empty() { (gates(&names, &modes)) @if !signals.is_empty() { "; " } }
                (signals.join("; ")) "."
            }
        }
        (hidden::sentences(sparse, &names, training))
        (unidentifiable(sparse, &names, &modes))
        details.printed {
            summary { "Coefficients, their intervals and their contributions" }
            (about(sparse.found))
            div.tables {
                @for i in 0..outputs.len() {
                    div { (coefficients(&names, &modes, &parts(sparse, i), sparse, i)) }
                }
            }
        }
        details {
            summary { "Equations as text, to copy" }
            pre.copy { (text) @for line in letters.iter().chain(&signals) { (line) "\n" } }
        }
        details {
            summary { "Equations in LaTeX, to copy" }
            pre.copy { (motion.equations_latex()) (motion.units_latex()) (motion.coefficients_latex()) }
        }
    };
    Section::new("equations", "Equations", body)
}

/// Terms of an equation, the largest contribution first.
fn parts(sparse: Sparse<'_>, output: usize) -> Vec<Part<'_>> {
    let fit = &sparse.found.fit;
    let equations = &fit.equations;
    let terms = equations.terms();
    let scaled = |j: usize| fit.scaled.get(output * terms.len() + j).map_or(0.0, |s| s.abs());
    let total: f64 = (0..terms.len()).map(scaled).sum();
    let mut parts: Vec<Part<'_>> = terms
        .iter()
        .enumerate()
        .map(|(j, term)| Part {
            term,
            place: j,
            coefficient: equations.coefficient(output, j),
            share: if total > 0.0 { scaled(j) / total } else { 0.0 },
        })
        .filter(|part| part.coefficient != 0.0)
        .collect();
    parts.sort_by(|a, b| b.share.total_cmp(&a.share));
    parts
}

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
        "Time is in seconds"
        @for (unit, names) in units {
            ", "
            @for (i, name) in names.iter().enumerate() { @if i > 0 { ", " } (variable(name)) }
            @if unit.is_empty() { " without a stated unit" } @else { " in " (number::unit(unit)) }
        }
        ". Commands are held over a sample of " (number::duration(description.dt))
        ". The terms of an equation are sorted by contribution, the largest first."
    }
}

/// Terms that these runs do not identify, and inputs without a term.
fn unidentifiable(sparse: Sparse<'_>, names: &[&str], modes: &Modes) -> Markup {
    let lost: Vec<&Term> = sparse.found.unidentifiable.iter().collect();
    let equations = &sparse.found.fit.equations;
    let visible = equations.outputs() + equations.inputs();
    // An input is in use if a signal derived from it is.
    let source = |variable: u16| {
        usize::from(variable).checked_sub(visible).map_or(variable, |s| equations.signals()[s].source())
    };
    let used: HashSet<u16> = (0..equations.outputs())
        .flat_map(|i| parts(sparse, i))
        .flat_map(|part| part.term.factors().iter().map(|f| source(f.variable)).collect::<Vec<_>>())
        .collect();
    let inputs = equations.outputs()..visible;
    let idle: Vec<&str> =
        inputs.filter(|&i| !u16::try_from(i).is_ok_and(|i| used.contains(&i))).map(|i| names[i]).collect();
    html! {
        @if !lost.is_empty() {
            p.caution {
                "These runs cannot distinguish some terms, because they are constant or collinear: "
                @for (i, lost) in lost.iter().enumerate() { @if i > 0 { ", " } (in_mode(names, modes, lost)) }
                ". The coefficient of such a term also contains the effect of the others."
            }
        }
        @if !idle.is_empty() {
            p.caution { "No equation uses the " @if idle.len() == 1 { "input " } @else { "inputs " }
                @for (i, name) in idle.iter().enumerate() { @if i > 0 { ", " } (variable(name)) } "." }
        }
    }
}

/// `du/dt = ...` as text, wrapped to [`LINE`].
fn plain(names: &[&str], modes: &Modes, output: usize, parts: &[Part<'_>]) -> String {
    let name = names.get(output).unwrap_or(&"?");
    let mut text = format!("d({name})/dt =");
    let mut used = text.len();
    let mut put = |piece: &str, broken: bool| {
        if broken || used + piece.len() > LINE {
            text.push_str("\n   ");
            used = 3;
        }
        used += piece.len();
        text.push_str(piece);
    };
    if parts.is_empty() {
        put(" 0", false);
    }
    let groups = modes.grouped(parts.iter().map(|part| (part.coefficient, part.term.clone())));
    for (g, (mode, terms)) in groups.iter().enumerate() {
        if *mode != Mode::All {
            put(&format!(" {}{} [", if g > 0 { "+ " } else { "" }, modes.weight(*mode)), true);
        }
        for (i, (coefficient, term)) in terms.iter().enumerate() {
            let sign = match (*coefficient < 0.0, i) {
                (true, _) => "- ",
                (false, 0) => "",
                (false, _) => "+ ",
            };
            let mut piece = format!(" {sign}{}", number::plain(coefficient.abs(), 5));
            if !term.factors().is_empty() {
                let _ = write!(piece, " {}", term.name(names));
            }
            put(&piece, false);
        }
        if *mode != Mode::All {
            put(" ]", false);
        }
    }
    text.push_str("\n\n");
    text
}
