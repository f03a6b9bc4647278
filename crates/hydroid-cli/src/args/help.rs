//! Options of `hydroid adapt --help` and `hydroid control --help`; `--help-advanced` shows all.

use clap::Command;

/// Basic options by subcommand.
const BASIC: [(&str, &[&str]); 2] = [
    (
        "adapt",
        &[
            "config",
            "output",
            "learner",
            "forgetting",
            "noise",
            "no_guard",
            "training_log",
            "horizon",
            "stream",
            "state",
            "black_box",
            "replay",
        ],
    ),
    (
        "control",
        &[
            "config",
            "output",
            "plant",
            "controller",
            "task",
            "speed",
            "turn_speed",
            "radius",
            "points",
            "waypoints",
            "seed",
            "adapt",
            "runs",
        ],
    ),
];

/// Hides all other options in the help of these subcommands.
pub fn short(command: Command) -> Command {
    BASIC.into_iter().fold(command, |command, (name, basic)| {
        command.mut_subcommand(name, |subcommand| {
            subcommand.mut_args(|arg| {
                let id = arg.get_id().as_str();
                let hidden = !arg.is_positional() && id != "help_advanced" && !basic.contains(&id);
                arg.hide(hidden)
            })
        })
    })
}

/// The subcommand of `--help-advanced`.
pub fn advanced<'a>(words: impl Iterator<Item = &'a str>) -> Option<&'static str> {
    let words: Vec<&str> = words.take_while(|word| *word != "--").collect();
    let asked = words.contains(&"--help-advanced");
    BASIC.into_iter().map(|(name, _)| name).find(|name| asked && words.contains(name))
}
