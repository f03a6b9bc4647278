//! Arguments of `hydroid identify`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hydroid::boat::StatedRoles;
use hydroid::config::value::named;
use hydroid::identify::{GateOption, GivenRange, LagOption, MotionOption, RateLimitOption};

use super::{Duration, Horizon, LogArgs, Method};

/// Identify models from logs, judge them by cross-validation or on test runs, and write a report
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/identify.txt"))]
// Flags of the command line.
#[allow(clippy::struct_excessive_bools)]
pub struct Identify {
    /// Logs to identify from. The methods sindy, committee and grey-box are cross-validated over these runs (blocks of one or two
    /// runs) and then fitted to all of them; other methods split them into training, validation and test
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Configuration file (default: hydroid.toml in the current folder, if it exists)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Validation logs, for the choice of hyperparameters, in place of the cross-validation (needs --test)
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub validate: Vec<PathBuf>,
    /// Test logs, for the final evaluation only; without them the cross-validation judges
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub test: Vec<PathBuf>,
    /// Estimate the marked numbers of a vessel file (grey box), beside the methods; the logs are read with the commands of the
    /// file as inputs, and the result is a vessel file again
    #[arg(long, value_name = "BOAT.toml")]
    pub vessel: Option<PathBuf>,
    /// Methods, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "sindy,committee")]
    pub methods: Vec<Method>,
    /// Motion that the models predict: over ground, or through the water with a current for each run, which needs a heading
    /// (default: auto, if the logs have a heading the better one of the cross-validation)
    #[arg(long, value_name = "auto|over-ground|through-water")]
    pub motion: Option<MotionOption>,
    /// Rates at which actuators follow their commands, per second: auto, none, or 'delta=4 [deg],n=10' (default: auto, in a
    /// cross-validation those that reduce its error significantly). The models contain them
    #[arg(long, value_name = "auto|none|LIST")]
    pub rate_limit: Option<RateLimitOption>,
    /// Roles of inputs: propulsion, steering, thruster, disturbance or setting, as in delta=steering,wind=disturbance
    /// (default: those of the model, found from names, units and its response)
    #[arg(long, value_name = "INPUT=ROLE,..")]
    pub role: Option<StatedRoles>,
    /// Limits of a command, in the unit of the input in the boat, else of the model (default: those of the boat, 35 deg for a
    /// steering angle, or in simulations the range of the log). May be repeated
    #[arg(long, value_name = "NAME=LOW:HIGH", value_delimiter = ',', value_parser = named::<GivenRange>)]
    pub limit: Vec<(String, GivenRange)>,
    /// Value of a command without effect, in the same unit (default: that of the boat, 1500 for pulses in us, 0 for physical
    /// quantities). May be repeated
    #[arg(long, value_name = "NAME=VALUE", value_delimiter = ',', value_parser = named::<f64>)]
    pub neutral: Vec<(String, f64)>,
    /// Longest prediction horizon: samples (100) or seconds (10s) (default: 100 samples, or
    /// half of a block of a short log)
    #[arg(long, value_name = "N|Ns")]
    pub horizon: Option<Horizon>,
    /// Distance between the origins of the final evaluation [samples] (default: 1; about 10,000 origins in a cross-validation)
    #[arg(long, value_name = "N")]
    pub origin_stride: Option<usize>,
    /// Library of terms: families joined by +, as in 'marine + rational': degree N, marine, marine cubic, x|x|, x|y|,
    /// trigonometric, rational, 'inputs x outputs'; optional suffix ', no constant' (default: marine, degree 1 and 2 are compared)
    #[arg(long, value_name = "FAMILIES", help_heading = "Equations")]
    pub library: Option<String>,
    /// A term, as in 'u |u|' or 'n |n| sin(delta)', added to --library or --degree; may be repeated
    #[arg(long, alias = "term", value_name = "TERM", help_heading = "Equations")]
    pub terms: Vec<String>,
    /// A constraint on coefficients, as in 'u: u |u| <= 0' or 'v: u r = r: u v'; may be repeated
    #[arg(long, alias = "constraint", value_name = "OUTPUT: TERM <= 0", help_heading = "Equations")]
    pub constraints: Vec<String>,
    /// Dissipative damping: coefficients of y and y |y| in the equation of y are at most 0
    #[arg(long, help_heading = "Equations")]
    pub dissipative: bool,
    /// First-order lags of the actuators: auto, none, or time constants [s]: n=1.5,delta=0.3 (default: auto)
    #[arg(long, value_name = "auto|none|LIST", help_heading = "Equations")]
    pub lag: Option<LagOption>,
    /// Gate between two regimes: auto, none, or OUTPUT=CENTRE/SLOPE: u=2.5/12 (default: auto)
    #[arg(long, value_name = "auto|none|GATE", help_heading = "Equations")]
    pub gate: Option<GateOption>,
    /// Huber threshold of the residuals [standard deviations]: 1.345 is usual (default: least squares)
    #[arg(long, value_name = "X", allow_negative_numbers = true, help_heading = "Equations")]
    pub huber: Option<f64>,
    /// Refine the coefficients by the output error over many steps (default: only if the model error is close to the noise)
    #[arg(long, help_heading = "Equations", conflicts_with = "no_refine")]
    pub refine: bool,
    /// Keep the coefficients of the regression
    #[arg(long, help_heading = "Equations")]
    pub no_refine: bool,
    /// Members of the ensemble for intervals of coefficients and bands of rollouts; 0: none (default: 50)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1000), help_heading = "Equations")]
    pub members: Option<u16>,
    /// Equations that hydroid control can invert: linear in one function of each command, c, sin(c) or c |c| (method sindy)
    #[arg(long, help_heading = "Equations")]
    pub for_control: bool,
    /// Degree of the polynomial library (default: 1 and 2 are compared)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=6), help_heading = "Equations", conflicts_with = "library")]
    pub degree: Option<u8>,
    /// Sequentially thresholded least squares: drop terms with an effect below X standard deviations of the output per second
    /// (default: backward elimination and BIC)
    #[arg(long, value_name = "X", allow_negative_numbers = true, help_heading = "Equations")]
    pub threshold: Option<f64>,
    /// Window of the regression [s] (default: several are compared)
    #[arg(long, value_name = "S", allow_negative_numbers = true, help_heading = "Equations")]
    pub window: Option<f64>,
    /// Ridge penalty (default: several are compared)
    #[arg(long, value_name = "X", allow_negative_numbers = true, help_heading = "Equations")]
    pub ridge: Option<f64>,
    /// Time limit for the training of all networks: 90, 90s, 5m; the result then depends on the machine (default: none)
    #[arg(long, value_name = "TIME", help_heading = "Networks")]
    pub budget: Option<Duration>,
    /// Design range of outputs and inputs: u=0:6,v=-1:1 or 'u=0:12 [kn]'; sets the scaling of networks and the limit of
    /// divergence (default: the training range). May be repeated
    #[arg(long, alias = "range", value_name = "NAME=LOW:HIGH", value_delimiter = ',', value_parser = named::<GivenRange>, help_heading = "Networks")]
    pub ranges: Vec<(String, GivenRange)>,
    /// Largest number of epochs (default: depends on the network)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Networks")]
    pub epochs: Option<u32>,
    /// Restarts of each training from different initial weights; the best is kept (default: 1)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096), help_heading = "Networks")]
    pub restarts: Option<u16>,
    /// Require that the training continues from the checkpoint in the folder of -o; an error if none fits. Without this option
    /// a fitting checkpoint is used, and others are renamed
    #[arg(long, help_heading = "Networks")]
    pub resume: bool,
    /// Seed of all random numbers (default: 0)
    #[arg(long)]
    pub seed: Option<u64>,
    /// Folder for the models, report.html and identify.json
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    #[command(flatten)]
    pub log: LogArgs,
}
