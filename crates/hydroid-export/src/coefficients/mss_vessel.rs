//! Vessels as data of the templates of MSS.

use hydroid_core::craft::{Coriolis, Craft, RudderLaw, ThrustLaw};

use super::literal::Literal;
use super::servos::Servos;
use super::vehicle::{Channel, Vehicle, describe};
use crate::name::comment;

/// A vessel with any actuators, integrated in steps of `step` seconds.
pub(super) fn of_craft(craft: &Craft, step: f64) -> Vehicle {
    let hull = &craft.hull;
    let mass = hull.mass_matrix();
    let [length, beam, draught] = hull.size.unwrap_or([0.0; 3]);
    let mut servos = Servos::default();
    let mut thrusters = Vec::new();
    for thruster in &craft.thrusters {
        let name = comment(&thruster.name);
        let servo = servos.add(&name, &thruster.servo, true);
        let steering =
            thruster.steering.as_ref().map(|servo| servos.add(&format!("{name}, steering"), servo, true));
        thrusters.push(Literal::Record(vec![
            ("name", Literal::Text(name)),
            ("position", Literal::numbers(&thruster.position)),
            ("angle", Literal::Number(thruster.angle)),
            ("servo", Literal::Index(Some(servo))),
            ("steering", Literal::Index(steering)),
            ("dead_band", Literal::Number(thruster.dead_band)),
            ("quadratic", Literal::Flag(thruster.law == ThrustLaw::Quadratic)),
            ("forward", Literal::Number(thruster.forward)),
            ("reverse", Literal::Number(thruster.reverse)),
            ("speed_loss", Literal::Number(thruster.speed_loss)),
            ("diameter", Literal::Number(thruster.diameter.unwrap_or(0.0))),
        ]));
    }
    let (mut rudders, mut helms) = (Vec::new(), Vec::new());
    for rudder in &craft.rudders {
        let name = comment(&rudder.name);
        let servo = ("servo", Literal::Index(Some(servos.add(&name, &rudder.servo, true))));
        let mut helm = |servo, gain, sine| {
            let (gain, sine) = (("gain", Literal::Number(gain)), ("sine", Literal::Flag(sine)));
            helms.push(Literal::Record(vec![servo, gain, sine]));
        };
        match &rudder.law {
            RudderLaw::Linear(gain) => helm(servo, *gain, false),
            RudderLaw::Sine(gain) => helm(servo, *gain, true),
            RudderLaw::Normal(normal) => rudders.push(Literal::Record(vec![
                ("name", Literal::Text(name)),
                ("position", Literal::numbers(&normal.position)),
                servo,
                ("area", Literal::Number(normal.area)),
                ("lift_slope", Literal::Number(normal.lift_slope)),
                ("wake", Literal::Number(normal.wake)),
                ("straightening", Literal::Number(normal.straightening)),
                ("drag_deduction", Literal::Number(normal.drag_deduction)),
                ("hull_force", Literal::Number(normal.hull_force)),
                ("hull_position", Literal::Number(normal.hull_position)),
                ("thruster", Literal::Index(normal.thruster)),
                ("race", Literal::Number(normal.race)),
            ])),
        }
    }
    let channels = craft.commands.iter().map(|c| Channel {
        name: &c.name,
        unit: &c.unit,
        limits: c.limits,
        neutral: c.neutral,
    });
    let mut data = vec![
        ("NAME", Literal::Text(comment(&craft.name))),
        ("DENSITY", Literal::Number(craft.water_density)),
        ("LENGTH", Literal::Number(length)),
        ("BEAM", Literal::Number(beam)),
        ("MASS", Literal::numbers(&mass)),
        ("MUNK", Literal::Number(if hull.coriolis == Coriolis::Full { mass[1] - mass[0] } else { 0.0 })),
        ("LINEAR", Literal::matrix(&hull.linear)),
        ("QUADRATIC", Literal::matrix(&hull.quadratic)),
        ("LIFT", Literal::matrix(&hull.lift)),
        ("CROSS_FLOW", Literal::Number(0.5 * craft.water_density * draught * hull.cross_flow)),
        ("THRUSTERS", Literal::List(thrusters)),
        ("RUDDERS", Literal::List(rudders)),
        ("HELMS", Literal::List(helms)),
        ("STEP", Literal::Number(step)),
    ];
    let commands = describe(channels, &mut data);
    let positions = servos.describe(&mut data);
    let flying = craft.flying.map(|flying| {
        Literal::Record(vec![
            ("mass", Literal::numbers(&hull.mass_matrix_with(flying.added_mass_factor))),
            ("drag_factor", Literal::Number(flying.drag_factor)),
            ("transition_speed", Literal::Number(flying.transition_speed)),
            ("slope", Literal::Number(flying.slope)),
        ])
    });
    data.push(("FLYING", flying.unwrap_or(Literal::Nothing)));
    Vehicle { title: comment(&craft.name), commands, positions, data, accelerations: None }
}
