//! Selection of time, outputs, inputs and wind from the columns of a log.

use std::fmt;
use std::str::FromStr;

use super::csv::{RawLog, name_and_unit};
use super::error::LogError;
use super::parts::Parts;
use super::sensors::Sensors;

/// A channel and the column it comes from, as written on the command line or in `hydroid.toml`: `NAME`, `NAME=COLUMN`,
/// `NAME=COLUMN [unit]`, `NAME=COLUMN [unit] * 0.01`, `NAME=COLUMN - 1500`, `NAME=(COLUMN - 1500) / 400`. The unit
/// overrides that of the header; stored values are SI. With the value $x$ of the log, the value of the channel is
/// $(x - \mathrm{offset}) \cdot \mathrm{scale}$, which is then converted from the unit. A formula with `[1]` at its end,
/// `NAME=(COLUMN [us] - 1500) * 0.0025 [1]`, gives a pure number, which is not converted.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ChannelSpec {
    /// Name of the channel.
    pub name: String,
    /// Name of the column in the log.
    pub column: String,
    /// Unit of the column, if given.
    pub unit: Option<String>,
    /// Value of the log at which the channel is zero.
    pub offset: f64,
    /// Factor on the values of the log less the offset.
    pub scale: f64,
    /// Whether the value is a pure number, whatever the unit of the column is.
    pub is_number: bool,
}

impl ChannelSpec {
    /// A channel with the name of its column.
    pub fn named(name: impl Into<String>) -> Self {
        let name = name.into();
        Self { column: name.clone(), name, unit: None, offset: 0.0, scale: 1.0, is_number: false }
    }

    /// A channel whose name differs from the name of its column.
    pub fn renamed(name: impl Into<String>, column: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            column: column.into(),
            unit: None,
            offset: 0.0,
            scale: 1.0,
            is_number: false,
        }
    }

    /// The texts that a log may contain as the name of a column although they are read as an expression: `Engine - 1`
    /// and `Speed (kn)`, each as the specification of that column.
    pub(crate) fn as_names(&self) -> impl Iterator<Item = Self> + '_ {
        let offset = (self.offset != 0.0 && self.unit.is_none()).then(|| {
            let shifted = Self { name: String::new(), scale: 1.0, is_number: false, ..self.clone() };
            let expression = shifted.to_string();
            (expression.trim_start_matches('=').to_owned(), 0.0)
        });
        let unit = self.unit.as_ref().map(|unit| (format!("{} ({unit})", self.column), self.offset));
        offset.into_iter().chain(unit).map(|(column, offset)| {
            let name = if self.name == self.column { &column } else { &self.name };
            Self { name: name.clone(), column, offset, ..self.clone() }
        })
    }

    /// Several specifications separated by commas, as in `--outputs u,v,r=YAW [deg/s]`.
    ///
    /// # Errors
    /// If a specification is invalid.
    pub fn parse_list(text: &str) -> Result<Vec<Self>, LogError> {
        text.split(',').map(str::parse).collect()
    }
}

impl FromStr for ChannelSpec {
    type Err = LogError;

    fn from_str(text: &str) -> Result<Self, LogError> {
        let bad = |reason: &str| LogError::BadSpec { text: text.to_owned(), reason: reason.to_owned() };
        let (name, source) = match text.split_once('=') {
            Some((name, source)) => (Some(name.trim()), source.trim()),
            None => (None, text.trim()),
        };
        // A unit at the end of a formula is that of its value.
        let front = source.strip_suffix("[1]").map(str::trim_end).filter(|front| scaled(front).0 != *front);
        let is_number = front.is_some();
        let (source, scale) = scaled(front.unwrap_or(source));
        if !scale.is_finite() || scale == 0.0 {
            return Err(bad("the scale must be a finite number other than 0"));
        }
        let inner = source.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')).and_then(shifted);
        let outer = shifted(source);
        if inner.is_none()
            && let Some((front, _)) = outer
            && (scale != 1.0 || scaled(front).0 != front)
        {
            return Err(bad("a scale and an offset need parentheses, NAME=(COLUMN - OFFSET) * SCALE"));
        }
        let (source, offset) = inner.or(outer).unwrap_or((source, 0.0));
        let (column, unit) = name_and_unit(source);
        let name = name.unwrap_or(column);
        if column.is_empty() {
            return Err(bad("the name of the column is empty"));
        }
        if name.is_empty() {
            return Err(bad("the name of the channel is empty"));
        }
        Ok(Self {
            name: name.to_owned(),
            column: column.to_owned(),
            unit: unit.map(str::to_owned),
            offset,
            scale,
            is_number,
        })
    }
}

/// Splits `SOURCE * 0.01` and `SOURCE / 400`. The end is a scale only if it is a number: a column may have the name
/// `a*b`.
fn scaled(source: &str) -> (&str, f64) {
    if let Some((front, factor)) = source.rsplit_once('*')
        && let Ok(scale) = factor.trim().parse()
    {
        return (front.trim(), scale);
    }
    // A division needs a blank before it: a column may have the name `engine/2`.
    if let Some((front, divisor)) = source.rsplit_once('/')
        && front.ends_with(char::is_whitespace)
        && let Ok(divisor) = divisor.trim().parse::<f64>()
    {
        return (front.trim(), 1.0 / divisor);
    }
    (source, 1.0)
}

/// Splits `COLUMN - 1500` and `COLUMN + 3`. The sign needs a blank before it: a column may have the name `pwm-1`.
fn shifted(source: &str) -> Option<(&str, f64)> {
    source.rmatch_indices(['+', '-']).find_map(|(at, sign)| {
        let (front, number) = (&source[..at], source[at + 1..].trim());
        let value: f64 = number.parse().ok()?;
        let digits = number.starts_with(|c: char| c.is_ascii_digit() || c == '.');
        let apart = front.ends_with(char::is_whitespace) && !front.trim().is_empty();
        (digits && apart && value.is_finite())
            .then(|| (front.trim(), if sign == "-" { value } else { -value }))
    })
}

impl fmt::Display for ChannelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_scaled = self.scale != 1.0 || self.is_number;
        let parentheses = self.offset != 0.0 && is_scaled;
        let open = if parentheses { "(" } else { "" };
        // An expression and a column name with `=` need the form `NAME=COLUMN`.
        if self.name == self.column && self.offset == 0.0 && !self.is_number {
            f.write_str(&self.name)?;
        } else {
            write!(f, "{}={open}{}", self.name, self.column)?;
        }
        if let Some(unit) = &self.unit {
            write!(f, " [{unit}]")?;
        }
        if self.offset != 0.0 {
            let sign = if self.offset > 0.0 { '-' } else { '+' };
            write!(f, " {sign} {}{}", self.offset.abs(), if parentheses { ")" } else { "" })?;
        }
        if is_scaled {
            write!(f, " * {}", self.scale)?;
        }
        if self.is_number {
            f.write_str(" [1]")?;
        }
        Ok(())
    }
}

impl TryFrom<String> for ChannelSpec {
    type Error = LogError;

    fn try_from(text: String) -> Result<Self, LogError> {
        text.parse()
    }
}

impl From<ChannelSpec> for String {
    fn from(spec: ChannelSpec) -> Self {
        spec.to_string()
    }
}

/// Columns of wind speed `U` and direction, converted to the inputs `wind_x = U^2 cos(direction)` and `wind_y = U^2
/// sin(direction)` \[m^2/s^2\], in which a wind force proportional to the squared speed is linear. Use the relative
/// wind: its direction is relative to the vessel.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    /// Wind speed \[m/s\].
    pub speed: ChannelSpec,
    /// Wind direction \[rad\] in the body frame or in the world frame.
    pub direction: ChannelSpec,
}

impl FromStr for Wind {
    type Err = LogError;

    /// `SPEED,DIRECTION`.
    fn from_str(text: &str) -> Result<Self, LogError> {
        let (speed, direction) = text.split_once(',').ok_or_else(|| LogError::BadSpec {
            text: text.to_owned(),
            reason: "wind requires two columns, SPEED,DIRECTION".to_owned(),
        })?;
        Ok(Self { speed: speed.parse()?, direction: direction.parse()? })
    }
}

/// Columns of a log to use. Columns that are not given are chosen by name and reported in the notes.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Selection {
    /// Time column, with a unit (`timestamp [ms]`) unless in seconds or ISO 8601 stamps. Default: the first of `t`,
    /// `time`, `t_s`, `timestamp`, `time_s`. With [`sensors`](Self::sensors), that of the CSV files of the sensors.
    pub time: Option<String>,
    /// Outputs. If empty: `u`, `v` and `r`, as far as they exist.
    pub outputs: Vec<ChannelSpec>,
    /// Inputs. If empty: all columns whose names end in `_cmd` or `_ang`. The single name `none`, if no column has it,
    /// states that there are no inputs, as in a decay test.
    pub inputs: Vec<ChannelSpec>,
    /// Wind columns, which give two additional inputs.
    pub wind: Option<Wind>,
    /// Heading \[rad\], clockwise from north.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<ChannelSpec>,
    /// Sensors from which `u`, `v` and `r` are computed, for logs that do not contain them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensors: Option<Sensors>,
    /// Parts of the logs that are used. They are those of these logs: a model does not contain them.
    #[serde(skip)]
    pub parts: Parts,
}

impl Selection {
    /// Outputs and inputs as lists of specifications: `Selection::of("u,v,r", "n,delta")`.
    ///
    /// # Errors
    /// If a specification is invalid.
    pub fn of(outputs: &str, inputs: &str) -> Result<Self, LogError> {
        Ok(Self {
            outputs: ChannelSpec::parse_list(outputs)?,
            inputs: ChannelSpec::parse_list(inputs)?,
            ..Self::default()
        })
    }

    /// The inputs as they are named; none if the selection states that there are no inputs.
    #[doc(hidden)]
    pub fn named_inputs(&self, log: &RawLog) -> &[ChannelSpec] {
        if self.has_no_inputs(log) { &[] } else { &self.inputs }
    }

    /// Whether the selection states that there are no inputs.
    pub(crate) fn has_no_inputs(&self, log: &RawLog) -> bool {
        let [input] = &self.inputs[..] else { return false };
        *input == ChannelSpec::named("none") && log.position("none").is_none()
    }
}
