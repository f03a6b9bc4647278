//! Integration tests of the study.

mod hydrofoil;
