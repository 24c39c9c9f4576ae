//! What came of a run.

use serde_json::{Map, Value, json};

use crate::finding::Finding;
use crate::reading::Reading;

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
    /// Differences from readings, one a reading.
    pub differences: Vec<Finding>,
    /// What passed the wire, where it failed or differs from a reading.
    pub transcript: Vec<String>,
}

/// What came of a case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The drive does what the clauses demand.
    Passed,
    /// It does something else.
    Failed(Box<Finding>),
    /// It does what sentences demand, and differs from our reading of what they leave open.
    Reading,
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
            Verdict::Reading => "reading",
            Verdict::Skipped(_) => "skipped",
            Verdict::NotRun(_) => "not run",
        }
    }
}

impl Report {
    /// Whether nothing failed and the port held. Differences from readings are no failures.
    pub fn is_clean(&self) -> bool {
        let bad =
            |outcome: &Outcome| matches!(outcome.verdict, Verdict::Failed(_) | Verdict::NotRun(_));
        !self.outcomes.iter().any(bad)
    }

    /// The same with differences from readings as failures.
    pub fn strict(mut self) -> Self {
        for outcome in &mut self.outcomes {
            let told = !outcome.differences.is_empty();
            if told && matches!(outcome.verdict, Verdict::Reading | Verdict::NotRun(_)) {
                outcome.verdict = Verdict::Failed(Box::new(outcome.differences.remove(0)));
            }
        }
        self
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
            "reading": self.count(Verdict::Reading.word()),
            "skipped": self.count("skipped"),
            "not_run": self.count("not run"),
            "cases": cases,
        })
    }
}

impl Outcome {
    fn to_json(&self) -> Value {
        let mut object = json!({
            "name": self.name, "clauses": self.clauses, "verdict": self.verdict.word().to_lowercase().replace(' ', "-"),
        });
        match &self.verdict {
            Verdict::Passed | Verdict::Reading => {}
            Verdict::Failed(finding) => {
                let known = object.as_object_mut().expect("an object was made");
                known.extend(finding.to_json());
            }
            Verdict::Skipped(why) | Verdict::NotRun(why) => object["why"] = json!(why),
        }
        if !self.differences.is_empty() {
            object["differences"] = self.differences.iter().map(Finding::to_json).collect();
        }
        let told = matches!(self.verdict, Verdict::Failed(_)) || !self.differences.is_empty();
        if told {
            object["transcript"] = json!(self.transcript);
        }
        object
    }
}

impl Finding {
    fn to_json(&self) -> Map<String, Value> {
        let Finding { sent, expected, received, reading } = self;
        let row =
            reading.iter().flat_map(|Reading { row, text }| [("row", *row), ("reading", *text)]);
        [("sent", &**sent), ("expected", expected), ("received", received)]
            .into_iter()
            .chain(row)
            .map(|(name, text)| (name.to_owned(), json!(text)))
            .collect()
    }
}
