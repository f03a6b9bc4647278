//! Names from hostile logs.

use hydroid_export::identifier;
use proptest::prelude::*;

proptest! {
    #[test]
    fn any_text_gives_an_identifier(text in "\\PC*") {
        let name = identifier(&text);
        prop_assert!(name.len() <= 49 && name.starts_with(|c: char| c.is_ascii_alphabetic()), "{name}");
        prop_assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{name}");
        prop_assert_eq!(identifier(&name), name);
    }
}
