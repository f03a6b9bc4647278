//! Types of option values.

use std::str::FromStr;

use clap::ValueEnum;
use hydroid::identify::{self, GivenRange};
use hydroid::log::CommandTiming;

pub(super) fn parse_timing(text: &str) -> Result<CommandTiming, String> {
    match text {
        "before" => Ok(CommandTiming::Before),
        "after" => Ok(CommandTiming::After),
        _ => Err(String::from(
            "write before (the command of a row acts from this row on) or after (it acted until this row)",
        )),
    }
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let wrong = || format!("'{text}' is not {N} numbers separated by commas");
    let all: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
    match <[f64; N]>::try_from(all) {
        Ok(all) if all.iter().all(|x| !x.is_nan()) => Ok(all),
        _ => Err(wrong()),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair(pub [f64; 2]);

impl FromStr for Pair {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        numbers(text).map(Self)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triple(pub [f64; 3]);

impl FromStr for Triple {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        numbers(text).map(Self)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Points(pub Vec<[f64; 2]>);

impl FromStr for Points {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let points = text.split(';').filter(|part| !part.trim().is_empty()).map(numbers);
        let points = points.collect::<Result<_, String>>();
        points.map(Self).map_err(|why| format!("{why}: write points as NORTH,EAST;NORTH,EAST;.."))
    }
}

/// A number and its channel: `u=0.01`.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedNumber {
    pub name: String,
    pub number: f64,
}

impl FromStr for NamedNumber {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is not NAME=NUMBER, as in u=0.01");
        let (name, number) = text.split_once('=').ok_or_else(wrong)?;
        Ok(Self { name: name.trim().to_owned(), number: number.trim().parse().map_err(|_| wrong())? })
    }
}

/// A design range and its channel: `u=0:6`, `u=0:12 [kn]`.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedRange {
    pub name: String,
    pub range: GivenRange,
}

impl FromStr for NamedRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, range) = text.split_once('=').ok_or_else(|| {
            format!("'{text}' is not a range: write NAME=LOW:HIGH, as in u=0:6, or u=0:12 [kn]")
        })?;
        Ok(Self { name: name.trim().to_owned(), range: range.parse()? })
    }
}

/// Methods of identification.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Sparse equations of motion
    Sindy,
    /// Equations with past outputs and inputs
    Lagged,
    /// Equations with recursive adaptation
    Recursive,
    /// Difference equations that are combined by cross-validation and learn along a run
    Committee,
    /// The marked numbers of the vessel file in --vessel
    GreyBox,
    /// A recurrent network with LSTM cells
    Lstm,
    /// A recurrent network with GRU cells
    Gru,
    /// A vanilla recurrent network
    Rnn,
    /// A feed-forward network that predicts all steps of a horizon at once
    Direct,
    /// A feed-forward network of the accelerations, affine in the inputs: for control laws that invert the model
    Affine,
}

impl From<Method> for identify::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::Sindy => Self::Sindy,
            Method::Lagged => Self::Lagged,
            Method::Recursive => Self::Recursive,
            Method::Committee => Self::Committee,
            Method::GreyBox => Self::GreyBox,
            Method::Lstm => Self::Lstm,
            Method::Gru => Self::Gru,
            Method::Rnn => Self::Rnn,
            Method::Direct => Self::Direct,
            Method::Affine => Self::Affine,
        }
    }
}

/// Outputs that the model observes before the origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Origin {
    /// The measurements
    Measured,
    /// The true outputs of a simulated log
    True,
}

/// Reference of the errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Against {
    /// The measurements
    Measurement,
    /// The true outputs of a simulated log
    Truth,
}
