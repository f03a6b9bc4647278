//! Commands on topics, with the conditions under which they are sent and the causes that end them.

use std::collections::{BTreeSet, VecDeque};

use hydroid_live::link::{Axis, HelmEvent};

/// Milliseconds in nanoseconds.
const MS: i64 = 1_000_000;

/// A command that does not change is sent again after this time.
const REPEAT_NS: i64 = 80 * MS;

/// Without a new command for this time, the neutral command is sent.
const NEUTRAL_NS: i64 = 1_000 * MS;

/// Without a new command for this time, commands end.
const SILENT_NS: i64 = 2_000 * MS;

/// A permission counts for this time.
const ENABLED_NS: i64 = 1_000 * MS;

/// Another node commands if a message of it is not older.
const FOREIGN_NS: i64 = 2_000 * MS;

/// The clock of this computer was set if it goes back by more.
const CLOCK_BACK_NS: i64 = 100 * MS;

/// Neutral commands at the end, in case one is lost.
const NEUTRAL_STEPS: usize = 3;

/// Time between them.
const STEP_NS: i64 = 100 * MS;

/// Options of commands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Whether the operator allows commands.
    pub may_command: bool,
    /// Whether commands are computed only.
    pub is_dry_run: bool,
    /// Topic of the permission.
    pub enable: Option<String>,
}

#[derive(Clone, Debug)]
enum Phase {
    Off,
    Commanding { commanded_ns: i64, sent_ns: Option<i64>, is_changed: bool },
    Releasing { step: usize, sent_ns: Option<i64> },
}

/// Commands of a session. Values are those of the fields of topics.
#[derive(Clone, Debug)]
pub struct Commander {
    options: Options,
    axes: Vec<Axis>,
    values: Vec<f64>,
    phase: Phase,
    now_ns: i64,
    /// The last permission and its time.
    enabled: Option<(bool, i64)>,
    /// The last message of another node on a topic of commands.
    foreign: Option<(String, i64)>,
    /// Topics of commands to which nobody subscribes.
    unheard: Vec<String>,
    /// Topics of commands on which others publish.
    shared: Vec<String>,
    /// What ends commands until hydroid is started again, or the network accepts them.
    trouble: Option<String>,
    is_alive: bool,
    events: VecDeque<HelmEvent>,
}

impl Commander {
    /// Before the first message.
    pub fn new(axes: Vec<Axis>, options: Options) -> Result<Self, String> {
        for Axis { name, low, high, rest, .. } in &axes {
            if !(low.is_finite() && high.is_finite() && low < high && (low..=high).contains(&rest)) {
                return Err(format!(
                    "'{name}' has limits {low} to {high} and the neutral command {rest}: limits must ascend, with the \
                     neutral command between them"
                ));
            }
        }
        if axes.is_empty() {
            return Err("no input of the model is commanded: select at least one".to_owned());
        }
        Ok(Self {
            values: axes.iter().map(|axis| axis.rest).collect(),
            options,
            axes,
            phase: Phase::Off,
            now_ns: i64::MIN,
            enabled: None,
            foreign: None,
            unheard: Vec::new(),
            shared: Vec::new(),
            trouble: None,
            is_alive: false,
            events: VecDeque::new(),
        })
    }

    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Topics of the commands.
    pub fn topics(&self) -> Vec<usize> {
        let topics: BTreeSet<usize> = self.axes.iter().map(|axis| axis.place[0]).collect();
        topics.into_iter().collect()
    }

    pub fn permit(&mut self, is_enabled: bool, now_ns: i64) {
        self.enabled = Some((is_enabled, now_ns));
        self.watch(now_ns);
    }

    /// Another node has sent a command.
    pub fn hear_other(&mut self, topic: &str, now_ns: i64) {
        self.foreign = Some((topic.to_owned(), now_ns));
        // The neutral commands of a release would disturb it, too.
        if let Phase::Releasing { .. } = self.phase {
            self.phase = Phase::Off;
        }
        self.watch(now_ns);
    }

    /// Takes the state of the graph: topics of commands without subscribers, and with other publishers, and another reason
    /// against commands.
    pub fn see(&mut self, unheard: Vec<String>, shared: Vec<String>, trouble: Option<String>, now_ns: i64) {
        (self.unheard, self.shared, self.trouble) = (unheard, shared, trouble);
        self.watch(now_ns);
    }

    /// Whether messages arrive.
    pub fn set_alive(&mut self, is_alive: bool, now_ns: i64) {
        self.is_alive = is_alive;
        self.watch(now_ns);
    }

    /// Whether commands are permitted by their topic; `None` without one.
    pub fn is_enabled(&self, now_ns: i64) -> Option<bool> {
        self.options.enable.as_ref()?;
        Some(self.enabled.is_some_and(|(is, at)| is && now_ns.saturating_sub(at) <= ENABLED_NS))
    }

    /// Conditions that end commands, too.
    fn unmet(&self, now_ns: i64) -> Option<String> {
        if !self.is_alive {
            return Some("no messages arrive".to_owned());
        }
        if let (Some(topic), Some(false)) = (&self.options.enable, self.is_enabled(now_ns)) {
            return Some(match self.enabled {
                Some((false, _)) => format!("{topic} is false"),
                Some(_) => format!("there has been no message on {topic} for a second"),
                None => format!("there is no message on {topic}, which permits commands"),
            });
        }
        if let Some(topic) = self.unheard.first() {
            return Some(format!(
                "nobody subscribes to {topic}: start the driver of the actuators, or correct its name or type"
            ));
        }
        if self.trouble.is_some() {
            return self.trouble.clone();
        }
        let (topic, _) = self.foreign.as_ref().filter(|_| self.is_foreign(now_ns))?;
        Some(format!("another node commands {topic}: only one of them may steer"))
    }

    /// Whether a command of another node is recent.
    fn is_foreign(&self, now_ns: i64) -> bool {
        self.foreign.as_ref().is_some_and(|(_, at)| now_ns.saturating_sub(*at) <= FOREIGN_NS)
    }

    /// Why commands cannot begin now.
    pub fn refusals(&self, now_ns: i64) -> Vec<String> {
        let mut refusals = Vec::new();
        if self.options.is_dry_run {
            refusals.push("this is a dry run: leave --dry-run out".to_owned());
        }
        if !self.options.may_command {
            refusals.push("commands are not allowed: start with --allow-commands".to_owned());
        }
        refusals.extend(self.unmet(now_ns));
        for topic in &self.shared {
            refusals.push(format!("another node publishes {topic}: stop it, only one of them may steer"));
        }
        refusals
    }

    /// Whether commands are sent.
    pub fn is_commanding(&self) -> bool {
        matches!(self.phase, Phase::Commanding { .. })
    }

    /// Begins with the neutral command.
    pub fn begin(&mut self, now_ns: i64) -> Result<(), Vec<String>> {
        self.watch(now_ns);
        if self.is_commanding() {
            return Ok(());
        }
        let refusals = self.refusals(now_ns);
        if !refusals.is_empty() {
            return Err(refusals);
        }
        self.values = self.axes.iter().map(|axis| axis.rest).collect();
        self.phase = Phase::Commanding { commanded_ns: now_ns, sent_ns: None, is_changed: true };
        Ok(())
    }

    /// Takes a command. Values beyond the limits become the limits; those that are not finite become the neutral command.
    pub fn command(&mut self, values: &[f64], now_ns: i64) {
        self.watch(now_ns);
        let Phase::Commanding { commanded_ns, is_changed, .. } = &mut self.phase else { return };
        *commanded_ns = now_ns;
        for (i, (to, axis)) in self.values.iter_mut().zip(&self.axes).enumerate() {
            let value = values.get(i).copied().filter(|value| value.is_finite()).unwrap_or(axis.rest);
            let value = value.clamp(axis.low, axis.high);
            *is_changed |= *to != value;
            *to = value;
        }
    }

    /// Ends the commands: neutral, then none.
    pub fn release(&mut self, now_ns: i64, reason: &str) {
        self.now_ns = self.now_ns.max(now_ns);
        self.hand_off(reason.to_owned(), true);
    }

    fn hand_off(&mut self, reason: String, is_ours: bool) {
        if self.is_commanding() {
            self.phase = if is_ours { Phase::Releasing { step: 0, sent_ns: None } } else { Phase::Off };
            self.events.push_back(HelmEvent::HandsOff(reason));
        }
    }

    /// Ends the commands if a condition is not met.
    fn watch(&mut self, now_ns: i64) {
        let is_back = now_ns.saturating_add(CLOCK_BACK_NS) < self.now_ns;
        self.now_ns = now_ns;
        if is_back {
            self.hand_off("the clock of this computer has gone back".to_owned(), true);
            (self.enabled, self.foreign) = (None, None);
        }
        let Phase::Commanding { commanded_ns, is_changed, .. } = &mut self.phase else { return };
        let age = now_ns.saturating_sub(*commanded_ns);
        if age > NEUTRAL_NS {
            for (to, axis) in self.values.iter_mut().zip(&self.axes) {
                *is_changed |= *to != axis.rest;
                *to = axis.rest;
            }
        }
        let is_foreign = self.is_foreign(now_ns);
        if age > SILENT_NS && !is_foreign {
            self.hand_off(format!("there has been no new command for {:.1} s", age as f64 / 1e9), true);
        } else if let Some(reason) = self.unmet(now_ns) {
            // The cause without its remedy. Who has taken over must not be disturbed by a neutral command.
            let cause = reason.rsplit_once(": ").map_or(reason.as_str(), |(cause, _)| cause);
            self.hand_off(cause.to_owned(), !is_foreign);
        }
    }

    /// The values that are due to be sent.
    pub fn due(&mut self, now_ns: i64) -> Option<&[f64]> {
        self.watch(now_ns);
        let is_due = |sent: Option<i64>, step| sent.is_none_or(|sent| now_ns.saturating_sub(sent) >= step);
        match &mut self.phase {
            Phase::Off => None,
            Phase::Commanding { sent_ns, is_changed, .. } => {
                if !*is_changed && !is_due(*sent_ns, REPEAT_NS) {
                    return None;
                }
                (*is_changed, *sent_ns) = (false, Some(now_ns));
                Some(&self.values)
            }
            Phase::Releasing { step, sent_ns } => {
                if !is_due(*sent_ns, STEP_NS) {
                    return None;
                }
                (*step, *sent_ns) = (*step + 1, Some(now_ns));
                if *step == NEUTRAL_STEPS {
                    self.phase = Phase::Off;
                }
                for (to, axis) in self.values.iter_mut().zip(&self.axes) {
                    *to = axis.rest;
                }
                Some(&self.values)
            }
        }
    }

    pub fn take_event(&mut self) -> Option<HelmEvent> {
        self.events.pop_front()
    }
}
