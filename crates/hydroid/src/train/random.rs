//! Random streams: one seed per training, one stream per purpose.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Copy, Debug)]
pub(super) enum Purpose {
    Weights,
    /// Offsets of the windows of an epoch, common to all restarts.
    Offsets,
    /// Order of the windows of an epoch, for each restart.
    Order,
}

/// Stream of a purpose in a restart and an epoch: the number of completed epochs is the state of the random numbers.
pub(super) fn stream(seed: u64, purpose: Purpose, restart: usize, epoch: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Settings allow 2^12 restarts and 2^30 epochs.
    rng.set_stream((purpose as u64) << 48 | (restart as u64) << 32 | epoch as u64);
    rng
}
