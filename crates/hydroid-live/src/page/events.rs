//! Events of the readers: history, newest state, new messages.
//!
//! Nothing is queued for a reader: when its connection has room, it receives what is new since its last event.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Bytes, HttpBody};
use hyper::body::Frame;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until, timeout};

use super::MAX_SAID;
use super::history::History;
use super::readers::Place;

/// Shortest time between two events of a reader.
const INTERVAL: Duration = Duration::from_millis(100);

/// A comment is sent after this time without an event.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// New readers within this time receive the same history, so that many of them take little time.
const HISTORY_AGE: Duration = Duration::from_millis(500);

/// Time after which a browser connects again \[ms\].
const RETRY_MS: u32 = 1000;

/// The newest state.
#[derive(Clone, Debug, Default)]
struct State {
    json: Bytes,
    /// States ever.
    count: u64,
}

/// What the service has published.
#[derive(Debug, Default)]
pub(super) struct Hub {
    state: watch::Sender<State>,
    history: Mutex<History>,
    /// History as it was sent last.
    sent: Mutex<Option<Sent>>,
}

/// A history in the format of events.
#[derive(Clone, Debug)]
struct Sent {
    time: Instant,
    event: Bytes,
    /// Messages ever, up to this history.
    said: u64,
}

impl Hub {
    pub(super) fn state(&self, json: String) {
        let json = one_line(json);
        self.state.send_modify(|state| *state = State { json, count: state.count + 1 });
    }

    pub(super) fn said(&self, json: String) {
        let message = one_line(json);
        self.change(|history| history.said(message));
        // Wakes the readers.
        self.state.send_modify(|_| ());
    }

    pub(super) fn change(&self, change: impl FnOnce(&mut History)) {
        change(&mut lock(&self.history));
    }

    /// Whether the messages after a history will still be kept when its reader asks for them.
    fn follows(&self, sent: &Sent) -> bool {
        lock(&self.history).count() < sent.said + MAX_SAID as u64 / 2
    }

    /// The history as a new reader receives it.
    fn sent(&self) -> Sent {
        let mut sent = lock(&self.sent);
        match &*sent {
            Some(sent) if sent.time.elapsed() < HISTORY_AGE && self.follows(sent) => sent.clone(),
            _ => {
                // The service waits for the copy at most, not for the conversion to text.
                let mut history = lock(&self.history).clone();
                let mut event = format!("retry: {RETRY_MS}\n").into_bytes();
                append(&mut event, "history", &history.json());
                let new = Sent { time: Instant::now(), event: event.into(), said: history.count() };
                sent.insert(new).clone()
            }
        }
    }
}

/// Nothing that a panic leaves behind is invalid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// JSON in one line: line ends separate the fields of events, and are blanks in JSON.
fn one_line(json: String) -> Bytes {
    if json.contains(['\n', '\r']) { json.replace(['\n', '\r'], " ").into() } else { json.into() }
}

fn append(chunk: &mut Vec<u8>, event: &str, json: &[u8]) {
    for part in [b"event: ", event.as_bytes(), b"\ndata: ", json, b"\n\n"] {
        chunk.extend_from_slice(part);
    }
}

/// A reader of events.
struct Reader {
    hub: Arc<Hub>,
    state: watch::Receiver<State>,
    /// States and messages ever, up to the last event.
    states: u64,
    said: u64,
    has_history: bool,
    /// Earliest time of the next event.
    due: Instant,
}

impl Reader {
    /// Waits for something new.
    async fn next(mut self) -> (Self, Bytes) {
        if !self.has_history {
            let history = self.hub.sent();
            (self.has_history, self.said) = (true, history.said);
            return (self, history.event);
        }
        let mut chunk = Vec::new();
        sleep_until(self.due).await;
        while chunk.is_empty() {
            match timeout(KEEP_ALIVE, self.state.changed()).await {
                Ok(Ok(())) => self.append_news(&mut chunk),
                // The hub lives as long as its readers.
                Ok(Err(_)) => std::future::pending().await,
                Err(_) => chunk.extend_from_slice(b":\n\n"),
            }
        }
        self.due = Instant::now() + INTERVAL;
        (self, chunk.into())
    }

    fn append_news(&mut self, chunk: &mut Vec<u8>) {
        // Seen before the messages are read: a message that comes in between wakes the reader again.
        let state = self.state.borrow_and_update().clone();
        let history = lock(&self.hub.history);
        for message in history.said_since(self.said) {
            append(chunk, "said", message);
        }
        self.said = history.count();
        drop(history);
        if state.count != self.states {
            append(chunk, "state", &state.json);
            self.states = state.count;
        }
    }
}

/// The events of a reader as the body of an answer without end.
pub(super) struct Events {
    next: Pin<Box<dyn Future<Output = (Reader, Bytes)> + Send>>,
    /// Its place among the readers, until another one takes it.
    place: Place,
}

impl Events {
    pub(super) fn new(hub: Arc<Hub>, place: Place) -> Self {
        let mut state = hub.state.subscribe();
        // What was published before the connection is new for this reader.
        state.mark_changed();
        let reader = Reader { hub, state, states: 0, said: 0, has_history: false, due: Instant::now() };
        Self { next: Box::pin(reader.next()), place }
    }
}

impl HttpBody for Events {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        if Pin::new(&mut self.place).poll(context).is_ready() {
            return Poll::Ready(None);
        }
        let (reader, chunk) = ready!(self.next.as_mut().poll(context));
        self.next = Box::pin(reader.next());
        Poll::Ready(Some(Ok(Frame::data(chunk))))
    }
}
