//! The page of a study: summary, figures, tables, claims, method.

use maud::{Markup, html};
use serde::Serialize;
use serde_json::Value;

use super::claims::{Holds, Judged, Measured};
use super::outcome::{Cell, Outcome, Picture, Sheet};
use super::plan::{Experiment, Plan, Record};
use super::{Done, StudyError};
use hydroid_report::number;
use hydroid_report::page::{Section, columns, figure, page, table_of};

/// Largest number of columns of a table beside a figure.
const BESIDE: usize = 6;
const LONG: usize = 40;

pub(super) fn write(
    plan: &Plan,
    done: &[Done<'_>],
    claims: &[Judged],
    command: &str,
) -> Result<String, StudyError> {
    let mut sections = vec![Section::new("summary", "Summary", summary(plan, done, claims))];
    for one in done {
        let body = experiment(one.name, one.experiment, &one.outcome, command)?;
        sections.push(Section::new(one.name.clone(), one.experiment.title.clone(), body));
    }
    if !claims.is_empty() {
        let body = claims_table(claims, true);
        sections.push(Section::new("claims", "Claims of the thesis", body));
    }
    sections.push(Section::new("method", "Method", method(plan, done)));
    Ok(page("hydroid: a study", &sections))
}

fn summary(plan: &Plan, done: &[Done<'_>], claims: &[Judged]) -> Markup {
    let count = |verdict: Holds| claims.iter().filter(|claim| claim.verdict == verdict).count();
    html! {
        p.kicker { "hydroid thesis" @if plan.quick { " · small version" } }
        h1 { "Identification, online adaptation and control of a surface vessel" }
        p {
            "This study repeats the experiments of the master's thesis “The application of learning techniques to improve the control of surface vehicles”, from the simulated records to its table 1. It adds comparisons with hydroid. There are two vessels: a simple boat, and a hydrofoil with a displacement mode and a flying mode. There are three kinds of model: sparse equations (SINDy), networks that predict 20 steps at once, and recurrent networks. An extended Kalman filter adapts the weights of the recurrent networks online."
        }
        @if plan.quick {
            p.nothing { "This is the small version, with short records, few epochs and one seed. Its values are not those of the full study." }
        }
        @if !claims.is_empty() {
            p {
                strong { (count(Holds::Reproduced)) " claims reproduced, " (count(Holds::InPart)) " in part, " (count(Holds::NotReproduced)) " not." @if count(Holds::NotMeasured) > 0 { " " (count(Holds::NotMeasured)) " could not be measured." } }
                " The thesis states its claims in words. Each verdict is the worst of the verdicts on the measured values of the claim, which are compared with bounds that hydroid has set. " a href="#claims" { "The bounds and the reasons" } " are at the end of the page."
            }
            (claims_table(claims, false))
        } @else {
            p { (done.len()) " experiments. None of them decides a claim of the thesis." }
        }
    }
}

fn verdict(verdict: Holds) -> Markup {
    let class = match verdict {
        Holds::Reproduced => "good",
        Holds::InPart => "usable",
        Holds::NotReproduced | Holds::NotMeasured => "bad",
    };
    html! { span class={ "verdict " (class) } { (verdict.word()) } }
}

fn claims_table(claims: &[Judged], reasons: bool) -> Markup {
    html! {
        div.scroll tabindex="0" {
            table.claims {
                thead { tr {
                    th scope="col" { "verdict" } th scope="col" { "claim of the thesis" } th.n scope="col" { "value" } th scope="col" { "measured quantity" }
                    @if reasons { th scope="col" { "reproduced" } th scope="col" { "in part" } th scope="col" { "seeds and records" } th scope="col" { "because" } }
                } }
                tbody {
                    @for claim in claims {
                        @if reasons { (claim_rows(claim)) } @else { (claim_row(claim)) }
                    }
                }
            }
        }
    }
}

fn figure_of(measured: &Measured) -> String {
    measured.figure.map_or_else(|| number::NONE.to_owned(), |figure| number::text(figure, 3))
}

/// A claim with the value that decides.
fn claim_row(claim: &Judged) -> Markup {
    html! {
        tr {
            td { (verdict(claim.verdict)) }
            td.words { a href={ "#" (claim.experiment) } { (claim.claim) } }
            @if let Some(one) = claim.deciding() {
                td.n { (figure_of(one)) } td.words { (quantity(one)) }
            } @else { td.n { (number::NONE) } td {} }
        }
    }
}

/// A claim with a row for each value.
fn claim_rows(claim: &Judged) -> Markup {
    let rows = claim.measures.len();
    html! {
        @for (i, one) in claim.measures.iter().enumerate() {
            tr {
                @if i == 0 {
                    td rowspan=(rows) { (verdict(claim.verdict)) }
                    td.words rowspan=(rows) { a href={ "#" (claim.experiment) } { (claim.claim) } }
                }
                td.n { (figure_of(one)) }
                // A description that repeats the one above is left out.
                td.words { @if i > 0 && claim.measures[i - 1].measured == one.measured { (one.of) } @else { (quantity(one)) } }
                td { (one.bounds[0].words()) } td { (one.bounds[1].words()) } td.words { (one.over) }
                @if i == 0 { td.words rowspan=(rows) { (claim.because) } }
            }
        }
    }
}

fn quantity(one: &Measured) -> String {
    if one.of.is_empty() { one.measured.clone() } else { format!("{}: {}", one.of, one.measured) }
}

fn experiment(
    name: &str,
    experiment: &Experiment,
    outcome: &Outcome,
    command: &str,
) -> Result<Markup, StudyError> {
    let mut charts = Vec::new();
    let mut drawings = Vec::new();
    for shown in &outcome.pictures {
        let caption =
            html! { (shown.caption) " " a href={ "figures/" (name) "_" (shown.name) ".svg" } { "SVG" } };
        match &shown.picture {
            Picture::Chart(chart) => charts.push(figure(&chart.svg()?, &caption)),
            Picture::Drawing(svg) => drawings.push(figure(svg, &caption)),
        }
    }
    let tables = |wide: bool| {
        html! {
            @for tabled in outcome.tables.iter().filter(|tabled| wide == (tabled.sheet.columns.len() > BESIDE)) {
                @if tabled.sheet.rows.len() > LONG {
                    details { summary { "All " (tabled.sheet.rows.len()) " rows" } (sheet(&tabled.sheet)) }
                } @else {
                    (sheet(&tabled.sheet))
                }
                p.small { (tabled.caption) " " a href={ "data/" (name) "_" (tabled.sheet.name) ".csv" } { "CSV" } }
            }
        }
    };
    if outcome.tables.iter().any(|tabled| tabled.sheet.columns.len() <= BESIDE) {
        charts.push(tables(false));
    }
    Ok(html! {
        p { (experiment.text) }
        @for drawing in &drawings { div.drawing { (drawing) } }
        (columns(&charts))
        (tables(true))
        @for remark in &outcome.remarks { p.nothing { (remark) } }
        p.small {
            "Command for this experiment: " code { (command) " " (name) }
            @if !outcome.sheets.is_empty() {
                "; data: "
                @for (i, sheet) in outcome.sheets.iter().enumerate() {
                    @if i > 0 { ", " }
                    a href={ "data/" (name) "_" (sheet.name) ".csv" } { (sheet.name) ".csv" }
                }
            }
        }
    })
}

fn sheet(sheet: &Sheet) -> Markup {
    let heads: Vec<Markup> = sheet.columns.iter().map(|column| html! { (column) }).collect();
    let rows: Vec<Vec<Markup>> = sheet
        .rows
        .iter()
        .map(|row| {
            row.iter()
                .map(|cell| match cell {
                    Cell::Number(x) if x.is_finite() => html! { (number::text(*x, 3)) },
                    Cell::Number(_) | Cell::Nothing => html! { (number::NONE) },
                    Cell::Count(n) => html! { (number::count(*n)) },
                    Cell::Text(text) => html! { span.name { (text) } },
                })
                .collect()
        })
        .collect();
    let number = |c: usize| sheet.rows.iter().any(|row| matches!(row[c], Cell::Number(_) | Cell::Count(_)));
    table_of(&heads, &rows, number)
}

fn method(plan: &Plan, done: &[Done<'_>]) -> Markup {
    let mut models: Vec<&String> = done.iter().flat_map(|one| one.experiment.run.uses().1).collect();
    models.sort();
    models.dedup();
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    html! {
        p { "All records are simulated: the integration is a Runge-Kutta method of order 4 with steps of 10 ms, and the sample time is 0.1 s unless stated otherwise. White noise has standard deviations of 1 cm/s, 1 cm/s and 1 deg/s on u, v and r. Commands are mixtures of constant zero, steps, ramps, chirps, triangles and binary sequences, or those of a lawn-mower track in closed loop. Rollouts start from measured samples unless stated otherwise, and are compared with the true outputs." }
        p { "The documentation of hydroid contains the equations of the plants, the networks, the filter and the guard, with their sources. Settings are chosen on validation records, never on test records." }
        h3 { "Models" }
        div.scroll tabindex="0" {
            table {
                thead { tr { th scope="col" { "model" } th scope="col" { "method" } th scope="col" { "training record" } th scope="col" { "validation record" } th scope="col" { "seeds" } th scope="col" { "settings other than the defaults" } } }
                tbody {
                    @for name in models {
                        @if let Some(model) = plan.models.get(name) {
                            tr {
                                td { (name) } td { (model.method.name()) } td { (record(plan, &model.train)) } td { (record(plan, &model.validate)) }
                                td { (model.seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")) }
                                td.words { (settings(&model.network)) " " (settings(&model.sindy)) }
                            }
                        }
                    }
                }
            }
        }
        p.small {
            "hydroid " (env!("CARGO_PKG_VERSION")) ", " (std::env::consts::OS) " on " (std::env::consts::ARCH) ", " (threads) " cores. "
            "Experiments, records, models and claims are files: " code { "hydroid thesis --write-experiments FOLDER" } " writes them, and " code { "hydroid thesis --experiments FOLDER" } " runs edited ones. Results are stored in "
            code { "cache" } " beside this page and are reused as long as nothing that they depend on has changed (" (plan.experiments.len()) " experiments in all)."
        }
    }
}

fn record(plan: &Plan, name: &str) -> String {
    plan.records.get(name).map_or_else(
        || name.to_owned(),
        |record| {
            let Record { plant, duration_s, dt_s, seed, .. } = record;
            format!("{name} ({plant}, {duration_s} s, sample time {dt_s} s, seed {seed})")
        },
    )
}

/// Options that differ from the defaults, as in the file.
fn settings<T: Serialize + Default>(said: &T) -> String {
    let [said, usual] = [said, &T::default()].map(|settings| serde_json::to_value(settings).ok());
    let said = said.as_ref().and_then(Value::as_object).into_iter().flatten();
    let other = said.filter(|(key, value)| usual.as_ref().is_none_or(|usual| usual[key.as_str()] != **value));
    other.map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>().join(", ")
}
