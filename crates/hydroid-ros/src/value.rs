//! Messages of any type: read, written, and as rows of numbers.

use std::fmt;

use hydroid_io::{LONGEST_ARRAY, RosNumber, RosShape};
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error as _, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeSeq as _, SerializeTuple as _, Serializer};

/// A message or a part of it.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "the types of the wire")]
pub enum Value {
    Bool(bool),
    I8(i8),
    U8(u8),
    I16(i16),
    U16(u16),
    I32(i32),
    U32(u32),
    I64(i64),
    U64(u64),
    F32(f32),
    F64(f64),
    Text(String),
    Sequence(Vec<Value>),
    /// A struct or an array of fixed length.
    Parts(Vec<Value>),
}

impl Value {
    /// Zeros, empty texts and empty sequences.
    pub fn zero(shape: &RosShape) -> Self {
        match shape {
            RosShape::Number(number) => Self::number(*number, 0.0),
            RosShape::Text => Self::Text(String::new()),
            RosShape::Sequence(_) => Self::Sequence(Vec::new()),
            RosShape::Array(of, count) => Self::Parts(vec![Self::zero(of); *count]),
            RosShape::Struct(_, parts) => {
                Self::Parts(parts.iter().map(|(_, part)| Self::zero(part)).collect())
            }
        }
    }

    /// A number, as near as its type allows.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded, and saturates")]
    pub fn number(number: RosNumber, value: f64) -> Self {
        let whole = value.round();
        match number {
            RosNumber::Bool => Self::Bool(value != 0.0),
            RosNumber::I8 => Self::I8(whole as i8),
            RosNumber::U8 => Self::U8(whole as u8),
            RosNumber::I16 => Self::I16(whole as i16),
            RosNumber::U16 => Self::U16(whole as u16),
            RosNumber::I32 => Self::I32(whole as i32),
            RosNumber::U32 => Self::U32(whole as u32),
            RosNumber::I64 => Self::I64(whole as i64),
            RosNumber::U64 => Self::U64(whole as u64),
            RosNumber::F32 => Self::F32(value as f32),
            RosNumber::F64 => Self::F64(value),
        }
    }

    /// As a number; NaN for what is none.
    pub fn as_f64(&self) -> f64 {
        match *self {
            Self::Bool(value) => f64::from(u8::from(value)),
            Self::I8(value) => value.into(),
            Self::U8(value) => value.into(),
            Self::I16(value) => value.into(),
            Self::U16(value) => value.into(),
            Self::I32(value) => value.into(),
            Self::U32(value) => value.into(),
            Self::I64(value) => value as f64,
            Self::U64(value) => value as f64,
            Self::F32(value) => value.into(),
            Self::F64(value) => value,
            Self::Text(_) | Self::Sequence(_) | Self::Parts(_) => f64::NAN,
        }
    }

    /// The parts of a struct.
    pub fn parts_mut(&mut self) -> &mut [Value] {
        match self {
            Self::Parts(parts) | Self::Sequence(parts) => parts,
            _ => &mut [],
        }
    }

    fn part(&self, index: usize) -> Option<&Value> {
        match self {
            Self::Parts(parts) | Self::Sequence(parts) => parts.get(index),
            _ => None,
        }
    }

    /// Sets the number at a place; sequences become as long as it needs.
    fn set(&mut self, shape: &RosShape, path: &[usize], value: f64) {
        let Some((&index, rest)) = path.split_first() else {
            if let RosShape::Number(number) = shape {
                *self = Self::number(*number, value);
            }
            return;
        };
        let part = match shape {
            RosShape::Struct(_, parts) => parts.get(index).map(|(_, part)| part),
            RosShape::Array(of, _) | RosShape::Sequence(of) => Some(&**of),
            RosShape::Number(_) | RosShape::Text => None,
        };
        let Some(part) = part else { return };
        if let Self::Sequence(all) = self {
            while all.len() <= index {
                all.push(Self::zero(part));
            }
        }
        if let Some(to) = self.parts_mut().get_mut(index) {
            to.set(part, rest, value);
        }
    }

    /// CDR in little endian with its encapsulation.
    pub fn to_cdr(&self) -> Vec<u8> {
        let mut bytes = vec![0, 1, 0, 0];
        // A value has a size that is known, which is all that can fail.
        if let Ok(body) = cdr_encoding::to_vec::<_, byteorder::LittleEndian>(self) {
            bytes.extend(body);
        }
        bytes
    }
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Bool(value) => to.serialize_bool(*value),
            Self::I8(value) => to.serialize_i8(*value),
            Self::U8(value) => to.serialize_u8(*value),
            Self::I16(value) => to.serialize_i16(*value),
            Self::U16(value) => to.serialize_u16(*value),
            Self::I32(value) => to.serialize_i32(*value),
            Self::U32(value) => to.serialize_u32(*value),
            Self::I64(value) => to.serialize_i64(*value),
            Self::U64(value) => to.serialize_u64(*value),
            Self::F32(value) => to.serialize_f32(*value),
            Self::F64(value) => to.serialize_f64(*value),
            Self::Text(text) => to.serialize_str(text),
            Self::Sequence(all) => {
                let mut seq = to.serialize_seq(Some(all.len()))?;
                for value in all {
                    seq.serialize_element(value)?;
                }
                seq.end()
            }
            Self::Parts(parts) => {
                let mut tuple = to.serialize_tuple(parts.len())?;
                for part in parts {
                    tuple.serialize_element(part)?;
                }
                tuple.end()
            }
        }
    }
}

/// The wire does not say what a message is: it is read with the [`Seed`] of its type. A subscription that is watched must
/// be of what can be read without one.
impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(_: D) -> Result<Self, D::Error> {
        Err(D::Error::custom("the type of the message is needed"))
    }
}

/// Reads a message of a type.
#[derive(Clone, Copy, Debug)]
pub struct Seed<'a>(pub &'a RosShape);

impl<'de> DeserializeSeed<'de> for Seed<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<Value, D::Error> {
        match self.0 {
            RosShape::Number(number) => match number {
                RosNumber::Bool => from.deserialize_bool(self),
                RosNumber::I8 => from.deserialize_i8(self),
                RosNumber::U8 => from.deserialize_u8(self),
                RosNumber::I16 => from.deserialize_i16(self),
                RosNumber::U16 => from.deserialize_u16(self),
                RosNumber::I32 => from.deserialize_i32(self),
                RosNumber::U32 => from.deserialize_u32(self),
                RosNumber::I64 => from.deserialize_i64(self),
                RosNumber::U64 => from.deserialize_u64(self),
                RosNumber::F32 => from.deserialize_f32(self),
                RosNumber::F64 => from.deserialize_f64(self),
            },
            RosShape::Text => from.deserialize_str(self),
            RosShape::Sequence(_) => from.deserialize_seq(self),
            RosShape::Array(_, count) => from.deserialize_tuple(*count, self),
            RosShape::Struct(_, parts) => from.deserialize_tuple(parts.len(), self),
        }
    }
}

macro_rules! visit {
    ($($name:ident $of:ty => $value:ident,)*) => {
        $(fn $name<E>(self, value: $of) -> Result<Value, E> { Ok(Value::$value(value)) })*
    };
}

impl<'de> Visitor<'de> for Seed<'_> {
    type Value = Value;

    fn expecting(&self, to: &mut fmt::Formatter) -> fmt::Result {
        to.write_str("a part of a message")
    }

    visit! {
        visit_bool bool => Bool,
        visit_i8 i8 => I8,
        visit_u8 u8 => U8,
        visit_i16 i16 => I16,
        visit_u16 u16 => U16,
        visit_i32 i32 => I32,
        visit_u32 u32 => U32,
        visit_i64 i64 => I64,
        visit_u64 u64 => U64,
        visit_f32 f32 => F32,
        visit_f64 f64 => F64,
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        match self.0 {
            RosShape::Sequence(of) => {
                while let Some(value) = all.next_element_seed(Seed(of))? {
                    values.push(value);
                }
                return Ok(Value::Sequence(values));
            }
            RosShape::Array(of, count) => {
                for _ in 0..*count {
                    values.push(
                        all.next_element_seed(Seed(of))?
                            .ok_or_else(|| A::Error::custom("it is too short"))?,
                    );
                }
            }
            RosShape::Struct(_, parts) => {
                for (_, part) in parts {
                    values.push(
                        all.next_element_seed(Seed(part))?
                            .ok_or_else(|| A::Error::custom("it is too short"))?,
                    );
                }
            }
            RosShape::Number(_) | RosShape::Text => {}
        }
        Ok(Value::Parts(values))
    }
}

/// Where the number of a field is.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Place {
    /// Steps from the message to the number.
    Number(Vec<usize>),
    /// Steps to a quaternion, whose rotation about the third axis it is.
    Yaw(Vec<usize>),
}

/// The fields of a type of messages, with the names that a recording has: paths with dots, elements with brackets, and
/// `Q.yaw` of each quaternion `Q`. Elements of sequences of structs, and of arrays that are longer than
/// [`LONGEST_ARRAY`], are left out.
#[derive(Clone, Debug)]
pub struct Fields {
    shape: RosShape,
    names: Vec<String>,
    places: Vec<Place>,
    stamped: bool,
}

impl Fields {
    /// The fields of a type.
    pub fn of(shape: &RosShape) -> Self {
        let stamped = matches!(shape, RosShape::Struct(_, parts) if parts.first().is_some_and(|(name, part)| {
            name == "header" && matches!(part, RosShape::Struct(name, _) if name == "std_msgs/Header")
        }));
        let mut fields = Self { shape: shape.clone(), names: Vec::new(), places: Vec::new(), stamped };
        fields.add(shape, "", &mut Vec::new());
        fields
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    fn push(&mut self, name: String, place: Place) {
        self.names.push(name);
        self.places.push(place);
    }

    fn add(&mut self, shape: &RosShape, name: &str, path: &mut Vec<usize>) {
        match shape {
            RosShape::Number(_) => self.push(name.to_owned(), Place::Number(path.clone())),
            RosShape::Text => {}
            RosShape::Sequence(of) => {
                if let RosShape::Number(_) = **of {
                    self.elements(of, LONGEST_ARRAY, name, path);
                }
            }
            RosShape::Array(of, count) => {
                if *count <= LONGEST_ARRAY {
                    self.elements(of, *count, name, path);
                }
            }
            RosShape::Struct(type_name, parts) => {
                for (i, (part_name, part)) in parts.iter().enumerate() {
                    let is_stamp = self.stamped && name == "header" && part_name == "stamp";
                    if is_stamp {
                        continue;
                    }
                    let inner =
                        if name.is_empty() { part_name.clone() } else { format!("{name}.{part_name}") };
                    path.push(i);
                    self.add(part, &inner, path);
                    path.pop();
                }
                if type_name == "geometry_msgs/Quaternion" && parts.len() == 4 {
                    let yaw = if name.is_empty() { "yaw".to_owned() } else { format!("{name}.yaw") };
                    self.push(yaw, Place::Yaw(path.clone()));
                }
            }
        }
    }

    fn elements(&mut self, of: &RosShape, count: usize, name: &str, path: &mut Vec<usize>) {
        for i in 0..count {
            path.push(i);
            self.add(of, &format!("{name}[{i}]"), path);
            path.pop();
        }
    }

    /// The numbers of a message; NaN where it has none.
    pub fn row(&self, message: &Value) -> Vec<f64> {
        let at = |path: &[usize]| path.iter().try_fold(message, |value, index| value.part(*index));
        let of = |place: &Place| match place {
            Place::Number(path) => at(path).map_or(f64::NAN, Value::as_f64),
            Place::Yaw(path) => at(path).map_or(f64::NAN, |quaternion| {
                let part = |i| quaternion.part(i).map_or(f64::NAN, Value::as_f64);
                let [x, y, z, w] = [0, 1, 2, 3].map(part);
                (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
            }),
        };
        self.places.iter().map(of).collect()
    }

    /// Stamp of the header \[ns\]; `None` if there is none, or it is zero.
    pub fn stamp_ns(&self, message: &Value) -> Option<i64> {
        if !self.stamped {
            return None;
        }
        let stamp = message.part(0)?.part(0)?;
        let (Value::I32(seconds), Value::U32(nanoseconds)) = (stamp.part(0)?, stamp.part(1)?) else {
            return None;
        };
        let ns = i64::from(*seconds) * 1_000_000_000 + i64::from(*nanoseconds);
        (ns != 0).then_some(ns)
    }

    /// Whether a field can be set: it is a number of the message.
    pub fn can_set(&self, field: usize) -> bool {
        matches!(self.places.get(field), Some(Place::Number(_)))
    }

    /// Sets a number of a message.
    pub fn set(&self, message: &mut Value, field: usize, value: f64) {
        if let Some(Place::Number(path)) = self.places.get(field) {
            message.set(&self.shape, path, value);
        }
    }

    /// Sets the stamp of the header.
    pub fn stamp(&self, message: &mut Value, ns: i64) {
        if !self.stamped {
            return;
        }
        if let Some([stamp, ..]) = message.parts_mut().first_mut().map(Value::parts_mut) {
            *stamp = time(ns);
        }
    }
}

/// A `builtin_interfaces/Time`.
pub fn time(ns: i64) -> Value {
    let seconds = i32::try_from(ns.div_euclid(1_000_000_000)).unwrap_or(i32::MAX);
    let nanoseconds = u32::try_from(ns.rem_euclid(1_000_000_000)).unwrap_or(0);
    Value::Parts(vec![Value::I32(seconds), Value::U32(nanoseconds)])
}
