//! The state of an instance, and its bytes.

use xxhash_rust::xxh3::xxh3_64;

/// First bytes of a state; the last one is its version.
const MAGIC: &[u8; 16] = b"hydroid-fmu st 1";

/// Length of magic, token, kind and phase.
const HEAD: usize = 26;

/// Length of the fingerprint at the end.
const TAIL: usize = 8;

/// The state of an instance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct State {
    /// Fingerprint of the resources.
    pub(crate) token: u64,
    /// Kind of the instance.
    pub(crate) kind: u8,
    /// Phase of the instance.
    pub(crate) phase: u8,
    /// Time, inputs, parameters, states.
    pub(crate) numbers: Vec<f64>,
}

impl State {
    pub(crate) fn size(&self) -> usize {
        HEAD + 8 * self.numbers.len() + TAIL
    }

    /// The state as bytes: magic, token, kind, phase, numbers, and the fingerprint XXH3 of all before it; little-endian.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.size());
        bytes.extend(MAGIC);
        bytes.extend(self.token.to_le_bytes());
        bytes.extend([self.kind, self.phase]);
        bytes.extend(self.numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend(xxh3_64(&bytes).to_le_bytes());
        bytes
    }

    /// Reads [`bytes`](Self::bytes).
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, String> {
        let damaged = || String::from("the bytes are not a state of this FMU, or they are damaged");
        let (content, sum) = bytes.split_at_checked(bytes.len().saturating_sub(TAIL)).ok_or_else(damaged)?;
        if content.len() < HEAD || !content.len().wrapping_sub(HEAD).is_multiple_of(8) {
            return Err(damaged());
        }
        if xxh3_64(content).to_le_bytes() != *sum || !content.starts_with(MAGIC) {
            return Err(damaged());
        }
        let eight = |bytes: &[u8]| <[u8; 8]>::try_from(bytes).map_err(|_| damaged());
        let token = u64::from_le_bytes(eight(&content[16..24])?);
        let numbers = content[HEAD..].chunks_exact(8).map(|bytes| Ok(f64::from_le_bytes(eight(bytes)?)));
        let numbers = numbers.collect::<Result<Vec<f64>, String>>()?;
        Ok(Self { token, kind: content[24], phase: content[25], numbers })
    }
}
