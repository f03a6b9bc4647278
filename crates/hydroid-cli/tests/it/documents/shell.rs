//! Commands of a shell as words: as much of its syntax as the documents use.

use std::collections::HashMap;

/// Values of variables that a page assigned. A variable without a value stands for a name or a number.
#[derive(Default)]
pub(super) struct Variables(HashMap<String, String>);

const UNKNOWN: &str = "1";

impl Variables {
    fn value(&self, name: &str) -> &str {
        self.0.get(name).map_or(UNKNOWN, String::as_str)
    }
}

/// A word while it is read: `None` before its first character.
struct Words {
    commands: Vec<Vec<String>>,
    word: Option<String>,
    /// The next word is the file of a redirection.
    redirected: bool,
}

impl Words {
    fn push(&mut self, text: &str) {
        self.word.get_or_insert_default().push_str(text);
    }

    /// Ends a word.
    fn end(&mut self, variables: &mut Variables) {
        let Some(word) = self.word.take() else { return };
        if std::mem::take(&mut self.redirected) {
            return;
        }
        let command = self.commands.last_mut().expect("one command at least");
        let assignment = word.split_once('=').filter(|(name, _)| {
            command.is_empty()
                && !name.is_empty()
                && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        });
        if let Some((name, value)) = assignment {
            variables.0.insert(name.to_owned(), value.to_owned());
            return;
        }
        if let ["for", name, "in"] = command.iter().map(String::as_str).collect::<Vec<_>>()[..] {
            variables.0.insert(name.to_owned(), word.clone());
        }
        let prefix =
            ["do", "then", "else", "time", "$", "if", "while", "nohup", "done"].contains(&word.as_str());
        if !(prefix && command.is_empty()) {
            command.push(word);
        }
    }

    /// Ends a command.
    fn next(&mut self, variables: &mut Variables) {
        self.end(variables);
        self.commands.push(Vec::new());
    }
}

/// The simple commands of a script, with the values of variables in place of their names.
pub(super) fn commands(script: &str, variables: &mut Variables) -> Vec<Vec<String>> {
    let mut words = Words { commands: vec![Vec::new()], word: None, redirected: false };
    let mut rest = script.chars().peekable();
    let mut quoted = false;
    while let Some(c) = rest.next() {
        match c {
            '\'' if !quoted => words.push(&rest.by_ref().take_while(|c| *c != '\'').collect::<String>()),
            '"' => {
                quoted = !quoted;
                words.push("");
            }
            '\\' => match rest.next() {
                Some('\n') | None => {}
                Some(c) => words.push(&c.to_string()),
            },
            '$' if rest.next_if_eq(&'(').is_some() => {
                let mut depth = 1;
                while depth > 0 {
                    match rest.next() {
                        Some('(') => depth += 1,
                        Some(')') => depth -= 1,
                        Some(_) => {}
                        None => break,
                    }
                }
                words.push(UNKNOWN);
            }
            '$' => {
                let name: String = if rest.next_if_eq(&'{').is_some() {
                    rest.by_ref().take_while(|c| *c != '}').collect()
                } else {
                    std::iter::from_fn(|| rest.next_if(|c| c.is_ascii_alphanumeric() || *c == '_')).collect()
                };
                if name.is_empty() {
                    words.push("$");
                    continue;
                }
                let value = variables.value(&name).to_owned();
                // An unquoted value is split at its blanks.
                for (i, part) in value.split_whitespace().enumerate() {
                    if i > 0 && !quoted {
                        words.end(variables);
                    } else if i > 0 {
                        words.push(" ");
                    }
                    words.push(part);
                }
            }
            c if quoted => words.push(&c.to_string()),
            '#' if words.word.is_none() => while rest.next_if(|c| *c != '\n').is_some() {},
            '\n' | ';' | '|' | '&' | '(' | ')' => words.next(variables),
            '>' | '<' => {
                // The number of a stream, as in 2>.
                words.word = words.word.take().filter(|word| word.parse::<u8>().is_err());
                words.end(variables);
                while rest.next_if(|c| matches!(c, '>' | '&')).is_some() {}
                words.redirected = true;
            }
            c if c.is_whitespace() => words.end(variables),
            c => words.push(&c.to_string()),
        }
    }
    words.next(variables);
    words.commands.retain(|command| !command.is_empty());
    words.commands
}

#[test]
fn scripts_are_read() {
    let script = "A='x y'; B=2\nfor s in 1 2; do # comment\n  hydroid a \"$A\" $A --seed $s \\\n  -o out 2>&1 | head\ndone > z";
    let read = commands(script, &mut Variables::default());
    let read: Vec<String> = read.iter().map(|words| words.join(",")).collect();
    assert_eq!(read, ["for,s,in,1,2", "hydroid,a,x y,x,y,--seed,1,-o,out", "head"]);
}
