//! The cross-entropy planner.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::cost::{Cost, PlanningProblem, Simulator};
use super::gauss_newton::GaussNewton;
use super::options::PlannerOptions;
use crate::actuator::{Limits, clamp_to_limits};
use crate::control::error::{ControlError, positive};
use crate::control::liveness::SHORTEST_LIMIT_S as BLIND_S;
use crate::control::noise::Noise;
use crate::control::status::Status;
use crate::guidance::Reference;
use crate::memory::{MOST_COUNTED, Memory};
use crate::predict::{BATCH, Predictor, Workspace};

/// Model predictive control by the cross-entropy method, on any [`Predictor`].
///
/// # Law
///
/// Each iteration draws `candidates` command sequences with mean `mu` and deviations `s`, clamps them to limits and
/// rate limits, and moves mean and deviations to the `elites` with the least [`Cost`]:
///
/// ```text
/// c_k  = mu_k + s_k n_k,    n_k = a n_{k-1} + sqrt(1 - a^2) white,    a = exp(-dt / correlation)
/// mu  <- m mu + (1 - m) mean(elites),    s <- m s + (1 - m) deviation(elites)
/// ```
///
/// The mean and the best sequence are always among the candidates. The command is the first row of the best sequence,
/// held for `hold` samples. The next search starts from this plan, shifted by one row with its last row repeated, and from the initial
/// deviations. `gauss_newton_steps` damped Gauss-Newton steps refine the best sequence.
///
/// Sources: R. Y. Rubinstein and D. P. Kroese, *The Cross-Entropy Method*, 2004; P.-T. de Boer et al., *A tutorial on
/// the cross-entropy method*, 2005 (smoothing); C. Pinneri et al., *Sample-efficient cross-entropy method for real-time
/// planning*, 2020 (coloured noise, kept elites, shifted plans); Y. Yang et al., *Data efficient reinforcement learning
/// for legged robots*, 2019; H. Bharadhwaj, K. Xie and F. Shkurti, *Model-predictive control via cross-entropy and
/// gradient-based optimization*, 2020 (refinement).
///
/// # Time
///
/// The callback `stop` can end the search after every 64 candidates and after every Gauss-Newton step, with the best
/// sequence so far. A complete plan takes `candidates x horizon x hold x iterations` predicted samples, and each Gauss-Newton
/// step `horizon x inputs + 9` further rollouts. Without a stop, the result depends on the seed alone.
///
/// # Failure modes
///
/// A turn must begin within the horizon. If no candidate has a finite cost, the shifted plan is commanded and the
/// status is [`Status::Blind`].
#[derive(Clone, Debug)]
pub struct Planner {
    options: PlannerOptions,
    cost: Cost,
    limits: Vec<Limits>,
    dt: f64,
    /// Distance from the reference above which the status is [`Status::Lost`] \[m\].
    tolerance: f64,
    outputs: usize,
    correlation: f64,
    noise: Noise,
    gauss_newton: GaussNewton,
    blind: usize,
    /// Samples since the last plan; 0 if one is due.
    age: usize,
    cost_of_plan: f64,
    last: Vec<f64>,
    plan: Vec<f64>,
    mean: Vec<f64>,
    deviation: Vec<f64>,
    candidates: Vec<f64>,
    costs: Vec<f64>,
    order: Vec<usize>,
    y: Vec<f64>,
    now: Vec<f64>,
    work: Workspace,
    samples: Vec<f64>,
}

/// Result of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Cost of the plan; infinite if there is none.
    pub cost: f64,
    /// Number of finished iterations.
    pub iterations: usize,
    /// Number of rollouts.
    pub tried: usize,
    /// Status of the command.
    pub status: Status,
}

impl Planner {
    /// A planner for a model with `outputs` outputs (`u, v, r` first) and samples of `dt` seconds.
    ///
    /// # Errors
    /// If an option, a cost weight or a limit is out of range.
    pub fn new(
        options: PlannerOptions,
        cost: Cost,
        limits: &[Limits],
        outputs: usize,
        dt: f64,
        tolerance: f64,
    ) -> Result<Self, ControlError> {
        options.check()?;
        positive("the sample time", dt)?;
        positive("the tolerance", tolerance)?;
        if outputs < 3 {
            let needed = "u, v and r are needed";
            return Err(ControlError::Setting {
                what: "the number of outputs",
                value: outputs as f64,
                needed,
            });
        }
        if limits.is_empty() {
            let needed = "at least one command is needed";
            return Err(ControlError::Setting { what: "the number of limits", value: 0.0, needed });
        }
        cost.check(limits.len(), outputs)?;
        if let Some(channel) = limits.iter().position(|limits| !limits.are_ordered()) {
            return Err(ControlError::Limits { channel });
        }
        let len = options.horizon * limits.len();
        let step = dt * options.hold as f64;
        let correlation =
            if options.correlation_s > 0.0 { Float::exp(-step / options.correlation_s) } else { 0.0 };
        let gauss_newton =
            GaussNewton::new(&cost, options.horizon, limits.len(), options.gauss_newton_steps > 0);
        let mut planner = Self {
            options,
            cost,
            gauss_newton,
            limits: limits.to_vec(),
            dt,
            tolerance,
            outputs,
            correlation,
            noise: Noise::new(options.seed),
            blind: 0,
            age: 0,
            cost_of_plan: f64::INFINITY,
            last: vec![0.0; limits.len()],
            plan: vec![0.0; len],
            mean: vec![0.0; len],
            deviation: vec![0.0; len],
            candidates: vec![0.0; options.candidates * len],
            costs: vec![f64::INFINITY; options.candidates],
            order: (0..options.candidates).collect(),
            y: vec![0.0; BATCH * options.horizon * options.hold * outputs],
            now: vec![0.0; outputs],
            work: Workspace::new(),
            samples: Vec::with_capacity(if options.hold > 1 { BATCH * options.hold * len } else { 0 }),
        };
        planner.reset();
        Ok(planner)
    }

    /// Resets the plan to rest and the random numbers to the seed.
    pub fn reset(&mut self) {
        self.noise = Noise::new(self.options.seed);
        (self.blind, self.age) = (0, 0);
        for (last, limits) in self.last.iter_mut().zip(&self.limits) {
            *last = limits.rest;
        }
        for row in self.plan.chunks_exact_mut(self.last.len()) {
            row.copy_from_slice(&self.last);
        }
    }

    /// Visits all numbers on which later plans depend; see [`Controller::visit_state`](crate::control::Controller::visit_state).
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.noise.visit_state(memory);
        memory.count(&mut self.blind, MOST_COUNTED);
        memory.count(&mut self.age, self.options.hold - 1);
        memory.number(&mut self.cost_of_plan);
        let Self { last, plan, limits, .. } = self;
        for row in [last, plan] {
            for (command, limits) in row.iter_mut().zip(limits.iter().cycle()) {
                memory.number(command);
                if !(limits.low..=limits.high).contains(command) {
                    *command = limits.rest;
                }
            }
        }
    }

    /// The plan, `horizon x inputs`; its first row is the present command.
    pub fn plan(&self) -> &[f64] {
        &self.plan
    }

    /// The command that is planned for `later` samples after the last one. The last row of the plan is held.
    pub fn planned(&self, later: usize) -> &[f64] {
        let hold = self.options.hold;
        // Samples for which the first row has been commanded before the last sample.
        let begun = (self.age + hold - 1) % hold;
        let row = (begun.saturating_add(later) / hold).min(self.options.horizon - 1);
        &self.plan[row * self.limits.len()..][..self.limits.len()]
    }

    /// Horizon \[commands\].
    pub const fn horizon(&self) -> usize {
        self.options.horizon
    }

    /// Samples for which a command of a plan is held.
    pub const fn hold(&self) -> usize {
        self.options.hold
    }

    /// Plans from `pose` (`[x, y, psi]`) and the present state of `session`, or continues the command of the last plan until
    /// it ends. `references` are those at the ends of the commands of a plan: after 1, 2, .. `horizon` times `hold` samples.
    /// `stop` returns true to end the search.
    ///
    /// # Panics
    /// If `session`, `references` (fewer than the horizon) or `command` do not fit the planner.
    pub fn command(
        &mut self,
        session: &dyn Predictor,
        pose: [f64; 3],
        references: &[Reference],
        stop: &mut dyn FnMut() -> bool,
        command: &mut [f64],
    ) -> Plan {
        let inputs = self.limits.len();
        assert!(
            session.outputs() == self.outputs && session.inputs() == inputs,
            "the numbers of outputs and inputs of the planner"
        );
        let references = &references[..self.options.horizon];
        let due = self.age == 0;
        self.age = (self.age + 1) % self.options.hold;
        if !due && self.blind == 0 {
            command.copy_from_slice(&self.plan[..inputs]);
            clamp_to_limits(command, &self.last, &self.limits, self.dt);
            let seen = pose.iter().all(|x| x.is_finite());
            let status = if seen { self.status(pose, None, command) } else { Status::Blind };
            self.last.copy_from_slice(command);
            return Plan { cost: self.cost_of_plan, iterations: 0, tried: 0, status };
        }
        self.shift();
        session.output(&mut self.now);
        let seen = pose.iter().chain(&self.now).all(|x| x.is_finite())
            && references.iter().all(Reference::is_finite);
        let mut plan = Plan { cost: f64::INFINITY, iterations: 0, tried: 0, status: Status::Blind };
        if seen {
            self.search(session, pose, references, stop, &mut plan);
        }
        self.blind = if plan.cost.is_finite() { 0 } else { self.blind.saturating_add(1) };
        if self.blind as f64 * self.dt > BLIND_S {
            for row in self.plan.chunks_exact_mut(inputs) {
                row.iter_mut().zip(&self.limits).for_each(|(c, to)| *c = to.rest);
            }
            let step = self.step();
            clamp_to_limits(&mut self.plan, &self.last, &self.limits, step);
        }
        command.copy_from_slice(&self.plan[..inputs]);
        clamp_to_limits(command, &self.last, &self.limits, self.dt);
        self.cost_of_plan = plan.cost;
        if plan.cost.is_finite() {
            plan.status = self.status(pose, Some(&references[0]), command);
        }
        self.last.copy_from_slice(command);
        plan
    }

    fn shift(&mut self) {
        self.plan.copy_within(self.limits.len().., 0);
        let step = self.step();
        clamp_to_limits(&mut self.plan, &self.last, &self.limits, step);
    }

    /// Time of a command of a plan \[s\].
    fn step(&self) -> f64 {
        self.dt * self.options.hold as f64
    }

    fn search(
        &mut self,
        session: &dyn Predictor,
        pose: [f64; 3],
        references: &[Reference],
        stop: &mut dyn FnMut() -> bool,
        plan: &mut Plan,
    ) {
        let (inputs, len) = (self.limits.len(), self.plan.len());
        let PlannerOptions { candidates, iterations, deviation, .. } = self.options;
        self.mean.copy_from_slice(&self.plan);
        for (s, k) in self.deviation.iter_mut().zip(0..) {
            *s = deviation * self.limits[k % inputs].half();
        }
        let moment = PlanningProblem {
            pose,
            nu: [self.now[0], self.now[1], self.now[2]],
            outputs: self.outputs,
            last: &self.last,
            limits: &self.limits,
            references,
            dt: self.dt,
            hold: self.options.hold,
        };
        let mut simulator = Simulator { session, work: &mut self.work, samples: &mut self.samples };
        for _ in 0..iterations {
            let known = plan.cost.is_finite();
            let around = [&self.mean[..], &self.deviation, &self.plan];
            draw(&mut self.noise, self.correlation, around, known, &moment, &mut self.candidates);
            let (mut first, mut stopped) = (0, false);
            while first < candidates && !stopped {
                let count = BATCH.min(candidates - first);
                let commands = &self.candidates[first * len..(first + count) * len];
                let rows = moment.rows();
                let y = &mut self.y[..count * rows];
                moment.roll_out(&mut simulator, count, commands, y);
                for k in 0..count {
                    let of = &commands[k * len..(k + 1) * len];
                    let cost = self.cost.of(&moment, &y[k * rows..(k + 1) * rows], of);
                    self.costs[first + k] = cost;
                    if cost < plan.cost {
                        plan.cost = cost;
                        self.plan.copy_from_slice(of);
                    }
                }
                first += count;
                plan.tried += count;
                stopped = stop();
            }
            if first < candidates {
                return;
            }
            plan.iterations += 1;
            learn(
                &self.options,
                &self.limits,
                &self.candidates,
                &self.costs,
                &mut self.order,
                [&mut self.mean, &mut self.deviation],
            );
            if stopped {
                return;
            }
        }
        for _ in 0..self.options.gauss_newton_steps {
            if !plan.cost.is_finite() {
                return;
            }
            let (tried, cost) = self.gauss_newton.step(
                &mut simulator,
                &self.cost,
                &moment,
                (&mut self.plan, plan.cost),
                &mut self.y,
            );
            plan.tried += tried;
            let better = cost < plan.cost;
            plan.cost = cost;
            if !better || stop() {
                return;
            }
        }
    }

    /// Status of a command; with the reference at its end, also of the position.
    fn status(&self, [x, y, psi]: [f64; 3], reference: Option<&Reference>, command: &[f64]) -> Status {
        let mut status = Status::Tracking;
        for ((command, last), limits) in command.iter().zip(&self.last).zip(&self.limits) {
            if (command - last).abs() >= limits.rate * self.dt * (1.0 - 1e-9) {
                status = status.and(Status::RateLimited);
            }
            if !limits.are_held() && (*command <= limits.low || *command >= limits.high) {
                status = status.and(Status::Saturated);
            }
        }
        let Some(reference) = reference else { return status };
        let (sin, cos) = Float::sin_cos(psi);
        let back = self.step();
        let now = |i: usize| {
            reference.position[i] - back * (reference.velocity[i] - 0.5 * back * reference.acceleration[i])
        };
        let north = x + self.cost.lookahead * cos - now(0);
        let east = y + self.cost.lookahead * sin - now(1);
        if Float::hypot(north, east) > self.tolerance {
            status = status.and(Status::Lost);
        }
        status
    }
}

/// Candidates of an iteration: the mean, the best sequence so far, and random sequences.
fn draw(
    noise: &mut Noise,
    correlation: f64,
    [mean, deviation, best]: [&[f64]; 3],
    known: bool,
    moment: &PlanningProblem<'_>,
    candidates: &mut [f64],
) {
    let (inputs, len) = (moment.limits.len(), mean.len());
    let fresh = Float::sqrt(1.0 - correlation * correlation);
    for (index, candidate) in candidates.chunks_exact_mut(len).enumerate() {
        if index == 0 {
            candidate.copy_from_slice(mean);
        } else if index == 1 && known {
            candidate.copy_from_slice(best);
        } else {
            for i in 0..inputs {
                let mut n = noise.normal();
                for at in (i..len).step_by(inputs) {
                    candidate[at] = mean[at] + deviation[at] * n;
                    n = correlation * n + fresh * noise.normal();
                }
            }
        }
        moment.clamp(candidate);
    }
}

fn learn(
    options: &PlannerOptions,
    limits: &[Limits],
    candidates: &[f64],
    costs: &[f64],
    order: &mut [usize],
    [mean, deviation]: [&mut [f64]; 2],
) {
    let (inputs, len) = (limits.len(), mean.len());
    let PlannerOptions { elites, momentum, least_deviation, .. } = *options;
    // Ties in the order of the candidates, for the same elites in any previous order.
    let by_cost = |a: &usize, b: &usize| costs[*a].total_cmp(&costs[*b]).then(a.cmp(b));
    order.select_nth_unstable_by(elites - 1, by_cost);
    let best = &mut order[..elites];
    let finite = best.iter().filter(|k| costs[**k].is_finite()).count();
    if finite < 2 {
        return;
    }
    best.sort_unstable_by_key(|k| (!costs[*k].is_finite(), *k));
    let best = &best[..finite];
    for at in 0..len {
        let value = |k: &usize| candidates[k * len + at];
        let of_elites = best.iter().map(value).sum::<f64>() / finite as f64;
        let square = best.iter().map(|k| (value(k) - of_elites) * (value(k) - of_elites)).sum::<f64>();
        let least = least_deviation * limits[at % inputs].half();
        let spread = Float::sqrt(square / finite as f64);
        mean[at] = momentum * mean[at] + (1.0 - momentum) * of_elites;
        deviation[at] = (momentum * deviation[at] + (1.0 - momentum) * spread).max(least);
    }
}
