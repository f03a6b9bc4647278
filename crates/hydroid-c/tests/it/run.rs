//! A run of a model, and what the Rust API gives along it: the same calls as in `follow.c`.

use std::path::Path;

use hydroid::adapt::{self, Options, ResolvedOptions};
use hydroid::model::Model;
use hydroid_core::adapt::guard::Guard;
use hydroid_core::adapt::{Adapter, Innovation, Outcome, Rejection};
use hydroid_core::predict::{Predictor, Workspace};

use crate::models::{commands, drawn, first_outputs};

const HORIZON: usize = 20;

/// Samples of a window of training data.
const WINDOW: usize = 45;

/// A run: tables are flat, row by row.
pub(crate) struct Run {
    pub(crate) samples: usize,
    pub(crate) noise: Vec<f64>,
    pub(crate) headings: Vec<f64>,
    pub(crate) y: Vec<f64>,
    pub(crate) c: Vec<f64>,
}

impl Run {
    /// The model behind its own commands, with noise and missing values; for adapters with an outlier and an infinite value.
    pub(crate) fn of(model: &Model, samples: usize, learns: bool) -> Self {
        let (n, first) = (model.description.outputs.len(), first_outputs(model));
        let c = commands(model, samples, 2.0);
        let mut session = model.frozen().session();
        session.observe(&first);
        let mut y = first.clone();
        let m = session.inputs();
        y.resize(samples * n, 0.0);
        session.rollout(&c[..(samples - 1) * m], &mut Workspace::new(), &mut y[n..]);
        // A drawn model may diverge.
        for (x, at_first) in y.iter_mut().zip(first.iter().cycle()) {
            *x = if x.abs() < 10.0 { *x } else { *at_first };
        }
        let noise: Vec<f64> = first.iter().map(|x| 0.01 * x.abs().max(0.1)).collect();
        for (k, row) in y.chunks_exact_mut(n).enumerate() {
            row.iter_mut().zip(drawn(n, k as f64)).zip(&noise).for_each(|((y, e), std)| *y += 2.0 * e * std);
            match k % 17 {
                3 => row[k % n] = f64::NAN,
                // All of them for some time.
                9 | 10 => row.fill(f64::NAN),
                _ => {}
            }
        }
        if learns {
            y[(samples / 3) * n] += 100.0;
            y[(samples / 3 + 1) * n] = f64::INFINITY;
        }
        let heading = |k: usize| if k % 31 == 5 { f64::NAN } else { 0.01 * k as f64 };
        Self { samples, noise, headings: (0..samples).map(heading).collect(), y, c }
    }

    pub(crate) fn write(&self, path: &Path) {
        let all = [&self.noise, &self.headings, &self.y, &self.c];
        let numbers: Vec<f64> = all.into_iter().flatten().copied().collect();
        let bytes =
            [numbers.len() as f64].iter().chain(&numbers).flat_map(|x| x.to_ne_bytes()).collect::<Vec<u8>>();
        std::fs::write(path, bytes).unwrap();
    }
}

/// A session of either kind.
pub(crate) enum Session {
    Predictor(Box<dyn Predictor>),
    Adapter(Box<dyn Adapter>, ResolvedOptions),
}

impl Session {
    pub(crate) fn of(model: &Model, options: Option<&Options>) -> Self {
        match options {
            None => Self::Predictor(model.session()),
            Some(options) => {
                let (mut adapter, used) = adapt::adapter(model, options, &[]).unwrap();
                if options.kalman.rehearsal.is_some() {
                    let (n, m) = (adapter.outputs(), adapter.inputs());
                    let y: Vec<f64> = (0..WINDOW * n).map(|k| 0.3 + 0.01 * (k % 5) as f64).collect();
                    let c: Vec<f64> = (0..WINDOW * m).map(|k| 0.2 - 0.01 * (k % 7) as f64).collect();
                    adapter.store_window(&y, &c);
                }
                Self::Adapter(adapter, used)
            }
        }
    }

    fn predictor(&mut self) -> &mut dyn Predictor {
        match self {
            Self::Predictor(session) => session.as_mut(),
            Self::Adapter(adapter, _) => adapter.as_mut(),
        }
    }

    fn adapter(&mut self) -> Option<&mut dyn Adapter> {
        match self {
            Self::Predictor(_) => None,
            Self::Adapter(adapter, _) => Some(adapter.as_mut()),
        }
    }

    /// As `record_sample`.
    fn record_sample(&mut self, into: &mut Vec<f64>) {
        let session = self.predictor();
        let n = session.outputs();
        let mut row = vec![0.0; n];
        session.output(&mut row);
        into.extend(&row);
        session.output_through_water(&mut row);
        into.extend(&row);
        let Some(adapter) = self.adapter() else { return };
        into.extend(match adapter.outcome() {
            Outcome::Waiting => [0.0, f64::NAN, 0.0],
            Outcome::Accepted => [1.0, f64::NAN, 1.0],
            Outcome::Inflated { deviations, weight } => [2.0, deviations, weight],
            Outcome::Rejected(Rejection::Outlier { deviations }) => [3.0, deviations, 0.0],
            Outcome::Rejected(Rejection::NotFinite) => [4.0, f64::NAN, 0.0],
            Outcome::RolledBack => [5.0, f64::NAN, 0.0],
        });
        let innovations = adapter.innovations();
        let mut extend = |of: fn(&Innovation) -> f64| {
            into.extend((0..n).map(|output| innovations.get(output).map_or(f64::NAN, of)));
        };
        extend(|innovation| innovation.value);
        extend(|innovation| innovation.deviation);
        let active = adapter.guard().map(Guard::active);
        into.push(active.map_or(0.0, |active| active.index() as f64));
        into.push(f64::from(adapter.is_sound()));
    }

    /// As `record_predictions`.
    fn record_predictions(&mut self, commands: &[f64], into: &mut Vec<f64>) {
        let session = self.predictor();
        let n = session.outputs();
        let mut y = vec![0.0; HORIZON * n];
        session.rollout(commands, &mut Workspace::new(), &mut y);
        into.extend(&y);
        session.fork().rollout_batch(2, commands, &mut Workspace::new(), &mut y);
        into.extend(&y);
        if let Some(adapter) = self.adapter() {
            adapter.deviations(commands, &[1, 5, HORIZON], &mut Workspace::new(), &mut y[..3 * n]);
            into.extend(&y[..3 * n]);
        }
    }
}

/// All results along a run, and the learned model.
pub(crate) fn follow(model: &Model, run: &Run, options: Option<&Options>) -> (Vec<f64>, Option<Model>) {
    let mut session = Session::of(model, options);
    let (n, m) = (session.predictor().outputs(), session.predictor().inputs());
    let mut results = vec![session.predictor().warm_up() as f64];
    session.predictor().observe_heading(run.headings[0]);
    session.predictor().observe(&run.y[..n]);
    session.record_sample(&mut results);
    for k in 1..run.samples {
        let (y, c) = (&run.y[k * n..][..n], &run.c[(k - 1) * m..][..m]);
        session.predictor().observe_heading(run.headings[k]);
        if let Some(adapter) = session.adapter().filter(|_| k == run.samples / 4) {
            adapter.scale_noise(4.0);
        }
        if k % 3 == 0 {
            session.predictor().advance_observe(c, y);
        } else {
            session.predictor().advance(c);
            session.predictor().observe(y);
        }
        session.record_sample(&mut results);
        if k % 40 == 10 && k + HORIZON <= run.samples {
            session.record_predictions(&run.c[k * m..][..HORIZON * m], &mut results);
        }
        if k == run.samples / 2 {
            let mut next = Session::of(model, options);
            if let (Some(old), Some(next)) = (session.adapter(), next.adapter()) {
                let mut memory = vec![0.0; old.memory_len()];
                old.save(&mut memory);
                next.load(&memory);
            } else {
                let mut snapshot = vec![0.0; session.predictor().snapshot_len()];
                session.predictor().snapshot(&mut snapshot);
                next.predictor().restore(&snapshot);
                results.extend(snapshot);
            }
            session = next;
        }
    }
    if let Some(current) = session.predictor().current() {
        results.extend(current.velocity);
        results.extend(current.covariance);
    }
    let learned = if let Session::Adapter(adapter, used) = &mut session {
        results.extend(adapter.weights());
        results.extend([adapter.health().least_variance, adapter.health().min_s_over_r]);
        let learned = adapt::learned(model, options.unwrap(), adapter.weights(), &["the run"], used).unwrap();
        adapter.freeze(true);
        adapter.restart();
        Some(learned)
    } else {
        None
    };
    session.predictor().reset();
    session.predictor().observe(&run.y[..n]);
    session.record_sample(&mut results);
    (results, learned)
}
