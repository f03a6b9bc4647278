//! What options are: names, types, texts and defaults, for front ends that are no command line.

use std::any::TypeId;
use std::path::PathBuf;

use clap::{Arg, ArgAction, Args, Command};
use serde::Serialize;

use super::{Duration, Horizon};
use crate::boat::StatedRoles;
use crate::identify::GivenRange;

/// An option.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct OptionText {
    /// Key.
    pub key: String,
    /// Kind of its values in words: `float`, `sequence of 2 floats`, `mapping of str to float`.
    pub kind: String,
    /// Names that the value can be, with what they mean.
    pub choices: Vec<(String, String)>,
    /// What it is, with its default.
    pub text: String,
}

/// The options of a type.
pub fn options_of<A: Args>() -> Vec<OptionText> {
    let command = A::augment_args(Command::new("options"));
    command.get_arguments().map(described).collect()
}

fn described(arg: &Arg) -> OptionText {
    let choices = arg.get_possible_values();
    let choices = choices.iter().filter(|_| !matches!(arg.get_action(), ArgAction::SetTrue));
    let choices: Vec<_> = choices
        .map(|value| {
            (value.get_name().to_owned(), value.get_help().map(ToString::to_string).unwrap_or_default())
        })
        .collect();
    let text = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let default: Vec<_> = arg.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
    let default = if default.is_empty() || matches!(arg.get_action(), ArgAction::SetTrue) {
        String::new()
    } else {
        format!(" (default: {})", default.join(", "))
    };
    OptionText {
        key: arg.get_id().as_str().to_owned(),
        kind: kind(arg),
        choices,
        text: format!("{text}{default}"),
    }
}

fn kind(arg: &Arg) -> String {
    if matches!(arg.get_action(), ArgAction::SetTrue) {
        return "bool".to_owned();
    }
    let of = arg.get_value_parser().type_id();
    let one = [
        (TypeId::of::<f64>(), "float"),
        (TypeId::of::<usize>(), "int"),
        (TypeId::of::<u64>(), "int"),
        (TypeId::of::<PathBuf>(), "path"),
        (TypeId::of::<Duration>(), "float [s] or str"),
        (TypeId::of::<Horizon>(), "int [samples] or str"),
        (TypeId::of::<[f64; 2]>(), "sequence of 2 floats"),
        (TypeId::of::<[f64; 3]>(), "sequence of 3 floats"),
        (TypeId::of::<Vec<[f64; 2]>>(), "array_like, shape (points, 2)"),
        (TypeId::of::<(String, f64)>(), "mapping of str to float"),
        (TypeId::of::<(String, GivenRange)>(), "mapping of str to (float, float) or str"),
        (TypeId::of::<StatedRoles>(), "mapping of str to str"),
    ];
    let kind = one.into_iter().find(|(id, _)| of == *id).map_or("str", |(_, kind)| kind);
    let is_list = matches!(arg.get_action(), ArgAction::Append) && !kind.starts_with("mapping");
    if is_list { format!("{kind} or list of {kind}") } else { kind.to_owned() }
}
