//! Checks that the clauses, the cases that name them, and the named tests match.

use std::collections::{BTreeMap, BTreeSet};

use motorlink_conformance::st;
use motorlink_proto::st::Profile;

/// Names and clauses of the cases of both profiles.
fn cases() -> BTreeMap<String, &'static [&'static str]> {
    [Profile::Spec, Profile::Mcsdk54]
        .into_iter()
        .flat_map(st::suite)
        .map(|case| (case.name.into_owned(), case.clauses))
        .collect()
}

/// The paragraph as numbers, and the number in the paragraph.
fn place(id: &str) -> (Vec<u32>, u32) {
    let number = |text: &str| text.parse().unwrap_or_else(|_| panic!("{id} has no such form"));
    let parts: Vec<&str> = id.split('-').collect();
    let ["ST", paragraph, running] = parts[..] else { panic!("{id} has no such form") };
    (paragraph.split('.').map(number).collect(), number(running))
}

#[test]
fn ids_count_without_a_gap_in_the_order_of_the_document() {
    let mut last = (Vec::new(), 0);
    for clause in st::CLAUSES {
        let (paragraph, running) = place(clause.id);
        let wanted = if paragraph == last.0 { last.1 + 1 } else { 1 };
        assert_eq!(running, wanted, "{}", clause.id);
        assert!(paragraph >= last.0, "{} comes after {:?}", clause.id, last.0);
        last = (paragraph, running);
    }
}

#[test]
fn every_clause_is_tested_or_has_a_reason() {
    let tested: BTreeSet<&str> = cases().into_values().flatten().copied().collect();
    for clause in st::CLAUSES {
        let on_a_drive = tested.contains(clause.id);
        let excused = !clause.untested.is_empty();
        assert!(on_a_drive != excused, "{} needs either a case or a reason", clause.id);
    }
}

#[test]
fn every_case_names_clauses_that_exist() {
    let known: BTreeSet<&str> = st::CLAUSES.iter().map(|clause| clause.id).collect();
    for (name, clauses) in cases() {
        assert!(!clauses.is_empty(), "{name} names no clause");
        for clause in clauses {
            assert!(known.contains(clause), "{name} names {clause}, which does not exist");
        }
    }
}

#[test]
fn case_names_are_unique() {
    for profile in [Profile::Spec, Profile::Mcsdk54] {
        let mut seen = BTreeSet::new();
        for case in st::suite(profile) {
            assert!(seen.insert(case.name.clone()), "{} is there twice", case.name);
        }
    }
}
