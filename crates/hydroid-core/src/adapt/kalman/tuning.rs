//! What a filter is told.

use alloc::vec;
use alloc::vec::Vec;

/// What is kept of the covariance of the weights.
///
/// | memory | kept | numbers, of `m` weights |
/// | --- | --- | --- |
/// | `Full` | all of it | `m^2 / 2` |
/// | `Blocks` | what is between weights of the same group of blocks | `m` times the size of a group, half |
/// | `Diagonal` | the variance of each weight | `m` |
/// | `LowRank` | in the inverse, a diagonal and some directions | `m (rank + 1)` |
///
/// All but `Full` keep how the state depends on the weights as well, `m` times the length of the state. Weights that
/// are not learned cost nothing where no weight of their block is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Memory {
    /// All of it.
    #[default]
    Full,
    /// What is between weights of the same group of neighbouring [`Learnable::blocks`](super::Learnable::blocks): with
    /// one block a group the node-decoupled filter (Puskorius and Feldkamp, 1991, "Decoupled extended Kalman filter
    /// training of feedforward layered networks"), with all in one group the full one.
    Blocks {
        /// Blocks in a group.
        group: usize,
    },
    /// Each weight by itself.
    Diagonal,
    /// A diagonal and so many directions, in the inverse of the covariance.
    LowRank {
        /// Directions.
        rank: usize,
    },
}

impl core::fmt::Display for Memory {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Full => write!(f, "full"),
            Self::Blocks { group } => write!(f, "blocks:{group}"),
            Self::Diagonal => write!(f, "diagonal"),
            Self::LowRank { rank } => write!(f, "low-rank:{rank}"),
        }
    }
}

impl core::str::FromStr for Memory {
    type Err = &'static str;

    /// As it is displayed.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = "a memory is one of full, blocks:GROUP, diagonal, low-rank:RANK, as in low-rank:20";
        let (kind, number) = text.split_once(':').map_or((text, None), |(kind, number)| (kind, Some(number)));
        let number =
            number.map(|number| number.parse::<usize>().ok().filter(|&n| n > 0).ok_or(wrong)).transpose()?;
        match (kind, number) {
            ("full", None) => Ok(Self::Full),
            ("diagonal", None) => Ok(Self::Diagonal),
            ("blocks", Some(group)) => Ok(Self::Blocks { group }),
            ("low-rank", Some(rank)) => Ok(Self::LowRank { rank }),
            _ => Err(wrong),
        }
    }
}

/// Tuning of a [`Filter`](super::Filter), in the (scaled) units of its model.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
    /// `P0_h`: variance of each number of the state at the start of a run.
    pub initial_state: f64,
    /// `Q_h`: variance that each number of the state gains over a sample.
    pub state_noise: f64,
    /// `P0_theta` of each weight. A weight that has neither this nor [`weight_noise`](Self::weight_noise) is not learned; where
    /// no weight of a block is, the block costs nothing.
    pub initial_weights: Vec<f64>,
    /// `Q_theta` of each weight: variance that it gains over a sample.
    pub weight_noise: Vec<f64>,
    /// `R` of each output: variance of the measurement's noise.
    pub noise: Vec<f64>,
    /// Share of its distance from the weights given that a weight loses over a sample: a prior that moves along.
    pub leak: f64,
    /// `lambda`: the covariance of the weights grows by its inverse over a sample, so that a sample counts
    /// `lambda^n` when it is `n` old; 1 to forget nothing.
    pub forgetting: f64,
    /// Innovations of more standard deviations than this count as those of a noisier measurement (Huber's loss);
    /// infinite to trust all of them.
    pub huber: f64,
    /// Share of a measurement's own evidence in the `R` of its channel, which then follows the noise; 0 to keep `R`.
    pub noise_rate: f64,
    /// What is kept of the covariance.
    pub memory: Memory,
}

/// Why a filter cannot be tuned so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TuningError {
    /// A number is negative, or not one.
    Number(&'static str),
    /// There are not as many numbers as weights, or as outputs.
    Length(&'static str),
    /// Measurements without noise leave nothing to weigh them by.
    Noise,
    /// There is nothing to learn and no state to filter.
    Nothing,
}

impl core::fmt::Display for TuningError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Number(what) => write!(f, "{what} is not a number that it can be"),
            Self::Length(what) => write!(f, "one {what} is needed for each, no more and no less"),
            Self::Noise => write!(f, "the variance of the measurement noise must be positive"),
            Self::Nothing => write!(f, "there is nothing to learn: give the weights a variance, or a noise"),
        }
    }
}

impl core::error::Error for TuningError {}

impl Tuning {
    /// The same variance and noise for all weights; no leak, nothing forgotten, all measurements trusted, the full
    /// covariance.
    pub fn uniform(weights: usize, initial: f64, noise: f64, state: (f64, f64), measurement: &[f64]) -> Self {
        Self {
            initial_state: state.0,
            state_noise: state.1,
            initial_weights: vec![initial; weights],
            weight_noise: vec![noise; weights],
            noise: measurement.to_vec(),
            leak: 0.0,
            forgetting: 1.0,
            huber: f64::INFINITY,
            noise_rate: 0.0,
            memory: Memory::Full,
        }
    }

    /// Whether it makes sense for so many weights and outputs.
    pub(super) fn check(&self, weights: usize, outputs: usize) -> Result<(), TuningError> {
        let sound = |x: f64| x >= 0.0 && x.is_finite();
        let share = |x: f64| (0.0..1.0).contains(&x);
        for (what, values, len) in [
            ("initial variance", &self.initial_weights, weights),
            ("noise", &self.weight_noise, weights),
            ("measurement noise", &self.noise, outputs),
        ] {
            if values.len() != len {
                return Err(TuningError::Length(what));
            }
            if !values.iter().copied().all(sound) {
                return Err(TuningError::Number(what));
            }
        }
        let numbers = [
            ("the initial variance of the state", sound(self.initial_state)),
            ("the noise of the state", sound(self.state_noise)),
            ("the leak", share(self.leak)),
            ("the forgetting factor", share(1.0 - self.forgetting)),
            ("Huber's limit", self.huber > 0.0),
            ("the rate of the measurement noise", share(self.noise_rate)),
            ("the size of a group of blocks", self.memory != Memory::Blocks { group: 0 }),
            ("the rank", self.memory != Memory::LowRank { rank: 0 }),
        ];
        if let Some((what, _)) = numbers.into_iter().find(|(_, sound)| !sound) {
            return Err(TuningError::Number(what));
        }
        if self.noise.contains(&0.0) {
            return Err(TuningError::Noise);
        }
        Ok(())
    }

    /// Whether a weight is learned.
    pub(super) fn learns(&self, weight: usize) -> bool {
        self.initial_weights[weight] > 0.0 || self.weight_noise[weight] > 0.0
    }
}
