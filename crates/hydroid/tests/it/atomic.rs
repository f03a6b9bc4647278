//! Atomic writes.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use hydroid::atomic;

/// Links and devices must not be replaced.
#[test]
fn links_and_devices_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (target, link) = (folder.path().join("target"), folder.path().join("link"));
    std::fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    atomic::write(&link, |out| out.write_all(b"new")).unwrap();
    assert!(link.is_symlink());
    assert_eq!(std::fs::read_to_string(&target).unwrap(), "new");
    atomic::write(Path::new("/dev/null"), |out| out.write_all(b"gone")).unwrap();
    assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

/// Work that pauses for a write that may block is not ended in the pause.
#[test]
fn a_short_pause_of_held_work_does_not_end_it() {
    static FINISHED: AtomicBool = AtomicBool::new(false);
    let (begun, wait) = mpsc::channel();
    let work = std::thread::spawn(move || {
        for k in 0..30 {
            let held = atomic::hold();
            let _ = begun.send(());
            std::thread::sleep(Duration::from_millis(20));
            FINISHED.store(k == 29, Ordering::SeqCst);
            drop(held);
            std::thread::sleep(Duration::from_millis(10));
        }
    });
    wait.recv().unwrap();
    let settled = atomic::settle(Duration::from_millis(500), Duration::from_secs(20));
    assert!(settled.is_some() && FINISHED.load(Ordering::SeqCst));
    drop(settled);
    work.join().unwrap();
}
