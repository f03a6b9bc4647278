//! Peak memory of the process, on Linux.

use std::fs;

/// Resets the peak, so that the next [`mb`] covers the time in between.
pub fn reset() {
    // 5 resets the peak of the resident set (proc(5), clear_refs). Without it, the peak includes earlier work.
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// Peak resident memory since the last [`reset`] \[MB\]; `None` on other systems.
pub fn mb() -> Option<f64> {
    of(&fs::read_to_string("/proc/self/status").ok()?)
}

/// The peak in the text of `/proc/self/status` \[MB\].
pub fn of(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some((kib * 1.024e-3).round())
}
