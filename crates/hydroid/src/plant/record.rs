//! Simulated logs of any model.

use std::io::{self, Write};

use rand_distr::{Distribution as _, StandardNormal};

use super::error::PlantError;
use super::input_map::InputMap;
use super::simulation::{Simulation, middle};
use crate::evaluate::BAND_80;
use crate::excitation::{Composer, Purpose, stream};
use crate::log::{Channel, RawLog, Rows, Trajectory};
use crate::model::Model;
use crate::progress::{Progress, report};

/// Commands of a simulation.
#[derive(Clone, Debug)]
pub enum Commands<'a> {
    /// Random steps, ramps, chirps and PRBS of propulsion and steering, over this time \[s\].
    Mixed {
        /// Duration \[s\].
        duration_s: f64,
    },
    /// Rows of commands, one for each sample.
    Given(Vec<f64>),
    /// Those of a run from a sample on. The simulation starts with the measured state at this sample.
    Run {
        /// The run.
        run: &'a Trajectory,
        /// First sample.
        from: usize,
    },
}

/// Options of [`record`].
#[derive(Clone, Debug)]
pub struct RecordOptions<'a> {
    /// Commands.
    pub commands: Commands<'a>,
    /// Seed of commands and noise.
    pub seed: u64,
    /// Factor on the measurement noise of the model's outputs; 0 for none.
    pub noise: f64,
    /// Factor on the process noise; 0 for none.
    pub process_noise: f64,
    /// Velocity of the water, north and east \[m/s\].
    pub current: [f64; 2],
}

/// A simulated log of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Sample time \[s\].
    pub dt: f64,
    /// Inputs of the model.
    pub inputs: Vec<Channel>,
    /// Outputs of the model.
    pub outputs: Vec<Channel>,
    /// Rows of commands; the last one is that of the last sample.
    pub commands: Vec<f64>,
    /// Pose of each sample: north, east \[m\], heading \[rad\].
    pub eta: Vec<[f64; 3]>,
    /// Rows of outputs over ground.
    pub truth: Vec<f64>,
    /// Rows of outputs over ground with measurement noise.
    pub measured: Vec<f64>,
}

/// Largest number of samples.
const MOST_SAMPLES: f64 = 5e7;

/// Samples between two calls of the progress.
const PROGRESS_EVERY: usize = 64;

/// Past that a start within a run takes into account \[samples\].
const PAST: usize = 2_000;

/// Simulates a model. Without a measured start, the vessel is at the origin, heads north, and is as near to rest as its
/// training range permits.
///
/// The process noise is white: in each sample it moves the outputs by independent normal numbers. Their variance is the
/// greatest growth per sample of the variance of the model's errors on runs that were left out, from the measurement noise at
/// both ends to a horizon of the prediction bands; a model without bands has none.
///
/// # Errors
/// If the model is not a plant, a number is out of range, the motion diverges, or `progress` cancels.
pub fn record(
    model: &Model,
    map: Option<&InputMap>,
    options: &RecordOptions<'_>,
    progress: Progress<'_>,
) -> Result<Record, PlantError> {
    for (what, value) in [("the noise", options.noise), ("the process noise", options.process_noise)] {
        if !(value.is_finite() && value >= 0.0) {
            let needed = "0 for none, 1 for that of the model";
            return Err(PlantError::Option { what, value, needed });
        }
    }
    let d = &model.description;
    let (n, m) = (d.outputs.len(), d.inputs.len());
    let mut simulation = Simulation::new(model)?.with_current(options.current);
    let commands = match &options.commands {
        Commands::Mixed { duration_s } => {
            let samples = samples(*duration_s, d.dt)?;
            // A log for identification stays where the model was seen.
            let map = map.map_or_else(|| InputMap::find(model), |map| Ok(map.clone()))?.within(model);
            mixed(&mut simulation.clone(), model, &map, samples, options.seed)
        }
        Commands::Given(rows) => rows.clone(),
        Commands::Run { run, from } => run.inputs.rows(*from, run.len()).to_vec(),
    };
    if commands.len() < m {
        let needed = "at least one sample is needed";
        return Err(PlantError::Option { what: "the number of samples", value: 0.0, needed });
    }
    begin(&mut simulation, model, options, &commands[..m]);
    let process = process_deviations(model, options.process_noise);
    let mut random = stream(options.seed, Purpose::Noise);
    let mut white = || -> f64 { StandardNormal.sample(&mut random) };
    let mut record = Record {
        dt: d.dt,
        inputs: d.inputs.iter().map(|port| port.channel.clone()).collect(),
        outputs: d.outputs.iter().map(|port| port.channel.clone()).collect(),
        eta: Vec::with_capacity(commands.len() / m),
        truth: Vec::with_capacity(commands.len() / m * n),
        measured: Vec::with_capacity(commands.len() / m * n),
        commands,
    };
    let count = record.commands.len() / m;
    for (k, c) in record.commands.chunks_exact(m).enumerate() {
        if k % PROGRESS_EVERY == 0 {
            report(progress, k as f64 / count as f64)?;
        }
        let row = simulation.outputs_over_ground();
        let noise = d.outputs.iter().map(|port| options.noise * port.noise.unwrap_or(0.0));
        record.eta.push(simulation.eta());
        record.measured.extend(row.iter().zip(noise).map(|(y, sigma)| y + sigma * white()));
        record.truth.extend(row);
        simulation.advance(c);
        simulation.check()?;
        if let Some(process) = &process {
            let shift: Vec<f64> = process.iter().map(|sigma| sigma * white()).collect();
            simulation.shift(&shift);
        }
    }
    report(progress, 1.0)?;
    Ok(record)
}

/// Starts a simulation at rest, or with the measured motion.
fn begin(simulation: &mut Simulation, model: &Model, options: &RecordOptions<'_>, first: &[f64]) {
    if let Commands::Run { run, from } = &options.commands {
        let heading = run.heading_at(*from);
        let psi = if heading.is_finite() { heading } else { 0.0 };
        simulation.start_in(run, *from, PAST, [0.0, 0.0, psi]);
    } else {
        simulation.start([0.0; 3], &rest(model), first);
    }
}

/// Poses of the members of the model's ensemble or committee under given commands (rows), without noise.
///
/// # Errors
/// If the model is not a plant. The poses of a member that diverges end there.
pub fn member_tracks(
    model: &Model,
    options: &RecordOptions<'_>,
    commands: &[f64],
) -> Result<Vec<Vec<[f64; 3]>>, PlantError> {
    let m = model.description.inputs.len();
    let track = |member: Simulation| {
        let mut member = member.with_current(options.current);
        begin(&mut member, model, options, &commands[..m]);
        let mut eta = vec![member.eta()];
        // The command of the last sample leads beyond it.
        for c in commands.chunks_exact(m).take((commands.len() / m).saturating_sub(1)) {
            member.advance(c);
            if member.check().is_err() {
                break;
            }
            eta.push(member.eta());
        }
        eta
    };
    Ok(Simulation::of_members(model)?.into_iter().map(track).collect())
}

fn samples(duration_s: f64, dt: f64) -> Result<usize, PlantError> {
    let samples = (duration_s / dt).round();
    if !(1.0..=MOST_SAMPLES).contains(&samples) {
        let needed = "it must hold between one and 50 million samples";
        return Err(PlantError::Option { what: "the duration", value: duration_s, needed });
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by the check")]
    Ok(samples as usize)
}

/// Outputs as near to rest as the training range permits.
pub fn rest(model: &Model) -> Vec<f64> {
    let mut row = middle(model);
    for (value, port) in row.iter_mut().zip(&model.description.outputs) {
        if crate::model::MOTION.contains(&port.channel.name.as_str()) {
            *value = 0.0_f64.clamp(port.range.low, port.range.high);
        }
    }
    row
}

/// Propulsion and steering from a seed, at the time scale of the model.
fn mixed(simulation: &mut Simulation, model: &Model, map: &InputMap, samples: usize, seed: u64) -> Vec<f64> {
    let dt = simulation.dt();
    let (pace_s, duration_s) = (response_time(simulation, model, map).max(2.0 * dt), dt * samples as f64);
    let pushes = Composer { low: -map.astern(), high: 1.0, forward: 0.88, pace_s };
    let turns = Composer { low: -1.0, high: 1.0, forward: 0.5, pace_s };
    let pushes = pushes.compose(duration_s, &mut stream(seed, Purpose::Propeller)).sample(dt, samples);
    let turns = turns.compose(duration_s, &mut stream(seed, Purpose::Rudder)).sample(dt, samples);
    let mut commands = vec![0.0; samples * map.names.len()];
    for ((row, p), s) in commands.chunks_exact_mut(map.names.len()).zip(pushes).zip(turns) {
        map.write_command(p, s, row);
    }
    commands
}

/// Time in which the yaw rate rises to 63.2 % of its largest value after a step of half the steering \[s\].
fn response_time(simulation: &mut Simulation, model: &Model, map: &InputMap) -> f64 {
    const SAMPLES: usize = 1_000;
    simulation.start([0.0; 3], &middle(model), &map.command(0.5, 0.0));
    let (ahead, step) = (map.command(0.5, 0.0), map.command(0.5, 0.5));
    for _ in 0..SAMPLES {
        simulation.advance(&ahead);
    }
    let initial = simulation.nu()[2];
    let mut rates = Vec::with_capacity(SAMPLES);
    for _ in 0..SAMPLES {
        simulation.advance(&step);
        rates.push((simulation.nu()[2] - initial).abs());
    }
    let most = rates.iter().copied().filter(|rate| rate.is_finite()).fold(0.0, f64::max);
    let risen = rates.iter().position(|rate| *rate >= 0.632 * most).unwrap_or(0);
    (risen + 1) as f64 * simulation.dt()
}

/// Standard deviations of the process noise in a sample; `None` for none.
pub(crate) fn process_deviations(model: &Model, factor: f64) -> Option<Vec<f64>> {
    let d = &model.description;
    let bands = d.bands.as_ref().filter(|_| factor > 0.0)?;
    let level = bands.levels.iter().position(|level| *level == 0.8)?;
    let of = |(c, port): (usize, &crate::model::Port)| {
        let noise = port.noise.unwrap_or(0.0);
        let rate = |&horizon: &usize| {
            let error = bands.half_width(level, horizon, c) / BAND_80;
            // An error has measurement noise at both of its ends.
            (error * error - 2.0 * noise * noise) / horizon as f64
        };
        factor * bands.horizons.iter().map(rate).fold(0.0, f64::max).sqrt()
    };
    Some(d.outputs.iter().enumerate().map(of).collect())
}

impl Record {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.eta.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.eta.is_empty()
    }

    /// Writes the record as CSV: time, commands, pose, outputs with noise, and outputs without (`_true`).
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        self.write(writer)
    }

    /// The log that is read from the file of [`write_csv`](Self::write_csv).
    pub fn to_log(&self, name: &str) -> RawLog {
        self.log(name)
    }
}

impl Rows for Record {
    fn channels(&self) -> Vec<Channel> {
        let pose = [("x", "m"), ("y", "m"), ("psi", "rad")].map(|(name, unit)| Channel::new(name, unit));
        let truth = self.outputs.iter().map(|c| Channel::new(format!("{}_true", c.name), c.unit.as_str()));
        let (inputs, outputs) = (self.inputs.iter().cloned(), self.outputs.iter().cloned());
        [Channel::new("t", "s")].into_iter().chain(inputs).chain(pose).chain(outputs).chain(truth).collect()
    }

    fn len(&self) -> usize {
        self.eta.len()
    }

    fn row(&self, k: usize, values: &mut Vec<f64>) {
        let (n, m) = (self.outputs.len(), self.inputs.len());
        values.push((1e9 * k as f64 * self.dt).round() / 1e9);
        values.extend_from_slice(&self.commands[k * m..][..m]);
        values.extend_from_slice(&self.eta[k]);
        values.extend_from_slice(&self.measured[k * n..][..n]);
        values.extend_from_slice(&self.truth[k * n..][..n]);
    }
}
