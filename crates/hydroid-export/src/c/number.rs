//! Numbers and functions of C in one precision.

use crate::graph::Unary;

/// Floating-point type of the exported code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// `double`: results agree with hydroid to rounding.
    #[default]
    Double,
    /// `float`: for processors without double precision.
    Float,
}

impl Precision {
    pub(super) fn type_name(self) -> &'static str {
        match self {
            Self::Double => "double",
            Self::Float => "float",
        }
    }

    /// A literal of a number, with all its digits.
    pub(super) fn literal(self, value: f64) -> String {
        let text = match self {
            Self::Double => format!("{value:?}"),
            #[expect(clippy::cast_possible_truncation, reason = "to the precision of the code")]
            Self::Float => format!("{:?}F", value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32),
        };
        if text.starts_with('-') { format!("({text})") } else { text }
    }

    /// A call of a function of `math.h`.
    pub(super) fn call(self, name: &str, arguments: &str) -> String {
        let suffix = if self == Self::Float { "f" } else { "" };
        format!("{name}{suffix}({arguments})")
    }

    pub(super) fn unary(self, prefix: &str, f: Unary, x: &str) -> String {
        let name = match f {
            Unary::Neg => return format!("-{x}"),
            Unary::Sign => return format!("{prefix}_sign({x})"),
            Unary::Logistic => return format!("{prefix}_logistic({x})"),
            Unary::Tanh => return format!("{prefix}_tanh({x})"),
            Unary::Abs => "fabs",
            Unary::Exp => "exp",
            Unary::Ln => "log",
            Unary::Sin => "sin",
            Unary::Cos => "cos",
            Unary::Sqrt => "sqrt",
        };
        self.call(name, x)
    }
}
