//! Fingerprints of data for caches, checkpoints and recordings. They detect mistakes, not forgery.

use xxhash_rust::xxh3::Xxh3Default;

/// A 64-bit XXH3 hash of numbers and texts, added one after another in little-endian bytes.
#[derive(Clone, Default)]
pub struct Fingerprint(Xxh3Default);

impl Fingerprint {
    /// The fingerprint of no data.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds bytes, without their number.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// Adds an integer.
    pub fn word(&mut self, word: u64) {
        self.bytes(&word.to_le_bytes());
    }

    /// Adds numbers, bit by bit.
    pub fn numbers(&mut self, numbers: &[f64]) {
        for x in numbers {
            self.word(x.to_bits());
        }
    }

    /// Adds a text and its length.
    pub fn text(&mut self, text: &str) {
        self.word(text.len() as u64);
        self.bytes(text.as_bytes());
    }

    /// The hash of all added data.
    pub fn value(&self) -> u64 {
        self.0.digest()
    }

    /// The hash in 16 hexadecimal digits.
    pub fn hex(&self) -> String {
        format!("{:016x}", self.value())
    }
}
