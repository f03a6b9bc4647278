//! A day: the loop of boat, link and hydroid, with an operator and a pilot.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use hydroid::model::Model;
use hydroid_live::boat::{Action, Boat, Identified, Settings};
use hydroid_live::link::mavlink::MavLink;
use mavlink::{MavHeader, Message as _};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

use super::autopilot::{Autopilot, MANUAL};
use super::faults::Recovery;
use super::link::Direction;
use super::recordings::Recordings;
use super::vessel::{Commands, FENCE_M, link, model, settings};
use super::watch::Watch;
use super::{Counts, MS, S, TICK_NS};

/// Start of each day.
const START_NS: i64 = 1_700_000_000 * S;

const VEHICLE: MavHeader = MavHeader { system_id: 1, component_id: 1, sequence: 0 };

/// Distances from the middle at which the pilot fetches the boat, and at which it is given back \[m\].
const FETCH_M: f64 = 0.5 * FENCE_M;
const BACK_M: f64 = 12.0;

/// The boat may be outside of the fence by so much under command: errors of the position, and its way until it is seen.
const OUTSIDE_M: f64 = 20.0;

/// Time after the end of a jump in which the estimate may be off.
const OFF_NS: i64 = 20 * S;

const EXPERIMENTS: [&str; 6] = ["auto", "acceleration", "zigzag-20", "circle", "prbs", "chirp"];

pub(super) struct Day {
    commands: Commands,
    pub(super) rng: ChaCha8Rng,
    pub(super) now_ns: i64,
    pub(super) autopilot: Autopilot,
    /// To hydroid, and to the autopilot.
    pub(super) down: Direction,
    pub(super) up: Direction,
    boat: Boat<MavLink>,
    settings: Settings,
    pub(super) watch: Watch,
    recordings: Recordings,
    _place: TempDir,
    pub(super) present_folder: PathBuf,
    pub(super) recoveries: Vec<(i64, Recovery)>,
    /// hydroid does not run before this time.
    dead_until_ns: i64,
    is_fetched: bool,
    /// Last time at which positions were off.
    off_ns: i64,
    /// Number of the last message to the crew, and the last ones.
    told: u64,
    said: Vec<String>,
    /// Way of the boat when steering began.
    steers_from_m: Option<f64>,
    pub(super) counts: Counts,
}

impl Day {
    pub(super) fn new(commands: Commands, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let place = TempDir::new().unwrap();
        let folder = place.path().join("live");
        let settings = settings(commands, &folder, &mut rng);
        let mut autopilot = Autopilot::new(START_NS, &mut rng);
        let watch = Watch::new(commands, &settings);
        autopilot.set_mode(watch.required_mode());
        let boat = begin(commands, &settings, START_NS, &mut rng);
        Self {
            commands,
            rng,
            now_ns: START_NS,
            autopilot,
            down: Direction::new(),
            up: Direction::new(),
            boat,
            settings,
            watch,
            recordings: Recordings::default(),
            _place: place,
            present_folder: folder,
            recoveries: Vec::new(),
            dead_until_ns: 0,
            is_fetched: false,
            off_ns: 0,
            told: 0,
            said: Vec::new(),
            steers_from_m: None,
            counts: Counts::default(),
        }
    }

    /// Folder of the recordings in the settings.
    pub(super) fn folder(&self) -> PathBuf {
        self.settings.folder.clone()
    }

    pub(super) fn seconds(&self) -> f64 {
        (self.now_ns - START_NS) as f64 / 1e9
    }

    /// The last messages to the crew.
    pub(super) fn last_said(&self) -> String {
        self.said[self.said.len().saturating_sub(15)..].join("\n")
    }

    pub(super) fn counts(&self) -> Counts {
        let mut counts = self.counts.clone();
        counts.seconds = (self.now_ns - START_NS) / S;
        counts.commands += self.watch.count;
        counts.damaged = self.down.damaged + self.up.damaged;
        let Recordings { files, rows, left_out, .. } = &self.recordings;
        (counts.files, counts.rows, counts.left_out) = (*files, *rows, *left_out);
        counts
    }

    pub(super) fn run(&mut self, seconds: i64) -> Result<(), String> {
        let [mut acts_ns, mut fails_ns] = [START_NS + 8 * S, START_NS + 60 * S];
        let end_ns = START_NS + seconds * S;
        while self.now_ns < end_ns {
            self.step()?;
            self.recover();
            self.pilot();
            if self.now_ns >= acts_ns {
                acts_ns = self.now_ns + self.rng.random_range(2 * S..40 * S);
                self.operate()?;
            }
            if self.now_ns >= fails_ns {
                // Experiments and paths need some quiet time.
                let longest = if self.rng.random_bool(0.3) { 600 * S } else { 120 * S };
                fails_ns = self.now_ns + self.rng.random_range(5 * S..longest);
                self.fault()?;
            }
        }
        self.boat.release(self.now_ns);
        self.hear()?;
        for _ in 0..50 {
            self.step()?;
        }
        let left_out = self.left_out();
        self.boat.close(self.now_ns);
        if self.recordings.path().is_some() {
            self.recordings.end(&self.present_folder, left_out)?;
        }
        self.hear()
    }

    /// A tick of both sides.
    fn step(&mut self) -> Result<(), String> {
        self.now_ns += TICK_NS;
        let now_ns = self.now_ns;
        for message in self.autopilot.tick(&mut self.rng) {
            self.down.send(VEHICLE, &message, now_ns, &mut self.rng);
        }
        self.watch.see(&self.autopilot);
        let is_dead = now_ns < self.dead_until_ns;
        while let Some(received) = self.down.next(now_ns) {
            let (header, message) = &received;
            let is_own = (header.system_id, header.component_id) == (1, 1);
            if is_dead {
                continue;
            }
            if is_own {
                self.watch.told(message, now_ns);
            }
            self.counts.samples += u64::from(self.boat.receive(&received, now_ns));
            self.hear()?;
            if is_own {
                self.recordings.add(message, now_ns);
            }
        }
        if !is_dead {
            self.tick()?;
        }
        while let Some((_, message)) = self.up.next(now_ns) {
            self.autopilot.receive(&message);
        }
        if self.autopilot.faults.jump_m != [0.0; 2] {
            self.off_ns = now_ns;
        }
        // With positions that are off, the operator has begun again in spite of the warning.
        let is_judged = self.watch.is_commanding() && now_ns - self.off_ns > OFF_NS;
        if is_judged && self.autopilot.water.distance() > FENCE_M + OUTSIDE_M {
            return Err(format!("a commanded boat {:.0} m from the middle", self.autopilot.water.distance()));
        }
        Ok(())
    }

    /// hydroid sends what is due.
    fn tick(&mut self) -> Result<(), String> {
        let mut sent = Vec::new();
        self.boat.tick(self.now_ns, |message| sent.push(message));
        self.hear()?;
        for (header, message) in sent {
            self.watch.sent(&message, self.now_ns)?;
            // Rows of the messages that hydroid sends are those of its commands.
            if matches!(message.message_name(), "RC_CHANNELS_OVERRIDE" | "SET_POSITION_TARGET_LOCAL_NED") {
                self.recordings.add(&message, self.now_ns);
            }
            self.up.send(header, &message, self.now_ns, &mut self.rng);
        }
        Ok(())
    }

    /// Takes what hydroid says.
    fn hear(&mut self) -> Result<(), String> {
        let way_m = self.autopilot.water.way_m;
        for said in self.boat.said_after(self.told) {
            self.told = said.id;
            let text = said.text.as_str();
            self.said.push(format!("{:.2} s: {text}", (said.at_ns - START_NS) as f64 / 1e9));
            self.watch.said(text, self.now_ns)?;
            if let Some(path) = text.strip_prefix("recording ") {
                self.recordings.begin(path.as_ref());
            } else if let Some(reason) = text.strip_prefix("hands off: ") {
                self.counts.experiments += u64::from(reason.contains("is complete"));
                *self.counts.ends.entry(words(reason)).or_default() += 1;
                if let Some(from_m) = self.steers_from_m.take() {
                    self.counts.steered_m += way_m - from_m;
                }
            } else if text == "hydroid steers" {
                self.steers_from_m = Some(way_m);
            } else if let Some(why) = text.strip_prefix("refused: ") {
                *self.counts.refused.entry(words(why)).or_default() += 1;
            }
        }
        let excess = self.said.len().saturating_sub(100);
        self.said.drain(..excess);
        Ok(())
    }

    /// Rows that the recorder has left out so far.
    fn left_out(&self) -> u64 {
        self.boat.view(self.now_ns, [0; 2])["recording"]["lost"].as_u64().unwrap_or(0)
    }

    /// Waits for a thread of hydroid, while the time stands still.
    fn wait(&mut self, is_done: impl Fn(&str) -> bool) -> Result<(), String> {
        for _ in 0..100_000 {
            let from = self.told;
            self.tick()?;
            if self.boat.said_after(from).any(|said| is_done(&said.text)) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_micros(300));
        }
        Err("a thread has not ended".to_owned())
    }

    /// The pilot fetches a boat that nobody commands and that is far from the middle.
    fn pilot(&mut self) {
        let distance = self.autopilot.water.distance();
        let is_in_use = self.watch.is_commanding() || self.is_awaited_mode();
        let required_mode = self.watch.required_mode();
        let fetches = if self.is_fetched { distance > BACK_M } else { distance > FETCH_M };
        if is_in_use || !fetches {
            if std::mem::take(&mut self.is_fetched) {
                self.autopilot.sticks = [0.0; 2];
                if !is_in_use {
                    self.autopilot.set_mode(required_mode);
                }
            }
            return;
        }
        self.is_fetched = true;
        self.autopilot.set_mode(MANUAL);
        self.autopilot.sticks = self.autopilot.water.homeward();
    }

    fn is_awaited_mode(&self) -> bool {
        self.recoveries.iter().any(|(_, recovery)| *recovery == Recovery::Mode)
    }

    /// The operator does something.
    fn operate(&mut self) -> Result<(), String> {
        if self.now_ns < self.dead_until_ns || self.is_fetched {
            return Ok(());
        }
        let choice = self.rng.random_range(0..100);
        let name = EXPERIMENTS[self.rng.random_range(0..EXPERIMENTS.len())].to_owned();
        let action = match choice {
            0..3 => Action::Stop {},
            3..6 => Action::Freeze {},
            6..9 => Action::Learn {},
            9..12 => Action::Record {},
            12..14 => Action::StopRecording {},
            14..23 => Action::Identify {},
            23..30 => Action::Adopt {},
            30..34 => Action::RollBack {},
            34..65 => Action::Experiment { name },
            _ => Action::Steer {},
        };
        let (before, left_out) = (self.recordings.path().is_some(), self.left_out());
        let done = self.boat.act(action.clone(), self.now_ns);
        if done.is_ok() && before && matches!(action, Action::StopRecording {} | Action::Identify {}) {
            self.recordings.end(&self.present_folder, left_out)?;
        }
        self.hear()?;
        if done.is_err() {
            return Ok(());
        }
        match action {
            Action::Experiment { .. } => self.watch.begun(),
            Action::Identify {} => {
                self.wait(|text| text.contains("was identified:") || text.starts_with("no model"))?;
            }
            Action::Adopt {} => self.counts.adopted += 1,
            Action::Steer {} => {
                self.watch.asked_to_steer();
                // Some change their mind before the controller is ready.
                if self.rng.random_bool(0.1) {
                    drop(self.boat.act(Action::Stop {}, self.now_ns));
                    return self.hear();
                }
                self.wait(|text| {
                    text == "hydroid steers" || text.contains("cannot steer") || text.starts_with("hands off")
                })?;
            }
            _ => {}
        }
        Ok(())
    }

    /// hydroid is killed, and begins again after a while.
    pub(super) fn kill(&mut self) -> Result<(), String> {
        self.recordings.kill(&self.present_folder)?;
        self.counts.kills += 1;
        self.counts.commands += self.watch.count;
        if let Some(from_m) = self.steers_from_m.take() {
            self.counts.steered_m += self.autopilot.water.way_m - from_m;
        }
        self.dead_until_ns = self.now_ns + self.rng.random_range(500 * MS..20 * S);
        self.boat = begin(self.commands, &self.settings, self.dead_until_ns, &mut self.rng);
        self.watch = Watch::new(self.commands, &self.settings);
        self.told = 0;
        Ok(())
    }
}

/// hydroid with a model on board, and one that is offered for each identification.
fn begin(commands: Commands, settings: &Settings, now_ns: i64, rng: &mut ChaCha8Rng) -> Boat<MavLink> {
    let mut boat = Boat::new(settings.clone(), MavLink::new(link(10.0)), now_ns).unwrap();
    if rng.random_bool(0.9) {
        boat.take_on("first", &model(commands, 0.3, rng)).unwrap();
    }
    let offered: Vec<Model> = (0..4).map(|_| model(commands, 0.2, rng)).collect();
    boat.identify_by(Arc::new(move |recordings, _| {
        let model = offered[recordings.len() % offered.len()].clone();
        Ok(Identified { name: format!("model-{}", recordings.len()), model, text: "good".to_owned() })
    }));
    boat
}

/// The first words of a text, without numbers.
fn words(text: &str) -> String {
    let letters: String = text.chars().filter(|c| !c.is_ascii_digit()).collect();
    letters.split_whitespace().take(9).collect::<Vec<_>>().join(" ")
}
