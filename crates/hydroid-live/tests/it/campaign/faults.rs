//! Random faults, and what ends them.

use std::fs;

use rand::RngExt as _;

use super::S;
use super::autopilot::HOLD;
use super::day::Day;
use super::link::Faults;

/// What ends a fault, or what the pilot does after a take-over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Recovery {
    Link,
    Fix,
    Jump,
    Compass,
    Receiver,
    Disk,
    Mode,
    Arm,
    Failsafe,
}

/// Names of the faults.
const FAULTS: [&str; 14] = [
    "silence",
    "bad link",
    "no fix",
    "short jump",
    "jump that stays",
    "frozen compass",
    "frozen receiver",
    "clock step",
    "restart",
    "failsafe",
    "disk",
    "kill",
    "take-over",
    "disarmed",
];

impl Day {
    fn recover_after(&mut self, seconds: std::ops::Range<f64>, recovery: Recovery) {
        #[expect(clippy::cast_possible_truncation, reason = "minutes")]
        let ns = (1e9 * self.rng.random_range(seconds)) as i64;
        self.recoveries.push((self.now_ns + ns, recovery));
    }

    fn is_awaited(&self, recovery: Recovery) -> bool {
        self.recoveries.iter().any(|(_, other)| *other == recovery)
    }

    /// A random fault.
    pub(super) fn fault(&mut self) -> Result<(), String> {
        let name = FAULTS[self.rng.random_range(0..FAULTS.len())];
        match name {
            "silence" => {
                let until_ns = self.now_ns + self.rng.random_range(S / 2..20 * S);
                let which = self.rng.random_range(0..3);
                for (k, direction) in [&mut self.down, &mut self.up].into_iter().enumerate() {
                    if which != k {
                        direction.silent_until_ns = until_ns;
                    }
                }
            }
            "bad link" => {
                let mut share = |most: f64| self.rng.random_range(0.0..most);
                let faults = Faults {
                    loss: share(0.4),
                    duplication: share(0.3),
                    corruption: share(0.2),
                    reordering: share(0.3),
                };
                (self.down.faults, self.up.faults) = (faults, faults);
                self.recover_after(5.0..120.0, Recovery::Link);
            }
            "no fix" => {
                self.autopilot.faults.has_no_fix = true;
                self.recover_after(0.5..40.0, Recovery::Fix);
            }
            "short jump" | "jump that stays" if !self.is_awaited(Recovery::Jump) => {
                let (far, to) = (self.rng.random_range(3.0..90.0), self.rng.random_range(-3.2..3.2_f64));
                self.autopilot.faults.jump_m = [far * to.cos(), far * to.sin()];
                let stays = if name == "short jump" { 0.2..2.0 } else { 20.0..150.0 };
                self.recover_after(stays, Recovery::Jump);
            }
            "frozen compass" if !self.is_awaited(Recovery::Compass) => {
                self.autopilot.faults.frozen = Some(self.autopilot.water.pose[2]);
                self.recover_after(2.0..60.0, Recovery::Compass);
            }
            "frozen receiver" if !self.is_awaited(Recovery::Receiver) => {
                self.autopilot.freeze_receiver();
                self.recover_after(1.0..60.0, Recovery::Receiver);
            }
            "clock step" => {
                // The clock of the autopilot goes forward, or back.
                let step_ns = self.rng.random_range(-20 * S..20 * S);
                self.autopilot.boot_ns = (self.autopilot.boot_ns + step_ns).min(self.autopilot.now_ns);
            }
            "restart" => {
                self.autopilot.restart();
                self.recover_after(5.0..30.0, Recovery::Mode);
                self.recover_after(10.0..40.0, Recovery::Arm);
            }
            "failsafe" => {
                self.autopilot.fail();
                self.recover_after(2.0..20.0, Recovery::Failsafe);
                self.recover_after(20.0..40.0, Recovery::Mode);
            }
            "disk" if !self.is_awaited(Recovery::Disk) => {
                self.take_disk();
                self.recover_after(5.0..120.0, Recovery::Disk);
            }
            "kill" => self.kill()?,
            "take-over" => {
                let modes = [HOLD, 3, 5, 10, 11];
                self.autopilot.set_mode(modes[self.rng.random_range(0..modes.len())]);
                self.recover_after(1.0..40.0, Recovery::Mode);
            }
            "disarmed" => {
                self.autopilot.set_armed(false);
                self.recover_after(1.0..30.0, Recovery::Arm);
            }
            _ => return Ok(()),
        }
        *self.counts.faults.entry(name).or_default() += 1;
        Ok(())
    }

    /// Ends the faults whose time has come.
    pub(super) fn recover(&mut self) {
        let now_ns = self.now_ns;
        let due: Vec<Recovery> =
            self.recoveries.extract_if(.., |(at_ns, _)| *at_ns <= now_ns).map(|(_, what)| what).collect();
        for recovery in due {
            let autopilot = &mut self.autopilot;
            match recovery {
                Recovery::Link => (self.down.faults, self.up.faults) = Default::default(),
                Recovery::Fix => autopilot.faults.has_no_fix = false,
                Recovery::Jump => autopilot.faults.jump_m = [0.0; 2],
                Recovery::Compass => autopilot.faults.frozen = None,
                Recovery::Receiver => autopilot.faults.fix = None,
                Recovery::Disk => self.give_disk(),
                Recovery::Mode => autopilot.set_mode(self.watch.required_mode()),
                Recovery::Arm => autopilot.set_armed(true),
                Recovery::Failsafe => autopilot.has_failsafe = false,
            }
        }
    }

    /// The folder of the recordings is gone, and cannot be made: a file has its place.
    fn take_disk(&mut self) {
        let folder = self.folder();
        let away = folder.with_extension("away");
        fs::create_dir_all(&folder).unwrap();
        fs::rename(&folder, &away).unwrap();
        fs::write(&folder, b"").unwrap();
        self.present_folder = away;
    }

    fn give_disk(&mut self) {
        let folder = self.folder();
        fs::remove_file(&folder).unwrap();
        fs::rename(folder.with_extension("away"), &folder).unwrap();
        self.present_folder = folder;
    }
}
