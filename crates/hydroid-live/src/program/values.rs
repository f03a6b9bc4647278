//! Types of option values.

use std::str::FromStr;

use clap::ValueEnum;
use hydroid::identify::GivenRange;

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let wrong = || format!("'{text}' is not {N} numbers separated by commas");
    let all: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
    match <[f64; N]>::try_from(all) {
        Ok(all) if all.iter().all(|x| !x.is_nan()) => Ok(all),
        _ => Err(wrong()),
    }
}

/// Two numbers: `1,2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair(pub [f64; 2]);

impl FromStr for Pair {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        numbers(text).map(Self)
    }
}

/// Three numbers: `1,2,3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triple(pub [f64; 3]);

impl FromStr for Triple {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        numbers(text).map(Self)
    }
}

/// Points: `0,0;40,0`.
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
    /// Name of the channel.
    pub name: String,
    /// The number.
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
    /// Name of the channel.
    pub name: String,
    /// The range.
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

/// Methods of adaptation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Learner {
    /// Recursive least squares on increments (equations) or on the last layer (direct predictors)
    LeastSquares,
    /// An extended Kalman filter over state and weights, which also filters the measurement noise
    Kalman,
}
