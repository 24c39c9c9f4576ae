//! Careless hosts. Each has one fault, and one scenario finds it.

use std::fmt::Debug;

/// Checks that each fault fails in its scenario. `failing` returns the scenarios in which a fault
/// fails.
pub fn are_caught<F: Copy + Debug>(caught: &[(F, &str)], failing: impl Fn(F) -> Vec<String>) {
    for &(fault, scenario) in caught {
        let failed = failing(fault);
        assert!(failed.iter().any(|name| name == scenario), "{fault:?}: {failed:?}");
    }
}

/// Checks that each of these scenarios finds a fault. The fault `everywhere` does not count,
/// because it fails in most.
pub fn are_needed<F: Copy + PartialEq>(
    scenarios: impl Iterator<Item = String>,
    caught: &[(F, &str)],
    everywhere: F,
    failing: impl Fn(F) -> Vec<String>,
) {
    let others = caught.iter().filter(|(fault, _)| *fault != everywhere);
    let mut found: Vec<String> = others.flat_map(|(fault, _)| failing(*fault)).collect();
    // The undisturbed scenario finds that fault. For a reply at the timeout the result is random.
    found.push("every_reading_has_its_own_value".to_owned());
    found.push("a_reply_at_the_timeout_is_matched_to_its_request_or_dropped".to_owned());
    for scenario in scenarios {
        assert!(found.contains(&scenario), "{scenario}");
    }
}
