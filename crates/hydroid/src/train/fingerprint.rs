//! Fingerprints that detect a checkpoint of another job.

use super::{Job, TrainOptions};
use crate::fingerprint::Fingerprint;
use crate::log::Trajectory;

fn add_runs(hash: &mut Fingerprint, runs: &[&Trajectory]) {
    hash.word(runs.len() as u64);
    for run in runs {
        hash.numbers(&[run.dt]);
        for table in [&run.outputs, &run.inputs] {
            hash.word(table.len() as u64);
            table.channels().iter().for_each(|channel| hash.text(&channel.name));
            hash.numbers(table.rows(0, table.len()));
        }
    }
}

/// Fingerprints of options and data. The budget is excluded: a resumed training may have more time.
pub(super) fn fingerprints(job: &Job<'_>, options: &TrainOptions) -> [String; 2] {
    let mut told = Fingerprint::new();
    told.text(&format!("{:?}", TrainOptions { budget_s: None, ..options.clone() }));
    told.word(job.horizon as u64);
    let mut data = Fingerprint::new();
    add_runs(&mut data, job.runs);
    add_runs(&mut data, job.validation);
    for range in job.outputs.iter().chain(job.inputs) {
        data.numbers(&[range.low, range.high]);
    }
    if let Some(equations) = &job.equations {
        data.text(&format!("{:?}{:?}", equations.terms(), equations.signals()));
        data.word(equations.substeps() as u64);
        data.numbers(equations.coefficients());
    }
    [told.hex(), data.hex()]
}
