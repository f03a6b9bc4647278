//! Telling whether two things are the same without keeping them.

/// FNV-1a over 64-bit words: not against malice, but against mistaking one for another.
#[derive(Clone, Copy, Debug)]
pub struct Fnv(u64);

impl Fnv {
    /// Of nothing.
    pub fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// Adds a byte.
    pub fn byte(&mut self, byte: u8) {
        self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }

    /// Adds a word.
    pub fn word(&mut self, word: u64) {
        word.to_le_bytes().into_iter().for_each(|byte| self.byte(byte));
    }

    /// Adds a number, by its bits.
    pub fn number(&mut self, x: f64) {
        self.word(x.to_bits());
    }

    /// Adds numbers.
    pub fn numbers(&mut self, numbers: &[f64]) {
        for &x in numbers {
            self.number(x);
        }
    }

    /// Adds a text, with its length.
    pub fn text(&mut self, text: &str) {
        self.word(text.len() as u64);
        for byte in text.bytes() {
            self.word(u64::from(byte));
        }
    }

    /// The hash.
    pub fn value(self) -> u64 {
        self.0
    }

    /// The hash in hexadecimal digits.
    pub fn hex(self) -> String {
        format!("{:016x}", self.0)
    }
}
