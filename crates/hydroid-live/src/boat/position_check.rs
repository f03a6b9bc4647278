//! Test of each position against where speed and heading have led, before it is used.
//!
//! The filter of the motion gives outliers less weight, and never none: it follows a position that jumps and stays, and
//! the geofence, which is judged by the estimate, moves with the error. Therefore a position outside of a gate around the
//! prediction is not used (validation gate: Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation*, 2001, section 5.4), and commands end as without a position. Because the prediction gets worse without
//! positions, those that stay outside of the gate are used after a while, as ArduPilot's filter does.
//!
//! While commands push the vessel, a position that [repeats](Repeats) is stuck.

use hydroid::log::{LogError, Sensors};
use hydroid::recording::{LiveColumn, LiveMotion, LiveTopics};

use hydroid::closed_loop::{Repeats, local_position};

/// Half width of the gate \[m\], to which standard deviations of the predicted position are added. Usual errors of a
/// receiver without corrections are smaller.
const GATE_M: f64 = 10.0;
const DEVIATIONS: f64 = 4.0;

/// Positions outside of the gate are not used for this time \[s\].
const UNUSED_S: f64 = 10.0;

/// A position that is outside of the gate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jump {
    /// Time of the first position outside of the gate \[s\].
    pub(super) since: f64,
    /// Distance of the last one from the prediction \[m\].
    pub(super) distance: f64,
}

/// The test, for one vessel.
pub(super) struct PositionCheck {
    columns: [LiveColumn; 2],
    is_geographic: bool,
    /// Place of the antenna forward and to starboard \[m\].
    antenna_m: [f64; 2],
    jump: Option<Jump>,
    repeats: Repeats,
    /// Time of the last fix \[s\].
    last: Option<f64>,
}

impl PositionCheck {
    /// The test of the position that sensors name; `None` if they name none.
    pub(super) fn new(topics: &LiveTopics, sensors: &Sensors) -> Result<Option<Self>, LogError> {
        let [ahead, starboard, _] = sensors.antenna_m;
        let (is_geographic, named) = match (&sensors.latitude, &sensors.longitude) {
            (Some(latitude), Some(longitude)) => (true, [latitude, longitude]),
            _ => match (&sensors.north, &sensors.east) {
                (Some(north), Some(east)) => (false, [north, east]),
                _ => return Ok(None),
            },
        };
        let columns = [topics.column(named[0])?, topics.column(named[1])?];
        Ok(Some(Self {
            columns,
            is_geographic,
            antenna_m: [ahead, starboard],
            jump: None,
            repeats: Repeats::default(),
            last: None,
        }))
    }

    /// The last position, if it is outside of the gate.
    pub(super) fn jump(&self) -> Option<Jump> {
        self.jump
    }

    /// Time for which the position has not changed \[s\], if it is stuck under commands that have pushed the vessel since a time \[s\].
    pub(super) fn stuck_s(&self, pushing_since: f64) -> Option<f64> {
        self.repeats.stuck_s(self.last? - pushing_since)
    }

    /// Takes a fix into account for [`stuck_s`](Self::stuck_s).
    fn repeat(&mut self, t: f64, values: &[f64]) {
        let fix = [0, 1].map(|k| values.get(self.columns[k].field).copied().unwrap_or(f64::NAN));
        if fix.iter().all(|x| !x.is_nan()) {
            let elapsed = t - self.last.unwrap_or(t);
            if elapsed < 0.0 {
                self.repeats = Repeats::default();
            }
            self.repeats.take(elapsed, fix);
            self.last = Some(t);
        }
    }

    /// Tests the row of a topic at a time \[s\]; the answer is what takes its place if its position is not to be used.
    pub(super) fn test(
        &mut self,
        topic: usize,
        t: f64,
        values: &[f64],
        motion: &LiveMotion,
    ) -> Option<Vec<f64>> {
        if self.columns.iter().any(|column| column.topic != topic) {
            return None;
        }
        self.repeat(t, values);
        let distance = self.distance(t, values, motion)?;
        let (deviation, ..) = motion.uncertainty()?;
        if distance <= GATE_M + DEVIATIONS * deviation {
            self.jump = None;
            return None;
        }
        let since = self.jump.map_or(t, |jump| jump.since.min(t));
        self.jump = Some(Jump { since, distance });
        if t - since > UNUSED_S {
            return None;
        }
        let mut values = values.to_vec();
        self.columns.iter().for_each(|column| values[column.field] = f64::NAN);
        Some(values)
    }

    /// Distance of a position from the prediction \[m\]; `None` where one of them is not known.
    fn distance(&self, t: f64, values: &[f64], motion: &LiveMotion) -> Option<f64> {
        let [mut north, mut east] = [0, 1].map(|k| {
            let column = &self.columns[k];
            values.get(column.field).map_or(f64::NAN, |value| column.source.si(*value))
        });
        if self.is_geographic {
            [north, east] = local_position(motion.origin_deg()?, [north.to_degrees(), east.to_degrees()])?;
        }
        let [at_north, at_east, psi] = motion.at(t)?.pose;
        let ([ahead, starboard], (sine, cosine)) = (self.antenna_m, psi.sin_cos());
        north -= at_north + ahead * cosine - starboard * sine;
        east -= at_east + ahead * sine + starboard * cosine;
        Some(north.hypot(east)).filter(|distance| distance.is_finite())
    }
}
