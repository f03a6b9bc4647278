//! Peak memory of the process.

use hydroid_study::peak_memory::{mb, of};

#[test]
fn the_status_of_a_process_is_in_kibibytes() {
    assert_eq!(of("VmPeak:\t  9 kB\nVmHWM:\t 1000000 kB\nVmRSS:\t 1 kB\n"), Some(1024.0));
    assert_eq!(of("Name:\thydroid\n"), None);
}

#[test]
fn used_memory_is_in_the_peak() {
    // Written, so that the pages are resident; other tests of this process may use more.
    let filled = vec![1u8; 256 << 20];
    let Some(peak) = mb() else { return };
    assert!(filled.iter().map(|&x| u64::from(x)).sum::<u64>() == 256 << 20 && peak > 256.0, "{peak} MB");
}
