//! Offset between the clock of the autopilot and that of this computer.
//!
//! An exchange of `TIMESYNC` measures the offset as half of the round trip permits: of the last exchanges, that with the
//! shortest round trip holds (clock filter of NTP; D. L. Mills, RFC 5905, section 10). Before the first one, and for an
//! autopilot that does not answer, the message with the shortest delay gives the offset, too late by this delay.

use super::topics::Stamp;

/// Exchanges that are compared.
const EXCHANGES: usize = 8;

/// Time \[ns\] over which the shortest delay of a message is taken; clocks drift by less than 1 ms in it.
const MEMORY_NS: i64 = 10_000_000_000;

/// A clock that goes back by more than this \[us\] has started again. Messages may overtake each other by less.
const RESTART_US: u64 = 2_000_000;

/// An exchange.
#[derive(Clone, Copy, Debug)]
struct Exchange {
    round_trip_ns: i64,
    offset_ns: i64,
}

/// The clock of an autopilot.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    exchanges: [Option<Exchange>; EXCHANGES],
    next: usize,
    /// Smallest difference between reception and stamp, in the present and in the last period.
    least_ns: [Option<i64>; 2],
    period_from_ns: i64,
    /// Newest stamp \[us\].
    newest_us: u64,
    /// The first offset that was measured \[ns\].
    first_ns: Option<i64>,
}

impl Clock {
    /// Takes the answer to a `TIMESYNC` that was sent at `sent_ns`; `boot_ns` is the time of the autopilot in it.
    pub fn exchange(&mut self, sent_ns: i64, boot_ns: i64, received_ns: i64) {
        let round_trip_ns = received_ns.saturating_sub(sent_ns);
        if round_trip_ns < 0 || boot_ns < 0 {
            return;
        }
        let offset_ns = sent_ns.saturating_add(round_trip_ns / 2).saturating_sub(boot_ns);
        self.exchanges[self.next] = Some(Exchange { round_trip_ns, offset_ns });
        self.next = (self.next + 1) % EXCHANGES;
        self.first_ns = self.first_ns.or(Some(offset_ns));
    }

    /// Change of the offset since it was first measured \[s\]: the drift of the clock of the autopilot.
    pub fn drift_s(&self) -> Option<f64> {
        Some(self.offset_ns()?.saturating_sub(self.first_ns?) as f64 / 1e9)
    }

    /// Time of a message in nanoseconds since 1970 on the clock of this computer, at most that of its reception. The second
    /// result says whether the autopilot has started again.
    pub fn utc_ns(&mut self, stamp: Stamp, received_ns: i64) -> (i64, bool) {
        let (sent_ns, restarted) = self.stamped_ns(stamp, received_ns);
        (sent_ns.min(received_ns), restarted)
    }

    fn stamped_ns(&mut self, stamp: Stamp, received_ns: i64) -> (i64, bool) {
        let us = match stamp {
            Stamp::Boot(us) => us,
            Stamp::ShortBoot(us) => unwrapped(us, self.newest_us),
            Stamp::Fix(us) => {
                let boot_ns = i64::try_from(us).unwrap_or(i64::MAX).saturating_mul(1000);
                let offset_ns = self.offset_ns();
                return (offset_ns.map_or(received_ns, |offset_ns| boot_ns.saturating_add(offset_ns)), false);
            }
            Stamp::Utc(us) => {
                let ns = i64::try_from(us).ok().and_then(|us| us.checked_mul(1000));
                return (ns.unwrap_or(received_ns), false);
            }
            Stamp::None => return (received_ns, false),
        };
        let restarted = us.saturating_add(RESTART_US) < self.newest_us;
        if restarted {
            *self = Self::default();
        }
        self.newest_us = self.newest_us.max(us);
        let boot_ns = i64::try_from(us).unwrap_or(i64::MAX).saturating_mul(1000);
        let difference = received_ns.saturating_sub(boot_ns);
        if received_ns.saturating_sub(self.period_from_ns) > MEMORY_NS {
            self.least_ns = [None, self.least_ns[0]];
            self.period_from_ns = received_ns;
        }
        self.least_ns[0] = Some(self.least_ns[0].map_or(difference, |least| least.min(difference)));
        let offset = self.offset_ns().unwrap_or(difference);
        (boot_ns.saturating_add(offset), restarted)
    }

    /// Time of this computer minus that of the autopilot \[ns\].
    pub fn offset_ns(&self) -> Option<i64> {
        let best = self.exchanges.iter().flatten().min_by_key(|exchange| exchange.round_trip_ns);
        best.map(|exchange| exchange.offset_ns).or_else(|| self.least_ns.into_iter().flatten().min())
    }

    /// Shortest round trip of the last exchanges \[ns\]: the offset is known to half of it.
    pub fn round_trip_ns(&self) -> Option<i64> {
        self.exchanges.iter().flatten().map(|exchange| exchange.round_trip_ns).min()
    }
}

/// The time whose last 32 bits are given and which is closest to a known one.
fn unwrapped(us: u32, near: u64) -> u64 {
    const TURN: u64 = 1 << 32;
    let base = near - near % TURN + u64::from(us);
    let candidates = [base.checked_sub(TURN), Some(base), base.checked_add(TURN)];
    candidates.into_iter().flatten().min_by_key(|time| time.abs_diff(near)).unwrap_or(base)
}
