//! Sparse equations of the hydrofoil with the settings of the thesis, compared with those of hydroid.

use serde::{Deserialize, Serialize};

use super::super::StudyError;
use super::super::outcome::{Cell, Outcome, Sheet};
use super::super::palette;
use super::super::recipe::{self, DIFFERENCES, HORIZONS, Row, THRESHOLDS, Verdict};
use super::super::runner::Runner;
use super::median;
use hydroid::identify::output_ranges;
use hydroid_report::figure::{Figure, Key, Line, Mark, Panel, Points, Sign};
use hydroid_report::style;

/// Sparse regression with the settings of the thesis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    pub train: String,
    pub test: String,
    /// Degrees of the polynomials.
    pub degrees: Vec<u8>,
    /// The equations of hydroid.
    pub ours: String,
}

impl Recipe {
    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let [train, test] = [runner.record(&self.train)?, runner.record(&self.test)?];
        let degrees: Vec<(u8, usize)> = self
            .degrees
            .iter()
            .flat_map(|&degree| (0..DIFFERENCES.len()).map(move |d| (degree, d)))
            .collect();
        let rows: Vec<Vec<Row>> = runner.each("the recipe of the thesis", &degrees, |&(degree, d)| {
            let key = runner.store.key("recipe", &(degree, d), &[train.key, test.key]);
            runner.store.get("recipe", key, || {
                recipe::recipe(&train.run, &test.run, &[degree], &DIFFERENCES[d..=d], &THRESHOLDS)
            })
        })?;
        let rows: Vec<Row> = rows.into_iter().flatten().collect();
        let ours = runner.models(&self.ours)?;
        let ranges = output_ranges(&[&train.run]);
        let found: Vec<Option<recipe::Errors>> = runner.each("hydroid's equations", &ours, |learned| {
            runner.fits(learned, &test)?;
            let key = runner.store.key("from truth", &(), &[learned.key, train.key, test.key]);
            runner.store.get("equations", key, || {
                let test = recipe::judged(learned.model.session().as_mut(), &ranges, &test.run)?;
                Ok((test.diverged == 0).then(|| recipe::errors(&test.mae)))
            })
        })?;
        let mut outcome = Outcome::default();
        let mut table = Sheet::new(
            "recipe",
            &[
                "verdict",
                "degree",
                "differences",
                "force in",
                "threshold",
                "terms",
                "20 steps: u [m/s]",
                "v [m/s]",
                "r [rad/s]",
                "100 steps: u [m/s]",
                "v [m/s]",
                "r [rad/s]",
                "diverged",
            ],
        );
        for row in &rows {
            let mut cells: Vec<Cell> = vec![
                row.verdict.to_string().into(),
                usize::from(row.degree).into(),
                row.difference.as_str().into(),
                row.unit.as_str().into(),
                row.threshold.into(),
                row.terms.into(),
            ];
            cells.extend(errors(row.errors.as_ref()));
            cells.push(format!("{} of {}", row.diverged, row.windows).into());
            table.row(cells);
        }
        for (learned, found) in ours.iter().zip(&found) {
            let mut cells: Vec<Cell> = vec![
                format!("hydroid's defaults, seed {}", learned.seed).into(),
                Cell::Nothing,
                Cell::Nothing,
                Cell::Nothing,
                Cell::Nothing,
                learned.model.weights().into(),
            ];
            cells.extend(errors(found.as_ref()));
            cells.push(if found.is_some() { "none" } else { "some" }.into());
            table.row(cells);
        }
        let ours_20 = median(found.iter().flatten().map(|errors| errors[0][0]).collect());
        let works = rows.iter().filter(|row| row.verdict == Verdict::WorksModerately);
        let best = works.filter_map(|row| row.errors.as_ref()).map(|e| e[0][0]).fold(f64::INFINITY, f64::min);
        outcome.basis = format!("{} settings, records {} and {}", rows.len(), self.train, self.test);
        shares(&rows, &mut outcome);
        outcome.measure("recipe_over_ours_u_20", best / ours_20);
        outcome.chart(
            "sindy_hydrofoil",
            figure(&rows, ours_20),
            "Error of u after 20 steps against the threshold, for every setting of the thesis. Crosses at the upper edge are settings that diverged or have no terms. The line is the error of the equations that hydroid identifies with its defaults, which include lag and change of mode. The table contains v and r.",
        );
        outcome.table(
            table,
            "All settings: mean absolute errors of u, v and r. Rollouts start from true states and are compared with the truth.",
        );
        Ok(outcome)
    }
}

/// Shares of the settings by verdict. Only diverged and collapsed ones fail in the sense of the thesis.
fn shares(rows: &[Row], outcome: &mut Outcome) {
    let share = |verdict: Verdict| {
        rows.iter().filter(|row| row.verdict == verdict).count() as f64 / rows.len() as f64
    };
    for (name, verdict) in [
        ("collapsed", Verdict::Collapsed),
        ("diverging", Verdict::Diverges),
        ("no_propeller", Verdict::LostItsPropeller),
        ("hardly_better", Verdict::HardlyBetterThanPersistence),
        ("moderate", Verdict::WorksModerately),
    ] {
        outcome.measure(&format!("{name}_share"), share(verdict));
    }
    outcome.measure("failing_share", share(Verdict::Collapsed) + share(Verdict::Diverges));
}

fn errors(found: Option<&recipe::Errors>) -> Vec<Cell> {
    match found {
        Some(found) => found.iter().flatten().map(|&x| Cell::Number(x)).collect(),
        None => (0..3 * HORIZONS.len()).map(|_| Cell::Nothing).collect(),
    }
}

/// Thresholds on a logarithmic axis; zero is drawn at the left.
fn figure(rows: &[Row], ours: f64) -> Figure {
    let place = |threshold: f64| if threshold > 0.0 { threshold.log10() } else { -2.7 };
    let height = |row: &Row| row.errors.as_ref().map(|errors| errors[0][0].log10());
    let top = 0.6;
    let mut panel = Panel::new("error of u after 20 steps [m/s]").height(240.0).decades().range(-4.2, top);
    let mut figure =
        Figure::new("Error against the threshold, settings of the thesis", "threshold (leftmost: none)")
            .x_decades()
            .x_range(-2.9, -0.15);
    for (unit, sign, shift) in [("N", Sign::Ring, -0.02), ("100 N", Sign::Disc, 0.02)] {
        let of = |good: bool| {
            let some = rows.iter().filter(|row| {
                row.unit == unit && good == (height(row).is_some() && row.diverged == 0 && row.terms > 0)
            });
            some.map(|row| {
                (
                    place(row.threshold) + shift,
                    if good { height(row).unwrap_or(top).min(top) } else { top - 0.1 },
                )
            })
            .collect::<Vec<_>>()
        };
        let colour = if unit == "N" { style::PERSISTENCE } else { style::INK };
        panel = panel
            .mark(Mark::Points(Points { points: of(true), sign, colour, radius: 3.5, label: None }))
            .mark(Mark::Points(Points {
                points: of(false),
                sign: Sign::Cross,
                colour,
                radius: 4.0,
                label: None,
            }));
        figure = figure.key(Key::Sign(sign, colour), format!("thesis, propeller in {unit}"));
    }
    let line = palette::line("sindy");
    panel = panel.mark(Mark::Line(Line::new(vec![(-2.9, ours.log10()), (-0.15, ours.log10())], line)));
    figure.key(Key::Line(line), "hydroid, defaults").panel(panel)
}
