//! The node in the graph of ROS 2: subscriptions, publishers, log.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context as _, anyhow};
use hydroid_live::boat::{Level, Said};
use hydroid_live::link::{Port, UtcClock};
use mio::{Events, Interest, Poll, Token};
use ros2_client::builtin_interfaces::Time;
use ros2_client::dds::{Context, Node, NodeLoggingHandle, Publisher, RosoutRaw as _, Subscription};
use ros2_client::log::LogLevel;
use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{MessageTypeName, Name, NodeName, NodeOptions};
use rustdds::{DomainParticipant, DomainParticipantBuilder, RTPSEntity as _, Topic};

use crate::link::Message;
use crate::names::Names;
use crate::settings::Subscribed;
use crate::value::{Seed, Value};

/// Time between looks at the graph.
const LOOK: Duration = Duration::from_millis(500);

/// Damaged messages and own commands that are passed over in a turn.
const WASTE: usize = 16;

/// The clock of the system was set if it differs by more from that of the session \[s\].
const SET_S: f64 = 0.5;

/// Reliable publishers reach every subscriber; a slow one must not delay the commands.
const QOS: QosProfile = QosProfile::publisher_default()
    .reliability_reliable(WhenFull::Fail)
    .history(History::KeepLast { depth: 100 });

/// A command that is late is of no use.
const COMMANDS: QosProfile =
    QOS.history(History::KeepLast { depth: 1 }).lifespan(Some(Duration::from_millis(500)));

/// A node that is in the graph.
pub(crate) struct Graph {
    participant: DomainParticipant,
    node: Node,
    names: Names,
}

/// The domain of the environment: `ROS_DOMAIN_ID`.
pub(crate) fn domain() -> anyhow::Result<u16> {
    match std::env::var("ROS_DOMAIN_ID") {
        Ok(text) if !text.trim().is_empty() => text
            .trim()
            .parse()
            .map_err(|_| anyhow!("ROS_DOMAIN_ID is '{text}': a number from 0 to 232 is needed")),
        _ => Ok(0),
    }
}

/// Whether the environment restricts the graph to this computer.
fn is_local() -> bool {
    let set = |name: &str, to: &[&str]| std::env::var(name).is_ok_and(|value| to.contains(&value.as_str()));
    set("ROS_LOCALHOST_ONLY", &["1"]) || set("ROS_AUTOMATIC_DISCOVERY_RANGE", &["LOCALHOST"])
}

impl Graph {
    /// Joins the graph of a domain.
    ///
    /// # Errors
    /// If names are invalid, or the network cannot be used.
    pub(crate) fn join(names: Names, domain: u16) -> anyhow::Result<Self> {
        let mut builder = DomainParticipantBuilder::new(domain);
        if is_local() {
            builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        }
        let participant =
            builder.build().map_err(|error| anyhow!("the network cannot be used: {error:?}"))?;
        let context = Context::from_domain_participant(participant.clone())
            .map_err(|error| anyhow!("the graph of ROS 2 cannot be joined: {error}"))?;
        let name = NodeName::new(&names.namespace, &names.node)
            .map_err(|error| anyhow!("the node {}/{}: {error}", names.namespace, names.node))?;
        let mut node = context
            .new_node(name, NodeOptions::new())
            .map_err(|error| anyhow!("the node cannot be created: {error:?}"))?;
        let spinner = node.spinner().map_err(|error| anyhow!("the node cannot be created: {error}"))?;
        std::thread::Builder::new().name("node".to_owned()).spawn(move || {
            // It ends with the node.
            let _ = futures::executor::block_on(spinner.spin());
        })?;
        Ok(Self { participant, node, names })
    }

    /// Writes to the log of the graph.
    pub(crate) fn log(&self) -> Log {
        Log { handle: self.node.logging_handle() }
    }

    /// A topic with a type, by its name in the configuration.
    fn topic(&self, name: &str, of: &str) -> anyhow::Result<Topic> {
        let full = self.names.topic(name);
        let parsed = Name::parse(&full).map_err(|error| anyhow!("the topic {full}: {error}"))?;
        let (package, of) =
            of.split_once("/msg/").with_context(|| format!("{of} is not a type of a message"))?;
        self.node
            .create_topic(&parsed, MessageTypeName::new(package, of), &QOS)
            .map_err(|error| anyhow!("the topic {full}: {error}"))
    }

    /// A publisher of a topic.
    pub(crate) fn publisher(&mut self, name: &str, of: &str) -> anyhow::Result<Publisher<Value>> {
        self.publisher_with(name, of, QOS)
    }

    fn publisher_with(&mut self, name: &str, of: &str, qos: QosProfile) -> anyhow::Result<Publisher<Value>> {
        let topic = self.topic(name, of)?;
        self.node
            .create_publisher(&topic, Some(qos))
            .map_err(|error| anyhow!("the topic {} cannot be published: {error}", self.names.topic(name)))
    }

    /// Subscribes to topics, and publishes those of commands.
    pub(crate) fn port(
        mut self,
        topics: &[Subscribed],
        commands: &[usize],
        clock: UtcClock,
    ) -> anyhow::Result<GraphPort> {
        let poll = Poll::new().context("the network cannot be watched")?;
        let (mut subscriptions, mut publishers, mut names) = (Vec::new(), Vec::new(), Vec::new());
        for (i, of) in topics.iter().enumerate() {
            let topic = self.topic(of.name, &of.of.name)?;
            let best_effort = QOS.reliability_best_effort();
            let mut subscription = self
                .node
                .create_subscription::<Value>(&topic, Some(best_effort))
                .map_err(|error| anyhow!("{} cannot be subscribed to: {error}", of.name))?;
            poll.registry()
                .register(&mut subscription, Token(i), Interest::READABLE)
                .context("the network cannot be watched")?;
            subscriptions.push((subscription, *of));
            let is_command = commands.contains(&i);
            let publisher = is_command.then(|| self.publisher_with(of.name, &of.of.name, COMMANDS));
            publishers.push(publisher.transpose()?);
            names.push(self.names.topic(of.name));
        }
        let events = Events::with_capacity(topics.len().max(1));
        Ok(GraphPort {
            participant: self.participant,
            _node: self.node,
            started: (SystemTime::now(), clock.now_ns()),
            is_blocked: false,
            clock,
            poll,
            events,
            subscriptions,
            publishers,
            names,
            next: 0,
            looked: None,
            damaged: 0,
        })
    }
}

/// Writes to the log of the graph, `/rosout`.
pub(crate) struct Log {
    handle: NodeLoggingHandle,
}

impl Log {
    /// Writes what is said.
    pub(crate) fn write(&self, said: &Said) {
        let level = match said.level {
            Level::Info => LogLevel::Info,
            Level::Warning => LogLevel::Warn,
            Level::Error => LogLevel::Error,
        };
        let stamp = Time::from_nanos(said.at_ns);
        self.handle.rosout_raw(stamp, level, self.handle.base_name(), &said.text, "", "", 0);
    }
}

/// The topics of a session.
pub(crate) struct GraphPort {
    participant: DomainParticipant,
    /// It is in the graph as long as it lives.
    _node: Node,
    /// A moment on the clock of the system and on that of the session.
    started: (SystemTime, i64),
    /// Whether a command was not accepted since the last look.
    is_blocked: bool,
    clock: UtcClock,
    poll: Poll,
    events: Events,
    subscriptions: Vec<(Subscription<Value>, Subscribed)>,
    publishers: Vec<Option<Publisher<Value>>>,
    /// Names on the network.
    names: Vec<String>,
    /// Subscription from which the next message is taken.
    next: usize,
    looked: Option<Instant>,
    damaged: u64,
}

impl GraphPort {
    /// A message that has arrived; the topics have their turn.
    fn take(&mut self) -> Option<Message> {
        for _ in 0..self.subscriptions.len() {
            let topic = self.next;
            self.next = (self.next + 1) % self.subscriptions.len();
            let (subscription, of) = &self.subscriptions[topic];
            // A flood of what cannot be used must not hold up the commands.
            for _ in 0..WASTE {
                match subscription.take_seed(Seed(&of.of.shape)) {
                    Ok(None) => break,
                    Err(_) => self.damaged += 1,
                    Ok(Some((value, info))) => {
                        let own = self.publishers[topic].as_ref();
                        if own.is_some_and(|own| own.gid() == info.publisher_gid()) {
                            continue;
                        }
                        let published_ns = info.source_timestamp().map(|time| time.to_nanos());
                        return Some(Message::Sample { topic, value, published_ns });
                    }
                }
            }
        }
        None
    }

    /// Who else publishes and subscribes, and what the clock of the system does.
    fn look(&mut self) -> Message {
        let own = self.participant.guid().prefix;
        let writers = self.participant.discovered_writers();
        let readers = self.participant.discovered_readers();
        let dds = |name: &String| format!("rt{name}");
        let publishers = self.names.iter().map(|name| {
            let others = writers.iter().filter(|writer| writer.writer_proxy.remote_writer_guid.prefix != own);
            others.filter(|writer| writer.publication_topic_data.topic_name == dds(name)).count()
        });
        let subscribers = self.names.iter().zip(&self.subscriptions).map(|(name, (_, of))| {
            let others = readers.iter().filter(|reader| reader.reader_proxy.remote_reader_guid.prefix != own);
            let of_type = of.of.name.replace("/msg/", "::msg::dds_::") + "_";
            let fits = others.filter(|reader| {
                let data = &reader.subscription_topic_data;
                *data.topic_name() == dds(name) && *data.type_name() == of_type
            });
            fits.count()
        });
        let (started, started_ns) = self.started;
        let session_s = (self.clock.now_ns() - started_ns) as f64 / 1e9;
        let system_s = match SystemTime::now().duration_since(started) {
            Ok(elapsed) => elapsed.as_secs_f64(),
            Err(back) => -back.duration().as_secs_f64(),
        };
        let set_s = Some(system_s - session_s).filter(|by| by.abs() > SET_S);
        Message::Graph {
            publishers: publishers.collect(),
            subscribers: subscribers.collect(),
            clock_set_s: set_s,
            // Without commands, nothing tells whether the next one is accepted: they may begin again.
            is_blocked: std::mem::take(&mut self.is_blocked),
        }
    }
}

impl Port for GraphPort {
    type Message = Message;

    fn next(&mut self, within: Duration) -> io::Result<Option<(Message, i64)>> {
        if self.looked.is_none_or(|looked| looked.elapsed() > LOOK) {
            self.looked = Some(Instant::now());
            return Ok(Some((self.look(), self.clock.now_ns())));
        }
        if let Some(message) = self.take() {
            return Ok(Some((message, self.clock.now_ns())));
        }
        match self.poll.poll(&mut self.events, Some(within)) {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
        Ok(self.take().map(|message| (message, self.clock.now_ns())))
    }

    fn send(&mut self, message: &Message) -> io::Result<()> {
        let Message::Command { topic, value } = message else { return Ok(()) };
        let Some(Some(publisher)) = self.publishers.get(*topic) else { return Ok(()) };
        let sent = publisher.publish(value.clone());
        if sent.is_err() {
            // The helm learns it from the next look, which is due at once.
            (self.is_blocked, self.looked) = (true, None);
        }
        sent.map_err(|error| io::Error::other(error.to_string()))
    }

    fn losses(&self) -> [u64; 2] {
        [self.damaged, 0]
    }
}
