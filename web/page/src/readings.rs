//! Logs as tables. A reading that computes the velocities from sensors takes most of the time of an identification: it is
//! kept, so that a single log that was checked is not read once more. Several logs of a vessel are read together, since their
//! sensors are estimated together.

use std::cell::RefCell;

use hydroid::log::{LogError, Note, PrepareOptions, RawLog, Selection};
use hydroid::progress::Progress;
use hydroid::recording::read_logs;
use hydroid_io::LogFile;

/// The readings from sensors: the last one of each set of files.
#[derive(Default)]
pub(crate) struct Readings(RefCell<Vec<Reading>>);

struct Reading {
    names: Vec<String>,
    asked: Selection,
    options: PrepareOptions,
    selection: Selection,
    tables: Vec<RawLog>,
    notes: Vec<Note>,
}

impl Readings {
    /// As [`read_logs`], of files that have not changed since [`Readings::forget`].
    pub(crate) fn read(
        &self,
        files: &[LogFile],
        selection: &mut Selection,
        options: &PrepareOptions,
        progress: Progress<'_>,
    ) -> Result<(Vec<RawLog>, Vec<Note>), LogError> {
        if selection.sensors.is_none() {
            return read_logs(files, selection, options, progress);
        }
        let names: Vec<String> = files.iter().map(LogFile::name).collect();
        let kept = self.0.borrow();
        let same =
            kept.iter().find(|own| own.names == names && own.asked == *selection && own.options == *options);
        if let Some(same) = same {
            selection.clone_from(&same.selection);
            return Ok((same.tables.clone(), same.notes.clone()));
        }
        drop(kept);
        let asked = selection.clone();
        let (tables, notes) = read_logs(files, selection, options, progress)?;
        let mut kept = self.0.borrow_mut();
        kept.retain(|own| own.names != names);
        kept.push(Reading {
            names,
            asked,
            options: *options,
            selection: selection.clone(),
            tables: tables.clone(),
            notes: notes.clone(),
        });
        Ok((tables, notes))
    }

    /// Forgets the readings of a file.
    pub(crate) fn forget(&self, name: &str) {
        self.0.borrow_mut().retain(|own| own.names.iter().all(|own| own != name));
    }
}
