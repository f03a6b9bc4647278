//! From a craft to TOML.

use std::fmt::Write as _;

use hydroid_core::craft::{Coriolis, Order, RudderLaw, Servo, ThrustLaw};

use super::{CraftFile, Tie};

impl CraftFile {
    /// The vessel file as TOML text. Numbers that were estimated have their standard deviations beside them.
    pub fn text(&self) -> String {
        let mut out = Writer { file: self, text: String::new(), index: 0 };
        out.write();
        out.text
    }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A key: bare if possible.
fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(bare) { name.to_owned() } else { quoted(name) }
}

/// A converted number without the rounding error of the conversion.
fn neat(value: f64) -> String {
    number(format!("{value:.13e}").parse().unwrap_or(value))
}

/// A number with a decimal point or an exponent.
fn number(value: f64) -> String {
    toml::Value::Float(value).to_string()
}

struct Writer<'a> {
    file: &'a CraftFile,
    text: String,
    /// Index of the next number in the order of the parameters.
    index: usize,
}

impl Writer<'_> {
    fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    /// The next number as a key, with its unit.
    fn next(&mut self, name: &str, shown: bool) {
        let parameters = self.file.craft.parameters();
        let (parameter, value) = &parameters[self.index];
        let estimate = self.file.estimate.iter().find(|estimate| estimate.index == self.index);
        let deviation = estimate.and_then(|estimate| estimate.deviation);
        self.index += 1;
        if !shown {
            return;
        }
        let spread = deviation.map(|deviation| format!(", +- {deviation:.3e} (1 sigma)")).unwrap_or_default();
        let line = format!("{name} = {} # {}{spread}", number(*value), parameter.unit);
        self.line(&line);
    }

    /// The next numbers as a matrix.
    fn matrix(&mut self, name: &str, size: usize) {
        let values: Vec<f64> = self.file.craft.parameters().iter().map(|(_, value)| *value).collect();
        let estimated: Vec<String> = (self.index..self.index + size * size)
            .filter_map(|index| {
                let estimate = self.file.estimate.iter().find(|estimate| estimate.index == index)?;
                let at = index - self.index;
                let deviation = estimate.deviation?;
                Some(format!("[{}][{}] +- {deviation:.3e}", at / size, at % size))
            })
            .collect();
        let row = |i: usize| {
            let cells: Vec<String> = (0..size).map(|j| number(values[self.index + size * i + j])).collect();
            format!("[{}]", cells.join(", "))
        };
        let rows: Vec<String> = (0..size).map(row).collect();
        let note = if estimated.is_empty() { String::new() } else { format!(" # {}", estimated.join(", ")) };
        let line = format!("{name} = [{}]{note}", rows.join(", "));
        self.index += size * size;
        self.line(&line);
    }

    fn order(&self, order: &Order) -> String {
        let terms: Vec<String> = order
            .terms
            .iter()
            .map(|(c, _, gain)| {
                format!(
                    "{} = {}",
                    key(&self.file.craft.commands[*c].name),
                    neat(gain / self.file.units[*c].gain)
                )
            })
            .collect();
        format!("{{ {} }}", terms.join(", "))
    }

    fn limits(&mut self, servo: &Servo) {
        let [low, high] = servo.order.limits;
        if low.is_finite() && high.is_finite() {
            let line = format!("limits = [{}, {}]", number(low), number(high));
            self.line(&line);
        }
    }

    fn servo(&mut self, servo: &Servo, shared: &dyn Fn(&str) -> bool) {
        self.next("lag", !shared("lag") && servo.lag != 0.0);
        if servo.rate.is_some() {
            self.next("rate", !shared("rate"));
        }
    }

    fn write(&mut self) {
        let file = self.file;
        let craft = &file.craft;
        let head = format!(
            "name = {}\nwater_density = {} # kg/m^3",
            quoted(&craft.name),
            number(craft.water_density)
        );
        self.line(&head);
        if craft.hull.coriolis == Coriolis::WithoutMunk {
            self.line("coriolis = \"without_munk\"");
        }
        if !file.estimate.is_empty() {
            let parameters = craft.parameters();
            self.line("\n# Numbers that `hydroid identify --vessel` estimates and `hydroid adapt` follows, with the relative standard deviation of the prior.\n[estimate]");
            for estimate in &file.estimate {
                let line =
                    format!("{} = {}", quoted(&parameters[estimate.index].0.path), number(estimate.prior));
                self.line(&line);
            }
        }
        if file.estimate.iter().any(|estimate| estimate.deviation.is_some()) {
            let parameters = craft.parameters();
            self.line("\n# Standard deviations of the estimates, in the units of the numbers.\n[deviation]");
            for (estimate, deviation) in file.estimate.iter().filter_map(|e| Some((e, e.deviation?))) {
                let line = format!("{} = {}", quoted(&parameters[estimate.index].0.path), number(deviation));
                self.line(&line);
            }
        }
        if let Some([length, beam, draught]) = craft.hull.size {
            let line = format!(
                "\n[hull]\nlength = {} # m\nbeam = {} # m\ndraught = {} # m",
                number(length),
                number(beam),
                number(draught)
            );
            self.line(&line);
        }
        self.line("\n[rigid_body]");
        for name in ["mass", "x_g", "i_z"] {
            self.next(name, true);
        }
        self.line("\n[added_mass]");
        for name in ["x_udot", "y_vdot", "y_rdot", "n_rdot"] {
            self.next(name, true);
        }
        self.line("\n[drag]");
        self.matrix("linear", 3);
        self.matrix("quadratic", 3);
        self.matrix("lift", 2);
        self.next("cross_flow", true);
        if craft.flying.is_some() {
            self.line("\n[flying]");
            for name in ["added_mass_factor", "drag_factor", "transition_speed", "slope"] {
                self.next(name, true);
            }
        }
        for (command, unit) in craft.commands.iter().zip(&file.units) {
            let mut lines = format!("\n[[command]]\nname = {}\n", quoted(&command.name));
            if !unit.text.is_empty() {
                let _ = writeln!(lines, "unit = {}", quoted(&unit.text));
            }
            let [low, high] = command.limits;
            let given =
                |value: f64| if unit.factor == 1.0 { number(value) } else { neat(value / unit.factor) };
            let (low, high, neutral) = (given(low), given(high), given(command.neutral));
            let _ = write!(lines, "limits = [{low}, {high}]\nneutral = {neutral}");
            self.line(&lines);
        }
        for index in 0..craft.thrusters.len() {
            self.thruster(index);
        }
        for index in 0..craft.rudders.len() {
            self.rudder(index);
        }
        let [u, v, r] = craft.noise;
        let noise =
            format!("\n[noise]\nu = {} # m/s\nv = {} # m/s\nr = {} # rad/s", number(u), number(v), number(r));
        self.line(&noise);
    }

    fn position(&mut self, position: [f64; 2]) {
        self.index += 2;
        let line = format!("position = [{}, {}] # m", number(position[0]), number(position[1]));
        self.line(&line);
    }

    fn thruster(&mut self, index: usize) {
        let file = self.file;
        let thruster = &file.craft.thrusters[index];
        let tie: Option<&Tie> = file.ties.iter().find(|tie| tie.thruster == index);
        let shared = |key: &str| tie.is_some_and(|tie| tie.keys.contains(&key));
        let mut head = format!("\n[[thruster]]\nname = {}", quoted(&thruster.name));
        if let Some(tie) = tie {
            let _ = write!(head, "\nlike = {}", quoted(&file.craft.thrusters[tie.like].name));
        }
        self.line(&head);
        let order = format!("order = {}", self.order(&thruster.servo.order));
        self.line(&order);
        self.limits(&thruster.servo);
        self.position(thruster.position);
        self.next("angle", !shared("angle") && thruster.angle != 0.0);
        self.servo(&thruster.servo, &shared);
        let law = match thruster.law {
            ThrustLaw::Quadratic => "quadratic",
            ThrustLaw::Linear => "linear",
        };
        self.line(&format!("law = \"{law}\"\ndead_band = {}", number(thruster.dead_band)));
        for name in ["forward", "reverse", "speed_loss"] {
            self.next(name, !shared(name));
        }
        if let Some(noise) = thruster.force_noise {
            self.line(&format!("force_noise = {} # N", number(noise)));
        }
        if let Some(diameter) = thruster.diameter {
            self.line(&format!("diameter = {} # m", number(diameter)));
        }
        if let Some(steering) = &thruster.steering {
            let order = format!("[thruster.steering]\norder = {}", self.order(&steering.order));
            self.line(&order);
            self.limits(steering);
            self.servo(steering, &|_| false);
        }
    }

    fn rudder(&mut self, index: usize) {
        let file = self.file;
        let rudder = &file.craft.rudders[index];
        let order = self.order(&rudder.servo.order);
        self.line(&format!("\n[[rudder]]\nname = {}\norder = {order}", quoted(&rudder.name)));
        self.limits(&rudder.servo);
        if let RudderLaw::Normal(normal) = &rudder.law {
            self.position(normal.position);
        }
        self.servo(&rudder.servo, &|_| false);
        let normal = match &rudder.law {
            RudderLaw::Normal(normal) => normal,
            RudderLaw::Linear(_) | RudderLaw::Sine(_) => {
                let law = if matches!(rudder.law, RudderLaw::Sine(_)) { "sine" } else { "linear" };
                self.line(&format!("law = \"{law}\""));
                return self.next("gain", true);
            }
        };
        self.line(&format!("area = {} # m^2", number(normal.area)));
        for name in ["lift_slope", "wake", "straightening", "drag_deduction", "hull_force", "hull_position"] {
            self.next(name, true);
        }
        if let Some(of) = normal.thruster {
            self.line(&format!("thruster = {}", quoted(&file.craft.thrusters[of].name)));
        }
        self.next("race", true);
    }
}
