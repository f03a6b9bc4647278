//! The straight course at a steady speed from which a trial begins.

use super::error::ManoeuvreError;
use super::settling::{BLOCK, Settling};
use crate::model::Model;
use crate::plant::{InputMap, Simulation};

/// Options of the approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Propulsion: 1 is full ahead, 0 none.
    pub propulsion: f64,
    /// Steady speed through the water \[m/s\]; in place of the propulsion.
    pub speed_m_s: Option<f64>,
}

impl Default for Options {
    /// 85 % of the largest shaft speed. The test speed of the IMO is 90 % of the speed at 85 % of the engine's largest
    /// power; the power grows with the cube of the shaft speed.
    fn default() -> Self {
        Self { propulsion: 0.85, speed_m_s: None }
    }
}

/// A vessel on a straight course at a steady speed.
#[derive(Clone, Debug)]
pub struct Approach {
    /// The simulation, at the origin and heading north.
    pub simulation: Simulation,
    /// Propulsion: 1 is full ahead; 0 for a vessel that no input pushes.
    pub propulsion: f64,
    /// Steering that holds the course: 1 is hard to starboard.
    pub steering: f64,
    /// Speed through the water \[m/s\].
    pub speed_m_s: f64,
}

/// Distance from the steady speed, relative to it, at which the approach ends.
const STEADY: f64 = 1e-6;

/// Largest number of blocks of one approach.
const MOST_BLOCKS: usize = 5_000;

/// Largest difference of a stated speed from the only one of a vessel that no input pushes, relative to it.
const SAME_SPEED: f64 = 0.01;

/// Longest extrapolation of the speed, relative to its change over a block.
const LONGEST_JUMP: f64 = 50.0;

/// Yaw rate of a straight course, relative to that with the steering hard over.
const STRAIGHT: f64 = 1e-7;

impl Approach {
    /// The approach of a simulation of a model, or of a member of its ensemble or committee.
    ///
    /// Blocks of simulation bring the speed to its steady value. In each block, the steering is such that the yaw rate is zero
    /// at its end as at its start, also for a vessel that is not directionally stable; it is found by the rule of false
    /// position (Illinois variant).
    ///
    /// A vessel that no input pushes, as one whose shaft speed was constant in the logs, has one steady speed.
    ///
    /// # Errors
    /// If the vessel has no such speed, does not move ahead, cannot hold a straight course, or diverges, and if the model is not
    /// valid at this speed.
    pub fn new(
        model: &Model,
        map: &InputMap,
        simulation: Simulation,
        options: &Options,
    ) -> Result<Self, ManoeuvreError> {
        let found = Self::find(model, map, simulation, options)?;
        if let Some(reason) = found.simulation.not_valid() {
            return Err(ManoeuvreError::NotValid { reason });
        }
        // An input that pushes and turns, such as a thruster, may add to the push when it turns.
        let is_apart = map.push.iter().zip(&map.turn).all(|(push, turn)| *push == 0.0 || *turn == 0.0);
        let simulation = if is_apart { found.simulation.after_approach() } else { found.simulation };
        Ok(Self { simulation, ..found })
    }

    fn find(
        model: &Model,
        map: &InputMap,
        simulation: Simulation,
        options: &Options,
    ) -> Result<Self, ManoeuvreError> {
        let most = [-1.0, 1.0].map(|side| side * map.seen_over(model, side));
        let mut search = Search { simulation, map, most, start: crate::plant::middle(model) };
        if let Some(reason) = map.no_propulsion() {
            let found = search.at_propulsion(0.0)?;
            let own_m_s = found.speed_m_s;
            return match options.speed_m_s {
                Some(speed_m_s) if (speed_m_s / own_m_s - 1.0).abs() <= SAME_SPEED => Ok(found),
                Some(speed_m_s) => Err(ManoeuvreError::OwnSpeed { speed_m_s, own_m_s, reason }),
                None => Ok(found),
            };
        }
        let Some(speed) = options.speed_m_s else { return search.at_propulsion(options.propulsion) };
        // Secant method on the propulsion, from the slowest steady speed ahead. A speed order may never be zero.
        let middle = search.start.clone();
        let mut from = [0.0, 0.0];
        for p in [-map.astern(), 0.0] {
            search.start.clone_from(&middle);
            if let Ok(found) = search.at_propulsion(p) {
                from = [p, found.speed_m_s];
                break;
            }
        }
        search.start = middle;
        let mut high = search.at_propulsion(1.0)?;
        let mut to = [1.0, high.speed_m_s];
        if !(speed > 0.0 && (from[1]..=to[1]).contains(&speed)) {
            return Err(ManoeuvreError::Speed { speed_m_s: speed, low_m_s: from[1], high_m_s: to[1] });
        }
        for _ in 0..60 {
            if (high.speed_m_s - speed).abs() <= 1e-6 * speed {
                break;
            }
            let share = ((speed - from[1]) / (to[1] - from[1])).clamp(0.02, 0.98);
            let between = from[0] + share * (to[0] - from[0]);
            high = search.at_propulsion(between)?;
            if high.speed_m_s < speed {
                from = [between, high.speed_m_s];
            } else {
                to = [between, high.speed_m_s];
            }
        }
        Ok(high)
    }
}

struct Search<'a> {
    simulation: Simulation,
    map: &'a InputMap,
    /// Steering to port and to starboard in which the straight course is searched for: the model was seen there.
    most: [f64; 2],
    /// Outputs from which the next search starts.
    start: Vec<f64>,
}

impl Search<'_> {
    /// Alternates blocks of simulation on a straight course and searches for the steering, until the speed is steady.
    fn at_propulsion(&mut self, p: f64) -> Result<Approach, ManoeuvreError> {
        let mut settling = Settling::from(self.simulation.surge_of(&self.start));
        for _ in 0..MOST_BLOCKS {
            let steering = self.straight(p)?;
            self.block(p, steering)?;
            let [u, v, _] = self.simulation.nu();
            let longest = LONGEST_JUMP * (u - self.simulation.surge_of(&self.start)).abs();
            let rest = settling.update(u);
            if rest.abs() <= STEADY * u.abs().max(1e-3) {
                if u <= 0.0 {
                    return Err(ManoeuvreError::NotAhead { speed_m_s: u });
                }
                let mut simulation = self.simulation.clone();
                simulation.place([0.0; 3]);
                return Ok(Approach { simulation, propulsion: p, steering, speed_m_s: u.hypot(v) });
            }
            self.start.copy_from_slice(self.simulation.outputs());
            // The search goes on from the expected limit.
            let jump = if rest.is_finite() { rest.clamp(-longest, longest) } else { 0.0 };
            if jump != 0.0 {
                settling = Settling::from(u + jump);
            }
            self.simulation.on_course(&mut self.start, u + jump);
        }
        Err(ManoeuvreError::Unsteady {
            t_s: (MOST_BLOCKS * BLOCK) as f64 * self.simulation.dt(),
            speed_m_s: self.simulation.nu()[0],
            yaw_deg_s: self.simulation.nu()[2].to_degrees(),
        })
    }

    /// Simulates a block from the start.
    fn block(&mut self, p: f64, s: f64) -> Result<(), ManoeuvreError> {
        let command = self.map.command(p, s);
        self.simulation.start([0.0; 3], &self.start, &command);
        for _ in 0..BLOCK {
            self.simulation.advance(&command);
        }
        Ok(self.simulation.check()?)
    }

    /// Yaw rate after a block.
    fn yaw_rate(&mut self, p: f64, s: f64) -> Result<f64, ManoeuvreError> {
        self.block(p, s)?;
        Ok(self.simulation.nu()[2])
    }

    /// Steering of a straight course.
    fn straight(&mut self, p: f64) -> Result<f64, ManoeuvreError> {
        let [hard_port, hard_starboard] = self.most;
        let (port, starboard) = (self.yaw_rate(p, hard_port)?, self.yaw_rate(p, hard_starboard)?);
        if !(port < 0.0 && starboard > 0.0) {
            let speed_m_s = self.simulation.nu()[0];
            let [low_deg_s, high_deg_s] = [port, starboard].map(f64::to_degrees);
            return Err(ManoeuvreError::NoStraightCourse { speed_m_s, low_deg_s, high_deg_s });
        }
        let tolerance = STRAIGHT * (starboard - port);
        let neutral = self.yaw_rate(p, 0.0)?;
        if neutral.abs() <= tolerance {
            return Ok(0.0);
        }
        let (mut a, mut fa) = (0.0, neutral);
        let (mut b, mut fb) = if neutral < 0.0 { (hard_starboard, starboard) } else { (hard_port, port) };
        let mut last = 0.0_f64;
        for _ in 0..200 {
            let s = (a * fb - b * fa) / (fb - fa);
            let f = self.yaw_rate(p, s)?;
            if f.abs() <= tolerance || (b - a).abs() < 1e-12 {
                return Ok(s);
            }
            if f.signum() == fa.signum() {
                (a, fa) = (s, f);
                if last < 0.0 {
                    fb *= 0.5;
                }
                last = -1.0;
            } else {
                (b, fb) = (s, f);
                if last > 0.0 {
                    fa *= 0.5;
                }
                last = 1.0;
            }
        }
        Ok(a)
    }
}
