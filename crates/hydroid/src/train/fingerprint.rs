//! Fingerprints that detect a checkpoint of another job.

use super::{Job, TrainOptions};
use crate::fnv::Fnv;
use crate::log::Trajectory;

fn add_runs(fnv: &mut Fnv, runs: &[&Trajectory]) {
    fnv.word(runs.len() as u64);
    for run in runs {
        fnv.number(run.dt);
        for table in [&run.outputs, &run.inputs] {
            fnv.word(table.len() as u64);
            table.channels().iter().for_each(|channel| fnv.text(&channel.name));
            table.rows(0, table.len()).iter().for_each(|&x| fnv.number(x));
        }
    }
}

/// Fingerprints of options and data. The budget is excluded: a resumed training may have more time.
pub(super) fn fingerprints(job: &Job<'_>, options: &TrainOptions) -> [String; 2] {
    let empty = Fnv::new();
    let mut told = empty;
    told.text(&format!("{:?}", TrainOptions { budget_s: None, ..options.clone() }));
    told.word(job.horizon as u64);
    let mut data = empty;
    add_runs(&mut data, job.runs);
    add_runs(&mut data, job.validation);
    for range in job.outputs.iter().chain(job.inputs) {
        data.number(range.low);
        data.number(range.high);
    }
    if let Some(equations) = &job.equations {
        data.text(&format!("{:?}{:?}", equations.terms(), equations.signals()));
        data.word(equations.substeps() as u64);
        equations.coefficients().iter().for_each(|&c| data.number(c));
    }
    [told.hex(), data.hex()]
}
