//! Recursive least squares in C, as [`hydroid_core::adapt::RecursiveLeastSquares`] and its gate.

use std::fmt::Write as _;

use hydroid_core::adapt::{NoiseConstants, UdFactor};

use super::{Fields, Learning};

/// Functions of the factor of the covariance, and of the coefficients.
const FUNCTIONS: &str = include_str!("least_squares.c");

/// Type of the noise estimate.
pub(super) const NOISE: &str = "/* Estimate of the noise of the rows. */
typedef struct {
    NAME_real variance[UPPER_OUTPUTS]; /* (unit of the output / s)^2 */
    uint32_t rows; /* number of rows so far */
    uint32_t streak; /* consecutive outliers */
} NAME_noise;
";

/// Fields of [`NOISE`].
pub(super) fn noise(outputs: usize) -> Fields {
    Fields { reals: outputs, counters: 2, ..Fields::default() }
}

/// The functions with the constants of the gate.
pub(super) fn functions(of: &Learning<'_>, noise: &NoiseConstants) -> String {
    let precision = of.precision;
    let large = match precision {
        super::Precision::Double => 1e150,
        super::Precision::Float => 1e18,
    };
    let fewest = format!("{}U", noise.fewest_rows);
    FUNCTIONS
        .replace("FABS", &precision.call("fabs", "").replace("()", ""))
        .replace("SQRT", &precision.call("sqrt", "").replace("()", ""))
        .replace("INFLATE", &of.number(noise.gate.inflate))
        .replace("REJECT", &of.number(noise.gate.reject))
        .replace("MOST", &of.number(noise.most_leverage))
        .replace("FEWEST", &fewest)
        .replace("LARGE", &of.number(large))
}

/// Fields of a covariance with a suffix of their names.
pub(super) fn covariance(fields: &mut Fields, suffix: &str, terms: usize) {
    let len = terms * terms.saturating_sub(1) / 2;
    fields.reals(&format!("u{suffix}"), len, "factor U of the covariance of the scaled coefficients");
    fields.reals(&format!("d{suffix}"), terms, "factor D");
}

/// Tables and statements that set a covariance to the one of the start; `index` makes the names unique.
pub(super) fn forget(of: &Learning<'_>, factor: &UdFactor, index: &str, target: &str) -> (String, String) {
    let (columns, n) = (factor.columns(), factor.len());
    let mut tables = of.table(&format!("NAME_d_{index}"), factor.diagonal());
    let mut body = format!(
        "    for (i = 0; i < {n}; ++i) {{\n        {target}[i] = NAME_d_{index}[i];\n    }}\n",
        target = target.replace('?', "d")
    );
    let u = target.replace('?', "u");
    if columns.is_empty() {
        let _ = writeln!(body, "    {u}[0] = 0;");
    } else if columns.iter().all(|u| *u == 0.0) {
        let _ = writeln!(body, "    for (i = 0; i < {}; ++i) {{\n        {u}[i] = 0;\n    }}", columns.len());
    } else {
        tables.push_str(&of.table(&format!("NAME_u_{index}"), columns));
        let _ = writeln!(
            body,
            "    for (i = 0; i < {}; ++i) {{\n        {u}[i] = NAME_u_{index}[i];\n    }}",
            columns.len()
        );
    }
    (tables, body)
}
