//! The result of a run.

use serde_json::{Map, Value, json};

use crate::finding::Finding;
use crate::reading::Reading;

/// The results of all cases.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// In the order of the suite.
    pub outcomes: Vec<Outcome>,
}

/// The result of one case.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The case.
    pub name: String,
    /// The clauses that it tests.
    pub clauses: &'static [&'static str],
    /// The verdict.
    pub verdict: Verdict,
    /// Differences from readings, one per reading.
    pub differences: Vec<Finding>,
    /// The transfers, if the case failed or differs from a reading.
    pub transcript: Vec<String>,
}

/// The verdict on one case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The drive meets the demands of the clauses.
    Passed,
    /// The drive does not meet a demand.
    Failed(Box<Finding>),
    /// The drive meets the demands of the document, but differs from our reading of an unclear
    /// sentence.
    Reading,
    /// Not run, with the reason.
    Skipped(String),
    /// Not run, or not finished: the port or the drive failed, or this machine was too busy. The
    /// text is the reason.
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
    /// Whether no case failed and the port worked. Differences from readings are not failures.
    pub fn is_clean(&self) -> bool {
        let bad =
            |outcome: &Outcome| matches!(outcome.verdict, Verdict::Failed(_) | Verdict::NotRun(_));
        !self.outcomes.iter().any(bad)
    }

    /// Counts differences from readings as failures.
    pub fn strict(mut self) -> Self {
        for outcome in &mut self.outcomes {
            let differs = !outcome.differences.is_empty();
            if differs && matches!(outcome.verdict, Verdict::Reading | Verdict::NotRun(_)) {
                outcome.verdict = Verdict::Failed(Box::new(outcome.differences.remove(0)));
            }
        }
        self
    }

    /// The number of cases with this verdict.
    pub fn count(&self, word: &str) -> usize {
        self.outcomes.iter().filter(|outcome| outcome.verdict.word() == word).count()
    }

    /// Names of the cases that failed.
    pub fn failed(&self) -> impl Iterator<Item = &Outcome> {
        self.outcomes.iter().filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)))
    }

    /// Why the other cases were not run; empty if all were run.
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
        let differs = matches!(self.verdict, Verdict::Failed(_)) || !self.differences.is_empty();
        if differs {
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
