//! Arguments that sessions over all links have in common.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args as ClapArgs;

use hydroid::config::value::{named, numbers};
use hydroid::identify::GivenRange;

/// Commands to the vessel.
#[derive(Debug, ClapArgs)]
#[command(next_help_heading = "Commands")]
pub struct CommandArgs {
    /// Permit commands to the vessel: experiments, and steering with a model
    #[arg(long)]
    pub allow_commands: bool,
    /// Compute commands and send none
    #[arg(long)]
    pub dry_run: bool,
    /// Experiment to start as soon as the preflight permits it: auto, acceleration, zigzag-20, zigzag-10, circle, prbs, chirp
    #[arg(long, value_name = "NAME")]
    pub experiment: Option<String>,
    /// Inputs that push the boat ahead; -NAME pushes astern
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_name = "LIST")]
    pub push: Vec<String>,
    /// Inputs that turn it to starboard; -NAME turns to port
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_name = "LIST")]
    pub turn: Vec<String>,
    /// Limits of commands in the units of the model (default for MAVLink: pulses from 1100 to 1900 us)
    #[arg(long, value_delimiter = ',', value_parser = named::<GivenRange>, value_name = "NAME=LOW:HIGH")]
    pub limit: Vec<(String, GivenRange)>,
    /// Neutral commands in the units of the model (default: those of [boat.inputs], 1500 for pulses in us, 0 for physical
    /// quantities)
    #[arg(long, value_delimiter = ',', value_parser = named::<f64>, value_name = "NAME=VALUE")]
    pub neutral: Vec<(String, f64)>,
    /// Radius of the geofence [m]
    #[arg(long, default_value_t = 100.0, value_name = "M")]
    pub fence: f64,
    /// Centre of the geofence, latitude and longitude [deg] (default: the first position)
    #[arg(long, allow_hyphen_values = true, value_name = "LAT,LON", value_parser = numbers::<2>)]
    pub fence_centre: Option<[f64; 2]>,
    /// Largest speed over ground [m/s]
    #[arg(long, default_value_t = 3.0, value_name = "M_S")]
    pub max_speed: f64,
    /// Largest yaw rate [deg/s]
    #[arg(long, default_value_t = 60.0, value_name = "DEG_S")]
    pub max_yaw_rate: f64,
    /// Longest duration of an experiment [s]
    #[arg(long, default_value_t = 900.0, value_name = "S")]
    pub duration: f64,
    /// Seed of the signals of experiments
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
}

/// The page.
#[derive(Debug, ClapArgs)]
#[command(next_help_heading = "Page")]
pub struct PageArgs {
    /// Address of the page
    #[arg(long, default_value = "127.0.0.1:8600", value_name = "ADDRESS:PORT")]
    pub page: SocketAddr,
    /// No page
    #[arg(long)]
    pub no_page: bool,
    /// Token of the actions (default: the variable HYDROID_TOKEN, else a random one, which is printed)
    #[arg(long, value_name = "TEXT")]
    pub token: Option<String>,
    /// Names under which the page may be opened beside localhost and addresses
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    pub host_names: Vec<String>,
}

/// What sessions over all links have in common.
#[derive(Debug, ClapArgs)]
pub struct SessionArgs {
    /// The model: a .safetensors file, or new to begin without one
    #[arg(value_name = "MODEL|new", default_value = "new")]
    pub model: PathBuf,
    /// Configuration file with the sections [log], [live] and [control] (default: hydroid.toml in the current folder)
    #[arg(long, short, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Print an example of the configuration file
    #[arg(long)]
    pub print_config: bool,
    /// Folder of recordings and identified models
    #[arg(long, short, default_value = "live", value_name = "DIR")]
    pub output: PathBuf,
    /// Begin without a recording
    #[arg(long)]
    pub no_record: bool,
    /// Horizons of the predictions [s]
    #[arg(long, default_value = "1,2,5,10", value_delimiter = ',', value_name = "LIST")]
    pub horizons: Vec<f64>,
    /// Commands to the vessel.
    #[command(flatten)]
    pub commands: CommandArgs,
    /// The page.
    #[command(flatten)]
    pub web: PageArgs,
    /// Seconds of the session in a second of the clock, for a simulated boat that is faster
    #[arg(long, default_value_t = 1.0, value_name = "X")]
    pub time_scale: f64,
}
