//! The page of manoeuvring trials.

use std::path::Path;

use hydroid::atomic;
use hydroid::manoeuvre::{Figure as Value, Track, Trial, TrialKind, Trials, interval_words};
use hydroid::model::Model;
use hydroid::plant::Outside;
use maud::{Markup, html};
use serde_json::Value as Document;

use super::figure::{Dash, Figure, Key, Line, Mark, Panel, Stroke, envelope};
use super::number::{self, text};
use super::page::{Section, cell, columns, figure, page, readable, table};
use super::style;
use super::{FolderError, ReportError};

/// Content of a page of trials.
#[derive(Clone, Copy, Debug)]
pub struct ManoeuvreReport<'a> {
    /// Command line that reproduces the page.
    pub command: &'a str,
    pub model: &'a Model,
    pub trials: &'a Trials,
}

/// Points of a curve.
const POINTS: usize = 600;

/// Tracks of members in a figure.
pub(super) const MEMBERS: usize = 40;

const STARBOARD: Stroke = style::MODEL_LINE;
const PORT: Stroke = Stroke { colour: style::ALARM, width: 2.0, dash: Dash::Solid };
pub(super) const MEMBER: Stroke = Stroke { colour: style::BAND, width: 0.5, dash: Dash::Solid };

/// The page.
pub fn manoeuvres(subject: &ManoeuvreReport<'_>) -> Result<String, ReportError> {
    let mut all = vec![summary(subject)];
    all.extend(sections(subject)?);
    all.push(definitions(subject));
    Ok(page(&subject.title(), &all))
}

/// A section for each trial.
pub(super) fn sections(subject: &ManoeuvreReport<'_>) -> Result<Vec<Section>, ReportError> {
    let of = |wanted: fn(&TrialKind) -> bool| -> Vec<&Trial> {
        subject.trials.trials.iter().filter(|trial| wanted(&trial.kind)).collect()
    };
    let mut sections = Vec::new();
    let circles = of(|kind| matches!(kind, TrialKind::TurningCircle { .. }));
    if !circles.is_empty() {
        let caption = html! { "Tracks from the order on; the approach heads north. Thin lines are members of the model. Both axes have the same scale." };
        let body = html! { (columns(&[figure(&tracks("Turning circles", &circles).svg()?, &caption), values(subject, &circles)])) };
        sections.push(Section::new("turning-circle", "Turning circle", body));
    }
    for (i, pair) in zigzags(subject).into_iter().enumerate() {
        let heading = pair.first().map(|trial| title(subject, trial)).unwrap_or_default();
        let caption = html! { "Heading (solid) and steering (dashed) over time." };
        let body =
            html! { (columns(&[figure(&zigzag(subject, &pair).svg()?, &caption), values(subject, &pair)])) };
        sections.push(Section::new(format!("zigzag-{i}"), heading, body));
    }
    for trial in of(|kind| matches!(kind, TrialKind::PullOut { .. })) {
        let caption = html! { "Yaw rate after the steering has returned to that of the straight course. A directionally stable vessel stops turning." };
        let body =
            html! { (columns(&[figure(&pull_out(trial).svg()?, &caption), values(subject, &[trial])])) };
        sections.push(Section::new("pull-out", "Pull-out", body));
    }
    for trial in of(|kind| matches!(kind, TrialKind::Spiral { .. })) {
        let caption = html! { "Steady yaw rate against the steering, from starboard to port (solid) and back (dashed). Where the two differ, the vessel is not directionally stable." };
        let body = html! { (columns(&[figure(&spiral(subject, trial).svg()?, &caption), values(subject, &[trial])])) };
        sections.push(Section::new("spiral", "Spiral", body));
    }
    for (id, heading, trials) in [
        ("acceleration", "Acceleration", of(|kind| matches!(kind, TrialKind::Acceleration))),
        ("stopping", "Stopping", of(|kind| matches!(kind, TrialKind::Stopping))),
    ] {
        if !trials.is_empty() {
            let caption = html! { "Surge velocity over time." };
            let body = html! { (columns(&[figure(&speed(heading, &trials).svg()?, &caption), values(subject, &trials)])) };
            sections.push(Section::new(id, heading, body));
        }
    }
    Ok(sections)
}

impl ManoeuvreReport<'_> {
    fn title(&self) -> String {
        let d = &self.model.description;
        let name = d.boat.particulars.name.as_ref().or_else(|| self.model.is_vessel().then_some(&d.name));
        let vessel = name.map(|name| format!(" of {name}"));
        format!("Manoeuvring trials{}", vessel.unwrap_or_default())
    }

    /// Writes a folder: the document of the trials in `trials.json`, their tracks in `tracks.csv`, and the page in
    /// `report.html`.
    pub fn write(&self, folder: &Path, document: &Document) -> Result<(), FolderError> {
        let page = manoeuvres(self)?;
        atomic::write(&folder.join("trials.json"), |out| writeln!(out, "{document:#}"))?;
        atomic::write(&folder.join("tracks.csv"), |out| self.trials.write_csv(out))?;
        atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
        Ok(())
    }
}

fn title(subject: &ManoeuvreReport<'_>, trial: &Trial) -> String {
    let title = trial.kind.title(&subject.trials.inputs);
    let title = title.split(", first").next().unwrap_or(&title);
    let mut letters = title.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// Zigzags of equal angles, in pairs.
fn zigzags<'a>(subject: &ManoeuvreReport<'a>) -> Vec<Vec<&'a Trial>> {
    let mut pairs: Vec<Vec<&Trial>> = Vec::new();
    for trial in &subject.trials.trials {
        let TrialKind::Zigzag { steering, heading_deg } = trial.kind else { continue };
        let same = |other: &&Trial| matches!(other.kind, TrialKind::Zigzag { steering: s, heading_deg: h } if s.abs() == steering.abs() && h == heading_deg);
        match pairs.iter_mut().find(|pair| pair.iter().all(same)) {
            Some(pair) => pair.push(trial),
            None => pairs.push(vec![trial]),
        }
    }
    pairs
}

/// How the trials begin.
pub(super) fn approach(subject: &ManoeuvreReport<'_>) -> Section {
    let body = html! { p { "Each trial begins on a straight course, at " (approach_text(subject)) "." } };
    Section::new("trials", "Trials", body)
}

/// Speed and commands of the approach.
fn approach_text(subject: &ManoeuvreReport<'_>) -> String {
    let trials = subject.trials;
    let commands =
        subject.model.description.inputs.iter().zip(&trials.approach_command).map(|(port, value)| {
            let (value, unit) = match port.channel.unit.as_str() {
                "rad" => (value.to_degrees(), "deg"),
                "1" => (*value, ""),
                unit => (*value, unit),
            };
            format!("{} {} {}", port.channel.name, text(value, 3), number::unit(unit)).trim_end().to_owned()
        });
    let commands = commands.collect::<Vec<_>>().join(", ");
    format!("{} m/s through the water, with {}", text(trials.approach_speed_m_s, 3), readable(&commands))
}

fn summary(subject: &ManoeuvreReport<'_>) -> Section {
    let trials = subject.trials;
    let judged: Vec<&Value> =
        trials.trials.iter().flat_map(|t| &t.figures).filter(|f| f.criterion.is_some()).collect();
    let missed = judged.iter().filter(|f| f.criterion.is_some_and(|c| !c.passed)).count();
    let open = judged.iter().filter(|f| f.criterion.is_some_and(|c| c.is_certain != Some(true))).count();
    let is_open = trials.trials.iter().any(|trial| trial.stability_not_decided.is_some());
    let is = |stable: bool| trials.trials.iter().any(|trial| trial.directionally_stable == Some(stable));
    let stability = match (is(true), is(false)) {
        (true, false) if !is_open => " The vessel is directionally stable.",
        (false, true) if !is_open => " The vessel is not directionally stable.",
        (false, false) if !is_open => "",
        _ => " Directional stability is not decided.",
    };
    let not_judged = |figure: &&Value| figure.not_judged.is_some();
    let without = trials.trials.iter().flat_map(|trial| &trial.figures).filter(not_judged).count();
    let (class, heading, words) = if judged.is_empty() && without == 0 {
        (
            "usable",
            "Predicted by the model.",
            String::from(if trials.options.length_m.is_none() {
                "Without the length of the ship, no criteria apply."
            } else {
                "No criteria apply: a turning circle is judged at 35 degrees, or hard over with known limits."
            }),
        )
    } else if missed == 0 {
        let words = match without {
            0 => format!("All {} criteria of IMO resolution MSC.137(76) are met.", judged.len()),
            _ => format!(
                "{} criteria of IMO resolution MSC.137(76) are met, and {without} are not judged, because their figures have no value.",
                judged.len()
            ),
        };
        if without > 0 {
            ("usable", "Criteria not all judged.", words)
        } else if open == 0 {
            ("good", "Criteria met.", words)
        } else {
            let words = format!("{words} The intervals of {open} reach beyond the limit, or are not known.");
            ("usable", "Criteria met by the estimates.", words)
        }
    } else {
        let words =
            format!("{missed} of {} criteria of IMO resolution MSC.137(76) are missed.", judged.len());
        ("bad", "Criteria missed.", words)
    };
    let not_valid = trials.trials.iter().filter(|trial| trial.not_valid.is_some()).count();
    let (class, heading, words) = match not_valid {
        0 => (class, heading, words),
        count => {
            let of = trials.trials.len();
            (
                "bad",
                "Not valid in part.",
                format!("{count} of {of} trials leave what the model can tell. {words}"),
            )
        }
    };
    let body = html! {
        header {
            p.kicker { "hydroid · manoeuvring trials" }
            h1 { (subject.title()) }
        }
        div class={ "banner " (class) } role="status" { strong { (heading) } " " (words) (stability) }
        dl.facts {
            dt { "Model" } dd { (subject.model.title()) " (" (subject.model.kind()) ")" }
            dt { "Approach" } dd { (approach_text(subject)) }
            @if trials.options.scale != 1.0 { dt { "Scale" } dd { (text(trials.options.scale, 4)) } }
            @if let Some(length) = trials.options.length_m { dt { "Length" } dd { (text(length, 4)) " m" } }
            @for (key, value, unit) in subject.model.description.boat.particulars.numbers().filter(|(key, ..)| !["length", "scale"].contains(key)) {
                dt { (key.replace('_', " ")) } dd { (text(value, 4)) " " (unit) }
            }
            @for note in &trials.notes { dt { "Note" } dd { (note) } }
        }
    };
    Section::new("summary", "Summary", body)
}

/// Figures of trials side by side.
fn values(subject: &ManoeuvreReport<'_>, trials: &[&Trial]) -> Markup {
    let Some(first) = trials.first() else { return html! {} };
    let intervals = trials.iter().any(|trial| trial.figures.iter().any(|figure| figure.interval.is_some()));
    let side = |trial: &Trial| match trial.kind {
        TrialKind::TurningCircle { steering } | TrialKind::Zigzag { steering, .. } => {
            if steering > 0.0 {
                "starboard"
            } else {
                "port"
            }
        }
        _ => "value",
    };
    let mut heads = vec![cell("")];
    heads.extend(trials.iter().map(|trial| cell(side(trial))));
    heads.push(cell("unit"));
    let limits = trials
        .iter()
        .any(|trial| trial.figures.iter().any(|f| f.criterion.is_some() || f.not_judged.is_some()));
    if limits {
        heads.push(cell("limit"));
    }
    let rows: Vec<Vec<Markup>> = first
        .figures
        .iter()
        .enumerate()
        .map(|(i, figure)| {
            let (name, unit) = figure.name_and_unit();
            let mut row = vec![cell(name)];
            row.extend(trials.iter().map(|trial| {
                let figure = &trial.figures[i];
                let missed = figure.criterion.is_some_and(|criterion| !criterion.passed);
                html! {
                    span class=[missed.then_some("warning")] { (figure.value.map_or_else(|| figure.missing().to_owned(), |value| text(value, 3))) @if figure.extrapolated && figure.value.is_some() { " *" } }
                    @if let Some([low, high]) = figure.interval { br; span.small { (text(low, 3)) " to " (text(high, 3)) (figure.left_out_text()) } }
                    @if let Some(reason) = &figure.no_interval { br; span.small { "no interval: " (reason) } }
                }
            }));
            row.push(cell(unit));
            if limits {
                let limit = figure.criterion.map(|criterion| {
                    let all = || trials.iter().filter_map(|trial| trial.figures[i].criterion);
                    let mark = match (all().all(|c| c.passed), all().all(|c| c.is_certain == Some(true))) {
                        (true, true) => "✓",
                        (true, false) => "(✓)",
                        (false, _) => "✕",
                    };
                    format!("{} {mark}", text(criterion.limit, 3))
                });
                let open = trials.iter().find_map(|trial| trial.figures[i].not_judged);
                let open = open.map(|limit| format!("{} not judged", text(limit, 3)));
                let limit = open.or(limit);
                row.push(cell(limit.unwrap_or_default()));
            }
            row
        })
        .collect();
    let stable = first.directionally_stable;
    html! {
        (table(&heads, &rows, 1))
        @for trial in trials {
            @if let Some(reason) = &trial.not_valid { p.warning { "Not valid " (reason) "." } }
        }
        @for outside in &outside(trials) {
            p.small { "* " (outside) "." }
        }
        @if let Some(reason) = &first.stability_not_decided { p { "Directional stability is not decided: " (reason) "." } }
        @if let Some(stable) = stable { p { (if stable { "Directionally stable." } else { "Not directionally stable." }) } }
        @if let Some(words) = interval_words(&first.figures, first.members).filter(|_| intervals) {
            p.small { "Below each value: interval (" (words) ")." }
        }
        @if limits { p.small { "Limits for a length of " (text(subject.trials.options.length_m.unwrap_or(f64::NAN), 4)) " m." } }
    }
}

/// Outputs that leave the training range in any of the trials, from the earliest time on.
fn outside(trials: &[&Trial]) -> Vec<Outside> {
    let mut all: Vec<Outside> = Vec::new();
    for outside in trials.iter().flat_map(|trial| &trial.outside) {
        match all.iter_mut().find(|known| known.name == outside.name) {
            None => all.push(outside.clone()),
            Some(known) => {
                known.from_s = known.from_s.min(outside.from_s);
                known.reached[0] = known.reached[0].min(outside.reached[0]);
                known.reached[1] = known.reached[1].max(outside.reached[1]);
            }
        }
    }
    all
}

fn thinned(points: impl ExactSizeIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let thin = points.len().div_ceil(POINTS).max(1);
    points.step_by(thin).collect()
}

pub(super) fn position(track: &Track) -> Vec<(f64, f64)> {
    thinned(track.eta[track.execute..].iter().map(|[north, east, _]| (*east, *north)))
}

fn side_stroke(trial: &Trial) -> (Stroke, &'static str) {
    match trial.kind {
        TrialKind::TurningCircle { steering } | TrialKind::Zigzag { steering, .. } if steering < 0.0 => {
            (PORT, "to port")
        }
        _ => (STARBOARD, "to starboard"),
    }
}

fn tracks(name: &str, trials: &[&Trial]) -> Figure {
    let mut panel = Panel::new("north [m]");
    for track in trials.iter().flat_map(|trial| trial.member_tracks.iter().take(MEMBERS)) {
        panel = panel.mark(Mark::Line(Line::new(position(track), MEMBER)));
    }
    let mut shown = Figure::new(name, "east [m]").equal_axes();
    let mut all: Vec<(f64, f64)> = Vec::new();
    for trial in trials {
        let (stroke, key) = side_stroke(trial);
        shown = shown.key(Key::Line(stroke), key);
        for track in &trial.tracks {
            let points = position(track);
            all.extend(&points);
            panel = panel.mark(Mark::Line(Line::new(points, stroke)));
        }
    }
    let ((left, right), (low, high)) = (covered(&all, |p| p.0), covered(&all, |p| p.1));
    shown.x_range(left, right).panel(panel.range(low, high))
}

/// A figure (SVG file) of a simulated track (poses: north, east \[m\], heading), those of members of the model, and the
/// measured one.
pub fn simulated_track(
    simulated: &[[f64; 3]],
    members: &[Vec<[f64; 3]>],
    measured: Option<&[[f64; 3]]>,
) -> Result<String, ReportError> {
    let points = |eta: &[[f64; 3]]| thinned(eta.iter().map(|[north, east, _]| (*east, *north)));
    let mut panel = Panel::new("north [m]");
    for member in members.iter().take(MEMBERS) {
        panel = panel.mark(Mark::Line(Line::new(points(member), MEMBER)));
    }
    let mut shown =
        Figure::new("Simulated track", "east [m]").equal_axes().key(Key::Line(STARBOARD), "simulated");
    let mut all = points(simulated);
    panel = panel.mark(Mark::Line(Line::new(all.clone(), STARBOARD)));
    if let Some(measured) = measured {
        let points = points(measured);
        all.extend(&points);
        panel = panel.mark(Mark::Line(Line::new(points, style::MEASURED_LINE)));
        shown = shown.key(Key::Line(style::MEASURED_LINE), "measured");
    }
    let ((left, right), (low, high)) = (covered(&all, |p| p.0), covered(&all, |p| p.1));
    Ok(shown.x_range(left, right).panel(panel.range(low, high)).file()?)
}

/// The range of points with a margin.
pub(super) fn covered(points: &[(f64, f64)], of: fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let (low, high) =
        points.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let margin = 0.06 * (high - low) + 1e-3;
    (low - margin, high + margin)
}

pub(super) fn over_time(track: &Track, of: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
    let samples = track.execute..track.len();
    let points: Vec<(f64, f64)> = samples.map(|k| ((k - track.execute) as f64 * track.dt, of(k))).collect();
    envelope(points.into_iter(), POINTS / 2)
}

fn zigzag(subject: &ManoeuvreReport<'_>, trials: &[&Trial]) -> Figure {
    let steering = subject.trials.inputs.steering();
    let label = format!("heading [deg], steering [{}]", steering.unit);
    let mut panel = Panel::new(label).height(220.0);
    let mut shown = Figure::new("Zigzag over time", "time [s]");
    for trial in trials {
        let (stroke, key) = side_stroke(trial);
        shown = shown.key(Key::Line(stroke), format!("first {key}"));
        for track in trial.member_tracks.iter().take(MEMBERS / 2) {
            let heading = over_time(track, |k| (track.eta[k][2] - track.eta[track.execute][2]).to_degrees());
            panel = panel.mark(Mark::Line(Line::new(heading, MEMBER)));
        }
    }
    for trial in trials {
        let (stroke, _) = side_stroke(trial);
        for track in &trial.tracks {
            let heading = over_time(track, |k| (track.eta[k][2] - track.eta[track.execute][2]).to_degrees());
            let order = over_time(track, |k| track.steering[k] * steering.full);
            let dashed = Stroke { width: 1.0, dash: Dash::Dashed, ..stroke };
            panel = panel.mark(Mark::Line(Line::new(order, dashed)));
            panel = panel.mark(Mark::Line(Line::new(heading, stroke)));
        }
    }
    shown.panel(panel)
}

fn pull_out(trial: &Trial) -> Figure {
    let mut panel = Panel::new("yaw rate [deg/s]").height(220.0);
    for track in trial.member_tracks.iter().take(MEMBERS) {
        panel = panel.mark(Mark::Line(Line::new(over_time(track, |k| track.nu[k][2].to_degrees()), MEMBER)));
    }
    for (track, stroke) in trial.tracks.iter().zip([STARBOARD, PORT]) {
        panel = panel.mark(Mark::Line(Line::new(over_time(track, |k| track.nu[k][2].to_degrees()), stroke)));
    }
    Figure::new("Yaw rate after a pull-out", "time [s]")
        .key(Key::Line(STARBOARD), "from starboard")
        .key(Key::Line(PORT), "from port")
        .panel(panel)
}

fn spiral(subject: &ManoeuvreReport<'_>, trial: &Trial) -> Figure {
    let steering = subject.trials.inputs.steering();
    let point = |p: &hydroid::manoeuvre::SpiralPoint| (p.steering * steering.full, p.yaw_rate_deg_s);
    // The turning point; a trial that diverges has fewer points.
    let points = &trial.points;
    let half =
        (1..points.len()).find(|&k| points[k].steering > points[k - 1].steering).unwrap_or(points.len());
    let down: Vec<(f64, f64)> = points[..half].iter().rev().map(point).collect();
    let up: Vec<(f64, f64)> = points[half.saturating_sub(1)..].iter().map(point).collect();
    let back = Stroke { dash: Dash::Dashed, ..PORT };
    Figure::new("Spiral", format!("steering [{}], positive to starboard", steering.unit))
        .key(Key::Line(STARBOARD), "from starboard to port")
        .key(Key::Line(back), "from port to starboard")
        .panel(
            Panel::new("steady yaw rate [deg/s]")
                .height(220.0)
                .mark(Mark::Line(Line::new(down, STARBOARD)))
                .mark(Mark::Line(Line::new(up, back))),
        )
}

fn speed(name: &str, trials: &[&Trial]) -> Figure {
    let mut panel = Panel::new("surge velocity [m/s]").height(180.0);
    for trial in trials {
        for track in trial.member_tracks.iter().take(MEMBERS) {
            panel = panel.mark(Mark::Line(Line::new(over_time(track, |k| track.nu[k][0]), MEMBER)));
        }
        for track in &trial.tracks {
            panel = panel.mark(Mark::Line(Line::new(over_time(track, |k| track.nu[k][0]), STARBOARD)));
        }
    }
    Figure::new(name, "time [s]").panel(panel)
}

/// Terms, and the command.
pub(super) fn definitions(subject: &ManoeuvreReport<'_>) -> Section {
    let body = html! {
        p {
            "Advance and transfer are the distances along and across the initial course up to a change of heading by 90°, the tactical diameter is that across up to 180°. "
            "An overshoot is the change of heading in the old direction after the steering was reversed. "
            "The drift angle is positive if the bow points to starboard of the path. "
            "Definitions and criteria: IMO resolution MSC.137(76), MSC/Circ.1053, ITTC procedure 7.5-04-02-01."
        }
        details {
            summary { "Command that reproduces this page" }
            pre.copy.wrap { (readable(subject.command)) }
        }
    };
    Section::new("definitions", "Definitions", body)
}
