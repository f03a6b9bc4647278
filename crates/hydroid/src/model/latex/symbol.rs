//! Names, numbers and units in LaTeX.

use crate::model::text::significant;
use crate::model::units::UnitProduct;

const GREEK: [(&str, char); 23] = [
    ("alpha", 'α'),
    ("beta", 'β'),
    ("gamma", 'γ'),
    ("delta", 'δ'),
    ("epsilon", 'ε'),
    ("zeta", 'ζ'),
    ("eta", 'η'),
    ("theta", 'θ'),
    ("iota", 'ι'),
    ("kappa", 'κ'),
    ("lambda", 'λ'),
    ("mu", 'μ'),
    ("nu", 'ν'),
    ("xi", 'ξ'),
    ("pi", 'π'),
    ("rho", 'ρ'),
    ("sigma", 'σ'),
    ("tau", 'τ'),
    ("upsilon", 'υ'),
    ("phi", 'φ'),
    ("chi", 'χ'),
    ("psi", 'ψ'),
    ("omega", 'ω'),
];

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Symbol {
    base: String,
    index: String,
}

impl Symbol {
    /// The index is the text after the first underscore of a name, or the digits after a single letter.
    pub(super) fn of(name: &str) -> Self {
        let (base, index) = match name.split_once('_') {
            Some((base, index)) if !base.is_empty() && !index.is_empty() => (base, index),
            _ => (name, ""),
        };
        let letters = base.trim_end_matches(|c: char| c.is_ascii_digit());
        let one = letters.chars().count() == 1 || GREEK.iter().any(|(word, _)| *word == letters);
        let (base, digits) = if one { base.split_at(letters.len()) } else { (base, "") };
        let index = match (digits, index) {
            ("", index) => index.to_owned(),
            (digits, "") => digits.to_owned(),
            (digits, index) => format!("{digits} {index}"),
        };
        let mut characters = base.chars();
        let base = match (characters.next(), characters.next()) {
            (Some(c), None) if c.is_ascii_alphabetic() => c.to_string(),
            (Some(c), None) if greek(c).is_some() => format!(r"\{}", greek(c).unwrap_or_default()),
            _ if GREEK.iter().any(|(word, _)| *word == base) => format!(r"\{base}"),
            _ => upright(base),
        };
        let digits = index.bytes().all(|b| b.is_ascii_digit());
        Self { base, index: if digits { index } else { upright(&index) } }
    }

    /// With an accent (`\dot`, `\hat`) over the base, or none.
    pub(super) fn accented(&self, accents: &[&str]) -> String {
        let mut text = self.base.clone();
        for accent in accents {
            text = format!("{accent}{{{text}}}");
        }
        if !self.index.is_empty() {
            text = format!("{text}_{{{}}}", self.index);
        }
        text
    }
}

/// The symbol of a channel in mathematics mode: `\delta`, `n_{1}`, `\mathrm{rudder}`.
pub fn symbol(name: &str) -> String {
    Symbol::of(name).accented(&[])
}

fn greek(c: char) -> Option<&'static str> {
    GREEK.iter().find(|(_, letter)| *letter == c).map(|(word, _)| *word)
}

/// A word in an upright face, in a formula.
fn upright(word: &str) -> String {
    let plain = !word.is_empty() && word.bytes().all(|b| b.is_ascii_alphanumeric());
    if plain { format!(r"\mathrm{{{word}}}") } else { format!(r"\text{{{}}}", escaped(word)) }
}

/// Any text, for the text mode of LaTeX.
pub fn escaped(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        match c {
            '\\' => safe.push_str(r"\textbackslash{}"),
            '^' => safe.push_str(r"\textasciicircum{}"),
            '~' => safe.push_str(r"\textasciitilde{}"),
            '<' => safe.push_str(r"\textless{}"),
            '>' => safe.push_str(r"\textgreater{}"),
            '|' => safe.push_str(r"\textbar{}"),
            '"' => safe.push_str("''"),
            '{' | '}' | '$' | '&' | '#' | '_' | '%' => {
                safe.push('\\');
                safe.push(c);
            }
            c if c.is_control() => safe.push(' '),
            c => match greek(c) {
                Some(word) => safe.extend([r"\ensuremath{\", word, "}"]),
                None => safe.push(c),
            },
        }
    }
    safe
}

/// The magnitude of a number: `0.9070`, `1.234 \times 10^{-7}`.
pub(super) fn magnitude(x: f64, digits: usize) -> String {
    power_of_ten(&significant(x.abs(), digits))
}

/// The shortest form of a number, with its sign.
pub(super) fn shortest(x: f64) -> String {
    let plain = x == 0.0 || (1e-4..1e6).contains(&x.abs());
    power_of_ten(&if plain { format!("{x}") } else { format!("{x:e}") })
}

fn power_of_ten(text: &str) -> String {
    match text.split_once('e') {
        Some((mantissa, power)) => format!(r"{mantissa} \times 10^{{{power}}}"),
        None => text.to_owned(),
    }
}

/// A unit, in an upright face: `\mathrm{m}\,\mathrm{s}^{-2}`.
pub fn unit(unit: &UnitProduct) -> String {
    let factor = |(symbol, power): &(String, i32)| match power {
        1 => upright(symbol),
        power => format!("{}^{{{power}}}", upright(symbol)),
    };
    let factors: Vec<String> = unit.powers().iter().map(factor).collect();
    if factors.is_empty() { String::from("1") } else { factors.join(r"\,") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_symbols() {
        let text = |name: &str| Symbol::of(name).accented(&[]);
        for (name, expected) in [
            ("u", "u"),
            ("delta", r"\delta"),
            ("ψ", r"\psi"),
            ("P_f", r"P_{\mathrm{f}}"),
            ("delta_cmd", r"\delta_{\mathrm{cmd}}"),
            ("delta2", r"\delta_{2}"),
            ("u5_bow", r"u_{\text{5 bow}}"),
            ("wind_x", r"\mathrm{wind}_{\mathrm{x}}"),
            ("a_b_c", r"a_{\text{b\_c}}"),
            ("_", r"\text{\_}"),
            ("", r"\text{}"),
            (
                r"50% & {\x}^~#$",
                r"\text{50\% \& \{\textbackslash{}x\}\textasciicircum{}\textasciitilde{}\#\$}",
            ),
            ("a|b<\"c\">", r"\text{a\textbar{}b\textless{}''c''\textgreater{}}"),
            ("line\nbreak", r"\text{line break}"),
            ("Länge", r"\text{Länge}"),
            ("Δψ", r"\text{Δ\ensuremath{\psi}}"),
        ] {
            assert_eq!(text(name), expected, "{name}");
        }
        assert_eq!(Symbol::of("P_f").accented(&[r"\hat", r"\dot"]), r"\dot{\hat{P}}_{\mathrm{f}}");
    }

    #[test]
    fn numbers_have_powers_of_ten() {
        assert_eq!(magnitude(-0.907, 4), "0.9070");
        assert_eq!(magnitude(1.234_56e-7, 4), r"1.235 \times 10^{-7}");
        assert_eq!((shortest(-2.5), shortest(12.0), shortest(0.0)), ("-2.5".into(), "12".into(), "0".into()));
        assert_eq!(shortest(-3e300), r"-3 \times 10^{300}");
    }

    #[test]
    fn units_are_upright() {
        let coefficient = UnitProduct::of_channel("u", "m/s").per_second();
        assert_eq!(unit(&coefficient), r"\mathrm{m}\,\mathrm{s}^{-2}");
        assert_eq!(unit(&UnitProduct::of_channel("d", "rad")), "1");
        assert_eq!(unit(&UnitProduct::of_channel("n", "")), r"\text{[n]}");
    }
}
