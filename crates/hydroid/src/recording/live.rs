//! A recording that is still being written: motion and inputs of a vessel from rows of topics while they arrive.

use std::f64::consts::{PI, TAU};

use hydroid_core::control::{DeadReckoning, longest_age_s};
use hydroid_core::navigation::{Filter, Prior, State};

use super::instruments::{CURRENT_M_S, UNITS, local_step};
use super::known::{self, Placed};
use super::motion::usual;
use crate::log::line::Source;
use crate::log::{self, ChannelSpec, LogError, RawColumn, RawLog, Selection, Sensors};
use crate::navigate::{self, Event, Kind, Row, Sensor, Statistics};

/// Longest time \[s\] over which a motion is predicted without measurements.
const LONGEST_S: f64 = 60.0;

/// A longer time between two measurements counts as this multiple of the usual one in its mean.
const LONGEST_STEP: f64 = 4.0;

/// The topics of a link.
#[derive(Clone, Debug)]
pub struct LiveTopics {
    header: RawLog,
    /// Topic and field of each column.
    places: Vec<(usize, usize)>,
}

/// Where the value of a channel comes from.
#[derive(Clone, Debug)]
pub struct LiveColumn {
    /// Index of the topic.
    pub topic: usize,
    /// Index of the field.
    pub field: usize,
    /// Name of the column.
    pub name: String,
    /// Conversion to SI units.
    pub source: Source,
}

impl LiveColumn {
    /// SI value of the row of a topic; `None` for rows of other topics, NaN where a row has no value.
    fn of(&self, topic: usize, values: &[f64]) -> Option<f64> {
        (topic == self.topic).then(|| self.source.si(values.get(self.field).copied().unwrap_or(f64::NAN)))
    }
}

impl LiveTopics {
    /// Topics with their fields and units; the unit of a pure number is empty.
    pub fn new<'a, F>(name: &str, topics: impl IntoIterator<Item = (&'a str, F)>) -> Self
    where
        F: IntoIterator<Item = (&'a str, &'a str)>,
    {
        let (mut columns, mut places) = (Vec::new(), Vec::new());
        for (topic, (of, fields)) in topics.into_iter().enumerate() {
            for (field, (name, unit)) in fields.into_iter().enumerate() {
                let unit = Some(unit).filter(|unit| !unit.is_empty());
                columns.push(RawColumn::of(&format!("{of}.{name}"), unit, Vec::new()));
                places.push((topic, field));
            }
        }
        Self { header: RawLog::without_rows(name, columns), places }
    }

    /// The column that a specification names.
    ///
    /// # Errors
    /// If there is none, or its unit is unknown.
    pub fn column(&self, spec: &ChannelSpec) -> Result<LiveColumn, LogError> {
        let source = log::channel(&self.header, spec, &mut Vec::new())?;
        let (topic, field) = self.places[source.column];
        Ok(LiveColumn { topic, field, name: self.header.columns[source.column].name.clone(), source })
    }
}

/// A sensor of a link: its columns, and what is seen of it.
struct Instrument {
    name: &'static str,
    /// Kind, or `None` for the quality of the position.
    kind: Option<Kind>,
    columns: Vec<LiveColumn>,
    /// Whether the first two columns are speed and course.
    polar: bool,
    /// Whether the first two columns are latitude and longitude.
    geographic: bool,
}

/// What is seen of a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorHealth {
    /// Name.
    pub name: &'static str,
    /// Index of its topic.
    pub topic: usize,
    /// Names of its columns.
    pub columns: String,
    /// Time of the last measurement \[s\]; NaN before it.
    pub last: f64,
    /// Time of the last measurement that agreed with the other sensors \[s\]: of a heading, that turned as the yaw rate
    /// says; NaN before it.
    pub agreed: f64,
    /// Usual time between measurements \[s\]; NaN before the second one.
    pub step: f64,
    /// Share of outliers among the last hundred measurements.
    pub outliers: f64,
}

impl SensorHealth {
    /// Whether no measurement has agreed for longer than `max_age_s`, by default the longest age of
    /// [its steps](longest_age_s), as those of a compass that is frozen or has jumped.
    pub fn contradicts(&self, max_age_s: Option<f64>) -> bool {
        self.last - self.agreed > max_age_s.unwrap_or_else(|| longest_age_s(self.step))
    }
}

/// Motion of a vessel from the rows of a link in the order of their arrival: the filter of [`hydroid_core::navigation`].
///
/// With [known](Sensors::known) sensors it has their statistics. Otherwise they are those of usual sensors of a boat, and
/// the motion is [provisional](Self::is_provisional).
pub struct LiveMotion {
    instruments: Vec<Instrument>,
    health: Vec<SensorHealth>,
    sensors: Sensors,
    placed: Vec<Placed>,
    statistics: Statistics,
    filter: Option<Filter>,
    turning: Turning,
    /// Time of the filter \[s\].
    t: f64,
    /// First values: position, velocity, heading.
    first: [Option<[f64; 2]>; 3],
    quality: Option<f64>,
    /// The last position, geographic \[rad\], and as north and east of the first \[m\].
    last_fix: Option<([f64; 2], [f64; 2])>,
    /// The first position \[deg\].
    origin_deg: Option<[f64; 2]>,
}

/// The column of a sensor.
fn column(
    topics: &LiveTopics,
    name: &str,
    spec: Option<&ChannelSpec>,
) -> Result<Option<LiveColumn>, LogError> {
    let Some(spec) = spec else { return Ok(None) };
    let column = topics.column(spec)?;
    let si = UNITS.iter().find(|(of, _)| *of == name).map_or("", |(_, unit)| unit);
    let found = &column.source.channel.unit;
    if found.is_empty() && (name == "latitude" || name == "longitude") {
        return topics.column(&ChannelSpec { unit: Some("deg".to_owned()), ..spec.clone() }).map(Some);
    }
    if !found.is_empty() && !si.is_empty() && found != si {
        return Err(LogError::Unusable {
            path: topics.header.path.clone(),
            reason: format!("the {name} `{}` is in {found}, which is not a unit of {si}", spec.column),
            remedy: format!("name another column, or state the unit: {name} = \"{} [{si}]\"", spec.column),
        });
    }
    Ok(Some(column))
}

/// A sensor with the names and specifications of its columns.
type Named<'a> = (Option<Kind>, &'a [(&'static str, &'a Option<ChannelSpec>)]);

/// The sensors of a link. The quality comes before the position of the same row.
fn instruments(topics: &LiveTopics, sensors: &Sensors) -> Result<Vec<Instrument>, LogError> {
    let s = sensors;
    let all: [Named<'_>; 8] = [
        (None, &[("quality", &s.quality)]),
        (Some(Kind::Position), &[("latitude", &s.latitude), ("longitude", &s.longitude)]),
        (Some(Kind::Position), &[("north", &s.north), ("east", &s.east)]),
        (Some(Kind::Velocity), &[("speed", &s.speed), ("course", &s.course)]),
        (Some(Kind::Velocity), &[("velocity_north", &s.velocity_north), ("velocity_east", &s.velocity_east)]),
        (Some(Kind::Heading), &[("heading", &s.heading)]),
        (Some(Kind::YawRate), &[("yaw_rate", &s.yaw_rate)]),
        (
            Some(Kind::SpecificForce),
            &[
                ("acceleration_forward", &s.acceleration_forward),
                ("acceleration_starboard", &s.acceleration_starboard),
            ],
        ),
    ];
    let unusable = |reason: String, remedy: &str| LogError::Unusable {
        path: topics.header.path.clone(),
        reason,
        remedy: remedy.to_owned(),
    };
    let mut instruments: Vec<Instrument> = Vec::new();
    for (kind, named) in all {
        let mut columns = Vec::new();
        for (name, spec) in named {
            columns.extend(column(topics, name, spec.as_ref())?);
        }
        if columns.is_empty() {
            continue;
        }
        if columns.len() < named.len() || columns.iter().any(|column| column.topic != columns[0].topic) {
            let names = named.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" and ");
            return Err(unusable(
                format!("{names} are needed together, from one topic"),
                "name both in the section [log.sensors], or neither",
            ));
        }
        let (polar, geographic) = (named[0].0 == "speed", named[0].0 == "latitude");
        let name = match kind {
            Some(Kind::Position) => "position",
            Some(Kind::Velocity) => "velocity",
            Some(Kind::SpecificForce) => "accelerations",
            Some(Kind::YawRate) => "yaw rate",
            _ => named[0].0,
        };
        instruments.push(Instrument { name, kind, columns, polar, geographic });
    }
    let has = |kind| instruments.iter().any(|one| one.kind == Some(kind));
    if !has(Kind::Position) || !has(Kind::Heading) {
        return Err(unusable(
            "a position and a heading are needed".to_owned(),
            "name their columns in the section [log.sensors], such as latitude, longitude and heading",
        ));
    }
    Ok(instruments)
}

impl LiveMotion {
    /// The sensors that a selection names.
    ///
    /// # Errors
    /// If a column does not exist, or position and heading are not both measured.
    pub fn new(topics: &LiveTopics, sensors: &Sensors) -> Result<Self, LogError> {
        let instruments = instruments(topics, sensors)?;
        let qualities: Vec<f64> = match &sensors.known {
            Some(known) => {
                known::check(known, &topics.header.path)?;
                known.position.iter().filter_map(|(quality, _)| *quality).collect()
            }
            None => Vec::new(),
        };
        let placed = known::placed(sensors, &qualities);
        let all: Vec<Sensor> = placed.iter().map(|placed| placed.sensor.clone()).collect();
        let noise = sensors.known.as_ref().map_or_else(|| usual(BOAT_RAD_S), |known| known.noise);
        let statistics = Statistics { noise, ..known::usual(&all) };
        let health = instruments
            .iter()
            .map(|one| SensorHealth {
                name: one.name,
                topic: one.columns[0].topic,
                columns: one.columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(", "),
                last: f64::NAN,
                agreed: f64::NAN,
                step: f64::NAN,
                outliers: 0.0,
            })
            .collect();
        Ok(Self {
            instruments,
            health,
            turning: Turning::new(),
            sensors: sensors.clone(),
            placed,
            statistics,
            filter: None,
            t: f64::NAN,
            first: [None; 3],
            quality: None,
            last_fix: None,
            origin_deg: None,
        })
    }

    /// Takes other sensors of the same vessel, or what is known of them now. Place and motion go on.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn change_sensors(&mut self, topics: &LiveTopics, sensors: &Sensors) -> Result<(), LogError> {
        let mut changed = Self::new(topics, sensors)?;
        (changed.origin_deg, changed.last_fix) = (self.origin_deg, self.last_fix);
        for health in &mut changed.health {
            let same = |other: &&SensorHealth| other.columns == health.columns;
            if let Some(known) = self.health.iter().find(same) {
                *health = known.clone();
            }
        }
        if let (Some(row), Some((_, current, _))) = (self.at(self.t), self.uncertainty()) {
            changed.begin_at(self.t, row.pose, row.water[0], current);
        }
        *self = changed;
        Ok(())
    }

    /// Whether the statistics of the sensors are those of usual ones.
    pub fn is_provisional(&self) -> bool {
        self.sensors.known.is_none()
    }

    /// The first position, latitude and longitude \[deg\], from which north and east count.
    pub fn origin_deg(&self) -> Option<[f64; 2]> {
        self.origin_deg
    }

    /// What is seen of each sensor.
    pub fn health(&self) -> &[SensorHealth] {
        &self.health
    }

    /// Whether position and heading are recent enough at a time \[s\] for commands: none is older than `max_age_s`, by default
    /// that of [its steps](longest_age_s). The positions since `set_aside` are not used, and a heading is none
    /// while it [contradicts](Self::is_contradicted) the yaw rate.
    pub fn is_fresh(&self, t: f64, max_age_s: Option<f64>, set_aside: Option<f64>) -> bool {
        let is_fresh = |kind: Kind, until: f64| {
            let at = self.instruments.iter().position(|one| one.kind == Some(kind));
            at.is_some_and(|at| {
                let health = &self.health[at];
                let limit = max_age_s.unwrap_or_else(|| longest_age_s(health.step));
                t - health.last <= limit && t - until <= limit
            })
        };
        is_fresh(Kind::Position, set_aside.unwrap_or(f64::INFINITY))
            && is_fresh(Kind::Heading, f64::INFINITY)
            && !self.is_contradicted(max_age_s)
    }

    /// Whether compass and gyro [contradict](SensorHealth::contradicts) each other.
    pub fn is_contradicted(&self, max_age_s: Option<f64>) -> bool {
        self.health.iter().any(|health| health.contradicts(max_age_s))
    }

    /// Time of the estimate \[s\]; NaN before it.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// Whether rows of a topic are measurements.
    pub fn uses(&self, topic: usize) -> bool {
        self.instruments.iter().any(|one| one.columns.iter().any(|column| column.topic == topic))
    }

    /// Takes the row of a topic at a time \[s\]. Measurements that are older than the last one count as of its time.
    pub fn row(&mut self, topic: usize, t: f64, values: &[f64]) {
        if !t.is_finite() {
            return;
        }
        let mut is_fix = true;
        for i in 0..self.instruments.len() {
            let one = &self.instruments[i];
            // A position that came twice is one measurement.
            if one.kind.is_some() && t == self.health[i].last {
                continue;
            }
            let mut value = [0.0; 2];
            let mut complete = true;
            for (to, column) in value.iter_mut().zip(&one.columns) {
                match column.of(topic, values) {
                    Some(x) if x.is_finite() => *to = x,
                    _ => complete = false,
                }
            }
            if !complete {
                continue;
            }
            let Some(kind) = one.kind else {
                self.quality = Some(value[0]);
                continue;
            };
            if !is_fix && kind == Kind::Velocity {
                continue;
            }
            if one.polar {
                value = [value[0] * value[1].cos(), value[0] * value[1].sin()];
            }
            if one.geographic {
                let Some(place) = self.place(value) else {
                    is_fix = false;
                    continue;
                };
                value = place;
            }
            self.turning.take(kind, t, value[0]);
            let outlier = self.measure(kind, t, value);
            let health = &mut self.health[i];
            let step = t - health.last;
            if step > 0.0 {
                // A gap is not a usual step: old positions would be trusted for longer after it.
                let usual = health.step;
                health.step = if usual.is_nan() {
                    step
                } else {
                    usual + 0.1 * (step.min(LONGEST_STEP * usual) - usual)
                };
            }
            if step.is_nan() || step > 0.0 {
                health.last = t;
            }
            if self.instruments[i].kind != Some(Kind::Heading) || self.turning.agrees() {
                health.agreed = t;
            }
            health.outliers += 0.01 * (f64::from(u8::from(outlier)) - health.outliers);
        }
    }

    /// North and east of the first fix \[m\]; `None` for what is not a fix.
    fn place(&mut self, fix: [f64; 2]) -> Option<[f64; 2]> {
        // Receivers without a fix write zeros.
        let is_fix = fix[0].abs() <= PI / 2.0 && fix[1].abs() <= TAU && fix != [0.0; 2];
        if !is_fix {
            return None;
        }
        let place = match self.last_fix {
            None => [0.0; 2],
            Some((last, place)) => {
                let [north, east] = local_step(last, fix);
                [place[0] + north, place[1] + east]
            }
        };
        self.origin_deg.get_or_insert(fix.map(f64::to_degrees));
        self.last_fix = Some((fix, place));
        Some(place)
    }

    /// Updates the filter; true for an outlier.
    fn measure(&mut self, kind: Kind, t: f64, value: [f64; 2]) -> bool {
        let slot = match kind {
            Kind::Position => Some(0),
            Kind::Velocity => Some(1),
            Kind::Heading => Some(2),
            _ => None,
        };
        if let Some(slot) = slot {
            self.first[slot].get_or_insert(value);
        }
        let Some(filter) = &mut self.filter else {
            self.begin(t);
            return false;
        };
        let of_kind = |placed: &&(usize, &Placed)| placed.1.sensor.kind == kind;
        let of_quality =
            |placed: &&(usize, &Placed)| placed.1.quality.is_none() || placed.1.quality == self.quality;
        let all: Vec<(usize, &Placed)> = self.placed.iter().enumerate().filter(|p| of_kind(&p)).collect();
        // A quality that was never seen counts as the last one.
        let Some(&(sensor, _)) = all.iter().find(of_quality).or(all.last()) else { return false };
        let dt = t - self.t;
        if dt > 0.0 {
            filter.predict(dt.min(LONGEST_S));
            self.t = t;
        }
        let sensors: Vec<Sensor> = self.placed.iter().map(|placed| placed.sensor.clone()).collect();
        let event = Event { t, sensor, value };
        let mut outlier = false;
        filter.update(&self.statistics.measurement(&sensors, &event), |update| {
            outlier |= update.innovation.is_outlier();
        });
        if !filter.estimate().mean.iter().all(|x| x.is_finite()) {
            self.filter = None;
            self.first = [None; 3];
        }
        outlier
    }

    /// Begins when position and heading are known.
    fn begin(&mut self, t: f64) {
        let [Some(position), velocity, Some(heading)] = self.first else { return };
        let heading = heading[0];
        let (sine, cosine) = heading.sin_cos();
        let [forward, starboard, _] = self.sensors.antenna_m;
        let speed = velocity.map_or(0.0, |v| v[0] * cosine + v[1] * sine);
        let north = position[0] - (cosine * forward - sine * starboard);
        let east = position[1] - (sine * forward + cosine * starboard);
        self.begin_at(t, [north, east, heading], speed, [0.0; 2]);
    }

    /// Begins at a pose of the origin of the body frame, a surge velocity through the water, and a current.
    fn begin_at(&mut self, t: f64, [north, east, heading]: [f64; 3], speed: f64, current: [f64; 2]) {
        let mut prior = Prior::default()
            .with(State::Heading, heading, 0.1)
            .with(State::Surge, speed, 2.0)
            .with(State::North, north, 10.0)
            .with(State::East, east, 10.0)
            .with(State::CurrentNorth, current[0], CURRENT_M_S)
            .with(State::CurrentEast, current[1], CURRENT_M_S);
        if let Some(known) = &self.sensors.known {
            prior = known::prior(known, &prior);
        }
        self.filter = Some(Filter::new(self.statistics.noise, &prior, Filter::OUTLIER));
        self.t = t;
    }

    /// The motion at a time \[s\] from the measurements so far; `None` before the first ones.
    pub fn at(&self, t: f64) -> Option<Row> {
        let mut filter = self.filter.clone()?;
        let dt = t - self.t;
        if dt > 0.0 {
            filter.predict(dt.min(LONGEST_S));
        }
        Some(navigate::filtered(t, filter.estimate()))
    }

    /// Standard deviation of the position \[m\], and the current to the north and east \[m/s\] with its standard deviation.
    pub fn uncertainty(&self) -> Option<(f64, [f64; 2], f64)> {
        let estimate = self.filter.as_ref()?.estimate();
        let position = (0.5 * (estimate.variance(State::North) + estimate.variance(State::East))).sqrt();
        let current = [State::CurrentNorth, State::CurrentEast];
        let deviation = current.map(|state| estimate.variance(state)).into_iter().fold(0.0, f64::max).sqrt();
        Some((position, current.map(|state| estimate.get(state)), deviation))
    }
}

/// A heading that is integrated from the yaw rate beside the measured one.
struct Turning {
    reckoning: DeadReckoning,
    t: f64,
    rate: f64,
}

impl Turning {
    fn new() -> Self {
        // The position is not integrated: its speed does not count.
        Self { reckoning: DeadReckoning::new(1.0, TURNING_S), t: f64::NAN, rate: f64::NAN }
    }

    /// Takes a measurement.
    fn take(&mut self, kind: Kind, t: f64, value: f64) {
        let heading = match kind {
            Kind::YawRate => f64::NAN,
            Kind::Heading if !self.rate.is_nan() => value,
            _ => return,
        };
        let elapsed = t - self.t;
        if elapsed.is_nan() || elapsed > LONGEST_S || self.reckoning.is_unsettled() {
            self.reckoning.reset();
        }
        self.reckoning.take(elapsed.max(0.0), [0.0, 0.0, self.rate], &mut [f64::NAN, f64::NAN, heading]);
        self.t = self.t.max(t);
        if kind == Kind::YawRate {
            self.rate = value;
        }
    }

    fn agrees(&self) -> bool {
        let [_, off] = self.reckoning.off();
        off == 0.0
    }
}

/// Time constant of the integrated heading \[s\]: a bias of the gyro of a degree per second is 10 deg.
const TURNING_S: f64 = 10.0;

/// Frequency of the waves \[rad/s\] that moves a boat whose sensors are not known yet.
const BOAT_RAD_S: f64 = 2.0;

/// The inputs of a model along a link: means of the held commands over the steps, then wind as the product of its squared
/// speed with cosine and sine of its direction.
pub struct LiveInputs {
    columns: Vec<LiveColumn>,
    wind: Option<[LiveColumn; 2]>,
    held: Vec<f64>,
    /// Integral of each command since `from`, up to `until`.
    sums: Vec<f64>,
    from: f64,
    until: f64,
    wind_now: [f64; 2],
}

impl LiveInputs {
    /// The inputs that a selection names.
    ///
    /// # Errors
    /// If a column does not exist.
    pub fn new(topics: &LiveTopics, selection: &Selection) -> Result<Self, LogError> {
        let named = selection.inputs.iter().filter(|spec| spec.column != "none");
        let columns = named.map(|spec| topics.column(spec)).collect::<Result<Vec<_>, _>>()?;
        let wind = match &selection.wind {
            Some(wind) => Some([topics.column(&wind.speed)?, topics.column(&wind.direction)?]),
            None => None,
        };
        let n = columns.len();
        Ok(Self {
            columns,
            wind,
            held: vec![f64::NAN; n],
            sums: vec![0.0; n],
            from: f64::NAN,
            until: f64::NAN,
            wind_now: [f64::NAN; 2],
        })
    }

    /// Columns of the inputs without wind.
    pub fn columns(&self) -> &[LiveColumn] {
        &self.columns
    }

    /// The commands in force; NaN before the first.
    pub fn held(&self) -> &[f64] {
        &self.held
    }

    /// Takes the row of a topic at a time \[s\].
    pub fn row(&mut self, topic: usize, t: f64, values: &[f64]) {
        if self.columns.iter().any(|column| column.topic == topic) {
            self.advance(t);
        }
        for (held, column) in self.held.iter_mut().zip(&self.columns) {
            if let Some(value) = column.of(topic, values).filter(|value| value.is_finite()) {
                *held = value;
            }
        }
        if let Some([speed, direction]) = &self.wind {
            for (now, column) in self.wind_now.iter_mut().zip([speed, direction]) {
                *now = column.of(topic, values).unwrap_or(*now);
            }
        }
    }

    fn advance(&mut self, t: f64) {
        let dt = t - self.until;
        if dt > 0.0 {
            for (sum, held) in self.sums.iter_mut().zip(&self.held) {
                *sum += dt * held;
            }
            self.until = t;
        } else if self.until.is_nan() {
            (self.from, self.until) = (t, t);
        }
    }

    /// Means since the last call up to a time \[s\]; the values in force at the first one. NaN is unknown.
    pub fn take(&mut self, t: f64, into: &mut Vec<f64>) {
        self.advance(t);
        into.clear();
        let duration = self.until - self.from;
        for (sum, held) in self.sums.iter_mut().zip(&self.held) {
            let mean = *sum / duration;
            into.push(if duration > 0.0 && mean.is_finite() { mean } else { *held });
            *sum = 0.0;
        }
        self.from = self.until;
        if self.wind.is_some() {
            let [speed, direction] = self.wind_now;
            into.extend([speed * speed * direction.cos(), speed * speed * direction.sin()]);
        }
    }
}
