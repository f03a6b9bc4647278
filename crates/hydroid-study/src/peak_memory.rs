//! Peak memory of the process, on Linux.

use std::fs;

/// Resets the peak, so that the next [`mb`] covers the time in between.
pub(super) fn reset() {
    // 5 resets the peak of the resident set (proc(5), clear_refs). Without it, the peak includes earlier work.
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// Peak resident memory since the last [`reset`] \[MB\]; `None` on other systems.
pub(super) fn mb() -> Option<f64> {
    of(&fs::read_to_string("/proc/self/status").ok()?)
}

fn of(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some((kib * 1.024e-3).round())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_tells_in_kibibytes() {
        assert_eq!(of("VmPeak:\t  9 kB\nVmHWM:\t 1000000 kB\nVmRSS:\t 1 kB\n"), Some(1024.0));
        assert_eq!(of("Name:\thydroid\n"), None);
    }

    #[test]
    fn what_is_used_shows() {
        // Written, so that the pages are resident; other tests of this process may use more.
        let filled = vec![1u8; 256 << 20];
        let Some(peak) = mb() else { return };
        assert!(filled.iter().map(|&x| u64::from(x)).sum::<u64>() == 256 << 20 && peak > 256.0, "{peak} MB");
    }
}
