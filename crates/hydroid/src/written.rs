//! Values of options as tables and lists, or as the text of the command line: `u=SOG,r=GYRO`.
//!
//! Each function is the `deserialize_with` of a field.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::marker::PhantomData;
use std::str::FromStr;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// A value, or its text.
pub(crate) fn value<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr<Err: Display>,
{
    deserializer.deserialize_any(Written { parse: |text: &str| text.parse().map_err(said), of: PhantomData })
}

/// The text of a value that may be left out.
pub(crate) fn text<'de, D, T>(deserializer: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr<Err: Display>,
{
    let text = Option::<String>::deserialize(deserializer)?;
    text.map(|text| text.parse().map_err(D::Error::custom)).transpose()
}

/// As [`value`], for a field that may be left out.
pub(crate) fn optional<'de, D, T>(deserializer: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr<Err: Display>,
{
    #[derive(Deserialize)]
    #[serde(bound = "T: Deserialize<'de> + FromStr<Err: Display>")]
    struct Given<T>(#[serde(deserialize_with = "value")] T);
    Ok(Option::deserialize(deserializer)?.map(|Given(value)| value))
}

/// A list, or `VALUE,VALUE`.
pub(crate) fn list<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr<Err: Display>,
{
    let parse = |text: &str| text.split(',').map(|part| part.trim().parse().map_err(said)).collect();
    deserializer.deserialize_any(Written { parse, of: PhantomData })
}

/// A table, or `NAME=VALUE,NAME=VALUE`.
pub(crate) fn table<'de, D, T>(deserializer: D) -> Result<BTreeMap<String, T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr<Err: Display>,
{
    let parse = |text: &str| {
        let mut table = BTreeMap::new();
        for part in text.split(',') {
            let (name, value) =
                part.split_once('=').ok_or_else(|| format!("'{part}' is not NAME=VALUE, as in u=0.01"))?;
            if table.insert(name.trim().to_owned(), value.trim().parse().map_err(said)?).is_some() {
                return Err(format!("'{text}' names '{}' twice", name.trim()));
            }
        }
        Ok(table)
    };
    deserializer.deserialize_any(Written { parse, of: PhantomData })
}

/// As [`table`], in the order of the table.
pub(crate) fn named<'de, D, T>(deserializer: D) -> Result<Vec<(String, T)>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr<Err: Display>,
{
    Ok(table(deserializer)?.into_iter().collect())
}

/// As [`named`], and back.
pub(crate) mod by_name {
    pub(crate) use super::named as deserialize;

    pub(crate) fn serialize<S: serde::Serializer, T: serde::Serialize>(
        all: &[(String, T)],
        into: S,
    ) -> Result<S::Ok, S::Error> {
        into.collect_map(all.iter().map(|(name, value)| (name, value)))
    }
}

/// What a function makes of a text, or else what the type itself reads.
pub(crate) fn parsed<'de, D, T, P>(deserializer: D, parse: P) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
    P: FnOnce(&str) -> Result<T, String>,
{
    deserializer.deserialize_any(Written { parse, of: PhantomData })
}

/// Whether a flag is not given.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature of serde")]
pub(crate) fn is_off(flag: &bool) -> bool {
    !flag
}

fn said(error: impl Display) -> String {
    error.to_string()
}

/// Parses a text, and reads everything else as the type itself does.
struct Written<T, P> {
    parse: P,
    of: PhantomData<T>,
}

impl<'de, T, P> Visitor<'de> for Written<T, P>
where
    T: Deserialize<'de>,
    P: FnOnce(&str) -> Result<T, String>,
{
    type Value = T;

    fn expecting(&self, out: &mut Formatter<'_>) -> fmt::Result {
        out.write_str("a table, a list or a text")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        (self.parse)(text).map_err(E::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<T, A::Error> {
        T::deserialize(SeqAccessDeserializer::new(seq))
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<T, E> {
        T::deserialize(value.into_deserializer())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<T, E> {
        T::deserialize(value.into_deserializer())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<T, E> {
        T::deserialize(value.into_deserializer())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<T, E> {
        T::deserialize(value.into_deserializer())
    }
}

#[cfg(test)]
mod tests {
    use crate::config::{Config, Manoeuvre};

    #[test]
    fn a_text_is_read_as_its_table() {
        let file = |text: &str| toml::from_str::<Config>(text).map_err(|error| error.message().to_owned());
        let debug = |text| format!("{:?}", file(text).unwrap());
        for (text, table) in [
            ("log.outputs = 'u=SOG, r=GYRO [deg/s]'", "log.outputs = ['u=SOG', 'r=GYRO [deg/s]']"),
            ("log.inputs = 'none'", "log.inputs = ['none']"),
            ("log.wind = 'SPEED,DIR [deg]'", "log.wind = { speed = 'SPEED', direction = 'DIR [deg]' }"),
            ("ranges = 'u=0:6,r=-20:20 [deg/s]'", "ranges = { u = [0, 6], r = '-20:20 [deg/s]' }"),
            ("sindy.lag = 'n=1.5'", "sindy.lag = { n = 1.5 }"),
            ("sindy.gate = 'u=2.5/12'", "sindy.gate = { output = 'u', centre = 2.5, slope = 12 }"),
            ("identify.rate_limit = 'delta=4 [deg]'", "identify.rate_limit = { delta = '4 [deg]' }"),
        ] {
            assert_eq!(debug(text), debug(table));
        }
        let error = |text| file(text).unwrap_err();
        assert!(error("ranges = 'u=0:6,u=0:7'").contains("names 'u' twice"));
        assert!(error("ranges = 'u'").contains("NAME=VALUE"));
        assert!(error("sindy.lag = 3").contains("lag is \"auto\""), "{}", error("sindy.lag = 3"));

        let trials = |text| toml::from_str::<Manoeuvre>(text).unwrap();
        assert_eq!(
            trials("role = 'n=propulsion,d=steering'\nlimit = 'd=-30:30 [deg]'\nneutral = 'n=1500'"),
            trials(
                "role = { n = 'propulsion', d = 'steering' }\nlimit = { d = '-30:30 [deg]' }\nneutral = { n = 1500 }"
            )
        );
    }
}
