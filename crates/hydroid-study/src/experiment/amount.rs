//! Accuracy against the amount of training data.

use serde::{Deserialize, Serialize};

use super::super::StudyError;
use super::super::outcome::{Outcome, Sheet};
use super::super::palette;
use super::super::runner::Runner;
use super::median;
use super::table::judged;
use hydroid_report::figure::{Figure, Key, Line, Mark, Panel, Points, Sign};

/// Methods, each trained on records of increasing length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Amount {
    /// One line of the figure per method.
    pub series: Vec<Series>,
}

/// Models of one method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Series {
    /// Name of the method.
    pub name: String,
    /// Models, from the shortest to the longest training record.
    pub models: Vec<String>,
}

impl Amount {
    pub(super) fn uses(&self) -> (Vec<&String>, Vec<&String>) {
        (Vec::new(), self.series.iter().flat_map(|series| &series.models).collect())
    }

    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let mut outcome = Outcome::default();
        let mut table = Sheet::new(
            "amount",
            &["method", "log [min]", "20 steps: u [m/s]", "v [m/s]", "r [rad/s]", "training [s]"],
        );
        let mut panel = Panel::new("error of u after 20 steps [m/s]").height(240.0).decades();
        let mut figure =
            Figure::new("Accuracy against the amount of data", "length of the log [min]").x_decades();
        for series in &self.series {
            let mut points = Vec::new();
            for name in &series.models {
                let models = runner.models(name)?;
                let found = models
                    .iter()
                    .map(|learned| judged(runner, name, learned))
                    .collect::<Result<Vec<_>, _>>()?;
                let middle = |c: usize| median(found.iter().map(|judged| judged.at_20[c]).collect());
                let plan =
                    runner.plan().models.get(name).ok_or_else(|| StudyError::missing("model", name))?;
                let minutes =
                    runner.plan().records.get(&plan.train).map_or(f64::NAN, |r| r.duration_s / 60.0);
                points.push((minutes.log10(), middle(0).log10()));
                table.row(vec![
                    series.name.as_str().into(),
                    minutes.into(),
                    middle(0).into(),
                    middle(1).into(),
                    middle(2).into(),
                    median(models.iter().map(|learned| learned.about.seconds).collect()).into(),
                ]);
                outcome.basis(models.len(), &[&plan.test]);
                outcome.measure(&format!("{name}_u_20"), middle(0));
            }
            let stroke = palette::line(&series.models[0]);
            figure = figure.key(Key::Line(stroke), series.name.clone());
            panel = panel.mark(Mark::Line(Line::new(points.clone(), stroke))).mark(Mark::Points(Points {
                points,
                sign: Sign::Disc,
                colour: stroke.colour,
                radius: 4.0,
                label: None,
            }));
        }
        outcome.chart(
            "amount",
            figure.panel(panel),
            "The hydrofoil in both modes: mean absolute error of u, 2 s ahead, against the length of the training log. Rollouts start from measured samples and are compared with the truth. The table contains v and r.",
        );
        outcome.table(table, "Mean absolute errors of u, v and r on the test record.");
        Ok(outcome)
    }
}
