//! Functions that the code of a model calls.

use super::number::Precision;
use crate::graph::{Op, Unary};
use crate::state_space::StateSpace;

const SIGN: &str = "static REAL NAME_sign(REAL x)
{
    return (REAL)((x > 0) - (x < 0));
}
";

const LOGISTIC: &str = "static REAL NAME_logistic(REAL x)
{
    return (REAL)1 / ((REAL)1 + EXP(-x));
}
";

const AFFINE: &str = "/* y = W x + b; W column by column. */
static void NAME_affine(const REAL *w, const REAL *b, const REAL *x, size_t rows, size_t columns, REAL *y)
{
    size_t i;
    size_t j;
    for (i = 0; i < rows; ++i) {
        y[i] = b[i];
    }
    for (j = 0; j < columns; ++j) {
        for (i = 0; i < rows; ++i) {
            y[i] += w[j * rows + i] * x[j];
        }
    }
}
";

const GRU: &str = "/* h+ = (1 - z) n + z h with gates r, z, n; a = W_ih x + b_ih, b = W_hh h + b_hh. */
static void NAME_gru(const REAL *a, const REAL *b, const REAL *h, size_t n, REAL *next)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        const REAL reset = NAME_logistic(a[i] + b[i]);
        const REAL update = NAME_logistic(a[n + i] + b[n + i]);
        const REAL fresh = TANH(a[2 * n + i] + reset * b[2 * n + i]);
        next[i] = fresh + update * (h[i] - fresh);
    }
}
";

const LSTM: &str =
    "/* c+ = f c + i g and m = o tanh(c+) with gates i, f, g, o; a = W_ih x + b_ih, b = W_hh h + b_hh. */
static void NAME_lstm(const REAL *a, const REAL *b, const REAL *c, size_t n, REAL *next)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        const REAL input = NAME_logistic(a[i] + b[i]);
        const REAL forget = NAME_logistic(a[n + i] + b[n + i]);
        const REAL fresh = TANH(a[2 * n + i] + b[2 * n + i]);
        next[i] = forget * c[i] + input * fresh;
        next[n + i] = NAME_logistic(a[3 * n + i] + b[3 * n + i]) * TANH(next[i]);
    }
}
";

const MEDIAN: &str = "/* Weighted median: half of the votes are below it, half above. What is not a number counts as infinite. */
static REAL NAME_median(REAL *values, unsigned long *votes, size_t count)
{
    unsigned long all = 0;
    unsigned long below = 0;
    size_t i;
    size_t j;
    for (i = 0; i < count; ++i) {
        const REAL value = isnan(values[i]) ? (REAL)HUGE_VAL : values[i];
        const unsigned long vote = votes[i];
        all += vote;
        for (j = i; j > 0 && values[j - 1] > value; --j) {
            values[j] = values[j - 1];
            votes[j] = votes[j - 1];
        }
        values[j] = value;
        votes[j] = vote;
    }
    for (i = 0; i + 1 < count; ++i) {
        below += votes[i];
        if (2 * below > all) {
            return values[i];
        }
        if (2 * below == all) {
            return (values[i] + values[i + 1]) / 2;
        }
    }
    return values[count - 1];
}
";

/// The functions that the code of a model calls.
pub(super) fn needed(name: &str, precision: Precision, space: &StateSpace) -> String {
    let uses = |test: &dyn Fn(&Op) -> bool| {
        let functions = space.functions();
        let mut nodes = functions.iter().flat_map(|&index| &space.function(index).nodes);
        nodes.any(|node| test(&node.op))
    };
    let gru = uses(&|op| matches!(op, Op::Gru { .. }));
    let lstm = uses(&|op| matches!(op, Op::Lstm { .. }));
    let of = |f: Unary| uses(&|op| matches!(op, Op::Unary(of, _) if *of == f));
    let helpers = [
        (of(Unary::Sign), SIGN),
        (gru || lstm || of(Unary::Logistic), LOGISTIC),
        (gru || lstm || uses(&|op| matches!(op, Op::Affine { .. })), AFFINE),
        (gru, GRU),
        (lstm, LSTM),
        (uses(&|op| matches!(op, Op::Median { .. })), MEDIAN),
    ];
    let mut text = String::new();
    for (_, helper) in helpers.into_iter().filter(|(needed, _)| *needed) {
        let function = |of: &str| precision.call(of, "").trim_end_matches("()").to_owned();
        let code = helper
            .replace("EXP", &function("exp"))
            .replace("TANH", &function("tanh"))
            .replace("REAL", precision.type_name())
            .replace("NAME", name);
        text.push_str(&code);
        text.push('\n');
    }
    text
}
