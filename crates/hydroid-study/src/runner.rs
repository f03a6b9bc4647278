//! Records and models of the experiments, computed on first use.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::peak_memory;
use super::plan::{Drive, ModelPlan, Plan, Record};
use super::store::{Key, Store};
use super::{Status, StudyError, Watch};
use hydroid::excitation::{Excitation, LawnMower, LowSpeed, Turn};
use hydroid::identify::{
    self, Job, Keyword, MotionOption, NetworkTrainingOptions, RateLimitOption, identify_with_stages,
};
use hydroid::log::{Split, Trajectory};
use hydroid::model::{Model, Reading};
use hydroid::progress::Cancelled;
use hydroid::simulate::{self, Simulated, simulate};

/// A simulated record.
#[derive(Debug)]
pub struct LoadedRecord {
    pub(super) name: String,
    pub(super) key: Key,
    pub(super) simulated: Simulated,
    /// The record as a log of `u`, `v` and `r`.
    pub run: Trajectory,
}

/// A model of one seed with its key.
#[derive(Debug)]
pub struct Learned {
    pub(super) key: Key,
    pub seed: u64,
    pub model: Model,
    pub(super) about: About,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct About {
    /// Training time \[s\].
    pub(super) seconds: f64,
    /// Peak memory of the process during training \[MB\], if known.
    pub(super) peak_mb: Option<f64>,
}

/// Records and models of a plan; models are stored.
pub struct Runner<'a> {
    plan: &'a Plan,
    pub(super) store: &'a Store,
    watch: Watch<'a>,
    /// Share of the earlier experiments in the study, and of this one, by usual computing times.
    pub(super) place: (f64, f64),
    pub(super) at: String,
    records: Mutex<BTreeMap<String, Arc<LoadedRecord>>>,
    models: Mutex<BTreeMap<String, Arc<Vec<Learned>>>>,
}

impl<'a> Runner<'a> {
    /// A runner without records and models.
    pub fn new(plan: &'a Plan, store: &'a Store, watch: Watch<'a>) -> Self {
        let (records, models) = (Mutex::default(), Mutex::default());
        Self { plan, store, watch, place: (0.0, 1.0), at: String::new(), records, models }
    }

    pub(super) fn plan(&self) -> &'a Plan {
        self.plan
    }

    /// Reports progress; an error if the study is cancelled.
    pub(super) fn tell(&self, what: &str, fraction: f64) -> Result<(), Cancelled> {
        let (before, share) = self.place;
        let status = Status { experiment: &self.at, what, fraction, before, share };
        match (self.watch)(&status) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Cancelled),
        }
    }

    pub(super) fn progress<'b>(&'b self, what: &'b str) -> impl FnMut(f64) -> ControlFlow<()> + 'b {
        |fraction| match self.tell(what, fraction) {
            Ok(()) => ControlFlow::Continue(()),
            Err(Cancelled) => ControlFlow::Break(()),
        }
    }

    pub(super) fn cannot(&self, why: impl std::fmt::Display) -> StudyError {
        StudyError::Cannot { name: self.at.clone(), why: why.to_string() }
    }

    /// A record, simulated on first use.
    pub fn record(&self, name: &str) -> Result<Arc<LoadedRecord>, StudyError> {
        let there = |records: &Mutex<BTreeMap<String, Arc<LoadedRecord>>>| {
            records.lock().unwrap_or_else(PoisonError::into_inner).get(name).map(Arc::clone)
        };
        if let Some(loaded) = there(&self.records) {
            return Ok(loaded);
        }
        let record = self.plan.records.get(name).ok_or_else(|| StudyError::missing("record", name))?;
        self.tell(&format!("simulating {name}"), 0.0)?;
        let simulated = simulate(&options(record)?, &mut self.progress(name))?;
        let run = Trajectory { name: name.to_owned(), ..simulated.to_trajectory(&["u", "v", "r"])? };
        let key = self.store.key("record", record, &[]);
        let loaded = Arc::new(LoadedRecord { name: name.to_owned(), key, simulated, run });
        self.records
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(name.to_owned(), Arc::clone(&loaded));
        Ok(loaded)
    }

    /// Checks that model and record have the same outputs, inputs and sample time.
    pub(super) fn fits(&self, learned: &Learned, loaded: &LoadedRecord) -> Result<(), StudyError> {
        let fits = learned.model.check(std::slice::from_ref(&loaded.run));
        fits.map_err(|error| {
            self.cannot(format_args!("a model does not fit the record '{}': {error}", loaded.name))
        })
    }

    pub(super) fn records(&self, names: &[String]) -> Result<Vec<Arc<LoadedRecord>>, StudyError> {
        names.iter().map(|name| self.record(name)).collect()
    }

    /// The models of a name, one per seed. They are trained sequentially, each on all cores, so that training times are
    /// comparable.
    ///
    /// # Errors
    /// If the name is unknown, or a model cannot be identified or stored.
    pub fn models(&self, name: &str) -> Result<Arc<Vec<Learned>>, StudyError> {
        if let Some(models) = self.models.lock().unwrap_or_else(PoisonError::into_inner).get(name) {
            return Ok(Arc::clone(models));
        }
        let plan = self.plan.models.get(name).ok_or_else(|| StudyError::missing("model", name))?;
        let learned =
            plan.seeds.iter().map(|&seed| self.learn(name, plan, seed)).collect::<Result<_, _>>()?;
        let learned = Arc::new(learned);
        self.models
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(name.to_owned(), Arc::clone(&learned));
        Ok(learned)
    }

    fn learn(&self, name: &str, plan: &ModelPlan, seed: u64) -> Result<Learned, StudyError> {
        let [train, validate, test] =
            [&plan.train, &plan.validate, &plan.test].map(|record| self.record(record));
        let (train, validate, test) = (train?, validate?, test?);
        let alone = ModelPlan { seeds: vec![seed], ..plan.clone() };
        let key = self.store.key("model", &alone, &[train.key, validate.key, test.key]);
        let (model, about) = self.store.model(&format!("{name}-seed{seed}"), key, || {
            let names: Vec<&str> = plan.outputs.iter().map(String::as_str).collect();
            let part = |loaded: &LoadedRecord| -> Result<Vec<Trajectory>, StudyError> {
                let run = loaded.simulated.to_trajectory(&names)?;
                Ok(vec![Trajectory { name: loaded.name.clone(), ..run }])
            };
            let of = &plan.network;
            let networks = NetworkTrainingOptions {
                lstm: of.clone(),
                gru: of.clone(),
                rnn: of.clone(),
                direct: of.clone(),
                affine: of.clone(),
                ..NetworkTrainingOptions::default()
            };
            let job = Job {
                methods: vec![plan.method],
                split: Split {
                    train: part(&train)?,
                    validation: part(&validate)?,
                    test: part(&test)?,
                    notes: Vec::new(),
                },
                reading: Reading::default(),
                boat: hydroid::boat::Boat::default(),
                horizon: plan.horizon,
                origin_stride: 20,
                seed,
                ranges: plan.ranges.clone(),
                networks,
                vessel: None,
                motion: MotionOption::OverGround,
                rate_limits: RateLimitOption::Keyword(Keyword::None),
                allow_feedback: Vec::new(),
                sindy: plan.sindy.clone(),
            };
            let what = format!("training {name}, seed {seed}");
            let mut progress = self.progress(&what);
            peak_memory::reset();
            let mut found =
                identify_with_stages(&job, &mut |stage: &identify::Stage<'_>| progress(stage.fraction))?;
            let candidate = found.candidates.swap_remove(0);
            Ok((candidate.model, About { seconds: candidate.train_seconds, peak_mb: peak_memory::mb() }))
        })?;
        Ok(Learned { key, seed, model, about })
    }

    /// A result for each item; results that are not in the store are computed in parallel.
    pub(super) fn each<I, T>(
        &self,
        what: &str,
        items: &[I],
        make: impl Fn(&I) -> Result<T, StudyError> + Sync,
    ) -> Result<Vec<T>, StudyError>
    where
        I: Sync,
        T: Send,
    {
        let done = Mutex::new(0usize);
        let one = |item: &I| {
            self.tell(what, 0.0)?;
            let made = make(item)?;
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            *done += 1;
            self.tell(what, *done as f64 / items.len() as f64)?;
            Ok(made)
        };
        items.par_iter().map(one).collect()
    }
}

fn options(record: &Record) -> Result<simulate::Options, StudyError> {
    let vessel =
        hydroid::craft::built_in(&record.plant).ok_or_else(|| StudyError::missing("plant", &record.plant))?;
    let excitation = match record.excitation {
        Drive::Mixed => Excitation::Mixed,
        Drive::LowSpeed => Excitation::LowSpeed(LowSpeed::default()),
        Drive::LawnMower => Excitation::LawnMower(LawnMower {
            leg: record.leg_m,
            spacing: record.spacing_m,
            turn: Turn::Arc,
            speeds: record.speeds.clone(),
        }),
    };
    Ok(simulate::Options {
        duration_s: record.duration_s,
        dt_s: record.dt_s,
        seed: record.seed,
        ..simulate::Options::new(vessel, excitation)
    })
}
