//! Sparse equations of the hydrofoil with the settings of the thesis: a polynomial library in `u, v, r` and the two
//! commands, derivatives by finite differences, sequentially thresholded least squares (STLSQ). The propeller force is
//! not measured. Settings that the thesis does not state are varied:
//!
//! - differences: central, or smoothed (slope of a parabola through 11 or 51 samples, Savitzky and Golay 1964);
//! - threshold on the unscaled coefficients, from 0 to 0.5;
//! - unit of the propeller command: N, for which its coefficient in `du/dt` is about 0.005, or 100 N.
//!
//! Rollouts start from true states and are compared with the truth. Each setting has a [`Verdict`].

use std::fmt;
use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::predict::Predictor;
use serde::{Deserialize, Serialize};

use super::StudyError;
use hydroid::evaluate::{Against, DesignRange, Evaluation, Options, Origin, evaluate};
use hydroid::identify::output_ranges;
use hydroid::log::Trajectory;
use hydroid::progress::silent;
use hydroid::sindy::{
    Constraints, FitOptions, Library, LinearRegression, Optimizer, RegressionForm, Scaling, Variables,
};

/// Differences.
pub const DIFFERENCES: [(&str, RegressionForm); 3] = [
    ("central", RegressionForm::Central),
    ("smoothed, 11", RegressionForm::Smoothed { half: 5 }),
    ("smoothed, 51", RegressionForm::Smoothed { half: 25 }),
];
/// Thresholds.
pub const THRESHOLDS: [f64; 8] = [0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5];
/// Units of the propeller command \[N\].
pub const UNITS: [(&str, f64); 2] = [("N", 1.0), ("100 N", 100.0)];
/// Horizons of the table \[samples\].
pub const HORIZONS: [usize; 2] = [20, 100];

/// Verdict on a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// No terms are left.
    Collapsed,
    /// A rollout left ten times the range of the training data.
    Diverges,
    /// No term of `du/dt` has the propeller command.
    LostItsPropeller,
    /// At 100 steps the error of an output is more than half of that of persistence.
    HardlyBetterThanPersistence,
    /// None of these.
    WorksModerately,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Collapsed => "collapsed",
            Self::Diverges => "diverges",
            Self::LostItsPropeller => "lost its propeller",
            Self::HardlyBetterThanPersistence => "hardly better than persistence",
            Self::WorksModerately => "works moderately",
        })
    }
}

/// Errors at [`HORIZONS`], by output.
pub type Errors = [Vec<f64>; 2];

/// A setting and its result.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// Degree of the polynomials.
    pub degree: u8,
    /// One of [`DIFFERENCES`].
    pub difference: String,
    /// One of [`UNITS`].
    pub unit: String,
    /// One of [`THRESHOLDS`].
    pub threshold: f64,
    pub terms: usize,
    /// Mean absolute errors; `None` if every rollout diverged.
    pub errors: Option<Errors>,
    /// Number of diverged rollouts.
    pub diverged: usize,
    pub windows: usize,
    pub verdict: Verdict,
}

/// Evaluates rollouts from true states against the truth.
///
/// # Errors
/// If the run is too short for a rollout, or has no truth.
pub fn judged(
    session: &mut dyn Predictor,
    ranges: &[DesignRange],
    test: &Trajectory,
) -> Result<Evaluation, StudyError> {
    let options = Options {
        horizon: HORIZONS[1],
        origin_stride: 20,
        origin: Origin::True,
        against: Against::Truth,
        warm_up: 1,
        ..Options::default()
    };
    Ok(evaluate("sindy", session, ranges, &[test], &options, &mut silent())?)
}

/// Selects the errors at [`HORIZONS`].
pub fn errors(table: &[Vec<f64>]) -> Errors {
    HORIZONS.map(|horizon| table[horizon - 1].clone())
}

fn has_input(equations: &Equations, input: usize) -> bool {
    let variable = equations.outputs() + input;
    let mut terms = equations.terms().iter().enumerate();
    terms.any(|(j, term)| {
        equations.coefficient(0, j) != 0.0
            && term.factors().iter().any(|factor| usize::from(factor.variable) == variable)
    })
}

/// Fits settings on one run and evaluates them on another.
///
/// # Errors
/// If a run is too short for its library or for a rollout.
pub fn recipe(
    train: &Trajectory,
    test: &Trajectory,
    degrees: &[u8],
    differences: &[(&'static str, RegressionForm)],
    thresholds: &[f64],
) -> Result<Vec<Row>, StudyError> {
    let ranges = output_ranges(&[train]);
    let mut rows = Vec::new();
    for &degree in degrees {
        let terms = Library::polynomial(degree).terms(&Variables::of(train));
        for &(difference, regression) in differences {
            for (unit, scale) in UNITS {
                let scaling = Scaling::Variables(vec![1.0, 1.0, 1.0, scale, 1.0]);
                let prepared = LinearRegression::new(&[train], terms.clone(), regression, &scaling)?;
                for &threshold in thresholds {
                    let options = FitOptions {
                        optimizer: Optimizer::Stlsq(threshold),
                        ridge: 0.0,
                        substeps: 1,
                        constraints: Constraints::default(),
                    };
                    let equations = prepared.fit(&options)?.equations;
                    let (terms, propeller) = (equations.active_terms(), has_input(&equations, 0));
                    let test = judged(&mut EquationsSession::new(Arc::new(equations)), &ranges, test)?;
                    let found = errors(&test.mae);
                    let unchanged = &test.persistence.mae[HORIZONS[1] - 1];
                    let verdict = if terms == 0 {
                        Verdict::Collapsed
                    } else if test.diverged > 0 {
                        Verdict::Diverges
                    } else if !propeller {
                        Verdict::LostItsPropeller
                    } else if found[1].iter().zip(unchanged).any(|(error, kept)| *error > 0.5 * kept) {
                        Verdict::HardlyBetterThanPersistence
                    } else {
                        Verdict::WorksModerately
                    };
                    let (diverged, windows) = (test.diverged, test.windows);
                    rows.push(Row {
                        degree,
                        difference: difference.to_owned(),
                        unit: unit.to_owned(),
                        threshold,
                        terms,
                        errors: found.iter().flatten().all(|x| x.is_finite()).then_some(found),
                        diverged,
                        windows,
                        verdict,
                    });
                }
            }
        }
    }
    Ok(rows)
}
