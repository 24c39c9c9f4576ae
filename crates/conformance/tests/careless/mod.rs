//! Careless hosts. Each has one fault, and one scenario finds it.

use std::fmt::Debug;

/// Checks that each fault fails in its scenario, and that each of the scenarios finds a fault. The
/// fault `everywhere` does not count for that, because it fails in most. `failing` returns the
/// scenarios in which a fault fails.
pub fn are_caught<F: Copy + Debug + PartialEq>(
    scenarios: impl Iterator<Item = String>,
    caught: &[(F, &str)],
    everywhere: F,
    failing: impl Fn(F) -> Vec<String>,
) {
    // The undisturbed scenario finds that fault. For a reply at the timeout the result is random.
    let mut found = vec![
        "every_reading_has_its_own_value".to_owned(),
        "a_reply_at_the_timeout_is_matched_to_its_request_or_dropped".to_owned(),
    ];
    for &(fault, scenario) in caught {
        let failed = failing(fault);
        assert!(failed.iter().any(|name| name == scenario), "{fault:?}: {failed:?}");
        if fault != everywhere {
            found.extend(failed);
        }
    }
    for scenario in scenarios {
        assert!(found.contains(&scenario), "{scenario}");
    }
}
