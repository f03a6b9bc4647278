//! The reader of terms and constraints on arbitrary text: `cargo +nightly fuzz run expression`. What is read
//! as a term must be printed as one that reads the same.
#![no_main]

use hydroid::sindy::expression::Vocabulary;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let mut words = Vocabulary::new(["u", "v", "r", "n", "delta", "wind_x", "a.b [c]"], 3, 0.1);
    let _ = words.constraint(text);
    if let Ok(term) = words.term(text) {
        let name = term.name(&words.names());
        assert_eq!(words.term(&name), Ok(term), "{name}");
    }
});
