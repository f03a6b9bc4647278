//! Description of a model in the metadata of its files (`metadata_props`): texts, of which the lists are JSON.

use hydroid::model::{Model, Port};
use serde_json::{Value, json};

use super::proto::Property;
use crate::Precision;
use crate::state_space::StateSpace;

fn channels(ports: &[Port]) -> Value {
    let range = |range: hydroid::evaluate::DesignRange| json!([range.low, range.high]);
    let of = |port: &Port| {
        json!({
            "name": port.channel.name,
            "unit": port.channel.unit,
            "range": range(port.range),
            "training_range": range(port.training_range.unwrap_or(port.range)),
        })
    };
    ports.iter().map(of).collect()
}

/// The properties of a file with a function of a model.
pub(super) fn properties(
    model: &Model,
    space: &StateSpace,
    precision: Precision,
    function: &str,
) -> Vec<Property> {
    let d = &model.description;
    let state: Value =
        space.state.iter().map(|label| json!({ "name": label.name, "unit": label.unit })).collect();
    let precision = match precision {
        Precision::Double => "double",
        Precision::Float => "float",
    };
    let mut pairs = vec![
        ("hydroid.function", function.to_owned()),
        ("hydroid.model", d.name.clone()),
        ("hydroid.kind", model.kind().to_owned()),
        ("hydroid.version", d.provenance.hydroid.clone()),
        ("hydroid.precision", precision.to_owned()),
        ("hydroid.sample_time_s", format!("{:?}", d.dt)),
        ("hydroid.outputs", channels(&d.outputs).to_string()),
        ("hydroid.inputs", channels(&d.inputs).to_string()),
        ("hydroid.state", state.to_string()),
        ("hydroid.training", json!(d.provenance.training).to_string()),
        ("hydroid.relative_to_water", d.current.is_some().to_string()),
    ];
    if let Some(block) = &space.block {
        pairs.push(("hydroid.horizon", block.horizon.to_string()));
    }
    pairs.into_iter().map(|(key, value)| Property { key: Some(key.to_owned()), value: Some(value) }).collect()
}
