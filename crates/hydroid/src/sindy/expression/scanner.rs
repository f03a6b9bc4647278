//! Scanner of expressions.

use super::error::ExpressionError;

pub(super) struct Scanner<'a> {
    text: &'a str,
    at: usize,
}

pub(super) fn is_name_char(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '.')
}

impl<'a> Scanner<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { text, at: 0 }
    }

    pub(super) fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.at == self.text.len()
    }

    pub(super) fn mark(&self) -> usize {
        self.at
    }

    pub(super) fn back_to(&mut self, mark: usize) {
        self.at = mark;
    }

    pub(super) fn skip_space(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    pub(super) fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    pub(super) fn eat(&mut self, text: &str) -> bool {
        let is_here = self.rest().starts_with(text);
        if is_here {
            self.at += text.len();
        }
        is_here
    }

    pub(super) fn demand(&mut self, text: &str, what: &str) -> Result<(), ExpressionError> {
        self.skip_space();
        if self.eat(text) { Ok(()) } else { Err(self.expected(what)) }
    }

    /// Consumes `word(`, the start of a function, if it is next.
    pub(super) fn eat_call(&mut self, word: &str) -> bool {
        let call = self.rest().strip_prefix(word).and_then(|rest| rest.strip_prefix('('));
        // `sin(-0.5 s)` is a past value of a channel with the name `sin`.
        let is_call = call.is_some_and(|inside| !inside.trim_start().starts_with('-'));
        if is_call {
            self.at += word.len() + 1;
        }
        is_call
    }

    /// The longest of the names that is next as a complete word.
    pub(super) fn eat_name(&mut self, names: &[String]) -> Option<usize> {
        let rest = self.rest();
        let stands = |name: &str| {
            rest.strip_prefix(name).is_some_and(|after| {
                let ends_in_word = name.chars().next_back().is_some_and(is_name_char);
                !(name.is_empty() || ends_in_word && after.starts_with(is_name_char))
            })
        };
        let found = (0..names.len()).filter(|&i| stands(&names[i]));
        // The first of equal names.
        let longest = found.max_by_key(|&i| (names[i].len(), std::cmp::Reverse(i)))?;
        self.at += names[longest].len();
        Some(longest)
    }

    pub(super) fn word(&self) -> &'a str {
        let rest = self.rest();
        &rest[..rest.find(|c| !is_name_char(c)).unwrap_or(rest.len())]
    }

    pub(super) fn number(&mut self, what: &str) -> Result<f64, ExpressionError> {
        self.skip_space();
        self.eat_number().ok_or_else(|| self.expected(what))
    }

    /// A finite number, if it is next: digits with sign, point and exponent.
    pub(super) fn eat_number(&mut self) -> Option<f64> {
        let bytes = self.rest().as_bytes();
        let mut end = 0;
        let digits = |mut at: usize| {
            while bytes.get(at).is_some_and(u8::is_ascii_digit) {
                at += 1;
            }
            at
        };
        if matches!(bytes.first(), Some(b'+' | b'-')) {
            end += 1;
        }
        end = digits(end);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let after = digits(end + 1 + sign);
            if after > end + 1 + sign {
                end = after;
            }
        }
        let value: f64 = self.rest()[..end].parse().ok()?;
        if !value.is_finite() {
            return None;
        }
        self.at += end;
        Some(value)
    }

    pub(super) fn error(&self, reason: String, nearest: Option<String>) -> ExpressionError {
        let position = self.text[..self.at].chars().count() + 1;
        ExpressionError { text: self.text.to_owned(), position, reason, nearest }
    }

    pub(super) fn expected(&self, what: &str) -> ExpressionError {
        let found = match self.peek() {
            None => String::from("the end"),
            Some(c) if is_name_char(c) => format!("'{}'", self.word()),
            Some(c) => format!("'{c}'"),
        };
        self.error(format!("expected {what}, found {found}"), None)
    }
}
