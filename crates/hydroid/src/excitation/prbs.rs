//! Pseudo-random binary sequence (PRBS) from a linear feedback shift register.

/// Maximum-length sequence of 2^15 - 1 bits with a spectrum that is flat up to about half the bit rate: `x^15 + x^14 +
/// 1`, the polynomial of ITU-T O.150's PRBS15.
#[derive(Clone, Debug)]
pub(crate) struct Prbs {
    register: u16,
}

impl Prbs {
    /// A generator with any start; 0, which would stay 0, becomes 1.
    pub(crate) fn new(start: u16) -> Self {
        let register = start & 0x7fff;
        Self { register: if register == 0 { 1 } else { register } }
    }

    pub(crate) fn next_bit(&mut self) -> bool {
        let bit = ((self.register >> 14) ^ (self.register >> 13)) & 1;
        self.register = ((self.register << 1) | bit) & 0x7fff;
        bit == 1
    }
}
