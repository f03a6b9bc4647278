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

#[cfg(test)]
mod tests {
    use super::Prbs;

    #[test]
    fn has_full_length_and_balance() {
        let mut prbs = Prbs::new(0x2a5);
        let start = prbs.register;
        let mut ones = 0;
        for k in 1..=32_767 {
            ones += u32::from(prbs.next_bit());
            assert_eq!(prbs.register == start, k == 32_767, "period at {k}");
        }
        assert_eq!(ones, 16_384);
    }

    #[test]
    fn leaves_the_dead_state() {
        assert!((0..20).any(|_| Prbs::new(0).next_bit()) || Prbs::new(0).register != 0);
    }
}
