//! Compares the output of a host with the data that it received.

use std::time::Duration;

use crate::finding::Finding;
use crate::report::{Outcome, Verdict};

use super::journal::Journal;
use super::scenario::{Demand, Scenario, Task};

/// The output of a host.
#[derive(Debug, Clone, Default)]
pub struct HostOutput {
    /// The values that it read, in the order of its output.
    pub values: Vec<Reading>,
    /// Whether it reported a failure.
    pub reported_error: bool,
    /// Why it crashed or did not end.
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
    /// The verdict on a host's output. The host's unit is `digit` digits on the wire. `late` is the
    /// delay of the drive beyond its script, if it matters: the host may then have timed out
    /// correctly, and only violations that do not depend on time count.
    pub fn judge(
        &self,
        journal: &Journal,
        output: &HostOutput,
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
        // A host that sent nothing did not notice the delay.
        let late = late.filter(|_| !journal.sent().is_empty());
        let verdict =
            match (self.wrong(journal, output, digit), self.missing(journal, output), late) {
                (Some(fault), ..) | (None, Some(fault), None) => failed(fault),
                (None, Some(_), Some(late)) => Verdict::NotRun(format!(
                    "this machine is too busy to test a host: the drive was delayed by {} ms",
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

    /// The outcome of a scenario that was not run.
    pub fn skipped(&self, why: &str) -> Outcome {
        let verdict = Verdict::Skipped(why.to_owned());
        let (name, differences, transcript) = (self.name.to_string(), Vec::new(), Vec::new());
        Outcome { name, clauses: self.clauses, verdict, differences, transcript }
    }

    /// Violations that do not depend on time.
    fn wrong(&self, journal: &Journal, output: &HostOutput, digit: f64) -> Option<String> {
        let falsehood = |(index, reading): (usize, &Reading)| {
            let Reading { motor, value } = *reading;
            let is = |sent: i64| (sent as f64 * digit - value).abs() < digit / 2.0;
            let Some(sent) = journal.meaning(is) else {
                return Some(format!("the host reported {value}, which was in no reply"));
            };
            if let Some(why) = &sent.wrong {
                return Some(format!("the host reported {value}, but {why}"));
            }
            if sent.motor != motor {
                let sender = sent.motor;
                return Some(format!(
                    "the host reported {value} for motor {motor}; it was sent by motor {sender}"
                ));
            }
            let again = output.values[..index].contains(reading);
            again.then(|| format!("the host reported {value} twice; it was sent once"))
        };
        if let Some(fault) = output.values.iter().enumerate().find_map(falsehood) {
            return Some(fault);
        }
        if journal.starts > usize::from(self.task == Task::Start) {
            return Some(format!("the host sent START_MOTOR {} times", journal.starts));
        }
        output.ended_badly.clone()
    }

    /// Violations that a late drive may have caused.
    fn missing(&self, journal: &Journal, output: &HostOutput) -> Option<String> {
        if let Some(violation) = journal.violations.first() {
            return Some(format!("the host {violation}"));
        }
        let count = output.values.len();
        let wanted = self.task.values();
        match self.demand {
            _ if self.task == Task::Start && journal.starts == 0 => {
                Some("the host did not send START_MOTOR".to_owned())
            }
            Demand::Everything if count < wanted => {
                Some(format!("the host reported {count} values of {wanted}"))
            }
            Demand::Everything if output.reported_error && wanted == 0 => {
                Some("the host reported a failure".to_owned())
            }
            Demand::Error if !output.reported_error => {
                Some("the host did not report the failure".to_owned())
            }
            Demand::Truth if count < wanted && !output.reported_error => {
                Some(format!("the host reported {count} values of {wanted} and no error"))
            }
            _ if journal.sent().is_empty() => {
                Some("the host sent nothing, so nothing was tested".to_owned())
            }
            _ => None,
        }
    }
}
