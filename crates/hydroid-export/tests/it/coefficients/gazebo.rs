//! The plugins of Gazebo, by the equations of their sources.

use std::collections::BTreeMap;

use hydroid_core::craft::Dynamics;
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
                    root = (*start).to_owned();
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

/// `Hydrodynamics.cc` of gz-sim in surge, sway and yaw without its Coriolis forces: added mass, and the force of the
/// velocities.
fn gazebo(plugin: &Plugin, nu: [f64; 3]) -> ([[f64; 3]; 3], [f64; 3]) {
    const ROW: [&str; 3] = ["x", "y", "n"];
    const COLUMN: [&str; 3] = ["U", "V", "R"];
    let (mut mass, mut force) = ([[0.0; 3]; 3], [0.0; 3]);
    for i in 0..3 {
        for j in 0..3 {
            let (row, column) = (ROW[i], COLUMN[j]);
            mass[i][j] = plugin.number(&format!("{row}Dot{column}"));
            force[i] += plugin.number(&format!("{row}{column}")) * nu[j];
            for k in 0..3 {
                let other = COLUMN[k];
                force[i] += plugin.number(&format!("{row}{column}{other}")) * nu[j] * nu[k];
                force[i] += plugin.number(&format!("{row}{column}abs{other}")) * nu[j] * nu[k].abs();
            }
        }
    }
    (mass, force)
}

#[test]
fn the_plugin_of_gazebo_moves_a_hull_as_its_equations_do() {
    for name in VESSELS {
        let mut file = vessel(name);
        file.craft.hull.cross_flow = 0.0;
        let files = sdf(&model(&file), &options(), &CoefficientOptions::default()).unwrap();
        let plugin = parse(&content(&files, "boat_gz.sdf"));
        assert!(plugin.root.contains("name=\"gz::sim::systems::Hydrodynamics\""));
        assert_eq!(plugin.elements["disable_coriolis"], "true");
        assert_eq!(plugin.elements["link_name"], "base_link");
        let mut hull = file.craft.clone();
        hull.rudders.clear();
        let dynamics = Dynamics::new(&hull);
        let (m, x_g, i_z) = (hull.hull.mass, hull.hull.x_g, hull.hull.i_z);
        for nu in motions() {
            // Forward, port, up.
            let flipped @ [u, v, r] = [nu[0], -nu[1], -nu[2]];
            let (added, force) = gazebo(&plugin, flipped);
            // The rigid body of the physics engine.
            let rigid = [[m, 0.0, 0.0], [0.0, m, m * x_g], [0.0, m * x_g, i_z]];
            let centripetal = [-m * (v * r + x_g * r * r), m * u * r, m * x_g * u * r];
            let [du, dv, dr] = dynamics.acceleration(nu, &vec![0.0; dynamics.servos()]);
            let nu_dot = [du, -dv, -dr];
            for i in 0..3 {
                let left: f64 = (0..3).map(|j| rigid[i][j] * nu_dot[j]).sum::<f64>() + centripetal[i];
                let right: f64 = (0..3).map(|j| added[i][j] * nu_dot[j]).sum::<f64>() + force[i];
                let scale: f64 =
                    (0..3).map(|j| (rigid[i][j] * nu_dot[j]).abs()).sum::<f64>() + centripetal[i].abs();
                assert!(
                    (left - right).abs() <= 1e-11 * (scale + force[i].abs()) + 1e-9,
                    "{name} {nu:?} {i}: {left} {right}"
                );
            }
        }
    }
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
        assert_eq!(
            [plugin.number("xDotU"), plugin.number("yDotV"), plugin.number("nDotR")],
            [-hull.x_udot, -hull.y_vdot, -hull.n_rdot]
        );
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
        for derivative in &coefficients.derivatives {
            let words = format!("{} = ", derivative.symbol());
            assert!(plugin.comments.contains(&words), "{name}: {words}");
        }
        assert_eq!(plugin.comments.contains("N_uv = "), hull.y_vdot != hull.x_udot, "{name}");
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
