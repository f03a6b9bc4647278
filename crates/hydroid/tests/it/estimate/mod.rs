//! Regressions, selection, ensembles, constraints and robust losses against theory and brute force.

mod constraints;
mod criterion;
mod ensemble;
mod kernel;
mod made;
mod robust;
