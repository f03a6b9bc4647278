//! Names of channels as identifiers of programming languages.

/// Words that C, C++ or Python reserve, or that generated code uses.
const RESERVED: &[&str] = &[
    "alignas", "alignof", "and", "as", "asm", "assert", "async", "auto", "await", "bool", "break", "case", "catch",
    "char", "class", "const", "continue", "def", "default", "del", "delete", "do", "double", "elif", "else", "enum",
    "except", "extern", "false", "finally", "float", "for", "friend", "from", "global", "goto", "if", "import", "in",
    "inline", "int", "is", "lambda", "long", "main", "namespace", "new", "nonlocal", "not", "operator", "or", "pass",
    "private", "protected", "public", "raise", "register", "restrict", "return", "short", "signed", "sizeof", "static",
    "struct", "switch", "template", "this", "throw", "true", "try", "typedef", "typename", "union", "unsigned", "using",
    "virtual", "void", "volatile", "while", "with", "xor", "yield",
];

/// A name as an identifier: ASCII letters, digits and single underscores, at most 48 characters, first a letter. Other
/// characters become underscores; a reserved word gets one more letter. Any text gives a valid identifier; different texts
/// can give the same one.
///
/// ```
/// assert_eq!(hydroid_export::identifier("rudder angle [deg]"), "rudder_angle_deg");
/// assert_eq!(hydroid_export::identifier("*/ system(\"rm\");"), "system_rm");
/// assert_eq!(hydroid_export::identifier("3"), "x3");
/// ```
pub fn identifier(text: &str) -> String {
    const LONGEST: usize = 48;
    let mut name = String::new();
    for c in text.chars() {
        if name.len() >= LONGEST {
            break;
        }
        if c.is_ascii_alphanumeric() {
            name.push(c);
        } else if !name.is_empty() && !name.ends_with('_') {
            name.push('_');
        }
    }
    let name = name.trim_end_matches('_');
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || RESERVED.contains(&name.to_ascii_lowercase().as_str()) {
        return format!("x{name}");
    }
    name.to_owned()
}

/// Identifiers of several names: equal ones are numbered from the second on.
pub(crate) fn identifiers<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    let mut taken: Vec<String> = Vec::new();
    for name in names {
        let base = identifier(name);
        let mut candidate = base.clone();
        let mut count = 1;
        while taken.iter().any(|other| other.eq_ignore_ascii_case(&candidate)) {
            count += 1;
            candidate = format!("{base}_{count}");
        }
        taken.push(candidate);
    }
    taken
}

/// Text for a comment of one line, in any language: printable ASCII without the characters that end comments or strings in C,
/// Python, XML or LaTeX.
pub(crate) fn comment(text: &str) -> String {
    let safe = |c: char| if c.is_ascii_graphic() && !"*\\<>\"'`&${}~?".contains(c) || c == ' ' { c } else { '_' };
    text.chars().take(200).map(safe).collect()
}
