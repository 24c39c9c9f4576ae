//! Completions of positional arguments for fish, which clap_complete leaves out.

use clap::{Arg, Command, ValueHint};

/// Lines for a completion script: the words of each positional argument, and no file names for commands
/// that take none.
pub fn positionals(root: &Command) -> String {
    let mut script = String::new();
    for command in root.get_subcommands() {
        let name = command.get_name();
        let inner = names(command.get_subcommands());
        let but_inner = match inner.is_empty() {
            true => String::new(),
            false => format!("; and not __fish_seen_subcommand_from {inner}"),
        };
        let using = format!("__fish_motorlink_using_subcommand {name}");
        script += &lines(command, &format!("{using}{but_inner}"));
        for inner in command.get_subcommands() {
            let seen = names([inner].into_iter());
            script += &lines(inner, &format!("{using}; and __fish_seen_subcommand_from {seen}"));
        }
    }
    script
}

/// The names of commands and their aliases.
fn names<'a>(commands: impl Iterator<Item = &'a Command>) -> String {
    let names = commands.flat_map(Command::get_name_and_visible_aliases);
    names.collect::<Vec<_>>().join(" ")
}

fn lines(command: &Command, condition: &str) -> String {
    let is_path = |arg: &Arg| {
        matches!(
            arg.get_value_hint(),
            ValueHint::FilePath | ValueHint::DirPath | ValueHint::AnyPath
        )
    };
    if command.get_positionals().any(is_path) {
        return String::new();
    }
    let words = command.get_positionals().flat_map(Arg::get_possible_values);
    let words: Vec<String> = words.map(|word| format!("'{}'", word.get_name())).collect();
    let words = match words.is_empty() {
        true => String::new(),
        false => format!(" -a \"{}\"", words.join(" ")),
    };
    format!("complete -c motorlink -n \"{condition}\" -f{words}\n")
}
