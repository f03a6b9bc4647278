//! The sensors of a recording as measurements in SI units.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use hydroid_core::navigation::{Mounting, Prior, State};
use hydroid_io::Clock;

use super::open::Recording;
use crate::key::key;
use crate::log::parts::Kept;
use crate::log::sentinel::{self, Kind as Sentinel};
use crate::log::{
    self, ChannelSpec, FASTEST_M_S, FASTEST_RAD_S, LogError, Note, RawLog, Sensors, metres_per_radian,
};
use crate::navigate::{Event, Kind, Row, Run, Sensor};

/// Inertial measurements are averaged over this time \[s\]: a vessel moves less than that, and a filter step costs the same
/// for each.
const AVERAGED_S: f64 = 0.05;
/// An angle of a full turn is not beyond it because of rounding \[rad\].
const ROUNDING_RAD: f64 = 1e-6;
/// Shortest step of a table \[s\], unless it is given.
const SHORTEST_S: f64 = 0.1;
/// Nothing is measured after this many usual steps of the slowest sensor, at least [`LONGEST_S`] seconds.
const LONGEST_STEPS: f64 = 10.0;
const LONGEST_S: f64 = 1.0;
/// Standard deviation of the components of the current before the first measurement \[m/s\].
pub(super) const CURRENT_M_S: f64 = 0.5;

/// Measurements of one sensor in SI units, in the order of time; NaN where a row has no measurement.
#[derive(Default)]
pub(super) struct Track(Vec<Event>);

impl Track {
    fn new(t: &[f64], value: impl Fn(usize) -> [f64; 2]) -> Self {
        Self(t.iter().enumerate().map(|(k, &t)| Event { t, sensor: 0, value: value(k) }).collect())
    }

    /// Times and values that are measured.
    fn measured(&self) -> impl Iterator<Item = &Event> {
        self.0.iter().filter(|event| event.value.iter().all(|x| x.is_finite()))
    }

    /// Times and first values that are measured.
    pub(super) fn pairs(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.measured().map(|event| (event.t, event.value[0]))
    }

    fn values_mut(&mut self) -> impl Iterator<Item = &mut [f64; 2]> {
        self.0.iter_mut().map(|event| &mut event.value)
    }

    fn len(&self) -> usize {
        self.measured().count()
    }

    fn step(&self) -> Option<f64> {
        log::Clock::usual_step(&self.pairs().map(|(t, _)| t).collect::<Vec<_>>())
    }

    /// Stretches of time in which one value is repeated for unusually long.
    fn repeats(&self) -> Vec<[f64; 2]> {
        let measured: Vec<&Event> = self.measured().collect();
        let blocks: Vec<&[&Event]> = measured.chunk_by(|a, b| a.value == b.value).collect();
        let mut lengths: Vec<usize> = blocks.iter().map(|block| block.len()).collect();
        lengths.sort_unstable();
        lengths.pop();
        let usual = lengths.get(lengths.len() / 2).copied().unwrap_or(0);
        let long = blocks.iter().filter(|block| block.len() > UNUSUAL * usual);
        let ends = long.map(|block| [block[0].t, block[block.len() - 1].t]);
        ends.filter(|[from, to]| to - from > STUCK_S).collect()
    }

    /// The last value at or before a time.
    fn at(&self, t: f64) -> f64 {
        let next = self.0.partition_point(|event| event.t <= t);
        next.checked_sub(1).map_or(f64::NAN, |k| self.0[k].value[0])
    }

    /// Means over steps of [`AVERAGED_S`] of a faster sensor.
    fn averaged(self) -> Self {
        if self.step().is_none_or(|step| step > 0.75 * AVERAGED_S) {
            return self;
        }
        let mut out = Vec::new();
        let (mut bin, mut sum_t, mut sum, mut n) = (f64::NAN, 0.0, [0.0; 2], 0.0);
        let end = Event { t: f64::INFINITY, sensor: 0, value: [0.0; 2] };
        for &Event { t, value, .. } in self.measured().chain([&end]) {
            let of = (t / AVERAGED_S).floor();
            if of != bin {
                if n > 0.0 {
                    // Sums of stamps since 1970 lose digits: the offset from the step is summed.
                    let t = bin * AVERAGED_S + sum_t / n;
                    out.push(Event { t, sensor: 0, value: sum.map(|sum| sum / n) });
                }
                (bin, sum_t, sum, n) = (of, 0.0, [0.0; 2], 0.0);
            }
            sum_t += t - bin * AVERAGED_S;
            sum = [sum[0] + value[0], sum[1] + value[1]];
            n += 1.0;
        }
        Self(out)
    }
}

/// Headings and positions are stuck if one value lasts for longer \[s\], in this multiple of the usual number of rows, while the vessel turns by this angle
/// \[rad\]. Its course over ground turns with it where it is faster than this \[m/s\].
const STUCK_S: f64 = 10.0;
const UNUSUAL: usize = 10;
const TURNING_RAD: f64 = 1.0;
const SAILING_M_S: f64 = 0.5;

/// Length of a leap, in steps that one in hundred exceeds.
const LEAP: f64 = 3.0;

/// Time before a position repeats, in which the vessel was sailing \[s\].
const SAILED_S: f64 = 2.0;

/// Angle between the heading and the direction of the motion on the whole that no misalignment of a compass has \[deg\].
const BESIDE_DEG: f64 = 60.0;

/// The sensors of one recording in SI units, with all times from `origin`.
pub(super) struct Instruments {
    pub(super) path: String,
    /// Time \[s\] of the first measurement.
    pub(super) origin: f64,
    pub(super) position: Option<Track>,
    pub(super) quality: Option<Track>,
    pub(super) velocity: Option<Track>,
    pub(super) heading: Option<Track>,
    pub(super) yaw_rate: Option<Track>,
    force: Option<Track>,
}

/// Quantities of sensors, as the unit of their SI values.
pub(super) const UNITS: [(&str, &str); 13] = [
    ("latitude", "rad"),
    ("longitude", "rad"),
    ("north", "m"),
    ("east", "m"),
    ("quality", ""),
    ("speed", "m/s"),
    ("course", "rad"),
    ("velocity_north", "m/s"),
    ("velocity_east", "m/s"),
    ("heading", "rad"),
    ("yaw_rate", "rad/s"),
    ("acceleration_forward", "m/s^2"),
    ("acceleration_starboard", "m/s^2"),
];

/// Leaves out the rows of a table that repeat the last fix of a slower receiver, which are no measurements of their own, and
/// gives the number of rows that a fix lasts: the median over the fixes. At rest, the receiver has a fix after as many rows, too.
fn leave_repeats(position: &mut Track, velocity: Option<&mut Track>) -> Option<usize> {
    let fix = |row: usize| position.0[row].value;
    let rows: Vec<usize> =
        (0..position.0.len()).filter(|&row| fix(row).iter().all(|x| !x.is_nan())).collect();
    let mut lasted: Vec<usize> = rows.chunk_by(|a, b| fix(*a) == fix(*b)).map(<[_]>::len).collect();
    // The last one may be cut.
    lasted.pop();
    lasted.sort_unstable();
    let usual = *lasted.get(lasted.len().checked_sub(1)? / 2)?;
    if usual < 2 {
        return None;
    }
    let repeats: Vec<usize> = rows
        .chunk_by(|a, b| fix(*a) == fix(*b))
        .flat_map(|same| {
            same.iter().enumerate().filter(|(k, _)| !k.is_multiple_of(usual)).map(|(_, row)| *row)
        })
        .collect();
    for track in [position].into_iter().chain(velocity) {
        for &row in &repeats {
            track.0[row].value = [f64::NAN; 2];
        }
    }
    Some(usual)
}

/// Units of a speed that states none.
const SPEED_UNITS: [(&str, f64); 3] = [("m/s", 1.0), ("kn", 1852.0 / 3600.0), ("km/h", 1.0 / 3.6)];
/// Relative difference of the speed of the positions from that in such a unit.
const ALIKE: f64 = 0.1;

/// Converts velocities from a speed without a unit to the unit in which the positions move as fast, and says so.
fn find_unit(
    header: &RawLog,
    spec: &ChannelSpec,
    position: Option<&Track>,
    velocity: &mut Track,
) -> Result<Option<Note>, LogError> {
    if !log::channel(header, spec, &mut Vec::new())?.channel.unit.is_empty() {
        return Ok(None);
    }
    let (path, column) = (&header.path, &spec.column);
    let factor =
        position.and_then(|position| gain(&displacements(position, velocity))).map(|gain| gain.factor);
    let found =
        factor.and_then(|factor| SPEED_UNITS.iter().find(|(_, of)| (factor / of - 1.0).abs() < ALIKE));
    let note = match found {
        Some((unit, si)) => {
            velocity.values_mut().flatten().for_each(|x| *x *= si);
            Note::info(format!(
                "{path}: `{column}` has no unit, and is taken as {unit}, in which the positions move as fast"
            ))
        }
        None => Note::warning(format!(
            "{path}: `{column}` has no unit, and is taken as m/s; no positions show whether that is right"
        )),
    };
    Ok(Some(note.with_remedy(format!("state its unit: speed = \"{column} [kn]\""))))
}

/// Stamps and SI values of a column.
fn values<'a>(
    recording: &'a Recording,
    (name, spec): (&str, &ChannelSpec),
    notes: &mut Vec<Note>,
) -> Result<(&'a [f64], Vec<f64>), LogError> {
    let at = recording.position(spec)?;
    let source = log::channel(&recording.log, spec, notes)?;
    let (t, values) = recording.series(at);
    let si = UNITS.iter().find(|(of, _)| *of == name).map_or("", |(_, unit)| unit);
    let found = &source.channel.unit;
    let mut factor = 1.0;
    if found.is_empty() && (name == "latitude" || name == "longitude") {
        factor = PI / 180.0;
    } else if found.is_empty() && si == "rad" && values.iter().any(|x| x.abs() > TAU + 0.1) {
        factor = PI / 180.0;
        notes.push(
            Note::info(format!(
                "{}: `{}` has no unit and is above 2 pi: it is taken as degrees",
                recording.log.path, spec.column
            ))
            .with_remedy(format!("state its unit: {name} = \"{} [deg]\"", spec.column)),
        );
    } else if found == "rps" && si == "rad/s" {
        factor = TAU;
    } else if !found.is_empty() && !si.is_empty() && found != si {
        return Err(LogError::Unusable {
            path: recording.log.path.clone(),
            reason: format!("the {name} `{}` is in {found}, which is not a unit of {si}", spec.column),
            remedy: format!("name another column, or state the unit: {name} = \"{} [{si}]\"", spec.column),
        });
    }
    let mut values: Vec<f64> = values.iter().map(|x| factor * source.si(*x)).collect();
    if name != "quality" {
        let kind = if ["heading", "course"].contains(&name) { Sentinel::Angle } else { Sentinel::Measured };
        let raw = |x: f64| source.raw(x / factor);
        let found = sentinel::find(values.iter().copied(), kind, TAU + ROUNDING_RAD, raw);
        values.iter_mut().filter(|x| found.iter().any(|(of, _)| of == *x)).for_each(|x| *x = f64::NAN);
        notes.extend(sentinel::note(&recording.log.path, &spec.column, &found, raw));
    }
    check_size(recording, name, spec, si, &values)?;
    Ok((t, values))
}

/// Share of the values that errors of a sensor may have.
const ERRORS: f64 = 0.01;

/// Refuses velocities and yaw rates that no vessel has: their unit is another one.
fn check_size(
    recording: &Recording,
    name: &str,
    spec: &ChannelSpec,
    si: &str,
    values: &[f64],
) -> Result<(), LogError> {
    let (limit, other) = match si {
        "rad/s" => (FASTEST_RAD_S, "deg/s"),
        "m/s" => (FASTEST_M_S, "kn"),
        _ => return Ok(()),
    };
    let measured = || values.iter().filter(|x| x.is_finite());
    let beyond = measured().filter(|x| x.abs() > limit).count();
    if beyond as f64 <= ERRORS * measured().count() as f64 {
        return Ok(());
    }
    let fastest = measured().fold(0.0, |fastest: f64, x| fastest.max(x.abs()));
    Err(LogError::Unusable {
        path: recording.log.path.clone(),
        reason: format!(
            "the {name} `{}` is up to {fastest:.1} {si}, and no vessel is faster than {limit} {si}",
            spec.column
        ),
        remedy: format!(
            "state its unit in the section [log.sensors]: {name} = \"{} [{other}]\"",
            spec.column
        ),
    })
}

/// Changes positions in degrees and minutes, as ddmm.mmmm of NMEA, to radians.
///
/// # Errors
/// If they are out of range as degrees, and are not of this form.
fn from_minutes(path: &str, position: &mut Track, notes: &mut Vec<Note>) -> Result<(), LogError> {
    let degrees = |x: f64| x * (180.0 / PI);
    let limits = [90.0, 180.0];
    let fixes = position.measured().map(|event| event.value).filter(|fix| *fix != [0.0; 2]);
    let fixes: Vec<[f64; 2]> = fixes.map(|fix| fix.map(degrees)).collect();
    let is_out = |fix: &&[f64; 2]| fix[0].abs() > limits[0] || fix[1].abs() > 2.0 * limits[1];
    // A few positions out of range are errors of the receiver.
    if 2 * fixes.iter().filter(is_out).count() <= fixes.len() {
        return Ok(());
    }
    // A longitude is no latitude in minutes.
    if fixes.iter().all(|[a, b]| a.abs() <= limits[1] && b.abs() <= limits[0]) {
        return Err(LogError::Unusable {
            path: path.to_owned(),
            reason: format!(
                "latitudes such as {:.4} are beyond 90 degrees, and latitude and longitude seem to be exchanged",
                fixes[0][0]
            ),
            remedy: "exchange latitude and longitude in the section [log.sensors]".to_owned(),
        });
    }
    let is_form = |fix: &[f64; 2]| {
        fix.iter().zip(limits).all(|(x, limit)| x.abs() < 100.0 * limit && x.abs() % 100.0 < 60.0)
    };
    if let Some([latitude, longitude]) = fixes.iter().find(|fix| !is_form(fix)) {
        return Err(LogError::Unusable {
            path: path.to_owned(),
            reason: format!(
                "the position {latitude:.4}, {longitude:.4} is neither in degrees nor in degrees and minutes (ddmm.mmmm)"
            ),
            remedy: "state the factor in the section [log.sensors]: latitude = \"COLUMN [deg] * 1e-7\", and the same for longitude".to_owned(),
        });
    }
    for x in position.values_mut().flatten() {
        let size = degrees(x.abs());
        let whole = (size / 100.0).floor();
        *x = (whole + (size - 100.0 * whole) / 60.0).copysign(*x) * (PI / 180.0);
    }
    notes.push(
        Note::warning(format!(
            "{path}: positions such as {:.4}, {:.4} are read as degrees and minutes (ddmm.mmmm)",
            fixes[0][0], fixes[0][1]
        ))
        .with_remedy("numbers without a sign are north and east: in the south or west give latitude or longitude the factor -1 in the section [log.sensors]"),
    );
    Ok(())
}

/// Stamps and values of a column that is named.
type Column<'a> = Option<(&'a [f64], Vec<f64>)>;

impl Instruments {
    pub(super) fn new(
        recording: &Recording,
        sensors: &Sensors,
        notes: &mut Vec<Note>,
    ) -> Result<Self, LogError> {
        let path = recording.log.path.clone();
        let mut found = Vec::new();
        let mut get = |name: &'static str, spec: &Option<ChannelSpec>| {
            spec.as_ref().map(|spec| values(recording, (name, spec), &mut found)).transpose()
        };
        let latitude = get("latitude", &sensors.latitude)?;
        let longitude = get("longitude", &sensors.longitude)?;
        let north = get("north", &sensors.north)?;
        let east = get("east", &sensors.east)?;
        let quality = get("quality", &sensors.quality)?;
        let speed = get("speed", &sensors.speed)?;
        let course = get("course", &sensors.course)?;
        let velocity_north = get("velocity_north", &sensors.velocity_north)?;
        let velocity_east = get("velocity_east", &sensors.velocity_east)?;
        let heading = get("heading", &sensors.heading)?;
        let yaw_rate = get("yaw_rate", &sensors.yaw_rate)?;
        let forward = get("acceleration_forward", &sensors.acceleration_forward)?;
        let starboard = get("acceleration_starboard", &sensors.acceleration_starboard)?;
        // Conversions of units are many, and expected.
        notes.extend(found.into_iter().filter(|note| note.is_warning() || note.remedy.is_some()));
        let one = |of: Column<'_>| of.map(|(t, x)| Track::new(t, |k| [x[k], 0.0]));
        let both = |a: Column<'_>, b: Column<'_>, names: &str| match (a, b) {
            (Some((t, a)), Some((other, b))) if t == other => Ok(Some(Track::new(t, |k| [a[k], b[k]]))),
            (None, None) => Ok(None),
            _ => Err(LogError::Unusable {
                path: path.clone(),
                reason: format!("{names} are needed together, from one topic"),
                remedy: "name both in the section [log.sensors], or neither".to_owned(),
            }),
        };
        let mut position = match both(latitude, longitude, "latitude and longitude")? {
            Some(mut fixes) => {
                from_minutes(&path, &mut fixes, notes)?;
                local(&mut fixes);
                Some(fixes)
            }
            None => both(north, east, "north and east")?,
        };
        let mut velocity = match both(speed, course, "speed and course")? {
            Some(mut track) => {
                for value in track.values_mut() {
                    let [speed, course] = *value;
                    *value = [speed * course.cos(), speed * course.sin()];
                }
                Some(track)
            }
            None => both(velocity_north, velocity_east, "velocity_north and velocity_east")?,
        };
        if let (Some(spec), Some(velocity)) = (&sensors.speed, &mut velocity) {
            notes.extend(find_unit(&recording.log, spec, position.as_ref(), velocity)?);
        }
        if let Some(fixes) = &mut position {
            let is_same = |of: &&mut Track| of.0.iter().map(|e| e.t).eq(fixes.0.iter().map(|e| e.t));
            let velocity = velocity.as_mut().filter(is_same);
            if let Some(rows) = leave_repeats(fixes, velocity) {
                notes.push(Note::info(format!(
                    "{path}: the position changes every {rows} rows: those between repeat a fix of the receiver, and are left out"
                )));
            }
        }
        let force = both(forward, starboard, "acceleration_forward and acceleration_starboard")?;
        let (quality, heading, yaw_rate) = (one(quality), one(heading), one(yaw_rate));
        let is_used = |track: &Option<Track>| track.as_ref().is_some_and(|track| track.len() > 1);
        if !is_used(&position) && !is_used(&velocity) {
            return Err(LogError::Unusable {
                path,
                reason: "there is neither a position nor a velocity".to_owned(),
                remedy: "name the columns of the GNSS in the section [log.sensors], such as latitude and longitude; `hydroid inspect` lists the columns".to_owned(),
            });
        }
        if !is_used(&heading) && !is_used(&yaw_rate) {
            return Err(LogError::Unusable {
                path,
                reason:
                    "there is neither a heading nor a yaw rate: the sway velocity cannot be told from a drift"
                        .to_owned(),
                remedy: "name the column of the compass or the gyro in the section [log.sensors]".to_owned(),
            });
        }
        let clock = sensors.columns().next().map(|(_, spec)| recording.position(spec)).transpose()?;
        let clock = clock.map_or(Clock::None, |at| recording.topics[recording.topic_of[at]].clock);
        if clock == Clock::None {
            return Err(LogError::Unusable {
                path,
                reason: "the rows have no time".to_owned(),
                remedy: "a column of the time is needed: t [s], or time with ISO 8601 stamps".to_owned(),
            });
        }
        let mut all = Self { path, origin: 0.0, position, quality, velocity, heading, yaw_rate, force };
        all.leave_constants(notes);
        all.check_turns()?;
        all.leave_stuck_positions(notes);
        all.leave_stuck_headings(notes);
        all.yaw_rate = all.yaw_rate.map(Track::averaged);
        all.force = all.force.map(Track::averaged);
        all.origin =
            all.tracks().filter_map(|s| s.pairs().next()).map(|(t, _)| t).fold(f64::INFINITY, f64::min);
        let origin = all.origin;
        all.tracks_mut().flat_map(|track| &mut track.0).for_each(|event| event.t -= origin);
        Ok(all)
    }

    /// Leaves out gyros, accelerometers and velocities of one value, which measure nothing, beside a heading or a position: without one,
    /// nothing would be left.
    fn leave_constants(&mut self, notes: &mut Vec<Note>) {
        let Self { path, position, heading, velocity, yaw_rate, force, .. } = self;
        let all = [
            ("velocity", velocity, position.is_some()),
            ("yaw rate", yaw_rate, heading.is_some()),
            ("acceleration", force, true),
        ];
        for (name, track, may_lack) in all {
            let is_constant = |track: &Track| {
                let mut measured = track.measured();
                let first = measured.next().map(|event| event.value);
                measured.next().is_some() && track.measured().all(|event| Some(event.value) == first)
            };
            if track.take_if(|track| may_lack && is_constant(track)).is_some() {
                notes.push(
                    Note::warning(format!(
                        "{path}: the {name} has one value throughout, and is no measurement: it is not used"
                    ))
                    .with_remedy("name another column in the section [log.sensors], or none"),
                );
            }
        }
    }

    /// Refuses headings that change by more than a turn from one row to the next.
    fn check_turns(&self) -> Result<(), LogError> {
        let Some(heading) = &self.heading else { return Ok(()) };
        let values: Vec<(f64, f64)> = heading.pairs().collect();
        // Through a gap, a heading without wraps may go on.
        let is_leap = |pair: &&[(f64, f64)]| {
            let (step_s, change) = (pair[1].0 - pair[0].0, (pair[1].1 - pair[0].1).abs());
            change > 1.5 * TAU && change > TAU * step_s
        };
        let Some([(_, from), (_, to)]) = values.windows(2).find(is_leap) else { return Ok(()) };
        Err(LogError::Unusable {
            path: self.path.clone(),
            reason: format!(
                "the heading goes from {:.0} to {:.0} deg between two rows, by more than a turn: its unit is another one",
                from.to_degrees(),
                to.to_degrees()
            ),
            remedy: "state the factor in the section [log.sensors], as of hundredths of a degree: heading = \"COLUMN [deg] * 0.01\"".to_owned(),
        })
    }

    /// Leaves out positions that repeat one value after the vessel was sailing, or before they leap: no vessel stands, or leaps, from one
    /// fix to the next. What else has one value in that time is left out, too.
    fn leave_stuck_positions(&mut self, notes: &mut Vec<Note>) {
        let Some(position) = &self.position else { return };
        let measured: Vec<&Event> = position.measured().collect();
        let sailed = |[from, _]: &[f64; 2]| {
            let first = measured.partition_point(|event| event.t < *from);
            let before = measured[..first].iter().rev().find(|event| event.t <= *from - SAILED_S);
            before.is_some_and(|event| {
                let [a, b] = [measured[first].value, event.value];
                (a[0] - b[0]).hypot(a[1] - b[1]) > SAILING_M_S * (from - event.t)
            })
        };
        let length = |a: &Event, b: &Event| (a.value[0] - b.value[0]).hypot(a.value[1] - b.value[1]);
        let mut steps: Vec<f64> = measured.windows(2).map(|pair| length(pair[0], pair[1])).collect();
        steps.sort_unstable_by(f64::total_cmp);
        let usual = steps.get(steps.len() * 99 / 100).copied().unwrap_or(f64::INFINITY);
        let leaps = |[_, to]: &[f64; 2]| {
            let next = measured.partition_point(|event| event.t <= *to);
            measured.get(next).is_some_and(|event| length(event, measured[next - 1]) > LEAP * usual)
        };
        let repeats = position.repeats().into_iter();
        let stuck: Vec<[f64; 2]> = repeats.filter(|ends| sailed(ends) || leaps(ends)).collect();
        let Some([from, to]) = stuck.first() else { return };
        let text = super::table::time_text;
        let more = match stuck.len() {
            1 => String::new(),
            n => format!(", and {} more times", n - 1),
        };
        notes.push(
            Note::warning(format!(
                "{}: the position has one value from {} to {}{more}, and the vessel was sailing before, or the position leaps then: the receiver, or the logger, is stuck, and what repeats in that time is left out",
                self.path, text(*from), text(*to)
            ))
            .with_remedy("repair the receiver or its connection"),
        );
        for track in self.tracks_mut() {
            for [from, to] in &stuck {
                let first = track.0.partition_point(|event| event.t <= *from);
                let last = track.0.partition_point(|event| event.t <= *to);
                let part = &mut track.0[first..last];
                if part.windows(2).all(|pair| pair[0].value == pair[1].value) {
                    for event in part {
                        event.value = [f64::NAN; 2];
                    }
                }
            }
        }
    }

    /// Leaves out headings that repeat one value while the vessel turns, by its gyro or else by its course over ground.
    fn leave_stuck_headings(&mut self, notes: &mut Vec<Note>) {
        let Some(heading) = &self.heading else { return };
        let long = heading.repeats().into_iter();
        let stuck: Vec<[f64; 2]> = long.filter(|ends| self.turn(*ends).abs() > TURNING_RAD).collect();
        let (Some([from, to]), Some(heading)) = (stuck.first(), &mut self.heading) else { return };
        let is_out = |t: f64| stuck.iter().any(|[from, to]| (*from..=*to).contains(&t));
        heading.0.iter_mut().filter(|event| is_out(event.t)).for_each(|event| event.value[0] = f64::NAN);
        let more = match stuck.len() {
            1 => String::new(),
            n => format!(", and {} more times", n - 1),
        };
        let text = super::table::time_text;
        notes.push(
            Note::warning(format!(
                "{}: the heading has one value from {} to {}{more}, while the vessel turns: the sensor is stuck, and these headings are left out",
                self.path, text(*from), text(*to)
            ))
            .with_remedy("repair the compass or its connection"),
        );
    }

    /// Largest turn of the vessel since the beginning of a stretch of time \[rad\], by the gyro relative to its median, else by the course over ground where it
    /// changes steadily.
    fn turn(&self, [from, to]: [f64; 2]) -> f64 {
        let within = |track: &Track| -> Vec<Event> {
            track.measured().filter(|event| (from..=to).contains(&event.t)).copied().collect()
        };
        let changes: Vec<f64> = if let Some(yaw_rate) = &self.yaw_rate {
            let rates = within(yaw_rate);
            // A bias turns nothing.
            let usual = log::median(yaw_rate.pairs().map(|(_, rate)| rate).collect()).unwrap_or(0.0);
            let turn = |[a, b]: [&Event; 2]| (0.5 * (a.value[0] + b.value[0]) - usual) * (b.t - a.t);
            rates.windows(2).map(|pair| turn([&pair[0], &pair[1]])).collect()
        } else if let Some(track) = self.position.as_ref().or(self.velocity.as_ref()) {
            let own = Track(within(track));
            let moves: Vec<[f64; 2]> = match &self.position {
                Some(_) => displacements(&own, &own).into_iter().map(|(_, rate, _)| rate).collect(),
                None => own.0.iter().map(|event| event.value).collect(),
            };
            let sails = |v: &[f64; 2]| v[0].hypot(v[1]) > SAILING_M_S;
            let change = |pair: &[[f64; 2]]| {
                let [a, b] = [pair[0], pair[1]];
                let turn = (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]);
                if pair.iter().all(sails) && turn.abs() < TURNING_RAD { turn } else { 0.0 }
            };
            moves.windows(2).map(change).collect()
        } else {
            Vec::new()
        };
        let sums = changes.iter().scan(0.0, |sum: &mut f64, change| {
            *sum += change;
            Some(*sum)
        });
        sums.fold(0.0, |most: f64, sum| if sum.abs() > most.abs() { sum } else { most })
    }

    /// Leaves the measurements that are in some parts of the recording, on its clock.
    pub(super) fn keep(&mut self, kept: &Kept) {
        let origin = self.origin;
        for event in self.tracks_mut().flat_map(|track| &mut track.0).filter(|e| !kept.has(e.t + origin)) {
            event.value = [f64::NAN; 2];
        }
    }

    fn tracks(&self) -> impl Iterator<Item = &Track> {
        let all = [&self.position, &self.velocity, &self.force, &self.quality, &self.heading, &self.yaw_rate];
        all.into_iter().flatten()
    }

    fn tracks_mut(&mut self) -> impl Iterator<Item = &mut Track> {
        let Self { position, velocity, force, quality, heading, yaw_rate, .. } = self;
        [position, velocity, force, quality, heading, yaw_rate].into_iter().flatten()
    }

    /// Turns the axes of an inertial unit with axes forward, port, up, whose yaw rate has the opposite sign of the
    /// change of the heading.
    pub(super) fn turn_axes(&mut self, notes: &mut Vec<Note>) {
        let (Some(heading), Some(yaw_rate)) = (&self.heading, &mut self.yaw_rate) else { return };
        let Some(slope) = slope(heading, yaw_rate) else { return };
        if slope < 0.0 {
            yaw_rate.values_mut().for_each(|[rate, _]| *rate = -*rate);
            let mut turned =
                "the yaw rate has the opposite sign of the change of the heading: its sign is changed"
                    .to_owned();
            if let Some(force) = &mut self.force {
                force.values_mut().for_each(|[_, starboard]| *starboard = -*starboard);
                turned += ", and that of acceleration_starboard (axes forward, port, up)";
            }
            notes.push(
                Note::info(format!("{}: {turned}", self.path))
                    .with_remedy("state the signs in the section [log.sensors]: yaw_rate = \"COLUMN * -1\""),
            );
        }
        if !(0.7..1.4).contains(&slope.abs()) {
            notes.push(
                Note::warning(format!(
                    "{}: the heading changes {:.3} times as fast as the yaw rate states",
                    self.path,
                    slope.abs()
                ))
                .with_remedy("check the units of heading and yaw rate"),
            );
        }
    }

    /// Checks that the heading turns as the direction of the motion does, and that the vessel moves ahead on the whole.
    ///
    /// # Errors
    /// If it turns the other way: it counts counterclockwise. If the vessel moves astern: the compass is mounted the other way round.
    pub(super) fn check_heading(&self) -> Result<(), LogError> {
        let (Some(position), Some(heading)) = (&self.position, &self.heading) else { return Ok(()) };
        let along = |side: f64| {
            let ahead = |event: &Event| Event {
                value: [event.value[0].cos(), side * event.value[0].sin()],
                ..*event
            };
            gain(&displacements(position, &Track(heading.0.iter().map(ahead).collect())))
        };
        let found = along(1.0);
        let direct = found.map_or(1.0, |gain| gain.unexplained);
        let mirrored = along(-1.0).map_or(1.0, |gain| gain.unexplained);
        if mirrored >= 0.5 * direct {
            let beside = found.map(|gain| gain.angle.to_degrees()).filter(|angle| angle.abs() > BESIDE_DEG);
            let Some(beside) = beside else { return Ok(()) };
            return Err(LogError::Unusable {
                path: self.path.clone(),
                reason: format!(
                    "on the whole the vessel moves {beside:.0} deg to starboard of its heading: the compass seems to be mounted another way round"
                ),
                remedy: format!(
                    "subtract the angle in the section [log.sensors]: heading = \"COLUMN [deg] - {:.0}\"; if the vessel sails astern or drifts most of the time, leave these parts out ({})",
                    -beside,
                    key("exclude")
                ),
            });
        }
        Err(LogError::Unusable {
            path: self.path.clone(),
            reason: format!(
                "the heading turns the other way than the positions: the opposite angle leaves {:.0} % of their changes unexplained, the heading {:.0} %",
                100.0 * mirrored,
                100.0 * direct
            ),
            remedy: "headings count clockwise from north: for degrees counterclockwise from east write heading = \"(COLUMN - 90) * -1\" in the section [log.sensors], and check that latitude and longitude, or north and east, are not exchanged".to_owned(),
        })
    }

    /// Checks that the estimate of the heading is that of the measurements, on the whole.
    ///
    /// # Errors
    /// If it is nearer to the opposite direction.
    pub(super) fn check_estimate(&self, rows: &[Row]) -> Result<(), LogError> {
        let Some(heading) = &self.heading else { return Ok(()) };
        let mut agreement = 0.0;
        for (t, measured) in heading.pairs().filter(|(_, measured)| measured.is_finite()) {
            let at = rows.partition_point(|row| row.t < t);
            if let Some(row) = rows.get(at).filter(|row| row.t - t < PART_S) {
                agreement += (measured - row.pose[2]).cos();
            }
        }
        if agreement >= 0.0 {
            return Ok(());
        }
        Err(LogError::Unusable {
            path: self.path.clone(),
            reason: "the estimated heading points the other way than the measured one".to_owned(),
            remedy: "leave out the beginning of the log, or parts in which the heading is not measured, as that of a GNSS receiver at rest".to_owned(),
        })
    }

    /// States how velocities of the GNSS contradict the changes of its positions.
    pub(super) fn check_gnss(&self) -> Option<String> {
        let (position, velocity) = (self.position.as_ref()?, self.velocity.as_ref()?);
        let parts = displacements(position, velocity);
        let exchanged: Vec<_> = parts.iter().map(|&(t, [a, b], v)| (t, [b, a], v)).collect();
        let (direct, swapped) = (gain(&parts), gain(&exchanged));
        let unexplained = direct.map_or(1.0, |gain| gain.unexplained);
        if swapped.is_some_and(|swapped| swapped.unexplained < 0.5 * unexplained) {
            return Some(
                "positions move to the north as the velocity of the GNSS does to the east: latitude and longitude, or north and east, seem to be exchanged"
                    .to_owned(),
            );
        }
        let gain = direct.filter(|gain| (gain.factor - 1.0).abs() > 0.2 || gain.angle.abs() > 0.2)?;
        Some(format!(
            "positions of the GNSS move {:.2} times as fast as its velocity states, in a direction {:.0} deg to starboard of it",
            gain.factor,
            180.0 / PI * gain.angle
        ))
    }

    /// Measurements of a part in the order of time, and the prior. Kinds of position fixes come first among the sensors.
    pub(super) fn run(&self, part: &Part, all: &[Sensor], qualities: &[f64]) -> Run {
        let places = qualities.len().max(1);
        let fix = |event: &Event| {
            let quality = self.quality.as_ref().map(|quality| quality.at(event.t));
            quality.and_then(|value| qualities.iter().position(|q| *q == value)).unwrap_or(0)
        };
        let fixes = self.position.iter().flat_map(|track| &track.0);
        let mut events: Vec<Event> = fixes.map(|event| Event { sensor: fix(event), ..*event }).collect();
        let others = [(&self.velocity, 0), (&self.force, 3), (&self.heading, 1), (&self.yaw_rate, 2)];
        for (track, sensor) in others {
            let of = track.iter().flat_map(|track| &track.0);
            events.extend(of.map(|event| Event { sensor: places + sensor, ..*event }));
        }
        events.retain(|event| event.value.iter().all(|x| x.is_finite()) && part.has(event.t));
        events.sort_by(|a, b| a.t.total_cmp(&b.t));
        Run { prior: start(&events, all), events }
    }

    /// The times in which a sensor is measured, with the rows of the table: from the first time at which the place (position or
    /// velocity) and the direction (heading or yaw rate) are known. Times without any measurement are not bridged, and a
    /// measurement whose stamp is far from all others is in no part.
    pub(super) fn parts(&self, dt: Option<f64>, notes: &mut Vec<Note>) -> Result<Vec<Part>, LogError> {
        let step = dt.or_else(|| {
            let usual = [&self.heading, &self.position, &self.velocity];
            let usual = usual.into_iter().flatten().find_map(Track::step);
            usual.map(|usual| rounded(usual).max(SHORTEST_S))
        });
        let step = step.filter(|step| *step > 0.0 && step.is_finite()).unwrap_or(SHORTEST_S);
        let place = self.position.iter().chain(&self.velocity);
        let (place, direction) = (times(place), times(self.heading.iter().chain(&self.yaw_rate)));
        let (all, limit) = stretches(&self.tracks().collect::<Vec<_>>());
        // All sensors have begun at the first row.
        let begun = self.tracks().filter_map(|s| s.pairs().next()).map(|(t, _)| t).fold(0.0, f64::max);
        // The first measurement, the first time at which place and direction are known, and the last measurement.
        let mut both: Vec<[f64; 3]> = Vec::new();
        for [begin, to] in all {
            let first = |times: &[f64]| {
                let at = times.partition_point(|t| *t < begin);
                times.get(at).copied().filter(|t| *t <= to)
            };
            if let (Some(place), Some(direction)) = (first(&place), first(&direction)) {
                both.push([begin, place.max(direction), to]);
            }
        }
        let longest = both.iter().map(|[_, from, to]| to - from).fold(0.0, f64::max);
        if let Some([_, from, to]) = both.first_mut()
            && begun < *to
        {
            *from = from.max(begun);
        }
        let origin = both.first().map_or(0.0, |[_, from, ..]| *from);
        let mut parts: Vec<Part> = Vec::new();
        let mut rows = 0.0;
        for [begin, from, to] in both {
            let [first, last] = [((from - origin) / step).ceil(), ((to - origin) / step).floor()];
            rows += last - first;
            if last - first < 1.0 || rows > MOST_ROWS {
                continue;
            }
            // The rows begin with the last sensor, and the measurements of the first part with the first one.
            let from = if parts.is_empty() { begin } else { from };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in the range above")]
            let all = first as usize..=last as usize;
            parts.push(Part { from, to, times: all.map(|k| origin + k as f64 * step).collect() });
        }
        if parts.is_empty() || rows > MOST_ROWS {
            return Err(LogError::Unusable {
                path: self.path.clone(),
                reason: format!("position and heading overlap for {longest:.1} s"),
                remedy: "check the stamps of the topics with `hydroid inspect`".to_owned(),
            });
        }
        self.tell_gaps(&parts, limit, notes);
        Ok(parts)
    }

    /// Removes the rows of outages of the sensors of place or direction from the first to the last one in which a velocity is
    /// not known any more: its standard deviation exceeds a third of its spread, and its usual one. An
    /// outage beyond the given limit has no rows.
    pub(super) fn cut_outages(&self, rows: &mut Vec<Row>, max_gap_s: Option<f64>, notes: &mut Vec<Note>) {
        let (Some(first), Some(end)) = (rows.first(), rows.last()) else { return };
        let ends = [first.t, end.t];
        let place = self.position.iter().chain(&self.velocity);
        let direction = self.heading.iter().chain(&self.yaw_rate);
        let mut all: Vec<(&str, [f64; 2], Range<usize>)> = Vec::new();
        for (name, times) in
            [("position or velocity", times(place)), ("heading or yaw rate", times(direction))]
        {
            for [from, to] in outages(times, ends, max_gap_s) {
                let before = rows.partition_point(|row| row.t <= from + ROUNDING_S);
                let after = rows.partition_point(|row| row.t < to - ROUNDING_S || to == ends[1]);
                all.push((name, [from, to], before..after.max(before)));
            }
        }
        let mut is_known = vec![true; rows.len()];
        for (.., range) in &all {
            is_known[range.clone()].fill(false);
        }
        let known: Vec<&Row> =
            rows.iter().zip(&is_known).filter(|(_, known)| **known).map(|(row, _)| row).collect();
        if known.is_empty() {
            return;
        }
        let limits: [f64; 3] = std::array::from_fn(|i| {
            let n = known.len() as f64;
            let mean = known.iter().map(|row| row.ground[i]).sum::<f64>() / n;
            let square = known.iter().map(|row| (row.ground[i] - mean).powi(2)).sum::<f64>() / n;
            let mut usual: Vec<f64> = known.iter().map(|row| row.ground_deviation[i]).collect();
            usual.sort_by(f64::total_cmp);
            // That of nineteen of twenty rows: the beginning of a run is less certain.
            usual[(usual.len() - 1) * 19 / 20].max(KNOWN * square.sqrt())
        });
        let mut is_kept = vec![true; rows.len()];
        let mut cuts: Vec<(&str, [f64; 2])> = Vec::new();
        for (name, [from, to], range) in all {
            let is_open = |row: &Row| {
                max_gap_s.is_some_and(|longest| to - from > longest)
                    || (0..3).any(|i| row.ground_deviation[i] > limits[i])
            };
            let own = &rows[range.clone()];
            if let (Some(a), Some(b)) = (own.iter().position(is_open), own.iter().rposition(is_open)) {
                cuts.push((name, [own[a].t, own[b].t]));
                is_kept[range.start + a..=range.start + b].fill(false);
            }
        }
        let mut kept = is_kept.into_iter();
        rows.retain(|_| kept.next() == Some(true));
        cuts.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        if let Some((name, [from, to])) = cuts.first() {
            let text = |t: f64| super::table::time_text(t + self.origin);
            let more = match cuts.len() {
                1 => String::new(),
                n => format!(", and in {} more gaps", n - 1),
            };
            notes.push(Note::warning(format!(
                "{}: there are no rows from {} to {}{more}: no {name} is measured; the gap is longer than the limit, or u, v and r are not known within {:.2} m/s, {:.2} m/s and {:.3} rad/s",
                self.path, text(*from), text(*to), limits[0], limits[1], limits[2]
            )));
        }
    }

    /// Says where measurements are missing, and which ones are left out.
    fn tell_gaps(&self, parts: &[Part], limit: f64, notes: &mut Vec<Note>) {
        let text = |t: f64| super::table::time_text(t + self.origin);
        let all = [
            ("positions", &self.position),
            ("velocities", &self.velocity),
            ("headings", &self.heading),
            ("yaw rates", &self.yaw_rate),
            ("accelerations", &self.force),
        ];
        for (name, track) in all {
            let times: Vec<f64> = track.iter().flat_map(Track::pairs).map(|(t, _)| t).collect();
            let is_outside = |t: &&f64| {
                let next = parts.partition_point(|part| part.to < **t);
                parts.get(next).is_none_or(|part| !part.has(**t))
            };
            let mut outside = times.iter().filter(is_outside);
            let Some(first) = outside.next() else { continue };
            notes.push(
                Note::warning(format!(
                    "{}: {} of {} {name} are left out, the first at {}: position and heading are not both known there, and {limit:.1} s or more are without any measurement",
                    self.path,
                    1 + outside.count(),
                    times.len(),
                    text(*first)
                ))
                .with_remedy("if the recording was not paused, check the stamps of the topics with `hydroid inspect`"),
            );
        }
        if let [first, second, more @ ..] = parts {
            notes.push(Note::info(format!(
                "{}: there are no rows from {} to {}{}: nothing is measured",
                self.path,
                text(first.to),
                text(second.from),
                if more.is_empty() { String::new() } else { format!(", and in {} more gaps", more.len()) }
            )));
        }
    }
}

/// A stamp that differs from that of a row by less \[s\] is at the row.
const ROUNDING_S: f64 = 1e-6;
/// Share of the usual spread of a velocity that its standard deviation may have in an outage.
const KNOWN: f64 = 1.0 / 3.0;

/// Times \[s\] between two without measurements of some sensors that are longer than their limit. The limit is that of a gap of all sensors, or the given one; a single missing measurement is no gap.
fn outages(mut times: Vec<f64>, [begin, end]: [f64; 2], max_gap_s: Option<f64>) -> Vec<[f64; 2]> {
    times.dedup();
    let Some(step) = log::Clock::usual_step(&times) else { return Vec::new() };
    let limit = LONGEST_S.max(LONGEST_STEPS * step);
    let limit = max_gap_s.map_or(limit, |given| given.max(2.0 * step).min(limit));
    // A stamp far from all others is no end of an outage.
    times.retain(|t| (begin..=end).contains(t));
    let ends = times.iter().copied().chain([end]);
    let starts = std::iter::once(begin).chain(times.iter().copied());
    starts.zip(ends).filter(|(from, to)| to - from > limit).map(|(from, to)| [from, to]).collect()
}

/// Spread of the first headings, from which on they do not agree \[rad\].
const DISAGREE: f64 = 0.5;

/// The prior of measurements in the order of time: place, course and speed of the first ones.
pub(super) fn start(events: &[Event], sensors: &[Sensor]) -> Prior {
    let of = |kind: Kind| events.iter().filter(move |event| sensors[event.sensor].kind == kind);
    let velocities = || of(Kind::Velocity).take(5);
    let speed =
        velocities().map(|e| e.value[0].hypot(e.value[1])).sum::<f64>() / velocities().count().max(1) as f64;
    let course = velocities().next().map_or(0.0, |e| e.value[1].atan2(e.value[0]));
    // The first headings of a receiver at rest have any direction: if they disagree, their spread is the deviation of the first.
    let headings = || of(Kind::Heading).take(20).map(|event| event.value[0]);
    let [cosine, sine] = [f64::cos, f64::sin].map(|part| headings().map(part).sum::<f64>());
    let agreement = cosine.hypot(sine) / headings().count().max(1) as f64;
    let spread = (-2.0 * agreement.max(1e-3).ln()).max(0.0).sqrt();
    let (heading, deviation) = headings()
        .next()
        .map_or((course, 0.5), |heading| (heading, if spread > DISAGREE { spread } else { 0.1 }));
    let (sine, cosine) = heading.sin_cos();
    let [north, east] = of(Kind::Position).next().map_or([0.0; 2], |event| {
        let Mounting { forward, starboard } = sensors[event.sensor].mounting;
        let [north, east] = event.value;
        [north - (cosine * forward - sine * starboard), east - (sine * forward + cosine * starboard)]
    });
    Prior::default()
        .with(State::Heading, heading, deviation)
        .with(State::Surge, speed, 2.0)
        .with(State::North, north, 10.0)
        .with(State::East, east, 10.0)
        .with(State::CurrentNorth, 0.0, CURRENT_M_S)
        .with(State::CurrentEast, 0.0, CURRENT_M_S)
}

/// Most rows of a table.
const MOST_ROWS: f64 = 1e8;

/// A time without a gap of all sensors.
pub(super) struct Part {
    /// Times of its measurements \[s\].
    from: f64,
    to: f64,
    /// Times of its rows \[s\].
    pub(super) times: Vec<f64>,
}

impl Part {
    /// Whether a time is in it.
    fn has(&self, t: f64) -> bool {
        (self.from..=self.to).contains(&t)
    }
}

/// Times of the measurements of some sensors, in order.
fn times<'a>(sensors: impl Iterator<Item = &'a Track>) -> Vec<f64> {
    let mut times: Vec<f64> = sensors.flat_map(Track::pairs).map(|(t, _)| t).collect();
    times.retain(|t| t.is_finite());
    times.sort_by(f64::total_cmp);
    times
}

/// The stretches of time in which one of some sensors is measured, and the longest time between measurements in them.
fn stretches(sensors: &[&Track]) -> (Vec<[f64; 2]>, f64) {
    let steps = sensors.iter().filter_map(|track| track.step());
    let limit = steps.map(|step| LONGEST_STEPS * step).fold(LONGEST_S, f64::max);
    let times = times(sensors.iter().copied());
    let mut all: Vec<[f64; 2]> = Vec::new();
    for t in times {
        match all.last_mut() {
            Some([_, to]) if t - *to <= limit => *to = t,
            _ => all.push([t, t]),
        }
    }
    (all, limit)
}

/// A step without the noise of stamps: two digits.
fn rounded(step: f64) -> f64 {
    format!("{step:.1e}").parse().unwrap_or(step)
}

/// Changes latitudes and longitudes to positions north and east of the first fix \[m\]. Increments are added, with the radii of curvature at each latitude, so
/// that the axes are north and east at each place.
fn local(position: &mut Track) {
    let mut last: Option<(f64, f64)> = None;
    let (mut north, mut east) = (0.0, 0.0);
    for [phi, lambda] in position.values_mut() {
        // Receivers without a fix write zeros.
        let is_fix = phi.abs() <= PI / 2.0 && lambda.abs() <= TAU && (*phi != 0.0 || *lambda != 0.0);
        if !is_fix {
            (*phi, *lambda) = (f64::NAN, f64::NAN);
            continue;
        }
        if let Some((phi0, lambda0)) = last {
            let step = local_step([phi0, lambda0], [*phi, *lambda]);
            north += step[0];
            east += step[1];
        }
        last = Some((*phi, *lambda));
        (*phi, *lambda) = (north, east);
    }
}

/// The way between two fixes to the north and east \[m\], with the radii of curvature in their middle.
pub(super) fn local_step(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    let middle = 0.5 * (to[0] + from[0]);
    let [meridian, parallel] = metres_per_radian(middle);
    let turn = to[1] - from[1];
    [(to[0] - from[0]) * meridian, (turn - TAU * (turn / TAU).round()) * parallel]
}

/// A chance relation of parts of a run exceeds this F statistic, with five parts or more, less than once in fifty times;
/// with fifty, in twenty thousand.
const SIGNIFICANT: f64 = 20.0;
/// Duration of the parts \[s\].
const PART_S: f64 = 5.0;

/// Middle times of parts of some seconds \[s\], and the mean rates of change of positions and the mean velocities in them \[m/s\].
fn displacements(position: &Track, velocity: &Track) -> Vec<(f64, [f64; 2], [f64; 2])> {
    let [places, speeds] = [position, velocity].map(|track| track.measured().collect::<Vec<_>>());
    let mut parts = Vec::new();
    let mut from = 0;
    for k in 1..places.len() {
        let (start, end) = (places[from], places[k]);
        let dt = end.t - start.t;
        if dt < PART_S {
            continue;
        }
        from = k;
        let part = |t: f64| speeds.partition_point(|speed| speed.t < t);
        let within = &speeds[part(start.t)..part(end.t)];
        // A gap has no mean.
        if dt < 2.0 * PART_S && within.len() > 1 {
            let mean =
                [0, 1].map(|i| within.iter().map(|speed| speed.value[i]).sum::<f64>() / within.len() as f64);
            let rate = [0, 1].map(|i| (end.value[i] - start.value[i]) / dt);
            parts.push((0.5 * (start.t + end.t), rate, mean));
        }
    }
    parts
}

/// Displacements as multiples of velocities, turned clockwise.
#[derive(Clone, Copy)]
struct Gain {
    factor: f64,
    /// \[rad\].
    angle: f64,
    /// Share of the squares that it does not explain.
    unexplained: f64,
}

/// Regression of displacements on velocities, as complex numbers; none if they are not clearly related.
fn gain(parts: &[(f64, [f64; 2], [f64; 2])]) -> Option<Gain> {
    let n = parts.len() as f64;
    let sum = |of: &dyn Fn([f64; 2], [f64; 2]) -> f64| parts.iter().map(|(_, d, v)| of(*d, *v)).sum::<f64>();
    let along = sum(&|d, v| d[0] * v[0] + d[1] * v[1]);
    let across = sum(&|d, v| d[1] * v[0] - d[0] * v[1]);
    let (dd, vv) = (sum(&|d, _| d[0] * d[0] + d[1] * d[1]), sum(&|_, v| v[0] * v[0] + v[1] * v[1]));
    let explained = (along * along + across * across) / vv;
    (explained * (n - 2.0) > SIGNIFICANT * (dd - explained)).then(|| Gain {
        factor: along.hypot(across) / vv,
        angle: across.atan2(along),
        unexplained: 1.0 - explained / dd,
    })
}

/// Slope of the change of the heading over that of the integrated yaw rate, in parts of some seconds, where they are
/// clearly related.
fn slope(heading: &Track, yaw_rate: &Track) -> Option<f64> {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let turns: Vec<(f64, f64)> = heading.pairs().collect();
    let rates: Vec<(f64, f64)> = yaw_rate.pairs().collect();
    let mut from = 0;
    let mut changes = Vec::new();
    for k in 1..turns.len() {
        if turns[k].0 - turns[from].0 < PART_S {
            continue;
        }
        let turn: f64 = turns[from..=k]
            .windows(2)
            .map(|pair| {
                let d = pair[1].1 - pair[0].1;
                d - TAU * (d / TAU).round()
            })
            .sum();
        let part = |t: f64| rates.partition_point(|rate| rate.0 < t);
        let within = &rates[part(turns[from].0)..part(turns[k].0)];
        if within.len() > 1 {
            let mean = within.iter().map(|rate| rate.1).sum::<f64>() / within.len() as f64;
            changes.push((mean, turn / (turns[k].0 - turns[from].0)));
        }
        from = k;
    }
    // Without the means, so that a bias of the gyro does not matter.
    let n = changes.len().max(1) as f64;
    let mean = changes.iter().fold((0.0, 0.0), |sum, c| (sum.0 + c.0 / n, sum.1 + c.1 / n));
    for (x, y) in changes.iter().map(|c| (c.0 - mean.0, c.1 - mean.1)) {
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    // The F statistic of the regression.
    (xy * xy * (n - 2.0) > SIGNIFICANT * (xx * yy - xy * xy)).then(|| xy / xx)
}
