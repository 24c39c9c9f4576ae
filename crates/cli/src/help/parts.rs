//! Subcommands that a build may leave out.

use clap::{Arg, ArgMatches, Command};

/// Whether this build has a feature of this crate, and its subcommands.
type Part = (bool, &'static [&'static str]);

const PARTS: &[Part] = &[
    (cfg!(feature = "conformance"), &["conformance"]),
    (cfg!(feature = "fleet"), &["fleet", "node"]),
    (cfg!(feature = "monitor"), &["monitor"]),
    (
        cfg!(feature = "record"),
        &["convert", "decode", "info", "plot", "record", "recover", "replay", "sim run"],
    ),
    (cfg!(feature = "watch"), &["watch"]),
];

/// How to get what a build leaves out.
pub const WHOLE_PROGRAM: &str = "`make web && cargo install --locked --path crates/cli` in a clone \
                                 of Motorlink builds the program with all subcommands";

/// Marks a subcommand that says only that it is left out.
const STUB: &str = "left-out";

/// Adds what this build leaves out, hidden, so that words behind it are no errors of their own.
pub fn with_left_out(command: Command) -> Command {
    with_stubs(command, PARTS)
}

fn with_stubs(mut command: Command, parts: &[Part]) -> Command {
    for path in parts.iter().filter(|(is_built, _)| !is_built).flat_map(|(_, paths)| *paths) {
        command = match path.split_once(' ') {
            Some((parent, name)) => {
                command.mut_subcommand(parent, |parent| parent.subcommand(stub(name)))
            }
            None => command.subcommand(stub(path)),
        };
    }
    command
}

fn stub(name: &'static str) -> Command {
    let rest = Arg::new(STUB)
        .hide(true)
        .default_value("")
        .num_args(0..)
        .allow_hyphen_values(true)
        .trailing_var_arg(true);
    Command::new(name)
        .about(format!("This program was built without it: {WHOLE_PROGRAM}"))
        .hide(true)
        .disable_help_flag(true)
        .arg(rest.value_parser(clap::value_parser!(std::ffi::OsString)))
}

/// The subcommand of a command line, if this build leaves it out.
pub fn left_out(matches: &ArgMatches) -> Option<String> {
    let (name, behind) = matches.subcommand()?;
    if behind.ids().any(|id| id == STUB) {
        return Some(name.to_owned());
    }
    left_out(behind).map(|rest| format!("{name} {rest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What every build has.
    const ALWAYS: [&str; 11] = [
        "completions",
        "demo",
        "guard",
        "man",
        "ports",
        "rmd",
        "share",
        "sim",
        "sim presets",
        "spec",
        "st",
    ];

    /// The subcommands, and those of `sim`.
    fn paths(command: &Command) -> Vec<String> {
        let sim = command.find_subcommand("sim").unwrap().get_subcommands();
        let sim = sim.map(|it| format!("sim {}", it.get_name()));
        let mut paths: Vec<_> =
            command.get_subcommands().map(|it| it.get_name().to_owned()).chain(sim).collect();
        paths.sort();
        paths
    }

    #[test]
    fn each_subcommand_is_in_every_build_or_in_the_table() {
        let with = |parts: &mut dyn Iterator<Item = &Part>| {
            let mut paths: Vec<String> =
                parts.flat_map(|part| part.1).chain(&ALWAYS).map(|it| it.to_string()).collect();
            paths.sort();
            paths
        };
        assert_eq!(paths(&crate::command()), with(&mut PARTS.iter().filter(|part| part.0)));
        assert_eq!(paths(&with_left_out(crate::command())), with(&mut PARTS.iter()));
    }

    #[test]
    fn what_is_left_out_is_told_whatever_stands_behind_it() {
        let command =
            || with_stubs(crate::command(), &[(false, &["left", "sim out"]), (true, &["st"])]);
        let told =
            |words: &str| left_out(&command().try_get_matches_from(words.split(' ')).unwrap());
        for path in ["left", "sim out"] {
            for rest in ["", " --help", " --open", " x --plot y.svg -- z"] {
                assert_eq!(
                    told(&format!("motorlink {path}{rest}")).as_deref(),
                    Some(path),
                    "{rest}"
                );
            }
        }
        assert_eq!(told("motorlink st -p x status"), None);
        assert!(!command().render_help().to_string().contains("left"));
    }
}
