//! Subcommands that a build may leave out.

/// The features of this crate, whether this build has them, and their subcommands.
const PARTS: &[(&str, bool, &[&str])] = &[
    ("conformance", cfg!(feature = "conformance"), &["conformance"]),
    ("fleet", cfg!(feature = "fleet"), &["fleet", "node"]),
    ("monitor", cfg!(feature = "monitor"), &["monitor"]),
    (
        "record",
        cfg!(feature = "record"),
        &["convert", "decode", "info", "plot", "record", "recover", "replay", "run"],
    ),
    ("watch", cfg!(feature = "watch"), &["watch"]),
];

/// How to get a subcommand, if this build does not have it.
pub fn left_out(subcommand: &str) -> Option<&'static str> {
    let is_left_out = |(_, is_built, subcommands): &(_, bool, &[&str])| {
        !is_built && subcommands.contains(&subcommand)
    };
    PARTS.iter().any(is_left_out).then_some(
        "this program was built without it: `cargo install --locked --path crates/cli` builds one \
         with all subcommands",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_subcommands_of_builds_with_their_feature_only() {
        let command = crate::command();
        let sim = command.find_subcommand("sim").unwrap();
        for (feature, is_built, subcommands) in PARTS {
            for name in *subcommands {
                let found = [&command, sim].iter().any(|it| it.find_subcommand(name).is_some());
                assert_eq!(found, *is_built, "{feature}: {name}");
                assert_eq!(left_out(name).is_some(), !is_built, "{feature}: {name}");
            }
        }
        assert_eq!(left_out("st"), None);
    }
}
