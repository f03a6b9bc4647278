//! Vessels of the Marine Systems Simulator (MSS) and the Python Vehicle Simulator.
//!
//! `NAME.py` has the class of a vehicle with the interface of the Python Vehicle Simulator (T. I. Fossen,
//! github.com/cybergalactic/PythonVehicleSimulator: `dynamics(eta, nu, u_actual, u_control, sampleTime)`) and needs numpy.
//! `NAME.m` is a function `[xdot, U] = NAME(x, ui)` for MATLAB and Octave, as those in the folder VESSELS of MSS. Both contain
//! all equations of the vessel ([`hydroid_core::craft`], [`hydroid_core::vessel::Plant`]).

use hydroid::model::{Body, Model};
use hydroid_core::craft::{Craft, Order, Servo, ThrustLaw};
use hydroid_core::model::PlantModel;
use hydroid_core::vessel::{Coriolis, RudderLaw};

use super::CoefficientOptions;
use super::literal::Literal;
use super::numbers::short;
use super::servos::Servos;
use crate::name::comment;
use crate::{ExportError, File, Options, identifier};

/// Templates of vessels, of equations of motion, and the class of both.
const VESSEL: [&str; 2] = [include_str!("templates/vessel.py"), include_str!("templates/vessel.m")];
const EQUATIONS: [&str; 2] = [include_str!("templates/equations.py"), include_str!("templates/equations.m")];
const VEHICLE: &str = include_str!("templates/vehicle.py");

/// Names that the generated code uses, or that Python or MATLAB reserve beside those of [`identifier`].
const USED: &[&str] = &[
    "abs",
    "acceleration",
    "actuators",
    "advance",
    "beam",
    "commands",
    "cos",
    "cross_flow",
    "damping",
    "dict",
    "disp",
    "elseif",
    "end",
    "error",
    "exp",
    "flying",
    "format",
    "function",
    "helms",
    "isempty",
    "kept",
    "length",
    "lift",
    "linear",
    "mass",
    "mass_matrix",
    "math",
    "max",
    "min",
    "munk",
    "nan",
    "inf",
    "nargin",
    "none",
    "np",
    "numel",
    "nu_dot",
    "order_of",
    "otherwise",
    "parameters",
    "parfor",
    "persistent",
    "pi",
    "print",
    "quadratic",
    "range",
    "rudders",
    "servo_rate",
    "servos",
    "settled",
    "sign",
    "sin",
    "spmd",
    "sqrt",
    "step",
    "struct",
    "sum",
    "tanh",
    "thrust_of",
    "thrusters",
    "unwind_protect",
    "until",
    "zeros",
    "zip",
];

/// A vessel or equations of motion as `NAME.py` and `NAME.m`.
///
/// # Errors
/// If the model is neither a vessel nor equations of `u`, `v`, `r` without delays and limits of rates.
pub fn mss(
    model: &Model,
    options: &Options,
    coefficient_options: &CoefficientOptions,
) -> Result<Vec<File>, ExportError> {
    let vehicle = match &model.body {
        Body::Craft(craft) => {
            let step = craft.model.dt() / craft.model.steps() as f64;
            Vehicle::of_craft(&craft.file.craft, step)
        }
        Body::Plant(plant) => Vehicle::of_plant(plant, coefficient_options.water_density),
        Body::Equations(equations) => super::mss_equations::vehicle(model, equations)?,
        _ => {
            return Err(ExportError::Unsupported {
                model: model.title(),
                format: "mss",
                reason: format!(
                    "a model of kind '{}' is neither a vessel nor equations of motion",
                    model.kind()
                ),
                remedy: String::from(
                    "identify a vessel with `hydroid identify --methods grey-box --vessel FILE.toml`, or export this \
                     model to C or CasADi",
                ),
            });
        }
    };
    let [python, matlab] = if vehicle.accelerations.is_some() { EQUATIONS } else { VESSEL };
    let name = class_name(&options.name);
    let file = |extension: &str, text: String| File {
        name: format!("{name}.{extension}"),
        content: text.into_bytes(),
    };
    Ok(vec![
        file("py", vehicle.fill(&[python, VEHICLE].concat(), &name, 0)),
        file("m", vehicle.fill(matlab, &name, 1)),
    ])
}

/// Name of the class and the function.
fn class_name(name: &str) -> String {
    let name = identifier(name);
    if USED.contains(&name.to_ascii_lowercase().as_str()) { format!("{name}_vessel") } else { name }
}

/// The data of the templates by their names there.
pub(super) struct Vehicle {
    pub(super) title: String,
    pub(super) commands: Vec<String>,
    pub(super) positions: Vec<String>,
    pub(super) data: Vec<(&'static str, Literal)>,
    /// Equations of motion in Python and MATLAB; none for a vessel.
    pub(super) accelerations: Option<[String; 2]>,
}

impl Vehicle {
    /// A template in Python (0) or MATLAB (1) with the data.
    fn fill(&self, template: &str, name: &str, language: usize) -> String {
        let literal = [Literal::python, Literal::matlab][language];
        let prefix = ["", "%  "][language];
        let lines = |lines: &[String]| {
            let lines: Vec<String> = lines.iter().map(|line| format!("{prefix}  {line}")).collect();
            lines.join("\n")
        };
        let mut text = String::new();
        let mut rest = template;
        // Names in the inserted text are not replaced.
        while let Some((before, after)) = rest.split_once('@') {
            text.push_str(before);
            let Some((key, after)) = after.split_once('@') else { break };
            match key {
                "CLASS" => text.push_str(name),
                "TITLE" => text.push_str(&self.title),
                "VERSION" => text.push_str(env!("CARGO_PKG_VERSION")),
                "COMMANDS" => text.push_str(&lines(&self.commands)),
                "POSITIONS" => text.push_str(&lines(&self.positions)),
                "ACCELERATIONS" => text.extend(self.accelerations.as_ref().map(|of| of[language].as_str())),
                key => {
                    let found = self.data.iter().find(|(known, _)| *known == key);
                    text.push_str(&found.map(|(_, value)| literal(value)).unwrap_or_default());
                }
            }
            rest = after;
        }
        text.push_str(rest);
        text
    }

    fn of_craft(craft: &Craft, step: f64) -> Self {
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
        let mut rudders = Vec::new();
        for rudder in &craft.rudders {
            let name = comment(&rudder.name);
            let servo = servos.add(&name, &rudder.servo, true);
            rudders.push(Literal::Record(vec![
                ("name", Literal::Text(name)),
                ("position", Literal::numbers(&rudder.position)),
                ("servo", Literal::Index(Some(servo))),
                ("area", Literal::Number(rudder.area)),
                ("lift_slope", Literal::Number(rudder.lift_slope)),
                ("wake", Literal::Number(rudder.wake)),
                ("straightening", Literal::Number(rudder.straightening)),
                ("drag_deduction", Literal::Number(rudder.drag_deduction)),
                ("hull_force", Literal::Number(rudder.hull_force)),
                ("hull_position", Literal::Number(rudder.hull_position)),
                ("thruster", Literal::Index(rudder.thruster)),
                ("race", Literal::Number(rudder.race)),
            ]));
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
            ("MUNK", Literal::Number(mass[1] - mass[0])),
            ("LINEAR", Literal::matrix(&hull.linear)),
            ("QUADRATIC", Literal::matrix(&hull.quadratic)),
            ("LIFT", Literal::matrix(&hull.lift)),
            ("CROSS_FLOW", Literal::Number(0.5 * craft.water_density * draught * hull.cross_flow)),
            ("THRUSTERS", Literal::List(thrusters)),
            ("RUDDERS", Literal::List(rudders)),
            ("HELMS", Literal::List(Vec::new())),
            ("STEP", Literal::Number(step)),
        ];
        let commands = describe(channels, &mut data);
        let positions = servos.describe(&mut data);
        data.push(("FLYING", Literal::Nothing));
        Self { title: comment(&craft.name), commands, positions, data, accelerations: None }
    }

    fn of_plant(plant: &PlantModel, density: f64) -> Self {
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
            ("sine", Literal::Flag(params.rudder.law == RudderLaw::Sine)),
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
        Self { title: comment(&params.name), commands, positions, data, accelerations: None }
    }
}

pub(super) struct Channel<'a> {
    pub(super) name: &'a str,
    pub(super) unit: &'a str,
    pub(super) limits: [f64; 2],
    pub(super) neutral: f64,
}

/// Adds the commands to the data, and describes them line by line.
pub(super) fn describe<'a>(
    channels: impl Iterator<Item = Channel<'a>>,
    data: &mut Vec<(&'static str, Literal)>,
) -> Vec<String> {
    let (mut lines, mut records) = (Vec::new(), Vec::new());
    for Channel { name, unit, limits: [low, high], neutral } in channels {
        let (name, unit) = (comment(name), comment(unit));
        let (low_text, high_text, neutral_text) = (short(low), short(high), short(neutral));
        lines.push(format!("{name} ({unit}, {low_text} to {high_text}, {neutral_text})"));
        records.push(Literal::Record(vec![
            ("name", Literal::Text(name)),
            ("unit", Literal::Text(unit)),
            ("low", Literal::Number(low)),
            ("high", Literal::Number(high)),
            ("neutral", Literal::Number(neutral)),
        ]));
    }
    data.push(("INPUTS", Literal::Number(lines.len() as f64)));
    data.push(("COMMAND_DATA", Literal::List(records)));
    lines
}
