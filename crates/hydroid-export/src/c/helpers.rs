//! Functions that the code of a model calls.

use super::number::Precision;
use crate::graph::{Op, Unary};
use crate::state_space::StateSpace;

/// The functions that the code of a model calls.
pub(super) fn needed(name: &str, precision: Precision, space: &StateSpace, functions: &[usize]) -> String {
    let uses = |test: &dyn Fn(&Op) -> bool| {
        let mut nodes = functions.iter().flat_map(|&index| &space.function(index).nodes);
        nodes.any(|node| test(&node.op))
    };
    let gru = uses(&|op| matches!(op, Op::Gru { .. }));
    let lstm = uses(&|op| matches!(op, Op::Lstm { .. }));
    let of = |f: Unary| uses(&|op| matches!(op, Op::Unary(of, _) if *of == f));
    let logistic = gru || lstm || of(Unary::Logistic);
    let tanh = gru || lstm || of(Unary::Tanh);
    // `exp`, the logistic function and `tanh` have no branches, as in hydroid, so that compilers vectorize loops over them.
    let (exp, normal, end) = match precision {
        Precision::Double => (include_str!("helpers/exp_double.c"), 708.0, 20.0),
        Precision::Float => (include_str!("helpers/exp_float.c"), 87.0, 10.0),
    };
    let helpers = [
        (of(Unary::Sign), include_str!("helpers/sign.c")),
        (logistic || tanh, exp),
        (logistic, include_str!("helpers/logistic.c")),
        (tanh, include_str!("helpers/tanh.c")),
        (gru || lstm || uses(&|op| matches!(op, Op::Affine { .. })), include_str!("helpers/affine.c")),
        (uses(&|op| matches!(op, Op::Product { .. })), include_str!("helpers/product.c")),
        (
            uses(&|op| matches!(op, Op::TransposedProduct { .. })),
            include_str!("helpers/transposed_product.c"),
        ),
        (uses(&|op| matches!(op, Op::Outer { .. })), include_str!("helpers/outer.c")),
        (gru, include_str!("helpers/gru.c")),
        (lstm, include_str!("helpers/lstm.c")),
        (uses(&|op| matches!(op, Op::Median { .. })), include_str!("helpers/median.c")),
    ];
    let mut text = String::new();
    for (_, helper) in helpers.into_iter().filter(|(needed, _)| *needed) {
        let code = helper
            .replace("FABS", if precision == Precision::Float { "fabsf" } else { "fabs" })
            .replace("NORMAL", &precision.literal(normal))
            .replace("END", &precision.literal(end))
            .replace("REAL", precision.type_name())
            .replace("NAME", name);
        text.push_str(&code);
        text.push('\n');
    }
    text
}
