//! Simulated boats of first order, for experiments.

use hydroid_live::Axis;
use hydroid_live::experiment::{Experiment, Explored, Fence, Kind, Seen, Settings, Step};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Drive {
    /// One throttle and a rudder, which acts in proportion to the speed.
    Rudder,
    /// Two thrusters, left and right.
    Twin,
}

/// First-order surge and yaw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Boat {
    pub(crate) name: &'static str,
    pub(crate) drive: Drive,
    pub(crate) astern: bool,
    pub(crate) speed: f64,
    pub(crate) push_s: f64,
    pub(crate) yaw_rate: f64,
    pub(crate) turn_s: f64,
    /// Drag proportional to the square of the speed.
    pub(crate) quadratic: bool,
    /// Time constant of the actuators.
    pub(crate) lag_s: f64,
}

pub(crate) const BOATS: [Boat; 9] = [
    Boat {
        name: "tiny",
        drive: Drive::Rudder,
        astern: true,
        speed: 1.2,
        push_s: 0.5,
        yaw_rate: 0.8,
        turn_s: 0.5,
        quadratic: false,
        lag_s: 0.1,
    },
    Boat {
        name: "model",
        drive: Drive::Rudder,
        astern: true,
        speed: 3.0,
        push_s: 1.5,
        yaw_rate: 1.0,
        turn_s: 0.5,
        quadratic: true,
        lag_s: 0.1,
    },
    Boat {
        name: "rib",
        drive: Drive::Rudder,
        astern: true,
        speed: 8.0,
        push_s: 4.0,
        yaw_rate: 0.5,
        turn_s: 1.0,
        quadratic: true,
        lag_s: 0.3,
    },
    Boat {
        name: "launch",
        drive: Drive::Rudder,
        astern: true,
        speed: 4.0,
        push_s: 8.0,
        yaw_rate: 0.2,
        turn_s: 4.0,
        quadratic: false,
        lag_s: 0.5,
    },
    Boat {
        name: "ship",
        drive: Drive::Rudder,
        astern: true,
        speed: 3.0,
        push_s: 20.0,
        yaw_rate: 0.06,
        turn_s: 20.0,
        quadratic: false,
        lag_s: 1.0,
    },
    Boat {
        name: "fast-ship",
        drive: Drive::Rudder,
        astern: true,
        speed: 8.0,
        push_s: 20.0,
        yaw_rate: 0.1,
        turn_s: 8.0,
        quadratic: true,
        lag_s: 1.0,
    },
    Boat {
        name: "twin",
        drive: Drive::Twin,
        astern: true,
        speed: 2.0,
        push_s: 2.0,
        yaw_rate: 0.6,
        turn_s: 1.0,
        quadratic: false,
        lag_s: 0.1,
    },
    Boat {
        name: "ahead-only",
        drive: Drive::Rudder,
        astern: false,
        speed: 3.0,
        push_s: 5.0,
        yaw_rate: 0.3,
        turn_s: 2.0,
        quadratic: true,
        lag_s: 0.2,
    },
    Boat {
        name: "twin-ahead",
        drive: Drive::Twin,
        astern: false,
        speed: 2.0,
        push_s: 3.0,
        yaw_rate: 0.8,
        turn_s: 1.5,
        quadratic: false,
        lag_s: 0.1,
    },
];

impl Boat {
    pub(crate) fn radius(&self) -> f64 {
        self.speed / self.yaw_rate
    }

    /// Twelve turning radii, or as many half ways of a time constant where the boat is sluggish for its radius.
    pub(crate) fn fence(&self) -> f64 {
        (12.0 * self.radius().max(0.5 * self.speed * self.push_s.max(self.turn_s))).max(60.0 * 0.5)
    }

    pub(crate) fn scale(&self) -> f64 {
        self.push_s.max(self.turn_s)
    }

    pub(crate) fn dt(&self) -> f64 {
        (0.1 * self.push_s.min(self.turn_s)).clamp(0.05, 0.5)
    }

    pub(crate) fn settings(&self, seed: u64) -> Settings {
        let low = if self.astern { -1.0 } else { 0.0 };
        let input = |name: &str, low: f64, high: f64| Axis::new(name, [low, high], 0.0);
        let (inputs, push, turn) = match self.drive {
            Drive::Rudder => (
                vec![input("throttle", low, 1.0), input("rudder", -35.0, 35.0)],
                vec![(0, 1.0)],
                vec![(1, 1.0)],
            ),
            Drive::Twin => (
                vec![input("left", low, 1.0), input("right", low, 1.0)],
                vec![(0, 1.0), (1, 1.0)],
                vec![(0, 1.0), (1, -1.0)],
            ),
        };
        Settings {
            inputs,
            push,
            turn,
            fence: Fence::Circle { north: 10.0, east: -20.0, radius: self.fence() },
            max_speed_m_s: 1.3 * self.speed + 1.0,
            max_yaw_rate_rad_s: 1.5 * self.yaw_rate,
            duration_s: 200.0 + 150.0 * self.scale(),
            dt_s: self.dt(),
            seed,
            level: Settings::DEFAULT_LEVEL,
        }
    }
}

/// State of a simulated boat.
#[derive(Clone, Debug)]
pub(crate) struct Sim {
    pub(crate) boat: Boat,
    pub(crate) t: f64,
    pub(crate) north: f64,
    pub(crate) east: f64,
    pub(crate) psi: f64,
    pub(crate) u: f64,
    pub(crate) r: f64,
    actual: [f64; 2],
    pub(crate) current: [f64; 2],
    gust: [f64; 3],
    pub(crate) gusts: bool,
    rng: ChaCha8Rng,
}

impl Sim {
    pub(crate) fn new(boat: Boat, settings: &Settings, current: f64, gusts: bool) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + settings.seed);
        let mut angle = || rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
        let (psi, to, place) = (angle(), angle(), angle());
        let from = rng.random_range(0.0..0.5) * settings.fence.size();
        let [n, e] = settings.fence.interior();
        Self {
            boat,
            t: 100.0,
            north: n + from * place.cos(),
            east: e + from * place.sin(),
            psi,
            u: 0.0,
            r: 0.0,
            actual: [0.0; 2],
            current: [current * to.cos(), current * to.sin()],
            gust: [0.0; 3],
            gusts,
            rng,
        }
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.rng.random_range(-0.5..0.5)).sum()
    }

    pub(crate) fn advance(&mut self, commands: &[f64], dt: f64) {
        let boat = self.boat;
        let [push, turn] = match boat.drive {
            Drive::Rudder => [commands[0], commands[1] / 35.0],
            Drive::Twin => [0.5 * (commands[0] + commands[1]), 0.5 * (commands[0] - commands[1])],
        };
        let n = 5;
        let h = dt / f64::from(n);
        for _ in 0..n {
            let a = 1.0 - (-h / boat.lag_s).exp();
            self.actual[0] += a * (push - self.actual[0]);
            self.actual[1] += a * (turn - self.actual[1]);
            if self.gusts {
                let tau = 8.0_f64;
                let s = (2.0 * h / tau).sqrt();
                for k in 0..3 {
                    let size = if k < 2 { 0.1 } else { 0.05 * boat.yaw_rate };
                    let x = self.normal();
                    self.gust[k] += -h / tau * self.gust[k] + s * size * x;
                }
            }
            let full = boat.speed;
            let drag = if boat.quadratic { self.u * self.u.abs() / full } else { self.u };
            // A turn at full rate takes a fifth of the speed.
            let loss = 0.25 * self.u * (self.r / boat.yaw_rate).powi(2);
            self.u += h / boat.push_s * (full * self.actual[0] - drag - loss);
            let effect = match boat.drive {
                Drive::Rudder => self.u / full,
                Drive::Twin => 1.0,
            };
            self.r += h / boat.turn_s * (boat.yaw_rate * effect * self.actual[1] + self.gust[2] - self.r);
            self.psi += h * self.r;
            let [vn, ve] = self.over_ground();
            self.north += h * vn;
            self.east += h * ve;
        }
        self.t += dt;
    }

    fn over_ground(&self) -> [f64; 2] {
        let (s, c) = self.psi.sin_cos();
        // Sideslip outward of the turn.
        let v = -0.1 * self.boat.radius() * self.r;
        [
            self.u * c - v * s + self.current[0] + self.gust[0],
            self.u * s + v * c + self.current[1] + self.gust[1],
        ]
    }

    pub(crate) fn seen(&mut self) -> Seen {
        let [vn, ve] = self.over_ground();
        let (s, c) = self.psi.sin_cos();
        let noise = if self.gusts { 1.0 } else { 0.0 };
        let mut add = |value: f64, sd: f64| value + noise * sd * self.normal();
        Seen {
            t: 0.0,
            north: add(0.0, 0.1),
            east: add(0.0, 0.1),
            psi: add(0.0, 0.005),
            u: add(vn * c + ve * s, 0.03),
            v: add(-vn * s + ve * c, 0.03),
            r: add(0.0, 0.003),
        }
        .plus(self)
    }
}

trait Plus {
    fn plus(self, sim: &Sim) -> Self;
}

impl Plus for Seen {
    fn plus(mut self, sim: &Sim) -> Self {
        self.t = sim.t;
        self.north += sim.north;
        self.east += sim.east;
        self.psi = (self.psi + sim.psi).rem_euclid(std::f64::consts::TAU);
        self.r += sim.r;
        self
    }
}

/// What happened in a run.
#[derive(Clone, Debug)]
pub(crate) struct Report {
    pub(crate) end: Step,
    pub(crate) seconds: f64,
    pub(crate) active_s: f64,
    pub(crate) least_margin: f64,
    pub(crate) top_speed: f64,
    pub(crate) top_rate: f64,
    pub(crate) explored: Explored,
    pub(crate) scales: Option<[f64; 2]>,
    pub(crate) commands: Vec<Vec<f64>>,
    pub(crate) texts: Vec<String>,
}

pub(crate) fn run(kind: Kind, settings: &Settings, sim: &mut Sim) -> Report {
    let mut explored = Explored::new(&settings.inputs, &settings.push, &settings.turn).unwrap();
    let mut experiment = Experiment::new(kind, settings.clone(), &explored).unwrap();
    let start = sim.t;
    let mut report = Report {
        end: Step::Abort("never".into()),
        seconds: 0.0,
        active_s: 0.0,
        least_margin: f64::INFINITY,
        top_speed: 0.0,
        top_rate: 0.0,
        explored: explored.clone(),
        scales: None,
        commands: Vec::new(),
        texts: Vec::new(),
    };
    let mut k = 0u64;
    loop {
        let seen = sim.seen();
        let margin = settings.fence.margin(sim.north, sim.east);
        report.least_margin = report.least_margin.min(margin);
        report.top_speed = report.top_speed.max(seen.u.hypot(seen.v));
        report.top_rate = report.top_rate.max(sim.r.abs());
        let step = experiment.step(&seen);
        let text = experiment.text();
        if report.texts.last() != Some(&text) {
            report.texts.push(text);
        }
        assert!((0.0..=1.0).contains(&experiment.progress()) && experiment.remaining_s() >= 0.0);
        match step {
            Step::Command(commands) => {
                assert_eq!(commands.len(), settings.inputs.len());
                for (input, command) in settings.inputs.iter().zip(&commands) {
                    assert!((input.low..=input.high).contains(command), "{} {command}", input.name);
                }
                explored.see(settings.dt_s, &commands);
                sim.advance(&commands, settings.dt_s);
                report.commands.push(commands);
            }
            end => {
                report.end = end;
                break;
            }
        }
        k += 1;
        assert!(k as f64 * settings.dt_s < settings.duration_s + 1.0, "no end");
    }
    report.seconds = sim.t - start;
    report.active_s = experiment.active_s();
    report.scales = experiment.time_scales();
    if let Some([p, t]) = report.scales {
        explored.set_time_scales(p, t);
    }
    report.explored = explored;
    report
}
