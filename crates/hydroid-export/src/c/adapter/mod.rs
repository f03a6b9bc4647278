//! The memory and the functions of a model that learns.
//!
//! A method has a struct of fixed size and four functions in C:
//!
//! ```text
//! NAME_adapter_forget(adapter)                        the covariance of the start, nothing learned
//! NAME_adapter_begin(adapter, state, outputs)         after NAME_init: the start of a run
//! NAME_adapter_step(adapter, state, command)          a sample
//! NAME_adapter_observe(adapter, state, outputs)       a measurement: learns
//! ```

mod committee;
mod equations;
mod filter;
mod least_squares;

use std::fmt::Write as _;

use super::function::Printer;
use super::number::Precision;
use crate::adapter::{Adapter, Method};

/// Code of a method.
struct Code {
    /// Equations of the method, lines of a comment.
    about: String,
    /// Types in front of the struct `NAME_adapter`.
    types: String,
    /// The fields of that struct.
    fields: Fields,
    /// Definitions of the four functions and of those that they call.
    source: String,
}

/// Fields of a struct.
#[derive(Default)]
struct Fields {
    text: String,
    /// Numbers, and counters of 32 bits.
    reals: usize,
    counters: usize,
    /// Structs in it with an odd number of counters: in double precision, they end with an unused one.
    odd: usize,
}

impl Fields {
    /// An array of numbers.
    fn reals(&mut self, name: &str, len: usize, about: &str) {
        let _ = writeln!(self.text, "    NAME_real {name}[{}]; /* {about} */", len.max(1));
        self.reals += len.max(1);
    }

    fn counter(&mut self, name: &str, about: &str) {
        let _ = writeln!(self.text, "    uint32_t {name}; /* {about} */");
        self.counters += 1;
    }

    /// A field of a type of `inner`.
    fn inner(&mut self, name: &str, type_name: &str, inner: &Self) {
        let _ = writeln!(self.text, "    {type_name} {name};");
        self.reals += inner.reals;
        self.counters += inner.counters;
        self.odd += inner.odd + inner.counters % 2;
    }

    fn bytes(&self, precision: Precision) -> usize {
        match precision {
            Precision::Double => 8 * self.reals + 4 * (self.counters + self.odd).next_multiple_of(2),
            Precision::Float => 4 * (self.reals + self.counters),
        }
    }
}

/// Printer of an adapter.
pub(super) struct Learning<'a> {
    /// Prefix of all names, an identifier.
    pub(super) name: &'a str,
    pub(super) precision: Precision,
    pub(super) adapter: &'a Adapter,
}

impl Learning<'_> {
    fn code(&self) -> Code {
        match &self.adapter.method {
            Method::Committee(members) => committee::code(self, members),
            Method::Equations(learner) => equations::code(self, learner),
            Method::Network(learner) => filter::code(self, learner),
        }
    }

    /// Replaces the words that stand for names and types. The name of a model may contain such words.
    fn named(&self, text: &str) -> String {
        let words = [
            ("REAL", "\u{1}", self.precision.type_name().to_owned()),
            ("UPPER", "\u{2}", self.name.to_ascii_uppercase()),
            ("NAME", "\u{3}", self.name.to_owned()),
        ];
        let marked = words.iter().fold(text.to_owned(), |text, (word, mark, _)| text.replace(word, mark));
        words.iter().fold(marked, |text, (_, mark, name)| text.replace(mark, name))
    }

    /// Name of a function of the graph, with the word `NAME`.
    fn function(&self, index: usize) -> String {
        let module = &self.adapter.space.module;
        Printer { prefix: "NAME", precision: self.precision, module }.name(index)
    }

    pub(super) fn header(&self) -> String {
        let Code { about, types, mut fields, .. } = self.code();
        fields.counter("frozen", "1: nothing is learned, all else goes on");
        let bytes = fields.bytes(self.precision);
        let (weights, first) = (self.adapter.weights, self.adapter.first_weight());
        let text = format!(
            "
/* The model learns along a run:
 *
{about} *
 * The learned coefficients are the last numbers of the state, so that a copy of state and adapter saves all. A run:
 *     NAME_adapter adapter;
 *     NAME_adapter_init(&adapter, &state, outputs, command);
 *     NAME_adapter_step(&adapter, &state, command);         in place of NAME_step, one sample
 *     NAME_adapter_observe(&adapter, &state, outputs);      in place of NAME_observe
 * NAME_output and NAME_rollout predict with the learned coefficients. */
#define UPPER_WEIGHTS {weights}
#define UPPER_FIRST_WEIGHT {first}

{types}/* The memory of the method: {bytes} bytes. */
typedef struct {{
{}}} NAME_adapter;

/* Results of NAME_adapter_observe. */
#define UPPER_WAITING 0  /* Nothing was learned: no row is complete, values are missing, or learning is frozen. */
#define UPPER_LEARNED 1
#define UPPER_REJECTED 2 /* An outlier, or a number that is not finite. */

/* Starts a run in a steady motion, as NAME_init, with the coefficients and the covariance of the identification. */
void NAME_adapter_init(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS],
                       const REAL command[UPPER_INPUTS]);

/* Starts another run. Learned coefficients and their covariance stay. */
void NAME_adapter_start(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS],
                        const REAL command[UPPER_INPUTS]);

/* Predicts the next sample with the command held. */
void NAME_adapter_step(NAME_adapter *adapter, NAME_state *state, const REAL command[UPPER_INPUTS]);

/* Takes measured outputs, NaN for a missing value, and learns from them. At most one measurement of a sample. */
int NAME_adapter_observe(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS]);
",
            fields.text
        );
        self.named(&text)
    }

    pub(super) fn source(&self) -> String {
        let text = format!(
            "
{}
void NAME_adapter_init(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS],
                       const REAL command[UPPER_INPUTS])
{{
    NAME_init(state, outputs, command);
    adapter->frozen = 0;
    NAME_adapter_forget(adapter);
    NAME_adapter_begin(adapter, state, outputs);
}}

void NAME_adapter_start(NAME_adapter *adapter, NAME_state *state, const REAL outputs[UPPER_OUTPUTS],
                        const REAL command[UPPER_INPUTS])
{{
    REAL weights[UPPER_WEIGHTS];
    size_t i;
    for (i = 0; i < UPPER_WEIGHTS; ++i) {{
        weights[i] = state->x[UPPER_FIRST_WEIGHT + i];
    }}
    NAME_init(state, outputs, command);
    for (i = 0; i < UPPER_WEIGHTS; ++i) {{
        state->x[UPPER_FIRST_WEIGHT + i] = weights[i];
    }}
    NAME_adapter_begin(adapter, state, outputs);
}}
",
            self.code().source
        );
        self.named(&text)
    }

    /// A number, which may be infinite.
    fn number(&self, value: f64) -> String {
        if value == f64::INFINITY { String::from("(REAL)HUGE_VAL") } else { self.precision.literal(value) }
    }

    /// A table of constants.
    fn table(&self, name: &str, numbers: &[f64]) -> String {
        let numbers: Vec<String> = numbers.iter().map(|number| self.precision.literal(*number)).collect();
        format!("static const REAL {name}[{}] = {{\n{}}};\n", numbers.len(), lines(&numbers))
    }

    /// A table of indices.
    fn indices(name: &str, numbers: &[usize]) -> String {
        let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
        format!("static const uint16_t {name}[{}] = {{\n{}}};\n", numbers.len(), lines(&numbers))
    }
}

/// Items with commas, six in a line.
fn lines(items: &[String]) -> String {
    let lines: Vec<String> = items.chunks(6).map(|line| format!("    {},", line.join(", "))).collect();
    lines.join("\n") + "\n"
}
