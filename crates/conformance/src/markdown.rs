//! Tables: every clause and its tests for docs/CONFORMANCE.md, every scenario for
//! docs/HOST-CONFORMANCE.md.

use std::fmt::Write;

use crate::case::Case;
use crate::clause::Clause;
use crate::host::Scenario;
use crate::reading::Reading;

/// The table of `clauses`, with the cases of `suite` that test each, and the reading that demands a
/// whole case. Cases that differ only in their subject are merged.
pub fn markdown<'a, B: 'a>(
    clauses: &[Clause],
    suite: impl Iterator<Item = &'a Case<B>> + Clone,
) -> String {
    let mut table = String::from("| id | demands | on a drive | on a host |\n|---|---|---|---|\n");
    for clause in clauses {
        let mut cases: Vec<String> = Vec::new();
        for case in suite.clone().filter(|case| case.clauses.contains(&clause.id)) {
            let name = case.name.split('[').next().unwrap_or(&case.name);
            let row = case.reading.map(|Reading { row, .. }| format!(" (reading {row})"));
            let text = format!("`{name}`{}", row.unwrap_or_default());
            if !cases.contains(&text) {
                cases.push(text);
            }
        }
        let drive = if cases.is_empty() { clause.untested.to_owned() } else { cases.join(", ") };
        let host = code(clause.host);
        let text = clause.text.replace('|', "\\|");
        writeln!(table, "| {} | {text} | {drive} | {host} |", clause.id)
            .expect("text is written to memory");
    }
    table
}

/// The table of the scenarios for hosts.
pub fn scenario_table<S>(scenarios: &[Scenario<S>]) -> String {
    let mut table = String::from("| scenario | a correct host | clauses |\n|---|---|---|\n");
    for Scenario { name, expected, clauses, .. } in scenarios {
        let clauses = clauses.join(", ");
        writeln!(table, "| `{name}` | {expected} | {clauses} |")
            .expect("text is written to memory");
    }
    table
}

fn code(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}
