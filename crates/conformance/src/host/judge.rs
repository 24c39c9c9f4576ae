//! What a host said, held against what it was told.

use std::time::Duration;

use crate::finding::Finding;
use crate::report::{Outcome, Verdict};

use super::journal::Journal;
use super::scenario::{Demand, Scenario, Task};

/// What a host said.
#[derive(Debug, Clone, Default)]
pub struct Said {
    /// What it read, in the order in which it said it.
    pub values: Vec<Reading>,
    /// Whether it said that something failed.
    pub complained: bool,
    /// That it crashed or did not come to an end.
    pub ended_badly: Option<String>,
}

/// A value that a host read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The motor.
    pub motor: u8,
    /// The value, in the document's unit.
    pub value: f64,
}

impl<S> Scenario<S> {
    /// What comes of it when the host said this. A digit on the wire is `digit` of what it says.
    /// `late` is how much later than planned the drive was served, where that matters: then a host
    /// may have given up rightly, and is judged only by what is wrong in any case.
    pub fn judge(
        &self,
        journal: &Journal,
        said: &Said,
        digit: f64,
        late: Option<Duration>,
    ) -> Outcome {
        let failed = |fault| {
            Verdict::Failed(Box::new(Finding {
                sent: journal.sent(),
                expected: self.expected.to_owned(),
                received: fault,
                reading: None,
            }))
        };
        // A host that sent nothing did not notice.
        let late = late.filter(|_| !journal.sent().is_empty());
        let verdict = match (self.wrong(journal, said, digit), self.missing(journal, said), late) {
            (Some(fault), ..) | (None, Some(fault), None) => failed(fault),
            (None, Some(_), Some(late)) => Verdict::NotRun(format!(
                "this machine is too busy to judge a host: the drive was served {} ms late",
                late.as_millis()
            )),
            (None, None, _) => Verdict::Passed,
        };
        let transcript = match verdict {
            Verdict::Failed(_) => journal.transcript.clone(),
            _ => Vec::new(),
        };
        let (name, differences) = (self.name.to_string(), Vec::new());
        Outcome { name, clauses: self.clauses, verdict, differences, transcript }
    }

    /// Why it was not run.
    pub fn skipped(&self, why: &str) -> Outcome {
        let verdict = Verdict::Skipped(why.to_owned());
        let (name, differences, transcript) = (self.name.to_string(), Vec::new(), Vec::new());
        Outcome { name, clauses: self.clauses, verdict, differences, transcript }
    }

    /// What is wrong however late the drive was served.
    fn wrong(&self, journal: &Journal, said: &Said, digit: f64) -> Option<String> {
        let falsehood = |(index, reading): (usize, &Reading)| {
            let Reading { motor, value } = *reading;
            let is = |told: i64| (told as f64 * digit - value).abs() < digit / 2.0;
            let Some(told) = journal.meaning(is) else {
                return Some(format!("the host said {value}, which no reply told it"));
            };
            if let Some(why) = &told.wrong {
                return Some(format!("the host said {value}, but {why}"));
            }
            if told.motor != motor {
                let teller = told.motor;
                return Some(format!("the host said {value} of motor {motor}; motor {teller} did"));
            }
            let again = said.values[..index].contains(reading);
            again.then(|| format!("the host said {value} twice, which it was told once"))
        };
        if let Some(fault) = said.values.iter().enumerate().find_map(falsehood) {
            return Some(fault);
        }
        if journal.starts > usize::from(self.task == Task::Start) {
            return Some(format!("the host sent START_MOTOR {} times", journal.starts));
        }
        said.ended_badly.clone()
    }

    /// What a late drive may explain.
    fn missing(&self, journal: &Journal, said: &Said) -> Option<String> {
        if let Some(violation) = journal.violations.first() {
            return Some(format!("the host {violation}"));
        }
        let count = said.values.len();
        let wanted = self.task.values();
        match self.demand {
            _ if self.task == Task::Start && journal.starts == 0 => {
                Some("the host did not send START_MOTOR".to_owned())
            }
            Demand::Everything if count < wanted => {
                Some(format!("the host said {count} values of {wanted}"))
            }
            Demand::Everything if said.complained && wanted == 0 => {
                Some("the host said that it failed".to_owned())
            }
            Demand::Error if !said.complained => {
                Some("the host did not say that anything failed".to_owned())
            }
            Demand::Truth if count < wanted && !said.complained => {
                Some(format!("the host said {count} values of {wanted} and nothing of an error"))
            }
            _ if journal.sent().is_empty() => {
                Some("the host sent nothing, so that nothing was tested".to_owned())
            }
            _ => None,
        }
    }
}
