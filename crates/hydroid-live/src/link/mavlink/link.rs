//! An autopilot that speaks `MAVLink` as a [`Link`].

use ::mavlink::MavHeader;
use ::mavlink::dialects::ardupilotmega::MavMessage;

use super::helm::{self, Helm, State, Target};
use super::mixer::{self, Mixer};
use super::topics::{TOPICS, row};
use super::{Autopilot, Options};
use crate::link::{Axis, ClockState, Event, HelmEvent, Link, Topic};

/// Pulses \[us\] of the ends of a channel: the defaults of `RCn_MIN` and `RCn_MAX`.
const PULSES_US: [f64; 2] = [1100.0, 1900.0];

/// Options of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// System id of the autopilot; `None` for the first that is heard.
    pub system: Option<u8>,
    /// Own system id.
    pub own_system: u8,
    /// Rate \[Hz\] that is asked for of the topics in use.
    pub rate_hz: f64,
    /// Whether commands may be sent.
    pub may_command: bool,
    /// Whether commands are computed and not sent.
    pub is_dry_run: bool,
}

/// The autopilot with its helm.
pub struct MavLink {
    settings: Settings,
    autopilot: Autopilot,
    helm: Result<Helm, String>,
    /// From outputs to the channels of the helm.
    mixer: Option<Mixer>,
}

impl MavLink {
    /// Before the first message.
    pub fn new(settings: Settings) -> Self {
        let options = Options { system: settings.system, own_system: settings.own_system, rates: Vec::new() };
        Self {
            settings,
            autopilot: Autopilot::new(options),
            helm: Err("the link is not prepared".to_owned()),
            mixer: None,
        }
    }

    /// The helm of inputs as commands: outputs of the autopilot by its sticks, or others directly.
    fn make_helm(&mut self, axes: Vec<Axis>) -> Result<Helm, String> {
        let options = helm::Options {
            own_system: self.settings.own_system,
            is_allowed: self.settings.may_command,
            is_dry_run: self.settings.is_dry_run,
        };
        let outputs: Option<Vec<_>> =
            axes.iter().map(|axis| output(axis.place).map(|number| axis.clone().at(number))).collect();
        if let Some(outputs) = outputs.filter(|outputs| !outputs.is_empty()) {
            let mixer = Mixer::new(outputs)?;
            let helm = Helm::asking(Mixer::channels(), options, &mixer.parameters())?;
            self.mixer = Some(mixer);
            return Ok(helm);
        }
        let of = |axis: Axis| target(axis.place).map(|target| axis.at(target));
        Helm::new(axes.into_iter().map(of).collect::<Result<_, String>>()?, options)
    }

    /// Ends commands of outputs that no report confirms.
    fn confirm(&mut self, now_ns: i64) {
        if let (Ok(helm), Some(mixer)) = (&mut self.helm, &self.mixer)
            && helm.state() == State::Commanding
            && let Some(reason) = mixer.unconfirmed(now_ns)
        {
            helm.release(now_ns, &reason);
        }
    }
}

/// The number of an output that a field contains.
fn output([topic, field]: [usize; 2]) -> Option<u8> {
    mixer::output(TOPICS[topic].name, TOPICS[topic].fields[field].name)
}

/// The target of a field.
fn target([topic, field]: [usize; 2]) -> Result<Target, String> {
    Target::of(TOPICS[topic].name, TOPICS[topic].fields[field].name)
}

impl Link for MavLink {
    type Message = (MavHeader, MavMessage);

    fn topics(&self) -> &[Topic] {
        TOPICS
    }

    fn limits(&self, place: [usize; 2]) -> Result<Option<[f64; 2]>, String> {
        // What an actuator takes is a property of the boat.
        if output(place).is_some() {
            return Ok(None);
        }
        Ok(matches!(target(place)?, Target::Channel(_)).then_some(PULSES_US))
    }

    fn prepare(&mut self, topics: &[usize], axes: Result<Vec<Axis>, String>) {
        self.helm = axes.and_then(|axes| self.make_helm(axes));
        let mut rates: Vec<(usize, f64)> =
            topics.iter().map(|topic| (*topic, self.settings.rate_hz)).collect();
        for (topic, rate_hz) in self.helm.iter().flat_map(Helm::rates) {
            if !rates.iter().any(|(other, _)| *other == topic) {
                rates.push((topic, rate_hz));
            }
        }
        self.autopilot.ask_for(rates);
    }

    fn clock(&self) -> ClockState {
        let clock = self.autopilot.clock();
        ClockState { offset_s: clock.drift_s(), round_trip_ns: clock.round_trip_ns() }
    }

    fn receive(
        &mut self,
        (header, message): &Self::Message,
        received_ns: i64,
        now_ns: i64,
        tell: &mut dyn FnMut(Event),
    ) {
        let is_own = self.autopilot.receive(*header, message, received_ns, tell);
        let Ok(helm) = &mut self.helm else { return };
        if !is_own {
            return;
        }
        helm.receive(*header, message, now_ns);
        let mut values = Vec::new();
        if let Some(mixer) = &mut self.mixer
            && let MavMessage::SERVO_OUTPUT_RAW(_) = message
            && row(message, &mut values).is_some()
        {
            // The first field is the bank of outputs.
            mixer.report(&values[1..], &|name| helm.parameter(name), now_ns);
        }
        self.confirm(now_ns);
    }

    fn tick(&mut self, now_ns: i64, send: &mut dyn FnMut(Self::Message), tell: &mut dyn FnMut(Event)) {
        self.autopilot.tick(now_ns, |header, message| send((header, message)), tell);
    }

    fn tick_helm(&mut self, now_ns: i64, send: &mut dyn FnMut(Self::Message)) {
        self.confirm(now_ns);
        if let Ok(helm) = &mut self.helm {
            let autopilot = &mut self.autopilot;
            helm.tick(now_ns, |message| send((autopilot.next_header(), message)));
        }
    }

    fn required_mode(&self) -> Option<&str> {
        self.helm.as_ref().ok().map(Helm::required_mode)
    }

    fn impossible(&self) -> Option<&str> {
        self.helm.as_ref().err().map(String::as_str)
    }

    fn refusals(&self, now_ns: i64) -> Vec<String> {
        match (&self.helm, &self.mixer) {
            (Ok(helm), None) => helm.refusals(now_ns),
            (Ok(helm), Some(mixer)) => {
                let mut refusals = helm.refusals(now_ns);
                refusals.extend(mixer.refusals(&|name| helm.parameter(name)));
                refusals.extend(mixer.unseen(now_ns));
                refusals
            }
            (Err(error), _) => vec![error.clone()],
        }
    }

    fn is_commanding(&self) -> bool {
        self.helm.as_ref().is_ok_and(|helm| helm.state() == State::Commanding)
    }

    fn begin(&mut self, now_ns: i64) -> Result<(), Vec<String>> {
        if self.is_commanding() {
            return Ok(());
        }
        if self.mixer.is_some() {
            let refusals = self.refusals(now_ns);
            if !refusals.is_empty() {
                return Err(refusals);
            }
        }
        self.helm.as_mut().map_err(|error| vec![error.clone()])?.begin(now_ns)?;
        if let Some(mixer) = &mut self.mixer {
            mixer.begin(now_ns);
        }
        Ok(())
    }

    fn command(&mut self, values: &[f64], now_ns: i64) {
        let Ok(helm) = &mut self.helm else { return };
        let Some(mixer) = &mut self.mixer else { return helm.command(values, now_ns) };
        mixer.want(values, &|name| helm.parameter(name), now_ns);
        // Without the pulses of the sticks, they are neutral.
        let sticks = mixer.pulses(values, &|name| helm.parameter(name));
        helm.command(sticks.as_ref().map_or(&[], |pulses| &pulses[..]), now_ns);
    }

    fn release(&mut self, now_ns: i64, reason: &str) {
        if let Ok(helm) = &mut self.helm {
            helm.release(now_ns, reason);
        }
    }

    fn take_event(&mut self) -> Option<HelmEvent> {
        self.helm.as_mut().ok().and_then(Helm::take_event)
    }
}
