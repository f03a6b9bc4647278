//! The page of a study: summary, figures, tables, claims, method.

use maud::{Markup, html};
use serde::Serialize;
use serde_json::Value;

use super::claims::{Holds, Judged};
use super::outcome::{Cell, Outcome, Picture, Sheet};
use super::plan::{Experiment, Plan, Record};
use super::{Done, StudyError};
use hydroid_report::number;
use hydroid_report::page::{Section, columns, figure, page, table_of};

/// A table of no more columns than this stands beside a figure.
const BESIDE: usize = 6;
/// A table of more rows than this is folded.
const LONG: usize = 40;

/// The page.
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
        sections.push(Section::new("claims", "Claims", body));
    }
    sections.push(Section::new("method", "Method", method(plan, done)));
    Ok(page("hydroid: a study", &sections))
}

fn summary(plan: &Plan, done: &[Done<'_>], claims: &[Judged]) -> Markup {
    let count = |verdict: Holds| claims.iter().filter(|claim| claim.verdict == verdict).count();
    html! {
        p.kicker { "hydroid thesis" @if plan.quick { " --quick" } }
        h1 { "Learning how a surface vessel moves, and learning on while it sails" }
        p {
            "The experiments of the thesis “The application of learning techniques to improve the control of surface vehicles”, repeated from simulation to its table 1, and what hydroid adds. Two vessels: a simple boat, and a hydrofoil that changes between floating and flying. Three ways to learn them: sparse equations (SINDy), a network that predicts 20 steps at once, and recurrent networks that a Kalman filter goes on teaching at sea."
        }
        @if plan.quick {
            p.nothing { "This is the small version: short records, few epochs, one seed. Its figures show the story, and are no measure of what the methods can do." }
        }
        @if !claims.is_empty() {
            p {
                strong { (count(Holds::Reproduced)) " claims are reproduced, " (count(Holds::InPart)) " in part, " (count(Holds::NotReproduced)) " not." @if count(Holds::NotMeasured) > 0 { " " (count(Holds::NotMeasured)) " could not be measured." } }
                " Each verdict follows from a bound on one figure; " a href="#claims" { "the reasons" } " stand at the end."
            }
            (claims_table(claims, false))
        } @else {
            p { (done.len()) " experiments, none of which decides a claim by itself." }
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
                    th scope="col" { "claim" } th scope="col" { "measured" } th.n scope="col" { "figure" } th scope="col" { "verdict" }
                    @if reasons { th scope="col" { "reproduced" } th scope="col" { "in part" } th scope="col" { "because" } }
                } }
                tbody {
                    @for claim in claims {
                        tr {
                            td.words { a href={ "#" (claim.experiment) } { (claim.claim) } }
                            td.words { (claim.measured) }
                            td.n { (claim.figure.map_or_else(|| number::NONE.to_owned(), |figure| number::text(figure, 3))) }
                            td { (verdict(claim.verdict)) }
                            @if reasons {
                                td { (claim.bounds[0].words()) } td { (claim.bounds[1].words()) }
                                td.words { (claim.because) }
                            }
                        }
                    }
                }
            }
        }
    }
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
            "Alone: " code { (command) " " (name) }
            @if !outcome.sheets.is_empty() {
                "; numbers: "
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
        p { "All records are simulated: Runge-Kutta in steps of 10 ms, samples of 0.1 s unless it is said otherwise, white noise of 1 cm/s, 1 cm/s and 1 deg/s on u, v and r, commands mixed of steps, ramps, chirps, triangles and binary sequences, or those of a lawn-mower in closed loop. Rollouts start from measured samples unless it is said otherwise, and are compared with the truth." }
        p { "Equations of motion, of the networks, of the filter and of the guard, with their sources, stand in hydroid's documentation. Settings are chosen on validation records, never on those that judge." }
        h3 { "Models" }
        div.scroll tabindex="0" {
            table {
                thead { tr { th scope="col" { "model" } th scope="col" { "method" } th scope="col" { "learned from" } th scope="col" { "chosen on" } th scope="col" { "seeds" } th scope="col" { "settings that are not the default" } } }
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
            "Experiments, records, models and claims are files: " code { "hydroid thesis --write-experiments FOLDER" } " writes them, " code { "hydroid thesis --experiments FOLDER" } " runs what was made of them. Results are kept in "
            code { "cache" } " beside this page and taken from there where nothing that they depend on has changed (" (plan.experiments.len()) " experiments in all)."
        }
    }
}

fn record(plan: &Plan, name: &str) -> String {
    plan.records.get(name).map_or_else(
        || name.to_owned(),
        |record| {
            let Record { plant, duration_s, dt_s, seed, .. } = record;
            format!("{name} ({plant}, {duration_s} s in samples of {dt_s} s, seed {seed})")
        },
    )
}

/// What is said of a network or of equations beside what goes without saying, as it stands in the file.
fn settings<T: Serialize + Default>(said: &T) -> String {
    let [said, usual] = [said, &T::default()].map(|settings| serde_json::to_value(settings).ok());
    let said = said.as_ref().and_then(Value::as_object).into_iter().flatten();
    let other = said.filter(|(key, value)| usual.as_ref().is_none_or(|usual| usual[key.as_str()] != **value));
    other.map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>().join(", ")
}
