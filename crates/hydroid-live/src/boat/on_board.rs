//! A model on board: it follows the vessel with its adapter and, for comparison, frozen.

use std::collections::VecDeque;

use hydroid::adapt;
use hydroid::closed_loop::Pilot;
use hydroid::log::{ChannelSpec, CommandTiming, LogError, PrepareOptions, Sensors};
use hydroid::model::Model;
use hydroid::navigate::Row;
use hydroid::recording::{LiveColumn, LiveInputs, LiveMotion, LiveTopics};

use crate::stream::{Follower, Sample, StreamError};

/// Time over which errors are averaged \[s\].
const MEMORY_S: f64 = 120.0;

/// A model cannot follow the vessel.
#[derive(Debug, thiserror::Error)]
pub enum OnBoardError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Stream(#[from] StreamError),
    #[error("the model cannot be adapted: {0}")]
    Adapt(String),
    #[error(
        "the model was not identified from the sensors of the vessel: identify it with the section [log.sensors]"
    )]
    NoSensors,
}

/// Where an output of the model comes from.
enum Output {
    /// Computed from sensors.
    Motion(fn(&Row) -> f64),
    /// A column, with its last value.
    Column(LiveColumn, f64),
}

impl Output {
    fn of(spec: &ChannelSpec, topics: &LiveTopics) -> Result<Self, LogError> {
        let computed: fn(&Row) -> f64 = match spec.column.as_str() {
            "x" => |row| row.pose[0],
            "y" => |row| row.pose[1],
            "psi" => |row| row.pose[2],
            "u" => |row| row.ground[0],
            "v" => |row| row.ground[1],
            "r" => |row| row.ground[2],
            _ => return Ok(Self::Column(topics.column(spec)?, f64::NAN)),
        };
        Ok(Self::Motion(computed))
    }
}

/// Mean squared errors by output and horizon, with exponential forgetting.
#[derive(Clone, Debug)]
struct Errors {
    /// Predictions that wait for their measurement: number of the sample, and the values by horizon and output.
    waiting: VecDeque<(u64, Vec<f64>)>,
    sums: Vec<f64>,
    weights: Vec<f64>,
}

impl Errors {
    fn new(len: usize) -> Self {
        Self { waiting: VecDeque::new(), sums: vec![0.0; len], weights: vec![0.0; len] }
    }

    /// Compares predictions for sample `k` with its measurement.
    fn compare(&mut self, k: u64, horizons: &[usize], measured: &[f64], kept: f64) {
        let n = measured.len();
        for (h, &horizon) in horizons.iter().enumerate() {
            let made = k.checked_sub(horizon as u64);
            let Some((_, values)) = self.waiting.iter().find(|(at, _)| Some(*at) == made) else { continue };
            for (i, y) in measured.iter().enumerate() {
                let error = y - values[h * n + i];
                if error.is_finite() {
                    let at = h * n + i;
                    self.sums[at] = kept * self.sums[at] + error * error;
                    self.weights[at] = kept * self.weights[at] + 1.0;
                }
            }
        }
    }

    fn predict(&mut self, k: u64, values: Vec<f64>, longest: usize) {
        self.waiting.push_back((k, values));
        while self.waiting.len() > longest + 1 {
            self.waiting.pop_front();
        }
    }

    fn rmse(&self, at: usize) -> f64 {
        (self.sums[at] / self.weights[at]).sqrt()
    }
}

/// A model on board.
pub(crate) struct OnBoard {
    /// Name of its file.
    pub(crate) name: String,
    pub(crate) model: Model,
    /// Whether it is to learn.
    pub(crate) is_learning: bool,
    is_acting: bool,
    pub(crate) horizons: Vec<usize>,
    adapted: Follower,
    frozen: Follower,
    errors: [Errors; 2],
    outputs: Vec<Output>,
    inputs: LiveInputs,
    sample: Sample,
    /// Prediction of the outputs of the last sample, made one sample before.
    expected: Vec<f64>,
    /// Time of the next sample \[s\].
    next: f64,
    samples: u64,
    /// North and east of the origin of the path \[m\].
    pub(crate) path_origin: [f64; 2],
}

impl OnBoard {
    /// A model with the default options of its adaptation, guarded.
    pub(crate) fn new(
        name: &str,
        model: &Model,
        topics: &LiveTopics,
        horizons_s: &[f64],
    ) -> Result<Self, OnBoardError> {
        let dt = model.description.dt;
        let reading = &model.description.reading;
        if reading.selection.sensors.is_none() {
            return Err(OnBoardError::NoSensors);
        }
        let horizons = horizons(horizons_s, dt);
        // The rows of a link have the commands that have acted.
        let options = PrepareOptions { command_timing: CommandTiming::After, ..reading.options };
        let learning = adapt::Options::of(model).guarded(model);
        let follower = |is_learning: bool| -> Result<Follower, OnBoardError> {
            let (mut adapter, _) = adapt::adapter(model, &learning, &[])
                .map_err(|error| OnBoardError::Adapt(error.to_string()))?;
            adapter.freeze(!is_learning);
            let mut follower = Follower::new(model, adapter, &horizons, options)?;
            follower.predict_track();
            Ok(follower)
        };
        let outputs = reading
            .selection
            .outputs
            .iter()
            .map(|spec| Output::of(spec, topics))
            .collect::<Result<Vec<_>, _>>()?;
        let (n, m) = (outputs.len(), model.description.inputs.len());
        let (adapted, mut frozen) = (follower(true)?, follower(false)?);
        frozen.leave_out_bands();
        Ok(Self {
            name: name.to_owned(),
            model: model.clone(),
            is_learning: true,
            is_acting: true,
            adapted,
            frozen,
            errors: [(); 2].map(|()| Errors::new(n * horizons.len())),
            horizons,
            inputs: LiveInputs::new(topics, &reading.selection)?,
            sample: Sample {
                t: f64::NAN,
                outputs: vec![f64::NAN; n],
                heading: f64::NAN,
                pose: [f64::NAN; 3],
                inputs: vec![f64::NAN; m],
                plan: Vec::new(),
            },
            outputs,
            expected: vec![f64::NAN; n],
            next: f64::NAN,
            samples: 0,
            path_origin: [0.0; 2],
        })
    }

    /// The sensors from which it was identified.
    pub(crate) fn sensors(&self) -> Option<&Sensors> {
        self.model.description.reading.selection.sensors.as_ref()
    }

    /// Columns of the commands.
    pub(crate) fn commands(&self) -> &[LiveColumn] {
        self.inputs.columns()
    }

    /// Takes the row of a topic at a time \[s\], before the motion takes it; `is_measured` is whether it will. True if there
    /// was a sample up to this time.
    pub(crate) fn row(
        &mut self,
        topic: usize,
        t: f64,
        values: &[f64],
        motion: &LiveMotion,
        is_measured: bool,
    ) -> bool {
        let dt = self.model.description.dt;
        let mut followed = false;
        if self.next.is_nan() && !motion.time().is_nan() {
            self.next = t;
        }
        if is_measured {
            // Samples in a gap would be predictions of the motion, and no measurements.
            if t - self.next > 2.0 * dt {
                self.next = t;
            }
            while t >= self.next {
                followed |= self.follow(self.next, motion);
                self.next += dt;
            }
        }
        self.inputs.row(topic, t, values);
        for output in &mut self.outputs {
            if let Output::Column(column, last) = output
                && column.topic == topic
                && let Some(value) = values.get(column.field)
            {
                *last = column.source.si(*value);
            }
        }
        followed
    }

    /// Follows a sample; false if the motion is not known.
    fn follow(&mut self, t: f64, motion: &LiveMotion) -> bool {
        let Some(row) = motion.at(t) else { return false };
        let sample = &mut self.sample;
        sample.t = t;
        for (y, output) in sample.outputs.iter_mut().zip(&self.outputs) {
            *y = match output {
                Output::Motion(of) => of(&row),
                Output::Column(_, last) => *last,
            };
        }
        sample.heading = row.pose[2];
        let [north, east] = self.path_origin;
        sample.pose = [row.pose[0] - north, row.pose[1] - east, row.pose[2]];
        self.inputs.take(t, &mut sample.inputs);
        self.samples += 1;
        let k = self.samples;
        let kept = (-self.model.description.dt / MEMORY_S).exp();
        let longest = self.horizons.last().copied().unwrap_or(1);
        for (i, expected) in self.expected.iter_mut().enumerate() {
            *expected = self.adapted.prediction(i).next().unwrap_or(f64::NAN);
        }
        // Both know what a controller plans, which only the adapted one carries out.
        let mut planned = Vec::new();
        for (follower, errors) in [&mut self.adapted, &mut self.frozen].into_iter().zip(&mut self.errors) {
            let mut sample = sample.clone();
            sample.plan.clone_from(&planned);
            follower.clear_note();
            follower.refuse_absurd_commands(&mut sample);
            let status = follower.follow(&sample);
            if status.is_reset() {
                errors.waiting.clear();
            }
            planned.extend_from_slice(follower.planned());
            errors.compare(k, &self.horizons, &sample.outputs, kept);
            let n = sample.outputs.len();
            let mut values = vec![f64::NAN; n * self.horizons.len()];
            for i in 0..n {
                for (h, value) in follower.prediction(i).enumerate() {
                    values[h * n + i] = value;
                }
            }
            errors.predict(k, values, longest);
        }
        true
    }

    /// Learns, or keeps its weights.
    pub(crate) fn learn(&mut self, is_learning: bool) {
        self.is_learning = is_learning;
        self.adapted.adapter_mut().freeze(!(is_learning && self.is_acting));
    }

    /// States whether the inputs act on the vessel; otherwise, nothing is learned.
    pub(crate) fn set_acting(&mut self, is_acting: bool) {
        self.is_acting = is_acting;
        self.learn(self.is_learning);
    }

    /// Steers from the next sample on.
    pub(crate) fn steer(&mut self, pilot: Pilot, origin: [f64; 2]) -> Result<(), LogError> {
        self.path_origin = origin;
        self.adapted.steer(pilot)
    }

    /// Steers no more.
    pub(crate) fn release(&mut self) {
        self.adapted.release();
        self.path_origin = [0.0; 2];
    }

    /// The controller, while it steers.
    pub(crate) fn pilot(&self) -> Option<&Pilot> {
        self.adapted.pilot()
    }

    /// The adapter.
    pub(crate) fn follower(&self) -> &Follower {
        &self.adapted
    }

    pub(crate) fn sample(&self) -> &Sample {
        &self.sample
    }

    /// Prediction of an output of the last sample, made one sample before.
    pub(crate) fn expected(&self, output: usize) -> f64 {
        self.expected.get(output).copied().unwrap_or(f64::NAN)
    }

    /// Remarks on the last sample.
    pub(crate) fn note(&self) -> &str {
        self.adapted.note()
    }

    /// RMSE of the adapted and of the frozen model at each horizon over the last minutes.
    pub(crate) fn rmse(&self, adapted: bool, output: usize) -> Vec<f64> {
        let errors = &self.errors[usize::from(!adapted)];
        (0..self.horizons.len()).map(|h| errors.rmse(h * self.outputs.len() + output)).collect()
    }

    /// Error over all outputs, each relative to its scale in the training, at the longest horizon.
    pub(crate) fn score(&self, adapted: bool) -> f64 {
        let ports = &self.model.description.outputs;
        let errors = ports.iter().enumerate().filter_map(|(i, port)| {
            let rmse = *self.rmse(adapted, i).last()?;
            Some(rmse / (port.range.high - port.range.low))
        });
        errors.sum::<f64>() / ports.len() as f64
    }
}

/// Horizons in samples, ascending, the first of them one sample.
fn horizons(seconds: &[f64], dt: f64) -> Vec<usize> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let samples = seconds.iter().map(|s| (s / dt).round().max(1.0) as usize);
    let mut all: Vec<usize> = samples.chain([1]).map(|n| n.min(crate::stream::MAX_HORIZON)).collect();
    all.sort_unstable();
    all.dedup();
    all
}
