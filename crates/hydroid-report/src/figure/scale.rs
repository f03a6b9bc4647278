//! Linear scales and round tick values.

/// A linear map from an interval of values to an interval of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// Maps `range` to the pixels `from..to`, which may decrease. An empty or non-finite range is widened.
    pub fn new(range: (f64, f64), from: f64, to: f64) -> Self {
        let (low, high) = widened(range);
        Self { low, high, from, to }
    }

    pub(crate) const fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Pixel of a value. Far values are clamped to a finite distance; NaN stays NaN.
    pub fn place(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        self.from + (self.to - self.from) * share.clamp(-1e4, 1e4)
    }

    /// About `wanted` ticks at round values, at least two and at most `most`.
    pub fn ticks(&self, wanted: usize, most: usize) -> Ticks {
        let width = self.high - self.low;
        let rough = width / wanted.max(1) as f64;
        let power = 10f64.powf(rough.log10().floor());
        let far = |step: &f64| (step / rough).ln().abs();
        let mut steps = [0.2, 0.5, 1.0, 2.0, 5.0, 10.0].map(|m| m * power);
        steps.sort_by(|a, b| far(a).total_cmp(&far(b)));
        // Multiples of 2.5 are less legible than multiples of 2 or 5, but better than a single tick.
        let quarters = [0.25, 2.5].map(|m| m * power);
        let fits = |step: &f64| (2..=most).contains(&self.span(*step).1);
        let step = steps.into_iter().chain(quarters).find(fits).unwrap_or(steps[0]);
        let (first, count) = self.span(step);
        let values = (0..count).map(|i| (first + i as f64) * step).collect();
        Ticks::new(values, step)
    }

    /// Ticks of a logarithmic axis: powers of ten; if fewer than two are in range, 1, 2 and 5 times powers of ten; else
    /// linear.
    pub fn decades(&self, most: usize) -> Ticks {
        let marked = |mantissas: &[f64]| -> Vec<f64> {
            #[allow(clippy::cast_possible_truncation)] // exponents between -320 and 310
            let (first, last) = (self.low.max(-320.0).floor() as i32, self.high.min(310.0).ceil() as i32);
            let powers = (first..=last).flat_map(|p| mantissas.iter().map(move |m| f64::from(p) + m.log10()));
            powers.filter(|v| (self.low..=self.high).contains(v)).collect()
        };
        let mut values = marked(&[1.0]);
        if values.len() < 2 {
            values = marked(&[1.0, 2.0, 5.0]);
        }
        if values.len() < 2 {
            values = self.ticks(3, most.max(2)).values;
        }
        let every = values.len().div_ceil(most.max(1));
        let values = values.into_iter().step_by(every.max(1)).collect();
        Ticks { values, power: 0, decimals: 0, logarithms: true }
    }

    fn span(&self, step: f64) -> (f64, usize) {
        let first = (self.low / step - 1e-9).ceil();
        let last = (self.high / step + 1e-9).floor();
        // More than 100 steps can only result from rounding errors.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = ((last - first).clamp(-1.0, 100.0) + 1.0) as usize;
        (first, count)
    }
}

fn widened((low, high): (f64, f64)) -> (f64, f64) {
    if !(low.is_finite() && high.is_finite() && (high - low).is_finite()) {
        return (0.0, 1.0);
    }
    let middle = 0.5 * (low + high);
    if high - low > 1e-9 * middle.abs() && high - low > 1e-300 {
        (low, high)
    } else {
        let half = if middle == 0.0 { 1.0 } else { 0.1 * middle.abs() };
        (middle - half, middle + half)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Ticks {
    pub values: Vec<f64>,
    /// Power of ten that the labels omit and the axis label states; 0 for none.
    pub(crate) power: i32,
    decimals: usize,
    /// Whether the values are logarithms to base 10.
    logarithms: bool,
}

impl Ticks {
    fn new(values: Vec<f64>, step: f64) -> Self {
        let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        #[allow(clippy::cast_possible_truncation)] // an exponent of ten of a finite number
        let power = if largest > 0.0 && !(1e-3..1e5).contains(&largest) {
            3 * (largest.log10() / 3.0).floor() as i32
        } else {
            0
        };
        let scaled = step / 10f64.powi(power);
        let exact = |decimals: &usize| {
            let shifted = scaled * 10f64.powf(*decimals as f64);
            (shifted - shifted.round()).abs() < 1e-6 * shifted
        };
        let decimals = (0..9).find(exact).unwrap_or(9);
        Self { values, power, decimals, logarithms: false }
    }

    /// The label of a tick, with a typographic minus.
    pub fn label(&self, value: f64) -> String {
        if self.logarithms {
            let number = 10f64.powf(value);
            // Two digits distinguish the ticks of every logarithmic axis.
            let rounded = format!("{number:.1e}").parse().unwrap_or(number);
            // The shortest decimal that parses back to the value.
            return if (1e-4..1e5).contains(&number) {
                f64::to_string(&rounded)
            } else {
                format!("{number:.0e}")
            };
        }
        let scaled = value / 10f64.powi(self.power);
        let text = format!("{:.*}", self.decimals, scaled);
        match text.strip_prefix('-') {
            Some(digits) if digits.bytes().any(|b| (b'1'..=b'9').contains(&b)) => format!("−{digits}"),
            Some(digits) => digits.to_owned(),
            None => text,
        }
    }

    /// `×10⁻³` if the labels omit a power of ten; empty otherwise.
    pub fn factor(&self) -> String {
        if self.power == 0 { String::new() } else { format!("×10{}", superscript(self.power)) }
    }
}

pub(crate) fn superscript(n: i32) -> String {
    n.to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '4' => '⁴',
            '5' => '⁵',
            '6' => '⁶',
            '7' => '⁷',
            '8' => '⁸',
            '9' => '⁹',
            _ => '⁰',
        })
        .collect()
}

/// The range of the finite values; `None` if there are none.
pub(crate) fn cover(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|v| v.is_finite()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((v.min(low), v.max(high))),
    })
}

/// A range with a margin on both sides, as a share of its width.
pub(crate) fn padded((low, high): (f64, f64), share: f64) -> (f64, f64) {
    let (low, high) = widened((low, high));
    let margin = share * (high - low);
    (low - margin, high + margin)
}
