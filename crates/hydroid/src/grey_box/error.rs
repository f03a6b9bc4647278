//! Errors of a grey box.

use hydroid_core::model::CraftModelError;

use crate::key::key;
use crate::progress::Cancelled;

/// Error of the estimation of the numbers of a vessel file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum GreyBoxError {
    #[error(
        "the vessel file marks no number to estimate: add a list of paths, as in estimate = [\"drag.linear[0][0]\", \"thruster.*.forward\"]"
    )]
    NothingMarked,
    #[error(
        "the vessel has the {what} {needed}, the logs have {given}: name the columns of the log, as in {}",
        key(what).is("NAME=COLUMN")
    )]
    Channels {
        /// `outputs` or `inputs`.
        what: &'static str,
        given: String,
        needed: String,
    },
    #[error(
        "the vessel has the command '{name}' in {needed}, the logs in {given}: state the unit of the column, as in {}",
        key("inputs").is(format_args!("{name}=COLUMN [{needed}]"))
    )]
    Unit { name: String, given: String, needed: String },
    #[error(
        "the motion of the vessel file diverges from the logs, or no run is as long as the horizon: check the numbers of the file with `hydroid simulate VESSEL.toml --excitation LOG`, or give a shorter {}",
        key("horizon")
    )]
    NoStart,
    #[error(transparent)]
    Vessel(#[from] CraftModelError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
