//! Checks that clauses and cases match.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use motorlink_conformance::rmd::{CLAUSES, suite};
use motorlink_proto::rmd::COMMANDS;

#[test]
fn each_paragraph_of_the_document_has_clauses_that_are_numbered() {
    let codes = COMMANDS.iter().map(|row| format!("{:02X}", u8::from(row.code)));
    let due: BTreeSet<String> = codes.chain(["1", "2", "280"].map(str::to_owned)).collect();
    let mut counts = BTreeMap::<String, u32>::new();
    for clause in CLAUSES {
        let count = counts.entry(clause.paragraph().to_owned()).or_default();
        *count += 1;
        assert_eq!(clause.id, format!("RMD-{}-{count:02}", clause.paragraph()));
    }
    assert!(counts.keys().eq(&due));
}

#[test]
fn every_clause_is_tested_or_has_a_reason() {
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
