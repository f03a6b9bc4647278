//! The check of `u`, `v` and `r` against the pose.

use std::f64::consts::PI;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::log;
use hydroid::log::{PrepareOptions, RawLog, Selection, inspect, read};

const KNOT: f64 = 1852.0 / 3600.0;
const DEGREE: f64 = PI / 180.0;

/// A log, its selection, and the columns of u, v, r.
#[derive(Clone)]
struct Boat {
    log: RawLog,
    selection: Selection,
    columns: [usize; 3],
}

impl Boat {
    fn new(log: RawLog, selection: Selection) -> Self {
        let columns = [0, 1, 2].map(|i| log.position(&selection.outputs[i].column).unwrap());
        Self { log, selection, columns }
    }

    /// Factor from the unit in the file to SI.
    fn unit(&self, i: usize) -> f64 {
        match self.log.columns[self.columns[i]].unit.as_deref() {
            Some("kn") => KNOT,
            Some("deg/s") => DEGREE,
            Some("deg/min") => DEGREE / 60.0,
            _ => 1.0,
        }
    }

    /// The same log with a channel as if the sensor wrote in another unit than the one stated: values in SI divided by
    /// the factor of that unit.
    fn in_unit(mut self, i: usize, factor: f64) -> Self {
        // A fleet log may state the wrong unit already, so that the values differ from SI by the stated unit.
        let by = self.unit(i) / factor;
        let column = &mut self.log.columns[self.columns[i]];
        column.values.iter_mut().for_each(|x| *x *= by);
        // The header loses its unit: the column is read in SI.
        column.unit = None;
        self
    }

    fn flipped(mut self, i: usize) -> Self {
        self.log.columns[self.columns[i]].values.iter_mut().for_each(|x| *x = -*x);
        self
    }

    /// Two channels with each other's columns.
    fn exchanged(mut self, i: usize, j: usize) -> Self {
        let outputs = &mut self.selection.outputs;
        let names = [outputs[i].name.clone(), outputs[j].name.clone()];
        outputs.swap(i, j);
        [outputs[i].name, outputs[j].name] = names;
        self
    }

    /// The values of two columns in each other's place, without units in the header.
    fn mixed_up(mut self, i: usize, j: usize) -> Self {
        for k in [i, j] {
            let by = self.unit(k);
            let column = &mut self.log.columns[self.columns[k]];
            column.values.iter_mut().for_each(|x| *x *= by);
            column.unit = None;
        }
        let (a, b) = (self.columns[i], self.columns[j]);
        let values = std::mem::take(&mut self.log.columns[a].values);
        self.log.columns[a].values = std::mem::replace(&mut self.log.columns[b].values, values);
        self
    }

    /// Another frame of the pose: the new position and heading \[rad\] from the old ones.
    fn in_frame(mut self, frame: impl Fn(f64, f64, f64) -> [f64; 3]) -> Self {
        let place = |names: &[&str]| {
            let fits = |c: &hydroid::log::RawColumn| names.contains(&c.name.as_str());
            self.log.columns.iter().position(fits).unwrap()
        };
        let [x, y] = [
            place(&["x", "x_m", "x_position_mid", "north_m"]),
            place(&["y", "y_m", "y_position_mid", "east_m"]),
        ];
        let heading = place(&["psi", "psi_rad", "psi_hat"]);
        let unit = if self.log.columns[heading].unit.as_deref() == Some("deg") { DEGREE } else { 1.0 };
        for k in 0..self.log.rows() {
            let value = |i: usize| self.log.columns[i].values[k];
            let new = frame(value(x), value(y), value(heading) * unit);
            for (i, value) in [(x, new[0]), (y, new[1]), (heading, new[2] / unit)] {
                self.log.columns[i].values[k] = value;
            }
        }
        // The names must not contradict the frame.
        for (i, name) in [(x, "x [m]"), (y, "y [m]")] {
            name[..1].clone_into(&mut self.log.columns[i].name);
            self.log.columns[i].unit = Some("m".to_owned());
        }
        self
    }

    /// Messages on velocities that are hardly possible.
    fn implausible(&self) -> Vec<String> {
        let found = inspect(&self.log, &self.selection, &PrepareOptions::default()).unwrap();
        let messages = found.notes.into_iter().map(|n| n.message);
        messages.filter(|m| m.contains("no vessel turns") || m.contains("move sideways")).collect()
    }

    /// Messages and remedies of the check.
    fn accusations(&self) -> Vec<(String, String)> {
        let found = inspect(&self.log, &self.selection, &PrepareOptions::default()).unwrap();
        found
            .notes
            .into_iter()
            .filter(|n| {
                n.message.contains("contradicts the pose") || n.message.contains("seem to be exchanged")
            })
            .map(|n| (n.message, n.remedy.unwrap()))
            .collect()
    }
}

fn folder() -> Option<PathBuf> {
    let found = std::env::var_os("HYDROID_DATA").map(PathBuf::from);
    if found.is_none() {
        let _ = writeln!(std::io::stderr(), "skipped: no HYDROID_DATA");
    }
    found
}

fn selection(file: &Path) -> Selection {
    let path = file.to_string_lossy();
    let of = |outputs: &str, inputs: &str| Selection::of(outputs, inputs).unwrap();
    if path.contains("cybership") {
        of("u=u_mps,v=v_mps,r=r_radps", "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster")
    } else if path.contains("esso") {
        of("u=u_velo,v=vm_velo,r=r_angvelo", "n=n_prop,delta=delta_rudder")
    } else if path.contains("usv") {
        of("u=u_mps,v=v_mps,r=r_radps", "pwm_left_us,pwm_right_us")
    } else {
        of("u,v,r", "u,v")
    }
}

fn boat(file: &Path) -> Boat {
    let log = read(file).unwrap();
    let mut selection = selection(file);
    if file.parent().is_some_and(|p| p.ends_with("rates")) {
        selection.inputs =
            log.columns[1..3].iter().map(|c| hydroid::log::ChannelSpec::named(&c.name)).collect();
    } else if file.parent().is_some_and(|p| p.ends_with("truth")) {
        selection.inputs.clear();
    }
    Boat::new(log, selection)
}

fn files(folder: &Path, parts: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for part in parts {
        let entries = std::fs::read_dir(folder.join(part)).unwrap().map(|e| e.unwrap().path());
        found.extend(entries.filter(|p| p.extension().is_some_and(|e| e == "csv")));
    }
    found.sort();
    found
}

const PUBLIC: &[&str] = &[
    "cybership-enterprise1",
    "esso-osaka",
    "usv-asw",
    "fleet/otter/rates",
    "fleet/tanker/rates",
    "fleet/clarke83/rates",
    "fleet/zefakkel/rates",
    "fleet/transit/rates",
    "fleet/otter/truth",
    "fleet/tanker/truth",
    "fleet/clarke83/truth",
    "fleet/zefakkel/truth",
    "fleet/transit/truth",
];

#[test]
fn no_right_public_log_is_accused() {
    let Some(folder) = folder() else { return };
    let files = files(&folder, PUBLIC);
    assert!(files.len() >= 70, "{}", files.len());
    for file in files {
        let right = boat(&file);
        assert_eq!(right.accusations(), [], "{}", file.display());
        let mut without_pose = right;
        let pose = [
            "x",
            "y",
            "psi",
            "x_m",
            "y_m",
            "psi_rad",
            "x_position_mid",
            "y_position_mid",
            "psi_hat",
            "north_m",
        ];
        for column in &mut without_pose.log.columns {
            if pose.contains(&column.name.as_str()) {
                column.name.insert_str(0, "unknown ");
                column.unit = None;
                column.values.fill(0.0);
            }
        }
        assert_eq!(without_pose.implausible(), Vec::<String>::new(), "{}", file.display());
    }
}

type Change = fn(Boat) -> Boat;

/// Changes of the pose that leave u, v and r right.
const FRAMES: &[(&str, Change)] = &[
    ("x east, y north, heading counterclockwise from east", |b| {
        b.in_frame(|x, y, psi| [y, x, PI / 2.0 - psi])
    }),
    ("x east, y north, heading clockwise from north", |b| b.in_frame(|x, y, psi| [y, x, psi])),
    ("x north, y west, heading clockwise from north", |b| b.in_frame(|x, y, psi| [x, -y, psi])),
    ("a basin at an angle of 37 degrees", |b| {
        let (sin, cos) = (37.0 * DEGREE).sin_cos();
        b.in_frame(move |x, y, psi| [cos * x - sin * y, sin * x + cos * y, psi])
    }),
    ("a compass with an error of 3 degrees", |b| b.in_frame(|x, y, psi| [x, y, psi + 3.0 * DEGREE])),
    ("a position 1 m ahead", |b| b.in_frame(|x, y, psi| [x + psi.cos(), y + psi.sin(), psi])),
    ("v and r to port, heading counterclockwise", |b| {
        b.flipped(1).flipped(2).in_frame(|x, y, psi| [y, x, PI / 2.0 - psi])
    }),
];

/// An accused output, its column, and the end of its new specification.
type Accused = (usize, usize, &'static str);

/// Name of the case, change of the log, and what the check should find.
const CASES: &[(&str, Change, &[Accused])] = &[
    ("r in deg/s", |b| b.in_unit(2, DEGREE), &[(2, 2, " [deg/s]")]),
    ("r in deg/min", |b| b.in_unit(2, DEGREE / 60.0), &[(2, 2, " [deg/min]")]),
    ("u in kn", |b| b.in_unit(0, KNOT), &[(0, 0, " [kn]")]),
    ("u and v in kn", |b| b.in_unit(0, KNOT).in_unit(1, KNOT), &[(0, 0, " [kn]"), (1, 1, " [kn]")]),
    ("u in km/h", |b| b.in_unit(0, 1.0 / 3.6), &[(0, 0, " [km/h]")]),
    ("u in cm/s", |b| b.in_unit(0, 0.01), &[(0, 0, " [cm/s]")]),
    ("u in ft/s", |b| b.in_unit(0, 0.3048), &[(0, 0, " [ft/s]")]),
    ("v in mm/s", |b| b.in_unit(1, 0.001), &[(1, 1, " [mm/s]")]),
    ("r flipped", |b| b.flipped(2), &[(2, 2, " * -1")]),
    ("v flipped", |b| b.flipped(1), &[(1, 1, " * -1")]),
    ("u flipped", |b| b.flipped(0), &[(0, 0, " * -1")]),
    ("u and v exchanged", |b| b.exchanged(0, 1), &[(0, 0, ""), (1, 1, "")]),
    ("u and r exchanged", |b| b.exchanged(0, 2), &[(0, 0, ""), (2, 2, "")]),
    ("v and r exchanged", |b| b.exchanged(1, 2), &[(1, 1, ""), (2, 2, "")]),
    ("columns of u and v exchanged", |b| b.mixed_up(0, 1), &[(0, 1, ""), (1, 0, "")]),
    ("r flipped, u in kn", |b| b.in_unit(0, KNOT).flipped(2), &[(0, 0, " [kn]"), (2, 2, " * -1")]),
    ("r flipped and in deg/s", |b| b.in_unit(2, DEGREE).flipped(2), &[(2, 2, " [deg/s] * -1")]),
];

/// The outputs that a case should accuse and are not, or are without the right remedy.
fn not_named(right: &Boat, change: Change, expected: &[Accused]) -> Vec<String> {
    let wrong = change(right.clone());
    let found = wrong.accusations();
    let names = ["u", "v", "r"];
    let column = |i: usize| right.log.columns[right.columns[i]].name.as_str();
    let spec = |&(output, from, end): &Accused| {
        let name = if names[output] == column(from) { String::new() } else { format!("{}=", names[output]) };
        format!("{name}{}{end}", column(from))
    };
    let accused = |name: &str| {
        found.iter().any(|(message, _)| {
            message.contains(&format!("`{name}` contradicts"))
                || message.split(" seem to be exchanged").next().unwrap().contains(&format!("`{name}`"))
                    && message.contains("exchanged")
        })
    };
    let mut missed = Vec::new();
    for case in expected {
        let listed = |remedy: &str| {
            let list = remedy.trim_start_matches("outputs=").trim_matches('"');
            list.split(',').any(|entry| entry == spec(case))
        };
        if !accused(names[case.0]) || !found.iter().all(|(_, remedy)| listed(remedy)) {
            missed.push(format!("{} {found:?}", spec(case)));
        }
    }
    for (i, name) in names.iter().enumerate() {
        if accused(name) && !expected.iter().any(|(output, ..)| *output == i) {
            missed.push(format!("{name} is right {found:?}"));
        }
    }
    missed
}

/// One run of each vessel whose sway velocity is known.
const VESSELS: &[&str] = &[
    "cybership-enterprise1/random_run1.csv",
    "cybership-enterprise1/dptest1.csv",
    "esso-osaka/random_31-Jul-2020_14_52_18.csv",
    "fleet/otter/rates/run2.csv",
    "fleet/tanker/rates/run1.csv",
    "fleet/clarke83/rates/run3.csv",
    "fleet/zefakkel/rates/run6.csv",
    "fleet/transit/rates/run4.csv",
];

#[test]
fn wrong_units_signs_and_exchanged_channels_of_the_public_logs_are_named() {
    let Some(folder) = folder() else { return };
    // The heading of `dptest1` hardly changes, so that a flipped `u` is the same as another frame of the path.
    for file in VESSELS.iter().filter(|file| !file.contains("dptest1")) {
        let right = boat(&folder.join(file));
        for (name, change, expected) in CASES {
            assert_eq!(not_named(&right, *change, expected), Vec::<String>::new(), "{file}: {name}");
        }
    }
}

#[test]
fn another_frame_of_the_pose_is_no_fault() {
    let Some(folder) = folder() else { return };
    for file in VESSELS {
        for (name, change) in FRAMES {
            assert_eq!(change(boat(&folder.join(file))).accusations(), [], "{file}: {name}");
        }
    }
}

/// A boat on a winding path, in SI units, at 10 Hz with a little noise.
fn winding() -> Boat {
    let mut text = String::from("t [s],n [rps],x [m],y [m],psi [rad],u,v,r\n");
    let (mut x, mut y, mut psi) = (0.0_f64, 0.0_f64, 0.3_f64);
    for k in 0..3000 {
        let t = f64::from(k) * 0.1;
        let noise = |seed: f64| 0.02 * ((f64::from(k) * seed).sin() * 1e4).fract();
        let (u, v, r) =
            (1.0 + 0.4 * (0.07 * t).sin(), 0.2 * (0.23 * t).sin() + 0.05, 0.1 * (0.11 * t).sin() + 0.02);
        let wrapped = psi.sin().atan2(psi.cos());
        text += &format!(
            "{t:.1},{:.2},{:.3},{:.3},{wrapped:.4},{:.4},{:.4},{:.4}\n",
            (0.3 * t).sin(),
            x + noise(1.1),
            y + noise(1.3),
            u + noise(1.7),
            v + noise(1.9),
            r + 0.1 * noise(2.3)
        );
        x += 0.1 * (u * psi.cos() - v * psi.sin());
        y += 0.1 * (u * psi.sin() + v * psi.cos());
        psi += 0.1 * r;
    }
    Boat::new(log(&text), Selection::of("u,v,r", "n").unwrap())
}

#[test]
fn a_winding_path_names_wrong_channels_and_no_others() {
    let right = winding();
    assert_eq!(right.accusations(), []);
    for (name, change) in FRAMES {
        assert_eq!(change(right.clone()).accusations(), [], "{name}");
    }
    for (name, change, expected) in CASES {
        assert_eq!(not_named(&right, *change, expected), Vec::<String>::new(), "{name}");
    }
    let (message, remedy) = right.clone().in_unit(2, DEGREE).accusations().remove(0);
    assert_eq!(
        message,
        "log.csv: `r` contradicts the pose: as read it is 57.3 times the rate of change of `psi`; its unit seems to be deg/s"
    );
    assert_eq!(remedy, "outputs=\"u,v,r [deg/s]\"");
    let (message, remedy) = right.clone().mixed_up(0, 1).accusations().remove(0);
    assert!(message.contains("`u` and `v` seem to be exchanged: the forward velocity"), "{message}");
    assert_eq!(remedy, "outputs=\"u=v,v=u,r\"");
}

#[test]
fn outputs_are_checked_without_the_others() {
    let only = |outputs: &str, change: Change| {
        let mut boat = change(winding());
        boat.selection = Selection::of(outputs, "n").unwrap();
        boat.accusations().len()
    };
    assert_eq!([only("u", |b| b), only("v", |b| b), only("r", |b| b), only("u,v", |b| b)], [0; 4]);
    assert_eq!(only("r", |b| b.in_unit(2, DEGREE)), 1);
    assert_eq!(only("u,r", |b| b.in_unit(0, KNOT)), 1);
    assert_eq!(only("u", |b| b.flipped(0)), 1);
    assert_eq!(only("r", |b| b.flipped(2)), 1);
    assert_eq!(only("u,v", |b| b.mixed_up(0, 1)), 1);
}

#[test]
fn an_unclear_pose_accuses_nothing() {
    let wrong = || winding().in_unit(2, DEGREE).in_unit(0, KNOT);
    assert_eq!(wrong().accusations().len(), 2);
    let place = |boat: &Boat, name: &str| boat.log.position(name).unwrap();
    // A heading without a unit that never wraps, two headings, and a heading of another vessel.
    let mut unclear = wrong();
    let psi = place(&unclear, "psi");
    unclear.log.columns[psi].unit = None;
    unclear.log.columns[psi].values.iter_mut().for_each(|x| *x *= 0.1);
    assert_eq!(unclear.accusations(), []);
    let mut two = wrong();
    let mut second = two.log.columns[psi].clone();
    second.name = "heading".to_owned();
    two.log.columns.push(second);
    assert_eq!(two.accusations(), []);
    let mut poor = wrong();
    poor.log.columns[psi].values.reverse();
    assert_eq!(poor.accusations(), []);
    // Without a position, the yaw rate alone is checked.
    let mut without = wrong();
    let x = place(&without, "x");
    without.log.columns[x].name = "depth".to_owned();
    assert_eq!(without.accusations().len(), 1);
}

#[test]
fn a_wrapped_heading_needs_no_unit() {
    for factor in [1.0, 1.0 / DEGREE] {
        let mut boat = winding().in_unit(2, DEGREE);
        let psi = boat.log.position("psi").unwrap();
        boat.log.columns[psi].unit = None;
        boat.log.columns[psi].values.iter_mut().for_each(|x| *x *= factor);
        assert_eq!(boat.accusations().len(), 1);
    }
}
