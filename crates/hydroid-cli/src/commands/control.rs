//! `hydroid control`.

mod service;

use std::path::Path;

use anyhow::Context as _;
use hydroid::atomic::{self, Lock};
use hydroid::closed_loop::{Metrics, MonteCarlo, Summary, TunedAutopilot};
use hydroid::config::control::{Document, NamedModel, Setup, Simulated};
use hydroid::log::Note;
use hydroid_report::ClosedLoopReport;

use super::Outcome;
use crate::args::{Control, Global};
use crate::ui;

pub fn run(args: &Control, global: Global) -> anyhow::Result<Outcome> {
    let options = args.options.clone();
    options.check()?;
    service::check_options(args, &options)?;
    let read = |path: Option<&Path>| path.map(NamedModel::read).transpose();
    let mut setup = Setup::new(options, read(args.model.as_deref())?, read(args.plant.as_deref())?)?;
    if setup.controller.adapt.is_some() {
        let reading = &setup.model.description.reading;
        let of = (args.model.as_deref().unwrap_or(Path::new("")), &*setup.model);
        let files = &args.training_log;
        let training = crate::logs::training_logs(files, args.training_time.0, of, reading, global)?;
        setup.controller.rehearsal = training.replayed.into();
    }
    // Built before any simulation, so that a model that it cannot invert is refused early.
    let bar = ui::Bar::new("tuning the PID", global);
    let tuned = setup.tune(&mut bar.callback())?;
    drop(bar);
    if let (Some(stream), Some(file)) = (&args.stream, &args.model) {
        setup.check_firm().context("the service does not steer")?;
        let notes: Vec<Note> = setup.notes().into_iter().map(Note::warning).collect();
        ui::print_notes(&notes, global);
        return service::run(args, global, &service::Steered { stream, file, setup: &setup });
    }
    simulate(args, global, &setup, tuned.as_ref())
}

fn simulate(
    args: &Control,
    global: Global,
    setup: &Setup,
    tuned: Option<&TunedAutopilot>,
) -> anyhow::Result<Outcome> {
    let mut controller = setup
        .controller
        .controller(setup.conditions.seed)
        .context("this controller cannot be used with this model and vessel")?;
    let _lock = match &args.output {
        Some(folder) => {
            atomic::probe(folder)?;
            Some(Lock::new(folder)?)
        }
        None => None,
    };
    let bar = ui::Bar::new("trials", global);
    let trials = setup.trials(&mut bar.callback())?;
    drop(bar);
    let bar = ui::Bar::new("simulating the closed loop", global);
    let simulated = setup.simulate(controller.as_mut(), trials, &mut bar.callback())?;
    drop(bar);
    let document = setup.document(&simulated, tuned);
    if let Some(folder) = &args.output {
        write(folder, setup, &simulated, tuned, &document)?;
    }
    if global.json {
        super::print_json(&document)?;
    } else {
        if let Some(tuned) = tuned {
            print_tuning(tuned);
        }
        for note in setup.notes().into_iter().chain(simulated.extrapolations()) {
            outln!("{note}");
        }
        match &simulated.trials {
            Some(trials) => print_trials(trials),
            None => print_metrics(&simulated.metrics),
        }
        if let Some(folder) = &args.output {
            outln!("{}: track.csv, control.json, report.html", folder.display());
        }
    }
    Ok(if simulated.is_sound() { Outcome::Done } else { Outcome::Missed })
}

fn write(
    folder: &Path,
    setup: &Setup,
    simulated: &Simulated,
    tuned: Option<&TunedAutopilot>,
    document: &Document<'_>,
) -> anyhow::Result<()> {
    let Simulated { run, metrics, trials, .. } = simulated;
    atomic::write(&folder.join("track.csv"), |out| run.write_csv(out))?;
    let mut text = serde_json::to_string_pretty(document)?;
    text.push('\n');
    atomic::write(&folder.join("control.json"), |out| out.write_all(text.as_bytes()))?;
    let page = hydroid_report::closed_loop(&ClosedLoopReport {
        title: &setup.title(),
        command: &ui::command_line(),
        facts: &setup.facts(simulated),
        path: &setup.scenario.track.path,
        run,
        metrics,
        trials: trials.as_ref(),
        outside: &simulated.outside,
        tuned,
    })?;
    atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
    Ok(())
}

fn print_metrics(m: &Metrics) {
    outln!("position      {:>9.4} m    RMS distance from the reference after {} s", m.rms_position, m.from_s);
    outln!("cross-track   {:>9.4} m    RMS, maximum {:.4} m", m.rms_cross_track, m.max_cross_track);
    outln!("speed         {:>9.4} m/s  RMS", m.rms_speed);
    match m.settled_after {
        Some(after) => outln!("settled after {after:>9.1} s"),
        None => outln!("settled after         - "),
    }
    outln!("saturated     {:>9.1} %    of {:.1} s", 100.0 * m.saturated, m.duration_s);
    let (median, max) = (m.us_per_command.median, m.us_per_command.max);
    outln!("command       {median:>9.1} us   median, maximum {max:.1} us");
    let status: Vec<String> = m.status.iter().map(|(name, count)| format!("{name} {count}")).collect();
    outln!("status        {}", status.join(", "));
    if m.arrived == Some(false) {
        outln!("the end of the path was not reached");
    }
    if m.diverged {
        outln!("the simulation diverged: the state of the vessel is not finite");
    }
    if m.violations > 0 {
        outln!("{} commands beyond their limits", m.violations);
    }
}

fn print_trials(f: &MonteCarlo) {
    outln!("{} trials: {} on track, {} diverged", f.runs, f.held, f.diverged);
    outln!(
        "commands beyond their limits: {}; samples off track without a status: {}",
        f.violations,
        f.undetected_losses
    );
    outln!("{:<24} {:>10} {:>10} {:>10}", "", "median", "95 %", "max");
    let line = |name: &str, s: &Summary| {
        outln!("{name:<24} {:>10.4} {:>10.4} {:>10.4}", s.median, s.p95, s.max);
    };
    line("position [m], RMS", &f.rms_position);
    line("cross-track [m], RMS", &f.rms_cross_track);
    line("cross-track [m], maximum", &f.max_cross_track);
    line("speed [m/s], RMS", &f.rms_speed);
}

fn print_tuning(tuned: &TunedAutopilot) {
    let best = &tuned.best;
    outln!(
        "tuned on {} separate seeds, best of {} candidates: omega {:.2} rad/s, look-ahead {:.2} m, integral {:.2} m/s, speed gain {:.3} of full ahead per m/s, exponent {}; score {:.4}",
        tuned.seeds.len(),
        tuned.tried,
        best.omega,
        best.lookahead,
        best.sigma,
        best.proportional,
        best.exponent,
        tuned.score
    );
}
