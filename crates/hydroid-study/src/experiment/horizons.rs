//! Figures 6, 7 and 9: errors of networks over 1 to 100 steps, frozen and adapted.

use std::collections::BTreeMap;

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
    /// Ranges of horizons by name, first and last, for which the share with a lower adapted error is measured.
    #[serde(default)]
    pub shares: BTreeMap<String, Vec<[usize; 2]>>,
    /// One of the models, with which the adapted errors of the others are compared.
    pub reference: Option<String>,
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

/// Median errors of a network, by output and horizon.
#[derive(Clone, Debug, Default)]
struct Curves {
    frozen: Vec<Vec<f64>>,
    adapted: Vec<Vec<f64>>,
}

impl Curves {
    fn of(all: &[Along], which: Which) -> Self {
        let curves = |of: Way<'_>| -> Vec<Vec<f64>> {
            let middle = |n: usize, c: usize| {
                median(all.iter().filter_map(|one| Some(which.of(of(one)?)[n][c])).collect())
            };
            (0..OUTPUTS.len()).map(|c| (0..HORIZON).map(|n| middle(n, c)).collect()).collect()
        };
        Self { frozen: curves(&|one| Some(&one.frozen)), adapted: curves(&|one| Some(&one.adapted)) }
    }

    /// Whether the adapted error is below the frozen one, at each horizon.
    fn better(&self, c: usize) -> Vec<bool> {
        self.adapted[c].iter().zip(&self.frozen[c]).map(|(adapted, frozen)| adapted < frozen).collect()
    }
}

type Way<'a> = &'a dyn Fn(&Along) -> Option<&Errors>;

/// Median, minimum and maximum over models and records.
type Spread = (f64, f64, f64);

impl Horizons {
    pub(super) fn check(&self) -> Result<(), String> {
        for (name, ranges) in &self.shares {
            let within = |&[first, last]: &[usize; 2]| 1 <= first && first <= last && last <= HORIZON;
            if ranges.is_empty() || !ranges.iter().all(within) {
                return Err(format!(
                    "`shares.{name}` needs ranges [first, last] of horizons between 1 and {HORIZON}"
                ));
            }
        }
        match &self.reference {
            Some(name) if !self.models.contains(name) => {
                Err(format!("`reference`: '{name}' is not one of its models"))
            }
            _ => Ok(()),
        }
    }

    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let records = runner.records(&self.records)?;
        let mut outcome = Outcome::default();
        let mut table = Sheet::new(
            format!("{}_error", self.error.word()),
            &["network", "output", "", "1 step", "20 steps", "100 steps"],
        );
        let mut curves = BTreeMap::new();
        for name in &self.models {
            let models = runner.models(name)?;
            outcome.basis(models.len(), &self.records);
            let pairs: Vec<(&Learned, &LoadedRecord)> = models
                .iter()
                .flat_map(|model| records.iter().map(move |record| (model, &**record)))
                .collect();
            let all = runner.each(&format!("{name} along the records"), &pairs, |(model, record)| {
                adaptation(runner, model, record, false)
            })?;
            self.one(name, &all, &mut table, &mut outcome);
            curves.insert(name, Curves::of(&all, self.error));
            self.measures(name, &curves[name], &mut outcome);
            remarks(name, &all, &curves[name], &mut outcome);
        }
        self.compare(&curves, &mut outcome);
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
    }

    /// For each output: share of horizons with an adapted median below the frozen one, of all and of the named ranges;
    /// last horizon up to which all are lower; the horizons that are not, in words; ratio of the medians at 20 steps,
    /// and its median over the horizons.
    fn measures(&self, name: &str, curves: &Curves, outcome: &mut Outcome) {
        for (c, (output, _)) in OUTPUTS.iter().enumerate() {
            let (adapted, frozen) = (&curves.adapted[c], &curves.frozen[c]);
            let better = curves.better(c);
            let named = format!("{name}_{output}");
            outcome.measure(&format!("{named}_better"), share(&better, &[[1, HORIZON]]));
            for (range, ranges) in &self.shares {
                outcome.measure(&format!("{named}_{range}"), share(&better, ranges));
            }
            let falls_to = better.iter().take_while(|better| **better).count();
            outcome.measure(&format!("{named}_falls_to"), falls_to as f64);
            outcome.words.insert(format!("{named}_falls_to"), falls_to.to_string());
            outcome.words.insert(format!("{named}_exceptions"), exceptions(&better));
            outcome.measure(&format!("{named}_left_20"), adapted[19] / frozen[19]);
            outcome.measure(&format!("{named}_20"), adapted[19]);
            let left = adapted.iter().zip(frozen).map(|(adapted, frozen)| adapted / frozen);
            outcome.measure(&format!("{named}_left"), median(left.collect()));
        }
    }

    /// Adapted errors divided by those of the reference, median over the horizons.
    fn compare(&self, curves: &BTreeMap<&String, Curves>, outcome: &mut Outcome) {
        let Some((reference, against)) = self.reference.as_ref().and_then(|name| curves.get_key_value(name))
        else {
            return;
        };
        for (name, of) in curves.iter().filter(|(name, _)| *name != reference) {
            for (c, (output, _)) in OUTPUTS.iter().enumerate() {
                let ratio = of.adapted[c].iter().zip(&against.adapted[c]).map(|(a, b)| a / b);
                outcome.measure(&format!("{name}_{output}_over_{reference}"), median(ratio.collect()));
            }
        }
    }
}

fn remarks(name: &str, all: &[Along], curves: &Curves, outcome: &mut Outcome) {
    let worse = (0..OUTPUTS.len()).filter(|&c| curves.better(c).contains(&false));
    let worse: Vec<&str> = worse.map(|c| OUTPUTS[c].0).collect();
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

/// Share of the horizons in `ranges` (first and last, from 1) that are `better`.
fn share(better: &[bool], ranges: &[[usize; 2]]) -> f64 {
    let inside = |n: usize| ranges.iter().any(|&[first, last]| (first..=last).contains(&(n + 1)));
    let chosen: Vec<bool> = better.iter().enumerate().filter(|&(n, _)| inside(n)).map(|(_, b)| *b).collect();
    chosen.iter().filter(|better| **better).count() as f64 / chosen.len() as f64
}

/// The horizons that are not `better`: `none`, `all`, or ranges such as `3, 97 to 99`.
fn exceptions(better: &[bool]) -> String {
    if better.iter().all(|better| *better) {
        return "none".to_owned();
    }
    if !better.contains(&true) {
        return "all".to_owned();
    }
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for n in (0..better.len()).filter(|&n| !better[n]).map(|n| n + 1) {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == n => *last = n,
            _ => ranges.push((n, n)),
        }
    }
    let words = ranges
        .iter()
        .map(|&(first, last)| if first == last { first.to_string() } else { format!("{first} to {last}") });
    words.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_exceptions_count_horizons_from_one() {
        let mut better = vec![true; HORIZON];
        assert_eq!((share(&better, &[[1, 100]]), exceptions(&better).as_str()), (1.0, "none"));
        for n in [3, 97, 98, 99] {
            better[n - 1] = false;
        }
        assert_eq!(exceptions(&better), "3, 97 to 99");
        assert_eq!(share(&better, &[[1, 96], [100, 100]]), 96.0 / 97.0);
        assert_eq!(share(&better, &[[97, 99]]), 0.0);
        assert_eq!(exceptions(&[false; HORIZON]), "all");
    }
}
