//! Live streams.

use crate::live::Live;
use crate::models;

/// Longest stream \[lines\].
const LONGEST: usize = 200;

/// The streams: all variants that learn, and a vessel that is steered.
pub fn variants() -> Vec<String> {
    let steered = ["vessel+steered", "vessel+planned"].map(str::to_owned);
    models::variants().into_iter().chain(steered).collect()
}

/// The first byte chooses the variant, the second the format (`j` for JSON); then lines follow. A line that begins with `@`
/// is a sample in the codes of [`Live::coded`]. Every line of data has one answer, nothing is null without a reason,
/// and clean samples bring finite predictions.
pub fn stream(bytes: &[u8]) {
    let [variant, format, lines @ ..] = bytes else { return };
    let variants = variants();
    let mut live = Live::new(&variants[usize::from(*variant) % variants.len()], *format == b'j');
    live.begin();
    for line in lines.split(|byte| *byte == b'\n').take(LONGEST) {
        let is_blank = std::str::from_utf8(line).is_ok_and(|line| line.trim().is_empty());
        let answer = match line.strip_prefix(b"@") {
            Some(codes) => live.coded(codes),
            None => live.serve(line),
        };
        assert_eq!(
            answer.is_none(),
            is_blank,
            "an answer to each line of data: {}",
            String::from_utf8_lossy(line)
        );
    }
    live.recover();
}
