//! One direction of a link: frames as bytes, with faults, and the parser of the transport behind them.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::io::{self, Read};

use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::error::MessageReadError;
use mavlink::{MavHeader, MavlinkReader, write_v2_msg};
use rand::{Rng, RngExt as _};

use super::MS;

/// Faults of a link: probabilities for a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {
    pub(super) loss: f64,
    pub(super) duplication: f64,
    pub(super) corruption: f64,
    /// The frame is up to [`LATE_NS`] late.
    pub(super) reordering: f64,
}

/// Longest delay of a frame that others overtake.
pub(super) const LATE_NS: i64 = 300 * MS;

/// Largest delay of other frames.
pub(super) const DELAY_NS: i64 = 60 * MS;

/// Bytes that have arrived.
#[derive(Default)]
struct Arrived(VecDeque<u8>);

impl Read for Arrived {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.0.is_empty() { Err(io::ErrorKind::WouldBlock.into()) } else { self.0.read(into) }
    }
}

/// One direction.
pub(super) struct Direction {
    pub(super) faults: Faults,
    /// Nothing passes before this time.
    pub(super) silent_until_ns: i64,
    waiting: BinaryHeap<Reverse<(i64, u64, Vec<u8>)>>,
    count: u64,
    reader: MavlinkReader<Arrived>,
    /// Frames that were damaged on the way. The parser passes over most of them without an error.
    pub(super) damaged: u64,
}

impl Direction {
    pub(super) fn new() -> Self {
        Self {
            faults: Faults::default(),
            silent_until_ns: 0,
            waiting: BinaryHeap::new(),
            count: 0,
            reader: MavlinkReader::new(Arrived::default()),
            damaged: 0,
        }
    }

    /// Sends a frame.
    pub(super) fn send(&mut self, header: MavHeader, message: &MavMessage, now_ns: i64, rng: &mut impl Rng) {
        let Faults { loss, duplication, corruption, reordering } = self.faults;
        if now_ns < self.silent_until_ns || rng.random_bool(loss) {
            return;
        }
        for _ in 0..=u8::from(rng.random_bool(duplication)) {
            let mut frame = Vec::new();
            write_v2_msg(&mut frame, header, message).unwrap();
            if rng.random_bool(corruption) {
                damage(&mut frame, rng);
                self.damaged += 1;
            }
            let mut due_ns = now_ns + rng.random_range(5 * MS..DELAY_NS);
            if rng.random_bool(reordering) {
                due_ns += rng.random_range(0..LATE_NS);
            }
            self.count += 1;
            self.waiting.push(Reverse((due_ns, self.count, frame)));
        }
    }

    /// The next message that has arrived.
    pub(super) fn next(&mut self, now_ns: i64) -> Option<(MavHeader, MavMessage)> {
        loop {
            match self.reader.read_any_message::<MavMessage>() {
                Ok(message) => return Some(message),
                Err(MessageReadError::Parse(_)) => {}
                Err(MessageReadError::Io(_)) => {
                    let Reverse((due_ns, ..)) = self.waiting.peek()?;
                    if *due_ns > now_ns {
                        return None;
                    }
                    let Reverse((.., frame)) = self.waiting.pop()?;
                    self.reader.get_mut().0.extend(frame);
                }
            }
        }
    }
}

/// Flips bytes, cuts the frame, or puts bytes before it.
fn damage(frame: &mut Vec<u8>, rng: &mut impl Rng) {
    match rng.random_range(0..4) {
        0 => frame.truncate(rng.random_range(0..frame.len())),
        1 => {
            let before: Vec<u8> = (0..rng.random_range(1..40)).map(|_| rng.random()).collect();
            frame.splice(0..0, before);
        }
        _ => {
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..frame.len());
                frame[at] ^= rng.random_range(1..=255_u8);
            }
        }
    }
}
