//! Arguments of `hydroid export`.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use hydroid::config;
use hydroid_export::Precision;

/// Write a model in the format of another tool: C, ONNX, CasADi, FMU, Gazebo, MSS, LaTeX
///
/// The exported model has constant weights, or learns along a run (--to c --adapter). A rollout of it is that of the model to
/// rounding. A format that cannot express a model is refused with the reason.
#[derive(Debug, ClapArgs)]
#[command(after_help = include_str!("help/export.txt"))]
pub struct Export {
    /// The model: a .safetensors file, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Format
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub to: Target,
    /// File, whose name without the extension is the name of the exported model; or a folder
    #[arg(long, short, required = true, value_name = "FILE|FOLDER")]
    pub output: PathBuf,
    /// Name of the exported model, a prefix of all its names (default: that of the file, or of the model)
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// Sample time of a vessel [s] (default: 0.1); an identified model has its own
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub dt: Option<f64>,
    /// c, onnx: type of the numbers (default: double)
    #[arg(long, value_enum, value_name = "TYPE")]
    pub precision: Option<PrecisionKind>,
    /// c: the exported model learns along a run, by the method of hydroid adapt (equations, committees, recurrent networks)
    #[arg(long)]
    pub adapter: bool,
    /// fmu: version of the Functional Mock-up Interface (default: 3)
    #[arg(long, value_name = "2|3", value_parser = clap::value_parser!(u8).range(2..=3))]
    pub fmi: Option<u8>,
    /// fmu: libraries hydroid-fmu, one for each platform (default: that of this computer, beside the program)
    #[arg(long, value_name = "FILES", value_delimiter = ',')]
    pub library: Vec<PathBuf>,
    /// sdf, mss, latex: vessel file with mass, added mass, length and density of the water, for equations of motion, whose
    /// coefficients are accelerations
    #[arg(long, value_name = "FILE")]
    pub vessel: Option<PathBuf>,
    /// sdf, latex: speed [m/s] of the prime system and of the linear derivatives of a straight course (default for equations: the
    /// middle of their training range)
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub speed: Option<f64>,
    /// latex: length [m] of the prime system (default: that of the vessel file)
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub length: Option<f64>,
    /// sdf: name of the link in Gazebo (default: base_link)
    #[arg(long, value_name = "NAME")]
    pub link: Option<String>,
    #[command(flatten)]
    pub adaptation: config::Adapt,
}

/// A format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// C99: a header and a source without dependencies
    C,
    /// ONNX: files for start, step, measurement, rollout and rates
    Onnx,
    /// CasADi: a file of Python, with models for do-mpc and acados
    Casadi,
    /// Functional mock-up unit: co-simulation, and model exchange in continuous time
    Fmu,
    /// Hydrodynamics plugins of Gazebo and VRX
    Sdf,
    /// Vessels of the Marine Systems Simulator (Octave, MATLAB) and the Python Vehicle Simulator
    Mss,
    /// Table of hydrodynamic derivatives in LaTeX
    Latex,
}

impl Target {
    /// Name of the format in the command.
    pub fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// Extensions of its files.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::C => &["c", "h"],
            Self::Onnx => &["onnx"],
            Self::Casadi => &["py"],
            Self::Fmu => &["fmu"],
            Self::Sdf => &["sdf"],
            Self::Mss => &["py", "m"],
            Self::Latex => &["tex"],
        }
    }
}

/// Type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PrecisionKind {
    /// 64 bits
    Double,
    /// 32 bits
    Float,
}

impl From<PrecisionKind> for Precision {
    fn from(kind: PrecisionKind) -> Self {
        match kind {
            PrecisionKind::Double => Self::Double,
            PrecisionKind::Float => Self::Float,
        }
    }
}
