//! Random streams of a run: one seed, one stream for each purpose.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Copy, Debug)]
pub(super) enum Purpose {
    Noise = 0,
    Gusts = 1,
    /// Conditions of a Monte Carlo trial.
    Conditions = 2,
    /// Process noise of a model.
    Process = 3,
}

pub(super) fn stream(seed: u64, purpose: Purpose) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(purpose as u64);
    random
}
