//! Tables of pose and velocities from sensors.

use std::f64::consts::{PI, TAU};

use hydroid_core::navigation::{Noise, State};

use super::instruments::{CURRENT_M_S, Instruments, start};
use super::known::{self, Placed};
use super::open::Recording;
use super::table;
use crate::log::count;
use crate::log::line::Resolved;
use crate::log::parts::{Kept, no_rows};
use crate::log::{LogError, Note, PrepareOptions, RawColumn, RawLog, Selection};
use crate::navigate::{self, Calibration, Kind, Run, Runs, Sensor, Smoothed, Statistics};
use crate::progress::Progress;

/// Kinds of position fixes with a noise of their own.
const QUALITIES: usize = 6;
/// Measurements from which the statistics are estimated: more of them change little.
const ENOUGH: usize = 40_000;
/// Share of their estimation in the time, for the progress.
const FIT: f64 = 0.85;

/// First guesses of the statistics, for ships and boats. Rates of the motion are inversely proportional to the length of a
/// vessel, frequencies of the waves that move it to the square root. The likelihood decides.
fn guesses(sensors: &[Sensor]) -> [Statistics; 4] {
    [0.5, 1.0, 2.0, 4.0].map(|frequency| Statistics { noise: usual(frequency), ..known::usual(sensors) })
}

/// Usual statistics of a vessel that waves of this frequency \[rad/s\] move.
pub(super) fn usual(frequency: f64) -> Noise {
    let degree = PI / 180.0;
    let rate = 0.06 * frequency * frequency;
    Noise {
        surge_rate: rate,
        surge_acceleration: rate,
        sway_rate: rate,
        sway: 0.1,
        pivot_rate: rate,
        yaw_rate: rate,
        yaw: rate,
        wave_frequency: frequency,
        wave_damping: 0.1,
        wave_forward: 0.1,
        wave_starboard: 0.1,
        gnss_rate: 1.0 / 60.0,
        gnss: 1.0,
        compass_rate: 0.1,
        compass: 0.3 * degree,
        gyro_walk: 1e-5,
        accelerometer_walk: 1e-4,
        current_walk: 1e-4,
    }
}

/// Computes the tables of the recordings of one vessel, whose sensors have the same statistics. What is not
/// [known](Sensors::known) of the sensors is estimated, and filled in.
pub(super) fn tables(
    recordings: &[Recording],
    selection: &mut Selection,
    options: &PrepareOptions,
    notes: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<Vec<RawLog>, LogError> {
    let Some(sensors) = &selection.sensors else { return Ok(Vec::new()) };
    let mut instruments = recordings
        .iter()
        .map(|recording| Instruments::new(recording, sensors, notes))
        .collect::<Result<Vec<_>, _>>()?;
    let chosen = recordings.iter().zip(&mut instruments);
    let chosen = chosen.map(|(recording, one)| choose(recording, one, selection, options));
    let chosen = chosen.collect::<Result<Vec<_>, _>>()?;
    let mut contradictions = Vec::with_capacity(instruments.len());
    for one in &mut instruments {
        let found = one.check_gnss();
        // Exchanged axes of the positions are no turned heading.
        if found.is_none() {
            one.check_heading()?;
        }
        one.turn_axes(notes);
        let note = |text: &String| Note::warning(format!("{}: {text}", one.path)).with_remedy(CHECK_GNSS);
        notes.extend(found.iter().map(note));
        contradictions.push(found);
    }
    let qualities = qualities(&instruments);
    let mut placed = known::placed(sensors, &qualities);
    let mut runs =
        Runs { sensors: placed.iter().map(|placed| placed.sensor.clone()).collect(), runs: Vec::new() };
    let (mut times, mut counts) = (Vec::new(), Vec::new());
    for one in &instruments {
        let parts = one.parts(options.dt, notes)?;
        runs.runs.extend(parts.iter().map(|part| one.run(part, &runs.sensors, &qualities)));
        counts.push(parts.len());
        times.extend(parts.into_iter().map(|part| part.times));
    }
    retain_used(&mut runs, &mut placed);
    // What is wrong with the other columns is found before the long computation.
    let others =
        recordings.iter().map(|recording| others(recording, selection)).collect::<Result<Vec<_>, _>>()?;
    let calibrations;
    let statistics = if let Some(known) = &sensors.known {
        known::check(known, &instruments.first().map_or(String::new(), |one| one.path.clone()))?;
        for run in &mut runs.runs {
            run.prior = known::prior(known, &run.prior);
        }
        calibrations = known::calibrations(known, &runs.sensors);
        Statistics { noise: known.noise, ..known::usual(&runs.sensors) }
    } else {
        let guesses = guesses(&runs.sensors);
        let sample = sample(&runs);
        let halves = halves(&sample);
        let (fitted, found) =
            navigate::calibrate(&sample, &halves, &guesses, &mut |done| progress(FIT * done))?;
        calibrations = found;
        for run in &mut runs.runs {
            run.prior = fitted.prior(&run.prior);
            for of in &calibrations {
                let (value, _) = of.used();
                run.prior = run.prior.clone().with(of.state, value, 0.0).linearized_at(of.state, value);
            }
        }
        fitted.statistics
    };
    let smoothed =
        navigate::smooth(&runs, &statistics, &times, &mut |done| progress(FIT + (1.0 - FIT) * done))?;
    let mut smoothed = joined(smoothed, &counts);
    for ((one, smoothed), chosen) in instruments.iter().zip(&mut smoothed).zip(&chosen) {
        if let Some(Chosen { kept, .. }) = chosen {
            smoothed.rows.retain(|row| kept.has(row.t + one.origin));
            let (rows, parts) = (count(smoothed.rows.len(), "row"), selection.parts.described());
            notes.push(Note::info(format!("{}: {rows} are used ({parts})", one.path)));
        }
        one.cut_outages(&mut smoothed.rows, options.max_gap_s, notes);
        // An error of all rows ends none of them.
        for calibration in &calibrations {
            widen(smoothed, calibration);
        }
    }
    for ((one, smoothed), contradiction) in instruments.iter().zip(&smoothed).zip(contradictions) {
        check_outliers(&one.path, &runs.sensors, smoothed, contradiction)?;
        one.check_estimate(&smoothed.rows)?;
    }
    let mut tables = Vec::with_capacity(recordings.len());
    for (i, one) in instruments.iter().enumerate() {
        let zero = chosen[i].as_ref().map(|chosen| chosen.zero);
        tables.push(one.table(&recordings[i], &others[i], &smoothed[i], zero, notes)?);
    }
    if let (Some(one), Some(last)) = (instruments.first(), smoothed.last()) {
        let path =
            if instruments.len() == 1 { one.path.clone() } else { format!("the {} logs", instruments.len()) };
        let is_known = selection.sensors.as_ref().is_some_and(|sensors| sensors.known.is_some());
        states(&path, one, last, (&calibrations, is_known), notes);
    }
    for (one, smoothed) in instruments.iter().zip(&smoothed) {
        outliers(&one.path, &runs.sensors, smoothed, notes);
        current(&one.path, smoothed, notes);
    }
    if let (Some(sensors), Some(last)) = (&mut selection.sensors, smoothed.last()) {
        sensors.known.get_or_insert_with(|| known::of(&placed, &statistics, last));
    }
    Ok(tables)
}

/// The parts of a recording that are used.
struct Chosen {
    /// Time \[s\] of the first row of all of its parts, from which the table counts.
    zero: f64,
    kept: Kept,
}

/// Leaves the measurements of the parts that are used.
fn choose(
    recording: &Recording,
    one: &mut Instruments,
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<Option<Chosen>, LogError> {
    if selection.parts.is_all() {
        return Ok(None);
    }
    let times: Vec<f64> =
        one.parts(options.dt, &mut Vec::new())?.into_iter().flat_map(|part| part.times).collect();
    let zero = times.first().copied().unwrap_or(0.0);
    let kept = recording.parts(selection, zero + one.origin)?;
    if !times.iter().any(|t| kept.has(*t + one.origin)) {
        let times: Vec<f64> = times.iter().map(|t| t - zero).collect();
        return Err(no_rows(one.path.clone(), &selection.parts, &times));
    }
    one.keep(&kept);
    Ok(Some(Chosen { zero, kept }))
}

/// The parts of each recording as one: `counts` are their numbers.
fn joined(parts: Vec<Smoothed>, counts: &[usize]) -> Vec<Smoothed> {
    let mut parts = parts.into_iter();
    let mut all = Vec::with_capacity(counts.len());
    for count in counts {
        let mut own = parts.by_ref().take(*count);
        let Some(mut whole) = own.next() else { continue };
        for part in own {
            for (sensor, more) in part.counts.into_iter().enumerate() {
                whole.counts[sensor] += more;
                let share = more / whole.counts[sensor].max(1.0);
                whole.outliers[sensor] += share * (part.outliers[sensor] - whole.outliers[sensor]);
                whole.nis[sensor] += share * (part.nis[sensor] - whole.nis[sensor]);
            }
            whole.rows.extend(part.rows);
            whole.end = part.end;
        }
        all.push(whole);
    }
    all
}

/// The kinds of position fixes, the most frequent first.
fn qualities(instruments: &[Instruments]) -> Vec<f64> {
    let mut counts: Vec<(f64, usize)> = Vec::new();
    let all = instruments.iter().filter(|one| one.position.is_some()).flat_map(|one| &one.quality);
    for value in all.flat_map(|series| series.pairs().map(|(_, value)| value)) {
        if let Some(count) = counts.iter_mut().find(|count| count.0 == value) {
            count.1 += 1;
        } else if counts.len() <= QUALITIES {
            counts.push((value, 1));
        }
    }
    // A quality of many values is not a kind.
    if counts.len() > QUALITIES {
        return Vec::new();
    }
    counts.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.total_cmp(&b.0)));
    counts.into_iter().map(|(value, _)| value).collect()
}

/// Leaves out sensors without measurements.
fn retain_used(runs: &mut Runs, placed: &mut Vec<Placed>) {
    let used: Vec<bool> = (0..runs.sensors.len())
        .map(|sensor| runs.runs.iter().any(|run| run.events.iter().any(|event| event.sensor == sensor)))
        .collect();
    let place = |sensor: usize| used[..sensor].iter().filter(|used| **used).count();
    for event in runs.runs.iter_mut().flat_map(|run| &mut run.events) {
        event.sensor = place(event.sensor);
    }
    let mut kept = used.iter();
    placed.retain(|_| kept.next().is_some_and(|kept| *kept));
    runs.sensors = placed.iter().map(|placed| placed.sensor.clone()).collect();
}

/// The beginnings of runs from which the statistics are estimated: of all of them, since they differ in heading and
/// manoeuvres, but of eight at most, so that each is long enough.
fn sample(runs: &Runs) -> Runs {
    let mut left = ENOUGH;
    let share = ENOUGH / runs.runs.len().clamp(1, 8);
    let mut sample = Runs { sensors: runs.sensors.clone(), runs: Vec::new() };
    for run in &runs.runs {
        let take = run.events.len().min(share).min(left);
        if take > 0 {
            sample.runs.push(Run { events: run.events[..take].to_vec(), prior: run.prior.clone() });
            left -= take;
        }
    }
    sample
}

/// The halves of the measurements of runs, by runs if there are several.
fn halves(runs: &Runs) -> [Runs; 2] {
    let of = |runs_: Vec<Run>| Runs { sensors: runs.sensors.clone(), runs: runs_ };
    if let [run] = &runs.runs[..] {
        let (first, second) = run.events.split_at(run.events.len() / 2);
        let second = Run { events: second.to_vec(), prior: start(second, &runs.sensors) };
        return [of(vec![Run { events: first.to_vec(), prior: run.prior.clone() }]), of(vec![second])];
    }
    let all: usize = runs.runs.iter().map(|run| run.events.len()).sum();
    let mut before = 0;
    let in_first = |run: &&Run| {
        before += run.events.len();
        2 * before <= all
    };
    let count = runs.runs.iter().take_while(in_first).count().clamp(1, runs.runs.len().max(2) - 1);
    [of(runs.runs[..count].to_vec()), of(runs.runs[count..].to_vec())]
}

/// Adds the standard deviation of a constant of the sensors, which is fixed in the smoother, to those of its results.
fn widen(smoothed: &mut Smoothed, calibration: &Calibration) {
    let (value, deviation) = calibration.used();
    smoothed.end[calibration.state as usize] = (value, deviation);
    let changes: Vec<f64> = smoothed
        .rows
        .windows(2)
        .map(|rows| (rows[1].ground[0] - rows[0].ground[0]) / (rows[1].t - rows[0].t))
        .chain([0.0])
        .collect();
    for (row, change) in smoothed.rows.iter_mut().zip(changes) {
        let [u, v, r] = row.ground;
        // A delay shows the velocities of before, and the direction of the path of before in a turn.
        let [with_u, with_v] =
            if calibration.state == State::Misalignment { [v, u] } else { [change, u * r] };
        let [of_u, of_v, _] = &mut row.ground_deviation;
        (*of_u, *of_v) = (of_u.hypot(deviation * with_u), of_v.hypot(deviation * with_v));
    }
}

/// Columns that are computed from sensors, with their units.
type Computed = (&'static str, &'static str, fn(&navigate::Row) -> f64);
const COMPUTED: [Computed; 9] = [
    ("x", "m", |row| row.pose[0]),
    ("y", "m", |row| row.pose[1]),
    ("psi", "rad", |row| row.pose[2]),
    ("u", "m/s", |row| row.ground[0]),
    ("v", "m/s", |row| row.ground[1]),
    ("r", "rad/s", |row| row.ground[2]),
    ("deviation_u", "m/s", |row| row.ground_deviation[0]),
    ("deviation_v", "m/s", |row| row.ground_deviation[1]),
    ("deviation_r", "rad/s", |row| row.ground_deviation[2]),
];

/// A column of a recording in a table.
struct Other {
    column: usize,
    /// Whether the values are held until they change.
    held: bool,
    /// The period of an angle.
    period: Option<f64>,
}

/// The commands and the wind of a recording.
///
/// # Errors
/// If the selection cannot be applied to a table with these columns.
fn others(recording: &Recording, selection: &Selection) -> Result<Vec<Other>, LogError> {
    let computed = COMPUTED.iter().map(|&(name, unit, _)| RawColumn::of(name, Some(unit), Vec::new()));
    let mut columns: Vec<RawColumn> = std::iter::once(table::time(&[])).chain(computed).collect();
    let mut others = Vec::new();
    let wind =
        selection.wind.iter().flat_map(|wind| [(&wind.speed, false, false), (&wind.direction, false, true)]);
    for (spec, held, direction) in selection.inputs.iter().map(|spec| (spec, true, false)).chain(wind) {
        if spec.column == "none" && selection.inputs.len() == 1 {
            continue;
        }
        let column = recording.position(spec)?;
        let name = &recording.log.columns[column].name;
        if !columns.iter().any(|column| column.name == *name) {
            columns.push(recording.column(column, Vec::new()));
            others.push(Other { column, held, period: recording.period(spec, direction)? });
        }
    }
    let header = RawLog::without_rows(&recording.log.path, columns);
    Resolved::new(&header, selection, None, &mut Vec::new())?;
    Ok(others)
}

impl Instruments {
    fn table(
        &self,
        recording: &Recording,
        others: &[Other],
        smoothed: &Smoothed,
        zero: Option<f64>,
        notes: &mut Vec<Note>,
    ) -> Result<RawLog, LogError> {
        let t: Vec<f64> = smoothed.rows.iter().map(|row| row.t).collect();
        let zero = zero.or(t.first().copied()).unwrap_or(0.0);
        let absolute: Vec<f64> = t.iter().map(|t| t + self.origin).collect();
        let computed = COMPUTED
            .iter()
            .map(|&(name, unit, of)| RawColumn::of(name, Some(unit), smoothed.rows.iter().map(of).collect()));
        let mut columns: Vec<RawColumn> =
            std::iter::once(table::time_from(zero, &t)).chain(computed).collect();
        for Other { column, held, period } in others {
            let values = if *held {
                recording.held(*column, &absolute)
            } else {
                recording.interpolated(*column, &absolute, *period)
            };
            columns.push(recording.column(*column, values));
        }
        notes.push(table::start(&self.path, zero + self.origin));
        RawLog::from_columns(&self.path, columns)
    }
}

/// Notes on delay, misalignment and bias.
fn states(
    path: &str,
    one: &Instruments,
    smoothed: &Smoothed,
    (calibrations, is_known): (&[Calibration], bool),
    notes: &mut Vec<Note>,
) {
    let of = |state: State| smoothed.end[state as usize];
    let (mut found, mut small) = (Vec::new(), Vec::new());
    for calibration in calibrations {
        let (value, deviation) = (calibration.whole.0, calibration.deviation());
        let is_delay = calibration.state == State::Delay;
        // What is known of the sensors is that of other logs.
        let source = if is_known { ", by the logs of the model" } else { "" };
        let text = if is_delay {
            format!("the GNSS is {value:.3} ± {deviation:.3} s late{source}")
        } else {
            let degree = 180.0 / PI;
            format!(
                "the compass shows {:.2} ± {:.2} deg too much{source}",
                degree * value,
                degree * deviation
            )
        };
        if calibration.is_open() {
            let assumed = if calibration.is_determined { "this" } else { "zero" };
            let (effect, remedy) = if is_delay {
                (
                    ", and v is wrong by this delay times u and r",
                    "record the accelerations of an inertial unit, and changes of speed and course",
                )
            } else {
                (
                    ", and v has a constant error in proportion to u",
                    "record straight courses in several directions",
                )
            };
            notes.push(
                Note::warning(format!(
                    "{path}: the measurements do not determine whether {text}: {assumed} is assumed{effect}"
                ))
                .with_remedy(remedy),
            );
        } else if calibration.is_determined {
            found.push(text);
        } else {
            small.push(text);
        }
    }
    if !small.is_empty() {
        notes.push(Note::info(format!("{path}: {}; this is not corrected", small.join(", "))));
    }
    if one.heading.is_none() {
        notes.push(
            Note::warning(format!(
                "{path}: there is no heading: v cannot be told from a current, and its standard deviation does not include that"
            ))
            .with_remedy("record a compass or a heading of two antennas"),
        );
    }
    if one.yaw_rate.is_some() {
        let (bias, deviation) = of(State::GyroBias);
        found.push(format!("the bias of the gyro is {bias:.5} ± {deviation:.5} rad/s at the end"));
    }
    if !found.is_empty() {
        notes.push(Note::info(format!("{path}: {}; this is corrected", found.join(", "))));
    }
}

/// A note on the current, if the headings of the run make it observable.
fn current(path: &str, smoothed: &Smoothed, notes: &mut Vec<Note>) {
    let [north, east] = [State::CurrentNorth, State::CurrentEast].map(|state| smoothed.end[state as usize]);
    let deviation = north.1.max(east.1);
    // On courses to one side, only the model of sway distinguishes a current from sway.
    if deviation < 0.5 * CURRENT_M_S && turned(&smoothed.rows) > PI / 2.0 {
        notes.push(Note::info(format!(
            "{path}: the current flows with {:.2} m/s to the north and {:.2} m/s to the east, ± {deviation:.2} m/s; u and v are over ground",
            north.0, east.0
        )));
    }
}

/// The arc in which all headings lie \[rad\].
fn turned(rows: &[navigate::Row]) -> f64 {
    let mut headings: Vec<f64> = rows.iter().map(|row| row.pose[2].rem_euclid(TAU)).collect();
    headings.sort_by(f64::total_cmp);
    let next = headings.iter().skip(1).copied().chain(headings.first().map(|psi| psi + TAU));
    TAU - headings.iter().zip(next).map(|(a, b)| b - a).fold(0.0, f64::max)
}

/// Remedy of measurements of the GNSS that contradict the others.
const CHECK_GNSS: &str = "check columns and units of position, speed and course in the section [log.sensors]";

const CHECK_HEADING: &str =
    "check columns and units of heading, yaw rate and acceleration in the section [log.sensors]";

/// Refuses a motion from sensors most of whose measurements contradict it.
fn check_outliers(
    path: &str,
    sensors: &[Sensor],
    smoothed: &Smoothed,
    contradiction: Option<String>,
) -> Result<(), LogError> {
    let kinds =
        [(Kind::Position, "positions"), (Kind::Velocity, "GNSS velocities"), (Kind::Heading, "headings")];
    for (kind, name) in kinds {
        let own = || (0..sensors.len()).filter(|sensor| sensors[*sensor].kind == kind);
        let all: f64 = own().map(|sensor| smoothed.counts[sensor]).sum();
        let outliers: f64 = own().map(|sensor| smoothed.counts[sensor] * smoothed.outliers[sensor]).sum();
        if outliers > 0.5 * all {
            return Err(LogError::Unusable {
                path: path.to_owned(),
                reason: format!(
                    "{:.1} % of the {name} are outliers: they contradict each other, or the other sensors{}",
                    100.0 * outliers / all,
                    contradiction.map_or_else(String::new, |text| format!("; {text}"))
                ),
                remedy: if kind == Kind::Heading { CHECK_HEADING } else { CHECK_GNSS }.to_owned(),
            });
        }
    }
    Ok(())
}

/// A note on outliers.
fn outliers(path: &str, sensors: &[Sensor], smoothed: &Smoothed, notes: &mut Vec<Note>) {
    for (sensor, share) in sensors.iter().zip(&smoothed.outliers) {
        // One in thousands is expected.
        if *share > 0.02 {
            let name = match sensor.kind {
                Kind::Position => "positions",
                Kind::Velocity => "GNSS velocities",
                Kind::Heading => "headings",
                Kind::YawRate => "yaw rates",
                Kind::SpecificForce => "accelerations",
                Kind::OverGround | Kind::ThroughWater => "velocities",
            };
            notes.push(Note::info(format!(
                "{path}: {:.1} % of the {name} are outliers, and count less",
                100.0 * share
            )));
        }
    }
}
