//! Parser of terms.

use hydroid_core::model::sparse::{Factor, Gate, Real, Shape, Signal, Term};

use super::ExpressionParser;
use super::error::{ExpressionError, list, nearest};
use super::scanner::{Scanner, is_name_char};

const MOST_FACTORS: usize = 1_000;

const FACTOR: &str = "a factor such as u, u^2, |u| or sin(delta)";

const FUNCTIONS: [(&str, Shape); 4] =
    [("sin", Shape::Sin), ("cos", Shape::Cos), ("ln", Shape::Log), ("sgn", Shape::Sign)];

impl ExpressionParser {
    pub(super) fn product(&mut self, scanner: &mut Scanner<'_>) -> Result<Term, ExpressionError> {
        let mut factors = Vec::new();
        scanner.skip_space();
        self.factor(scanner, &mut factors)?;
        loop {
            if factors.len() > MOST_FACTORS {
                return Err(scanner.error(format!("more than {MOST_FACTORS} factors"), None));
            }
            let before = scanner.mark();
            scanner.skip_space();
            if scanner.eat("/") {
                scanner.skip_space();
                let variable = self.variable(scanner)?;
                let count = exponent(scanner)?;
                let over = Factor { variable, shape: Shape::Reciprocal };
                factors.extend(std::iter::repeat_n(over, usize::from(count)));
            } else if scanner.eat("*") || scanner.eat("·") {
                scanner.skip_space();
                self.factor(scanner, &mut factors)?;
            } else if scanner.peek().is_some_and(|c| is_name_char(c) || c == '|') || self.starts_name(scanner)
            {
                self.factor(scanner, &mut factors)?;
            } else {
                scanner.back_to(before);
                return Ok(Term::new(factors));
            }
        }
    }

    /// Whether a name with an unusual first character is next.
    fn starts_name(&self, scanner: &mut Scanner<'_>) -> bool {
        let mark = scanner.mark();
        let found = scanner.eat_name(&self.channels).is_some();
        scanner.back_to(mark);
        found
    }

    fn factor(
        &mut self,
        scanner: &mut Scanner<'_>,
        factors: &mut Vec<Factor>,
    ) -> Result<(), ExpressionError> {
        if scanner.eat("|") {
            scanner.skip_space();
            let variable = self.variable(scanner)?;
            scanner.demand("|", "'|'")?;
            return power(scanner, factors, Factor { variable, shape: Shape::Abs });
        }
        if scanner.word() == "1" && !self.channels.iter().any(|name| name == "1") {
            scanner.eat("1");
            return Ok(());
        }
        for (word, shape) in FUNCTIONS {
            if scanner.eat_call(word) {
                scanner.skip_space();
                let variable = self.variable(scanner)?;
                scanner.demand(")", "')'")?;
                return power(scanner, factors, Factor { variable, shape });
            }
        }
        for (word, shape) in [("above", Shape::Above as fn(Gate) -> Shape), ("below", Shape::Below)] {
            if scanner.eat_call(word) {
                scanner.skip_space();
                let variable = self.variable(scanner)?;
                scanner.demand(",", "',' and the centre of the gate")?;
                let centre = Real(scanner.number("the centre of the gate, a number")?);
                scanner.demand(",", "',' and the slope of the gate")?;
                let slope = Real(scanner.number("the slope of the gate, a number")?);
                scanner.demand(")", "')'")?;
                return power(scanner, factors, Factor { variable, shape: shape(Gate { centre, slope }) });
            }
        }
        let variable = self.variable(scanner)?;
        // An exponent replaces repeated factors.
        let n = exponent(scanner)?;
        factors.push(Factor { variable, shape: Shape::Power(n) });
        Ok(())
    }

    fn variable(&mut self, scanner: &mut Scanner<'_>) -> Result<u16, ExpressionError> {
        if scanner.eat_call("lag") {
            scanner.skip_space();
            let here = scanner.mark();
            let input = self.channel(scanner)?;
            if usize::from(input) < self.outputs {
                scanner.back_to(here);
                let name = &self.channels[usize::from(input)];
                return Err(
                    scanner.error(format!("'{name}' is an output; only inputs have lag states"), None)
                );
            }
            scanner.demand(",", "',' and the time constant, as in lag(n, 1.5 s)")?;
            scanner.skip_space();
            let here = scanner.mark();
            let seconds = scanner.number("a time constant such as 1.5 s")?;
            // Rounded as in names.
            let seconds = (seconds * 1e3).round() / 1e3;
            if !(1e-3..=1e6).contains(&seconds) {
                scanner.back_to(here);
                return Err(scanner.expected("a time constant from 0.001 to 1000000 s"));
            }
            scanner.demand("s", "'s', for seconds")?;
            scanner.demand(")", "')'")?;
            let time_constant_s = Real(seconds);
            return self.signal(Signal::Lag { input, time_constant_s }, scanner);
        }
        let variable = self.channel(scanner)?;
        if !scanner.eat("(") {
            return Ok(variable);
        }
        scanner.skip_space();
        let here = scanner.mark();
        let seconds = scanner.number("a time before now, as in u(-0.5 s)")?;
        let samples = (-seconds / self.dt).round();
        // Times in names have a resolution of one millisecond.
        let exact = (samples * self.dt + seconds).abs() <= 6e-4 + 1e-6 * seconds.abs();
        if !((1.0..=f64::from(u16::MAX)).contains(&samples) && exact) {
            scanner.back_to(here);
            return Err(scanner.error(
                format!(
                    "the delay of a past value is a multiple of the sample time of {} s, at least one: write it as a negative time",
                    self.dt
                ),
                None,
            ));
        }
        scanner.demand("s", "'s', for seconds")?;
        scanner.demand(")", "')'")?;
        // Within the range of the type (checked above).
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = samples as u16;
        self.signal(Signal::Past { variable, samples }, scanner)
    }

    fn channel(&self, scanner: &mut Scanner<'_>) -> Result<u16, ExpressionError> {
        let Some(found) = scanner.eat_name(&self.channels) else {
            let word = scanner.word();
            if word.is_empty() || word.parse::<f64>().is_ok() {
                return Err(scanner.expected(FACTOR));
            }
            let (what, known): (_, Vec<&str>) = if scanner.rest()[word.len()..].starts_with('(') {
                let functions = FUNCTIONS.iter().map(|(name, _)| *name);
                ("function or channel", functions.chain(["above", "below", "lag"]).collect())
            } else {
                ("channel", Vec::new())
            };
            let near = nearest(word, self.channels.iter().map(String::as_str).chain(known));
            let hint =
                near.as_ref().map_or_else(|| String::from("."), |name| format!(", did you mean '{name}'?"));
            let reason = format!("there is no {what} '{word}'{hint} There are {}", list(&self.channels));
            return Err(scanner.error(reason, near));
        };
        u16::try_from(found)
            .map_err(|_| scanner.error(String::from("more channels than terms can name"), None))
    }

    fn signal(&mut self, signal: Signal, scanner: &Scanner<'_>) -> Result<u16, ExpressionError> {
        let place = self.signals.iter().position(|known| *known == signal).unwrap_or_else(|| {
            self.signals.push(signal);
            self.signals.len() - 1
        });
        u16::try_from(self.channels.len() + place)
            .map_err(|_| scanner.error(String::from("more signals than terms can name"), None))
    }
}

fn exponent(scanner: &mut Scanner<'_>) -> Result<u8, ExpressionError> {
    let before = scanner.mark();
    scanner.skip_space();
    if !scanner.eat("^") {
        scanner.back_to(before);
        return Ok(1);
    }
    scanner.skip_space();
    let digits = scanner.rest();
    let digits = &digits[..digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len())];
    match digits.parse::<u8>() {
        Ok(n) if n > 0 => {
            scanner.eat(digits);
            Ok(n)
        }
        _ => Err(scanner.expected("an exponent from 1 to 255")),
    }
}

fn power(
    scanner: &mut Scanner<'_>,
    factors: &mut Vec<Factor>,
    factor: Factor,
) -> Result<(), ExpressionError> {
    let n = exponent(scanner)?;
    factors.extend(std::iter::repeat_n(factor, usize::from(n)));
    Ok(())
}
