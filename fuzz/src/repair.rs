//! Sums and sizes of containers. Without repair nearly all changes of a file would end at its container.

use hydroid::fingerprint::Fingerprint;
use hydroid_live::black_box::Head;
use serde_json::{Map, Value};

/// Largest tensor that a repair creates \[bytes\].
const LARGEST_TENSOR: usize = 1 << 20;

/// Version of hydroid, which states and recordings contain.
pub fn version() -> &'static str {
    let manifest = include_str!("../../Cargo.toml");
    let version = manifest.lines().find_map(|line| line.strip_prefix("version = \""));
    version.and_then(|rest| rest.split('"').next()).expect("the workspace has a version")
}

/// Content of a safetensors file.
#[derive(Clone, Debug, Default)]
pub struct Tensors {
    /// Metadata.
    pub metadata: Map<String, Value>,
    /// Name, type, shape and bytes, in the order of the file.
    pub tensors: Vec<(String, Value, Value, Vec<u8>)>,
}

impl Tensors {
    /// Reads a file whose lengths and offsets may be wrong: tensors have the length that type and shape need.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let (length, rest) = bytes.split_first_chunk::<8>()?;
        let mut parser = serde_json::Deserializer::from_slice(rest).into_iter::<Map<String, Value>>();
        let header = parser.next()?.ok()?;
        let end = parser.byte_offset();
        let stated = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let is_padded = rest.get(end..stated).is_some_and(|gap| gap.iter().all(|byte| *byte == b' '));
        let mut data = rest.get(if is_padded { stated } else { end.next_multiple_of(8) }..).unwrap_or(&[]);
        let mut own = Self::default();
        let mut found = Vec::new();
        for (name, value) in header {
            match value {
                Value::Object(metadata) if name == "__metadata__" => own.metadata = metadata,
                Value::Object(mut tensor) => {
                    let offset = tensor.get("data_offsets").and_then(|at| at[0].as_u64());
                    let mut part = |key: &str| tensor.remove(key).unwrap_or_default();
                    found.push((offset, name, part("dtype"), part("shape")));
                }
                _ => {}
            }
        }
        found.sort_by_key(|(offset, ..)| *offset);
        for (_, name, dtype, shape) in found {
            let count = shape.as_array()?.iter().try_fold(1_usize, |count, length| {
                count.checked_mul(usize::try_from(length.as_u64()?).ok()?)
            });
            let width = if dtype.as_str()?.ends_with("64") { 8 } else { 4 };
            let length = count?.checked_mul(width).filter(|length| *length <= LARGEST_TENSOR)?;
            let (own_data, after) = data.split_at(length.min(data.len()));
            data = after;
            let mut values = own_data.to_vec();
            values.resize(length, 0);
            own.tensors.push((name, dtype, shape, values));
        }
        Some(own)
    }

    /// The file.
    pub fn write(&self) -> Vec<u8> {
        let mut header = Map::new();
        header.insert("__metadata__".to_owned(), self.metadata.clone().into());
        let (mut at, mut data) = (0, Vec::new());
        for (name, dtype, shape, values) in &self.tensors {
            let offsets = [at, at + values.len()];
            at = offsets[1];
            let tensor = serde_json::json!({ "dtype": dtype, "shape": shape, "data_offsets": offsets });
            header.insert(name.clone(), tensor);
            data.extend_from_slice(values);
        }
        let mut json = Value::Object(header).to_string().into_bytes();
        json.resize(json.len().next_multiple_of(8), b' ');
        [&(json.len() as u64).to_le_bytes()[..], &json, &data].concat()
    }

    /// A JSON object in the metadata.
    pub fn head(&self, key: &str) -> Option<Map<String, Value>> {
        serde_json::from_str(self.metadata.get(key)?.as_str()?).ok()
    }

    /// Replaces a JSON object in the metadata.
    pub fn set_head(&mut self, key: &str, head: Map<String, Value>) {
        self.metadata.insert(key.to_owned(), Value::Object(head).to_string().into());
    }

    fn tensor(&self, name: &str) -> &[u8] {
        self.tensors.iter().find(|(own, ..)| own == name).map_or(&[], |(.., bytes)| bytes)
    }
}

/// Safetensors whose lengths and offsets fit; other bytes are unchanged.
pub fn safetensors(bytes: &[u8]) -> Vec<u8> {
    Tensors::read(bytes).map_or_else(|| bytes.to_vec(), |tensors| tensors.write())
}

/// A state of a stream with this version, its sum, and the settings for the model that it names.
pub fn state(bytes: &[u8], settings: impl FnOnce(&str) -> Value) -> Vec<u8> {
    let Some(mut tensors) = Tensors::read(bytes) else { return bytes.to_vec() };
    const KEY: &str = "hydroid_stream";
    if let Some(mut head) = tensors.head(KEY) {
        let mut sum = Fingerprint::new();
        if let (Some(first), Some(rows)) = (head.get("first"), head.get("rows")) {
            sum.bytes(first.as_str().unwrap_or_default().as_bytes());
            sum.word(rows.as_u64().unwrap_or_default());
        }
        for name in ["clock", "commands", "memory"] {
            let numbers = tensors.tensor(name);
            sum.word((numbers.len() / 8) as u64);
            sum.bytes(numbers);
        }
        let settings = settings(head.get("model").and_then(Value::as_str).unwrap_or_default());
        head.insert("sum".to_owned(), sum.hex().into());
        head.insert("hydroid".to_owned(), version().into());
        head.insert("settings".to_owned(), settings);
        tensors.set_head(KEY, head);
    }
    tensors.write()
}

/// A black box with the sums and lengths of its parts, and this version.
pub fn black_box(bytes: &[u8]) -> Vec<u8> {
    let before = 24;
    let Some(rest) = bytes.get(before..) else { return bytes.to_vec() };
    let mut parser = serde_json::Deserializer::from_slice(rest).into_iter::<Head>();
    let Some(Ok(mut head)) = parser.next() else { return bytes.to_vec() };
    let end = parser.byte_offset();
    head.hydroid = version().to_owned();
    let json = serde_json::to_vec(&head).expect("a header is JSON");
    let mut out = bytes[..before].to_vec();
    out[12..16].copy_from_slice(&u32::try_from(json.len()).unwrap_or(u32::MAX).to_le_bytes());
    let mut sum = Fingerprint::new();
    sum.bytes(&json);
    out[16..24].copy_from_slice(&sum.value().to_le_bytes());
    out.extend(json);
    let mut ring = rest[end..].to_vec();
    repair_ring(&mut ring, &head);
    out.extend(ring);
    out
}

/// Sums of the segments, as in the format of the black box.
fn repair_ring(ring: &mut [u8], head: &Head) {
    const START: usize = 8 * 6;
    let sum_of = |bytes: &[&[u8]]| {
        let mut sum = Fingerprint::new();
        bytes.iter().for_each(|part| sum.bytes(part));
        sum.value().to_le_bytes()
    };
    let row = 8 * head.row_len();
    let size = |memory: usize, steps: usize| {
        let steps = steps.checked_mul(row + 8)?;
        memory.checked_mul(8)?.checked_add(steps)?.checked_add(START)
    };
    let Some(segment_len) = size(head.memory, head.steps) else { return };
    for segment in ring.chunks_mut(segment_len) {
        let Some((start, rest)) = segment.split_at_mut_checked(START) else { return };
        // A segment that was never written.
        if start.iter().all(|byte| *byte == 0) {
            continue;
        }
        let sequence = start[8..16].to_vec();
        let (memory, steps) = rest.split_at_mut((8 * head.memory).min(rest.len()));
        start[32..40].copy_from_slice(&sum_of(&[memory]));
        let own = sum_of(&[&start[..40]]);
        start[40..].copy_from_slice(&own);
        let steps = steps.chunks_exact_mut(row + 8).enumerate();
        // A step that was never written is zero, too.
        for (place, step) in steps.filter(|(_, step)| step.iter().any(|byte| *byte != 0)) {
            let sum = sum_of(&[&sequence, &(place as u64).to_le_bytes(), &step[..row]]);
            step[row..].copy_from_slice(&sum);
        }
    }
}
