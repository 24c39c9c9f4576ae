//! What came of a run.

use serde_json::{Value, json};

use crate::case::Finding;

/// What came of all cases.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// In the order of the suite.
    pub outcomes: Vec<Outcome>,
}

/// What came of one case.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The case.
    pub name: String,
    /// The clauses that it tests.
    pub clauses: &'static [&'static str],
    /// What came of it.
    pub verdict: Verdict,
    /// What passed the wire, where it failed.
    pub transcript: Vec<String>,
}

/// What came of a case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The drive does what the clauses demand.
    Passed,
    /// It does something else.
    Failed(Box<Finding>),
    /// Not tried, and why.
    Skipped(String),
    /// The port or the drive had failed before, or failed here; or this machine was too busy to judge.
    NotRun(String),
}

impl Verdict {
    /// One word for tables and files.
    pub const fn word(&self) -> &'static str {
        match self {
            Verdict::Passed => "passed",
            Verdict::Failed(_) => "FAILED",
            Verdict::Skipped(_) => "skipped",
            Verdict::NotRun(_) => "not run",
        }
    }
}

impl Report {
    /// Whether nothing failed and the port held.
    pub fn is_clean(&self) -> bool {
        let good =
            |outcome: &Outcome| matches!(outcome.verdict, Verdict::Passed | Verdict::Skipped(_));
        self.outcomes.iter().all(good)
    }

    /// How many cases ended with the verdict of this word.
    pub fn count(&self, word: &str) -> usize {
        self.outcomes.iter().filter(|outcome| outcome.verdict.word() == word).count()
    }

    /// Names of the cases that failed.
    pub fn failed(&self) -> impl Iterator<Item = &Outcome> {
        self.outcomes.iter().filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)))
    }

    /// Why the rest was not run; empty where everything was.
    pub fn lost(&self) -> &str {
        let lost = self.outcomes.iter().find_map(|outcome| match &outcome.verdict {
            Verdict::NotRun(why) => Some(why.as_str()),
            _ => None,
        });
        lost.unwrap_or_default()
    }

    /// The report as one JSON object.
    pub fn to_json(&self) -> Value {
        let cases: Vec<Value> = self.outcomes.iter().map(Outcome::to_json).collect();
        json!({
            "passed": self.count(Verdict::Passed.word()),
            "failed": self.failed().count(),
            "skipped": self.count("skipped"),
            "not_run": self.count("not run"),
            "cases": cases,
        })
    }
}

impl Outcome {
    fn to_json(&self) -> Value {
        let mut object = json!({
            "name": self.name, "clauses": self.clauses, "verdict": self.verdict.word().to_lowercase(),
        });
        match &self.verdict {
            Verdict::Passed => {}
            Verdict::Failed(finding) => {
                object["sent"] = json!(finding.sent);
                object["expected"] = json!(finding.expected);
                object["received"] = json!(finding.received);
                object["transcript"] = json!(self.transcript);
            }
            Verdict::Skipped(why) | Verdict::NotRun(why) => object["why"] = json!(why),
        }
        object
    }
}
