//! Integration tests of the reports.

mod closed_loop;
mod figure;
mod identification;
mod text;
