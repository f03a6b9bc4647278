//! A model that follows a vessel: from each sample to status, estimate and predictions.

use std::collections::VecDeque;
use std::fmt::Write as _;

use hydroid_core::adapt::{Adapter, Outcome, Rejection};
use hydroid_core::control::Stop;

use super::answer::{Status, Writer};
use super::clock::{Arrival, Clock};
use super::commands::Commands;
use super::line::Sample;
use super::session::{Session, Transition};
use super::{StreamError, names};
use hydroid::adapt::events::EventText;
use hydroid::boat::{Raw, Role};
use hydroid::closed_loop::{ActuatorCheck, ActuatorFault, Pilot, longest_gap};
use hydroid::evaluate::DesignRange;
use hydroid::log::{CommandTiming, LogError, PrepareOptions};
use hydroid::model::{Model, Port};
use hydroid::plant::{find_roles, input_values};

/// From this gap on \[s\], a time without a unit is probably not in seconds.
const DOUBTFUL_S: f64 = 30.0;

/// Widths of its range by which a command may lie outside it: the limit beyond which a rollout counts as diverged.
const MOST_WIDTHS: f64 = 10.0;

/// Part of the range of an actuator by which an echoed command may be rounded, and by which it is another command.
const BEYOND: f64 = 0.01;
const UNLIKE: f64 = 0.05;

/// Largest number of answers that a command is compared with.
const MOST_ANSWERS: usize = 1000;

/// The commands that an input accepts. An input that hardly moved in the training has the scale of its values, at least 1
/// in its unit, as the range of a constant channel.
fn bounds(port: &Port) -> [f64; 2] {
    let DesignRange { low, high } = port.range;
    let trained = port.training_range.map_or(0.0, |range| range.high - range.low);
    let scale = [high - low, trained, low.abs(), high.abs(), 1.0].into_iter().fold(0.0, f64::max);
    [low - MOST_WIDTHS * scale, high + MOST_WIDTHS * scale]
}

/// Places, names and raw values of the inputs that are commanded.
fn commanded(model: &Model) -> impl Iterator<Item = (usize, &str, Option<Raw>)> {
    let boat = find_roles(model);
    let names = model.description.inputs.iter().map(|port| port.channel.name.as_str());
    let all =
        names.zip(model.description.raw_inputs()).enumerate().map(|(place, (name, raw))| (place, name, raw));
    all.filter(move |(_, name, _)| boat.role(name).is_none_or(Role::is_commanded))
}

/// A model with its adapter along the samples of a vessel.
pub(crate) struct Follower {
    pub(super) model: Model,
    pub(super) session: Session,
    pub(super) clock: Clock,
    pub(super) commands: Commands,
    pub(super) writer: Writer,
    /// Remarks on the present sample.
    pub(super) note: String,
    names: Vec<String>,
    /// Accepted commands.
    bounds: Vec<[f64; 2]>,
    /// Places of the inputs that are commanded.
    commanded: Vec<usize>,
    options: PrepareOptions,
    max_gap_s: f64,
    /// Whether the unit of the time is not stated.
    pub(super) time_is_unstated: bool,
    /// Time since the last line in which none arrived, and the part of it that has passed for the commands \[s\].
    waited_s: f64,
    told_s: f64,
    /// Time that has passed for the commands since the last line that was used \[s\].
    since_s: f64,
    /// Commands of the last answers, with the times of the lines after them.
    answered: VecDeque<(f64, Vec<f64>)>,
    /// `u`, `v` and `r` that were used last, and those of the last line.
    last: [f64; 3],
    raw: [f64; 3],
}

impl Follower {
    /// Before the first sample. The horizons are those of the predictions, ascending \[samples\].
    pub(crate) fn new(
        model: &Model,
        adapter: Box<dyn Adapter>,
        horizons: &[usize],
        options: PrepareOptions,
    ) -> Result<Self, StreamError> {
        let dt = model.description.dt;
        let max_gap_s = options.max_gap_s.unwrap_or_else(|| longest_gap(dt));
        Ok(Self {
            clock: Clock::new(dt, max_gap_s)?,
            commands: Commands::new(adapter.inputs(), dt, options.command_timing, options.input_delay)?,
            writer: Writer::new(
                model.description.outputs.iter().map(|port| port.channel.name.as_str()),
                commanded(model),
            ),
            session: Session::new(adapter, horizons.to_vec(), dt),
            model: model.clone(),
            note: String::new(),
            names: names(model),
            bounds: model.description.inputs.iter().map(bounds).collect(),
            commanded: commanded(model).map(|(place, ..)| place).collect(),
            options,
            max_gap_s,
            time_is_unstated: false,
            waited_s: 0.0,
            told_s: 0.0,
            since_s: 0.0,
            answered: VecDeque::new(),
            last: [f64::NAN; 3],
            raw: [f64::NAN; 3],
        })
    }

    /// Steers from now on. Commands of the samples are those that have acted.
    pub(crate) fn steer(&mut self, pilot: Pilot) -> Result<(), LogError> {
        let (inputs, dt) = (self.session.adapter().inputs(), self.model.description.dt);
        if self.options.command_timing != CommandTiming::After {
            self.options.command_timing = CommandTiming::After;
            self.commands = Commands::new(inputs, dt, CommandTiming::After, self.options.input_delay)?;
        }
        // The limits of the actuators are those of the boat, and need not be those of the training or of the controller.
        // A boat that contradicts itself was refused when the model was read.
        let boat = input_values(&self.model).unwrap_or_default();
        for (place, limits) in pilot.limits().iter().enumerate() {
            let own = [limits.low, limits.high];
            let [least, most] = boat.get(place).map_or(own, |value| value.limits);
            let limits = DesignRange { low: least.min(limits.low), high: most.max(limits.high) };
            let [low, high] = &mut self.bounds[place];
            if self.commanded.contains(&place) {
                let rounding = BEYOND * (limits.high - limits.low);
                (*low, *high) = (limits.low - rounding, limits.high + rounding);
            } else {
                (*low, *high) = (low.min(limits.low), high.max(limits.high));
            }
        }
        self.session.steer_by(pilot, &self.model);
        Ok(())
    }

    /// Commands far outside the range of the model, where a rollout would have diverged, count as missing.
    pub(crate) fn refuse_absurd_commands(&mut self, sample: &mut Sample) {
        let inputs = self.bounds.len().max(1);
        let plan = sample.plan.chunks_exact_mut(inputs);
        for (row, is_plan) in
            std::iter::once((&mut sample.inputs[..], false)).chain(plan.map(|row| (row, true)))
        {
            let ports = self.bounds.iter().zip(&self.model.description.inputs);
            for (command, (&[low, high], port)) in row.iter_mut().zip(ports) {
                if *command < low || *command > high {
                    let what = if is_plan { "planned command" } else { "command" };
                    say(
                        &mut self.note,
                        format_args!(
                            "the {what} {} = {command:e} is beyond {low} to {high} and was refused",
                            port.channel.name
                        ),
                    );
                    *command = f64::NAN;
                }
            }
        }
    }

    /// A velocity that changes by more than the whole range of the model from one sample to the next counts as missing, unless the line
    /// before had it, too.
    pub(super) fn screen(&mut self, sample: &mut Sample) {
        let Some(pilot) = self.session.pilot() else { return };
        let ports = &self.model.description.outputs;
        for ((last, before), place) in self.last.iter_mut().zip(&mut self.raw).zip(pilot.motion()) {
            let (value, port) = (sample.outputs[place], &ports[place]);
            let widths =
                port.training_range.into_iter().chain([port.range]).map(|range| range.high - range.low);
            let width = widths.fold(0.0, f64::max);
            let is_far = |from: f64| (value - from).abs() > width && width > 0.0;
            if is_far(*last) && (is_far(*before) || before.is_nan()) {
                say(
                    &mut self.note,
                    format_args!(
                        "{} goes from {last} to {value}, by more than the range of the model, and is not used",
                        port.channel.name
                    ),
                );
                sample.outputs[place] = f64::NAN;
            } else if value.is_finite() {
                *last = value;
            }
            *before = value;
        }
    }

    /// Says that the commands that acted are not those of the answers, for longer than measurements may be old. Commands may act later
    /// by as much.
    fn compare_commands(&mut self, sample: &Sample) {
        let Some(pilot) = self.session.pilot() else { return };
        let limit_s = pilot.liveness().limit_s();
        self.answered.push_back((sample.t, pilot.command().to_vec()));
        let is_old = |(t, _): &(f64, Vec<f64>)| !(sample.t - limit_s..=sample.t).contains(t);
        while self.answered.len() > MOST_ANSWERS || self.answered.front().is_some_and(is_old) {
            self.answered.pop_front();
        }
        let ports = &self.model.description.inputs;
        let mut other = None;
        for &place in &self.commanded {
            let (acted, answered) = (sample.inputs[place], pilot.command()[place]);
            let width = pilot.limits()[place].high - pilot.limits()[place].low;
            let all = self.answered.iter().map(|(_, command)| command[place]);
            let (low, high) = all.fold((answered, answered), |(low, high), x| (low.min(x), high.max(x)));
            if acted < low - UNLIKE * width || acted > high + UNLIKE * width {
                other = Some((&ports[place].channel.name, acted, answered));
            }
        }
        let Some((name, acted, answered)) = other.filter(|_| !self.commands.agreed.is_nan()) else {
            self.commands.agreed = sample.t;
            return;
        };
        let since = sample.t - self.commands.agreed;
        if since > pilot.liveness().limit_s() {
            say(
                &mut self.note,
                format_args!(
                    "the commands are not carried out: {name} was {acted} where {answered} was answered, for {since:.1} s"
                ),
            );
        }
    }

    /// Advances to a sample on the grid, and collects remarks.
    pub(crate) fn follow(&mut self, sample: &Sample) -> Status {
        self.compare_commands(sample);
        let before = self.clock.seen();
        let arrival = self.clock.arrive(sample.t);
        match arrival {
            Arrival::First => self.pass_used(f64::INFINITY),
            Arrival::Next(steps) => self.pass_used(steps as f64 * self.model.description.dt),
            Arrival::Gap(gap) => self.pass_used(gap),
            Arrival::SetBack(_) => self.pass_used(self.max_gap_s),
            Arrival::Late(_) | Arrival::Ahead(_) | Arrival::Between => {}
        }
        let (max_gap, commands) = (self.max_gap_s, &mut self.commands);
        let (transition, reset) = match arrival {
            Arrival::Late(by) => {
                say(&mut self.note, format_args!("the sample is {by:.3} s before the last used one"));
                self.pass_line();
                return Status::Late;
            }
            Arrival::Ahead(by) => {
                say(
                    &mut self.note,
                    format_args!(
                        "the sample is {by:.3} s after the last used one: used if the next lines confirm it"
                    ),
                );
                self.pass_line();
                return Status::Ahead;
            }
            Arrival::SetBack(by) => {
                say(
                    &mut self.note,
                    format_args!(
                        "the clock was set back by {by:.3} s: a new run begins, the weights are kept"
                    ),
                );
                // The true time since the last sample of a clock that was set is not known.
                (self.session.begin(commands, sample, Some(max_gap)), true)
            }
            Arrival::Between => {
                // The stamp is known, and may be that of the line before.
                let step = self.clock.seen() - before;
                self.pass_line_of(if step > 0.0 { step } else { self.clock.interval() });
                return Status::Between;
            }
            Arrival::First => (self.session.begin(commands, sample, None), false),
            Arrival::Gap(gap) => {
                say(
                    &mut self.note,
                    format_args!("no sample for {gap:.3} s: a new run begins, the weights are kept"),
                );
                if gap > DOUBTFUL_S && self.time_is_unstated {
                    say(
                        &mut self.note,
                        format_args!("if the time is not in seconds, name it with its unit, as t [ms]"),
                    );
                }
                (self.session.begin(commands, sample, Some(gap)), true)
            }
            Arrival::Next(steps) => {
                if steps > 1 {
                    say(&mut self.note, format_args!("{} missing samples were predicted", steps - 1));
                }
                (self.session.advance_to(steps, commands, sample), false)
            }
        };
        self.add_remarks(transition);
        let reset = reset || transition.restarted;
        let outcome = self.session.adapter().outcome();
        match outcome {
            Outcome::Inflated { deviations, weight } => say(
                &mut self.note,
                format_args!(
                    "innovation of {deviations:.1} standard deviations, accepted with weight {weight:.2}"
                ),
            ),
            Outcome::Rejected(Rejection::Outlier { deviations }) => {
                say(&mut self.note, format_args!("innovation of {deviations:.1} standard deviations"));
            }
            Outcome::Rejected(Rejection::NotFinite) => {
                say(&mut self.note, format_args!("value too large for the filter"));
            }
            Outcome::Waiting | Outcome::Accepted | Outcome::RolledBack => {}
        }
        if let Some(guard) = self.session.adapter().guard() {
            for event in guard.events() {
                say(
                    &mut self.note,
                    format_args!("{}", EventText { action: &event.action, names: &self.names }),
                );
            }
        }
        self.explain_unknown(sample);
        self.explain_lost();
        let constant = self.session.pilot().is_some_and(|pilot| !pilot.adapts());
        match outcome {
            _ if reset => Status::Reset,
            Outcome::Waiting if constant => Status::Constant,
            outcome => Status::Used(outcome),
        }
    }

    /// Time passes \[s\] in which no line arrives.
    pub(super) fn wait(&mut self, seconds: f64) {
        self.waited_s += seconds;
        self.pass(seconds);
        self.told_s += seconds;
    }

    /// A line arrives after some more time \[s\]. What it holds decides how much time counts.
    pub(super) fn arrive_after(&mut self, seconds: f64) {
        self.waited_s += seconds;
    }

    /// What arrived was no line: the time in which it was awaited passes.
    pub(super) fn await_on(&mut self) {
        let untold = self.waited_s - self.told_s;
        self.pass(untold);
        self.told_s = self.waited_s;
    }

    fn pass(&mut self, seconds: f64) {
        self.since_s += seconds;
        self.session.pass(&mut self.commands, seconds);
    }

    /// A line is used, `elapsed` seconds after the one before by its stamp: the time of waiting counts if it is longer.
    fn pass_used(&mut self, elapsed: f64) {
        let untold = self.waited_s - self.told_s;
        if self.since_s + untold > elapsed {
            self.pass(untold);
        }
        (self.waited_s, self.told_s, self.since_s) = (0.0, 0.0, 0.0);
    }

    /// A line without a stamp that counts, and without a sample that is used: it is taken as one mean interval of the lines.
    /// A second one in a row beside the time grid is not a wrong stamp: the time since the last sample is not known.
    pub(super) fn pass_line(&mut self) {
        let is_set = self.clock.set_aside() > 1;
        self.pass_line_of(if is_set { f64::INFINITY } else { self.clock.interval() });
    }

    /// A line that was answered before a restart: its time is in the resumed state, and only the time of waiting passes.
    pub(super) fn pass_repeated(&mut self) {
        self.pass_line_of(0.0);
    }

    /// A line that stands for a time \[s\], or for the time in which it was awaited if that is longer.
    fn pass_line_of(&mut self, seconds: f64) {
        self.pass((seconds.max(self.waited_s) - self.told_s).max(0.0));
        (self.waited_s, self.told_s) = (0.0, 0.0);
        self.explain_lost();
    }

    /// Says why the commands rest.
    pub(super) fn explain_lost(&mut self) {
        let Some(pilot) = self.session.pilot() else { return };
        if let Some(why) = self.why_stopped() {
            say(&mut self.note, format_args!("{why}: the commands rest until the service is started anew"));
        }
        if pilot.stuck_s() > 0.0 {
            say(
                &mut self.note,
                format_args!(
                    "the position has been the same to the last digit for {:.1} s under commands that move the vessel, and is not used: check the receiver",
                    pilot.stuck_s()
                ),
            );
        }
        let [position_m, heading_rad] = pilot.contradicted();
        if position_m > 0.0 {
            say(
                &mut self.note,
                format_args!(
                    "the position is {position_m:.1} m from where heading, u and v have led, and is not used: one of them is wrong"
                ),
            );
        }
        if heading_rad > 0.0 {
            let heading_deg = heading_rad.to_degrees();
            say(
                &mut self.note,
                format_args!(
                    "the heading is {heading_deg:.0} deg from where r has led, and is not used: one of them is wrong"
                ),
            );
        }
        let Some(oldest) = pilot.lost().map(|(_, age)| age).reduce(f64::max) else { return };
        let names: Vec<&str> = pilot.lost().map(|(name, _)| name).collect();
        let (names, limit) = (names.join(", "), pilot.liveness().limit_s());
        let remark = if oldest.is_finite() {
            format!("no measurement of {names} for {oldest:.3} s, more than {limit} s: the commands rest")
        } else {
            format!("the age of the last measurement of {names} is not known: the commands rest")
        };
        say(&mut self.note, format_args!("{remark}"));
    }

    /// Why the vessel was stopped, in words.
    pub(crate) fn why_stopped(&self) -> Option<String> {
        let stop = self.session.pilot()?.stop()?;
        let name = |input: usize| &self.model.description.inputs[input].channel.name;
        let found = self.session.check().and_then(ActuatorCheck::found).filter(|_| stop == Stop::Unanswered);
        let which = found.map(|fault| match fault {
            ActuatorFault::Lost(input) => format!("{} acts as if it had no effect", name(input)),
            ActuatorFault::Reversed(input) => format!("{} acts as if it were reversed", name(input)),
            ActuatorFault::AllLost => String::from("it moves as if no command had an effect"),
        });
        Some(which.map_or_else(|| stop.text().to_owned(), |which| format!("{}: {which}", stop.text())))
    }

    fn add_remarks(&mut self, transition: Transition) {
        if transition.restarted {
            say(
                &mut self.note,
                format_args!(
                    "the state of the adapter was not finite: it begins again with the weights of the model"
                ),
            );
        }
        if transition.held {
            say(&mut self.note, format_args!("a missing command was replaced by the last one"));
        }
        if transition.lost {
            say(&mut self.note, format_args!("a new run begins because the previous command is unknown"));
        }
        if !self.commands.known() {
            say(&mut self.note, format_args!("the current command is not known yet"));
        }
    }

    /// Says why numbers of the answer are null.
    fn explain_unknown(&mut self, sample: &Sample) {
        let Self { session, names, note, .. } = self;
        let innovations = session.adapter().innovations();
        for (i, (y, estimate)) in sample.outputs.iter().zip(session.estimate()).enumerate() {
            if !estimate.is_finite() {
                say(note, format_args!("{} is not known yet", names[i]));
            } else if y.is_nan() {
                say(note, format_args!("{} was not measured", names[i]));
            } else if innovations.get(i).is_some_and(|innovation| !innovation.value.is_finite()) {
                say(note, format_args!("{} was not used", names[i]));
            }
        }
        let [predictions, bands] = session.unknown();
        if predictions > 0 {
            let all = session.horizons().len();
            say(note, format_args!("no finite prediction at {predictions} of {all} horizons"));
        } else if bands > 0 {
            let all = session.horizons().len();
            say(note, format_args!("no prediction bands at {bands} of {all} horizons"));
        }
    }

    /// Steers no more.
    pub(crate) fn release(&mut self) {
        self.session.release();
    }

    /// Predicts the track of samples with a pose, without a pilot, too.
    pub(crate) fn predict_track(&mut self) {
        let place =
            |name: &str| self.model.description.outputs.iter().position(|port| port.channel.name == name);
        if let [Some(u), Some(v), Some(r)] = ["u", "v", "r"].map(place) {
            self.session.predict_track_of([u, v, r]);
        }
    }

    /// Prediction of an output at each horizon.
    pub(crate) fn prediction(&self, output: usize) -> impl Iterator<Item = f64> {
        self.session.prediction(output)
    }

    /// Their standard deviations.
    pub(crate) fn deviations(&self, output: usize) -> impl Iterator<Item = f64> {
        self.session.deviations(output)
    }

    /// Predicted poses at the horizons, and upper bounds of the standard deviations of position \[m\] and heading \[rad\].
    pub(crate) fn track(&self) -> (&[[f64; 3]], &[[f64; 2]]) {
        self.session.track()
    }

    /// Computes no deviations of the predictions from now on.
    pub(crate) fn leave_out_bands(&mut self) {
        self.session.leave_out_bands();
    }

    /// Commands that the pilot plans, in rows; none without one.
    pub(crate) fn planned(&self) -> &[f64] {
        self.session.planned()
    }

    pub(crate) fn adapter(&self) -> &dyn Adapter {
        self.session.adapter()
    }

    pub(crate) fn adapter_mut(&mut self) -> &mut dyn Adapter {
        self.session.adapter_mut()
    }

    /// The controller, while it steers.
    pub(crate) fn pilot(&self) -> Option<&Pilot> {
        self.session.pilot()
    }

    /// Remarks since they were cleared.
    pub(crate) fn note(&self) -> &str {
        &self.note
    }

    pub(crate) fn clear_note(&mut self) {
        self.note.clear();
    }

    /// The answer to a sample that was followed, without its end.
    pub(crate) fn write(&mut self, number: u64, t: f64, status: Status) {
        self.writer.begin(number, Some(t), status, &self.note);
        self.write_steering(true);
        self.writer.session(&self.session);
        if self.session.pilot().is_some() {
            self.writer.track(&self.session);
        }
    }

    pub(super) fn write_steering(&mut self, used: bool) {
        if let Some(pilot) = self.session.pilot() {
            self.writer.steering(pilot, used);
        }
    }
}

pub(super) fn say(note: &mut String, remark: std::fmt::Arguments<'_>) {
    if !note.is_empty() {
        note.push_str("; ");
    }
    let _ = note.write_fmt(remark);
}
