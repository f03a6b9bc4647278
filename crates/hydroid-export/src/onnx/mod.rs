//! ONNX: a file for each function of a model.
//!
//! ```text
//! NAME_start.onnx     (outputs [n], command [m])         -> state [s]
//! NAME_step.onnx      (state [s], command [m])           -> next_state [s], outputs [n]
//! NAME_observe.onnx   (state [s], outputs [n])           -> next_state [s]
//! NAME_rollout.onnx   (state [s], commands [samples, m]) -> outputs [samples, n], last_state [s]
//! NAME_rates.onnx     (state [s], command [m])           -> rates [s]    of a model in continuous time
//! ```
//!
//! The functions of the [graph](crate::graph) are functions of the file (`FunctionProto`), so that a network or an equation
//! that is called several times is stored once. Rollouts are the operator `Scan`, repetitions inside a sample `Loop`.
//! Source: ONNX 1.12, <https://onnx.ai/onnx/repo-docs/IR.html> and <https://onnx.ai/onnx/operators/>.

mod function;
mod graphs;
mod metadata;
mod network;
mod nodes;
mod proto;
mod sums;

use hydroid::model::Model;
use prost::Message as _;

use crate::name::{comment, identifier};
use crate::state_space::StateSpace;
use crate::{File, Options, Precision};

/// Writes a model as ONNX files.
pub(crate) fn export(model: &Model, options: &Options, precision: Precision) -> Vec<File> {
    let space = StateSpace::of(model);
    let name = identifier(&options.name);
    let of = graphs::Graphs::new(model, &space, precision);
    let mut graphs = vec![of.start(), of.step(), of.observe(), of.rollout()];
    graphs.extend(space.rates.map(|rates| of.rates(rates)));
    graphs
        .into_iter()
        .map(|graph| {
            let functions = space.needed(&graph.roots).into_iter();
            let written = proto::Model {
                ir_version: Some(proto::IR_VERSION),
                producer_name: Some(String::from("hydroid")),
                producer_version: Some(String::from(env!("CARGO_PKG_VERSION"))),
                doc_string: Some(format!(
                    "{} '{}': {}",
                    comment(model.title()),
                    comment(&model.description.name),
                    graph.about
                )),
                graph: Some(graph.graph),
                opset_import: function::operator_sets(),
                metadata_props: metadata::properties(model, &space, precision, graph.name),
                functions: functions
                    .map(|index| function::written(&space.module, index, precision))
                    .collect(),
            };
            File { name: format!("{name}_{}.onnx", graph.name), content: written.encode_to_vec() }
        })
        .collect()
}
