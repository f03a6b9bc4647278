//! Values of options as text: numbers separated by commas, points by semicolons, `NAME=VALUE`.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::marker::PhantomData;
use std::str::FromStr;

use serde::de::value::StrDeserializer;
use serde::de::{Deserialize, Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};

/// `N` numbers: `1,2`.
///
/// # Errors
/// If the text is something else.
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let wrong = || format!("'{text}' is not {N} numbers separated by commas");
    let all: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
    match <[f64; N]>::try_from(all) {
        Ok(all) if all.iter().all(|x| !x.is_nan()) => Ok(all),
        _ => Err(wrong()),
    }
}

/// Points: `0,0;40,0`.
///
/// # Errors
/// If the text is something else.
pub fn points(text: &str) -> Result<Vec<[f64; 2]>, String> {
    let points = text.split(';').filter(|part| !part.trim().is_empty()).map(numbers);
    let points: Result<_, String> = points.collect();
    points.map_err(|why| format!("{why}: write points as NORTH,EAST;NORTH,EAST;.."))
}

/// A value and its channel: `u=0.01`, `u=0:12 [kn]`.
///
/// # Errors
/// If the text is something else.
pub fn named<T: FromStr<Err: Display>>(text: &str) -> Result<(String, T), String> {
    let (name, value) = text.split_once('=').ok_or_else(|| format!("'{text}' is not NAME=VALUE"))?;
    let value = value.trim().parse().map_err(|error| format!("{}: {error}", name.trim()))?;
    Ok((name.trim().to_owned(), value))
}

/// Values by name; the last one of a name counts.
pub fn by_name<T: Clone>(all: &[(String, T)]) -> BTreeMap<String, T> {
    all.iter().cloned().collect()
}

/// Reads values by name: a table, or text as on a command line.
pub(crate) fn read_named<'de, D, T>(from: D) -> Result<Vec<(String, T)>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr<Err: Display>,
{
    struct Named<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de> + FromStr<Err: Display>> Visitor<'de> for Named<T> {
        type Value = Vec<(String, T)>;

        fn expecting(&self, out: &mut Formatter<'_>) -> fmt::Result {
            out.write_str("a table of names and values, or \"NAME=VALUE,NAME=VALUE\"")
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
            text.split(',').map(|part| named(part).map_err(E::custom)).collect()
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut all = Vec::new();
            while let Some(entry) = map.next_entry()? {
                all.push(entry);
            }
            Ok(all)
        }
    }

    from.deserialize_any(Named(PhantomData))
}

/// Reads a list, or text with commas as on a command line.
pub(crate) fn read_list<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<Vec<T>, D::Error> {
    struct List<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for List<T> {
        type Value = Vec<T>;

        fn expecting(&self, out: &mut Formatter<'_>) -> fmt::Result {
            out.write_str("a list, or \"A,B\"")
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<Vec<T>, E> {
            let parts = text.split(',').map(str::trim).filter(|part| !part.is_empty());
            parts.map(|part| T::deserialize::<StrDeserializer<'_, E>>(part.into_deserializer())).collect()
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<Vec<T>, A::Error> {
            let mut list = Vec::new();
            while let Some(value) = all.next_element()? {
                list.push(value);
            }
            Ok(list)
        }
    }

    from.deserialize_any(List(PhantomData))
}
