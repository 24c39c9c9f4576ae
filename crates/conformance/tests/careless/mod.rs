//! Careless hosts, each with a fault and the scenario that finds it.

use std::fmt::Debug;

/// Each fault fails in its scenario; `failing` gives the scenarios in which a fault fails.
pub fn are_caught<F: Copy + Debug>(caught: &[(F, &str)], failing: impl Fn(F) -> Vec<String>) {
    for &(fault, scenario) in caught {
        let failed = failing(fault);
        assert!(failed.iter().any(|name| name == scenario), "{fault:?}: {failed:?}");
    }
}

/// Each of these scenarios finds a fault, not counting the fault `everywhere`, which fails in most.
pub fn are_needed<F: Copy + PartialEq>(
    scenarios: impl Iterator<Item = String>,
    caught: &[(F, &str)],
    everywhere: F,
    failing: impl Fn(F) -> Vec<String>,
) {
    let others = caught.iter().filter(|(fault, _)| *fault != everywhere);
    let mut found: Vec<String> = others.flat_map(|(fault, _)| failing(*fault)).collect();
    // The undisturbed one is for those. Which side of the timeout a reply falls on is chance.
    found.push("every_reading_has_its_own_value".to_owned());
    found.push("a_reply_at_the_timeout_is_its_own_or_nobodys".to_owned());
    for scenario in scenarios {
        assert!(found.contains(&scenario), "{scenario}");
    }
}
