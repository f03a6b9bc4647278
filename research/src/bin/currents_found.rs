//! Currents that an identification finds in simulated runs, beside the true ones.
//!
//! ```text
//! cargo run --release -p hydroid-research --bin currents_found -- [FIGURE.svg]
//! ```
//!
//! Ten identifications with four runs each, five of each vessel. Every run lasts 300 s in a current of its own, up to 0.8 m/s
//! from any direction; one run of each identification is in still water. The figure shows the errors of the
//! components with their intervals of 90 %.

use std::path::Path;

use anyhow::Context as _;
use hydroid::excitation::Excitation;
use hydroid::identify::{
    Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::{Split, Trajectory};
use hydroid::model::Reading;
use hydroid::progress::silent;
use hydroid::simulate::{self, simulate};
use hydroid_core::craft::Craft;
use plotters::prelude::*;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Largest speed of a current \[m/s\].
const MOST: f64 = 0.8;

/// Half-width of an interval of 90 % of a normal distribution, in standard deviations.
const NINETY: f64 = 1.645;

/// A component of the current of a run \[m/s\].
#[derive(Clone, Copy)]
struct Component {
    truth: f64,
    found: f64,
    deviation: f64,
}

fn main() -> anyhow::Result<()> {
    let mut all = Vec::new();
    println!("| vessel | seed | RMS error [m/s] | largest | inside the interval of 90 % |");
    println!("| --- | ---: | ---: | ---: | ---: |");
    for (vessel, seeds) in [(Craft::hydrofoil(), 0..5), (Craft::simple(), 5..10)] {
        for seed in seeds {
            let found = components(&vessel, seed)?;
            println!("| {} | {seed} | {} |", vessel.name, summary(&found));
            all.extend(found);
        }
    }
    println!("| all | | {} |", summary(&all));
    if let Some(path) = std::env::args().nth(1) {
        figure(Path::new(&path), &all)?;
    }
    Ok(())
}

fn components(vessel: &Craft, seed: u64) -> anyhow::Result<Vec<Component>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let currents: Vec<[f64; 2]> = (0..4)
        .map(|run| {
            let speed = if run == 0 { 0.0 } else { MOST * random.random::<f64>() };
            let direction = std::f64::consts::TAU * random.random::<f64>();
            [speed * direction.cos(), speed * direction.sin()]
        })
        .collect();
    let log = |(current, run): (&[f64; 2], u64)| -> anyhow::Result<Trajectory> {
        let options = simulate::Options {
            duration_s: 300.0,
            seed: 100 + 10 * seed + run,
            current: *current,
            ..simulate::Options::new(vessel.clone(), Excitation::Mixed)
        };
        Ok(simulate(&options, &mut silent())?.to_trajectory(&["u", "v", "r"])?)
    };
    let train = currents.iter().zip(0..).map(log).collect::<anyhow::Result<_>>()?;
    let job = Job {
        methods: vec![Method::Sindy],
        split: Split { train, validation: Vec::new(), test: Vec::new(), notes: Vec::new() },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 100,
        origin_stride: 10,
        seed: 0,
        ranges: std::collections::BTreeMap::default(),
        motion: MotionOption::ThroughWater,
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions { members: Some(0), ..SindyOptions::default() },
        networks: NetworkTrainingOptions::default(),
        vessel: None,
    };
    let found = identify(&job, &mut silent())?.currents.context("no currents were found")?;
    let of_run = |(run, current): (&hydroid::identify::RunCurrent, &[f64; 2])| {
        [0, 1].map(|i| Component {
            truth: current[i],
            found: [run.north_m_s, run.east_m_s][i],
            deviation: run.deviations_m_s[i],
        })
    };
    Ok(found.runs.iter().zip(&currents).flat_map(of_run).collect())
}

fn summary(components: &[Component]) -> String {
    let count = components.len() as f64;
    let errors = || components.iter().map(|c| (c.found - c.truth).abs());
    let rms = (errors().map(|e| e * e).sum::<f64>() / count).sqrt();
    let inside = components.iter().filter(|c| (c.found - c.truth).abs() <= NINETY * c.deviation).count();
    format!("{rms:.4} | {:.4} | {inside} of {}", errors().fold(0.0, f64::max), components.len())
}

fn figure(path: &Path, components: &[Component]) -> anyhow::Result<()> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (640, 400)).into_drawing_area();
        area.fill(&WHITE)?;
        let (limits, errors) = (-MOST..MOST, -0.06..0.06);
        let mut chart = ChartBuilder::on(&area)
            .margin(16)
            .x_label_area_size(44)
            .y_label_area_size(56)
            .build_cartesian_2d(limits, errors)?;
        chart
            .configure_mesh()
            .x_desc("true component of the current [m/s]")
            .y_desc("found - true [m/s], with intervals of 90 %")
            .x_labels(9)
            .y_labels(7)
            .y_label_formatter(&|y| format!("{y:.2}"))
            .light_line_style(WHITE.mix(0.0))
            .bold_line_style(BLACK.mix(0.1))
            .axis_desc_style(("sans-serif", 15))
            .label_style(("sans-serif", 13))
            .draw()?;
        chart.draw_series(LineSeries::new([(-MOST, 0.0), (MOST, 0.0)], BLACK.mix(0.5)))?;
        for (k, component) in components.iter().enumerate() {
            let Component { truth, found, deviation } = *component;
            // The first half belongs to the hydrofoil.
            let colour = if 2 * k < components.len() { RGBColor(0, 90, 160) } else { RGBColor(200, 90, 0) };
            let error = found - truth;
            let [low, high] = [error - NINETY * deviation, error + NINETY * deviation];
            chart.draw_series([PathElement::new([(truth, low), (truth, high)], colour.stroke_width(1))])?;
            chart.draw_series([Circle::new((truth, error), 3, colour.filled())])?;
        }
        area.present()?;
    }
    hydroid::atomic::write(path, |out| out.write_all(text.as_bytes()))?;
    Ok(())
}
