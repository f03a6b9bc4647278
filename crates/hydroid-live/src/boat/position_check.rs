//! Test of each position against where speed and heading have led, before it is used.
//!
//! The filter of the motion gives outliers less weight, and never none: it follows a position that jumps and stays, and
//! the geofence, which is judged by the estimate, moves with the error. Therefore a position outside of a gate around the
//! prediction is not used (validation gate: Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation*, 2001, section 5.4), and commands end as without a position. Because the prediction gets worse without
//! positions, those that stay outside of the gate are used after a while, as ArduPilot's filter does.
//!
//! A receiver that freezes repeats its last fix to the last digit, which noise does not let a working one do. While commands push the
//! vessel, such a position is stuck after [`STUCK_S`] and four times the usual time between changes.

use hydroid::log::{LogError, Sensors};
use hydroid::recording::{LiveColumn, LiveMotion, LiveTopics};

use hydroid::closed_loop::local_position;

/// Half width of the gate \[m\], to which standard deviations of the predicted position are added. Usual errors of a
/// receiver without corrections are smaller.
const GATE_M: f64 = 10.0;
const DEVIATIONS: f64 = 4.0;

/// Positions outside of the gate are not used for this time \[s\].
const UNUSED_S: f64 = 10.0;

/// Shortest time without a change after which a position is stuck \[s\].
const STUCK_S: f64 = 3.0;
const CHANGES: f64 = 4.0;
/// Longest time between changes that counts as usual \[s\], and the share of the newest one in the mean.
const LONGEST_S: f64 = 5.0;
const NEWEST: f64 = 0.2;

/// Fixes that are the same to the last digit.
#[derive(Clone, Copy, Debug)]
struct Repeated {
    values: [f64; 2],
    /// Times of the first and the last one \[s\].
    since: f64,
    until: f64,
    /// Usual time between changes \[s\].
    usual: f64,
}

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
    repeated: Option<Repeated>,
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
        Ok(Some(Self { columns, is_geographic, antenna_m: [ahead, starboard], jump: None, repeated: None }))
    }

    /// The last position, if it is outside of the gate.
    pub(super) fn jump(&self) -> Option<Jump> {
        self.jump
    }

    /// Time for which the position has not changed \[s\], if it is stuck under commands that have pushed the vessel since a time \[s\].
    pub(super) fn stuck_s(&self, pushing_since: f64) -> Option<f64> {
        let Repeated { since, until, usual, .. } = self.repeated?;
        let same_s = until - since.max(pushing_since);
        (same_s > STUCK_S.max(CHANGES * usual)).then_some(same_s)
    }

    /// Takes a fix into account for [`stuck_s`](Self::stuck_s).
    fn repeat(&mut self, t: f64, values: &[f64]) {
        let fix = [0, 1].map(|k| values.get(self.columns[k].field).copied().unwrap_or(f64::NAN));
        if fix.iter().any(|x| x.is_nan()) {
            return;
        }
        self.repeated = Some(match self.repeated {
            Some(last) if last.values == fix => Repeated { until: t.max(last.until), ..last },
            Some(last) => {
                let lasted = (t - last.since).clamp(0.0, LONGEST_S);
                let usual = last.usual + NEWEST * (lasted - last.usual);
                Repeated { values: fix, since: t, until: t, usual }
            }
            None => Repeated { values: fix, since: t, until: t, usual: 1.0 },
        });
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
