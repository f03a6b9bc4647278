//! The reader of terms and constraints on arbitrary text: `cargo +nightly fuzz run expression`. What is read
//! as a term must be printed as one that reads the same.
#![no_main]

use hydroid::sindy::expression::ExpressionParser;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let mut parser = ExpressionParser::new(["u", "v", "r", "n", "delta", "wind_x", "a.b [c]"], 3, 0.1);
    let _ = parser.constraint(text);
    if let Ok(term) = parser.term(text) {
        let name = term.name(&parser.names());
        assert_eq!(parser.term(&name), Ok(term), "{name}");
    }
});
