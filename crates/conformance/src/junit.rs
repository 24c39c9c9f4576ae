//! The report as JUnit XML.

use quick_junit::{NonSuccessKind, TestCase, TestCaseStatus, TestSuite};

use crate::finding::Finding;
use crate::reading::Reading;
use crate::report::{Outcome, Report, Verdict};

impl Report {
    /// The report as JUnit XML: a test suite with this name. A case that did not run because the
    /// port failed is an error there. A difference from a reading is skipped, with the type
    /// `reading`.
    pub fn to_junit(&self, suite: &str) -> String {
        let mut cases = TestSuite::new(suite);
        cases.add_test_cases(self.outcomes.iter().map(test_case));
        let mut report = quick_junit::Report::new("motorlink conformance");
        report.add_test_suite(cases);
        report.to_string().expect("XML is written to memory")
    }
}

fn test_case(outcome: &Outcome) -> TestCase {
    let mut status = match &outcome.verdict {
        Verdict::Passed => TestCaseStatus::success(),
        Verdict::Failed(_) => TestCaseStatus::non_success(NonSuccessKind::Failure),
        Verdict::Skipped(_) | Verdict::Reading => TestCaseStatus::skipped(),
        Verdict::NotRun(_) => TestCaseStatus::non_success(NonSuccessKind::Error),
    };
    match &outcome.verdict {
        Verdict::Passed => {}
        Verdict::Failed(finding) => {
            status.set_message(format!("expected {}", finding.expected));
            status.set_description(description(outcome, finding));
        }
        Verdict::Reading => {
            let rows: Vec<String> = outcome
                .differences
                .iter()
                .filter_map(|finding| finding.reading)
                .map(|reading| format!("{}: {}", reading.row, reading.text))
                .collect();
            status.set_type("reading");
            status.set_message(rows.join("; "));
            let texts = outcome.differences.iter().map(|finding| description(outcome, finding));
            status.set_description(texts.collect::<Vec<_>>().join("\n\n"));
        }
        Verdict::Skipped(why) | Verdict::NotRun(why) => {
            status.set_message(why.clone());
        }
    }
    let mut case = TestCase::new(outcome.name.clone(), status);
    case.set_classname(outcome.clauses.join(" "));
    case
}

fn description(
    outcome: &Outcome,
    Finding { sent, expected, received, reading }: &Finding,
) -> String {
    let row =
        reading.map(|Reading { row, text }| format!("reading  {row} {text}\n")).unwrap_or_default();
    format!(
        "clauses  {}\n{row}sent     {sent}\nexpected {expected}\nreceived {received}\n\n{}",
        outcome.clauses.join(", "),
        outcome.transcript.join("\n"),
    )
}
