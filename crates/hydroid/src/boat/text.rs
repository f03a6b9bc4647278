//! A boat as text.

use std::fmt::Write as _;

use super::{Boat, Evidence, Property};
use crate::toml_file::key;

impl Boat {
    /// The sections `[boat.inputs.NAME]` of `hydroid.toml` in the order of the inputs, each given with the column of its
    /// raw values. The evidence of each value is a comment.
    pub fn to_toml<'a>(&self, inputs: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
        let mut text = String::new();
        for (name, column) in inputs {
            let Some(input) = self.inputs.get(name) else { continue };
            let _ = writeln!(text, "\n[boat.inputs.{}] # {column}", key(name));
            let mut line = |property: Option<Property>, value: Option<String>| {
                let Some(value) = value else { return };
                let why = property.and_then(|property| input.found.get(&property));
                let _ = match why {
                    Some(evidence) => writeln!(text, "{value:<21} # {evidence}"),
                    None => writeln!(text, "{value}"),
                };
            };
            line(Some(Property::Role), input.role.map(|role| format!("role = \"{role}\"")));
            line(
                None,
                input.unit.as_ref().map(|unit| format!("unit = {}", toml::Value::from(unit.as_str()))),
            );
            line(Some(Property::Neutral), input.neutral.map(|neutral| format!("neutral = {neutral}")));
            line(Some(Property::Limits), input.limits.map(|[low, high]| format!("limits = [{low}, {high}]")));
            line(Some(Property::Scale), input.scale.map(|scale| format!("scale = {scale}")));
            if let Some(Evidence::Log(found)) = input.found.get(&Property::Neutral) {
                let found = toml::Value::from(found.as_str());
                let _ = writeln!(
                    text,
                    "# Nothing states the neutral value: no vessel is commanded with it until this line is removed.\nfound = {{ neutral = {{ log = {found} }} }}"
                );
            }
        }
        text
    }
}
