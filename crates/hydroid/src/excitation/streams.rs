//! One seed per run, one stream of random numbers per purpose.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

/// Purpose of random numbers. Each has its own stream, so that a change of one leaves the others as they were.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Purpose {
    Propeller = 0,
    Rudder = 1,
    Noise = 2,
    /// Speeds of a lawn-mower's legs.
    Legs = 3,
}

pub(crate) fn stream(seed: u64, purpose: Purpose) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(purpose as u64);
    rng
}
