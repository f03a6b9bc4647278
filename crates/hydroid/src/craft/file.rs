//! From TOML to a craft.

use std::collections::BTreeMap;
use std::path::Path;

use hydroid_core::craft::{
    CommandInput, Coriolis, Craft, Flying, Hull, NormalForce, Order, Rudder, RudderLaw, Servo, ThrustLaw,
    Thruster,
};

use super::error::CraftFileError;
use super::tables::{Command, CoriolisForm, EstimateList, File, Law, RudderKind, RudderTable, ThrusterTable};
use super::{CommandUnit, CraftFile, Estimate, Tie};
use crate::log::units::{Quantity, Unit};
use crate::toml_file::{self, TomlError, nearest};

/// Density of sea water at 15 degrees Celsius \[kg/m^3\].
const SEA_WATER: f64 = 1025.0;

/// Standard deviation of the prior of a number that is to be estimated, relative to it.
const PRIOR: f64 = 0.5;

/// Share of the additional velocity of a race at the rudder: 0.5 for the KVLCC2 (Yasukawa and Yoshimura 2015, table 3).
const RACE: f64 = 0.5;

/// Reads and validates a vessel file. [`CraftFile::text`] writes one.
///
/// # Errors
/// See [`CraftFileError`].
pub fn load(path: impl AsRef<Path>) -> Result<CraftFile, CraftFileError> {
    let path = path.as_ref();
    let text =
        std::fs::read_to_string(path).map_err(|source| TomlError::Read { path: path.to_owned(), source })?;
    parse(&text, path)
}

/// Whether a file has the tables of the form of vessel files that is not read any more: one propeller and one rudder.
fn is_former(text: &str) -> bool {
    let Ok(file) = text.parse::<toml::Table>() else { return false };
    ["propeller", "rudder", "commands"].iter().any(|key| file.get(*key).is_some_and(toml::Value::is_table))
}

/// Parses and validates a vessel file; `path` is for messages.
///
/// # Errors
/// See [`CraftFileError`].
pub fn parse(text: &str, path: &Path) -> Result<CraftFile, CraftFileError> {
    if is_former(text) {
        return Err(CraftFileError::Former { path: path.to_owned() });
    }
    let file: File = toml_file::parse(text, path)?;
    let reader = Reader { path, units: units(&file, path)? };
    let (craft, ties) = reader.craft(&file)?;
    craft.validate().map_err(|source| CraftFileError::Invalid {
        path: path.to_owned(),
        line: source.path().and_then(|field| line_of(text, field)),
        source,
    })?;
    let mut whole = CraftFile { craft, units: reader.units.clone(), estimate: Vec::new(), ties };
    whole.estimate = reader.estimates(&file, &whole)?;
    Ok(whole)
}

fn units(file: &File, path: &Path) -> Result<Vec<CommandUnit>, CraftFileError> {
    let of = |command: &Command| {
        if command.unit.is_empty() {
            return Ok(CommandUnit { text: String::new(), stored: String::new(), factor: 1.0, gain: 1.0 });
        }
        let unit = Unit::parse(&command.unit).map_err(|source| CraftFileError::Content {
            path: path.to_owned(),
            message: format!("command '{}': {source}", command.name),
        })?;
        let is_angle = unit.quantity == Some(Quantity::Angle);
        let gain = if is_angle { 1.0 } else { 1.0 / unit.factor };
        Ok(CommandUnit { text: unit.text, stored: unit.si, factor: unit.factor, gain })
    };
    file.command.iter().map(of).collect()
}

struct Reader<'a> {
    path: &'a Path,

    units: Vec<CommandUnit>,
}

impl Reader<'_> {
    fn unknown<'n>(
        &self,
        place: &str,
        kind: &'static str,
        name: &str,
        known: impl Iterator<Item = &'n str> + Clone,
    ) -> CraftFileError {
        let hint = nearest(name, known.clone()).map(|nearest| format!(", did you mean '{nearest}'?"));
        let known = known.collect::<Vec<_>>().join(", ");
        let hint = hint.unwrap_or_default();
        self.wrong(&format!(
            "{place} names the {kind} '{name}', which does not exist{hint}; there are: {known}"
        ))
    }

    fn wrong(&self, message: &str) -> CraftFileError {
        CraftFileError::Content { path: self.path.to_owned(), message: message.to_owned() }
    }

    fn missing(&self, place: &str, key: &str, remedy: &str) -> CraftFileError {
        self.wrong(&format!("{place} has no {key}: {remedy}"))
    }

    fn craft(&self, file: &File) -> Result<(Craft, Vec<Tie>), CraftFileError> {
        let hull = Hull {
            size: file.hull.as_ref().map(|hull| [hull.length, hull.beam, hull.draught]),
            mass: file.rigid_body.mass,
            x_g: file.rigid_body.x_g,
            i_z: file.rigid_body.i_z,
            x_udot: file.added_mass.x_udot,
            y_vdot: file.added_mass.y_vdot,
            y_rdot: file.added_mass.y_rdot,
            n_rdot: file.added_mass.n_rdot,
            linear: file.drag.linear.full(),
            quadratic: file.drag.quadratic.full(),
            lift: file.drag.lift,
            cross_flow: file.drag.cross_flow,
            coriolis: match file.coriolis {
                CoriolisForm::Full => Coriolis::Full,
                CoriolisForm::WithoutMunk => Coriolis::WithoutMunk,
            },
        };
        let flying = file.flying.as_ref().map(|flying| Flying {
            added_mass_factor: flying.added_mass_factor,
            drag_factor: flying.drag_factor,
            transition_speed: flying.transition_speed,
            slope: flying.slope,
        });
        let commands = file.command.iter().zip(&self.units).map(|(command, unit)| CommandInput {
            name: command.name.clone(),
            unit: unit.stored.clone(),
            limits: command.limits.map(|limit| unit.factor * limit),
            neutral: unit.factor * command.neutral,
        });
        let commands: Vec<CommandInput> = commands.collect();
        let (mut thrusters, mut ties): (Vec<Thruster>, Vec<Tie>) = (Vec::new(), Vec::new());
        for table in &file.thruster {
            let (thruster, tie) = self.thruster(table, &commands, &thrusters)?;
            ties.extend(tie);
            thrusters.push(thruster);
        }
        let rudders = file
            .rudder
            .iter()
            .map(|table| self.rudder(table, &commands, &thrusters))
            .collect::<Result<Vec<Rudder>, CraftFileError>>()?;
        let noise = [file.noise.u, file.noise.v, file.noise.r];
        let craft = Craft {
            name: file.name.clone(),
            water_density: file.water_density.unwrap_or(SEA_WATER),
            hull,
            flying,
            commands,
            thrusters,
            rudders,
            noise,
        };
        Ok((craft, ties))
    }

    fn order(
        &self,
        place: &str,
        order: &BTreeMap<String, f64>,
        limits: Option<[f64; 2]>,
        commands: &[CommandInput],
    ) -> Result<Order, CraftFileError> {
        let term = |(name, gain): (&String, &f64)| {
            let index = commands.iter().position(|command| command.name == *name).ok_or_else(|| {
                let known = commands.iter().map(|command| command.name.as_str());
                self.unknown(&format!("{place}.order"), "command", name, known)
            })?;
            let stored = self.units[index].gain * gain;
            if !stored.is_finite() {
                return Err(self.wrong(&format!("{place}.order.{name} is {gain}: a finite gain is needed")));
            }
            Ok((index, commands[index].neutral, stored))
        };
        let terms = order.iter().map(term).collect::<Result<Vec<_>, CraftFileError>>()?;
        if terms.is_empty() {
            return Err(self.missing(
                place,
                "command in its order",
                "write order = { NAME = GAIN } with the name of a command",
            ));
        }
        Ok(Order { terms, limits: limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]) })
    }

    fn thruster(
        &self,
        table: &ThrusterTable,
        commands: &[CommandInput],
        before: &[Thruster],
    ) -> Result<(Thruster, Option<Tie>), CraftFileError> {
        let place = format!("thruster.{}", table.name);
        let like = match &table.like {
            None => None,
            Some(name) => Some(before.iter().position(|other| other.name == *name).ok_or_else(|| {
                let known = before.iter().map(|other| other.name.as_str());
                self.unknown(&format!("{place}.like"), "thruster before it,", name, known)
            })?),
        };
        let base = like.map(|index| &before[index]);
        let mut keys = Vec::new();
        let mut number =
            |key: &'static str, given: Option<f64>, of: fn(&Thruster) -> f64, default: Option<f64>| {
                if let (None, Some(base)) = (given, base) {
                    keys.push(key);
                    return Ok(of(base));
                }
                given
                    .or(default)
                    .ok_or_else(|| self.missing(&place, key, "state it, or name another thruster with like"))
            };
        let forward = number("forward", table.forward, |t| t.forward, None)?;
        let reverse = number("reverse", table.reverse, |t| t.reverse, Some(forward))?;
        let speed_loss = number("speed_loss", table.speed_loss, |t| t.speed_loss, Some(0.0))?;
        let lag = number("lag", table.lag, |t| t.servo.lag, Some(0.0))?;
        let angle = number("angle", table.angle, |t| t.angle, Some(0.0))?;
        let base_rate = base.and_then(|base| base.servo.rate).filter(|_| table.rate.is_none());
        keys.extend(base_rate.map(|_| "rate"));
        let position = table.position.ok_or_else(|| {
            self.missing(
                &place,
                "position",
                "write position = [FORWARD, STARBOARD] in metres from the origin",
            )
        })?;
        let limits = table.limits.or_else(|| base.map(|base| base.servo.order.limits));
        let steering = match &table.steering {
            None => None,
            Some(given) => {
                let place = format!("{place}.steering");
                let order = self.order(&place, &given.order, given.limits, commands)?;
                Some(Servo { order, lag: given.lag, rate: given.rate })
            }
        };
        let law = match table.law {
            Some(Law::Quadratic) => ThrustLaw::Quadratic,
            Some(Law::Linear) => ThrustLaw::Linear,
            None => base.map(|base| base.law).unwrap_or_default(),
        };
        let order = self.order(&place, &table.order, limits, commands)?;
        let thruster = Thruster {
            name: table.name.clone(),
            position,
            angle,
            servo: Servo { order, lag, rate: table.rate.or(base_rate) },
            dead_band: table.dead_band.or_else(|| base.map(|base| base.dead_band)).unwrap_or(0.0),
            law,
            forward,
            reverse,
            speed_loss,
            diameter: table.diameter.or_else(|| base.and_then(|base| base.diameter)),
            steering,
            force_noise: table.force_noise,
        };
        let thruster_index = before.len();
        Ok((thruster, like.map(|like| Tie { thruster: thruster_index, like, keys })))
    }

    fn rudder(
        &self,
        table: &RudderTable,
        commands: &[CommandInput],
        thrusters: &[Thruster],
    ) -> Result<Rudder, CraftFileError> {
        let place = format!("rudder.{}", table.name);
        let servo = Servo {
            order: self.order(&place, &table.order, table.limits, commands)?,
            lag: table.lag,
            rate: table.rate,
        };
        let gain = || {
            let given = [
                ("position", table.position.is_some()),
                ("area", table.area.is_some()),
                ("aspect_ratio", table.aspect_ratio.is_some()),
                ("lift_slope", table.lift_slope.is_some()),
                ("wake", table.wake.is_some()),
                ("straightening", table.straightening.is_some()),
                ("drag_deduction", table.drag_deduction.is_some()),
                ("hull_force", table.hull_force.is_some()),
                ("hull_position", table.hull_position.is_some()),
                ("thruster", table.thruster.is_some()),
                ("race", table.race.is_some()),
            ];
            if let Some((key, _)) = given.iter().find(|(_, is_given)| *is_given) {
                return Err(self.wrong(&format!(
                    "{place}.{key} belongs to the normal force of a rudder in the flow: leave it out, or leave out law and gain"
                )));
            }
            table.gain.ok_or_else(|| {
                self.missing(&place, "gain", "state the yaw moment per surge velocity at the order 1")
            })
        };
        let law = match table.law {
            RudderKind::Linear => RudderLaw::Linear(gain()?),
            RudderKind::Sine => RudderLaw::Sine(gain()?),
            RudderKind::Normal => RudderLaw::Normal(self.normal(&place, table, thrusters)?),
        };
        Ok(Rudder { name: table.name.clone(), servo, law })
    }

    fn normal(
        &self,
        place: &str,
        table: &RudderTable,
        thrusters: &[Thruster],
    ) -> Result<NormalForce, CraftFileError> {
        if table.gain.is_some() {
            return Err(self.wrong(&format!(
                "{place}.gain needs law = \"linear\" or \"sine\", a yaw moment: state the law, or leave out the gain"
            )));
        }
        let slope = match (table.lift_slope, table.aspect_ratio) {
            (Some(slope), _) => slope,
            // Fujii's formula; Yasukawa and Yoshimura 2015, equation 18.
            (None, Some(ratio)) => 6.13 * ratio / (ratio + 2.25),
            (None, None) => {
                return Err(self.missing(
                    place,
                    "aspect_ratio",
                    "state the ratio of height and chord, or lift_slope [1/rad]",
                ));
            }
        };
        let thruster = match &table.thruster {
            None => None,
            Some(name) => Some(thrusters.iter().position(|t| t.name == *name).ok_or_else(|| {
                let known = thrusters.iter().map(|t| t.name.as_str());
                self.unknown(&format!("{place}.thruster"), "thruster", name, known)
            })?),
        };
        let position = table.position.ok_or_else(|| {
            self.missing(place, "position", "write position = [FORWARD, STARBOARD] in metres from the origin")
        })?;
        let area = table.area.ok_or_else(|| self.missing(place, "area", "state the area [m^2]"))?;
        Ok(NormalForce {
            position,
            area,
            lift_slope: slope,
            wake: table.wake.unwrap_or(0.0),
            straightening: table.straightening.unwrap_or(1.0),
            drag_deduction: table.drag_deduction.unwrap_or(0.0),
            hull_force: table.hull_force.unwrap_or(0.0),
            hull_position: table.hull_position.unwrap_or(0.0),
            thruster,
            race: table.race.unwrap_or(if thruster.is_some() { RACE } else { 0.0 }),
        })
    }

    fn estimates(&self, file: &File, whole: &CraftFile) -> Result<Vec<Estimate>, CraftFileError> {
        let parameters = whole.craft.parameters();
        let representatives = whole.representatives();
        let given: Vec<(&str, f64)> = match &file.estimate {
            EstimateList::Paths(paths) => paths.iter().map(|path| (path.as_str(), PRIOR)).collect(),
            EstimateList::Deviations(table) => {
                table.iter().map(|(path, &std)| (path.as_str(), std)).collect()
            }
        };
        let mut estimates: Vec<Estimate> = Vec::new();
        for (pattern, prior) in given {
            if !(prior.is_finite() && prior > 0.0) {
                return Err(self.wrong(&format!("estimate.\"{pattern}\" is {prior}: a standard deviation relative to the given number is needed, greater than 0")));
            }
            let matching: Vec<usize> =
                (0..parameters.len()).filter(|&i| matches(pattern, &parameters[i].0.path)).collect();
            if matching.is_empty() {
                let known = parameters.iter().map(|(parameter, _)| parameter.path.as_str());
                return Err(self.unknown("estimate", "number", pattern, known));
            }
            let is_pattern = pattern.contains('*');
            for index in matching {
                let (parameter, value) = &parameters[index];
                if *value == 0.0 {
                    if is_pattern {
                        continue;
                    }
                    return Err(self.wrong(&format!(
                        "{} is 0: the start of an estimate must not be 0: give a likely number",
                        parameter.path
                    )));
                }
                let index = representatives[index];
                if !estimates.iter().any(|known| known.index == index) {
                    estimates.push(Estimate { index, prior, deviation: None });
                }
            }
        }
        for (path, &deviation) in &file.deviation {
            if !(deviation.is_finite() && deviation >= 0.0) {
                return Err(self.wrong(&format!(
                    "deviation.\"{path}\" is {deviation}: the standard deviation of an estimate must not be negative"
                )));
            }
            let of = parameters.iter().position(|(parameter, _)| parameter.path == *path);
            let of = of.and_then(|index| {
                estimates.iter_mut().find(|estimate| estimate.index == representatives[index])
            });
            let Some(estimate) = of else {
                let known: Vec<&str> =
                    estimates.iter().map(|known| parameters[known.index].0.path.as_str()).collect();
                return Err(self.unknown("deviation", "estimated number", path, known.into_iter()));
            };
            estimate.deviation = Some(deviation);
        }
        estimates.sort_by_key(|estimate| estimate.index);
        Ok(estimates)
    }
}

/// Whether a path has a pattern, in which `*` stands for any text.
fn matches(pattern: &str, path: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = path.strip_prefix(parts.next().unwrap_or_default()) else { return false };
    let parts: Vec<&str> = parts.collect();
    for (i, part) in parts.iter().enumerate() {
        if i + 1 == parts.len() {
            return rest.ends_with(part);
        }
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.is_empty()
}

/// Line of a number in a file: the key in the table of its path. Tables of actuators are found by their names.
fn line_of(text: &str, field: &str) -> Option<usize> {
    let field = field.split('[').next()?;
    let (table, key) = field.split_once('.')?;
    let (name, key) = match table {
        "thruster" | "rudder" | "command" => key.rsplit_once('.').map(|(name, key)| (Some(name), key))?,
        _ => (None, key),
    };
    let (mut current, mut found) = ("", name.is_none());
    let mut header = None;
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.starts_with('[') {
            current = line.trim_matches(|c| c == '[' || c == ']').trim();
            found = name.is_none();
        } else if let Some((left, right)) = line.split_once('=')
            && current == table
        {
            let left = left.trim();
            if left == "name" && name.is_some_and(|name| right.trim().trim_matches('"') == name) {
                found = true;
                header = Some(k + 1);
            }
            if found && left == key {
                return Some(k + 1);
            }
        }
    }
    header
}
