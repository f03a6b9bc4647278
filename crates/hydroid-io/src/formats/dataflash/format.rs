//! Definitions of messages: FMT with FMTU, UNIT and MULT (ArduPilot, `libraries/AP_Logger/LogStructure.h`).

use crate::formats::number::{Number, chunk, text};
use crate::formats::record::{Record, Scale};
use crate::sink::Field;

/// Bytes in front of the body of a message: A3 95 and the type.
pub(super) const HEADER: usize = 3;

/// Length of a FMT message.
pub(super) const FMT_LENGTH: usize = 89;

/// Elements of the type `a`; all of them become fields.
const ARRAY: usize = 32;

/// What a letter of a format means.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Letter {
    /// Numbers one behind the other, with the factor that the letter implies.
    Numbers(Number, usize, Option<f64>),
    Text(usize),
}

impl Letter {
    fn of(letter: u8) -> Option<Self> {
        Some(match letter {
            b'a' => Self::Numbers(Number::I16, ARRAY, None),
            b'b' => Self::Numbers(Number::I8, 1, None),
            b'B' | b'M' => Self::Numbers(Number::U8, 1, None),
            b'h' => Self::Numbers(Number::I16, 1, None),
            b'H' => Self::Numbers(Number::U16, 1, None),
            b'i' => Self::Numbers(Number::I32, 1, None),
            b'I' => Self::Numbers(Number::U32, 1, None),
            b'q' => Self::Numbers(Number::I64, 1, None),
            b'Q' => Self::Numbers(Number::U64, 1, None),
            b'g' => Self::Numbers(Number::F16, 1, None),
            b'f' => Self::Numbers(Number::F32, 1, None),
            b'd' => Self::Numbers(Number::F64, 1, None),
            b'c' => Self::Numbers(Number::I16, 1, Some(0.01)),
            b'C' => Self::Numbers(Number::U16, 1, Some(0.01)),
            b'e' => Self::Numbers(Number::I32, 1, Some(0.01)),
            b'E' => Self::Numbers(Number::U32, 1, Some(0.01)),
            b'L' => Self::Numbers(Number::I32, 1, Some(1e-7)),
            b'n' => Self::Text(4),
            b'N' => Self::Text(16),
            b'Z' => Self::Text(64),
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::Numbers(number, count, _) => number.size() * count,
            Self::Text(size) => size,
        }
    }
}

/// A kind of message as its FMT describes it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Definition {
    pub(super) name: String,
    /// Length with the header.
    pub(super) length: usize,
    columns: Vec<(String, usize, Letter)>,
}

impl Definition {
    /// The type and definition in the body of a FMT message, or what is wrong with it.
    pub(super) fn parse(body: &[u8]) -> Result<(u8, Self), String> {
        let (Some([kind, length]), Some(name), Some(letters), Some(names)) =
            (chunk(body, 0), chunk::<4>(body, 2), chunk::<16>(body, 6), chunk::<64>(body, 22))
        else {
            return Err("a format is cut".to_owned());
        };
        let (name, names) = (text(&name), text(&names));
        if name.is_empty() || !name.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err("a format has no name".to_owned());
        }
        let mut names = names.split(',').map(str::trim);
        let mut columns = Vec::new();
        let mut at = 0;
        for byte in letters.into_iter().take_while(|&byte| byte != 0) {
            let Some(letter) = Letter::of(byte) else {
                return Err(format!("the format of {name} has a letter that means no type"));
            };
            if let Some(name) = names.next().filter(|name| !name.is_empty()) {
                columns.push((name.to_owned(), at, letter));
            }
            at += letter.size();
        }
        let length = usize::from(length);
        if length != at + HEADER {
            return Err(format!(
                "the format of {name} states {length} bytes, its fields have {}",
                at + HEADER
            ));
        }
        Ok((kind, Self { name, length, columns }))
    }

    /// A number of a message, without a factor.
    pub(super) fn number(&self, body: &[u8], column: &str) -> Option<f64> {
        let (at, number) = self.place(column)?;
        Some(number.read(body, at))
    }

    /// A text of a message, up to the first NUL.
    pub(super) fn text(&self, body: &[u8], column: &str) -> Option<String> {
        let (_, at, letter) = self.columns.iter().find(|(name, ..)| name == column)?;
        matches!(letter, Letter::Text(_)).then(|| body.get(*at..at + letter.size()).map(text))?
    }

    fn place(&self, column: &str) -> Option<(usize, Number)> {
        self.columns.iter().find(|(name, ..)| name == column).and_then(|&(_, at, letter)| match letter {
            Letter::Numbers(number, 1, _) => Some((at, number)),
            _ => None,
        })
    }
}

/// The letters of a FMTU message: a unit and a factor for each column.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct UnitLetters {
    pub(super) units: String,
    pub(super) factors: String,
}

/// Units and factors by their letters (UNIT and MULT messages).
#[derive(Debug, Default)]
pub(super) struct Tables {
    pub(super) units: Vec<Option<String>>,
    pub(super) factors: Vec<f64>,
}

impl Tables {
    pub(super) fn new() -> Self {
        Self { units: vec![None; 256], factors: vec![0.0; 256] }
    }

    pub(super) fn set_unit(&mut self, letter: u8, label: &str) {
        let label = label.trim();
        let label = match label {
            "" | "UNKNOWN" | "instance" | "satellites" => None,
            "degheading" | "deglatitude" | "deglongitude" => Some("deg".to_owned()),
            "Watt" => Some("W".to_owned()),
            "N.m" => Some("N m".to_owned()),
            _ => Some(label.replace("/s/s", "/s2")),
        };
        self.units[usize::from(letter)] = label;
    }
}

/// What is read of the messages of a type.
#[derive(Debug, Default)]
pub(super) struct Plan {
    pub(super) record: Record,
    /// Place and length of the number or name of the instance, and its number if it is one.
    instance: Option<(usize, usize, Option<Number>)>,
    /// Week, millisecond of the week, and state of the fix, of a GPS message.
    gps: Option<[Option<(usize, Number)>; 3]>,
}

impl Plan {
    /// A factor of a MULT message does not apply to a letter that implies one: such a letter states the same scale
    /// again (`c` in 0.01 with a factor of 0.01 is to be scaled once).
    pub(super) fn new(definition: &Definition, letters: &UnitLetters, tables: &Tables) -> Self {
        let mut plan = Self::default();
        let first = definition.columns.first().map(|(name, ..)| name.as_str());
        plan.record.time = match definition.place("TimeUS") {
            Some((at, number)) => Some((at, number, 1000)),
            None if first == Some("TimeMS") => {
                definition.place("TimeMS").map(|(at, number)| (at, number, 1_000_000))
            }
            None => None,
        };
        let (week, millisecond) = (definition.place("GWk"), definition.place("GMS"));
        if week.is_some() && millisecond.is_some() {
            plan.gps = Some([week, millisecond, definition.place("Status")]);
        }
        for (index, (name, at, letter)) in definition.columns.iter().enumerate() {
            let unit_letter = letters.units.as_bytes().get(index).copied();
            if unit_letter == Some(b'#') && letter.size() <= KEY && plan.instance.is_none() {
                let number = match *letter {
                    Letter::Numbers(number, ..) => Some(number),
                    Letter::Text(_) => None,
                };
                plan.instance = Some((*at, letter.size(), number));
            }
            match *letter {
                Letter::Text(size) => plan.record.texts.push((name.clone(), *at, size)),
                Letter::Numbers(..) if plan.record.time.is_some_and(|(time, ..)| time == *at) => {}
                Letter::Numbers(number, count, implied) => {
                    let unit = unit_letter.and_then(|letter| tables.units[usize::from(letter)].clone());
                    let stated = letters.factors.as_bytes().get(index);
                    let stated = stated.map_or(0.0, |&letter| tables.factors[usize::from(letter)]);
                    let scale = Scale::of(implied.unwrap_or(stated));
                    for i in 0..count {
                        let name = if count == 1 { name.clone() } else { format!("{name}[{i}]") };
                        plan.record.fields.push(Field { name, unit: unit.clone() });
                        plan.record.columns.push((at + i * number.size(), number, scale));
                    }
                }
            }
        }
        plan
    }

    /// The bytes that tell the instances of a type apart.
    pub(super) fn instance(&self, body: &[u8]) -> Key {
        let mut key = [0; KEY];
        if let Some((at, size, _)) = self.instance
            && let Some(bytes) = body.get(at..at + size)
        {
            key[..size].copy_from_slice(bytes);
        }
        key
    }

    /// The instance as it is written in the name of a topic; empty for the first.
    pub(super) fn instance_name(&self, body: &[u8]) -> String {
        let Some((at, size, number)) = self.instance else { return String::new() };
        match number {
            Some(number) => number.integer(body, at).filter(|&n| n != 0).map(|n| format!("[{n}]")),
            None => {
                body.get(at..at + size).map(text).filter(|name| !name.is_empty()).map(|n| format!("[{n}]"))
            }
        }
        .unwrap_or_default()
    }

    /// Week and millisecond of GPS time of a message with a fix.
    pub(super) fn gps_time(&self, body: &[u8]) -> Option<(i64, i64)> {
        let [week, millisecond, status] = self.gps?;
        let read = |place: Option<(usize, Number)>| place.and_then(|(at, number)| number.integer(body, at));
        // 3: a fix in three dimensions.
        (status.is_none() || read(status)? >= 3).then_some((read(week)?, read(millisecond)?))
    }
}

/// Longest field that tells instances apart.
const KEY: usize = 16;

/// Content of the field that tells instances apart.
pub(super) type Key = [u8; KEY];
