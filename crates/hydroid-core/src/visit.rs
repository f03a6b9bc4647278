//! Visits of the numbers of a state, to save or restore them.

/// Visits a counter of at most `most`.
pub(crate) fn visit_count(count: &mut usize, most: usize, visit: &mut dyn FnMut(&mut f64)) {
    let mut number = *count as f64;
    visit(&mut number);
    // A cast saturates, and NaN is 0.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let whole = number as usize;
    *count = whole.min(most);
}
