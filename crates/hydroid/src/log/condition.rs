//! Conditions on the columns of a log, as in `MODE.Mode == 10 && armed`.

use std::fmt;
use std::str::FromStr;

use super::error::LogError;

/// Deepest nesting of a condition.
const DEEPEST: usize = 32;

/// A condition on columns, by their values in the units of the log: comparisons (`==`, `!=`, `<`, `<=`, `>`, `>=`) of a column
/// with a number, combined with `&&`, `||`, `!` (or `and`, `or`, `not`) and parentheses. A column alone holds where it is
/// not zero. The name of a column with blanks or operators is in quotes. A missing value is the one before; before the
/// first value, no comparison of the column holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Condition {
    text: String,
    node: Node,
}

#[derive(Clone, Debug, PartialEq)]
enum Node {
    Compare { column: String, by: Order, number: f64 },
    Not(Box<Node>),
    All(Vec<Node>),
    Any(Vec<Node>),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    Equal,
    Unequal,
    Below,
    AtMost,
    Above,
    AtLeast,
}

/// The longest come first.
const ORDERS: [(&str, Order); 6] = [
    ("==", Order::Equal),
    ("!=", Order::Unequal),
    ("<=", Order::AtMost),
    (">=", Order::AtLeast),
    ("<", Order::Below),
    (">", Order::Above),
];

impl Condition {
    /// Names of its columns, in its order.
    pub(crate) fn columns(&self) -> Vec<&str> {
        fn add<'a>(node: &'a Node, names: &mut Vec<&'a str>) {
            match node {
                Node::Compare { column, .. } => names.push(column),
                Node::Not(inner) => add(inner, names),
                Node::All(all) | Node::Any(all) => all.iter().for_each(|inner| add(inner, names)),
            }
        }
        let mut names = Vec::new();
        add(&self.node, &mut names);
        names
    }

    /// Whether it holds for values of columns. A value that is not known is NaN: neither a comparison with it nor the
    /// opposite holds.
    pub(crate) fn holds(&self, names: &[String], values: &[f64]) -> bool {
        let value =
            |column: &str| names.iter().position(|name| name == column).map_or(f64::NAN, |at| values[at]);
        self.node.holds(&value) == Some(true)
    }
}

impl Node {
    /// `None` if it depends on a value that is not known.
    fn holds(&self, value: &dyn Fn(&str) -> f64) -> Option<bool> {
        match self {
            Self::Compare { column, by, number } => {
                let x = value(column);
                (!x.is_nan()).then_some(match by {
                    Order::Equal => x == *number,
                    Order::Unequal => x != *number,
                    Order::Below => x < *number,
                    Order::AtMost => x <= *number,
                    Order::Above => x > *number,
                    Order::AtLeast => x >= *number,
                })
            }
            Self::Not(inner) => inner.holds(value).map(|holds| !holds),
            Self::All(all) => decided(all, value, false),
            Self::Any(all) => decided(all, value, true),
        }
    }
}

/// The value of several conditions, which one with the value `by` decides.
fn decided(all: &[Node], value: &dyn Fn(&str) -> f64, by: bool) -> Option<bool> {
    let mut known = Some(!by);
    for node in all {
        match node.holds(value) {
            Some(holds) if holds == by => return Some(by),
            Some(_) => {}
            None => known = None,
        }
    }
    known
}

impl FromStr for Condition {
    type Err = LogError;

    fn from_str(text: &str) -> Result<Self, LogError> {
        let mut parser = Parser { rest: text, depth: 0 };
        let node = parser.any().and_then(|node| match parser.rest.trim_start() {
            "" => Ok(node),
            rest => Err(format!("`{rest}` does not belong to it")),
        });
        let node = node.map_err(|reason| LogError::BadOption {
            what: "a condition",
            value: format!("`{text}`"),
            reason: format!("{reason}; write comparisons of columns with numbers, as in mode == 10 && (armed || speed > 0.5)"),
        })?;
        Ok(Self { text: text.trim().to_owned(), node })
    }
}

/// What is left of a text.
struct Parser<'a> {
    rest: &'a str,
    depth: usize,
}

impl Parser<'_> {
    fn any(&mut self) -> Result<Node, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err("it is nested too deeply".to_owned());
        }
        let mut all = vec![self.all()?];
        while self.take("||") || self.take_word("or") {
            all.push(self.all()?);
        }
        self.depth -= 1;
        Ok(if all.len() == 1 { all.swap_remove(0) } else { Node::Any(all) })
    }

    fn all(&mut self) -> Result<Node, String> {
        let mut all = vec![self.one()?];
        while self.take("&&") || self.take_word("and") {
            all.push(self.one()?);
        }
        Ok(if all.len() == 1 { all.swap_remove(0) } else { Node::All(all) })
    }

    fn one(&mut self) -> Result<Node, String> {
        let mut is_opposite = false;
        while self.take("!") || self.take_word("not") {
            is_opposite = !is_opposite;
        }
        let node = if self.take("(") {
            let inner = self.any()?;
            if !self.take(")") {
                return Err("a parenthesis is not closed".to_owned());
            }
            inner
        } else {
            self.comparison()?
        };
        Ok(if is_opposite { Node::Not(Box::new(node)) } else { node })
    }

    fn comparison(&mut self) -> Result<Node, String> {
        let column = self.name()?;
        let Some((_, by)) = ORDERS.iter().find(|(sign, _)| self.take(sign)) else {
            if self.rest.trim_start().starts_with('=') {
                return Err("equality is written ==".to_owned());
            }
            return Ok(Node::Compare { column, by: Order::Unequal, number: 0.0 });
        };
        let rest = self.rest.trim_start();
        let end = rest.find(|c: char| c.is_whitespace() || "&|)".contains(c)).unwrap_or(rest.len());
        let (number, rest) = rest.split_at(end);
        self.rest = rest;
        let value = match number.to_ascii_lowercase().as_str() {
            "true" => Some(1.0),
            "false" => Some(0.0),
            text => text.parse::<f64>().ok().filter(|x| x.is_finite()),
        };
        let number =
            value.ok_or_else(|| format!("`{number}` after the column `{column}` is not a number"))?;
        Ok(Node::Compare { column, by: *by, number })
    }

    /// The name of a column, bare or in quotes.
    fn name(&mut self) -> Result<String, String> {
        let rest = self.rest.trim_start();
        if let Some(quote) = rest.chars().next().filter(|c| "'\"`".contains(*c)) {
            let (name, rest) =
                rest[1..].split_once(quote).ok_or_else(|| "a quote is not closed".to_owned())?;
            self.rest = rest;
            return Ok(name.to_owned());
        }
        let end = rest.find(|c: char| c.is_whitespace() || "&|!<>=()".contains(c)).unwrap_or(rest.len());
        let (name, rest) = rest.split_at(end);
        if name.is_empty() {
            return Err("the name of a column is missing".to_owned());
        }
        self.rest = rest;
        Ok(name.to_owned())
    }

    fn take(&mut self, sign: &str) -> bool {
        let rest = self.rest.trim_start().strip_prefix(sign);
        // `!=` compares.
        let rest = rest.filter(|rest| sign != "!" || !rest.starts_with('='));
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn take_word(&mut self, word: &str) -> bool {
        let rest = self.rest.trim_start();
        let found = rest.get(..word.len()).is_some_and(|front| front.eq_ignore_ascii_case(word))
            && rest[word.len()..].starts_with(|c: char| c.is_whitespace() || c == '(');
        if found {
            self.rest = &rest[word.len()..];
        }
        found
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl TryFrom<String> for Condition {
    type Error = LogError;

    fn try_from(text: String) -> Result<Self, LogError> {
        text.parse()
    }
}

impl From<Condition> for String {
    fn from(condition: Condition) -> Self {
        condition.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(text: &str, values: &[(&str, f64)]) -> bool {
        let (names, values): (Vec<_>, Vec<_>) = values.iter().map(|(n, x)| ((*n).to_owned(), *x)).unzip();
        text.parse::<Condition>().unwrap().holds(&names, &values)
    }

    #[test]
    fn comparisons_are_combined() {
        let at = [("MODE.Mode", 10.0), ("armed", 1.0), ("u", -0.5), ("Engine 1", 3.0), ("gone", f64::NAN)];
        for text in [
            "MODE.Mode == 10 && armed",
            "MODE.Mode==10&&armed",
            "mode > 3 || u < -0.4",
            "not (u >= 0) and 'Engine 1' != 2.5",
            "!(u>=0)&&`Engine 1`<=3",
            "armed == true",
            "MODE.Mode == 11 or armed and u < 0",
            "gone > 1 || armed",
        ] {
            assert!(holds(text, &at), "{text}");
        }
        for text in ["armed && u > 0", "!armed", "!u"] {
            assert!(!holds(text, &at), "{text}");
        }
        // Neither a comparison with an unknown value nor its opposite holds.
        for text in ["gone > 1", "!(gone > 1)", "gone <= 1", "armed && gone == 0", "unheard"] {
            assert!(!holds(text, &at), "{text}");
        }
    }

    #[test]
    fn what_is_no_condition_is_an_error() {
        for (text, said) in [
            ("", "missing"),
            ("a = 3", "=="),
            ("a == b", "not a number"),
            ("(a > 1", "not closed"),
            ("a > 1)", "does not belong"),
            ("a b", "does not belong"),
            ("'a > 1", "quote"),
            ("a > 1 &&", "missing"),
            (&"(".repeat(100), "deeply"),
        ] {
            let error = text.parse::<Condition>().unwrap_err().to_string();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
