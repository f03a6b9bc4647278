//! Model selection: which model predicts, by error records, shadow tests, and the account of the guarantee.

use alloc::vec;
use alloc::vec::Vec;

use super::deviation_bound::Budget;
use super::event::{Cause, Expert};
use super::options::GuardOptions;
use super::shadow_test::TestErrors;
use crate::adapt::memory::{Reader, Writer};

/// A model fails a test if its error exceeds the error of the reference model by this factor and by 1.5 noise floors.
const FAILURE_RATIO: f64 = 1.4;

/// Share of the account above which only the reference model predicts.
const ACCOUNT_LIMIT: f64 = 0.5;

/// Mean of the absolute value of a standard normal number.
const MEAN_OF_NOISE: f64 = 0.8;

/// The active model stays active while its record satisfies the guarantee. Another model becomes active if its record
/// exceeds the record of the reference model by at most this factor and half a noise floor.
const RETURN_RATIO: f64 = 1.1;

/// The adapted model also becomes active if its present errors over horizon and stride are below this share of the
/// errors of the reference model: in a new mode of motion all records are bad, and the adapted model improves first.
const LEAD_RATIO: f64 = 0.7;

/// Increase of [`caution`](GuardOptions::caution) for an overdraft of the whole account, and the decay time of an
/// overdraft \[windows\].
const OVERDRAFT_CAUTION: f64 = 2.0;
const OVERDRAFT_WINDOWS: f64 = 10.0;

/// Bound on the error of the reference model: this factor times its largest recent error, or times the growth of its
/// error within a stride at the start of a new mode; `CONFIRMED` times as much if the last rejection was wrong.
const ERROR_GROWTH: f64 = 6.0;
const SLOPE_GROWTH: f64 = 40.0;
const CONFIRMED: f64 = 3.0;

/// If the error over a stride has grown by less than `RISING` within a horizon, no new mode begins: the bound is at
/// most `DECAY` times the error of the last test, scaled by the change of the error over a stride. (After a return to
/// known motion, this error falls before the error over the horizon.)
const RISING: f64 = 1.1;
const DECAY: f64 = 2.0;

/// This smaller bound and the motion check hold if the reference model was wrong by `WRONG` noise floors within the
/// horizon, or if at most `TRUSTED` of the rejected predictions were right (exponential mean with gain `TRUST_GAIN`).
const WRONG: f64 = 10.0;
const TRUSTED: f64 = 0.75;
const TRUST_GAIN: f64 = 0.1;

/// The error of a model is bounded by this factor times its last revision of a prediction: a large revision reveals an
/// unknown mode before a test.
const REVISION_RATIO: f64 = 1.35;

/// Errors of an incomplete test: any error for the adapted models, none for the reference model.
const UNKNOWN: [f64; 3] = [f64::INFINITY, f64::INFINITY, 0.0];

/// Share of the account in use: tests are one stride apart and contain measurement noise.
const MARGIN: f64 = 0.75;

/// A learner loses a test if its record exceeds the best other record by `LOSS_RATIO` and two noise floors. Its loss
/// grows by the ratio, at most `MAX_LOSS`; at `ROLLBACK_LOSS` the weights roll back. The delay permits adaptation.
const LOSS_RATIO: f64 = 2.0;
const MAX_LOSS: f64 = 8.0;
const ROLLBACK_LOSS: f64 = 40.0;

#[derive(Clone, Debug)]
pub(super) struct ModelSelector {
    pub(super) active: Expert,
    /// Exponential means of the test errors of each model; NaN before the first test.
    pub(super) record: [f64; 3],
    record_gain: f64,
    floor: f64,
    factor: f64,
    caution: f64,
    /// Cost of each test of the window (ring), and the index of the next.
    account: Vec<f64>,
    account_index: usize,
    /// Largest cost of each pending prediction (ring), and the index of the next.
    pending: Vec<f64>,
    pending_index: usize,
    /// Permitted deviations of the next predictions.
    pub(super) budget: Budget,
    /// Test errors of all models within the last horizon; [`UNKNOWN`] for incomplete tests.
    recent: Vec<[f64; 3]>,
    /// Revisions in the same tests.
    revisions: Vec<[f64; 3]>,
    /// Whether the last rejected prediction was right, and the recent share of such predictions.
    confirmed: bool,
    trust: f64,
    /// Errors of the reference model over a stride in the same tests, and their largest value above the noise, which
    /// decays over a horizon.
    stride_errors: Vec<f64>,
    slope: f64,
    /// Recent cost beyond the budget, as a share of the account.
    overdraft: f64,
    learner_loss: f64,
}

impl ModelSelector {
    /// `floor` is the noise floor, in the units of the errors.
    pub(super) fn new(options: &GuardOptions, floor: f64) -> Self {
        let account = vec![0.0; options.window.div_ceil(options.stride)];
        let mut choice = Self {
            active: Expert::Adapted,
            record: [f64::NAN; 3],
            record_gain: (options.stride as f64 / options.record as f64).min(1.0),
            floor,
            factor: options.factor,
            caution: options.caution,
            account,
            account_index: 0,
            pending: vec![0.0; options.horizon / options.stride],
            pending_index: 0,
            budget: Budget::NONE,
            recent: vec![UNKNOWN; options.horizon / options.stride],
            revisions: vec![[0.0; 3]; options.horizon / options.stride],
            confirmed: false,
            trust: 0.5,
            stride_errors: vec![0.0; options.horizon / options.stride],
            slope: 0.0,
            overdraft: 0.0,
            learner_loss: 0.0,
        };
        choice.reset();
        choice
    }

    pub(super) fn reset(&mut self) {
        self.account.fill(0.0);
        self.recent.fill(UNKNOWN);
        self.revisions.fill([0.0; 3]);
        self.stride_errors.fill(0.0);
        let most = if self.active == Expert::Reference { 0.0 } else { self.fair_share() };
        self.budget = Budget { limit: most, ..Budget::NONE };
        self.pending.fill(most);
    }

    /// Cost of each pending prediction if the account is empty.
    fn fair_share(&self) -> f64 {
        self.allowance() / self.pending.len() as f64
    }

    /// The account: permitted excess over `factor` times the error of the reference model in the tests of a window.
    fn allowance(&self) -> f64 {
        MARGIN * self.floor * self.account.len() as f64
    }

    /// The largest cost of any open window; with the reference model from now on, no window ends with more.
    fn used(&self) -> f64 {
        let count = self.account.len();
        let (mut sum, mut most) = (0.0, 0.0f64);
        for back in 1..=count {
            sum += self.account[(self.account_index + count - back) % count];
            most = most.max(sum);
        }
        most
    }

    /// Updates records, account and budget by a test. Returns the cause if the active model changes.
    pub(super) fn update(&mut self, tested: &TestErrors) -> Option<Cause> {
        let baseline = Expert::Reference.index();
        for (record, &far) in self.record.iter_mut().zip(&tested.horizon) {
            // A diverged rollout counts with a finite error, a test without measurements is skipped.
            let far = far.min(1e3);
            if !tested.horizon[baseline].is_nan() {
                *record = if record.is_nan() { far } else { *record + self.record_gain * (far - *record) };
            }
        }
        // Both errors contain measurement noise, and the factor multiplies the subtracted one.
        let noise = (self.factor - 1.0) * MEAN_OF_NOISE * self.floor;
        self.account[self.account_index] = tested.excess + noise;
        self.account_index = (self.account_index + 1) % self.account.len();
        self.pending[self.pending_index] = 0.0;
        let used = self.used();
        self.overdraft *= 1.0 - 1.0 / (OVERDRAFT_WINDOWS * self.account.len() as f64);
        self.overdraft += tested.overdraft / self.allowance();
        let room = self.allowance() - used - self.pending.iter().sum::<f64>();
        let most = room.clamp(0.0, self.fair_share());
        let exhausted = used > ACCOUNT_LIMIT * self.allowance();

        let fails = |error: f64, than: f64| error > FAILURE_RATIO * than + 1.5 * self.floor;
        let (now, reference) = (tested.current_weights, tested.horizon[baseline]);
        let failed = [
            fails(now, reference) || fails(tested.stride[0], tested.stride[baseline]),
            fails(tested.horizon[Expert::Snapshot.index()], reference),
            false,
        ];
        let leads = now < LEAD_RATIO * reference && tested.stride[0] < LEAD_RATIO * tested.stride[baseline];
        let may = |expert: Expert| {
            !failed[expert.index()] && (self.is_competitive(expert) || (leads && expert == Expert::Adapted))
        };
        let next = if exhausted {
            Expert::Reference
        } else if reference.is_nan() {
            self.active
        } else {
            Expert::ALL.into_iter().find(|&expert| may(expert)).unwrap_or(Expert::Reference)
        };
        let cause = if tested.horizon[self.active.index()].is_infinite() {
            Cause::NotFinite
        } else if exhausted {
            Cause::Guarantee
        } else if failed[self.active.index()] {
            Cause::Test
        } else {
            Cause::Record
        };
        let changed = next != self.active;
        self.active = next;
        self.recent.rotate_left(1);
        if let Some(last) = self.recent.last_mut() {
            *last = if tested.complete { tested.horizon } else { UNKNOWN };
            if tested.complete && tested.stride[baseline].is_finite() {
                let decays = 1.0 - 1.0 / self.pending.len() as f64;
                self.slope = f64::max(decays * self.slope, tested.stride[baseline] - self.floor);
            }
        }
        self.revisions.rotate_left(1);
        if let Some(last) = self.revisions.last_mut() {
            *last = tested.revisions;
        }
        if let Some(right) = tested.rejection_right {
            self.confirmed = right;
            self.trust += TRUST_GAIN * (f64::from(u8::from(right)) - self.trust);
        }
        let end = self.stride_errors.len() - 1;
        let near = if tested.stride[baseline].is_finite() {
            tested.stride[baseline]
        } else {
            self.stride_errors[end]
        };
        self.stride_errors.rotate_left(1);
        self.stride_errors[end] = near;
        self.budget = if next == Expert::Reference {
            Budget::NONE
        } else {
            Budget {
                limit: most,
                supported_from: (self.error_bound(next) * (1.0 + self.factor) - most) / self.factor,
                supported_to: most + self.reference_error_bound(reference),
                in_deficit: used > 0.0,
                motion_check: self.reference_may_recover(),
            }
        };
        self.pending[self.pending_index] = self.budget.limit;
        self.pending_index = (self.pending_index + 1) % self.pending.len();
        changed.then_some(cause)
    }

    fn error_bound(&self, expert: Expert) -> f64 {
        let caution = self.caution + OVERDRAFT_CAUTION * self.overdraft;
        f64::max(caution * worst(&self.recent, expert), REVISION_RATIO * worst(&self.revisions, expert))
    }

    /// Bound on the error of the reference model after the error `last` in the last test.
    fn reference_error_bound(&self, last: f64) -> f64 {
        let recent = worst(&self.recent, Expert::Reference);
        let begins = f64::max(ERROR_GROWTH * recent, SLOPE_GROWTH * self.slope)
            * if self.confirmed { CONFIRMED } else { 1.0 };
        let (before, now) = (self.stride_errors[0], self.stride_errors[self.stride_errors.len() - 1]);
        let grown = if before > 0.0 { now / before } else { 1.0 };
        let is_steady = grown < RISING && self.reference_may_recover();
        if is_steady && last.is_finite() { begins.min(DECAY * grown * last) } else { begins }
    }

    /// Whether the reference model can recover at any time, or has stayed right.
    fn reference_may_recover(&self) -> bool {
        worst(&self.recent, Expert::Reference) >= WRONG * self.floor || self.trust <= TRUSTED
    }

    fn is_competitive(&self, expert: Expert) -> bool {
        let (own, reference) = (self.record[expert.index()], self.record[Expert::Reference.index()]);
        if expert == self.active {
            own <= self.factor * reference + self.floor
        } else {
            own <= RETURN_RATIO * reference + 0.5 * self.floor
        }
    }

    /// The model whose weights the learner takes after too many losses. Call it once after each test.
    pub(super) fn rollback_target(&mut self) -> Option<Expert> {
        let [learner, snapshot, reference] = self.record;
        let to = if snapshot <= reference { Expert::Snapshot } else { Expert::Reference };
        let worse = learner / (LOSS_RATIO * snapshot.min(reference) + 2.0 * self.floor);
        self.learner_loss = if worse > 1.0 { self.learner_loss + worse.min(MAX_LOSS) } else { 0.0 };
        if self.learner_loss < ROLLBACK_LOSS {
            return None;
        }
        self.learner_loss = 0.0;
        self.record[Expert::Adapted.index()] = self.record[to.index()];
        Some(to)
    }

    pub(super) fn invalidate(&mut self, expert: Expert) {
        for errors in &mut self.recent {
            errors[expert.index()] = f64::INFINITY;
        }
        if self.active == expert {
            self.budget.supported_from = f64::INFINITY;
        }
    }

    /// Whether a snapshot should be taken: the learner is active and at least as good as the last snapshot.
    pub(super) fn should_snapshot(&self) -> bool {
        let [learner, snapshot, _] = self.record;
        self.active == Expert::Adapted && learner <= snapshot
    }

    pub(super) fn memory_len(&self) -> usize {
        self.record.len()
            + self.account.len()
            + self.pending.len()
            + self.recent.as_flattened().len()
            + self.revisions.as_flattened().len()
            + self.stride_errors.len()
            + Budget::LEN
            + 8
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&self.record);
        into.numbers(&self.account);
        into.numbers(&self.pending);
        into.numbers(self.recent.as_flattened());
        into.numbers(self.revisions.as_flattened());
        into.numbers(&self.stride_errors);
        into.count(self.active.index());
        into.count(self.account_index);
        into.count(self.pending_index);
        into.numbers(&self.budget.numbers());
        into.numbers(&[self.slope, self.overdraft, self.learner_loss, self.trust]);
        into.flag(self.confirmed);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        from.numbers(&mut self.record);
        from.numbers(&mut self.account);
        from.numbers(&mut self.pending);
        from.numbers(self.recent.as_flattened_mut());
        from.numbers(self.revisions.as_flattened_mut());
        from.numbers(&mut self.stride_errors);
        self.active = Expert::ALL[from.count(Expert::ALL.len() - 1)];
        self.account_index = from.count(self.account.len() - 1);
        self.pending_index = from.count(self.pending.len() - 1);
        let mut budget = [0.0; Budget::LEN];
        from.numbers(&mut budget);
        self.budget = Budget::of(budget);
        let mut numbers = [0.0; 4];
        from.numbers(&mut numbers);
        [self.slope, self.overdraft, self.learner_loss, self.trust] = numbers;
        self.confirmed = from.flag();
    }
}

fn worst(of: &[[f64; 3]], expert: Expert) -> f64 {
    of.iter().map(|each| each[expert.index()]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
