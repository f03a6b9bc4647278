//! Telling whether two trainings are of the same job.

use super::{Job, Settings};
use crate::log::Trajectory;

/// FNV-1a over 64-bit words: not against malice, but against a checkpoint that is mistaken for another's.
#[derive(Clone, Copy, Debug)]
struct Fnv(u64);

impl Fnv {
    fn word(&mut self, word: u64) {
        for byte in word.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn number(&mut self, x: f64) {
        self.word(x.to_bits());
    }

    fn text(&mut self, text: &str) {
        self.word(text.len() as u64);
        for byte in text.bytes() {
            self.word(u64::from(byte));
        }
    }

    fn runs(&mut self, runs: &[&Trajectory]) {
        self.word(runs.len() as u64);
        for run in runs {
            self.number(run.dt);
            for table in [&run.outputs, &run.inputs] {
                self.word(table.len() as u64);
                table.channels().iter().for_each(|channel| self.text(&channel.name));
                table.rows(0, table.len()).iter().for_each(|&x| self.number(x));
            }
        }
    }
}

/// Numbers of settings and of data. The budget is not among them: whoever goes on may give more time.
pub(super) fn fingerprints(job: &Job<'_>, settings: &Settings) -> [String; 2] {
    let hex = |fnv: Fnv| format!("{:016x}", fnv.0);
    let empty = Fnv(0xcbf2_9ce4_8422_2325);
    let mut told = empty;
    told.text(&format!("{:?}", Settings { budget_s: None, ..settings.clone() }));
    told.word(job.horizon as u64);
    let mut data = empty;
    data.runs(job.runs);
    data.runs(job.validation);
    for range in job.outputs.iter().chain(job.inputs) {
        data.number(range.low);
        data.number(range.high);
    }
    if let Some(equations) = &job.equations {
        data.text(&format!("{:?}{:?}", equations.terms(), equations.signals()));
        data.word(equations.substeps() as u64);
        equations.coefficients().iter().for_each(|&c| data.number(c));
    }
    [hex(told), hex(data)]
}
