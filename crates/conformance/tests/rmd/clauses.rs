//! The clauses and what tests them belong together.

use std::collections::HashSet;

use motorlink_conformance::rmd::{CLAUSES, suite};

/// Chapters and commands in the order of the document.
const PARAGRAPHS: [&str; 26] = [
    "1", "2", "30", "31", "32", "33", "34", "90", "91", "19", "92", "94", "80", "81", "88", "9A",
    "9B", "9C", "9D", "A1", "A2", "A3", "A4", "A5", "A6", "280",
];

#[test]
fn ids_are_numbered_in_the_order_of_the_document() {
    let mut due = Vec::new();
    for paragraph in PARAGRAPHS {
        let count = CLAUSES.iter().filter(|clause| clause.paragraph() == paragraph).count();
        due.extend((1..=count).map(|number| format!("RMD-{paragraph}-{number:02}")));
    }
    assert!(CLAUSES.iter().map(|clause| clause.id).eq(due));
}

#[test]
fn every_clause_is_tested_or_says_why_not() {
    let suite = suite();
    for clause in CLAUSES {
        let tested = suite.iter().any(|case| case.clauses.contains(&clause.id));
        let id = clause.id;
        assert_ne!(tested, !clause.untested.is_empty(), "{id}: cases, or a reason for none");
    }
}

#[test]
fn every_case_has_a_name_of_its_own_and_names_clauses_that_exist() {
    let mut names = HashSet::new();
    for case in suite() {
        assert!(!case.clauses.is_empty(), "{} names no clause", case.name);
        for id in case.clauses {
            assert!(CLAUSES.iter().any(|clause| clause.id == *id), "{}: {id}", case.name);
        }
        assert!(names.insert(case.name.clone()), "{} is there twice", case.name);
    }
}
