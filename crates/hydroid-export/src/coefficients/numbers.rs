//! Numbers as text of other languages.

/// The shortest text that is read back as the same number, in Python, MATLAB and XML. An infinite number becomes the word
/// that is given.
pub(super) fn exact(x: f64, infinity: &str) -> String {
    if x.is_infinite() {
        return if x > 0.0 { infinity.to_owned() } else { format!("-{infinity}") };
    }
    // A zero without a sign.
    format!("{:?}", x + 0.0)
}

/// A number for a comment.
pub(super) fn short(x: f64) -> String {
    exact(x, "inf")
}
