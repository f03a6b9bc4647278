//! Integration tests of the exports.

mod coefficients;
