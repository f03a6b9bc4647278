//! Functions that the code of a model calls.

use super::number::Precision;
use crate::graph::{Op, Unary};
use crate::state_space::StateSpace;

const SIGN: &str = "static REAL NAME_sign(REAL x)
{
    return (REAL)((x > 0) - (x < 0));
}
";

/// `exp`, the logistic function and `tanh` without branches, as in hydroid, so that compilers vectorize loops over them.
const EXP_DOUBLE: &str =
    "/* e^x = s (1 + q) with s = 2^n, n next to x / ln 2, and a polynomial for q = e^r - 1, |r| <= ln 2 / 2
 * (Cody and Waite 1980). n is read from the last bits of n + 1.5 2^52. */
static double NAME_exp(double x, double *s)
{
    const double rounded = x * 1.4426950408889634 + 6755399441055744.0;
    const double n = rounded - 6755399441055744.0;
    const double r = (x - n * 0.6931471804855391) - n * 7.440617110012397e-11;
    double p = 2.510038549551032e-08;
    uint64_t bits;
    p = p * r + 2.7620088445409746e-07;
    p = p * r + 2.7557268459997064e-06;
    p = p * r + 2.4801521295954376e-05;
    p = p * r + 0.00019841269863053618;
    p = p * r + 0.0013888888917213717;
    p = p * r + 0.008333333333330062;
    p = p * r + 0.04166666666662413;
    p = p * r + 0.16666666666666669;
    p = p * r + 0.5000000000000001;
    memcpy(&bits, &rounded, sizeof bits);
    bits = (bits << 52) + UINT64_C(0x3ff0000000000000);
    memcpy(s, &bits, sizeof bits);
    return p * r * r + r;
}
";

const EXP_FLOAT: &str =
    "/* e^x = s (1 + q) with s = 2^n, n next to x / ln 2, and a polynomial for q = e^r - 1, |r| <= ln 2 / 2
 * (Cody and Waite 1980). n is read from the last bits of n + 1.5 2^23. */
static float NAME_exp(float x, float *s)
{
    const float rounded = x * 1.44269504F + 12582912.0F;
    const float n = rounded - 12582912.0F;
    const float r = (x - n * 0.69314575F) - n * 1.4286068e-6F;
    float p = 0.0013926184F;
    uint32_t bits;
    p = p * r + 0.008363179F;
    p = p * r + 0.041666555F;
    p = p * r + 0.16666577F;
    p = p * r + 0.5F;
    memcpy(&bits, &rounded, sizeof bits);
    bits = (bits << 23) + UINT32_C(0x3f800000);
    memcpy(s, &bits, sizeof bits);
    return p * r * r + r;
}
";

const LOGISTIC: &str = "/* 1 / (1 + exp(-x)). */
static REAL NAME_logistic(REAL x)
{
    REAL s;
    const REAL y = (x > NORMAL) ? NORMAL : x;
    const REAL q = NAME_exp((y < -NORMAL) ? NORMAL : -y, &s);
    return (REAL)1 / ((REAL)1 + (q * s + s));
}
";

const TANH: &str = "/* (e^2x - 1) / (e^2x - 1 + 2). */
static REAL NAME_tanh(REAL x)
{
    REAL s;
    const REAL size = FABS(x);
    const REAL y = (size > END) ? END : size;
    const REAL q = NAME_exp(y + y, &s);
    const REAL e = q * s + (s - (REAL)1);
    const REAL t = e / (e + (REAL)2);
    return (x < 0) ? -t : t;
}
";

const AFFINE: &str = "/* y = W x + b; W column by column. */
static void NAME_affine(const REAL *restrict w, const REAL *restrict b, const REAL *restrict x, size_t rows,
                        size_t columns, REAL *restrict y)
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

const PRODUCT: &str = "/* y = W x; W row by row. */
static void NAME_product(const REAL *restrict w, const REAL *restrict x, size_t rows, size_t columns, REAL *restrict y)
{
    size_t i;
    size_t j;
    for (i = 0; i < rows; ++i) {
        REAL sum = 0;
        for (j = 0; j < columns; ++j) {
            sum += w[i * columns + j] * x[j];
        }
        y[i] = sum;
    }
}
";

const TRANSPOSED_PRODUCT: &str = "/* y = W' x; W row by row. */
static void NAME_transposed_product(const REAL *restrict w, const REAL *restrict x, size_t rows, size_t columns,
                                    REAL *restrict y)
{
    size_t i;
    size_t j;
    for (j = 0; j < columns; ++j) {
        y[j] = 0;
    }
    for (i = 0; i < rows; ++i) {
        for (j = 0; j < columns; ++j) {
            y[j] += w[i * columns + j] * x[i];
        }
    }
}
";

const OUTER: &str = "/* W = a b', row by row. */
static void NAME_outer(const REAL *restrict a, const REAL *restrict b, size_t rows, size_t columns, REAL *restrict w)
{
    size_t i;
    size_t j;
    for (i = 0; i < rows; ++i) {
        for (j = 0; j < columns; ++j) {
            w[i * columns + j] = a[i] * b[j];
        }
    }
}
";

const GRU: &str = "/* h+ = (1 - z) n + z h with gates r, z, n; a = W_ih x + b_ih, b = W_hh h + b_hh. */
static void NAME_gru(const REAL *restrict a, const REAL *restrict b, const REAL *restrict h, size_t n,
                     REAL *restrict next)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        const REAL reset = NAME_logistic(a[i] + b[i]);
        const REAL update = NAME_logistic(a[n + i] + b[n + i]);
        const REAL fresh = NAME_tanh(a[2 * n + i] + reset * b[2 * n + i]);
        next[i] = fresh + update * (h[i] - fresh);
    }
}
";

const LSTM: &str =
    "/* c+ = f c + i g and m = o tanh(c+) with gates i, f, g, o; a = W_ih x + b_ih, b = W_hh h + b_hh. */
static void NAME_lstm(const REAL *restrict a, const REAL *restrict b, const REAL *restrict c, size_t n,
                      REAL *restrict next)
{
    size_t i;
    for (i = 0; i < n; ++i) {
        const REAL input = NAME_logistic(a[i] + b[i]);
        const REAL forget = NAME_logistic(a[n + i] + b[n + i]);
        const REAL fresh = NAME_tanh(a[2 * n + i] + b[2 * n + i]);
        next[i] = forget * c[i] + input * fresh;
        next[n + i] = NAME_logistic(a[3 * n + i] + b[3 * n + i]) * NAME_tanh(next[i]);
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
    let (exp, normal, end) = match precision {
        Precision::Double => (EXP_DOUBLE, 708.0, 20.0),
        Precision::Float => (EXP_FLOAT, 87.0, 10.0),
    };
    let helpers = [
        (of(Unary::Sign), SIGN),
        (logistic || tanh, exp),
        (logistic, LOGISTIC),
        (tanh, TANH),
        (gru || lstm || uses(&|op| matches!(op, Op::Affine { .. })), AFFINE),
        (uses(&|op| matches!(op, Op::Product { .. })), PRODUCT),
        (uses(&|op| matches!(op, Op::TransposedProduct { .. })), TRANSPOSED_PRODUCT),
        (uses(&|op| matches!(op, Op::Outer { .. })), OUTER),
        (gru, GRU),
        (lstm, LSTM),
        (uses(&|op| matches!(op, Op::Median { .. })), MEDIAN),
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
