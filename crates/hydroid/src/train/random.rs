//! One seed per training, one stream of random numbers per purpose.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

/// What random numbers are drawn for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Purpose {
    /// First weights of a restart.
    Weights,
    /// Where the windows of an epoch begin, the same for all restarts.
    Offsets,
    /// The order in which a restart sees the windows of an epoch.
    Order,
}

/// The stream of a purpose in a restart and an epoch. A stream for each epoch means that a training goes on after an
/// interruption with nothing to remember but the number of the epoch.
pub(super) fn stream(seed: u64, purpose: Purpose, restart: usize, epoch: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Settings allow 2^12 restarts and 2^30 epochs.
    rng.set_stream((purpose as u64) << 48 | (restart as u64) << 32 | epoch as u64);
    rng
}
