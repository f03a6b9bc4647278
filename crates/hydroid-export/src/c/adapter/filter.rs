//! The extended Kalman filter over hidden state and weights of a recurrent network, in C.

use super::{Code, Fields, Learning, Precision};
use crate::adapter::NetworkLearner;
use crate::state_space::recurrent::Outputs;

/// The filter.
const FILTER: &str = include_str!("filter.c");

/// Huber's loss.
const HUBER: &str = "        deviations = WORD_ABS(e[measured[i]]) / WORD_SQRT(l[i * UPPER_OUTPUTS + i]);
        if (deviations > WORD_LIMIT) {
            /* Huber's loss: more noise, so that the innovation has the weight limit / deviations. */
            l[i * UPPER_OUTPUTS + i] *= deviations / WORD_LIMIT;
        }
";

const LEAK: &str = "    for (i = 0; i < UPPER_WEIGHTS && adapter->frozen == 0U; ++i) {
        REAL *const weight = s + UPPER_HIDDEN + i;
        *weight = NAME_exported[i] + WORD_KEPT * (*weight - NAME_exported[i]);
    }
";

/// Outputs that follow from the hidden state.
const OF_HIDDEN: &str = include_str!("filter_of_hidden.c");

/// Outputs that the step reads.
const READ: &str = include_str!("filter_read.c");

/// The step of a network that reads the outputs.
const STEP_WITH_FEEDBACK: &str = include_str!("filter_step_with_feedback.c");

/// The step of a network whose base alone reads the outputs.
const STEP_WITHOUT_FEEDBACK: &str = include_str!("filter_step_without_feedback.c");

const LIMITED: &str = "    REAL positions[UPPER_INPUTS];
    F_LIMIT(state->x, command, positions);
";

const POSITIONS: &str = "    for (i = 0; i < UPPER_INPUTS; ++i) {
        state->x[i] = command[i];
    }
";

pub(super) fn code(of: &Learning<'_>, learner: &NetworkLearner) -> Code {
    let NetworkLearner { options, network, .. } = learner;
    let (hidden, weights, outputs) = (learner.hidden(), network.weights.len(), network.network.outputs);
    let estimates = hidden + weights;
    let (kept, leaks) = (1.0 - options.leak, options.leak > 0.0);
    let forgetting = if options.forgetting < 1.0 {
        format!(
            " * A sample has {:?} times the weight of the next one (forgetting factor).\n",
            options.forgetting
        )
    } else {
        String::new()
    };
    let about = format!(
        " * An extended Kalman filter of hidden state h ({hidden}) and weights theta ({weights}) of the network, in its scaled units:
 *     h+ = f(h, x, theta) + noise        theta+ = theta_0 + {kept:?} (theta - theta_0) + noise
 *     z  = g(h, theta) + noise
 * z are the measured outputs less the prediction of the base, divided by their scale; theta_0 are the exported weights. h
 * stands in front of theta in the state. A run starts with h = 0 and its variance, not with the settled h of NAME_init. A
 * divergence starts the estimation again with the present theta: UPPER_REJECTED, as for an infinite value, which counts as
 * missing.
{forgetting}"
    );
    let widest = hidden.max(outputs);
    let mut fields = Fields::default();
    let triangle = estimates * (estimates + 1) / 2;
    fields.reals("p", triangle, "covariance of h and theta: lower triangle, row by row");
    fields.reals("base", outputs, "outputs of the present by the base alone");
    fields.reals("jacobian", estimates * widest, "work: derivatives by h and theta, transposed");
    fields.reals("product", estimates * widest, "work: covariance times derivatives");
    fields.counter("stepped", "1: a step since the last measurement");

    let mut tables = vec![
        of.table("NAME_initial_variance", &options.initial_weights),
        of.table("NAME_weight_noise", &options.weight_noise),
        of.table("NAME_noise", &options.noise),
        of.table("NAME_correction_scale", &network.scaling.correction_scale),
    ];
    if leaks {
        tables.push(of.table("NAME_exported", &network.weights));
    }
    let source = [FILTER, run(learner).as_str()].concat();
    let (x, command) = match of.adapter.limit {
        Some(_) => ("(state->x + UPPER_POSITIONS)", "positions"),
        None => ("state->x", "command"),
    };
    let limited = of.adapter.limit.is_some();
    let when = |condition: bool, text: &'static str| String::from(if condition { text } else { "" });
    let huber = options.huber < f64::INFINITY;
    let suffix = if of.precision == Precision::Float { "f" } else { "" };
    let number = |value: f64| of.number(value);
    // Text first: it contains other words.
    let mut words = vec![
        ("WORD_TABLES", tables.concat()),
        ("WORD_LEAK", when(leaks, LEAK)),
        ("WORD_HUBER", when(huber, HUBER)),
        ("WORD_DEVIATIONS", when(huber, "    REAL deviations;\n")),
        ("WORD_LIMITED", when(limited, LIMITED)),
        ("WORD_POSITIONS", when(limited, POSITIONS)),
        ("WORD_HIDDEN", hidden.to_string()),
        ("WORD_FIRST", (of.adapter.first_weight() - hidden).to_string()),
        ("WORD_INPUTS", network.network.inputs.to_string()),
        ("WORD_BEHIND", of.adapter.behind_positions().to_string()),
        ("WORD_INITIAL_STATE", number(options.initial_state)),
        ("WORD_STATE_NOISE", number(options.state_noise)),
        ("WORD_GROWTH", number(kept / options.forgetting.sqrt())),
        ("WORD_KEPT", number(kept)),
        ("WORD_LIMIT", number(options.huber)),
        ("WORD_SQRT", format!("sqrt{suffix}")),
        ("WORD_ABS", format!("fabs{suffix}")),
        ("X_STATE", x.to_owned()),
        ("X_COMMAND", command.to_owned()),
    ];
    words.extend(functions(of, learner));
    let replace = |text: String, (word, with): &(&str, String)| text.replace(word, with);
    Code { about, types: String::new(), fields, source: words.iter().fold(source, replace) }
}

/// The functions `NAME_adapter_step` and `NAME_adapter_observe`.
fn run(learner: &NetworkLearner) -> String {
    let step = match learner.outputs {
        Outputs::OfHidden(_) => return OF_HIDDEN.to_owned(),
        Outputs::Read { .. } if learner.network.feedback => STEP_WITH_FEEDBACK,
        Outputs::Read { .. } => STEP_WITHOUT_FEEDBACK,
    };
    READ.replace("WORD_STEP", step)
}

/// Words for the functions of the graph.
fn functions(of: &Learning<'_>, learner: &NetworkLearner) -> Vec<(&'static str, String)> {
    let mut functions = vec![
        ("F_TRANSITION_JACOBIAN", learner.of_transition),
        ("F_OBSERVATION_JACOBIAN", learner.of_observation),
        ("F_OBSERVATION", learner.observation),
        ("F_INPUT", learner.input),
        ("F_BASE", learner.base),
    ];
    match learner.outputs {
        Outputs::OfHidden(shown) => functions.push(("F_SHOWN", shown)),
        Outputs::Read { wait } => functions.push(("F_WAIT", wait)),
    }
    functions.extend(of.adapter.limit.map(|limit| ("F_LIMIT", limit)));
    functions.into_iter().map(|(word, index)| (word, of.function(index))).collect()
}
