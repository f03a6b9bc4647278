//! The plugins of Gazebo, by the equations of their sources.

use std::collections::BTreeMap;

use hydroid::model::Model;
use hydroid_core::craft::{Craft, Dynamics};
use hydroid_export::coefficients::{CoefficientOptions, Coefficients, sdf};
use quick_xml::Reader;
use quick_xml::events::Event;

use super::{VESSELS, content, model, motions, near, options, vessel};

/// The elements of a plugin, the attributes of its root and its comments.
pub(crate) struct Plugin {
    pub(crate) root: String,
    pub(crate) elements: BTreeMap<String, String>,
    pub(crate) comments: String,
}

pub(crate) fn parse(text: &str) -> Plugin {
    let mut reader = Reader::from_str(text);
    reader.config_mut().check_comments = true;
    let (mut root, mut elements, mut comments) = (String::new(), BTreeMap::new(), String::new());
    let mut open: Vec<String> = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            Event::Start(start) => {
                let name = start.name().as_ref().to_owned();
                if open.is_empty() {
                    assert!(root.is_empty(), "one root");
                    root.push_str(&start);
                } else {
                    assert_eq!(open.len(), 1, "{name} inside {open:?}");
                    assert!(elements.insert(name.clone(), String::new()).is_none(), "{name} twice");
                }
                open.push(name);
            }
            Event::End(_) => drop(open.pop()),
            Event::Text(text) if open.len() == 2 => {
                elements.get_mut(&open[1]).unwrap().push_str(&text);
            }
            Event::GeneralRef(reference) if open.len() == 2 => {
                let name = (*reference).to_owned();
                let c = match name.as_str() {
                    "lt" => '<',
                    "gt" => '>',
                    "amp" => '&',
                    other => panic!("{other}"),
                };
                elements.get_mut(&open[1]).unwrap().push(c);
            }
            Event::Comment(text) => comments.push_str(&text),
            Event::Text(text) => assert!(text.trim().is_empty()),
            Event::Eof => break,
            other => panic!("{other:?}"),
        }
    }
    assert!(open.is_empty());
    Plugin { root, elements, comments }
}

impl Plugin {
    fn number(&self, name: &str) -> f64 {
        self.elements.get(name).map_or(0.0, |text| text.parse().unwrap())
    }
}

/// `Hydrodynamics.cc` of gz-sim in surge, sway and yaw without added mass and Coriolis forces.
fn gazebo(plugin: &Plugin, nu: [f64; 3]) -> [f64; 3] {
    const ROW: [&str; 3] = ["x", "y", "n"];
    const COLUMN: [&str; 3] = ["U", "V", "R"];
    let mut force = [0.0; 3];
    for i in 0..3 {
        for j in 0..3 {
            let (row, column) = (ROW[i], COLUMN[j]);
            force[i] += plugin.number(&format!("{row}{column}")) * nu[j];
            for k in 0..3 {
                let other = COLUMN[k];
                force[i] += plugin.number(&format!("{row}{column}{other}")) * nu[j] * nu[k];
                force[i] += plugin.number(&format!("{row}{column}abs{other}")) * nu[j] * nu[k].abs();
            }
        }
    }
    force
}

/// The link: mass, centre of gravity, yaw inertia about it, added mass `xx`, `yy`, `yr`, `rr`.
struct Link([f64; 7]);

impl Link {
    fn of(text: &str) -> Self {
        let plain = text.replace("<inertia>", "").replace("</inertia>", "");
        let plain = plain.replace("<fluid_added_mass>", "").replace("</fluid_added_mass>", "");
        let parsed = parse(&plain);
        assert_eq!(parsed.root, "inertial");
        let pose: Vec<f64> =
            parsed.elements["pose"].split(' ').map(|number| number.parse().unwrap()).collect();
        assert_eq!(pose[1..], [0.0; 5]);
        let [mass, izz] = ["mass", "izz"].map(|name| parsed.number(name));
        let [xx, yy, yr, rr] = ["xx", "yy", "yr", "rr"].map(|name| parsed.number(name));
        Self([mass, pose[0], izz, xx, yy, yr, rr])
    }

    /// What DART has on the left: `M nu_dot + C(nu) nu` of a rigid body with an added mass.
    fn left(&self, nu: [f64; 3], nu_dot: [f64; 3]) -> ([f64; 3], f64) {
        let Self([m, x_g, izz, xx, yy, yr, rr]) = *self;
        let [m11, m22, m23, m33] = [m + xx, m + yy, m * x_g + yr, izz + m * x_g * x_g + rr];
        let ([u, v, r], [du, dv, dr]) = (nu, nu_dot);
        let parts = [
            [m11 * du, 0.0, -(m22 * v + m23 * r) * r],
            [m22 * dv, m23 * dr, m11 * u * r],
            [m23 * dv, m33 * dr, (m22 - m11) * u * v + m23 * u * r],
        ];
        (parts.map(|row| row.iter().sum()), parts.as_flattened().iter().map(|part| part.abs()).sum())
    }
}

#[test]
fn the_plugin_of_gazebo_moves_a_hull_as_its_equations_do() {
    for name in VESSELS {
        let mut file = vessel(name);
        file.craft.hull.cross_flow = 0.0;
        let files = sdf(&model(&file), &options(), &CoefficientOptions::default()).unwrap();
        let plugin = parse(&content(&files, "boat_gz.sdf"));
        assert!(plugin.root.contains("name=\"gz::sim::systems::Hydrodynamics\""));
        for (key, value) in
            [("disable_coriolis", "true"), ("disable_added_mass", "true"), ("link_name", "base_link")]
        {
            assert_eq!(plugin.elements[key], value);
        }
        let link = Link::of(&content(&files, "boat_inertial.sdf"));
        let mut hull = file.craft.clone();
        hull.rudders.clear();
        let dynamics = Dynamics::new(&hull);
        for nu in motions() {
            // Forward, port, up.
            let [du, dv, dr] = dynamics.acceleration(nu, &vec![0.0; dynamics.servos()]);
            let (left, scale) = link.left([nu[0], -nu[1], -nu[2]], [du, -dv, -dr]);
            let force = gazebo(&plugin, [nu[0], -nu[1], -nu[2]]);
            assert!(
                (0..3).all(|i| near(left[i], force[i], 10.0 * scale)),
                "{name} {nu:?}: {left:?} {force:?}"
            );
        }
    }
}

#[test]
fn a_vessel_without_the_munk_moment_has_its_negative_in_the_plugin() {
    let params = Craft { flying: None, ..Craft::hydrofoil() };
    let model = Model::of_vessel(&params, 0.1).unwrap();
    let files = sdf(&model, &options(), &CoefficientOptions::default()).unwrap();
    let plugin = parse(&content(&files, "boat_gz.sdf"));
    let link = Link::of(&content(&files, "boat_inertial.sdf"));
    let plant = Dynamics::new(&params);
    for nu in motions() {
        let [du, dv, dr] = plant.acceleration(nu, &[0.0, 0.0]);
        let (left, scale) = link.left([nu[0], -nu[1], -nu[2]], [du, -dv, -dr]);
        let force = gazebo(&plugin, [nu[0], -nu[1], -nu[2]]);
        assert!((0..3).all(|i| near(left[i], force[i], 10.0 * scale)), "{nu:?}: {left:?} {force:?}");
    }
    assert!(plugin.comments.contains("u sin(RD)"));
}

/// `SimpleHydrodynamics.cc` of VRX: the diagonal in pure surge, sway and yaw.
#[test]
fn the_plugin_of_vrx_has_the_resistance_of_pure_motions_and_names_the_rest() {
    for name in VESSELS {
        let file = vessel(name);
        let model = model(&file);
        let files = sdf(&model, &options(), &CoefficientOptions::default()).unwrap();
        let plugin = parse(&content(&files, "boat_vrx.sdf"));
        assert!(plugin.root.contains("vrx::SimpleHydrodynamics"));
        let dynamics = Dynamics::new(&file.craft);
        let hull = &file.craft.hull;
        for zero in ["xDotU", "yDotV", "nDotR"] {
            assert_eq!(plugin.elements[zero], "0.0");
        }
        let link = Link::of(&content(&files, "boat_inertial.sdf"));
        assert_eq!(link.0[3..], [-hull.x_udot, -hull.y_vdot, 0.0 - hull.y_rdot, -hull.n_rdot]);
        for (i, [linear, quadratic]) in [["xU", "xUU"], ["yV", "yVV"], ["nR", "nRR"]].into_iter().enumerate()
        {
            for speed in [-0.6, 0.4] {
                let mut nu = [0.0; 3];
                nu[i] = speed;
                let drag = dynamics.damping(nu)[i];
                let found = (plugin.number(linear) + plugin.number(quadratic) * speed.abs()) * speed;
                assert!(near(found, drag, drag), "{name} {linear}: {found} {drag}");
            }
        }
        assert!(plugin.number("max_effort") >= 1e300);
        let coefficients = Coefficients::of(&model, &CoefficientOptions::default(), "sdf").unwrap();
        for derivative in coefficients.beside_added_mass() {
            let words = format!("{} = ", derivative.symbol(&[]));
            assert!(plugin.comments.contains(&words), "{name}: {words}");
        }
        for thruster in &file.craft.thrusters {
            assert!(plugin.comments.contains(&format!("thruster {} at", thruster.name)));
        }
    }
}

/// A vessel that is symmetric to port and starboard has no coefficient that changes between the frames.
#[test]
fn coefficients_of_asymmetric_hulls_change_their_sign() {
    let file = vessel("tests/golden/workboat");
    let files = sdf(&model(&file), &options(), &CoefficientOptions::default()).unwrap();
    let plugin = parse(&content(&files, "boat_gz.sdf"));
    let hull = &file.craft.hull;
    assert_eq!(plugin.number("xV"), hull.linear[0][1], "X_v = -10 in the frame forward, starboard, down");
    assert_eq!(plugin.number("yU"), hull.linear[1][0]);
    assert_eq!(plugin.number("xU"), -hull.linear[0][0]);
    assert_eq!(plugin.number("yR"), -hull.linear[1][2]);
    assert_eq!(plugin.number("xRabsR"), hull.quadratic[0][2]);
    assert_eq!(plugin.number("nVabsU"), -hull.lift[1][0]);
}
