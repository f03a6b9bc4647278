//! The table of coefficients: values, how sure they are, units, and what each term contributes.

use maud::{Markup, html};

use super::equations::{Part, Sparse};
use super::formula::{in_mode, variable};
use super::number;
use super::page::{cell, nothing, table};
use hydroid::model::Modes;
use hydroid::sindy::SearchResult;

/// A term that fewer members of the ensemble have than this is marked.
const DOUBTFUL: f64 = 0.5;

/// What the tables below are.
pub(super) fn about(found: &SearchResult) -> Markup {
    let members = found.ensemble.as_ref().map(|ensemble| ensemble.members.len());
    html! {
        p.small {
            @if let Some(members) = members {
                "90 %: the interval that holds nine tenths of the " (members) " members of an ensemble, each fitted anew to "
                "stretches of the training runs that were drawn with replacement, at the chosen settings; kept: the share of the members "
                "that have the term at all, marked where it is less than half: such a term may be a stand-in for others. "
            }
            "Share: root mean square of the term over the training runs, of the sum over the equation. "
            "Terms can cancel, so that a small share of a small sum may matter."
        }
    }
}

/// The coefficients of one equation.
pub(super) fn coefficients(
    names: &[&str],
    modes: &Modes,
    parts: &[Part<'_>],
    sparse: Sparse<'_>,
    index: usize,
) -> Markup {
    let Sparse { candidate, found, motion } = sparse;
    let output = &candidate.model.description.outputs[index].channel;
    if parts.is_empty() {
        return nothing(&format!("The equation of {} has no terms.", output.name));
    }
    let residual = found.fit.residual_rms.get(index).copied().unwrap_or(f64::NAN);
    let unit = &output.unit;
    let rate = if unit.is_empty() { "1/s".to_owned() } else { format!("{} per second", number::unit(unit)) };
    let largest = parts.first().map_or(1.0, |part| part.share).max(f64::MIN_POSITIVE);
    let mut heads = vec![cell("term"), cell("coefficient")];
    if found.ensemble.is_some() {
        heads.extend([cell("90 %"), cell("kept")]);
    }
    heads.extend([cell("unit"), cell("share")]);
    let rows: Vec<Vec<Markup>> = parts
        .iter()
        .map(|part| {
            let percent = 100.0 * part.share;
            let bar = 100.0 * part.share / largest;
            let mut row = vec![
                html! { span.name { (in_mode(names, modes, part.term)) } },
                cell(number::text(part.coefficient, 4)),
            ];
            if let Some(ensemble) = &found.ensemble {
                let at = index * found.fit.equations.terms().len() + part.place;
                let get = |list: &[f64]| list.get(at).copied().unwrap_or(f64::NAN);
                let inclusion = get(&ensemble.inclusion);
                let kept = format!("{} %", number::fixed(100.0 * inclusion, 0));
                row.push(html! {
                    @if inclusion > 0.0 {
                        (number::text(get(&ensemble.low), 4)) " … " (number::text(get(&ensemble.high), 4))
                    } @else { (number::NONE) }
                });
                row.push(html! {
                    @if inclusion < DOUBTFUL { span.caution title="fewer than half of the members have it" { (kept) " ⚠" } }
                    @else { (kept) }
                });
            }
            row.extend([
                cell(number::unit(&motion.coefficient_unit(index, part.term).to_string())),
                html! { span.share { span style={ "width:" (format!("{bar:.0}")) "%" } {} } (number::fixed(percent, 1)) " %" },
            ]);
            row
        })
        .collect();
    html! {
        h4 { "d" (variable(&output.name)) "/d" i { "t" } }
        (table(&heads, &rows, 1))
        p.small { "Residual of the regression: " (number::text(residual, 3)) " " (rate) " (RMS)." }
    }
}
