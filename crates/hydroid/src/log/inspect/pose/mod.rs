//! Check of the outputs `u`, `v` and `r` against the pose in the log.
//!
//! The heading shows the yaw rate. The path, turned into the body frame by the heading, shows the velocities over
//! ground, with any current. Over windows of several lengths, the rates of the pose are compared with the channels as
//! read, and with the channels in other units, with the other sign, and exchanged. A channel is reported only if its
//! reading leaves a large part of the pose rate unexplained at every length and another reading explains nearly all of
//! it. A pose of poor quality is explained by no reading and reports nothing.
//!
//! The frame of the pose is often not stated. Both orders of the axes are tried. A path that is rotated against the
//! heading is accepted if the vessel moves mainly forward as read. A heading that grows counterclockwise changes the
//! signs of both `v` and `r`: these signs are reported if they contradict each other, or if the names of the columns
//! show the direction of the heading.

mod columns;
mod fit;
mod windows;

use super::super::columns::{Columns, Origin};
use super::super::csv::RawLog;
use super::super::gaps;
use super::super::note::Note;
use super::super::prepare::PrepareOptions;
use super::super::resolve::{self, Resolved, Source};
use super::super::selection::{ChannelSpec, Selection};
use crate::key::key;
use columns::PoseColumns;
use fit::{Fit, Frame, Motion, Products, Verdict};
use windows::Window;

/// Two factors of units differ by at least 9 %; smaller differences are rounding.
const SAME: f64 = 1e-6;

/// Outputs of which the pose shows whether they are right.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Compared {
    /// `r`.
    pub(super) yaw: bool,
    /// `u` or `v`.
    pub(super) path: bool,
}

/// Compares the outputs with the pose and adds a note for each one that contradicts it.
pub(super) fn check(
    log: &RawLog,
    resolved: &Resolved,
    selection: &Selection,
    options: &PrepareOptions,
    notes: &mut Vec<Note>,
) -> Compared {
    let none = Compared::default();
    let Ok(specs) = resolve::outputs_or_default(log, selection) else { return none };
    let Some(pose) = columns::find(log, resolved) else { return none };
    let Some((channels, windows)) = read(log, resolved, &pose, options.max_gap_s) else { return none };
    let check = Check { channels, windows, pose };
    let verdicts = check.verdicts();
    check.report(log, &specs, &verdicts, notes);
    let known = |motion: Motion| {
        let channel = check.channel_of(motion);
        channel.is_some_and(|channel| !matches!(verdicts[channel], Verdict::Unknown))
    };
    Compared { yaw: known(Motion::Yaw), path: known(Motion::Surge) || known(Motion::Sway) }
}

/// Columns that may belong to a pose, by their names.
pub(super) fn candidates(log: &RawLog) -> impl Iterator<Item = usize> {
    columns::candidates(log)
}

/// The only column of a log that is a heading by its name and its unit.
pub(in crate::log) fn heading(log: &RawLog, resolved: &Resolved) -> Option<Source> {
    columns::find(log, resolved).map(|pose| pose.heading)
}

/// The axes of the only position of a log.
pub(in crate::log) fn position(log: &RawLog, resolved: &Resolved) -> Option<[Source; 2]> {
    columns::position(log, resolved)
}

/// An output and the motion that its name states.
struct Checked {
    source: Source,
    motion: Motion,
    /// Position in the outputs.
    output: usize,
}

fn read(
    log: &RawLog,
    resolved: &Resolved,
    pose: &PoseColumns,
    max_gap_s: Option<f64>,
) -> Option<(Vec<Checked>, Vec<Vec<Window>>)> {
    let named = resolved.outputs.iter().enumerate().filter_map(|(output, source)| {
        let motion = Motion::of(&source.channel.name)?;
        Some(Checked { source: source.clone(), motion, output })
    });
    let channels: Vec<Checked> = named.collect();
    let mut sources: Vec<Source> = channels.iter().map(|c| c.source.clone()).collect();
    sources.push(pose.heading.clone());
    sources.extend(pose.position.iter().flatten().cloned());
    let pose_and_channels = Resolved {
        time: resolved.time.clone(),
        outputs: sources,
        inputs: Vec::new(),
        wind: None,
        truth: None,
        heading: None,
        position: None,
    };
    let columns = Columns::new(Origin::Borrowed(log), &pose_and_channels, &mut Vec::new()).ok()?;
    super::super::clock::check_order(&columns).ok()?;
    let step = super::Clock::usual_step(&columns.t)?;
    let limit = max_gap_s.unwrap_or_else(|| gaps::default_limit(&columns, step, None, &mut Vec::new()));
    let windows = windows::windows(&columns, channels.len(), pose.position.is_some(), limit);
    (!channels.is_empty() && !windows.is_empty()).then_some((channels, windows))
}

/// Verdicts on surge and sway with the positions of their channels, for those that are outputs.
type PathVerdicts = [Option<(usize, Verdict)>; 2];

struct Check {
    channels: Vec<Checked>,
    windows: Vec<Vec<Window>>,
    pose: PoseColumns,
}

impl Check {
    fn channel_of(&self, motion: Motion) -> Option<usize> {
        self.channels.iter().position(|c| c.motion == motion)
    }

    /// One verdict for each channel.
    fn verdicts(&self) -> Vec<Verdict> {
        let mut verdicts: Vec<Verdict> = self.channels.iter().map(|_| Verdict::Unknown).collect();
        if let Some(own) = self.channel_of(Motion::Yaw) {
            verdicts[own] = self.verdict(own, |channel| fit::yaw(&self.windows, channel));
        }
        if self.pose.position.is_some() {
            for (channel, verdict) in self.path_verdicts() {
                verdicts[channel] = verdict;
            }
        }
        self.exchanged(&mut verdicts);
        self.signs(&mut verdicts);
        verdicts
    }

    /// The verdict on a motion from the products of its pose rate with any channel.
    fn verdict(&self, own: usize, products: impl Fn(usize) -> Products) -> Verdict {
        let as_read = products(own);
        if let Some(residual) = as_read.as_read_is_right() {
            return Verdict::Right(residual);
        }
        let motion = self.channels[own].motion;
        let best = |channel: usize| {
            products(channel).best(motion, channel, self.channels[channel].source.unit_factor())
        };
        let others = || (0..self.channels.len()).filter(|&i| i != own).filter_map(best);
        best(own)
            .or_else(|| others().min_by(|a, b| a.residual.total_cmp(&b.residual)))
            .map_or(Verdict::Unknown, Verdict::Wrong)
    }

    /// Verdicts on surge and sway in the order of the axes that explains them best.
    fn path_verdicts(&self) -> Vec<(usize, Verdict)> {
        // The frame of the path is known only if it explains the surge velocity, or the sway velocity without one.
        let rank = |verdicts: &PathVerdicts| {
            let quality = |verdict: &Option<(usize, Verdict)>| match verdict {
                Some((_, Verdict::Right(residual))) => (0, *residual),
                Some((_, Verdict::Wrong(fit))) => (1, fit.residual),
                Some((_, Verdict::Unknown)) | None => (2, 0.0),
            };
            let [surge, sway] = [quality(&verdicts[0]), quality(&verdicts[1])];
            let main = if verdicts[0].is_some() { surge } else { sway };
            (main.0 < 2).then_some((main.0, u8::from(sway.0 != 0), main.1))
        };
        let frames = [0, 1].map(|axes| self.in_frame(Frame { axes, angle: 0.0 }));
        let ranked = frames.into_iter().filter_map(|verdicts| Some((rank(&verdicts)?, verdicts)));
        let best = ranked.min_by(|(a, _), (b, _)| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
        match best {
            Some(((1, ..), _)) if self.is_rotated() => Vec::new(),
            Some((_, verdicts)) => verdicts.into_iter().flatten().collect(),
            None => Vec::new(),
        }
    }

    /// Verdicts on surge and sway in a frame of the path.
    fn in_frame(&self, frame: Frame) -> PathVerdicts {
        let surge = self
            .channel_of(Motion::Surge)
            .map(|own| (own, self.verdict(own, |channel| fit::surge(&self.windows, channel, frame))));
        let moving = match &surge {
            Some((own, Verdict::Right(_))) => Some((*own, 1.0)),
            Some((_, Verdict::Wrong(fit))) => Some((fit.channel, fit.factor)),
            _ => None,
        };
        let sway = self
            .channel_of(Motion::Sway)
            .map(|own| (own, self.verdict(own, |channel| fit::sway(&self.windows, channel, frame, moving))));
        [surge, sway]
    }

    /// Whether the velocities as read explain the path in a rotated frame, and move the vessel mainly forward.
    fn is_rotated(&self) -> bool {
        let (Some(surge), sway) = (self.channel_of(Motion::Surge), self.channel_of(Motion::Sway)) else {
            return false;
        };
        let all = || self.windows.iter().flatten();
        let squares = |channel: usize| all().map(|w| w.mean[channel] * w.mean[channel]).sum::<f64>();
        let forward = all().map(|w| w.mean[surge]).sum::<f64>() > 0.0
            && sway.is_none_or(|sway| squares(sway) < squares(surge));
        let fits = |axes: usize| {
            // Angle of the path against the velocity as read, over all windows.
            let (along, across) = all().fold((0.0, 0.0), |(along, across), w| {
                let lateral = sway.map_or([0.0; 2], |sway| w.forward[sway]);
                let velocity = [w.forward[surge][0] - lateral[1], w.forward[surge][1] + lateral[0]];
                let path = w.path[axes];
                (
                    along + path[0] * velocity[0] + path[1] * velocity[1],
                    across + path[1] * velocity[0] - path[0] * velocity[1],
                )
            });
            let [surge, sway] = self.in_frame(Frame { axes, angle: across.atan2(along) });
            surge.is_some_and(|(_, verdict)| verdict.is_right())
                && sway.is_none_or(|(_, verdict)| verdict.fit().is_none())
        };
        forward && (fits(0) || fits(1))
    }

    /// Keeps a fit with the channel of another motion only if that motion is not right as read, and gives the channel
    /// that remains to a motion whose channel is taken.
    fn exchanged(&self, verdicts: &mut [Verdict]) {
        for own in 0..verdicts.len() {
            let taken = verdicts[own].fit().map(|fit| fit.channel).filter(|&channel| channel != own);
            let used = |channel: usize| {
                let by_other =
                    |(i, v): (usize, &Verdict)| i != own && v.fit().is_some_and(|f| f.channel == channel);
                verdicts[channel].is_right() || verdicts.iter().enumerate().any(by_other)
            };
            if taken.is_some_and(used) {
                verdicts[own] = Verdict::Unknown;
            }
        }
        let taken: Vec<usize> = verdicts.iter().filter_map(|v| v.fit().map(|fit| fit.channel)).collect();
        let right = |i: usize| verdicts[i].is_right();
        let left: Vec<usize> = (0..verdicts.len()).filter(|&i| !taken.contains(&i) && !right(i)).collect();
        let without: Vec<usize> = (0..verdicts.len())
            .filter(|&i| matches!(verdicts[i], Verdict::Unknown) && taken.contains(&i))
            .collect();
        if let ([channel], [own]) = (left.as_slice(), without.as_slice()) {
            let unit = self.channels[*own].motion.si();
            let (factor, found, residual) = (1.0, f64::NAN, f64::NAN);
            verdicts[*own] =
                Verdict::Wrong(Fit { channel: *channel, unit, negative: false, factor, found, residual });
        }
    }

    /// Withdraws signs that the direction of the heading may explain.
    fn signs(&self, verdicts: &mut [Verdict]) {
        let [yaw, sway] = [Motion::Yaw, Motion::Sway].map(|motion| self.channel_of(motion));
        let sign = |channel: Option<usize>| match &verdicts[channel?] {
            Verdict::Right(_) => Some(false),
            Verdict::Wrong(fit) if fit.residual.is_finite() => Some(fit.negative),
            _ => None,
        };
        let certain = self.pose.compass || self.pose.north_east;
        let withdraw = match (sign(yaw), sign(sway)) {
            (Some(true), Some(true)) => !certain,
            (Some(true), None) | (None, Some(true)) => !certain && !self.pose.psi,
            _ => false,
        };
        for channel in [yaw, sway].into_iter().flatten().filter(|_| withdraw) {
            if let Verdict::Wrong(fit) = &mut verdicts[channel] {
                fit.negative = false;
                fit.factor = fit.factor.abs();
                if fit.channel == channel && (fit.factor - 1.0).abs() <= SAME {
                    verdicts[channel] = Verdict::Unknown;
                }
            }
        }
    }

    fn report(&self, log: &RawLog, specs: &[ChannelSpec], verdicts: &[Verdict], notes: &mut Vec<Note>) {
        let name = |channel: usize| self.channels[channel].source.channel.name.as_str();
        let heading = &self.pose.heading.channel.name;
        let path =
            self.pose.position.as_ref().map(|[x, y]| format!("`{}`, `{}`", x.channel.name, y.channel.name));
        let remedy = self.remedy(log, specs, verdicts);
        for (own, fit) in verdicts.iter().enumerate().filter_map(|(own, v)| Some((own, v.fit()?))) {
            if fit.channel != own {
                continue;
            }
            let what = match self.channels[own].motion {
                Motion::Yaw => format!("the rate of change of `{heading}`"),
                Motion::Surge | Motion::Sway => format!(
                    "the {} velocity that {} and `{heading}` show",
                    if self.channels[own].motion == Motion::Surge { "forward" } else { "sideways" },
                    path.as_deref().unwrap_or_default()
                ),
            };
            let unit = (fit.factor.abs() - 1.0).abs() > SAME;
            let cause = match (unit, fit.negative) {
                (true, false) => format!("its unit seems to be {}", fit.unit),
                (false, _) => self.sign_text(own),
                (true, true) => format!("its unit seems to be {}, and {}", fit.unit, self.sign_text(own)),
            };
            let sway = self.channel_of(Motion::Sway).filter(|&i| matches!(verdicts[i], Verdict::Unknown));
            let rest = match sway {
                Some(sway) if unit && self.channels[own].motion == Motion::Surge => {
                    format!("; the pose does not show the unit of `{}`", name(sway))
                }
                _ => String::new(),
            };
            notes.push(
                Note::warning(format!(
                    "{}: `{}` contradicts the pose: as read it is {} times {what}; {cause}{rest}",
                    log.path,
                    name(own),
                    number(1.0 / fit.found),
                ))
                .with_remedy(remedy.clone()),
            );
        }
        let exchanged: Vec<(usize, &Fit)> = verdicts
            .iter()
            .enumerate()
            .filter_map(|(own, v)| Some((own, v.fit().filter(|fit| fit.channel != own)?)))
            .collect();
        if !exchanged.is_empty() {
            let names: Vec<String> = exchanged.iter().map(|(own, _)| format!("`{}`", name(*own))).collect();
            let shown: Vec<String> = exchanged
                .iter()
                .filter(|(_, fit)| fit.residual.is_finite())
                .map(|(own, fit)| {
                    let motion = match self.channels[*own].motion {
                        Motion::Surge => "forward velocity",
                        Motion::Sway => "sideways velocity",
                        Motion::Yaw => "yaw rate",
                    };
                    let sign = if fit.negative { " with the other sign" } else { "" };
                    format!(
                        "the {motion} of the pose agrees with `{}` in {}{sign}",
                        name(fit.channel),
                        fit.unit
                    )
                })
                .collect();
            notes.push(
                Note::warning(format!(
                    "{}: {} seem to be exchanged: {}",
                    log.path,
                    names.join(" and "),
                    shown.join("; ")
                ))
                .with_remedy(remedy),
            );
        }
    }

    /// The explanation of a sign; the direction of the heading decides whether `r` or `v` has it.
    fn sign_text(&self, own: usize) -> String {
        let other = match self.channels[own].motion {
            Motion::Surge => return "its sign is flipped".to_owned(),
            Motion::Sway => Motion::Yaw,
            Motion::Yaw => Motion::Sway,
        };
        let heading = &self.pose.heading.channel.name;
        let rider = if self.pose.compass || self.pose.north_east {
            String::new()
        } else {
            let instead = self.channel_of(other).map_or(String::new(), |channel| {
                format!(", else `{}` is to be flipped", self.channels[channel].source.channel.name)
            });
            format!(" (if `{heading}` grows clockwise{instead})")
        };
        format!("its sign is flipped{rider}")
    }

    /// The complete corrected selection of the outputs.
    fn remedy(&self, log: &RawLog, specs: &[ChannelSpec], verdicts: &[Verdict]) -> String {
        let mut corrected = specs.to_vec();
        let mut in_header = Vec::new();
        for (own, fit) in verdicts.iter().enumerate().filter_map(|(own, v)| Some((own, v.fit()?))) {
            let (target, from) = (&self.channels[own], &self.channels[fit.channel]);
            let Some(spec) = specs.get(from.output) else { continue };
            let mut spec = ChannelSpec { name: target.source.channel.name.clone(), ..spec.clone() };
            let stated = from.source.channel.unit.as_str();
            if !stated.is_empty() && stated != target.motion.si() {
                let column = &log.columns[from.source.column].name;
                in_header.push(format!("`{column}` is `{} [{}]`", spec.name, fit.unit));
            } else if (fit.factor.abs() - 1.0).abs() > SAME {
                spec.unit = Some(fit.unit.to_owned());
            }
            if fit.negative {
                spec.scale = -spec.scale;
            }
            corrected[target.output] = spec;
        }
        if !in_header.is_empty() {
            return format!("correct the names and units of the header: the column {}", in_header.join(", "));
        }
        let list: Vec<String> = corrected.iter().map(ToString::to_string).collect();
        key("outputs").is(list.join(",")).to_string()
    }
}

/// A factor with three digits.
fn number(x: f64) -> String {
    let size = x.abs();
    let digits = [100.0, 10.0, 1.0].into_iter().filter(|least| size < *least).count();
    if size < 0.1 { format!("{x:.2e}") } else { format!("{x:.digits$}") }
}
