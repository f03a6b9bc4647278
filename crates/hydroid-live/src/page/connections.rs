//! Connections: one request each, in bounded number, memory and time.

use std::convert::Infallible;
use std::future::poll_fn;
use std::io::{self, IoSlice};
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::http::StatusCode;
use hyper::rt::{Read, ReadBufCursor, Write};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use tokio::io::AsyncWrite;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::task::{self, AbortHandle};
use tokio::time::{Sleep, sleep, timeout};

use super::answers::{Refusal, Server};

/// Connections at once.
const MAX_CONNECTIONS: usize = 64;

/// Longest head of a request \[bytes\].
const MAX_HEAD: usize = 16 << 10;

/// Headers of a request.
const MAX_HEADERS: usize = 64;

/// Longest time in which the head of a request arrives.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest time for a request and its answer, except for events.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);

/// Longest time in which a reader accepts nothing.
const WRITE_TIMEOUT: Duration = Duration::from_secs(10);

/// Send buffer of the system \[bytes\]. States that wait there become old: it holds few of them.
const SEND_BUFFER: u32 = 32 << 10;

/// Connections that wait until they are accepted.
const BACKLOG: u32 = 128;

/// Pause after an error of the system, for example too many open files.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Longest time, and most bytes, of the rest of a request that is read after its answer: if bytes are left, the system
/// resets the connection, and the answer may be lost.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(1);
const DRAIN_BYTES: usize = 1 << 20;

/// Binds an address. Needs the context of a runtime.
pub(super) fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
    // A server that starts again can use the port at once; on Windows it always can.
    #[cfg(not(windows))]
    socket.set_reuseaddr(true)?;
    // Accepted connections inherit it.
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// What a connection is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Phase {
    /// Nothing has arrived yet.
    Silent,
    /// The head of a request is incomplete, or the answer is complete.
    Idle,
    /// A request is answered.
    Answer,
    /// An action with the token.
    Action,
    /// Events, without end.
    Events,
}

/// Phase of a connection, for the task that accepts connections.
#[derive(Debug)]
pub(super) struct Progress(AtomicU8);

impl Progress {
    pub(super) fn enter(&self, phase: Phase) {
        self.0.store(phase as u8, Ordering::Relaxed);
    }

    fn is(&self, phase: Phase) -> bool {
        self.0.load(Ordering::Relaxed) == phase as u8
    }

    fn has_request(&self) -> bool {
        !self.is(Phase::Silent) && !self.is(Phase::Idle)
    }
}

struct Open {
    task: AbortHandle,
    progress: Arc<Progress>,
}

/// Accepts connections for ever.
pub(super) async fn serve(listener: TcpListener, server: Arc<Server>) {
    // Oldest first.
    let mut open: Vec<Open> = Vec::with_capacity(MAX_CONNECTIONS);
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => continue,
            Err(_) => {
                sleep(ACCEPT_PAUSE).await;
                continue;
            }
        };
        open.retain(|connection| !connection.task.is_finished());
        if open.len() >= MAX_CONNECTIONS {
            // The oldest connection without a request yields, else the oldest one without the token, so that nobody keeps
            // an operator out. If there is none, the new connection is closed.
            let oldest = |phase| open.iter().position(|connection| connection.progress.is(phase));
            let yielding = [Phase::Silent, Phase::Idle, Phase::Answer].into_iter().find_map(oldest);
            let Some(yielding) = yielding else { continue };
            open.remove(yielding).task.abort();
            task::yield_now().await;
        }
        let progress = Arc::new(Progress(AtomicU8::new(Phase::Silent as u8)));
        let task = tokio::spawn(connection(stream, server.clone(), progress.clone())).abort_handle();
        open.push(Open { task, progress });
    }
}

/// End of the exchange of request and answer.
enum End {
    Complete,
    /// The request could not be read.
    Refused(Refusal),
    /// The other side left or does not read.
    Lost,
}

async fn connection(mut stream: TcpStream, server: Arc<Server>, progress: Arc<Progress>) {
    // Without it, small events are late.
    let _ = stream.set_nodelay(true);
    let address = stream.peer_addr().map_or(Ipv6Addr::UNSPECIFIED.into(), |peer| peer.ip());
    let end = exchange(&stream, &server, &progress, address).await;
    progress.enter(Phase::Idle);
    // An answer that the system has still to send outlasts the time-out.
    let _ = match end {
        End::Complete => timeout(DRAIN_TIMEOUT, close(&mut stream)).await,
        End::Refused(refusal) => {
            let refused = async {
                send(&stream, refusal.text().as_bytes()).await?;
                close(&mut stream).await
            };
            timeout(DRAIN_TIMEOUT, refused).await
        }
        // The system drops what was not sent.
        End::Lost => Ok(stream.set_zero_linger()),
    };
}

async fn exchange(stream: &TcpStream, server: &Server, progress: &Arc<Progress>, address: IpAddr) -> End {
    let service = service_fn(|request| {
        progress.enter(Phase::Answer);
        async { Ok::<_, Infallible>(server.answer(request, progress.clone(), address).await) }
    });
    let io = Transport { stream, progress, stalled: None };
    let mut http = http1::Builder::new();
    // The times are limited below and by the transport. An action is done even if the operator leaves after it was sent.
    http.keep_alive(false).half_close(true).header_read_timeout(None);
    http.max_headers(MAX_HEADERS).max_buf_size(MAX_HEAD);
    let mut exchange = pin!(http.serve_connection(io, service));

    let head = until(exchange.as_mut(), || progress.has_request());
    let mut result = match timeout(HEAD_TIMEOUT, head).await {
        Ok(result) => result,
        Err(_) if progress.is(Phase::Silent) => return End::Complete,
        Err(_) => {
            let reason = "the request did not arrive in time; send it again";
            return End::Refused(Refusal::new(StatusCode::REQUEST_TIMEOUT, reason));
        }
    };
    if result.is_none() {
        let answer = until(exchange.as_mut(), || progress.is(Phase::Events));
        let Ok(answer) = timeout(ANSWER_TIMEOUT, answer).await else { return End::Lost };
        result = answer;
    }
    if result.is_none() {
        let mut left = pin!(left(stream));
        let events = poll_fn(|context| match left.as_mut().poll(context) {
            Poll::Ready(()) => Poll::Ready(None),
            Poll::Pending => exchange.as_mut().poll(context).map(Some),
        });
        result = events.await;
    }
    match result {
        Some(Ok(())) => End::Complete,
        Some(Err(error)) if !progress.has_request() && error.is_parse_too_large() => {
            let reason =
                format!("a request has at most {MAX_HEADERS} headers and {MAX_HEAD} bytes before its body");
            End::Refused(Refusal::new(StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE, reason))
        }
        Some(Err(error)) if !progress.has_request() && error.is_parse() => {
            End::Refused(Refusal::new(StatusCode::BAD_REQUEST, "this is not a request of HTTP/1.1"))
        }
        None | Some(Err(_)) => End::Lost,
    }
}

/// The output of a future, or `None` as soon as a condition holds that the future establishes.
async fn until<F: Future>(mut future: Pin<&mut F>, condition: impl Fn() -> bool) -> Option<F::Output> {
    poll_fn(|context| match future.as_mut().poll(context) {
        Poll::Ready(output) => Poll::Ready(Some(output)),
        Poll::Pending if condition() => Poll::Ready(None),
        Poll::Pending => Poll::Pending,
    })
    .await
}

/// Waits until the other side closes the connection. What it sends is not used.
async fn left(stream: &TcpStream) {
    let mut rest = [0; 1024];
    while stream.readable().await.is_ok() {
        match stream.try_read(&mut rest) {
            Ok(0) => return,
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => return,
            _ => {}
        }
    }
}

async fn send(stream: &TcpStream, mut text: &[u8]) -> io::Result<()> {
    while !text.is_empty() {
        stream.writable().await?;
        match stream.try_write(text) {
            Ok(sent) => text = &text[sent..],
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Ends the answer, and reads the rest of the request.
async fn close(stream: &mut TcpStream) -> io::Result<()> {
    poll_fn(|context| Pin::new(&mut *stream).poll_shutdown(context)).await?;
    let (mut rest, mut read) = ([0; 1024], 0);
    while read < DRAIN_BYTES {
        stream.readable().await?;
        match stream.try_read(&mut rest) {
            Ok(0) => return Ok(()),
            Ok(n) => read += n,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::ErrorKind::InvalidData.into())
}

/// The connection as hyper uses it: with a time-out of writes, and without hyper's own answers to requests that it cannot
/// read, which lack the headers of all answers.
struct Transport<'a> {
    stream: &'a TcpStream,
    progress: &'a Progress,
    /// Runs while the other side accepts nothing.
    stalled: Option<Pin<Box<Sleep>>>,
}

impl Transport<'_> {
    fn write(
        &mut self,
        context: &mut Context<'_>,
        write: impl Fn(&TcpStream) -> io::Result<usize>,
    ) -> Poll<io::Result<usize>> {
        loop {
            if self.stream.poll_write_ready(context)?.is_pending() {
                let stalled = self.stalled.get_or_insert_with(|| Box::pin(sleep(WRITE_TIMEOUT)));
                ready!(stalled.as_mut().poll(context));
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
            match write(self.stream) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                result => {
                    self.stalled = None;
                    return Poll::Ready(result);
                }
            }
        }
    }
}

impl Read for Transport<'_> {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        mut buffer: ReadBufCursor<'_>,
    ) -> Poll<io::Result<()>> {
        let mut chunk = [0; 4096];
        let room = chunk.len().min(buffer.remaining());
        loop {
            ready!(self.stream.poll_read_ready(context))?;
            match self.stream.try_read(&mut chunk[..room]) {
                Ok(read) => {
                    if read > 0 && self.progress.is(Phase::Silent) {
                        self.progress.enter(Phase::Idle);
                    }
                    buffer.put_slice(&chunk[..read]);
                    return Poll::Ready(Ok(()));
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Poll::Ready(Err(error)),
            }
        }
    }
}

impl Write for Transport<'_> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        if !self.progress.has_request() {
            return Poll::Ready(Ok(bytes.len()));
        }
        self.write(context, |stream| stream.try_write(bytes))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        if !self.progress.has_request() {
            return Poll::Ready(Ok(parts.iter().map(|part| part.len()).sum()));
        }
        self.write(context, |stream| stream.try_write_vectored(parts))
    }

    fn is_write_vectored(&self) -> bool {
        true
    }

    fn poll_flush(self: Pin<&mut Self>, _context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    /// [`close`] ends the answer.
    fn poll_shutdown(self: Pin<&mut Self>, _context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}
