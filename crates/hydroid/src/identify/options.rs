//! Options of the search for equations.
// Help texts come from the comments of the options; brackets are units.
#![expect(rustdoc::broken_intra_doc_links, reason = "the comments are help texts, too")]

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::IdentifyError;
use super::expressions::channel_index;
use crate::log::Trajectory;
use crate::sindy::{
    Criterion, Family, GateSpec, Lag, Library, Loss, Optimizer, RefineScope, RegressionForm, SearchGrid,
    Structure, StructureSpec, weak_form_from_noise, white_noise_std,
};
use crate::written;

#[cfg(feature = "arguments")]
const EQUATIONS: &str = "Equations";

/// Options of the search for equations, of the command, of the section `[sindy]` of a file, and of Python. Options that are
/// not given are selected on the validation runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "arguments", derive(clap::Args), group(skip))]
pub struct SindyOptions {
    /// Library of terms: families joined by +, as in 'marine + rational': degree N, marine, marine cubic, x|x|, x|y|,
    /// trigonometric, rational, 'inputs x outputs'; optional suffix ', no constant' (default: marine, degree 1 and 2 are compared)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FAMILIES", help_heading = EQUATIONS))]
    pub library: Option<String>,
    /// A term, as in 'u |u|' or 'n |n| sin(delta)', added to the library or the degree; may be repeated
    #[cfg_attr(feature = "arguments", arg(long, alias = "term", value_name = "TERM", help_heading = EQUATIONS))]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<String>,
    /// A constraint on coefficients, as in 'u: u |u| <= 0' or 'v: u r = r: u v'; may be repeated
    #[cfg_attr(feature = "arguments", arg(long, alias = "constraint", value_name = "OUTPUT: TERM <= 0", help_heading = EQUATIONS))]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub constraints: Vec<String>,
    /// Dissipative damping: coefficients of y and y |y| in the equation of y are at most 0
    #[cfg_attr(feature = "arguments", arg(long, help_heading = EQUATIONS))]
    #[serde(skip_serializing_if = "written::is_off")]
    pub dissipative: bool,
    /// Degree of the polynomial library (default: 1 and 2 are compared; up to 3 where no output is a velocity)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=6), help_heading = EQUATIONS, conflicts_with = "library"))]
    pub degree: Option<u8>,
    /// Whether the polynomial library has signed squares x |x| (default: both are compared; none where no output is a velocity)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "true|false", help_heading = EQUATIONS, conflicts_with = "library"))]
    pub signed_squares: Option<bool>,
    /// Whether the library has the constant 1, a steady force or a sensor offset (default: true)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "true|false", help_heading = EQUATIONS))]
    pub constant: Option<bool>,
    /// First-order lags of the actuators: auto, none, or time constants [s]: n=1.5,delta=0.3 (default: auto)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "auto|none|LIST", help_heading = EQUATIONS))]
    #[serde(deserialize_with = "written::optional")]
    pub lag: Option<LagOption>,
    /// Gate between two regimes: auto, none, or OUTPUT=CENTRE/SLOPE: u=2.5/12 (default: auto; none where no output is a velocity)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "auto|none|GATE", help_heading = EQUATIONS))]
    #[serde(deserialize_with = "written::optional")]
    pub gate: Option<GateOption>,
    /// Delay of the past values in lagged equations [s] (default: several are compared)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = EQUATIONS))]
    #[serde(alias = "past_s")]
    pub past: Option<f64>,
    /// Window of the regression [s] (default: several are compared)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = EQUATIONS))]
    #[serde(alias = "window_s")]
    pub window: Option<f64>,
    /// Central differences in place of the weak form
    #[cfg_attr(feature = "arguments", arg(long, help_heading = EQUATIONS))]
    #[serde(skip_serializing_if = "written::is_off")]
    pub central_differences: bool,
    /// Sequentially thresholded least squares: drop terms with an effect below X standard deviations of the output per second
    /// (default: backward elimination and BIC)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "X", allow_negative_numbers = true, help_heading = EQUATIONS))]
    pub threshold: Option<f64>,
    /// Ridge penalty for each row, on columns of unit RMS (default: several are compared)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "X", allow_negative_numbers = true, help_heading = EQUATIONS))]
    pub ridge: Option<f64>,
    /// Huber threshold of the residuals [standard deviations], against spikes: 1.345 is usual (default: least squares)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "X", allow_negative_numbers = true, help_heading = EQUATIONS))]
    pub huber: Option<f64>,
    /// Refine the coefficients by the output error over many steps: always, or never with false (default: only if the model
    /// error is close to the noise)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "true|false", num_args = 0..=1, require_equals = true, default_missing_value = "true", help_heading = EQUATIONS))]
    pub refine: Option<bool>,
    /// Members of the ensemble for intervals of coefficients and bands of rollouts; 0: none (default: 50)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N", help_heading = EQUATIONS))]
    pub members: Option<usize>,
    /// Equations that control laws can invert: linear in one function of each command, c, sin(c) or c |c| (method sindy)
    #[cfg_attr(feature = "arguments", arg(long, help_heading = EQUATIONS))]
    #[serde(skip_serializing_if = "written::is_off")]
    pub for_control: bool,
}

/// Members of the ensemble without an option.
pub(super) const MEMBERS: usize = 50;

const MAX_MEMBERS: usize = 1000;

/// A keyword in place of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Keyword {
    /// Search.
    Auto,
    /// None.
    None,
}

/// Actuator lags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "lag is \"auto\", \"none\", or time constants in seconds by input: lag = { n = 1.5 }"
)]
pub enum LagOption {
    /// Search, or none.
    Keyword(Keyword),
    /// Time constants \[s\] by the name of the input.
    Fixed(BTreeMap<String, f64>),
}

/// Gate between two modes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "gate is \"auto\", \"none\", or gate = { output = \"u\", centre = 2.5, slope = 12 }"
)]
pub enum GateOption {
    /// Search, or none.
    Keyword(Keyword),
    /// On an output.
    Fixed(FixedGate),
}

/// A gate `sigma(slope (y - centre))`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedGate {
    /// Output that selects the mode.
    pub output: String,
    /// Value with equal weights of both modes, in the unit of the output.
    pub centre: f64,
    /// Slope, per unit of the output.
    pub slope: f64,
}

impl std::str::FromStr for LagOption {
    type Err = String;

    /// `auto`, `none`, or `n=1.5,delta=0.3`.
    fn from_str(text: &str) -> Result<Self, String> {
        let found = keyword_or_list(text, |seconds| seconds.trim_end_matches('s').parse().ok());
        let found = found.map(|found| found.map_or_else(Self::Keyword, Self::Fixed));
        found.ok_or_else(|| format!("'{text}' is not auto, none, or a list like n=1.5,delta=0.3 (seconds)"))
    }
}

/// `auto` or `none` (an error value here), or a list `NAME=VALUE,NAME=VALUE`.
pub(super) fn keyword_or_list<T>(
    text: &str,
    value: impl Fn(&str) -> Option<T>,
) -> Option<Result<BTreeMap<String, T>, Keyword>> {
    match text {
        "auto" => return Some(Err(Keyword::Auto)),
        "none" => return Some(Err(Keyword::None)),
        _ => {}
    }
    let pair = |part: &str| {
        let (name, written) = part.split_once('=')?;
        Some((name.trim().to_owned(), value(written.trim())?))
    };
    text.split(',').map(pair).collect::<Option<_>>().map(Ok)
}

impl std::str::FromStr for GateOption {
    type Err = String;

    /// `auto`, `none`, or `u=2.5/12`: output, centre, slope.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => return Ok(Self::Keyword(Keyword::Auto)),
            "none" => return Ok(Self::Keyword(Keyword::None)),
            _ => {}
        }
        let gate = || {
            let (output, numbers) = text.split_once('=')?;
            let (centre, slope) = numbers.split_once('/')?;
            let (centre, slope) = (centre.trim().parse().ok()?, slope.trim().parse().ok()?);
            Some(FixedGate { output: output.trim().to_owned(), centre, slope })
        };
        gate()
            .map(Self::Fixed)
            .ok_or_else(|| format!("'{text}' is not auto, none, or output=centre/slope like u=2.5/12"))
    }
}

impl SindyOptions {
    /// Checks the options.
    ///
    /// # Errors
    /// If a number is outside its range.
    pub fn check(&self) -> Result<(), IdentifyError> {
        let settings = [
            ("window", "a positive number of seconds", self.window, f64::MIN_POSITIVE),
            ("past", "a positive number of seconds", self.past, f64::MIN_POSITIVE),
            ("threshold", "a number from 0 on", self.threshold, 0.0),
            ("ridge", "a number from 0 on", self.ridge, 0.0),
            ("huber", "a positive number of standard deviations", self.huber, f64::MIN_POSITIVE),
        ];
        for (what, needed, value, least) in settings {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v >= least)) {
                return Err(IdentifyError::InvalidOption { what, value: value.to_string(), needed });
            }
        }
        if let Some(members) = self.members.filter(|members| *members > MAX_MEMBERS) {
            let needed = "a number from 0 to 1000";
            return Err(IdentifyError::InvalidOption { what: "members", value: members.to_string(), needed });
        }
        Ok(())
    }

    /// Lags to search or given lags, by the index of the input.
    ///
    /// # Errors
    /// If an input does not exist, or a time constant is not positive.
    pub fn lags(&self, run: &Trajectory) -> Result<StructureSpec<Vec<Lag>>, IdentifyError> {
        let given = match &self.lag {
            None | Some(LagOption::Keyword(Keyword::Auto)) => return Ok(StructureSpec::Search),
            Some(LagOption::Keyword(Keyword::None)) => return Ok(StructureSpec::Absent),
            Some(LagOption::Fixed(given)) => given,
        };
        let mut lags = Vec::new();
        for (name, &time_constant_s) in given {
            let needed = "a positive number of seconds";
            let wrong = || IdentifyError::InvalidOption {
                what: "lag",
                value: format!("{name}={time_constant_s}"),
                needed,
            };
            let input = channel_index("lag", "input", name, run.inputs.channels())?;
            if !(time_constant_s.is_finite() && time_constant_s > 0.0) {
                return Err(wrong());
            }
            lags.push(Lag { input, time_constant_s });
        }
        Ok(StructureSpec::Fixed(lags))
    }

    /// Gate to search or given gate.
    ///
    /// # Errors
    /// If the output does not exist, a number is invalid, or a mode has too few samples in the training runs.
    pub fn gate(&self, training: &[&Trajectory]) -> Result<StructureSpec<GateSpec>, IdentifyError> {
        let given = match &self.gate {
            None | Some(GateOption::Keyword(Keyword::Auto)) => {
                // Nested gates are not supported.
                let lists = training.first().map_or(Ok(false), |run| self.lists_gates(run))?;
                let is_generic = self.gate.is_none() && training.first().is_some_and(|run| is_generic(run));
                return Ok(if lists || is_generic { StructureSpec::Absent } else { StructureSpec::Search });
            }
            Some(GateOption::Keyword(Keyword::None)) => return Ok(StructureSpec::Absent),
            Some(GateOption::Fixed(given)) => given,
        };
        let FixedGate { output: name, centre, slope } = given;
        let value = || format!("{name}={centre}/{slope}");
        let needed = "OUTPUT=CENTRE/SLOPE with a finite centre and a positive slope";
        let wrong = || IdentifyError::InvalidOption { what: "gate", value: value(), needed };
        let channels = training.first().map_or(&[][..], |run| run.outputs.channels());
        let output = channel_index("gate", "output", name, channels)?;
        if !(centre.is_finite() && slope.is_finite() && *slope > 0.0) {
            return Err(wrong());
        }
        let schedule = GateSpec::new(output, *centre, *slope);
        let share = schedule.upper_mode_share(training.iter().copied());
        if !(0.01..=0.99).contains(&share) {
            let side = if share < 0.5 { "above" } else { "below" };
            return Err(IdentifyError::ModeNotVisited { gate: value(), side, share: share.min(1.0 - share) });
        }
        Ok(StructureSpec::Fixed(schedule))
    }

    /// Libraries of one mode in the search, the simplest first.
    ///
    /// # Errors
    /// If the library is unknown or a listed term is invalid.
    pub fn libraries(&self, run: &Trajectory) -> Result<Vec<Library>, IdentifyError> {
        let listed = self.listed(run)?;
        let named = self.library.is_some() || self.degree.is_some() || self.signed_squares.is_some();
        if !(listed.is_empty() || named) {
            let whole = Library::listed(listed);
            return Ok(vec![if self.constant == Some(true) { whole.with(Family::Constant) } else { whole }]);
        }
        let libraries = if let Some(name) = &self.library {
            vec![name.parse::<Library>().map_err(IdentifyError::Library)?]
        } else {
            let polynomial = |degree, squares| {
                let plain = Library::polynomial(degree);
                if squares { plain.with(Family::SignedSquares) } else { plain }
            };
            match (self.degree, self.signed_squares) {
                (Some(degree), Some(squares)) => vec![polynomial(degree, squares)],
                (Some(degree), None) if is_generic(run) => vec![polynomial(degree, false)],
                (Some(degree), None) => vec![polynomial(degree, false), polynomial(degree, true)],
                (None, squares) if is_generic(run) => {
                    (1..=3).map(|degree| polynomial(degree, squares == Some(true))).collect()
                }
                (None, Some(squares)) => vec![polynomial(1, squares), polynomial(2, squares)],
                (None, None) => {
                    vec![polynomial(1, true), Library::marine(), polynomial(2, false), polynomial(2, true)]
                }
            }
        };
        let constant = self.constant.unwrap_or(true);
        let wanted = |library: Library| if constant { library } else { library.without_constant() };
        let libraries = libraries.into_iter().map(wanted);
        if listed.is_empty() {
            return Ok(libraries.collect());
        }
        Ok(libraries.map(|library| library.with(Family::Listed(listed.clone()))).collect())
    }

    /// The grid of the best subsets for data of no vessel with white noise; none without such noise, and with options that the grid
    /// would not follow.
    pub(super) fn sparsest(
        &self,
        training: &[&Trajectory],
        horizon: usize,
        library: &Library,
    ) -> Option<SearchGrid> {
        let settings = [self.threshold, self.ridge, self.huber, self.window];
        let is_constrained = self.dissipative || !self.constraints.is_empty();
        // A search for lags or a change of mode that is asked for takes place.
        let is_searched = self.gate == Some(GateOption::Keyword(Keyword::Auto))
            || self.lag == Some(LagOption::Keyword(Keyword::Auto));
        let is_other = self.central_differences || self.for_control || is_constrained || is_searched;
        if is_other || settings.iter().any(Option::is_some) {
            return None;
        }
        training.first().filter(|run| is_generic(run))?;
        Some(SearchGrid {
            noise: Some(white_noise_std(training)?),
            regressions: vec![weak_form_from_noise(training)?],
            optimizers: vec![Optimizer::Subset],
            ridges: vec![0.0],
            ..self.grid(training, horizon, std::slice::from_ref(library), &[], true)
        })
    }

    /// Search grid for a horizon \[samples\]. Lags and gates in `found` are combined only with the richer libraries;
    /// `plain` adds all libraries without them.
    pub fn grid(
        &self,
        training: &[&Trajectory],
        horizon: usize,
        libraries: &[Library],
        found: &[Structure],
        plain: bool,
    ) -> SearchGrid {
        let share = |part: f64| intervals(part * horizon as f64);
        let dt = training.first().map_or(1.0, |run| run.dt);
        let regressions = match (self.central_differences, self.window) {
            (true, _) => vec![RegressionForm::Central],
            (false, Some(window)) => vec![RegressionForm::Weak { intervals: intervals(window / dt) }],
            (false, None) => {
                let mut list = vec![1, share(0.2), share(0.5), share(1.0), share(2.0)];
                // The shortest window that averages the noise.
                list.extend(weak_form_from_noise(training).map(RegressionForm::window));
                list.sort_unstable();
                list.dedup();
                list.into_iter().map(|intervals| RegressionForm::Weak { intervals }).collect()
            }
        };
        let mut structures: Vec<Structure> =
            if plain { libraries.iter().cloned().map(Structure::from).collect() } else { Vec::new() };
        let has_rich = libraries.iter().any(is_rich);
        let largest = libraries.len().saturating_sub(2);
        for structure in found {
            let rich = libraries
                .iter()
                .enumerate()
                .filter(|(i, library)| libraries.len() < 3 || is_rich(library) || !has_rich && *i >= largest);
            let rich = rich.map(|(_, library)| library);
            structures
                .extend(rich.map(|library| Structure { library: library.clone(), ..structure.clone() }));
        }
        SearchGrid {
            structures,
            regressions,
            optimizers: self.threshold.map_or_else(
                || {
                    let tolerances = [0.002, 0.005, 0.01, 0.02, 0.05].map(Optimizer::Stepwise);
                    tolerances.into_iter().chain([Optimizer::Criterion(Criterion::Bic)]).collect()
                },
                |threshold| vec![Optimizer::Stlsq(threshold)],
            ),
            ridges: self.ridge.map_or_else(|| vec![1e-6, 1e-2, 0.1, 0.3, 1.0], |ridge| vec![ridge]),
            loss: self.huber.map_or(Loss::Squares, Loss::Huber),
            constraints: Vec::new(),
            noise: None,
            // Given options are not varied.
            refine: (self.refine != Some(false)).then_some(RefineScope {
                lags: !matches!(self.lag, Some(LagOption::Fixed(_))),
                gate: !matches!(self.gate, Some(GateOption::Fixed(_))),
                always: self.refine == Some(true),
            }),
        }
    }
}

/// Whether the outputs are no velocities of a vessel: none is called `u`, `v` or `r`, or has a unit of velocity. Their equations are
/// polynomials.
pub(super) fn is_generic(run: &Trajectory) -> bool {
    run.outputs.channels().iter().all(|channel| {
        !["u", "v", "r"].contains(&channel.name.as_str())
            && !["m/s", "rad/s"].contains(&channel.unit.as_str())
    })
}

pub(super) fn reference(libraries: &[Library]) -> Library {
    let marine = libraries.iter().find(|library| library.families().contains(&Family::Marine));
    marine.or(libraries.last()).cloned().unwrap_or_else(Library::marine)
}

fn is_rich(library: &Library) -> bool {
    let has = |family: &Family| library.families().contains(family);
    has(&Family::Marine) || has(&Family::SignedSquares) && has(&Family::Polynomial { degree: 2 })
}

pub(super) fn intervals(count: f64) -> usize {
    // Bounded far below any usize; a NaN becomes 1.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let whole = count.round().clamp(1.0, 1e6) as usize;
    whole.max(1)
}
