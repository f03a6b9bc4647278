//! Vessels with any set of actuators; the equations are those of [`hydroid_core::craft`].

use std::f64::consts::FRAC_PI_4;

use hydroid_core::craft::{
    Coriolis, Craft, Flying, Hull, NormalForce, Order, RudderLaw, Servo, ThrustLaw, Thruster,
};
use hydroid_core::model::CraftModel;
use hydroid_core::vessel::Number as _;

use super::{Label, StateSpace, outputs_first, rk4};
use crate::graph::{Builder, Module, Scalar, Test, Unary, Vector};

type Three<'a> = [Scalar<'a>; 3];

const ZERO: Scalar<'static> = Scalar::Constant(0.0);
const ONE: Scalar<'static> = Scalar::Constant(1.0);

/// The servos in the order of the positions, with names and units.
fn servos(craft: &Craft) -> Vec<(Label, &Servo)> {
    let mut all = Vec::new();
    for thruster in &craft.thrusters {
        all.push((Label::new(format!("order of {}", thruster.name), "1"), &thruster.servo));
        let steering = thruster.steering.iter();
        all.extend(
            steering.map(|servo| (Label::new(format!("steering of {}", thruster.name), "rad"), servo)),
        );
    }
    let rudders = craft.rudders.iter();
    all.extend(rudders.map(|rudder| (Label::new(format!("angle of {}", rudder.name), "rad"), &rudder.servo)));
    all
}

fn order<'a>(order: &Order, command: Vector<'a>) -> Scalar<'a> {
    let sum = order
        .terms
        .iter()
        .fold(ZERO, |sum: Scalar<'a>, &(c, neutral, gain)| sum + (command.at(c) - neutral) * gain);
    limited(order, sum)
}

fn limited<'a>(order: &Order, value: Scalar<'a>) -> Scalar<'a> {
    let [low, high] = order.limits;
    let value = if low == f64::NEG_INFINITY { value } else { value.max(Scalar::constant(low)) };
    if high == f64::INFINITY { value } else { value.min(Scalar::constant(high)) }
}

/// The position of a servo `h` seconds later, with the order held ([`Servo::step`]).
fn moved<'a>(servo: &Servo, position: Scalar<'a>, order: Scalar<'a>, h: f64) -> Scalar<'a> {
    if servo.follows_at_once() {
        return order;
    }
    let error = order - position;
    let decayed = order - error * servo.decay(h);
    let Some(rate) = servo.rate else { return decayed };
    let knee = if servo.lag > 0.0 { rate * servo.lag } else { 0.0 };
    let size = error.abs();
    let side = error.select(Test::Less, ZERO, Scalar::constant(-1.0), ONE);
    let ramp = (size - knee) / rate;
    let h = Scalar::constant(h);
    let late = if servo.lag > 0.0 {
        order - side * knee * ((ramp - h) / servo.lag).unary(Unary::Exp)
    } else {
        order
    };
    let ramped = h.select(Test::LessOrEqual, ramp, position + side * rate * h, late);
    size.select(Test::LessOrEqual, Scalar::constant(knee), decayed, ramped)
}

fn all_moved<'a>(
    servos: &[(Label, &Servo)],
    positions: &[Scalar<'a>],
    orders: &[Scalar<'a>],
    h: f64,
) -> Vec<Scalar<'a>> {
    let each = servos.iter().zip(positions).zip(orders);
    each.map(|(((_, servo), position), order)| moved(servo, *position, *order, h)).collect()
}

/// Rate of a servo, `sat((order - a) / lag, rate)`; 0 where the position is the order at once.
fn rate<'a>(servo: &Servo, position: Scalar<'a>, order: Scalar<'a>) -> Scalar<'a> {
    let error = order - position;
    match (servo.lag > 0.0, servo.rate) {
        (true, None) => error / servo.lag,
        (true, Some(rate)) => (error / servo.lag).max(Scalar::constant(-rate)).min(Scalar::constant(rate)),
        (false, Some(rate)) => error.unary(Unary::Sign) * rate,
        (false, None) => ZERO,
    }
}

fn damping<'a>(hull: &Hull, half_density: f64, nu: Three<'a>) -> Three<'a> {
    let [u, v, r] = nu;
    let mut force = [ZERO; 3];
    for i in 0..3 {
        for j in 0..3 {
            let (linear, quadratic) = (hull.linear[i][j], hull.quadratic[i][j]);
            if linear != 0.0 {
                force[i] = force[i] + nu[j] * linear;
            }
            if quadratic != 0.0 {
                force[i] = force[i] + nu[j].abs() * nu[j] * quadratic;
            }
        }
    }
    for i in 0..2 {
        for j in 0..2 {
            if hull.lift[i][j] != 0.0 {
                force[1 + i] = force[1 + i] + u.abs() * nu[1 + j] * hull.lift[i][j];
            }
        }
    }
    let [length, _, draught] = hull.size.unwrap_or([0.0; 3]);
    let factor = hull.cross_flow * half_density * draught;
    if length > 0.0 && factor > 0.0 {
        let [side, moment] = cross_flow(0.5 * length, v, r);
        force[1] = force[1] + side * factor;
        force[2] = force[2] + moment * factor;
    }
    force
}

/// Integrals of `|w| w` and `x |w| w` over the hull, `w = v + x r`.
fn cross_flow<'a>(l: f64, v: Scalar<'a>, r: Scalar<'a>) -> [Scalar<'a>; 2] {
    let (sway, turn) = (v.abs(), r.abs() * l);
    // Without change of the sign of w along the hull, the integrals are polynomials; else they are taken in two parts.
    let select = |even: Scalar<'a>, odd: Scalar<'a>| turn.select(Test::LessOrEqual, sway, even, odd);
    let cubed = 2.0 * l * l * l / 3.0;
    let side = v.select(Test::Less, ZERO, Scalar::constant(-1.0), ONE);
    let even = [(v * v * (2.0 * l) + r * r * cubed) * side, v * r * (side * (2.0 * cubed))];
    let rate = select(ONE, r);
    let (fore, aft) = (v + r * l, v - r * l);
    let cube = |w: Scalar<'a>| w * w * w.abs();
    let force = (cube(fore) - cube(aft)) / (rate * 3.0);
    let fourth = (cube(fore) * fore - cube(aft) * aft) / (rate * rate * 4.0);
    let odd = [force, fourth - v * force / rate];
    [select(even[0], odd[0]), select(even[1], odd[1])]
}

fn thrust<'a>(thruster: &Thruster, order: Scalar<'a>, advance: Scalar<'a>) -> Scalar<'a> {
    let n = (order.abs() - thruster.dead_band).max(ZERO);
    let [ahead, astern] = [thruster.forward, -thruster.reverse].map(Scalar::constant);
    let gain = ZERO.select(Test::Less, order, ahead, astern);
    let still = match thruster.law {
        ThrustLaw::Quadratic => gain * n * n,
        ThrustLaw::Linear => gain * n,
    };
    still - n * advance * thruster.speed_loss
}

fn rudder_force<'a>(
    rudder: &NormalForce,
    nu: Three<'a>,
    angle: Scalar<'a>,
    race: Option<(Scalar<'a>, Scalar<'a>, f64)>,
    half_density: f64,
) -> Three<'a> {
    let [x, y] = rudder.position;
    let mut u = (nu[0] - nu[2] * y) * (1.0 - rudder.wake);
    if let Some((thrust, advance, diameter)) = race {
        let disc = FRAC_PI_4 * diameter * diameter;
        let behind = advance * advance + thrust.max(ZERO) * (1.0 / (half_density * disc));
        u = u + (behind.unary(Unary::Sqrt) - advance.abs()) * rudder.race;
    }
    let v = (nu[1] + nu[2] * x) * rudder.straightening;
    let (sin, cos) = (angle.unary(Unary::Sin), angle.unary(Unary::Cos));
    let speed = (u * u + v * v).unary(Unary::Sqrt);
    let normal = speed * (u * sin + v * cos) * (rudder.lift_slope * (half_density * rudder.area));
    let along = -normal * sin * (1.0 - rudder.drag_deduction);
    let aside = -normal * cos;
    [
        along,
        aside * (1.0 + rudder.hull_force),
        aside * (x + rudder.hull_force * rudder.hull_position) - along * y,
    ]
}

fn actuators<'a>(craft: &Craft, nu: Three<'a>, positions: &[Scalar<'a>]) -> Three<'a> {
    let half_density = 0.5 * craft.water_density;
    let mut tau = [ZERO; 3];
    let mut thrusts = Vec::new();
    let mut positions = positions.iter().copied();
    let mut next = || positions.next().unwrap_or(ZERO);
    for thruster in &craft.thrusters {
        let order = next();
        let angle = match thruster.steering {
            Some(_) => next() + thruster.angle,
            None => Scalar::constant(thruster.angle),
        };
        let (sin, cos) = (angle.unary(Unary::Sin), angle.unary(Unary::Cos));
        let [x, y] = thruster.position;
        let advance = (nu[0] - nu[2] * y) * cos + (nu[1] + nu[2] * x) * sin;
        let thrust = thrust(thruster, order, advance);
        thrusts.push((thrust, advance, thruster.diameter.unwrap_or(0.0)));
        tau[0] = tau[0] + thrust * cos;
        tau[1] = tau[1] + thrust * sin;
        tau[2] = tau[2] + thrust * (sin * x - cos * y);
    }
    for rudder in &craft.rudders {
        let angle = next();
        let force = match &rudder.law {
            RudderLaw::Linear(gain) => [ZERO, ZERO, nu[0] * angle * *gain],
            RudderLaw::Sine(gain) => [ZERO, ZERO, nu[0] * angle.unary(Unary::Sin) * *gain],
            RudderLaw::Normal(rudder) => {
                let race = rudder.thruster.and_then(|of| thrusts.get(of).copied());
                rudder_force(rudder, nu, angle, race, half_density)
            }
        };
        for (sum, part) in tau.iter_mut().zip(force) {
            *sum = *sum + part;
        }
    }
    tau
}

/// The product of a force with the inverse of a mass matrix.
fn accelerated([m11, m22, m23, m33]: [f64; 4], [x, y, n]: Three<'_>) -> Three<'_> {
    let determinant = m22 * m33 - m23 * m23;
    [
        x * (1.0 / m11),
        y * (m33 / determinant) - n * (m23 / determinant),
        n * (m22 / determinant) - y * (m23 / determinant),
    ]
}

fn acceleration<'a>(craft: &Craft, nu: Three<'a>, positions: &[Scalar<'a>]) -> Three<'a> {
    let mass = craft.hull.mass_matrix();
    let [m11, m22, m23, _] = mass;
    let munk = if craft.hull.coriolis == Coriolis::Full { m22 - m11 } else { 0.0 };
    let [u, v, r] = nu;
    let damping = damping(&craft.hull, 0.5 * craft.water_density, nu);
    let applied = actuators(craft, nu, positions);
    let driving = [
        applied[0] + (v * m22 + r * m23) * r,
        applied[1] - u * r * m11,
        applied[2] - u * v * munk - u * r * m23,
    ];
    let damped = |factor: f64| std::array::from_fn(|i| driving[i] - damping[i] * factor);
    let normal = accelerated(mass, damped(1.0));
    let Some(flying) = &craft.flying else { return normal };
    let fly = accelerated(craft.hull.mass_matrix_with(flying.added_mass_factor), damped(flying.drag_factor));
    let weight = flying_weight(flying, u);
    let rest = ONE - weight;
    std::array::from_fn(|i| weight * fly[i] + rest * normal[i])
}

/// The order of a lone linear propeller that holds a measured surge velocity; none for other vessels. A
/// propeller without thrust in a direction holds nothing there: the first order counts. The equations are those of
/// [`hydroid_core::craft::Dynamics::holding_force`] and of the start of a session.
fn held_order<'a>(craft: &Craft, u: Scalar<'a>, first: Scalar<'a>) -> Option<Scalar<'a>> {
    let [propeller] = &craft.thrusters[..] else { return None };
    let is_ahead = propeller.steering.is_none() && propeller.angle == 0.0 && propeller.position[1] == 0.0;
    if propeller.law != ThrustLaw::Linear || propeller.speed_loss != 0.0 || !is_ahead {
        return None;
    }
    let [drag, ..] = damping(&craft.hull, 0.5 * craft.water_density, [u, ZERO, ZERO]);
    let force = match &craft.flying {
        None => drag,
        Some(flying) => {
            let inverse = |factor: f64| 1.0 / craft.hull.mass_matrix_with(factor)[0];
            let weight = flying_weight(flying, u);
            let (fly, normal) = (weight * inverse(flying.added_mass_factor), (ONE - weight) * inverse(1.0));
            drag * (fly * flying.drag_factor + normal) / (fly + normal)
        }
    };
    let limits = &propeller.servo.order;
    let order = |sign: f64, gain: f64| {
        if gain > 0.0 {
            limited(limits, force / gain + Scalar::constant(sign * propeller.dead_band))
        } else {
            first
        }
    };
    let astern = force.select(Test::Less, ZERO, order(-1.0, propeller.reverse), limited(limits, ZERO));
    Some(ZERO.select(Test::Less, force, order(1.0, propeller.forward), astern))
}

fn flying_weight<'a>(flying: &Flying, u: Scalar<'a>) -> Scalar<'a> {
    ((u - flying.transition_speed) * flying.slope).logistic()
}

pub(super) fn state_space(model: &CraftModel) -> StateSpace {
    let craft = model.craft();
    let servos = servos(craft);
    let (inputs, count) = (craft.commands.len(), servos.len());
    let states = 3 + count;
    let mut module = Module::default();

    let b = Builder::new();
    let (nu, positions) = (b.argument("nu", 3), b.argument("positions", count));
    let [u, v, r] = [0, 1, 2].map(|i| nu.at(i));
    let rates = b.gather(&acceleration(craft, [u, v, r], &positions.elements()));
    let motion =
        module.add(b.finish("acceleration", "Accelerations in surge, sway and yaw (Fossen 2021)", rates));

    let b = Builder::new();
    let c = b.argument("command", inputs);
    let orders: Vec<Scalar<'_>> = servos.iter().map(|(_, servo)| order(&servo.order, c)).collect();
    let orders = module.add(b.finish("orders", "Orders of the actuators under a command", b.gather(&orders)));

    let b = Builder::new();
    let (x, held) = (b.argument("state", states), b.argument("orders", count));
    let h = model.dt() / model.steps() as f64;
    let first: Vec<Scalar<'_>> = servos
        .iter()
        .enumerate()
        .map(|(i, (_, servo))| if servo.follows_at_once() { held.at(i) } else { x.at(3 + i) })
        .collect();
    let middle = all_moved(&servos, &first, &held.elements(), 0.5 * h);
    let last = all_moved(&servos, &middle, &held.elements(), 0.5 * h);
    let at = [&first, &middle, &middle, &last].map(|positions| b.gather(positions));
    let nu = rk4(&b, x.slice(0, 3), h, |stage, nu| b.call(motion, 3, &[nu, at[stage]]));
    let next = b.concat(&[nu, at[3]]);
    let substep = module.add(b.finish("integrate", "One step of the Runge-Kutta method of order 4", next));

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", inputs));
    let held = b.call(orders, count, &[c]);
    let next = b.repeat(substep, model.steps(), &[x, held]);
    let step = module.add(b.finish("step", "State after a sample with the command held", next));

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", inputs));
    let held = b.call(orders, count, &[c]);
    let at: Vec<Scalar<'_>> = servos
        .iter()
        .enumerate()
        .map(|(i, (_, servo))| if servo.follows_at_once() { held.at(i) } else { x.at(3 + i) })
        .collect();
    let nu = b.call(motion, 3, &[x.slice(0, 3), b.gather(&at)]);
    let follow: Vec<Scalar<'_>> =
        servos.iter().enumerate().map(|(i, (_, servo))| rate(servo, x.at(3 + i), held.at(i))).collect();
    let rates = module.add(b.finish("rates", "Rates of the state", b.concat(&[nu, b.gather(&follow)])));

    let b = Builder::new();
    let (y, c) = (b.argument("outputs", 3), b.argument("command", inputs));
    let mut positions = b.call(orders, count, &[c]).elements();
    if let Some(held) = held_order(craft, y.at(0), positions[0]) {
        positions[0] = held;
    }
    let state = b.concat(&[y, b.gather(&positions)]);
    let start = module.add(b.finish("start", "State of a steady motion", state));

    let [observe, output] = outputs_first(&mut module, 3, states);
    let mut state: Vec<Label> =
        [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")].map(|(name, unit)| Label::new(name, unit)).to_vec();
    state.extend(servos.into_iter().map(|(label, _)| label));
    StateSpace { module, state, start, step, observe, output, rates: Some(rates), block: None }
}
