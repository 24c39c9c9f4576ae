//! The report as JUnit XML.

use quick_junit::{NonSuccessKind, TestCase, TestCaseStatus, TestSuite};

use crate::report::{Outcome, Report, Verdict};

impl Report {
    /// The report as JUnit XML, a test suite of this name. What did not run because the port failed
    /// is an error there.
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
        Verdict::Skipped(_) => TestCaseStatus::skipped(),
        Verdict::NotRun(_) => TestCaseStatus::non_success(NonSuccessKind::Error),
    };
    match &outcome.verdict {
        Verdict::Passed => {}
        Verdict::Failed(finding) => {
            status.set_message(format!("expected {}", finding.expected));
            status.set_description(format!(
                "clauses  {}\nsent     {}\nexpected {}\nreceived {}\n\n{}",
                outcome.clauses.join(", "),
                finding.sent,
                finding.expected,
                finding.received,
                outcome.transcript.join("\n"),
            ));
        }
        Verdict::Skipped(why) | Verdict::NotRun(why) => {
            status.set_message(why.clone());
        }
    }
    let mut case = TestCase::new(outcome.name.clone(), status);
    case.set_classname(outcome.clauses.join(" "));
    case
}
