//! Header and source.

use std::fmt::Write as _;

use hydroid::boat::Raw;
use hydroid::model::{Model, Port};
use hydroid::plant::described_inputs;

use super::adapter::Learning;
use super::function::Printer;
use super::helpers;
use super::number::Precision;
use crate::adapter::Adapter;
use crate::name::{comment, identifiers};
use crate::state_space::StateSpace;

pub(super) struct Text<'a> {
    /// Prefix of all names, an identifier.
    pub(super) name: &'a str,
    pub(super) model: &'a Model,
    pub(super) space: &'a StateSpace,
    /// How the model learns; none for constant weights.
    pub(super) adapter: Option<&'a Adapter>,
    pub(super) precision: Precision,
}

/// Description of a channel or of a number of the state.
fn described(name: &str, unit: &str) -> String {
    let unit = if unit.is_empty() { "unit unknown" } else { unit };
    format!("{} [{}]", comment(name), comment(unit))
}

impl Text<'_> {
    fn upper(&self) -> String {
        self.name.to_ascii_uppercase()
    }

    fn channels(&self, ports: &[Port], what: &str) -> String {
        let upper = self.upper();
        let names = identifiers(ports.iter().map(|port| port.channel.name.as_str()));
        let mut text = format!("/* Indices of the {}. */\nenum {{\n", what.to_ascii_lowercase());
        let given = self.model.is_vessel();
        let trained = if given { "" } else { " in training" };
        for (index, (port, name)) in ports.iter().zip(names).enumerate() {
            let range = port.training_range.unwrap_or(port.range);
            let _ = writeln!(
                text,
                "    {upper}_{}_{} = {index}, /* {}, {} to {}{trained} */",
                what.trim_end_matches('s').to_ascii_uppercase(),
                name.to_ascii_uppercase(),
                described(&port.channel.name, &port.channel.unit),
                range.low,
                range.high
            );
        }
        text.push_str("};\n");
        text
    }

    /// Neutral value, limits and raw values of the inputs.
    fn boat(&self) -> String {
        let mut text = String::from("\n/* Neutral value and limits of the inputs, and how they are known:\n");
        for (name, about) in described_inputs(self.model) {
            let _ = writeln!(text, " * {}: {}", comment(&name), comment(&about));
        }
        text.push_str(" */\n");
        let raws = self.model.description.raw_inputs();
        if raws.iter().any(Option::is_some) {
            let (name, upper) = (self.name, self.upper());
            let _ = write!(
                text,
                "
/* The inputs of the model from the values that are sent and logged, and back. The arrays may be the same. */
void {name}_from_raw(const {name}_real raw[{upper}_INPUTS], {name}_real command[{upper}_INPUTS]);
void {name}_to_raw(const {name}_real command[{upper}_INPUTS], {name}_real raw[{upper}_INPUTS]);
"
            );
        }
        text
    }

    /// The functions between raw values and those of the model.
    fn conversions(&self) -> String {
        let raws = self.model.description.raw_inputs();
        if raws.iter().all(Option::is_none) {
            return String::new();
        }
        let (name, upper, real) = (self.name, self.upper(), self.precision.type_name());
        let number = |value: f64| self.precision.literal(value);
        let rows = |of: &dyn Fn(usize, &Raw) -> String, from: &str, to: &str| -> String {
            let row = |(i, raw): (usize, &Option<Raw>)| match raw {
                Some(raw) => format!("    {to}[{i}] = {};\n", of(i, raw)),
                None => format!("    {to}[{i}] = {from}[{i}];\n"),
            };
            raws.iter().enumerate().map(row).collect()
        };
        let from = rows(
            &|i, raw| format!("(raw[{i}] - ({})) * ({})", number(raw.offset), number(raw.factor)),
            "raw",
            "command",
        );
        let to = rows(
            &|i, raw| format!("command[{i}] / ({}) + ({})", number(raw.factor), number(raw.offset)),
            "command",
            "raw",
        );
        format!(
            "
void {name}_from_raw(const {real} raw[{upper}_INPUTS], {real} command[{upper}_INPUTS])
{{
{from}}}

void {name}_to_raw(const {real} command[{upper}_INPUTS], {real} raw[{upper}_INPUTS])
{{
{to}}}
"
        )
    }

    pub(super) fn header(&self) -> String {
        let (name, upper, d) = (self.name, self.upper(), &self.model.description);
        let (n, m, states) = (self.space.outputs(), self.space.inputs(), self.space.state.len());
        let real = self.precision.type_name();
        let motion = if d.current.is_some() { "\n * Velocities are relative to the water." } else { "" };
        let training = match &d.provenance.training[..] {
            [] => String::new(),
            runs => format!(" Training runs: {}.", comment(&runs.join(", "))),
        };
        let mut text = format!(
            "/* {title} '{model}': dynamics of a vessel, in discrete time.
 *
 * Written by hydroid {version}.{training}
 * Units are those of the channels below; angles in rad.{motion}
 *
 * A run:
 *     {name}_state state;
 *     {name}_init(&state, outputs, command);        start in a steady motion
 *     {name}_step(&state, command, {upper}_DT);     predict the next sample
 *     {name}_observe(&state, outputs);              correct with measurements; NaN for a missing one
 *     {name}_output(&state, outputs);
 */
#ifndef {upper}_H
#define {upper}_H

#include <stddef.h>
{includes}
#ifdef __cplusplus
extern \"C\" {{
#endif

typedef {real} {name}_real;

#define {upper}_OUTPUTS {n}
#define {upper}_INPUTS {m}
#define {upper}_STATES {states}

/* Sample time [s]. */
#define {upper}_DT {dt}

/* Results of functions. */
#define {upper}_OK 0
/* The time is not a whole number of samples. */
#define {upper}_TIME 1

",
            title = comment(self.model.title()),
            model = comment(&d.name),
            version = comment(&d.provenance.hydroid),
            dt = self.precision.literal(d.dt),
            includes = if self.adapter.is_some() { "#include <stdint.h>\n" } else { "" },
        );
        text.push_str(&self.channels(&d.outputs, "Outputs"));
        text.push('\n');
        text.push_str(&self.channels(&d.inputs, "Inputs"));
        if !d.inputs.is_empty() {
            text.push_str(&self.boat());
        }
        let _ = write!(
            text,
            "
/* The whole memory of a run; a copy restores it. */
typedef struct {{
    {name}_real x[{upper}_STATES];
}} {name}_state;

/* Starts a run in a steady motion: outputs and command have been constant for a long time. */
void {name}_init({name}_state *state, const {name}_real outputs[{upper}_OUTPUTS],
                 const {name}_real command[{upper}_INPUTS]);

/* Predicts the state after dt seconds with the command held. dt is a whole number of samples. Returns {upper}_OK, or
 * {upper}_TIME with the state as it was. */
int {name}_step({name}_state *state, const {name}_real command[{upper}_INPUTS], {name}_real dt);

/* Replaces the predicted outputs of the present by measured ones; NaN is a missing value. */
void {name}_observe({name}_state *state, const {name}_real outputs[{upper}_OUTPUTS]);

/* Outputs of the present. */
void {name}_output(const {name}_state *state, {name}_real outputs[{upper}_OUTPUTS]);

/* Predicts the outputs of the next samples, one row for each row of commands. The state stays. */
void {name}_rollout(const {name}_state *state, const {name}_real *commands, size_t samples,
                    {name}_real *outputs);
"
        );
        if self.space.rates.is_some() {
            let _ = write!(
                text,
                "
/* Rates of the state in continuous time, per second. */
void {name}_rates(const {name}_state *state, const {name}_real command[{upper}_INPUTS],
                  {name}_real rates[{upper}_STATES]);
"
            );
        }
        if let Some(learning) = self.learning() {
            text.push_str(&learning.header());
        }
        text.push_str("\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n");
        text
    }

    pub(super) fn source(&self) -> String {
        let (name, real) = (self.name, self.precision.type_name());
        let printer = self.printer();
        let mut text = format!(
            "#include \"{name}.h\"\n\n#include <math.h>\n#include <stdint.h>\n#include <string.h>\n
#ifdef __FAST_MATH__
#error \"This code tests for NaN and rounds on purpose: compile it without -ffast-math.\"
#endif\n\n/* The state:\n"
        );
        for (index, label) in self.space.state.iter().enumerate() {
            let _ = writeln!(text, " * x[{index}]  {}", described(&label.name, &label.unit));
        }
        text.push_str(" */\n\n");
        let functions = self.functions();
        text.push_str(&helpers::needed(self.name, self.precision, self.space, &functions));
        for index in functions {
            text.push_str(&printer.function(index));
            text.push('\n');
        }
        let function = |index: usize| printer.name(index);
        let upper = self.upper();
        let copy =
            format!("    for (i = 0; i < {upper}_STATES; ++i) {{\n        state->x[i] = next[i];\n    }}\n");
        let _ = write!(
            text,
            "void {name}_init({name}_state *state, const {real} outputs[{upper}_OUTPUTS], const {real} command[{upper}_INPUTS])
{{
    {start}(outputs, command, state->x);
}}

static void {name}_sample({name}_state *state, const {real} command[{upper}_INPUTS])
{{
    {real} next[{upper}_STATES];
    size_t i;
    {step}(state->x, command, next);
{copy}}}

int {name}_step({name}_state *state, const {real} command[{upper}_INPUTS], {real} dt)
{{
    const {real} samples = {round};
    {real} k;
    if (!(samples >= {one}) || !(samples < {most}) || {abs} > {tolerance} * dt) {{
        return {upper}_TIME;
    }}
    for (k = {zero}; k < samples; k += {one}) {{
        {name}_sample(state, command);
    }}
    return {upper}_OK;
}}

void {name}_observe({name}_state *state, const {real} outputs[{upper}_OUTPUTS])
{{
    {real} next[{upper}_STATES];
    size_t i;
    {observe}(state->x, outputs, next);
{copy}}}

void {name}_output(const {name}_state *state, {real} outputs[{upper}_OUTPUTS])
{{
    {output}(state->x, outputs);
}}

",
            start = function(self.space.start),
            step = function(self.space.step),
            observe = function(self.space.observe),
            output = function(self.space.output),
            round = self.precision.call("floor", &format!("dt / {upper}_DT + {}", self.precision.literal(0.5))),
            abs = self.precision.call("fabs", &format!("samples * {upper}_DT - dt")),
            tolerance = self.precision.literal(1e-5),
            // Counting in single precision ends at 2^24.
            most = self.precision.literal(16_777_216.0),
            one = self.precision.literal(1.0),
            zero = self.precision.literal(0.0),
        );
        text.push_str(&self.rollout(&printer));
        if let Some(rates) = self.space.rates {
            let _ = write!(
                text,
                "
void {name}_rates(const {name}_state *state, const {real} command[{upper}_INPUTS], {real} rates[{upper}_STATES])
{{
    {}(state->x, command, rates);
}}
",
                function(rates)
            );
        }
        text.push_str(&self.conversions());
        if let Some(learning) = self.learning() {
            text.push_str(&learning.source());
        }
        text
    }

    fn printer(&self) -> Printer<'_> {
        Printer { prefix: self.name, precision: self.precision, module: &self.space.module }
    }

    fn learning(&self) -> Option<Learning<'_>> {
        Some(Learning { name: self.name, precision: self.precision, adapter: self.adapter? })
    }

    /// Indices of all functions, each behind those that it calls.
    fn functions(&self) -> Vec<usize> {
        let mut roots = self.space.functions();
        roots.extend(self.adapter.iter().flat_map(|adapter| adapter.functions()));
        self.space.needed(&roots)
    }

    fn rollout(&self, printer: &Printer<'_>) -> String {
        let (name, upper, real) = (self.name, self.upper(), self.precision.type_name());
        let signature = format!(
            "void {name}_rollout(const {name}_state *state, const {real} *commands, size_t samples, {real} *outputs)\n{{\n"
        );
        let Some(block) = &self.space.block else {
            return format!(
                "{signature}    {name}_state at = *state;
    size_t k;
    for (k = 0; k < samples; ++k) {{
        {name}_sample(&at, commands + k * {upper}_INPUTS);
        {name}_output(&at, outputs + k * {upper}_OUTPUTS);
    }}
}}
"
            );
        };
        format!(
            "/* Samples that are predicted at once. */
#define {upper}_HORIZON {horizon}

{signature}    {name}_state at = *state;
    {real} ahead[{upper}_HORIZON * {upper}_INPUTS];
    {real} y[{upper}_HORIZON * {upper}_OUTPUTS];
    {real} next[{upper}_STATES];
    size_t k;
    size_t i;
    for (k = 0; k < samples; k += {upper}_HORIZON) {{
        const size_t count = (samples - k < {upper}_HORIZON) ? samples - k : {upper}_HORIZON;
        for (i = 0; i < {upper}_HORIZON * {upper}_INPUTS; ++i) {{
            const size_t row = i / {upper}_INPUTS;
            const size_t last = (row < count) ? row : count - 1;
            ahead[i] = commands[(k + last) * {upper}_INPUTS + i % {upper}_INPUTS];
        }}
        {predict}(at.x, ahead, y);
        for (i = 0; i < count * {upper}_OUTPUTS; ++i) {{
            outputs[k * {upper}_OUTPUTS + i] = y[i];
        }}
        {follow}(at.x, ahead, y, next);
        for (i = 0; i < {upper}_STATES; ++i) {{
            at.x[i] = next[i];
        }}
    }}
}}
",
            horizon = block.horizon,
            predict = printer.name(block.predict),
            follow = printer.name(block.follow),
        )
    }
}
