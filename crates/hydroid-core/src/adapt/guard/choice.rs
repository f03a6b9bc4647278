//! Which model predicts: records, tests, and the account of what the guarantee leaves.

use alloc::vec;
use alloc::vec::Vec;

use super::bound::Allowed;
use super::event::{Cause, Expert};
use super::settings::GuardOptions;
use super::trial::Tested;
use crate::adapt::memory::{Reader, Writer};

/// A model is dropped at once when a test finds it worse than the one from shore by this, beside one and a half
/// noise floors.
const FAILED: f64 = 1.4;

/// Share of the account from which on only the model from shore predicts.
const TIGHT: f64 = 0.5;

/// Mean of the absolute value of a normal number of deviation one.
const MEAN_OF_NOISE: f64 = 0.8;

/// A model is used as long as its record is not worse than that of the one from shore by the guarantee itself, and again when
/// it is not by this, beside half the noise floor ..
const AGAIN: f64 = 1.1;

/// .. or when, of late and over the last stride, it has not had more than this share of the other's errors: where the vessel
/// does what it has never done, all records are bad, and the one that learns gets better first.
const SPRINT: f64 = 0.7;

/// How much is added to [`caution`](GuardOptions::caution) where predictions that stood far off have cost all of the account, and
/// in how many windows that is forgotten.
const ONCE_BURNT: f64 = 2.0;
const FORGIVEN: f64 = 10.0;

/// The error of the model from shore is taken to be at most so many times the largest of the last horizon, or so many times what it
/// goes wrong by in a stride, where the vessel begins what that model has never seen. It may be more by this factor where the last
/// prediction that was refused for that would have been right.
const GROWS: f64 = 6.0;
const STEEP: f64 = 40.0;
const PROVEN: f64 = 3.0;

/// But where what it goes wrong by in a stride has not grown by this factor within a horizon, the vessel begins nothing: then its error
/// is taken to be at most so many times that of the last test, shrunk as that of a stride has. (Coming down from what it does not know, it is
/// right again seconds before a test of the horizon can tell.)
const RISING: f64 = 1.1;
const FALLS: f64 = 2.0;

/// That holds where it has been wrong by so many noise floors within the horizon, and so does what the motion of the vessel tells. Where it has
/// been right, it may be about to be wrong all the same: who said so before, and would have been right in this share of the cases (each counts
/// for so much), is believed.
const WRONG: f64 = 10.0;
const TRUSTED: f64 = 0.75;
const COUNTS: f64 = 0.1;

/// A model that has just said something else of the same time is taken to be wrong by so many times as much as it has changed its
/// mind: long before it can be tested, that tells that it has met something that it does not know.
const REVISED: f64 = 1.35;

/// What a test tells of which not all was measured: the model that is used may be off by anything, the other one by nothing.
const UNKNOWN: [f64; 3] = [f64::INFINITY, f64::INFINITY, 0.0];

/// Share of what the guarantee leaves that is made use of: tests are one in a stride, and measure with noise.
const MARGIN: f64 = 0.75;

/// A learner whose record is worse than another's by this, beside twice the noise floor, is losing: so much a test as it is
/// worse, at most `AT_ONCE`, until it has lost `LOST_AT`. One that has just come into water that it had forgotten
/// learns again within seconds, and is left alone.
const LOSES: f64 = 2.0;
const AT_ONCE: f64 = 8.0;
const LOST_AT: f64 = 40.0;

/// Chooses.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) active: Expert,
    /// Errors of late; NaN before the first test.
    pub(super) record: [f64; 3],
    share: f64,
    floor: f64,
    factor: f64,
    caution: f64,
    /// What each test added to the account, those of the window, and where the next goes.
    account: Vec<f64>,
    at: usize,
    /// What each prediction that is under way may cost, and where the next goes.
    under_way: Vec<f64>,
    next: usize,
    /// How far predictions from now on may be from those of the model from shore.
    pub(super) allowed: Allowed,
    /// Errors of all models in the tests of the last horizon; [`UNKNOWN`] where not all was measured.
    lately: Vec<[f64; 3]>,
    /// How far each has changed what it says, in the same tests.
    revised: Vec<[f64; 3]>,
    /// Whether the last prediction that was refused, far off as it was, would have been right, and the share of those of late that would.
    proven: bool,
    trust: f64,
    /// Errors of the model from shore over a stride, in the same tests; and how fast it has been going wrong, of late: the largest of them
    /// beyond the noise, forgotten over a horizon.
    strides: Vec<f64>,
    steep: f64,
    /// What predictions that stood far off have cost beyond what was allowed, of late, as a share of the account.
    burnt: f64,
    /// What the learner has lost, of late.
    lost: f64,
}

impl Choice {
    /// `floor` is the noise of a measurement, as errors are measured.
    pub(super) fn new(settings: &GuardOptions, floor: f64) -> Self {
        let account = vec![0.0; settings.window.div_ceil(settings.stride)];
        let mut choice = Self {
            active: Expert::Learner,
            record: [f64::NAN; 3],
            share: (settings.stride as f64 / settings.record as f64).min(1.0),
            floor,
            factor: settings.factor,
            caution: settings.caution,
            account,
            at: 0,
            under_way: vec![0.0; settings.horizon / settings.stride],
            next: 0,
            allowed: Allowed::NONE,
            lately: vec![UNKNOWN; settings.horizon / settings.stride],
            revised: vec![[0.0; 3]; settings.horizon / settings.stride],
            proven: false,
            trust: 0.5,
            strides: vec![0.0; settings.horizon / settings.stride],
            steep: 0.0,
            burnt: 0.0,
            lost: 0.0,
        };
        choice.reset();
        choice
    }

    /// The start of a run: nothing is owed from the one before.
    pub(super) fn reset(&mut self) {
        self.account.fill(0.0);
        self.lately.fill(UNKNOWN);
        self.revised.fill([0.0; 3]);
        self.strides.fill(0.0);
        let most = if self.active == Expert::Frozen { 0.0 } else { self.fair() };
        self.allowed = Allowed { most, ..Allowed::NONE };
        self.under_way.fill(most);
    }

    /// What each of the predictions that are under way may cost where nothing has been used.
    fn fair(&self) -> f64 {
        self.allowance() / self.under_way.len() as f64
    }

    /// What predictions may have been worse than `factor` times those of the model from shore, summed over the tests of a window.
    fn allowance(&self) -> f64 {
        MARGIN * self.floor * self.account.len() as f64
    }

    /// The most that has been used of it by any window that is not over: with the model from shore in use from now on, no
    /// window can end with more.
    fn used(&self) -> f64 {
        let count = self.account.len();
        let (mut sum, mut most) = (0.0, 0.0f64);
        for back in 1..=count {
            sum += self.account[(self.at + count - back) % count];
            most = most.max(sum);
        }
        most
    }

    /// Takes a test into account; says why another model is in use from now on, if one is.
    pub(super) fn take(&mut self, tested: &Tested) -> Option<Cause> {
        let frozen = Expert::Frozen.index();
        for (record, &far) in self.record.iter_mut().zip(&tested.far) {
            // What blew up is forgotten, in time; what nobody measured is none.
            let far = far.min(1e3);
            if !tested.far[frozen].is_nan() {
                *record = if record.is_nan() { far } else { *record + self.share * (far - *record) };
            }
        }
        // The noise of what was measured is in both errors, and with the factor in what is taken off.
        let noise = (self.factor - 1.0) * MEAN_OF_NOISE * self.floor;
        self.account[self.at] = tested.excess + noise;
        self.at = (self.at + 1) % self.account.len();
        self.under_way[self.next] = 0.0;
        let used = self.used();
        self.burnt *= 1.0 - 1.0 / (FORGIVEN * self.account.len() as f64);
        self.burnt += tested.beyond / self.allowance();
        let room = self.allowance() - used - self.under_way.iter().sum::<f64>();
        let most = room.clamp(0.0, self.fair());
        let tight = used > TIGHT * self.allowance();

        let fails = |error: f64, than: f64| error > FAILED * than + 1.5 * self.floor;
        let (now, shore) = (tested.now, tested.far[frozen]);
        let failed = [
            fails(now, shore) || fails(tested.near[0], tested.near[frozen]),
            fails(tested.far[Expert::Kept.index()], shore),
            false,
        ];
        let sprints = now < SPRINT * shore && tested.near[0] < SPRINT * tested.near[frozen];
        let may = |expert: Expert| {
            !failed[expert.index()] && (self.keeps_up(expert) || (sprints && expert == Expert::Learner))
        };
        let next = if tight {
            Expert::Frozen
        } else if shore.is_nan() {
            self.active
        } else {
            Expert::ALL.into_iter().find(|&expert| may(expert)).unwrap_or(Expert::Frozen)
        };
        let cause = if tested.far[self.active.index()].is_infinite() {
            Cause::NotFinite
        } else if tight {
            Cause::Guarantee
        } else if failed[self.active.index()] {
            Cause::Test
        } else {
            Cause::Record
        };
        let changed = next != self.active;
        self.active = next;
        self.lately.rotate_left(1);
        if let Some(last) = self.lately.last_mut() {
            *last = if tested.whole { tested.far } else { UNKNOWN };
            if tested.whole && tested.near[frozen].is_finite() {
                let decays = 1.0 - 1.0 / self.under_way.len() as f64;
                self.steep = f64::max(decays * self.steep, tested.near[frozen] - self.floor);
            }
        }
        self.revised.rotate_left(1);
        if let Some(last) = self.revised.last_mut() {
            *last = tested.revised;
        }
        if let Some(right) = tested.right {
            self.proven = right;
            self.trust += COUNTS * (f64::from(u8::from(right)) - self.trust);
        }
        // (Where nothing was measured it is taken to be what it was.)
        let end = self.strides.len() - 1;
        let near = if tested.near[frozen].is_finite() { tested.near[frozen] } else { self.strides[end] };
        self.strides.rotate_left(1);
        self.strides[end] = near;
        self.allowed = if next == Expert::Frozen {
            Allowed::NONE
        } else {
            Allowed {
                most,
                free: (self.feared(next) * (1.0 + self.factor) - most) / self.factor,
                far: most + self.off(shore),
                owes: used > 0.0,
                heeds: self.may_be_right_again(),
            }
        };
        self.under_way[self.next] = self.allowed.most;
        self.next = (self.next + 1) % self.under_way.len();
        changed.then_some(cause)
    }

    /// The largest error that a prediction of a model is taken to have.
    fn feared(&self, expert: Expert) -> f64 {
        let caution = self.caution + ONCE_BURNT * self.burnt;
        f64::max(caution * worst(&self.lately, expert), REVISED * worst(&self.revised, expert))
    }

    /// The largest error that the model from shore is taken to have, of which the last test found `far`.
    fn off(&self, far: f64) -> f64 {
        let lately = worst(&self.lately, Expert::Frozen);
        let begins = f64::max(GROWS * lately, STEEP * self.steep) * if self.proven { PROVEN } else { 1.0 };
        let (before, now) = (self.strides[0], self.strides[self.strides.len() - 1]);
        let grown = if before > 0.0 { now / before } else { 1.0 };
        let begins_nothing = grown < RISING && self.may_be_right_again();
        // (What was not measured says nothing.)
        if begins_nothing && far.is_finite() { begins.min(FALLS * grown * far) } else { begins }
    }

    /// Whether the model from shore, if it has been wrong, may be right again at any time; and if it has been right, remain so.
    fn may_be_right_again(&self) -> bool {
        worst(&self.lately, Expert::Frozen) >= WRONG * self.floor || self.trust <= TRUSTED
    }

    /// Whether the record of a model is good enough beside that of the one from shore.
    fn keeps_up(&self, expert: Expert) -> bool {
        let (own, shore) = (self.record[expert.index()], self.record[Expert::Frozen.index()]);
        if expert == self.active {
            own <= self.factor * shore + self.floor
        } else {
            own <= AGAIN * shore + 0.5 * self.floor
        }
    }

    /// Whether the learner is lost, and whose weights it should have: to be asked once after each test.
    pub(super) fn rescue(&mut self) -> Option<Expert> {
        let [learner, kept, frozen] = self.record;
        let to = if kept <= frozen { Expert::Kept } else { Expert::Frozen };
        let worse = learner / (LOSES * kept.min(frozen) + 2.0 * self.floor);
        self.lost = if worse > 1.0 { self.lost + worse.min(AT_ONCE) } else { 0.0 };
        if self.lost < LOST_AT {
            return None;
        }
        self.lost = 0.0;
        self.record[Expert::Learner.index()] = self.record[to.index()];
        Some(to)
    }

    /// A model has other weights from now on: what was found of the ones before says nothing of it.
    pub(super) fn forget(&mut self, expert: Expert) {
        for errors in &mut self.lately {
            errors[expert.index()] = f64::INFINITY;
        }
        if self.active == expert {
            self.allowed.free = f64::INFINITY;
        }
    }

    /// Whether what the learner knows is worth a snapshot: it has been as good as the last one, and in use.
    pub(super) fn deserves(&self) -> bool {
        let [learner, kept, _] = self.record;
        self.active == Expert::Learner && learner <= kept
    }

    pub(super) fn memory_len(&self) -> usize {
        self.record.len()
            + self.account.len()
            + self.under_way.len()
            + self.lately.as_flattened().len()
            + self.revised.as_flattened().len()
            + self.strides.len()
            + Allowed::LEN
            + 8
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&self.record);
        into.numbers(&self.account);
        into.numbers(&self.under_way);
        into.numbers(self.lately.as_flattened());
        into.numbers(self.revised.as_flattened());
        into.numbers(&self.strides);
        into.count(self.active.index());
        into.count(self.at);
        into.count(self.next);
        into.numbers(&self.allowed.numbers());
        into.numbers(&[self.steep, self.burnt, self.lost, self.trust]);
        into.flag(self.proven);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        from.numbers(&mut self.record);
        from.numbers(&mut self.account);
        from.numbers(&mut self.under_way);
        from.numbers(self.lately.as_flattened_mut());
        from.numbers(self.revised.as_flattened_mut());
        from.numbers(&mut self.strides);
        self.active = Expert::ALL[from.count(Expert::ALL.len() - 1)];
        self.at = from.count(self.account.len() - 1);
        self.next = from.count(self.under_way.len() - 1);
        let mut allowed = [0.0; Allowed::LEN];
        from.numbers(&mut allowed);
        self.allowed = Allowed::of(allowed);
        let mut numbers = [0.0; 4];
        from.numbers(&mut numbers);
        [self.steep, self.burnt, self.lost, self.trust] = numbers;
        self.proven = from.flag();
    }
}

/// The largest of a model.
fn worst(of: &[[f64; 3]], expert: Expert) -> f64 {
    of.iter().map(|each| each[expert.index()]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
