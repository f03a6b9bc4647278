//! The page of a live service: an HTTP server on its own thread.
//!
//! The service publishes its state, messages and points of the plots with [`Page`], which never waits for a reader, and
//! receives the actions of the operator as [`Request`]s. Everybody who reaches the address can read; an action needs the
//! token.
//!
//! | part | content |
//! | --- | --- |
//! | `connections` | limits of connections, time-outs, transport |
//! | `answers` | routes, headers, actions |
//! | `checks` | DNS rebinding, requests of other sites, token |
//! | `events` | newest state and new messages of each reader |
//! | `history` | what a new reader receives first |
//! | `readers` | who gets one of the places |
//!
//! Requests are untrusted. A connection carries one request, so nothing of a request remains for the next one.

mod answers;
mod checks;
mod connections;
mod events;
mod history;
mod readers;

use std::fmt::Write as _;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};
use std::thread::{self, JoinHandle};

use serde_json::Value;
use tokio::runtime;
use tokio::sync::oneshot;

use answers::Server;
use events::Hub;

/// Shortest token \[characters\]: 64 bits as hexadecimal digits.
pub const MIN_TOKEN: usize = 16;

/// Messages in the history.
pub const MAX_SAID: usize = 200;

/// Points of the track in the history.
pub const MAX_TRACK: usize = 3000;

/// Rows of the series in the history.
pub const MAX_SERIES: usize = 1200;

/// Requests that wait for the service.
const MAX_REQUESTS: usize = 16;

const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";

/// The files of the page.
pub const ASSETS: &[Asset] = &[
    Asset::new("/", HTML, include_str!("assets/index.html")),
    Asset::new("/page.css", STYLE, include_str!("assets/page.css")),
    Asset::new("/page.js", SCRIPT, include_str!("assets/page.js")),
    Asset::new("/plots.js", SCRIPT, hydroid_web::PLOTS),
    Asset::new("/uplot.css", STYLE, hydroid_web::UPLOT_STYLE),
    Asset::new("/uplot.js", SCRIPT, hydroid_web::UPLOT),
    Asset::new("/licence.txt", TEXT, hydroid_web::UPLOT_LICENCE),
];

/// Options of the server. They hold a secret, and are not printed.
#[derive(Clone, PartialEq, Eq)]
pub struct Options {
    /// Address on which it listens; port 0 selects a free one.
    pub address: SocketAddr,
    /// Token of the actions, of at least [`MIN_TOKEN`] characters; [`random_token`] makes one.
    pub token: String,
    /// Host names under which the page may be opened, without port. IP addresses and `localhost` need no entry.
    pub names: Vec<String>,
}

/// A file of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asset {
    /// Path of the request, as in `/page.js`.
    pub path: &'static str,
    pub content_type: &'static str,
    pub content: &'static [u8],
}

impl Asset {
    const fn new(path: &'static str, content_type: &'static str, content: &'static str) -> Self {
        Self { path, content_type, content: content.as_bytes() }
    }
}

/// An action for the service.
#[derive(Debug)]
pub struct Request {
    /// JSON object with a text `action`.
    pub action: Value,
    /// Where the answer goes.
    pub reply: Reply,
}

/// Receives the answer to an action: what was done, or why it is refused, with the remedy.
///
/// If it is dropped, the operator reads that the service gave no answer.
#[derive(Debug)]
pub struct Reply(oneshot::Sender<Result<String, String>>);

impl Reply {
    /// Whether the answer can still be delivered. After 5 s, the operator was told that the service does not answer: except
    /// for `stop`, the action should not be done any more.
    pub fn is_awaited(&self) -> bool {
        !self.0.is_closed()
    }

    pub fn send(self, answer: Result<String, String>) {
        // An answer that nobody awaits is lost.
        let _ = self.0.send(answer);
    }
}

/// A random token: 128 bits of the operating system as hexadecimal digits.
///
/// # Errors
/// If the operating system has no random numbers.
pub fn random_token() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| io::Error::other(format!("no random numbers: {error}")))?;
    let mut token = String::new();
    for byte in bytes {
        let _ = write!(token, "{byte:02x}");
    }
    Ok(token)
}

/// The server. It ends when this is dropped, together with all connections.
pub struct Page {
    address: SocketAddr,
    hub: Arc<Hub>,
    /// Dropped to end the thread.
    running: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Page {
    /// Listens on the address, and answers requests from then on with the files, the published data and, for actions, the
    /// answers of the service that reads the receiver.
    ///
    /// # Errors
    /// If the address cannot be used, the token is too short, or the system has no thread.
    pub fn start(options: Options, assets: &'static [Asset]) -> io::Result<(Self, Receiver<Request>)> {
        let Options { address, token, names } = options;
        if token.len() < MIN_TOKEN || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
            let reason = format!(
                "a token of the page has at least {MIN_TOKEN} letters, digits or signs and no blanks: anyone could guess a shorter one"
            );
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        let runtime = runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
        let listener = {
            let _context = runtime.enter();
            connections::listen(address)?
        };
        let address = listener.local_addr()?;
        let (requests, receiver) = mpsc::sync_channel(MAX_REQUESTS);
        let hub = Arc::new(Hub::default());
        let server = Server::new(hub.clone(), token, names, assets, requests);
        let (running, stopped) = oneshot::channel();
        let thread = thread::Builder::new().name("page".to_owned()).spawn(move || {
            runtime.spawn(connections::serve(listener, Arc::new(server)));
            let _ = runtime.block_on(stopped);
            // The runtime ends here, and with it all connections.
        })?;
        Ok((Self { address, hub, running: Some(running), thread: Some(thread) }, receiver))
    }

    /// Address on which it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Publishes the newest state, a JSON object. A reader receives at most about ten states per second, and always the
    /// newest one.
    pub fn state(&self, json: String) {
        self.hub.state(json);
    }

    /// Publishes a message, a JSON object. Each reader receives each message once, unless it is behind by more than
    /// [`MAX_SAID`] messages.
    pub fn said(&self, json: String) {
        self.hub.said(json);
    }

    /// Appends a point `[t, north, east, psi]` to the track of the history, which keeps [`MAX_TRACK`]; NaN is unknown.
    pub fn track(&self, point: [f64; 4]) {
        self.hub.change(|history| history.track(point));
    }

    /// Sets the names of the series. Rows of other names are removed from the history.
    pub fn name_series(&self, names: &[String]) {
        self.hub.change(|history| history.name_series(names));
    }

    /// Appends a row to the series of the history, which keeps [`MAX_SERIES`]: values at a time, in the order of the names.
    /// What is missing or NaN is unknown.
    pub fn series(&self, t: f64, measured: &[f64], predicted: &[f64]) {
        self.hub.change(|history| history.series(t, measured, predicted));
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.running.take();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
