//! Changes of one value inside a format, beside those of single bytes.

use serde_json::{Map, Number, Value, json};

use crate::repair::Tensors;

/// Changes a value of the format in half of the calls, and bytes in the others. The first `size` bytes of `data` are the
/// input; the result is its new length.
pub fn either(
    data: &mut [u8],
    size: usize,
    max_size: usize,
    seed: u32,
    change: fn(&[u8], u32) -> Option<Vec<u8>>,
    bytes: fn(&mut [u8], usize, usize) -> usize,
) -> usize {
    let changed = if seed.is_multiple_of(2) { change(&data[..size], seed / 2) } else { None };
    match changed.filter(|changed| changed.len() <= max_size) {
        Some(changed) => {
            data[..changed.len()].copy_from_slice(&changed);
            changed.len()
        }
        None => bytes(data, size, max_size),
    }
}

/// Numbers at the edges of what a format permits.
const NUMBERS: [f64; 24] = [
    0.0, -0.0, 1.0, -1.0, 2.0, 0.1, 0.5, -0.5, 3.0, 10.0, 100.0, 1e3, 1e4, 1e-3, 1e-9, 1e9, -1e9, 1e30,
    1e200, -1e200, 1e308, -1e308, 1e-300, 5e-324,
];

const WHOLE: [u64; 14] = [0, 1, 2, 3, 4, 7, 16, 64, 1000, 4096, 1 << 20, 1 << 32, 1 << 53, u64::MAX];

const WORDS: [&str; 10] = ["", "u", "r", "n", "t", "m/s", "deg", "u [kn]", "\u{1b}[31m", "a=b"];

/// Random numbers by the mixer of SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    fn number(&mut self) -> f64 {
        match self.below(12) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => f64::NEG_INFINITY,
            _ => self.of(&NUMBERS),
        }
    }
}

/// Changes a safetensors file: values of the JSON in its metadata, and numbers of its tensors.
pub fn safetensors(bytes: &[u8], seed: u32) -> Option<Vec<u8>> {
    let (mut tensors, mut random) = (Tensors::read(bytes)?, Random(u64::from(seed)));
    for _ in 0..=random.below(2) {
        if random.below(2) == 0 {
            for text in tensors.metadata.values_mut() {
                let mut value: Value = serde_json::from_str(text.as_str()?).ok()?;
                change(&mut value, &mut random);
                *text = value.to_string().into();
            }
        } else if !tensors.tensors.is_empty() {
            let which = random.below(tensors.tensors.len());
            set_number(&mut tensors.tensors[which].3, &mut random);
        }
    }
    Some(tensors.write())
}

/// Changes a black box: values of its header, and numbers of its segments.
pub fn black_box(bytes: &[u8], seed: u32) -> Option<Vec<u8>> {
    let (before, rest) = bytes.split_at_checked(24)?;
    let mut random = Random(u64::from(seed));
    let mut parser = serde_json::Deserializer::from_slice(rest).into_iter::<Value>();
    let mut head = parser.next()?.ok()?;
    let mut ring = rest[parser.byte_offset()..].to_vec();
    if random.below(2) == 0 {
        change(&mut head, &mut random);
    } else {
        (0..=random.below(3)).for_each(|_| set_number(&mut ring, &mut random));
    }
    Some([before, head.to_string().as_bytes(), &ring].concat())
}

/// Changes a value of a TOML file.
pub fn toml(bytes: &[u8], seed: u32) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(bytes).ok()?;
    Some(changed_toml(text, &mut Random(u64::from(seed)))?.into_bytes())
}

fn changed_toml(text: &str, random: &mut Random) -> Option<String> {
    let mut value: Value =
        toml::from_str::<Map<String, Value>>(text).ok().filter(|map| !map.is_empty())?.into();
    change(&mut value, random);
    toml::to_string(&value).ok()
}

fn set_number(bytes: &mut [u8], random: &mut Random) {
    let count = bytes.len() / 8;
    if count > 0 {
        let at = 8 * random.below(count);
        bytes[at..at + 8].copy_from_slice(&random.number().to_le_bytes());
    }
}

/// Changes one value, which may be a list or an object.
fn change(value: &mut Value, random: &mut Random) {
    let mut which = random.below(nodes(value));
    visit(value, &mut which, &mut |value| replace(value, random));
}

fn nodes(value: &Value) -> usize {
    1 + match value {
        Value::Array(list) => list.iter().map(nodes).sum(),
        Value::Object(object) => object.values().map(nodes).sum(),
        _ => 0,
    }
}

/// Calls `at` with the node of a number, in the order of a search in depth.
fn visit(value: &mut Value, which: &mut usize, at: &mut dyn FnMut(&mut Value)) -> bool {
    if *which == 0 {
        at(value);
        return true;
    }
    *which -= 1;
    match value {
        Value::Array(list) => list.iter_mut().any(|value| visit(value, which, at)),
        Value::Object(object) => object.values_mut().any(|value| visit(value, which, at)),
        _ => false,
    }
}

fn replace(value: &mut Value, random: &mut Random) {
    match value {
        Value::Null => *value = json!(random.of(&WHOLE)),
        Value::Bool(flag) => *flag = !*flag,
        Value::Number(number) if number.is_f64() => {
            // A number that JSON has.
            let next = random.of(&NUMBERS);
            *value = Number::from_f64(next).map_or(Value::Null, Value::Number);
        }
        Value::Number(_) => *value = json!(random.of(&WHOLE)),
        Value::String(text) => match changed_toml(text, random) {
            Some(changed) => *text = changed,
            None => *text = random.of(&WORDS).to_owned(),
        },
        Value::Array(list) => {
            let place = random.below(list.len());
            match (random.below(4), list.get(place).cloned()) {
                (0, _) => list.clear(),
                (1, Some(_)) => drop(list.remove(place)),
                (2, Some(item)) => list.insert(place, item),
                (_, Some(_)) => list.reverse(),
                (_, None) => *value = Value::Null,
            }
        }
        Value::Object(object) => {
            let key = object.keys().nth(random.below(object.len())).cloned();
            if let Some(key) = key {
                object.remove(&key);
            }
        }
    }
}
