//! Definitions of messages in OMG IDL (IDL 4.2, section 7.4), as far as ROS 2 uses it: modules, structs, enumerations,
//! typedefs, sequences and arrays. MCAP ("Appendix: `ros2idl`") stores the files one behind another.

use std::collections::HashMap;

use super::schema::{Count, Member, RosNumber, Schema, Type, check_name, cut, short};

/// Modules within modules.
const DEEPEST: usize = 16;

/// Reads IDL files, which follow each other behind lines of `=` and `IDL: name`.
pub(crate) fn parse(type_name: &str, text: &str) -> Result<Schema, String> {
    check_name(type_name.trim())?;
    let schema = Schema { root: short(type_name), ros1: false, types: HashMap::new() };
    let mut reader =
        Reader { tokens: tokens(text), at: 0, scope: Vec::new(), constants: HashMap::new(), schema };
    while reader.peek().is_some() {
        reader.declaration()?;
    }
    Ok(reader.schema)
}

/// Words and signs without comments, annotations' texts, preprocessor lines and separators.
fn tokens(text: &str) -> Vec<&str> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut at = 0;
    let mut line_start = true;
    while let Some(&byte) = bytes.get(at) {
        let rest = &text[at..];
        let whole_line = line_start && (byte == b'#' || rest.starts_with("====") || rest.starts_with("IDL:"));
        let length = if whole_line || rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if byte == b'"' || byte == b'\'' {
            let length = quoted(rest.as_bytes());
            tokens.push("\"");
            length
        } else if byte.is_ascii_whitespace() {
            1
        } else {
            let word =
                rest.find(|c: char| !(c.is_alphanumeric() || matches!(c, '_' | ':' | '.' | '-' | '+')));
            // A colon of its own separates nothing that is needed; a sign is one token.
            let first = rest.chars().next().map_or(1, char::len_utf8);
            let length = word.unwrap_or(rest.len()).max(first);
            tokens.push(&rest[..length]);
            length
        };
        line_start = byte == b'\n' || (line_start && byte.is_ascii_whitespace());
        at += length;
    }
    tokens
}

/// Length of a quoted text with its quotes; a backslash protects the next byte.
fn quoted(text: &[u8]) -> usize {
    let mut at = 1;
    while let Some(&byte) = text.get(at) {
        match byte {
            b'\\' => at += 2,
            _ if byte == text[0] => return at + 1,
            _ => at += 1,
        }
    }
    text.len()
}

struct Reader<'a> {
    tokens: Vec<&'a str>,
    at: usize,
    scope: Vec<String>,
    constants: HashMap<String, u32>,
    schema: Schema,
}

impl<'a> Reader<'a> {
    fn peek(&self) -> Option<&'a str> {
        self.tokens.get(self.at).copied()
    }

    fn next(&mut self) -> Result<&'a str, String> {
        let token = self.peek().ok_or("the definition ends in the middle")?;
        self.at += 1;
        Ok(token)
    }

    fn accept(&mut self, token: &str) -> bool {
        let found = self.peek() == Some(token);
        self.at += usize::from(found);
        found
    }

    fn expect(&mut self, token: &str) -> Result<(), String> {
        let found = self.next()?;
        if found == token {
            return Ok(());
        }
        Err(format!("the definition has '{}' where '{token}' belongs", cut(found)))
    }

    /// Skips to the end of a pair of brackets whose first has been read.
    fn skip_brackets(&mut self, open: &str, close: &str) -> Result<(), String> {
        let mut depth = 1;
        while depth > 0 {
            let token = self.next()?;
            depth += usize::from(token == open);
            depth -= usize::from(token == close);
        }
        Ok(())
    }

    fn annotations(&mut self) -> Result<(), String> {
        while self.accept("@") {
            self.next()?;
            if self.accept("(") {
                self.skip_brackets("(", ")")?;
            }
        }
        Ok(())
    }

    fn full_name(&self, name: &str) -> Result<String, String> {
        check_name(name)?;
        // Modules named `msg` are left out of all names.
        let outer: Vec<&str> =
            self.scope.iter().map(String::as_str).filter(|module| *module != "msg").collect();
        Ok(if outer.is_empty() { name.to_owned() } else { format!("{}/{name}", outer.join("/")) })
    }

    fn declaration(&mut self) -> Result<(), String> {
        self.annotations()?;
        match self.next()? {
            ";" => {}
            "}" => {
                self.scope.pop();
            }
            "module" => {
                let name = self.next()?;
                check_name(name)?;
                if self.scope.len() >= DEEPEST {
                    return Err("modules of the definition are nested too deep".to_owned());
                }
                self.scope.push(name.to_owned());
                self.expect("{")?;
            }
            "struct" => self.structure()?,
            "enum" => {
                let name = self.next()?;
                let name = self.full_name(name)?;
                self.expect("{")?;
                self.skip_brackets("{", "}")?;
                self.schema.define(&name, vec![member("", Type::Number(RosNumber::U32), Count::One)]);
            }
            "typedef" => {
                let (of, count) = self.type_of_member()?;
                for member in self.declarators(&of, count)? {
                    let name = self.full_name(&member.name)?;
                    self.schema.define(&name, vec![Member { name: String::new(), ..member }]);
                }
            }
            "const" => {
                let start = self.at;
                while self.next()? != ";" {}
                if let [.., name, "=", value, ";"] = self.tokens[start..self.at]
                    && let Ok(value) = value.parse()
                {
                    self.constants.insert(name.to_owned(), value);
                }
            }
            other => return Err(format!("'{}' of IDL is not supported", cut(other))),
        }
        Ok(())
    }

    fn structure(&mut self) -> Result<(), String> {
        let name = self.next()?;
        let name = self.full_name(name)?;
        if self.accept(":") {
            return Err("structs with a base are not supported".to_owned());
        }
        self.expect("{")?;
        let mut members = Vec::new();
        loop {
            self.annotations()?;
            if self.accept("}") {
                break;
            }
            let (of, count) = self.type_of_member()?;
            members.extend(self.declarators(&of, count)?);
        }
        self.schema.define(&name, members);
        Ok(())
    }

    /// Names behind a type, each perhaps with lengths of an array, up to the semicolon.
    fn declarators(&mut self, of: &Type, count: Count) -> Result<Vec<Member>, String> {
        let mut members = Vec::new();
        loop {
            self.annotations()?;
            let name = self.next()?;
            check_name(name)?;
            let mut count = count;
            while self.accept("[") {
                let length = self.next()?;
                let length = length.parse().ok().or_else(|| self.constants.get(length).copied());
                let length: u32 = length.ok_or("an array of the definition has no length")?;
                count = match count {
                    Count::One => Count::Fixed(length),
                    Count::Fixed(n) => Count::Fixed(n.checked_mul(length).ok_or("an array is too long")?),
                    Count::Any => return Err("arrays of sequences are not supported".to_owned()),
                };
                self.expect("]")?;
            }
            members.push(member(name, of.clone(), count));
            if self.accept(";") {
                return Ok(members);
            }
            self.expect(",")?;
        }
    }

    fn type_of_member(&mut self) -> Result<(Type, Count), String> {
        if !self.accept("sequence") {
            return Ok((self.simple_type()?, Count::One));
        }
        self.expect("<")?;
        let of = self.simple_type()?;
        if self.accept(",") {
            self.next()?;
        }
        self.expect(">")?;
        Ok((of, Count::Any))
    }

    fn simple_type(&mut self) -> Result<Type, String> {
        let word = self.next()?;
        let unsigned = word == "unsigned";
        let word = if unsigned { self.next()? } else { word };
        Ok(Type::Number(match word {
            "boolean" => RosNumber::Bool,
            "octet" | "char" => RosNumber::U8,
            "short" if unsigned => RosNumber::U16,
            "short" => RosNumber::I16,
            "long" if self.accept("double") => return Ok(Type::Unreadable("long double".to_owned())),
            "long" => match (self.accept("long"), unsigned) {
                (true, true) => RosNumber::U64,
                (true, false) => RosNumber::I64,
                (false, true) => RosNumber::U32,
                (false, false) => RosNumber::I32,
            },
            "float" => RosNumber::F32,
            "double" => RosNumber::F64,
            "string" | "wstring" => {
                if self.accept("<") {
                    self.skip_brackets("<", ">")?;
                }
                return Ok(if word == "string" { Type::Text } else { Type::Unreadable(word.to_owned()) });
            }
            "wchar" | "any" | "map" | "fixed" => return Ok(Type::Unreadable(word.to_owned())),
            "sequence" => return Err("sequences of sequences are not supported".to_owned()),
            other => {
                if let Some(kind) = RosNumber::of_ros(other, false) {
                    kind
                } else {
                    check_name(other)?;
                    return Ok(Type::Named(other.to_owned()));
                }
            }
        }))
    }
}

fn member(name: &str, of: Type, count: Count) -> Member {
    Member { name: name.to_owned(), of, count }
}
