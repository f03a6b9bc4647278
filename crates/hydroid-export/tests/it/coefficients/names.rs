//! Names from hostile logs. `tests/export/coefficients` parses the files with the parsers of Python, LaTeX and Octave.

use hydroid::craft::CraftFile;
use hydroid_export::coefficients::{CoefficientOptions, latex, mss, sdf};
use proptest::prelude::*;

use super::gazebo::parse;
use super::{content, model, options, vessel};

/// The workboat with names, or nothing if a vessel cannot have them.
fn named(names: &[String]) -> Option<CraftFile> {
    let mut file = vessel("tests/golden/workboat");
    let mut names = names.iter().cycle().enumerate().map(|(k, name)| format!("{name}{k}"));
    let mut next = || names.next().unwrap_or_default();
    file.craft.name = next();
    file.craft.commands.iter_mut().for_each(|command| {
        command.name = next();
        command.unit = next();
    });
    file.craft.thrusters.iter_mut().for_each(|thruster| thruster.name = next());
    file.craft.rudders.iter_mut().for_each(|rudder| rudder.name = next());
    file.ties.clear();
    file.craft.validate().is_ok().then_some(file)
}

/// What a file contains beside the names: its lines, and the number of each character that has a meaning in its language.
fn skeleton(text: &str, meaning: &str) -> (usize, Vec<usize>) {
    let count = |c: char| text.chars().filter(|other| *other == c).count();
    (text.lines().count(), meaning.chars().map(count).collect())
}

const HOSTILE: &str = "([ -~\\n\\r\\t\u{0}\u{85}\u{2028}\u{202e}äψ\"'\\\\{}$&#%^~_<>*/-]|-->|---|\"\"\"|''|\\\\end\\{tabular\\}|%\\{\\n|@CLASS@){0,16}";

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn names_do_not_break_out(names in prop::collection::vec(HOSTILE, 1..8), link in HOSTILE, own in HOSTILE) {
        let Some(file) = named(&names) else { return Ok(()) };
        let model = model(&file);
        let benign = super::model(&named(&[String::from("a")]).unwrap());
        let with_link = CoefficientOptions { link: link.clone(), speed: Some(1.0), ..CoefficientOptions::default() };
        let files = sdf(&model, &options(), &with_link).unwrap();
        let expected = sdf(&benign, &options(), &CoefficientOptions::default()).unwrap();
        let count = |files| content(files, "boat_inertial.sdf").matches("<!--").count();
        prop_assert_eq!(count(&files), count(&expected));
        prop_assert_eq!(content(&files, "boat_inertial.sdf").matches("--").count(), 2 * count(&expected));
        for name in ["boat_gz.sdf", "boat_vrx.sdf"] {
            let (plugin, expected) = (parse(&content(&files, name)), parse(&content(&expected, name)));
            prop_assert_eq!(&plugin.root, &expected.root);
            prop_assert_eq!(plugin.elements.len(), expected.elements.len());
            for (key, value) in &expected.elements {
                if key != "link_name" {
                    prop_assert_eq!(value, &plugin.elements[key]);
                }
            }
            // A parser of XML makes line breaks equal; ours are spaces.
            let safe: String = link.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            prop_assert_eq!(&plugin.elements["link_name"], &safe);
        }
        for (files, expected, extension, meaning) in [
            (mss(&model, &options()), mss(&benign, &options()), "py", "\"'\\{}"),
            (mss(&model, &options()), mss(&benign, &options()), "m", "\"'{}"),
            (latex(&model, &options(), &with_link), latex(&benign, &options(), &with_link), "tex", "$"),
        ] {
            let name = format!("boat.{extension}");
            let (text, expected) = (content(&files.unwrap(), &name), content(&expected.unwrap(), &name));
            prop_assert!(extension == "tex" || text.is_ascii());
            if extension == "tex" {
                let dollars = |text: &str| text.replace("\\$", "").matches('$').count();
                let unmasked = text.replace("\\ensuremath{", "");
                prop_assert_eq!(dollars(&unmasked), dollars(&expected));
                prop_assert_eq!(text.lines().count(), expected.lines().count());
            } else {
                prop_assert_eq!(skeleton(&text, meaning), skeleton(&expected, meaning));
            }
        }
        for file in mss(&model, &hydroid_export::Options { name: own }).unwrap() {
            let (stem, _) = file.name.rsplit_once('.').unwrap();
            prop_assert!(stem.starts_with(|c: char| c.is_ascii_alphabetic()));
            prop_assert!(stem.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
        }
    }
}

#[test]
fn a_vessel_with_the_name_of_a_function_has_another_class() {
    let model = model(&vessel("vessels/otter"));
    for (name, file) in
        [("sin", "sin_vessel.m"), ("np", "np_vessel.py"), ("None", "None_vessel.py"), ("End", "End_vessel.m")]
    {
        let options = hydroid_export::Options { name: String::from(name) };
        let files = mss(&model, &options).unwrap();
        content(&files, file);
    }
}

/// Every name that a template defines for its whole file is one that a class or a function cannot have.
#[test]
fn names_of_the_templates_are_taken() {
    let python = [
        include_str!("../../../src/coefficients/templates/vessel.py"),
        include_str!("../../../src/coefficients/templates/equations.py"),
    ];
    let matlab = include_str!("../../../src/coefficients/templates/vessel.m");
    let word = |text: &str| -> String {
        text.trim_start().chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect()
    };
    let mut names = Vec::new();
    for line in python.iter().flat_map(|text| text.lines()) {
        if let Some(name) = line.strip_prefix("def ") {
            names.push(word(name));
        } else if line.starts_with(|c: char| c.is_ascii_uppercase()) && line.contains(" = @") {
            let left = line.split(" = ").next().unwrap();
            names.extend(left.split(", ").map(word));
        }
    }
    names.extend(
        matlab
            .lines()
            .skip(1)
            .filter_map(|line| Some(word(line.strip_prefix("function ")?.split("= ").nth(1)?))),
    );
    // Identifiers do not begin with an underscore.
    names.retain(|name| !name.starts_with('_'));
    assert!(names.len() > 25, "{names:?}");
    let model = model(&vessel("vessels/otter"));
    for name in names {
        let options = hydroid_export::Options { name: name.clone() };
        let files = mss(&model, &options).unwrap();
        assert!(files.iter().all(|file| file.name.starts_with(&format!("{name}_vessel."))), "{name}");
    }
}
