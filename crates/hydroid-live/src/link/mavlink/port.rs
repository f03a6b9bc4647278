//! A link that is open: a thread reads, the caller writes.

use std::cell::Cell;
use std::convert::Infallible;
use std::io::{self, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use ::mavlink::dialects::ardupilotmega::{MavAutopilot, MavMessage};
use ::mavlink::error::{MessageReadError, ParserError};
use ::mavlink::{Dialect, MavHeader, MavlinkReader, MavlinkVersion, Message as _, write_v2_msg};

use super::transport::{Address, Peer, Sink, Source, open};
use crate::link::{self, UtcClock};

/// Messages that wait to be taken; more are left out, and counted.
const WAITING: usize = 4096;

/// A message with its sender and the time of its reception in nanoseconds since 1970.
type Received = ((MavHeader, MavMessage), i64);

/// Numbers of what a link could not use.
#[derive(Debug, Default)]
struct Counts {
    /// Stretches of frames in a row of which no message can be made: damaged, or of another dialect.
    damaged: AtomicU64,
    /// Messages that were left out because they were not taken in time.
    dropped: AtomicU64,
}

/// An open link.
pub struct Port {
    messages: Receiver<Received>,
    sink: Sink,
    peer: Option<Peer>,
    counts: Arc<Counts>,
    closed: Arc<AtomicBool>,
    frame: Vec<u8>,
}

impl Port {
    /// Opens an address, and begins to read. The other side is the first that sends the heartbeat of an autopilot, with this
    /// system id if one is given.
    pub fn open(address: &Address, system: Option<u8>, clock: UtcClock) -> io::Result<Self> {
        let (source, sink) = open(address)?;
        let peer = if let Source::Udp { peer, .. } = &source { Some(peer.clone()) } else { None };
        let (sender, messages) = sync_channel(WAITING);
        let (counts, closed) = (Arc::new(Counts::default()), Arc::new(AtomicBool::new(false)));
        let (told, ended) = (Arc::clone(&counts), Arc::clone(&closed));
        std::thread::Builder::new()
            .name("link".to_owned())
            .spawn(move || read(source, system, clock, &sender, &told, &ended))?;
        Ok(Self { messages, sink, peer, counts, closed, frame: Vec::new() })
    }
}

impl link::Port for Port {
    type Message = (MavHeader, MavMessage);

    fn next(&mut self, within: Duration) -> io::Result<Option<Received>> {
        match self.messages.recv_timeout(within) {
            Ok(received) => Ok(Some(received)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                Err(io::Error::new(io::ErrorKind::ConnectionAborted, "the other side has closed the link"))
            }
        }
    }

    fn send(&mut self, (header, message): &Self::Message) -> io::Result<()> {
        // A frame is one datagram.
        self.frame.clear();
        write_v2_msg(&mut self.frame, *header, message).map_err(io::Error::other)?;
        self.sink.write_all(&self.frame)?;
        self.sink.flush()
    }

    fn forget_peer(&self) {
        if let Some(peer) = &self.peer {
            peer.forget();
        }
    }

    fn losses(&self) -> [u64; 2] {
        [&self.counts.damaged, &self.counts.dropped].map(|count| count.load(Ordering::Relaxed))
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        self.closed.store(true, Ordering::Relaxed);
    }
}

/// The messages of ArduPilot. The reader asks for the checksum of each frame, and does not say which ones are wrong.
#[derive(Default)]
struct Checked {
    /// Frames since the last message whose checksum was compared.
    frames: Cell<u64>,
}

impl Dialect for Checked {
    type Message = MavMessage;
    type EncodeError = Infallible;

    fn message_id(&self, message: &MavMessage) -> u32 {
        message.message_id()
    }

    fn extra_crc(&self, message_id: u32) -> Option<u8> {
        self.frames.set(self.frames.get().saturating_add(1));
        Some(MavMessage::extra_crc(message_id))
    }

    fn decode(&self, version: MavlinkVersion, id: u32, payload: &[u8]) -> Result<MavMessage, ParserError> {
        MavMessage::parse(version, id, payload)
    }

    fn encode(
        &self,
        version: MavlinkVersion,
        message: &MavMessage,
        payload: &mut [u8],
    ) -> Result<usize, Infallible> {
        Ok(message.ser(version, payload))
    }
}

/// Reads until the link ends or nobody takes the messages any more.
fn read(
    source: Source,
    system: Option<u8>,
    clock: UtcClock,
    sender: &SyncSender<Received>,
    counts: &Counts,
    closed: &AtomicBool,
) {
    let mut reader = MavlinkReader::new(source);
    let dialect = Checked::default();
    while !closed.load(Ordering::Relaxed) {
        let read = reader.read_any_message_with_dialect(&dialect);
        let is_sound = matches!(read, Ok(_) | Err(MessageReadError::Parse(_)));
        if dialect.frames.take() > u64::from(is_sound) {
            counts.damaged.fetch_add(1, Ordering::Relaxed);
        }
        match read {
            Ok((header, message)) => {
                let received_ns = clock.now_ns();
                if let MavMessage::HEARTBEAT(beat) = &message
                    && beat.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID
                    && system.is_none_or(|system| u32::from(system) == header.system_id)
                {
                    reader.get_ref().accept();
                }
                match sender.try_send(((header, message), received_ns)) {
                    Ok(()) => {}
                    Err(TrySendError::Full(_)) => drop(counts.dropped.fetch_add(1, Ordering::Relaxed)),
                    Err(TrySendError::Disconnected(_)) => return,
                }
            }
            Err(MessageReadError::Parse(_)) => drop(counts.damaged.fetch_add(1, Ordering::Relaxed)),
            Err(MessageReadError::Io(error)) => match error.kind() {
                io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted => {}
                // Nobody listens at the address of a boat that is still off.
                io::ErrorKind::ConnectionRefused => std::thread::sleep(super::transport::TIMEOUT),
                _ => return,
            },
        }
    }
}
