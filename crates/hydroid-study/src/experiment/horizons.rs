//! Figures 6, 7 and 9: errors of networks over 1 to 100 steps, frozen and adapted.

use serde::{Deserialize, Serialize};

use super::super::StudyError;
use super::super::outcome::{Cell, Outcome, Sheet};
use super::super::palette;
use super::super::runner::{Learned, LoadedRecord, Runner};
use super::adaptation::{Along, Errors, HORIZON, adaptation};
use super::{OUTPUTS, median, range};
use hydroid_report::figure::{Figure, Key, Line, Mark, Panel};

/// Errors against the horizon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Horizons {
    /// Networks, one figure each.
    pub models: Vec<String>,
    pub records: Vec<String>,
    /// Mean or largest error.
    pub error: Which,
}

/// Statistic over the origins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Which {
    Mean,
    Max,
}

impl Which {
    const fn word(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Max => "largest",
        }
    }

    fn of(self, errors: &Errors) -> &[Vec<f64>] {
        match self {
            Self::Mean => &errors.mean,
            Self::Max => &errors.max,
        }
    }
}

type Way<'a> = &'a dyn Fn(&Along) -> Option<&Errors>;

/// Median, minimum and maximum over models and records.
type Spread = (f64, f64, f64);

impl Horizons {
    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let records = runner.records(&self.records)?;
        let mut outcome = Outcome::default();
        let mut table = Sheet::new(
            format!("{}_error", self.error.word()),
            &["network", "output", "", "1 step", "20 steps", "100 steps"],
        );
        for name in &self.models {
            let models = runner.models(name)?;
            let pairs: Vec<(&Learned, &LoadedRecord)> = models
                .iter()
                .flat_map(|model| records.iter().map(move |record| (model, &**record)))
                .collect();
            let all = runner.each(&format!("{name} along the records"), &pairs, |(model, record)| {
                adaptation(runner, model, record, false)
            })?;
            self.one(name, &all, &mut table, &mut outcome);
        }
        let of = format!(
            "{} seeds of training and {} of noise",
            runner.models(&self.models[0])?.len(),
            records.len()
        );
        outcome.table(
            table,
            format!("The {} error of u, v and r against the truth; medians over {of}.", self.error.word()),
        );
        Ok(outcome)
    }

    fn one(&self, name: &str, all: &[Along], table: &mut Sheet, outcome: &mut Outcome) {
        let spread = |of: Way<'_>, n: usize, c: usize| -> Spread {
            let values: Vec<f64> = all.iter().filter_map(|one| Some(self.error.of(of(one)?)[n][c])).collect();
            let (low, high) = range(&values);
            (median(values), low, high)
        };
        let ways: [(&str, Way<'_>); 3] = [
            ("frozen", &|one| Some(&one.frozen)),
            ("state filtered", &|one| one.filtered.as_ref()),
            ("adapted", &|one| Some(&one.adapted)),
        ];
        let network = palette::title(name);
        let mut figure = Figure::new(
            format!("{network}: {} error over the horizon, frozen and adapted", self.error.word()),
            "steps of 0.1 s ahead",
        )
        .x_range(0.0, HORIZON as f64);
        let mut sheet = Sheet::new(
            format!("{name}_{}", self.error.word()),
            &["output", "steps", "way", "median", "least", "largest"],
        );
        for (c, (output, unit)) in OUTPUTS.iter().enumerate() {
            let mut panel =
                Panel::new(format!("{} error of {output} [{unit}]", self.error.word())).height(130.0);
            let mut top = 0.0f64;
            for (way, of) in ways {
                let curve: Vec<Spread> = (0..HORIZON).map(|n| spread(of, n, c)).collect();
                let step = |n: usize| n as f64 + 1.0;
                if curve.iter().all(|(middle, ..)| middle.is_nan()) {
                    continue;
                }
                for (n, (middle, low, high)) in curve.iter().enumerate() {
                    sheet.row(vec![
                        (*output).into(),
                        (n + 1).into(),
                        way.into(),
                        (*middle).into(),
                        (*low).into(),
                        (*high).into(),
                    ]);
                }
                top = curve.iter().map(|(middle, ..)| *middle).fold(top, f64::max);
                if way == "adapted" {
                    top = curve.iter().map(|(.., high)| *high).fold(top, f64::max);
                    let points =
                        curve.iter().enumerate().map(|(n, (_, low, high))| (step(n), *low, *high)).collect();
                    panel = panel.mark(Mark::Band { points, colour: palette::colour(name), opacity: 0.18 });
                }
                let points = curve.iter().enumerate().map(|(n, (middle, ..))| (step(n), *middle)).collect();
                panel = panel.mark(Mark::Line(Line::new(points, palette::way(way, name))));
            }
            figure = figure.panel(panel.range(0.0, 1.05 * top));
        }
        for (way, _) in ways {
            figure = figure.key(
                Key::Line(palette::way(way, name)),
                if way == "frozen" { "frozen, as trained" } else { way },
            );
        }
        for (c, (output, unit)) in OUTPUTS.iter().enumerate() {
            for (way, of) in ways {
                let mut row: Vec<Cell> =
                    vec![network.clone().into(), format!("{output} [{unit}]").into(), way.into()];
                row.extend([1, 20, 100].map(|n| Cell::Number(spread(of, n - 1, c).0)));
                if row.iter().any(|cell| matches!(cell, Cell::Number(x) if x.is_finite())) {
                    table.row(row);
                }
            }
        }
        let caption = format!(
            "{network}, trained at low speed, along lawn-mower records with flight: {} error of u, v and r against the truth.{}",
            self.error.word(),
            if all.len() > 1 {
                format!(
                    " Lines are medians over {} runs with different seeds of training and of noise. The band is the range of the adapted network.",
                    all.len()
                )
            } else {
                String::new()
            }
        );
        outcome.chart(&format!("{name}_{}", self.error.word()), figure, caption);
        outcome.sheets.push(sheet);
        self.measures(name, all, outcome);
    }

    /// Share of horizons with an adapted median below the frozen one, for each output, and ratio of the errors at 20
    /// steps.
    fn measures(&self, name: &str, all: &[Along], outcome: &mut Outcome) {
        let middle = |of: Way<'_>, n: usize, c: usize| {
            median(all.iter().filter_map(|one| Some(self.error.of(of(one)?)[n][c])).collect())
        };
        let frozen: Way<'_> = &|one| Some(&one.frozen);
        let adapted: Way<'_> = &|one| Some(&one.adapted);
        for (c, (output, _)) in OUTPUTS.iter().enumerate() {
            let better = (0..HORIZON).filter(|&n| middle(adapted, n, c) < middle(frozen, n, c)).count();
            outcome.measure(&format!("{name}_{output}_better"), better as f64 / HORIZON as f64);
            let left = middle(adapted, 19, c) / middle(frozen, 19, c);
            outcome.measure(&format!("{name}_{output}_left_20"), left);
            outcome.measure(&format!("{name}_{output}_20"), middle(adapted, 19, c));
        }
        let worse: Vec<&str> = OUTPUTS
            .iter()
            .enumerate()
            .filter(|&(c, _)| (0..HORIZON).any(|n| middle(adapted, n, c) >= middle(frozen, n, c)))
            .map(|(_, (output, _))| *output)
            .collect();
        if !worse.is_empty() {
            outcome.remarks.push(format!(
                "{}: at some horizons, adaptation does not lower the error of {}.",
                palette::title(name),
                worse.join(", ")
            ));
        }
        let diverged: usize = all.iter().map(|one| one.adapted.diverged + one.frozen.diverged).sum();
        if diverged > 0 {
            outcome.remarks.push(format!(
                "{}: {diverged} rollouts diverged and are excluded from all values.",
                palette::title(name)
            ));
        }
    }
}
