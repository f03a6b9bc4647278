//! Integration tests of the study.

mod hydrofoil;
mod peak_memory;
