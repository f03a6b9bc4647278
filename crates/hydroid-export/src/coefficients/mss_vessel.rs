//! Vessels as data of the templates of MSS.

use hydroid_core::craft::{Coriolis, Craft, Order, RudderLaw, Servo, ThrustLaw};
use hydroid_core::model::PlantModel;
use hydroid_core::vessel::{self as old};

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

/// A built-in vessel.
pub(super) fn of_plant(plant: &PlantModel, density: f64) -> Vehicle {
    let params = plant.params();
    let (body, added, drag) = (&params.rigid_body, &params.added_mass, &params.drag);
    let mass = |factor: f64| {
        [
            body.mass - factor * added.x_udot,
            body.mass - factor * added.y_vdot,
            body.mass * body.x_g - factor * added.y_rdot,
            body.i_z - factor * added.n_rdot,
        ]
    };
    let normal = mass(1.0);
    let commands = [&params.commands.propeller, &params.commands.rudder];
    let channels = commands.iter().map(|c| Channel {
        name: &c.name,
        unit: &c.unit,
        limits: c.limits,
        neutral: c.clamp(0.0),
    });
    let unlimited = [f64::NEG_INFINITY, f64::INFINITY];
    let order = |command| Order { terms: vec![(command, 0.0, 1.0)], limits: unlimited };
    let mut servos = Servos::default();
    let propeller = Servo { order: order(0), lag: params.propeller.lag, rate: None };
    let propeller = servos.add("propeller force [N]", &propeller, false);
    let rudder = servos.add("rudder", &Servo { order: order(1), lag: 0.0, rate: None }, true);
    let thruster = vec![
        ("name", Literal::Text(String::from("propeller"))),
        ("position", Literal::numbers(&[0.0, 0.0])),
        ("angle", Literal::Number(0.0)),
        ("servo", Literal::Index(Some(propeller))),
        ("steering", Literal::Index(None)),
        ("dead_band", Literal::Number(0.0)),
        ("quadratic", Literal::Flag(false)),
        ("forward", Literal::Number(1.0)),
        ("reverse", Literal::Number(1.0)),
        ("speed_loss", Literal::Number(0.0)),
        ("diameter", Literal::Number(0.0)),
    ];
    let helm = vec![
        ("servo", Literal::Index(Some(rudder))),
        ("gain", Literal::Number(params.rudder.gain)),
        ("sine", Literal::Flag(params.rudder.law == old::RudderLaw::Sine)),
    ];
    let munk = if params.coriolis == Coriolis::Full { normal[1] - normal[0] } else { 0.0 };
    let mut data = vec![
        ("NAME", Literal::Text(comment(&params.name))),
        ("DENSITY", Literal::Number(density)),
        ("LENGTH", Literal::Number(0.0)),
        ("BEAM", Literal::Number(0.0)),
        ("MASS", Literal::numbers(&normal)),
        ("MUNK", Literal::Number(munk)),
        ("LINEAR", Literal::matrix(&drag.linear)),
        ("QUADRATIC", Literal::matrix(&drag.quadratic)),
        ("LIFT", Literal::matrix(&[[0.0; 2]; 2])),
        ("CROSS_FLOW", Literal::Number(0.0)),
        ("THRUSTERS", Literal::List(vec![Literal::Record(thruster)])),
        ("RUDDERS", Literal::List(Vec::new())),
        ("HELMS", Literal::List(vec![Literal::Record(helm)])),
        ("STEP", Literal::Number(plant.dt() / plant.steps() as f64)),
    ];
    let flying = params.flying.map(|flying| {
        Literal::Record(vec![
            ("mass", Literal::numbers(&mass(flying.added_mass_factor))),
            ("drag_factor", Literal::Number(flying.drag_factor)),
            ("transition_speed", Literal::Number(flying.transition_speed)),
            ("slope", Literal::Number(flying.slope)),
        ])
    });
    data.push(("FLYING", flying.unwrap_or(Literal::Nothing)));
    let commands = describe(channels, &mut data);
    let positions = servos.describe(&mut data);
    Vehicle { title: comment(&params.name), commands, positions, data, accelerations: None }
}
