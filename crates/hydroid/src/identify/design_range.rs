//! Design ranges: stated by the user, else the training ranges.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::expressions::channel_index;
use super::{IdentifyError, data_summary};
use crate::evaluate::DesignRange;
use crate::log::units::Unit;
use crate::log::{Channel, Trajectory};

/// A stated range: `0:12`, or `0:12 [kn]` in another unit than that of the channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct GivenRange {
    /// Lowest value expected.
    pub low: f64,
    /// Highest value expected.
    pub high: f64,
    /// Its unit; that of the channel if none is given.
    pub unit: Option<String>,
}

/// Form in a configuration file: `[0, 6]`, or text as on the command line.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "a range is [LOW, HIGH], or text like \"0:12\" or \"0:12 [kn]\"")]
enum Written {
    Pair([f64; 2]),
    Text(String),
}

impl TryFrom<Written> for GivenRange {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        match written {
            Written::Pair([low, high]) => Self { low, high, unit: None }.sound(),
            Written::Text(text) => text.parse(),
        }
    }
}

impl From<GivenRange> for Written {
    fn from(range: GivenRange) -> Self {
        match range.unit {
            None => Self::Pair([range.low, range.high]),
            Some(unit) => Self::Text(format!("{}:{} [{unit}]", range.low, range.high)),
        }
    }
}

impl GivenRange {
    fn sound(self) -> Result<Self, String> {
        if self.low.is_finite() && self.high.is_finite() && self.low < self.high {
            Ok(self)
        } else {
            Err(format!(
                "{}:{} is not a range: give two finite numbers, the lower one first",
                self.low, self.high
            ))
        }
    }
}

impl std::str::FromStr for GivenRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is not a range: write LOW:HIGH, as in 0:6, or 0:12 [kn]");
        let (numbers, unit) = match text.split_once('[') {
            None => (text, None),
            Some((numbers, unit)) => {
                (numbers, Some(unit.trim().strip_suffix(']').ok_or_else(wrong)?.trim().to_owned()))
            }
        };
        let (low, high) = numbers.split_once(':').ok_or_else(wrong)?;
        let (low, high) =
            (low.trim().parse().map_err(|_| wrong())?, high.trim().parse().map_err(|_| wrong())?);
        Self { low, high, unit }.sound()
    }
}

/// Stated ranges by the name of the channel.
pub type GivenRanges = BTreeMap<String, GivenRange>;

/// The range of a channel, stated or inferred.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelRange {
    /// Name and unit.
    pub channel: Channel,
    /// Whether it is an input.
    pub input: bool,
    /// The range.
    #[serde(flatten)]
    pub range: DesignRange,
    /// Whether it was stated; otherwise it is the training range.
    pub given: bool,
}

pub(super) fn design_ranges(
    given: &GivenRanges,
    training: &[&Trajectory],
) -> Result<Vec<ChannelRange>, IdentifyError> {
    let Some(run) = training.first() else { return Ok(Vec::new()) };
    let channels: Vec<Channel> =
        run.outputs.channels().iter().chain(run.inputs.channels()).cloned().collect();
    let outputs = run.outputs.width();
    let inferred =
        data_summary::output_ranges(training).into_iter().chain(data_summary::input_ranges(training));
    let mut all: Vec<ChannelRange> = channels
        .iter()
        .zip(inferred)
        .enumerate()
        .map(|(i, (channel, range))| ChannelRange {
            channel: channel.clone(),
            input: i >= outputs,
            range,
            given: false,
        })
        .collect();
    for (name, range) in given {
        let place = channel_index("range", "output or input", name, &channels)?;
        let wrong = |why: String| IdentifyError::Range { channel: name.clone(), why };
        let factor = match &range.unit {
            None => 1.0,
            Some(unit) => {
                let to = Unit::parse(&channels[place].unit).map_err(|e| wrong(e.to_string()))?;
                let from = Unit::parse(unit).map_err(|e| wrong(e.to_string()))?;
                from.to(&to).map_err(|e| wrong(e.to_string()))?
            }
        };
        let (low, high) = (factor * range.low, factor * range.high);
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(wrong(format!("{low} to {high} is not a range")));
        }
        all[place].range = DesignRange { low, high };
        all[place].given = true;
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Table;

    fn run() -> Trajectory {
        let table = |name: &str, unit: &str, values| Table::new(vec![Channel::new(name, unit)], values);
        Trajectory {
            name: "a".into(),
            t0: 0.0,
            dt: 1.0,
            outputs: table("u", "m/s", vec![0.5, 2.0, 1.0]),
            inputs: table("n", "rps", vec![-1.0, 3.0, f64::NAN]),
            truth: None,
            heading: None,
            position: None,
        }
    }

    fn given(list: &[(&str, &str)]) -> GivenRanges {
        list.iter().map(|(name, text)| ((*name).to_owned(), text.parse().unwrap())).collect()
    }

    #[test]
    fn stated_ranges_are_converted_and_the_others_inferred() {
        let run = run();
        let all = design_ranges(&given(&[("u", "0:36 [km/h]")]), &[&run]).unwrap();
        assert!(all[0].given && !all[0].input && !all[1].given && all[1].input);
        assert!((all[0].range.high - 10.0).abs() < 1e-12 && all[0].range.low == 0.0);
        assert_eq!(all[1].range, DesignRange { low: -1.0, high: 3.0 });
        let unknown = design_ranges(&given(&[("w", "0:1")]), &[&run]).unwrap_err().to_string();
        assert!(unknown.contains("there is no output or input 'w'"), "{unknown}");
        let unit = design_ranges(&given(&[("u", "0:1 [deg]")]), &[&run]).unwrap_err().to_string();
        assert!(unit.contains("'u'") && unit.contains("deg"), "{unit}");
    }
}
