//! Backstepping of a lookahead point with adaptation of two constant disturbances.

use num_traits::Float;

use super::affine::Affine;
use super::error::{ControlError, at_least, positive};
use super::lookahead_point::{LookaheadPoint, shortened};
use super::status::Status;
use super::{Controller, Estimate};
use crate::actuator::Limits;
use crate::guidance::Reference;
use crate::memory::Memory;

/// Options of [`Backstepping`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BacksteppingOptions {
    /// Distance `l` of the lookahead point from the origin \[m\], at least half a length of the vessel.
    pub lookahead: f64,
    /// `k_1` \[1/s\]: convergence rate of the distance.
    pub position: f64,
    /// `k_2` \[1/s\]: convergence rate of the closing velocity.
    pub velocity: f64,
    /// `q` \[1/s^2\]: weight of the distance in the Lyapunov function.
    pub weight: f64,
    /// `gamma_n` \[1/s^2\]: adaptation gain of a disturbance that is constant north and east (wind); 0 for none.
    pub weather: f64,
    /// `gamma_b` \[1/s^2\]: adaptation gain of a disturbance that is constant in the body frame; 0 for none.
    pub body: f64,
    /// Largest estimate of either disturbance \[m/s^2\].
    pub most: f64,
    /// Largest closing speed relative to the reference \[m/s\].
    pub closing_speed: f64,
    /// As in [`FeedbackLinearizationOptions`](super::FeedbackLinearizationOptions) \[m/s^2\].
    pub min_control_authority: f64,
    /// Distance from the reference above which the status is [`Status::Lost`] \[m\].
    pub tolerance: f64,
    /// Response time of the actuators \[s\] ([`Actuators`](super::Actuators)).
    pub response: f64,
    /// Whether the vessel is driven ahead only: a demand to go astern brakes it, with the rate of the velocity error, and no more.
    /// References must move forward; a station needs both directions.
    pub ahead: bool,
}

impl BacksteppingOptions {
    /// A lookahead distance \[m\], with the gains of the rate 1 /s.
    pub fn new(lookahead: f64) -> Self {
        Self {
            lookahead,
            position: 0.0,
            velocity: 0.0,
            weight: 0.0,
            weather: 0.0,
            body: 0.0,
            most: 0.3,
            closing_speed: 1.0,
            min_control_authority: 0.05,
            tolerance: 2.0,
            response: 0.0,
            ahead: false,
        }
        .with_rate(1.0)
    }

    /// These options with the gains of one rate \[1/s\]: `k_1 = k_2 = k`, `q = k^2`, `gamma_n = gamma_b = k^2 / 10`.
    #[must_use]
    pub fn with_rate(self, k: f64) -> Self {
        Self { position: k, velocity: k, weight: k * k, weather: 0.1 * k * k, body: 0.1 * k * k, ..self }
    }
}

/// Backstepping of a point `l` metres ahead of the origin, with adaptation, on any [`Affine`] model.
///
/// # Law
///
/// With the point `p` of [`FeedbackLinearization`](super::FeedbackLinearization), `d2p/dt2 = w + b_n + R(psi) b_b`: `w`
/// is the allocated acceleration, `b_n` an unknown constant acceleration north and east, `b_b` one in the body frame.
///
/// ```text
/// z_1 = p - p_d
/// a   = dp_d/dt - k_1 z_1                                  (virtual control: the velocity that closes the distance)
/// z_2 = dp/dt - a
/// w   = da/dt - q z_1 - k_2 z_2 - b_n^ - R(psi) b_b^
/// db_n^/dt = gamma_n z_2,      db_b^/dt = gamma_b R(psi)' z_2
/// ```
///
/// For `V = q |z_1|^2 / 2 + |z_2|^2 / 2 + |b_n - b_n^|^2 / (2 gamma_n) + |b_b - b_b^|^2 / (2 gamma_b)` this gives
/// `dV/dt = -q k_1 |z_1|^2 - k_2 |z_2|^2`: distance and rate converge to zero for any constants. (On a straight course
/// only the sum of both constants is observable, and only the sum is needed.)
///
/// Sources: M. Krstic, I. Kanellakopoulos, P. V. Kokotovic, *Nonlinear and Adaptive Control Design*, 1995, sections 2.3
/// (integrator backstepping) and 3.2 (adaptation of constants in the last step); for marine craft T. I. Fossen,
/// *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd ed., 2021, chapter 16.
///
/// Without adaptation and limits, the law equals feedback linearization with `k_p = q + k_1 k_2` and `k_d = k_1 + k_2`.
///
/// # Tuning
///
/// One rate `k` for all gains ([`BacksteppingOptions::with_rate`]): a damping of 0.7. `k` should stay below about `0.2
/// / h` for samples of `h` seconds and below the bandwidth of the actuators. The disturbances converge within about
/// `10 / k` seconds; faster adaptation increases the noise of the command.
///
/// # Assumptions and failure modes
///
/// As for [`FeedbackLinearization`](super::FeedbackLinearization). Faster disturbances are attenuated only. With
/// saturated commands, `z_2` contains no information on the disturbances: the estimates are corrected by the missing
/// acceleration and stay within `most`.
#[derive(Clone, Debug)]
pub struct Backstepping<M> {
    point: LookaheadPoint<M>,
    options: BacksteppingOptions,
    weather: [f64; 2],
    body: [f64; 2],
}

impl<M: Affine> Backstepping<M> {
    /// A controller with samples of `dt` seconds.
    ///
    /// # Errors
    /// If options, limits or lags are out of range, or the model has fewer than two commands.
    pub fn new(
        model: M,
        limits: &[Limits],
        dt: f64,
        options: BacksteppingOptions,
    ) -> Result<Self, ControlError> {
        positive("the gain of the position", options.position)?;
        positive("the gain of the velocity", options.velocity)?;
        positive("the weight of the position", options.weight)?;
        at_least("the adaptation gain of the weather", options.weather, 0.0)?;
        at_least("the adaptation gain of the body disturbance", options.body, 0.0)?;
        at_least("the largest disturbance", options.most, 0.0)?;
        positive("the closing speed", options.closing_speed)?;
        positive("the tolerance", options.tolerance)?;
        let BacksteppingOptions { lookahead, min_control_authority, response, .. } = options;
        let point = LookaheadPoint::new(model, limits, dt, response, lookahead, min_control_authority)?;
        let point = if options.ahead { point.keep_ahead(options.velocity) } else { point };
        Ok(Self { point, options, weather: [0.0; 2], body: [0.0; 2] })
    }

    /// The model.
    pub fn model(&self) -> &M {
        self.point.model()
    }

    /// See [`FeedbackLinearization::update`](super::FeedbackLinearization::update).
    ///
    /// # Errors
    /// If a channel is not invertible any more. Model and law stay as they were.
    pub fn update(&mut self, change: impl FnOnce(&mut M)) -> Result<(), ControlError>
    where
        M: Clone,
    {
        self.point.update(change)
    }

    /// Estimate of the disturbance that is constant north and east \[m/s^2\].
    pub const fn weather(&self) -> [f64; 2] {
        self.weather
    }

    /// Estimate of the disturbance of the point that is constant ahead and to starboard \[m/s^2\].
    pub const fn body(&self) -> [f64; 2] {
        self.body
    }
}

impl<M: Affine> Controller for Backstepping<M> {
    fn inputs(&self) -> usize {
        self.point.inputs()
    }

    fn reset(&mut self) {
        self.point.reset();
        (self.weather, self.body) = ([0.0; 2], [0.0; 2]);
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.point.visit_state(memory);
        memory.numbers(&mut self.weather);
        memory.numbers(&mut self.body);
    }

    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status {
        if !(estimate.is_finite() && reference.is_finite()) {
            return self.point.hold(command);
        }
        let BacksteppingOptions { position: k_1, velocity: k_2, weight, most, .. } = self.options;
        let error = self.point.error(estimate, reference);
        // k_1 z_1, limited to the closing speed. While it is limited, it does not change with z_1.
        let asked = error.position.map(|e| -k_1 * e);
        let closing = shortened(asked, self.options.closing_speed);
        let z_1 = closing.map(|c| c / k_1);
        let cut = closing != asked;
        let z_2: [f64; 2] = core::array::from_fn(|i| closing[i] - error.velocity[i]);
        let (sin, cos) = Float::sin_cos(estimate.eta[2]);
        let north_east = |[x, y]: [f64; 2]| [x * cos - y * sin, x * sin + y * cos];
        let ahead_starboard = |[x, y]: [f64; 2]| [x * cos + y * sin, y * cos - x * sin];
        let turned = north_east(self.body);
        let wanted = core::array::from_fn(|i| {
            // da/dt, with dz_1/dt = -de/dt
            let stepped = reference.acceleration[i] + if cut { 0.0 } else { k_1 * error.velocity[i] };
            stepped - weight * z_1[i] - k_2 * z_2[i] - self.weather[i] - turned[i]
        });
        let (mut status, missing) = self.point.accelerate(estimate, wanted, command);

        let BacksteppingOptions { weather, body, .. } = self.options;
        // The missing acceleration alone drives z_2 to missing / k_2 within 1 / k_2. This part is not a disturbance.
        let unexplained: [f64; 2] = core::array::from_fn(|i| z_2[i] - missing[i] / k_2);
        if !cut && unexplained.iter().all(|x| x.is_finite()) {
            let dt = self.point.dt();
            let learn = |known: [f64; 2], rate: f64, by: [f64; 2]| {
                shortened([known[0] + dt * rate * by[0], known[1] + dt * rate * by[1]], most)
            };
            self.weather = learn(self.weather, weather, unexplained);
            self.body = learn(self.body, body, ahead_starboard(unexplained));
        }
        if error.distance() > self.options.tolerance {
            status = status.and(Status::Lost);
        }
        status
    }
}
