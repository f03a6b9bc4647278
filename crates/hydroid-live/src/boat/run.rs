//! A session with its link and its page: the loop of `hydroid live`.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use hydroid::model::Model;

use super::{Action, Boat, Level, Said};
use crate::link::{Link, Port, UtcClock};
use crate::page::{Page, Request};

/// Longest wait for a message: ticks come at least as often.
const WAIT: Duration = Duration::from_millis(10);

/// Time between states of the page \[ns\].
const STATE_NS: i64 = 100_000_000;

/// Time between attempts to open a link that has ended \[ns\].
const REOPEN_NS: i64 = 1_000_000_000;

/// Time after the end in which commands are released.
const ENDING: Duration = Duration::from_millis(600);

/// Longest time in which messages are taken before ticks and actions have their turn.
const BUSY: Duration = Duration::from_millis(20);

/// A model that was identified beside the session.
pub struct Identified {
    /// Name of its file.
    pub name: String,
    pub model: Model,
    /// What its evaluation says.
    pub text: String,
}

/// Identifies a model from recordings, and writes it to a folder.
pub type Identify = Arc<dyn Fn(&[PathBuf], &Path) -> Result<Identified, String> + Send + Sync>;

/// The service cannot run.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    #[error("the link {address} cannot be opened: {source}")]
    Link { address: String, source: io::Error },
}

/// Opens a link, and opens it again after its end.
pub type Open<P> = Box<dyn FnMut() -> io::Result<P>>;

/// A session that runs.
pub struct Service<L, P> {
    boat: Boat<L>,
    open: Open<P>,
    port: Option<P>,
    clock: UtcClock,
    page: Option<(Page, Receiver<Request>)>,
    told: u64,
    state_ns: i64,
    opened_ns: i64,
    outputs: Vec<String>,
}

impl<L: Link, P: Port<Message = L::Message>> Service<L, P> {
    /// Opens the link.
    pub fn open(
        boat: Boat<L>,
        mut open: Open<P>,
        clock: UtcClock,
        page: Option<(Page, Receiver<Request>)>,
    ) -> Result<Self, ServiceError> {
        let port =
            open().map_err(|source| ServiceError::Link { address: boat.settings.address.clone(), source })?;
        Ok(Self {
            boat,
            open,
            port: Some(port),
            clock,
            page,
            told: 0,
            state_ns: 0,
            opened_ns: 0,
            outputs: Vec::new(),
        })
    }

    /// Runs until `stop` is set; `tell` hears what is said, and `each` has each turn of the loop with its time.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        mut tell: impl FnMut(&Said),
        each: &mut dyn FnMut(&Boat<L>, i64),
    ) {
        while !stop.load(Ordering::Relaxed) {
            self.receive();
            self.answer();
            self.step(&mut tell);
            each(&self.boat, self.clock.now_ns());
        }
        self.boat.release(self.clock.now_ns());
        let end = Instant::now() + ENDING;
        while Instant::now() < end {
            self.receive();
            self.step(&mut tell);
        }
        self.boat.close(self.clock.now_ns());
        self.step(&mut tell);
    }

    fn step(&mut self, tell: &mut impl FnMut(&Said)) {
        let now_ns = self.clock.now_ns();
        let Self { boat, port, .. } = self;
        boat.tick(now_ns, |message| {
            if let Some(port) = port {
                // A link that is broken for a moment loses messages; its loss is told by the missing heartbeat.
                let _ = port.send(&message);
            }
        });
        if let Some(port) = port
            && boat.is_lost()
        {
            // The autopilot may come back with another address.
            port.forget_peer();
        }
        for said in boat.said_after(self.told) {
            tell(said);
            if let Some((page, _)) = &self.page {
                page.said(said.json().to_string());
            }
            self.told = said.id;
        }
        self.publish(now_ns);
    }

    /// Takes the messages that have arrived.
    fn receive(&mut self) {
        let Some(port) = &mut self.port else {
            std::thread::sleep(WAIT);
            return self.reopen();
        };
        let mut wait = WAIT;
        let end = Instant::now() + BUSY;
        loop {
            if Instant::now() > end {
                return;
            }
            match port.next(wait) {
                Ok(Some((message, received_ns))) => {
                    if self.boat.receive(&message, received_ns)
                        && let (Some((page, _)), Some((measured, predicted))) =
                            (&self.page, self.boat.compared())
                    {
                        let names = self.boat.outputs();
                        if names != self.outputs {
                            page.name_series(&names);
                            self.outputs = names;
                        }
                        page.series(received_ns as f64 / 1e9, &measured, &predicted);
                    }
                    // The rest of what has arrived, and then the commands.
                    wait = Duration::ZERO;
                }
                Ok(None) => return,
                Err(error) => {
                    let now_ns = self.clock.now_ns();
                    self.boat.say(
                        now_ns,
                        Level::Warning,
                        format!("the link has ended: {error}; it is opened again"),
                    );
                    self.port = None;
                    self.opened_ns = now_ns;
                    return;
                }
            }
        }
    }

    fn reopen(&mut self) {
        let now_ns = self.clock.now_ns();
        if now_ns.saturating_sub(self.opened_ns) < REOPEN_NS {
            return;
        }
        self.opened_ns = now_ns;
        if let Ok(port) = (self.open)() {
            self.port = Some(port);
            self.boat.say(now_ns, Level::Info, "the link is open again");
        }
    }

    /// Answers the actions of the page.
    fn answer(&mut self) {
        let Some((_, requests)) = &self.page else { return };
        while let Ok(Request { action, reply }) = requests.try_recv() {
            let action: Result<Action, _> = serde_json::from_value(action);
            let answer = match action {
                Err(error) => Err(format!("the action is not understood: {error}")),
                // An action that nobody waits for any more may be a surprise; to stop is none.
                Ok(action) if !reply.is_awaited() && action != Action::Stop {} => continue,
                Ok(action) => self.boat.act(action, self.clock.now_ns()),
            };
            reply.send(answer);
        }
    }

    fn publish(&mut self, now_ns: i64) {
        let Some((page, _)) = &self.page else { return };
        if now_ns.saturating_sub(self.state_ns) < STATE_NS {
            return;
        }
        self.state_ns = now_ns;
        let losses = self.port.as_ref().map_or([0; 2], Port::losses);
        page.state(self.boat.view(now_ns, losses).to_string());
        if let Some(point) = self.boat.pose(now_ns) {
            page.track(point);
        }
    }
}
