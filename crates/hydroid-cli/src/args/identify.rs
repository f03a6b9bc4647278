//! What can be said to `hydroid identify`.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use hydroid::identify::{GateSetting, Lags};

use super::{Duration, Horizon, LogArgs, Method, NamedRange};

/// Learn a model from logs, judge it on runs that were held back, and write a report
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:
  hydroid identify -o demo                                     no log: simulates a hydrofoil and identifies it
  hydroid identify a.csv b.csv c.csv -o out                    three runs: trains on a, chooses on b, tests on c
  hydroid identify a.csv --validate b.csv --test c.csv --outputs u,v,r --inputs n,delta -o out
  hydroid identify long.csv -o out                             one run: 60 % / 20 % / 20 % in blocks
  hydroid identify a.csv b.csv c.csv --gate u=2.5/12 --lag n=1.5 --dissipative -o out
  hydroid identify a.csv b.csv c.csv --library 'marine + rational' --constraint 'v: u r = r: u v' -o out
  hydroid identify a.csv b.csv c.csv --term u --term 'u |u|' --term 'n |n|' --lag none --gate none -o out
  hydroid identify a.csv b.csv c.csv --methods sindy --for-control -o out      to steer with: hydroid control
  hydroid identify a.csv b.csv c.csv --methods sindy,lstm,gru --budget 5m --range u=0:6,v=-1:1 -o out
  hydroid identify a.csv b.csv c.csv --methods sindy,lstm,gru --budget 5m --range u=0:6,v=-1:1 -o out --resume
  hydroid identify a.csv b.csv c.csv --methods sindy,direct --horizon 20 -o out      all 20 steps at once
  hydroid identify -c hydroid.toml -o out

A configuration file can hold all of it but --methods; what the command line says goes before:
  [log]                                  [split]                     [identify]
  time = \"t_s\"                           train = [\"a.csv\"]           horizon = \"10s\"
  outputs = [\"u=u_mps [m/s]\", \"v\"]       validate = [\"b.csv\"]
  inputs = [\"n\", \"delta [deg]\"]          test = [\"c.csv\"]
  wind = { speed = \"ws\", direction = \"wd\" }

  [sindy]
  library = \"marine\"           terms = [\"u |u|\", \"v r\"]            lag = { n = 1.5 }    (or \"auto\", \"none\")
  dissipative = true           constraints = [\"u: n |n| >= 0\"]    gate = { output = \"u\", centre = 2.5, slope = 12 }
  huber = 1.345                members = 50                         refine = false       (or true, \"auto\")

  [network]                    [gru]  (or lstm, rnn: before [network])        [ranges]
  feedback = true              hidden = 32                                    u = [0, 6]
  base = \"hold\"                epochs = 400                                   n = \"0:600 [rpm]\"
  refit = true
                               [direct]  (hears nothing of [network])
                               history_s = 4.0
                               hidden = 256
                               base = \"equations\"             (or \"nothing\", \"hold\"; of sindy or lagged)

                               [affine]  (hears nothing of [network])
                               maps = [\"identity\", \"sine\"]
                               hidden = 32")]
// Flags of a command line.
#[allow(clippy::struct_excessive_bools)]
pub struct Identify {
    /// Training logs, or all logs where none is named for validation and test
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Configuration file (default: hydroid.toml, if there is one in this folder)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Logs on which, beside the training logs, settings are chosen
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub validate: Vec<PathBuf>,
    /// Logs on which the chosen model is judged
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub test: Vec<PathBuf>,
    /// Methods, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "sindy,lagged,recursive")]
    pub methods: Vec<Method>,
    /// Longest prediction horizon: samples (100) or seconds (10s) (default: 100 samples)
    #[arg(long, value_name = "N|Ns")]
    pub horizon: Option<Horizon>,
    /// Samples between the origins of the final evaluation (default: 1)
    #[arg(long, value_name = "N")]
    pub origin_stride: Option<usize>,
    /// The one library to use: families joined by +: degree N, marine, marine cubic, x|x|, x|y|, trigonometric,
    /// rational, 'inputs x outputs'; ', no constant' behind (default: marine and polynomials up to degree 2 are tried)
    #[arg(long, value_name = "FAMILIES", help_heading = "Equations")]
    pub library: Option<String>,
    /// A term in words, as in 'u |u|' or 'n |n| sin(delta)'; may be repeated. Added to --library or --degree, the
    /// whole library without them
    #[arg(long = "term", value_name = "TERM", help_heading = "Equations")]
    pub terms: Vec<String>,
    /// What a coefficient must obey, as in 'u: u |u| <= 0', or 'v: u r = r: u v'; may be repeated
    #[arg(long = "constraint", value_name = "OUTPUT: TERM <= 0", help_heading = "Equations")]
    pub constraints: Vec<String>,
    /// Damping may not push: coefficients of y and y |y| in the equation of y are not positive
    #[arg(long, help_heading = "Equations")]
    pub dissipative: bool,
    /// Actuators that follow their commands with a lag: auto (looked for), none, or time constants [s]:
    /// n=1.5,delta=0.3 (default: auto)
    #[arg(long, value_name = "auto|none|LIST", help_heading = "Equations")]
    pub lag: Option<Lags>,
    /// Where the equations change: auto (looked for), none, or OUTPUT=CENTRE/SLOPE: u=2.5/12 (default: auto)
    #[arg(long, value_name = "auto|none|GATE", help_heading = "Equations")]
    pub gate: Option<GateSetting>,
    /// Count residuals beyond so many standard deviations linearly, so that spikes hardly matter: 1.345 is
    /// usual (default: least squares)
    #[arg(long, value_name = "X", allow_negative_numbers = true, help_heading = "Equations")]
    pub huber: Option<f64>,
    /// Refine the coefficients by predictions over many steps wherever that makes predictions better (default: only
    /// where predictions miss the measurements by hardly more than the noise of the sensors)
    #[arg(long, help_heading = "Equations", conflicts_with = "no_refine")]
    pub refine: bool,
    /// Leave the coefficients at the regression's estimate
    #[arg(long, help_heading = "Equations")]
    pub no_refine: bool,
    /// Members of the ensemble that gives coefficients their intervals and rollouts their bands; 0 for none
    /// (default: 50)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1000), help_heading = "Equations")]
    pub members: Option<u16>,
    /// Equations for hydroid control, whose laws invert them: terms are linear in one function of each command (c, sin(c) or
    /// c |c|), which is chosen on the validation logs (method sindy)
    #[arg(long, help_heading = "Equations")]
    pub for_control: bool,
    /// Degree of the polynomial library (default: 1 and 2 are tried)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=6), help_heading = "Equations", conflicts_with = "library")]
    pub degree: Option<u8>,
    /// Select terms by thresholded least squares: drop those that move an output by less than this many of
    /// its standard deviations per second (default: backward elimination and BIC)
    #[arg(long, value_name = "X", allow_negative_numbers = true, help_heading = "Equations")]
    pub threshold: Option<f64>,
    /// Regress over this time [s] (default: one sample, what the noise asks for and shares of the horizon are tried)
    #[arg(long, value_name = "S", allow_negative_numbers = true, help_heading = "Equations")]
    pub window: Option<f64>,
    /// Ridge penalty (default: several are tried)
    #[arg(long, value_name = "X", allow_negative_numbers = true, help_heading = "Equations")]
    pub ridge: Option<f64>,
    /// Time for the training of all networks together: 90, 90s, 5m (default: until all epochs are done). With it the
    /// result depends on how fast the machine is
    #[arg(long, value_name = "TIME", help_heading = "Networks")]
    pub budget: Option<Duration>,
    /// The range that an output or input is meant for, in its unit or another: u=0:6, or 'u=0:12 [kn]'; a list, or
    /// repeated. It decides how networks are scaled and where a rollout counts as diverged (default: the range of
    /// the training logs)
    #[arg(long = "range", value_name = "NAME=LOW:HIGH", value_delimiter = ',', help_heading = "Networks")]
    pub ranges: Vec<NamedRange>,
    /// Passes over the training logs at the most (default: see docs/networks.md)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Networks")]
    pub epochs: Option<u32>,
    /// Trainings of each network from different first weights, of which the best is kept (default: 1)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096), help_heading = "Networks")]
    pub restarts: Option<u16>,
    /// Insist on going on with trainings that were interrupted in the folder of -o: an error if there is none, or one
    /// of another job. (Without it the same command goes on as well, and another begins anew)
    #[arg(long, help_heading = "Networks")]
    pub resume: bool,
    /// Seed of everything random (default: 0)
    #[arg(long)]
    pub seed: Option<u64>,
    /// Folder for the models, report.html and identify.json
    #[arg(long, short, value_name = "DIR")]
    pub output: PathBuf,
    #[command(flatten)]
    pub log: LogArgs,
}
