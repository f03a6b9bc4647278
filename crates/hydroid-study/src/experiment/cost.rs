//! Accuracy against the computing time of a filter step.

use serde::{Deserialize, Serialize};

use hydroid_core::adapt::kalman::CovarianceForm;

use super::super::StudyError;
use super::super::outcome::{Outcome, Sheet};
use super::super::palette;
use super::super::runner::Runner;
use super::adaptation;
use super::median;
use hydroid::adapt;
use hydroid_report::figure::{Figure, Key, Mark, Panel, Points, Sign};

/// Networks and forms of the stored covariance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    pub models: Vec<String>,
    pub record: String,
    /// Forms of the covariance, as in `hydroid adapt --covariance`.
    pub covariances: Vec<String>,
}

/// Time per sample \[us\], stored numbers, and error of u 20 steps ahead.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Spent {
    us: f64,
    memory: usize,
    error: f64,
}

impl Cost {
    pub(super) fn run(&self, runner: &Runner<'_>) -> Result<Outcome, StudyError> {
        let loaded = runner.record(&self.record)?;
        let mut outcome = Outcome::default();
        let mut table = Sheet::new(
            "cost",
            &["network", "covariance", "time per sample [us]", "memory [kB]", "20 steps: u [m/s]"],
        );
        let mut panel = Panel::new("adapted error of u after 20 steps [m/s]").height(320.0).decades();
        let mut figure =
            Figure::new("Accuracy against the computing time of a filter step", "time per sample [us]")
                .x_decades();
        for name in &self.models {
            let models = runner.models(name)?;
            outcome.basis(models.len(), &[&self.record]);
            let mut points = Vec::new();
            for words in &self.covariances {
                let covariance: CovarianceForm = words.parse().map_err(|error| {
                    runner.cannot(format_args!("'{words}' is not a form of the covariance: {error}"))
                })?;
                // Sequentially, because the result is a time.
                let mut all = Vec::new();
                for learned in models.iter() {
                    runner.fits(learned, &loaded)?;
                    let key = runner.store.key("cost", words, &[learned.key, loaded.key]);
                    all.push(runner.store.get("cost", key, || {
                        let mut options = adaptation::options(false, learned);
                        options.kalman.covariance = covariance;
                        let runs = [&loaded.run];
                        let memory = adapt::adapter(&learned.model, &options, &runs)?.0.memory_len();
                        let what = format!("{name}, {words}");
                        let report =
                            adapt::adapt(&learned.model, &runs, &options, &mut runner.progress(&what))?
                                .report;
                        Ok(Spent {
                            us: report.us_per_sample.median,
                            memory,
                            error: report.adapted.mae[19][0],
                        })
                    })?);
                }
                let of = |value: &dyn Fn(&Spent) -> f64| median(all.iter().map(value).collect());
                let (us, error) = (of(&|s| s.us), of(&|s| s.error));
                points.push(((us.log10(), error.log10()), words.clone()));
                table.row(vec![
                    palette::title(name).into(),
                    words.as_str().into(),
                    us.into(),
                    of(&|s| s.memory as f64 * 8e-3).into(),
                    error.into(),
                ]);
                outcome.measure(&format!("{name}_{words}_us"), us);
            }
            let (colour, sign) = (palette::colour(name), Sign::Disc);
            for (point, words) in points {
                let label = Some(words);
                panel = panel.mark(Mark::Points(Points {
                    points: vec![point],
                    sign,
                    colour,
                    radius: 4.5,
                    label,
                }));
            }
            figure = figure.key(Key::Sign(sign, colour), palette::title(name));
        }
        outcome.chart(
            "accuracy_cost",
            figure.panel(panel),
            format!(
                "Networks trained at low speed, along {}: adapted error of u, 2 s ahead, against the computing time of the filter per sample, for the covariance forms {}. v and r are not compared.",
                self.record,
                self.covariances.join(", ")
            ),
        );
        outcome.table(table, "Form of the weight covariance, computing time, memory, and adapted error of u; medians over seeds.");
        Ok(outcome)
    }
}
