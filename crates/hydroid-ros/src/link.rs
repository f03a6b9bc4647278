//! A graph of ROS 2 as a [`Link`].

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, OnceLock};

use hydroid_live::link::{Axis, ClockState, Event, HelmEvent, Link, Row, State, Topic};

use crate::commander::{self, Commander};
use crate::settings::Subscribed;
use crate::value::Value;

/// Without a message for this time \[ns\], the link is lost.
const LOST_NS: i64 = 5_000_000_000;

/// Stamps that differ by more from the clock of this computer are of another clock \[ns\].
const OTHER_CLOCK_NS: i64 = 10_000_000_000;

/// What comes from the graph and goes to it.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// A message of a topic.
    Sample {
        /// Index of the topic.
        topic: usize,
        value: Value,
        /// Time at which it was published, in nanoseconds since 1970.
        published_ns: Option<i64>,
    },
    /// Numbers of other publishers and of subscribers of each topic.
    Graph {
        publishers: Vec<usize>,
        /// Subscribers with the same type.
        subscribers: Vec<usize>,
        /// Time by which the clock of the system was set since the start \[s\].
        clock_set_s: Option<f64>,
        /// Whether the network has not accepted a command since the last message of this kind.
        is_blocked: bool,
    },
    /// A command for a topic.
    Command {
        /// Index of the topic.
        topic: usize,
        value: Value,
    },
}

/// The graph with its helm.
pub struct RosLink {
    subscribed: Vec<Subscribed>,
    topics: Vec<Topic>,
    options: commander::Options,
    used: Vec<usize>,
    /// Topics of commands, from the preparation on.
    commanded: Arc<OnceLock<Vec<usize>>>,
    helm: Result<Commander, String>,
    enable: Option<usize>,
    /// Reception of the last message of a topic in use.
    heard_ns: Option<i64>,
    is_lost: bool,
    state: Option<State>,
    /// Topics for which a message has said that their stamps are of another clock.
    other_clocks: Vec<bool>,
    /// Commands that were sent, as events.
    sent: VecDeque<Event>,
    domain: u16,
}

impl RosLink {
    /// Before the first message.
    pub fn new(subscribed: Vec<Subscribed>, options: commander::Options, domain: u16) -> Self {
        let enable = options.enable.as_ref();
        let enable = enable.and_then(|name| subscribed.iter().position(|topic| topic.name == name));
        Self {
            topics: subscribed.iter().map(Subscribed::topic).collect(),
            other_clocks: vec![false; subscribed.len()],
            subscribed,
            options,
            used: Vec::new(),
            commanded: Arc::default(),
            helm: Err("the link is not prepared".to_owned()),
            enable,
            heard_ns: None,
            is_lost: false,
            state: None,
            sent: VecDeque::new(),
            domain,
        }
    }

    /// Topics of commands, which are known when the link is prepared; none if commands are not to be sent.
    pub fn commanded(&self) -> Arc<OnceLock<Vec<usize>>> {
        Arc::clone(&self.commanded)
    }

    fn sample(
        &mut self,
        topic: usize,
        value: &Value,
        published_ns: Option<i64>,
        received_ns: i64,
        now_ns: i64,
        tell: &mut dyn FnMut(Event),
    ) {
        let Some(of) = self.subscribed.get(topic) else { return };
        if self.used.contains(&topic) {
            if self.heard_ns.is_none() {
                tell(Event::Found(format!("ROS 2, domain {}, {}", self.domain, of.name)));
            }
            self.heard_ns = Some(received_ns);
            if std::mem::take(&mut self.is_lost) {
                tell(Event::Back);
            }
        }
        let stamp = of.fields.stamp_ns(value).or(published_ns).unwrap_or(received_ns);
        let is_other = (received_ns - stamp).abs() > OTHER_CLOCK_NS;
        if is_other && !self.other_clocks[topic] {
            self.other_clocks[topic] = true;
            let text = format!(
                "the stamps of {} are {:.0} s from the clock of this computer: the times of reception are used",
                of.name,
                (stamp - received_ns) as f64 / 1e9
            );
            tell(Event::Text { warning: true, text });
        }
        // Nothing is measured in the future; a stamp that says so would stay fresh for too long.
        let sent_ns = if is_other { received_ns } else { stamp.min(received_ns) };
        let values = of.row(value);
        let is_true = values.first() == Some(&1.0);
        tell(Event::Row(Row { topic, sent_ns, received_ns, values }));
        tell(Event::Message { topic, sent_ns, received_ns, bytes: value.to_cdr() });
        if let Ok(helm) = &mut self.helm {
            helm.set_alive(self.heard_ns.is_some() && !self.is_lost, now_ns);
            if self.enable == Some(topic) {
                helm.permit(is_true, now_ns);
            } else if helm.axes().iter().any(|axis| axis.place[0] == topic) {
                helm.hear_other(of.name, now_ns);
            }
        }
    }
}

impl Link for RosLink {
    type Message = Message;

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn limits(&self, [topic, field]: [usize; 2]) -> Result<Option<[f64; 2]>, String> {
        let of = &self.subscribed[topic];
        if of.fields.can_set(field) {
            return Ok(None);
        }
        Err(format!(
            "{}.{} cannot be commanded: it is not a number of the message",
            of.name,
            of.fields.names()[field]
        ))
    }

    fn prepare(&mut self, topics: &[usize], axes: Result<Vec<Axis>, String>) {
        self.used = topics.to_vec();
        self.helm = axes.and_then(|axes| Commander::new(axes, self.options.clone()));
        if let Ok(helm) = &self.helm
            && self.options.may_command
            && !self.options.is_dry_run
        {
            let _ = self.commanded.set(helm.topics());
        }
    }

    fn clock(&self) -> ClockState {
        ClockState::default()
    }

    fn receive(&mut self, message: &Message, received_ns: i64, now_ns: i64, tell: &mut dyn FnMut(Event)) {
        match message {
            Message::Sample { topic, value, published_ns } => {
                self.sample(*topic, value, *published_ns, received_ns, now_ns, tell);
            }
            Message::Graph { publishers, subscribers, clock_set_s, is_blocked } => {
                let Ok(helm) = &mut self.helm else { return };
                let name = |topic: usize| self.subscribed[topic].name.to_owned();
                let commanded = helm.topics();
                let with = |is: &dyn Fn(usize) -> bool| {
                    commanded.iter().filter(|topic| is(**topic)).map(|topic| name(*topic)).collect()
                };
                let unheard = with(&|topic| subscribers.get(topic) == Some(&0));
                let shared = with(&|topic| publishers.get(topic).is_some_and(|count| *count > 0));
                let set = clock_set_s.map(|by| {
                    format!("the clock of this computer was set by {by:.1} s: start hydroid-ros again")
                });
                let blocked = is_blocked.then(|| {
                    "the network does not accept commands: a subscriber does not answer, end it".to_owned()
                });
                helm.see(unheard, shared, set.or(blocked), now_ns);
            }
            Message::Command { .. } => {}
        }
    }

    fn tick(&mut self, now_ns: i64, _: &mut dyn FnMut(Message), tell: &mut dyn FnMut(Event)) {
        while let Some(event) = self.sent.pop_front() {
            tell(event);
        }
        if let Some(heard_ns) = self.heard_ns
            && !self.is_lost
            && now_ns.saturating_sub(heard_ns) > LOST_NS
        {
            self.is_lost = true;
            tell(Event::Lost(now_ns.saturating_sub(heard_ns) as f64 / 1e9));
        }
        if let Ok(helm) = &mut self.helm {
            helm.set_alive(self.heard_ns.is_some() && !self.is_lost, now_ns);
        }
        // The inputs are those that the actuators hear, whoever sends them.
        let enabled = self.helm.as_ref().ok().and_then(|helm| helm.is_enabled(now_ns));
        let mode = match enabled {
            Some(true) => "commands permitted",
            Some(false) => "commands not permitted",
            None => "no permission needed",
        };
        let state = State { mode: mode.to_owned(), armed: true };
        if self.heard_ns.is_some() && self.state.as_ref() != Some(&state) {
            self.state = Some(state.clone());
            tell(Event::State(state));
        }
    }

    fn tick_helm(&mut self, now_ns: i64, send: &mut dyn FnMut(Message)) {
        let Ok(helm) = &mut self.helm else { return };
        let Some(values) = helm.due(now_ns).map(<[f64]>::to_vec) else { return };
        let mut messages: BTreeMap<usize, Value> = BTreeMap::new();
        for (axis, value) in helm.axes().iter().zip(values) {
            let [topic, field] = axis.place;
            let of = &self.subscribed[topic];
            let message = messages.entry(topic).or_insert_with(|| Value::zero(&of.of.shape));
            of.fields.set(message, field, value);
        }
        for (topic, mut value) in messages {
            let fields = self.subscribed[topic].fields;
            fields.stamp(&mut value, now_ns);
            let row = Row { topic, sent_ns: now_ns, received_ns: now_ns, values: fields.row(&value) };
            self.sent.push_back(Event::Row(row));
            let bytes = value.to_cdr();
            self.sent.push_back(Event::Message { topic, sent_ns: now_ns, received_ns: now_ns, bytes });
            send(Message::Command { topic, value });
        }
    }

    fn required_mode(&self) -> Option<&str> {
        None
    }

    fn impossible(&self) -> Option<&str> {
        self.helm.as_ref().err().map(String::as_str)
    }

    fn refusals(&self, now_ns: i64) -> Vec<String> {
        match &self.helm {
            Ok(helm) => helm.refusals(now_ns),
            Err(error) => vec![error.clone()],
        }
    }

    fn is_commanding(&self) -> bool {
        self.helm.as_ref().is_ok_and(Commander::is_commanding)
    }

    fn begin(&mut self, now_ns: i64) -> Result<(), Vec<String>> {
        match &mut self.helm {
            Ok(helm) => helm.begin(now_ns),
            Err(error) => Err(vec![error.clone()]),
        }
    }

    fn command(&mut self, values: &[f64], now_ns: i64) {
        if let Ok(helm) = &mut self.helm {
            helm.command(values, now_ns);
        }
    }

    fn release(&mut self, now_ns: i64, reason: &str) {
        if let Ok(helm) = &mut self.helm {
            helm.release(now_ns, reason);
        }
    }

    fn take_event(&mut self) -> Option<HelmEvent> {
        self.helm.as_mut().ok().and_then(Commander::take_event)
    }
}
