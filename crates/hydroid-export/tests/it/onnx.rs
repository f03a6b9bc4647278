//! The files of ONNX: their bytes and their texts. Their predictions are compared in `tests/export/onnx`.

use hydroid::model::Model;
use hydroid_export::{File, Format, Options, Precision, export, identifier};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use prost::Message as _;
use serde_json::Value;

use crate::models::all;

/// A file as its parts, of which the graph and the functions stay bytes (`ModelProto` of `onnx.proto`).
#[derive(Clone, PartialEq, prost::Message)]
struct Parts {
    #[prost(string, tag = "6")]
    doc_string: String,
    #[prost(message, optional, tag = "7")]
    graph: Option<Graph>,
    #[prost(message, repeated, tag = "14")]
    metadata: Vec<Property>,
    #[prost(bytes = "vec", repeated, tag = "25")]
    functions: Vec<Vec<u8>>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Property {
    #[prost(string, tag = "1")]
    key: String,
    #[prost(string, tag = "2")]
    value: String,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Graph {
    #[prost(bytes = "vec", repeated, tag = "1")]
    nodes: Vec<Vec<u8>>,
    #[prost(message, repeated, tag = "11")]
    inputs: Vec<Put>,
    #[prost(message, repeated, tag = "12")]
    outputs: Vec<Put>,
}

/// An input or output (`ValueInfoProto`).
#[derive(Clone, PartialEq, prost::Message)]
struct Put {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(bytes = "vec", tag = "2")]
    of_type: Vec<u8>,
    #[prost(string, tag = "3")]
    about: String,
}

impl Parts {
    fn property(&self, key: &str) -> &str {
        let found = self.metadata.iter().find(|property| property.key == key);
        &found.unwrap_or_else(|| panic!("no {key}")).value
    }

    fn puts(&self) -> Vec<&Put> {
        self.graph.iter().flat_map(|graph| graph.inputs.iter().chain(&graph.outputs)).collect()
    }
}

fn written(model: &Model, name: &str) -> Vec<File> {
    let options = Options { name: name.to_owned() };
    export(model, &Format::Onnx(Precision::Double), &options).unwrap()
}

fn parts(file: &File) -> Parts {
    Parts::decode(file.content.as_slice()).unwrap()
}

#[test]
fn bytes_are_equal_in_every_run() {
    for model in all() {
        assert!(written(&model, "vessel") == written(&model, "vessel"), "{}", model.description.name);
    }
}

#[test]
fn a_model_in_continuous_time_has_rates() {
    for model in all() {
        let names: Vec<String> = written(&model, "a boat").into_iter().map(|file| file.name).collect();
        let mut expected =
            ["start", "step", "observe", "rollout"].map(|end| format!("a_boat_{end}.onnx")).to_vec();
        let limited = model.description.inputs.iter().any(|port| port.rate_limit.is_some());
        let continuous = ["craft", "control_affine"].contains(&model.kind())
            || model.description.name == "equations"
            || model.description.name == "equations with lags";
        if continuous && !limited {
            expected.push(String::from("a_boat_rates.onnx"));
        }
        assert_eq!(names, expected, "{}", model.description.name);
    }
}

/// Graphs and functions do not depend on the names; the metadata contain them as they are.
#[test]
fn hostile_names_do_not_leave_their_place() {
    let strategy = prop::collection::vec("\\PC{0,30}|\"\\}\\], \\[\\{\"|\\x00\\n\\r|</doc>&amp;|n1", 5);
    let mut runner =
        TestRunner::new(ProptestConfig { cases: 24, failure_persistence: None, ..Default::default() });
    let base = all().remove(1);
    let usual: Vec<Parts> = written(&base, "vessel").iter().map(parts).collect();
    let outcome = runner.run(&strategy, |names| {
        let mut model = base.clone();
        model.description.name.clone_from(&names[0]);
        model.description.provenance.training.clone_from(&names);
        let d = &mut model.description;
        for (port, name) in d.outputs.iter_mut().chain(&mut d.inputs).zip(&names) {
            port.channel.name.clone_from(name);
            port.channel.unit.clone_from(name);
        }
        for (file, usual) in written(&model, &names[1]).iter().zip(&usual) {
            let parts = parts(file);
            let end = usual.property("hydroid.function");
            prop_assert_eq!(&file.name, &format!("{}_{end}.onnx", identifier(&names[1])));
            prop_assert_eq!(&parts.functions, &usual.functions);
            prop_assert_eq!(&parts.graph.clone().unwrap().nodes, &usual.graph.clone().unwrap().nodes);
            for (put, usual) in parts.puts().into_iter().zip(usual.puts()) {
                prop_assert_eq!((&put.name, &put.of_type), (&usual.name, &usual.of_type));
                prop_assert!(put.about.chars().all(|c| c == ' ' || c.is_ascii_graphic()), "{}", put.about);
            }
            prop_assert!(parts.doc_string.chars().all(|c| c == ' ' || c.is_ascii_graphic()));
            prop_assert_eq!(parts.property("hydroid.model"), &names[0]);
            let json = |key: &str| serde_json::from_str::<Value>(parts.property(key)).unwrap();
            prop_assert_eq!(json("hydroid.training"), serde_json::to_value(&names).unwrap());
            let (outputs, inputs) = (json("hydroid.outputs"), json("hydroid.inputs"));
            let channels = outputs.as_array().unwrap().iter().chain(inputs.as_array().unwrap());
            for (channel, name) in channels.zip(&names) {
                prop_assert_eq!(&channel["name"], name);
                prop_assert_eq!(&channel["unit"], name);
            }
        }
        Ok(())
    });
    outcome.unwrap();
}
