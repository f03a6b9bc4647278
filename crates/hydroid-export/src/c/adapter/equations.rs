//! Equations that learn, in C.

use std::fmt::Write as _;

use hydroid_core::adapt::GroupConstants;

use super::least_squares::{self, NOISE};
use super::{Code, Fields, Learning};
use crate::adapter::EquationsLearner;

const ROWS: &str = include_str!("equations.c");

/// Statements of a group of equations with the same terms.
struct Group {
    tables: String,
    locals: String,
    predict: String,
    correct: String,
    forget: String,
}

fn group(of: &Learning<'_>, learner: &EquationsLearner, index: usize, group: &GroupConstants) -> Group {
    let (n, constants) = (group.terms.len(), &learner.constants);
    let scales: Vec<f64> = group.terms.iter().map(|&t| constants.scales[t]).collect();
    let (mut tables, forget) =
        least_squares::forget(of, &group.factor, &index.to_string(), &format!("adapter->?{index}"));
    tables.push_str(&of.table(&format!("NAME_scale_{index}"), &scales));
    tables.push_str(&Learning::indices(&format!("NAME_terms_{index}"), &group.terms));
    let mut locals =
        format!("    REAL row{index}[{n}];\n    REAL f{index}[{n}];\n    REAL gain{index}[{n}];\n");
    let mut predict = format!(
        "    for (i = 0; i < {n}; ++i) {{
        row{index}[i] = phi[NAME_terms_{index}[i]];
    }}
    leverage[{first}] = NAME_project(adapter->u{index}, adapter->d{index}, row{index}, f{index}, {n});\n",
        first = group.outputs[0],
    );
    let mut correct = format!(
        "    NAME_absorb(adapter->u{index}, adapter->d{index}, f{index}, gain{index}, (REAL)1 / (share * {weight}), {n});\n",
        weight = of.number(constants.weight)
    );
    for (&output, &first) in group.outputs.iter().zip(&group.firsts) {
        let at = format!("weights + {first}, ");
        if output != group.outputs[0] {
            let _ = writeln!(predict, "    leverage[{output}] = leverage[{}];", group.outputs[0]);
        }
        let _ = writeln!(
            predict,
            "    e[{output}] = z[{output}] - NAME_expected(row{index}, {at}NAME_scale_{index}, {n});"
        );
        let _ = writeln!(correct, "    NAME_correct({at}gain{index}, NAME_scale_{index}, e[{output}], {n});");
    }
    if constants.lambda < 1.0 {
        let restored = n as f64 * (1.0 - constants.lambda) * group.information;
        let _ = writeln!(
            correct,
            "    /* Data are forgotten, the prior is restored: one coefficient of each equation in turn. */
    turn = adapter->turn{index};
    adapter->turn{index} = (turn + 1U) % {n}U;
    for (i = 0; i < {n}; ++i) {{
        adapter->d{index}[i] *= {growth};
        f{index}[i] = (i > turn) ? adapter->u{index}[i * (i - 1) / 2 + turn] : (REAL)(i == turn);
    }}
    NAME_absorb(adapter->u{index}, adapter->d{index}, f{index}, gain{index}, {noise}, {n});",
            growth = of.number(1.0 / constants.lambda),
            noise = of.number(1.0 / restored),
        );
        if group.leak {
            for &first in &group.firsts {
                tables
                    .push_str(&of.table(&format!("NAME_prior_{first}"), &learner.initial[first..first + n]));
                let _ = writeln!(correct, "    lost = (NAME_prior_{first}[turn] - weights[{first} + turn]) * NAME_scale_{index}[turn];
    NAME_correct(weights + {first}, gain{index}, NAME_scale_{index}, lost, {n});");
            }
        }
    }
    if index == 0 && constants.lambda < 1.0 {
        locals.push_str("    uint32_t turn;\n");
        locals.push_str(if group.leak { "    REAL lost;\n" } else { "" });
    }
    let forget =
        if constants.lambda < 1.0 { format!("{forget}    adapter->turn{index} = 0;\n") } else { forget };
    Group { tables, locals, predict, correct, forget }
}

pub(super) fn code(of: &Learning<'_>, learner: &EquationsLearner) -> Code {
    let constants = &learner.constants;
    let (terms, samples) = (constants.terms.len(), constants.blocks * constants.stride);
    let number = |value: f64| of.number(value);
    let about = format!(
        " * Recursive least squares on increments over a window of {samples} samples, a row every {stride}:
 *     (y(t) - y(t - T)) / T = Xi mean(theta)
 * with the terms theta in the middle of each interval, and the coefficients Xi of the equations. A row of the age
 * -dt {stride} / ln({lambda}) has the weight 1/e; the coefficients of the identification are the prior. An innovation gate
 * reduces the weight of outliers. A missing value restarts the window.
",
        stride = constants.stride,
        lambda = constants.lambda,
    );
    let mut fields = Fields::default();
    for (index, group) in constants.groups.iter().enumerate() {
        least_squares::covariance(&mut fields, &index.to_string(), group.terms.len());
    }
    fields.reals("start", learner.variables_len, "outputs, command and signals at the start of the interval");
    fields.reals(
        "starts",
        constants.blocks * learner.outputs,
        "outputs at the start of each block of the window",
    );
    fields.reals("sums", constants.blocks * terms, "sums of the scaled terms in each block");
    fields.inner("noise", "NAME_noise", &least_squares::noise(learner.outputs));
    if constants.lambda < 1.0 {
        for index in 0..constants.groups.len() {
            fields.counter(&format!("turn{index}"), "coefficient whose prior is restored next");
        }
    }
    fields.counter("current", "the incomplete block");
    fields.counter("filled", "intervals in it");
    fields.counter("full", "complete blocks");
    fields.counter("seen", "samples of the run");
    fields.counter("known", "1: the last sample was complete");
    fields.counter("held", "1: a command was given after it");

    let groups: Vec<Group> =
        constants.groups.iter().enumerate().map(|(index, own)| group(of, learner, index, own)).collect();
    let all = |part: fn(&Group) -> &str| groups.iter().map(part).collect::<String>();
    let at = of.adapter.behind_positions();
    let inner = if at == 0 { String::from("state->x") } else { format!("state->x + {at}") };
    let variables = of.function(learner.variables);
    let now = match of.adapter.limit {
        None => format!("    {variables}({inner}, command, adapter->start);\n"),
        Some(limit) => format!(
            "    {{
        REAL positions[{}];
        {}(state->x, command, positions);
        {variables}({inner}, positions, adapter->start);
    }}\n",
            learner.inputs,
            of.function(limit)
        ),
    };
    let rows = ROWS
        .replace("VARIABLES_NOW", &now)
        .replace("VARIABLES_OF", &variables)
        .replace("STATE,", &format!("{inner},"))
        .replace("LIBRARY", &of.function(learner.library))
        .replace("VARIABLES", &learner.variables_len.to_string())
        .replace("TERMS", &terms.to_string())
        .replace("STRIDE", &format!("{}U", constants.stride))
        .replace("BLOCKS", &format!("{}U", constants.blocks))
        .replace("SAMPLES", &number(samples as f64))
        .replace("WINDOW", &number(samples as f64 * learner.dt))
        .replace("WARM_UP", &format!("{}U", constants.warm_up))
        .replace("LONGEST", &format!("{}U", constants.noise.longest))
        .replace("RATE", &number(constants.noise.rate))
        .replace("LOCALS", &all(|group| &group.locals))
        .replace("PREDICT", &all(|group| &group.predict))
        .replace("CORRECT", &all(|group| &group.correct))
        .replace("FORGET_ALL", &all(|group| &group.forget));
    let source = [least_squares::functions(of, &constants.noise), all(|group| &group.tables), rows].concat();
    Code { about, types: format!("{NOISE}\n"), fields, source }
}
