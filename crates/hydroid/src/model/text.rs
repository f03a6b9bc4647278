//! A model's equations as text.

use super::{Body, Model};

impl Model {
    /// Names of the variables that terms are of: outputs, inputs, signals.
    pub fn variable_names(&self) -> Vec<String> {
        let d = &self.description;
        let mut names: Vec<String> =
            d.outputs.iter().chain(&d.inputs).map(|port| port.channel.name.clone()).collect();
        let Body::Equations(equations) = &self.body;
        let signals: Vec<String> = equations.signals().iter().map(|s| s.name(&names, d.dt)).collect();
        names.extend(signals);
        names
    }

    /// The equations of motion, one line for each output, in physical units: `du/dt = -0.907 u + ...`.
    /// Largest exponents last, as the library has them; empty for models without equations.
    pub fn equations_text(&self) -> Vec<String> {
        let Body::Equations(equations) = &self.body;
        let names = self.variable_names();
        (0..equations.outputs())
            .map(|i| {
                let mut text = format!("d{}/dt =", names[i]);
                let mut first = true;
                for (j, term) in equations.terms().iter().enumerate() {
                    let c = equations.coefficient(i, j);
                    if c == 0.0 {
                        continue;
                    }
                    let sign = match (c < 0.0, first) {
                        (true, true) => " -",
                        (false, true) => " ",
                        (true, false) => " - ",
                        (false, false) => " + ",
                    };
                    first = false;
                    text.push_str(sign);
                    text.push_str(&significant(c.abs()));
                    if !term.factors().is_empty() {
                        text.push(' ');
                        text.push_str(&term.name(&names));
                    }
                }
                if first {
                    text.push_str(" 0");
                }
                text
            })
            .collect()
    }
}

/// Four significant digits, without an exponent where that reads well.
fn significant(x: f64) -> String {
    if (1e-4..1e5).contains(&x) {
        // The exponent of such a number is a small integer.
        #[allow(clippy::cast_possible_truncation)]
        let exponent = x.log10().floor() as i32;
        let decimals = usize::try_from(3 - exponent).unwrap_or(0);
        format!("{x:.decimals$}")
    } else {
        format!("{x:.3e}")
    }
}
