//! Sensor faults that are injected into a log.
//!
//! ```text
//! spikes=0.01             each sample of an output is an outlier with probability 0.01
//! dropout=u:10s           the output is missing for 10 s
//! stuck=r:5s              the output repeats its last value for 5 s
//! bias=v:0.2              the output has an offset (in its SI unit) from then on
//! ..@120                  start of the fault in the run [s]; by default drawn from the seed
//! ```
//!
//! Several faults are separated by commas. Without a truth in the run, the measurements before the faults become its
//! truth.

use std::str::FromStr;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::log::{Table, Trajectory};

/// A sensor fault.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// Outliers in all outputs.
    Spikes {
        /// Probability, 0 to 1.
        probability: f64,
    },
    /// Missing values.
    Dropout {
        /// Output and start.
        on: Place,
        /// Duration \[s\].
        duration_s: f64,
    },
    /// Repeated last value.
    Stuck {
        /// Output and start.
        on: Place,
        /// Duration \[s\].
        duration_s: f64,
    },
    /// Constant offset.
    Bias {
        /// Output and start.
        on: Place,
        /// Offset in the SI unit.
        offset: f64,
    },
}

/// Output and start of a fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Name of the output.
    pub output: String,
    /// Start in the run \[s\]; `None` to draw it from the middle four fifths.
    pub at_s: Option<f64>,
}

/// Faults and their seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Faults in the order of injection.
    pub list: Vec<Fault>,
    /// Seed of spikes and of start times that are not given.
    pub seed: u64,
}

/// Invalid fault.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum FaultError {
    #[error(
        "'{0}' is not a fault: write spikes=0.01, dropout=u:10s, stuck=r:5s or bias=v:0.2, with @TIME at the end for a start at that time [s]"
    )]
    Form(String),
    #[error("a fault names the output '{output}', but the outputs are {known}")]
    Output { output: String, known: String },
}

impl FromStr for Faults {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let list = text.split(',').map(|one| one.trim().parse()).collect::<Result<_, _>>()?;
        Ok(Self { list, seed: 0 })
    }
}

impl FromStr for Fault {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let wrong = || FaultError::Form(text.to_owned());
        let (kind, rest) = text.split_once('=').ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(wrong);
        let time = |text: &str| {
            let text = text.trim();
            number(text.strip_suffix('s').unwrap_or(text))
                .and_then(|t| if t >= 0.0 { Ok(t) } else { Err(wrong()) })
        };
        if kind.trim() == "spikes" {
            let probability = number(rest)?;
            if !(0.0..=1.0).contains(&probability) {
                return Err(wrong());
            }
            return Ok(Self::Spikes { probability });
        }
        let (rest, at_s) = match rest.split_once('@') {
            Some((rest, at)) => (rest, Some(time(at)?)),
            None => (rest, None),
        };
        let (output, size) = rest.split_once(':').ok_or_else(wrong)?;
        let output = output.trim().to_owned();
        if output.is_empty() {
            return Err(wrong());
        }
        let on = Place { output, at_s };
        match kind.trim() {
            "dropout" => Ok(Self::Dropout { on, duration_s: time(size)? }),
            "stuck" => Ok(Self::Stuck { on, duration_s: time(size)? }),
            "bias" => Ok(Self::Bias { on, offset: number(size)? }),
            _ => Err(wrong()),
        }
    }
}

impl Faults {
    /// Injects the faults into runs, in order; each run has its own random stream.
    ///
    /// # Errors
    /// If a run lacks the output of a fault.
    pub fn inject(&self, runs: &mut [Trajectory]) -> Result<(), FaultError> {
        for (index, run) in runs.iter_mut().enumerate() {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
            rng.set_stream(index as u64);
            self.inject_one(run, &mut rng)?;
        }
        Ok(())
    }

    fn inject_one(&self, run: &mut Trajectory, rng: &mut ChaCha8Rng) -> Result<(), FaultError> {
        let (width, len) = (run.outputs.width(), run.len());
        let channels = run.outputs.channels().to_vec();
        let ranges: Vec<(f64, f64)> = (0..width).map(|c| range(run.outputs.column(c))).collect();
        let mut values = run.outputs.rows(0, len).to_vec();
        let place = |on: &Place, rng: &mut ChaCha8Rng| -> Result<(usize, usize), FaultError> {
            let found = channels.iter().position(|channel| channel.name == on.output);
            let known = || channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
            let output =
                found.ok_or_else(|| FaultError::Output { output: on.output.clone(), known: known() })?;
            // Drawn in any case, so that a given start changes no other fault.
            let share = 0.1 + 0.8 * rng.random::<f64>();
            let at = on.at_s.map_or(share * len as f64, |at| at / run.dt);
            Ok((output, samples(at, len)))
        };
        for fault in &self.list {
            match fault {
                Fault::Spikes { probability } => {
                    for (k, value) in values.iter_mut().enumerate() {
                        let (hit, size) = (rng.random::<f64>(), rng.random::<f64>());
                        if hit < *probability {
                            let (low, high) = ranges[k % width];
                            *value = low + (2.0 * size - 0.5) * (high - low);
                        }
                    }
                }
                Fault::Dropout { on, duration_s } => {
                    let (output, from) = place(on, rng)?;
                    for k in from..from.saturating_add(samples(duration_s / run.dt, len)).min(len) {
                        values[k * width + output] = f64::NAN;
                    }
                }
                Fault::Stuck { on, duration_s } => {
                    let (output, from) = place(on, rng)?;
                    for k in from.max(1)..from.saturating_add(samples(duration_s / run.dt, len)).min(len) {
                        values[k * width + output] = values[(k - 1) * width + output];
                    }
                }
                Fault::Bias { on, offset } => {
                    let (output, from) = place(on, rng)?;
                    (from..len).for_each(|k| values[k * width + output] += offset);
                }
            }
        }
        let clean = std::mem::replace(&mut run.outputs, Table::new(channels, values));
        run.truth.get_or_insert(clean);
        Ok(())
    }
}

/// Number of samples, limited to the run.
fn samples(count: f64, len: usize) -> usize {
    // Casts saturate.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = count.round().max(0.0) as usize;
    count.min(len)
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::NAN, f64::NAN), |(low, high), x| (x.min(low), x.max(high)))
}
