//! Short names of ports.

/// The last part of a port's name: `can0` of `slcan:/dev/can0?x=1`.
pub fn last_part(port: &str) -> &str {
    let body = port.split('?').next().unwrap_or(port).trim_end_matches(['/', ':']);
    match body.strip_prefix("zenoh:") {
        // The line of a node.
        Some(line) => line,
        None => body.rsplit(['/', ':']).next().unwrap_or(body),
    }
}

/// The same names, each of them once: `numbered` adds a number to one that is there already.
pub fn distinct(
    names: impl Iterator<Item = String>,
    numbered: impl Fn(&str, u32) -> String,
) -> Vec<String> {
    let mut distinct: Vec<String> = Vec::new();
    for name in names {
        let others = (2..).map(|number| numbered(&name, number));
        let mut choices = std::iter::once(name.clone()).chain(others);
        distinct.extend(choices.find(|it| !distinct.contains(it)));
    }
    distinct
}
