//! Table of coefficients: values, standard errors, 90 % intervals, units and contributions.

use maud::{Markup, html};

use super::equations::{Part, Sparse};
use super::formula::{in_mode, variable};
use super::number;
use super::page::{cell, nothing, table};
use hydroid::model::{CoefficientUncertainty, Modes, NamedEquations};
use hydroid::sindy::SearchResult;

/// A term in a smaller share of the ensemble members is marked.
const DOUBTFUL: f64 = 0.5;

pub(super) fn about(found: &SearchResult) -> Markup {
    let members = found.ensemble.as_ref().map(|ensemble| ensemble.members.len());
    html! {
        p.small {
            @if let Some(members) = members {
                "The standard error is the standard deviation of the coefficient over the " (members) " members of an ensemble; a member without the term counts as zero. "
                "“90 %” is the interval that contains 90 % of the members that contain the term. "
                "Each member is fitted with the chosen settings to parts of the training runs, drawn with replacement (bootstrap). "
                "“Included” is the share of the members that contain the term. A share below one half is marked: such a term may stand for collinear ones. "
            }
            "“Share” is the root mean square of the term over the training runs, relative to the sum over all terms of the equation. "
            "Terms can cancel, so that a term with a small share may still matter."
        }
    }
}

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
    let uncertainty = motion.coefficient_uncertainty().and_then(|all| all.into_iter().nth(index));
    let mut heads = vec![cell("term"), cell("coefficient")];
    if uncertainty.is_some() {
        heads.push(cell("standard error"));
    }
    if found.ensemble.is_some() {
        heads.extend([cell("90 %"), cell("included")]);
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
            if let Some(of) = &uncertainty {
                let error = of.terms.iter().position(|&j| j == part.place).and_then(|k| of.standard_errors[k]);
                row.push(cell(error.map_or_else(|| number::NONE.to_owned(), |error| number::text(error, 2))));
            }
            if let Some(ensemble) = &found.ensemble {
                let at = index * found.fit.equations.terms().len() + part.place;
                let get = |list: &[f64]| list.get(at).copied().unwrap_or(f64::NAN);
                let inclusion = get(&ensemble.inclusion);
                let share = format!("{} %", number::fixed(100.0 * inclusion, 0));
                row.push(html! {
                    @if inclusion > 0.0 {
                        (number::text(get(&ensemble.low), 4)) " … " (number::text(get(&ensemble.high), 4))
                    } @else { (number::NONE) }
                });
                row.push(html! {
                    @if inclusion < DOUBTFUL { span.caution title="fewer than half of the members contain this term" { (share) " ⚠" } }
                    @else { (share) }
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
        @if let Some(uncertainty) = &uncertainty { (correlated(names, modes, motion, uncertainty)) }
        p.small { "Residual of the regression: " (number::text(residual, 3)) " " (rate) " (RMS)." }
    }
}

/// Pairs of coefficients with a large correlation, if any.
fn correlated(
    names: &[&str],
    modes: &Modes,
    motion: NamedEquations<'_>,
    uncertainty: &CoefficientUncertainty,
) -> Markup {
    let pairs = uncertainty.strongly_correlated();
    let terms = motion.equations().terms();
    html! {
        @if !pairs.is_empty() {
            p.small {
                "Strongly correlated coefficients, which are only determined together: "
                @for (k, (i, j, correlation)) in pairs.iter().enumerate() {
                    @if k > 0 { "; " }
                    (in_mode(names, modes, &terms[*i])) " and " (in_mode(names, modes, &terms[*j]))
                    " (" (number::fixed(*correlation, 2)) ")"
                }
                "."
            }
        }
    }
}
