//! `modelDescription.xml`.

use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event};
use quick_xml::writer::Writer;

use super::units::{base, clean};
use super::variables::{Role, Variable, Variables};
use super::{Version, identity};

/// What the description states beside the variables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head<'a> {
    pub(super) version: Version,
    pub(super) name: &'a str,
    pub(super) title: &'a str,
    pub(super) token: u64,
    pub(super) dt: f64,
}

/// A document that is built up.
struct Document {
    writer: Writer<Vec<u8>>,
}

type Attributes<'a> = Vec<(&'a str, String)>;

impl Document {
    fn put(&mut self, event: Event<'_>) {
        // Writing to a vector cannot fail.
        let _ = self.writer.write_event(event);
    }

    fn start<'a>(name: &'a str, attributes: &Attributes<'_>) -> BytesStart<'a> {
        let mut start = BytesStart::new(name);
        for (key, value) in attributes {
            start.push_attribute((*key, clean(value).as_str()));
        }
        start
    }

    fn open(&mut self, name: &str, attributes: &Attributes<'_>) {
        self.put(Event::Start(Self::start(name, attributes)));
    }

    fn empty(&mut self, name: &str, attributes: &Attributes<'_>) {
        self.put(Event::Empty(Self::start(name, attributes)));
    }

    fn close(&mut self, name: &str) {
        self.put(Event::End(BytesEnd::new(name)));
    }
}

/// The description of an FMU.
pub(super) fn describe(head: Head<'_>, variables: &Variables) -> Vec<u8> {
    let mut document = Document { writer: Writer::new_with_indent(Vec::new(), b' ', 2) };
    document.put(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
    let (version, token) = match head.version {
        Version::V2 => ("2.0", "guid"),
        Version::V3 => ("3.0", "instantiationToken"),
    };
    let mut root = vec![
        ("fmiVersion", version.to_owned()),
        ("modelName", head.name.to_owned()),
        (token, identity(head.token)),
        ("description", head.title.to_owned()),
        ("generationTool", format!("hydroid {}", env!("CARGO_PKG_VERSION"))),
        ("variableNamingConvention", String::from("flat")),
    ];
    if head.version == Version::V2 {
        root.push(("numberOfEventIndicators", String::from("0")));
    }
    document.open("fmiModelDescription", &root);
    interfaces(&mut document, head, variables.continuous().is_ok());
    units(&mut document, variables);
    document.open("LogCategories", &vec![]);
    document.empty("Category", &vec![("name", String::from("logStatusError"))]);
    document.close("LogCategories");
    document
        .empty("DefaultExperiment", &vec![("startTime", String::from("0")), ("stepSize", number(head.dt))]);
    document.open("ModelVariables", &vec![]);
    for (index, variable) in variables.all().iter().enumerate() {
        match head.version {
            Version::V2 => scalar_variable(&mut document, index, variable, variables),
            Version::V3 => float64(&mut document, index, variable, variables),
        }
    }
    document.close("ModelVariables");
    structure(&mut document, head.version, variables);
    document.close("fmiModelDescription");
    document.writer.into_inner()
}

/// A number that is read back to the last bit.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn interfaces(document: &mut Document, head: Head<'_>, exchange: bool) {
    let yes = || String::from("true");
    let (state, derivatives) = match head.version {
        Version::V2 => (["canGetAndSetFMUstate", "canSerializeFMUstate"], "providesDirectionalDerivative"),
        Version::V3 => (["canGetAndSetFMUState", "canSerializeFMUState"], "providesDirectionalDerivatives"),
    };
    let common = || {
        let mut attributes = vec![("modelIdentifier", head.name.to_owned())];
        attributes.extend(state.map(|key| (key, yes())));
        attributes
    };
    if exchange {
        let mut attributes = common();
        attributes.push((derivatives, yes()));
        if head.version == Version::V2 {
            attributes.push(("completedIntegratorStepNotNeeded", yes()));
        }
        document.empty("ModelExchange", &attributes);
    }
    let mut attributes = common();
    attributes.push(("canHandleVariableCommunicationStepSize", yes()));
    document.empty("CoSimulation", &attributes);
}

fn units(document: &mut Document, variables: &Variables) {
    let mut names: Vec<String> =
        variables.all().iter().filter(|v| !v.unit.is_empty()).map(|v| clean(&v.unit)).collect();
    names.sort();
    names.dedup();
    document.open("UnitDefinitions", &vec![]);
    for name in names {
        let attributes = vec![("name", name.clone())];
        match base(&name) {
            None => document.empty("Unit", &attributes),
            Some(exponents) => {
                document.open("Unit", &attributes);
                let exponents = exponents.iter().map(|(key, exponent)| (*key, exponent.to_string()));
                document.empty("BaseUnit", &exponents.collect());
                document.close("Unit");
            }
        }
    }
    document.close("UnitDefinitions");
}

/// Causality, variability and kind of the start value.
fn traits(role: Role) -> (&'static str, &'static str, Option<&'static str>) {
    match role {
        Role::Time => ("independent", "continuous", None),
        Role::Input(_) => ("input", "continuous", None),
        Role::Output(_) | Role::Pose(_) => ("output", "continuous", Some("calculated")),
        Role::Hidden(_) | Role::Derivative(_) => ("local", "continuous", Some("calculated")),
        Role::StartOutput(_) | Role::StartInput(_) | Role::StartPose(_) | Role::Current(_) => {
            ("parameter", "fixed", Some("exact"))
        }
    }
}

/// Whether a variable is a state of model exchange.
fn is_state(role: Role, variables: &Variables) -> bool {
    variables.continuous().is_ok() && matches!(role, Role::Output(_) | Role::Hidden(_) | Role::Pose(_))
}

fn general<'a>(index: usize, variable: &Variable) -> Attributes<'a> {
    let (causality, variability, initial) = traits(variable.role);
    let mut attributes = vec![
        ("name", variable.name.clone()),
        ("valueReference", index.to_string()),
        ("description", variable.description.clone()),
        ("causality", causality.to_owned()),
        ("variability", variability.to_owned()),
    ];
    attributes.extend(initial.map(|initial| ("initial", initial.to_owned())));
    attributes
}

/// Attributes of the type; `offset` is added to the reference of a state.
fn real<'a>(variable: &Variable, variables: &Variables, offset: usize) -> Attributes<'a> {
    let mut attributes = Vec::new();
    if !variable.unit.is_empty() {
        attributes.push(("unit", variable.unit.clone()));
    }
    if is_state(variable.role, variables) {
        attributes.push(("nominal", number(variable.nominal)));
    }
    attributes.extend(variable.start.map(|start| ("start", number(start))));
    if let Role::Derivative(state) = variable.role
        && let Some(of) = variables.reference(variables.state(state))
    {
        attributes.push(("derivative", (of + offset).to_string()));
    }
    attributes
}

fn scalar_variable(document: &mut Document, index: usize, variable: &Variable, variables: &Variables) {
    document.open("ScalarVariable", &general(index, variable));
    document.empty("Real", &real(variable, variables, 1));
    document.close("ScalarVariable");
}

fn float64(document: &mut Document, index: usize, variable: &Variable, variables: &Variables) {
    let mut attributes = general(index, variable);
    attributes.extend(real(variable, variables, 0));
    document.empty("Float64", &attributes);
}

fn structure(document: &mut Document, version: Version, variables: &Variables) {
    let of = |accept: &dyn Fn(Role) -> bool| -> Vec<usize> {
        let all = variables.all().iter().enumerate();
        all.filter(|(_, variable)| accept(variable.role)).map(|(index, _)| index).collect()
    };
    let outputs = of(&|role| matches!(role, Role::Output(_) | Role::Pose(_)));
    let derivatives = of(&|role| matches!(role, Role::Derivative(_)));
    let unknowns = of(&|role| traits(role).2 == Some("calculated"));
    // Outputs of model exchange are states; those of co-simulation change in a step only.
    let own = |index: usize, offset: usize| match variables.continuous() {
        Ok(_) => (index + offset).to_string(),
        Err(_) => String::new(),
    };
    document.open("ModelStructure", &vec![]);
    if version == Version::V3 {
        let reference = |index: usize| ("valueReference", index.to_string());
        for index in &outputs {
            document.empty("Output", &vec![reference(*index), ("dependencies", own(*index, 0))]);
        }
        for index in &derivatives {
            document.empty("ContinuousStateDerivative", &vec![reference(*index)]);
        }
        for index in &unknowns {
            document.empty("InitialUnknown", &vec![reference(*index)]);
        }
    } else {
        let mut list = |name: &str, indices: &[usize], depends: bool| {
            if indices.is_empty() {
                return;
            }
            document.open(name, &vec![]);
            for index in indices {
                let mut attributes = vec![("index", (index + 1).to_string())];
                if depends {
                    attributes.push(("dependencies", own(*index, 1)));
                }
                document.empty("Unknown", &attributes);
            }
            document.close(name);
        };
        list("Outputs", &outputs, true);
        list("Derivatives", &derivatives, false);
        list("InitialUnknowns", &unknowns, false);
    }
    document.close("ModelStructure");
}
