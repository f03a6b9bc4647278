//! Time and memory of hydroid on board: messages at 100 Hz, a network that learns, and the state of the page at 10 Hz.

use std::sync::Arc;
use std::time::{Duration, Instant};

use hydroid::model::{Body, Model};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use hydroid_live::boat::{Action, Boat};
use hydroid_live::link::mavlink::MavLink;
use mavlink::MavHeader;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

use super::autopilot::Autopilot;
use super::vessel::{Commands, link, model, settings};
use super::{MS, S, TICK_NS};

const START_NS: i64 = 1_700_000_000 * S;

/// Time between states of the page.
const STATE_NS: i64 = 100 * MS;

/// A gated recurrent unit of the default size, with small weights: it learns increments of the motion.
fn network(commands: Commands, rng: &mut ChaCha8Rng) -> Model {
    let network = Network { cell: Cell::Gru { hidden: 18 }, inputs: 5, outputs: 3, read_out: true };
    let body = Recurrent {
        weights: (0..network.weights()).map(|k| (1.0 + k as f64).sqrt().sin() / 10.0).collect(),
        network,
        scaling: Scaling {
            output_mean: vec![1.0, 0.0, 0.0],
            output_scale: vec![0.7, 0.2, 0.3],
            input_mean: vec![0.5, 0.0],
            input_scale: vec![0.3, 0.5],
            correction_scale: vec![0.1, 0.03, 0.05],
        },
        base: BaseModel::Hold,
        feedback: true,
        wash_out: 100,
    };
    Model { body: Body::Recurrent(Arc::new(body)), ..model(commands, 0.0, rng) }
}

/// Resident memory \[MB\]; NaN where the system does not tell it.
fn resident_mb() -> f64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = pages.and_then(|text| text.split(' ').nth(1)?.parse::<f64>().ok());
    pages.map_or(f64::NAN, |pages| pages * 4096.0 / 1e6)
}

/// Times by their logarithm: bins of 2 % from 0.1 us on, whose memory does not grow.
struct Times {
    bins: Vec<u64>,
    longest: Duration,
    total: Duration,
}

impl Times {
    fn new() -> Self {
        Self { bins: vec![0; 1000], longest: Duration::ZERO, total: Duration::ZERO }
    }

    fn add(&mut self, time: Duration) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of a bin")]
        let bin = (50.0 * (1e7 * time.as_secs_f64()).max(1.0).ln()) as usize;
        self.bins[bin.min(999)] += 1;
        self.longest = self.longest.max(time);
        self.total += time;
    }

    fn count(&self) -> u64 {
        self.bins.iter().sum()
    }

    /// The time in microseconds that a share of the times does not exceed.
    fn quantile(&self, share: f64) -> f64 {
        let mut left = share * self.count() as f64;
        let bin = self.bins.iter().position(|count| {
            left -= *count as f64;
            left <= 0.0
        });
        bin.map_or(f64::NAN, |bin| 0.1 * (0.02 * (bin + 1) as f64).exp())
    }

    fn line(&self, what: &str, simulated_s: f64) {
        let [median, most, all] = [0.5, 0.99, 0.999].map(|share| self.quantile(share));
        let share = 100.0 * self.total.as_secs_f64() / simulated_s;
        let longest = 1e6 * self.longest.as_secs_f64();
        println!(
            "{what:32} {:9} {median:9.0} {most:9.0} {all:9.0} {longest:9.0} {share:8.2} %",
            self.count()
        );
    }
}

/// Prints the times of `receive` and `tick` and of the state, and the memory over the time. `HYDROID_SPEED_HOURS` is the
/// simulated time, a tenth of an hour by default; `HYDROID_SPEED_MODEL=equations` has a model of equations in place of the
/// network, with which the time advances faster. The memory must not grow with the time.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn time_and_memory_on_board() {
    let hours = std::env::var("HYDROID_SPEED_HOURS").map_or(0.1, |text| text.parse::<f64>().unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let place = TempDir::new().unwrap();
    let commands = Commands::Channels;
    let mut settings = settings(commands, &place.path().join("live"), &mut rng);
    settings.records = true;
    settings.horizons_s = vec![1.0, 2.0, 5.0, 10.0];
    settings.experiment.duration_s = 600.0;
    let mut boat = Boat::new(settings, MavLink::new(link(50.0)), START_NS).unwrap();
    let has_network = std::env::var("HYDROID_SPEED_MODEL").as_deref() != Ok("equations");
    let on_board = if has_network { network(commands, &mut rng) } else { model(commands, 0.1, &mut rng) };
    boat.take_on("model", &on_board).unwrap();
    let mut autopilot = Autopilot::new(START_NS, &mut rng);
    let header = MavHeader { system_id: 1, component_id: 1, sequence: 0 };
    let [mut messages, mut samples, mut ticks, mut steps, mut states] = [(); 5].map(|()| Times::new());
    let (mut now_ns, mut bytes, mut memory) = (START_NS, 0, Vec::new());
    #[expect(clippy::cast_possible_truncation, reason = "hours")]
    let end_ns = START_NS + (hours * 3600.0) as i64 * S;
    while now_ns < end_ns {
        now_ns += TICK_NS;
        let elapsed_ns = now_ns - START_NS;
        let mut step = Duration::ZERO;
        for message in autopilot.tick(&mut rng) {
            let begun = Instant::now();
            let is_sample = boat.receive(&(header, message), now_ns);
            let time = begun.elapsed();
            let times = if is_sample { &mut samples } else { &mut messages };
            times.add(time);
            step += time;
        }
        let begun = Instant::now();
        boat.tick(now_ns, |(_, message)| autopilot.receive(&message));
        ticks.add(begun.elapsed());
        steps.add(step + begun.elapsed());
        if elapsed_ns % STATE_NS == 0 {
            let begun = Instant::now();
            bytes = boat.view(now_ns, [0; 2]).to_string().len();
            states.add(begun.elapsed());
        }
        // An experiment excites the boat; the pilot steers in between.
        if elapsed_ns % (900 * S) == 10 * S {
            // It may be refused where the boat is.
            drop(boat.act(Action::Experiment { name: "auto".to_owned() }, now_ns));
        }
        let time = elapsed_ns as f64 / 1e9;
        autopilot.sticks = [0.3 * (0.05 * time).sin(), 0.4];
        if autopilot.water.distance() > 30.0 {
            autopilot.sticks = autopilot.water.homeward();
        }
        if elapsed_ns % (60 * S) == 0 {
            memory.push(resident_mb());
        }
    }
    let simulated_s = hours * 3600.0;
    println!(
        "{:32} {:>9} {:>9} {:>9} {:>9} {:>9} {:>10}",
        "[us]", "number", "median", "99 %", "99.9 %", "maximum", "of a core"
    );
    messages.line("receive, without a sample", simulated_s);
    samples.line("receive, with a sample", simulated_s);
    ticks.line("tick", simulated_s);
    steps.line("all of a step of 20 ms", simulated_s);
    states.line(&format!("state of the page, {bytes} bytes"), simulated_s);
    let shown: Vec<String> =
        memory.iter().step_by(memory.len().div_ceil(25)).map(|mb| format!("{mb:.1}")).collect();
    println!("resident memory [MB]: {}", shown.join(" "));
    assert!(samples.count() > 100, "{} samples", samples.count());
    if let (Some(early), Some(last)) = (memory.get(10), memory.last()) {
        let grown = last - early;
        assert!(grown.is_nan() || grown < 5.0, "the memory has grown by {grown:.1} MB after ten minutes");
    }
    boat.close(now_ns);
}
