//! Cases: tests of a drive.

use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use motorlink::port::PortError;

use crate::finding::Finding;
use crate::reading::Reading;
use crate::report::{Outcome, Report, Verdict};
use crate::world::Unavailable;

/// What a case needs: the user's permission or help.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Need {
    /// The motor turns.
    Spin,
    /// The drive's ROM is written, which wears.
    Rom,
    /// The drive's power is cycled.
    PowerCycle,
    /// Something outside the drive causes a fault.
    Fault,
}

/// A test of one or a few clauses on a drive. `B` is the harness.
pub struct Case<B> {
    /// The demand, as a sentence in snake case. A subject may follow in brackets:
    /// `registers_read_in_their_size[SPEED_MEAS]`.
    pub name: Cow<'static, str>,
    /// Ids of the clauses that it tests.
    pub clauses: &'static [&'static str],
    /// The permissions and help that it needs.
    pub needs: &'static [Need],
    /// The reading that demands the whole case; `None` if sentences of the document demand it.
    pub reading: Option<Reading>,
    /// The test.
    pub run: Run<B>,
}

/// The function of a case.
pub type Run<B> = Box<dyn Fn(&mut B) -> Result<(), Stop>>;

/// Why a case did not pass.
#[derive(Debug, thiserror::Error)]
pub enum Stop {
    /// The drive did not meet the demand.
    #[error("{0:?}")]
    Failed(Box<Finding>),
    /// The case does not apply to this drive, or cannot be run. The text is the reason.
    #[error("{0}")]
    Skipped(String),
    /// The port failed. The result for the drive is unknown.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The drive cannot be tested further, for example because it does not answer. The text is the
    /// reason.
    #[error("{0}")]
    Lost(String),
}

impl From<Unavailable> for Stop {
    fn from(error: Unavailable) -> Self {
        Stop::Skipped(error.0)
    }
}

/// Marks a failure as demanded by a reading instead of a sentence.
pub(crate) trait ReadAs {
    /// Adds the reading, unless there is one already.
    fn read_as(self, reading: Reading) -> Self;
}

impl ReadAs for Stop {
    fn read_as(mut self, reading: Reading) -> Self {
        if let Stop::Failed(finding) = &mut self {
            finding.reading.get_or_insert(reading);
        }
        self
    }
}

impl<T> ReadAs for Result<T, Stop> {
    fn read_as(self, reading: Reading) -> Self {
        self.map_err(|stop| stop.read_as(reading))
    }
}

/// Differences from readings that do not end a case.
#[derive(Debug, Default)]
pub(crate) struct Differences(Vec<Finding>);

impl Differences {
    /// Records a failure as a difference from `reading`, so that the case continues.
    pub(crate) fn note(&mut self, reading: Reading, result: Result<(), Stop>) -> Result<(), Stop> {
        match result.read_as(reading) {
            Err(Stop::Failed(finding)) => {
                self.0.push(*finding);
                Ok(())
            }
            other => other,
        }
    }

    /// Returns and clears the recorded differences.
    pub(crate) fn take(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.0)
    }
}

/// A drive under test, as [`run`] uses it.
pub trait Subject {
    /// Brings drive and line to the start state of a case: the line silent and in sync, the motor
    /// at rest. Clears the transcript.
    fn begin(&mut self) -> Result<(), Stop>;

    /// Undoes the changes of the case, and stops what it started. Called also after a failure.
    fn restore(&mut self) -> Result<(), Stop>;

    /// Whether the user permitted this.
    fn allows(&self, need: Need) -> bool;

    /// The transfers since [`begin`](Self::begin), one line each: `> 02 01 1e 21`.
    fn transcript(&self) -> Vec<String>;

    /// Returns and clears the differences from readings that did not end the case.
    fn differences(&mut self) -> Vec<Finding>;
}

impl<B> Case<B> {
    /// A case without a subject and without needs.
    pub fn new(
        name: impl Into<Cow<'static, str>>,
        clauses: &'static [&'static str],
        run: impl Fn(&mut B) -> Result<(), Stop> + 'static,
    ) -> Self {
        Case { name: name.into(), clauses, needs: &[], reading: None, run: Box::new(run) }
    }

    /// Adds needs.
    pub fn needs(self, needs: &'static [Need]) -> Self {
        Case { needs, ..self }
    }

    /// Marks the whole case as demanded by a reading.
    pub(crate) fn reading(self, reading: Reading) -> Self {
        Case { reading: Some(reading), ..self }
    }
}

/// Runs the cases on a drive. `progress` gets each outcome at once. When the port fails or the
/// drive is lost, the other cases are not run; the report has the reason.
pub fn run<B: Subject>(
    cases: &[Case<B>],
    harness: &mut B,
    mut progress: impl FnMut(&Outcome),
) -> Report {
    let mut report = Report::default();
    let mut dead: Option<String> = None;
    for case in cases {
        let missing = case.needs.iter().find(|&&need| !harness.allows(need));
        let (verdict, differences) = match (&dead, missing) {
            (Some(why), _) => (Verdict::NotRun(why.clone()), Vec::new()),
            (None, Some(need)) => (Verdict::Skipped(need.unmet().to_owned()), Vec::new()),
            (None, None) => conduct(case, harness, &mut dead),
        };
        let transcript = match verdict {
            Verdict::Failed(_) | Verdict::Reading => harness.transcript(),
            Verdict::NotRun(_) if !differences.is_empty() => harness.transcript(),
            _ => Vec::new(),
        };
        let (name, clauses) = (case.name.to_string(), case.clauses);
        let outcome = Outcome { name, clauses, verdict, differences, transcript };
        progress(&outcome);
        report.outcomes.push(outcome);
    }
    report
}

/// Runs a case between `begin` and `restore`. The case also fails if the drive cannot be restored,
/// because the user has to know. `dead` gets the reason if no further case can run. Returns the
/// differences from readings, the first of each reading.
fn conduct<B: Subject>(
    case: &Case<B>,
    harness: &mut B,
    dead: &mut Option<String>,
) -> (Verdict, Vec<Finding>) {
    let begun = harness.begin().map_err(Stop::without_reading);
    // If `begin` failed, there is nothing to restore.
    let (mut outcome, mut restored) = match begun {
        Err(stop @ (Stop::Port(_) | Stop::Lost(_))) => (Err(stop), Ok(())),
        begun => {
            // A panic of this kit must not leave a motor turning.
            let ran = catch_unwind(AssertUnwindSafe(|| {
                begun?;
                let done = (case.run)(harness);
                match case.reading {
                    Some(reading) => done.read_as(reading),
                    None => done,
                }
            }));
            let restored = harness.restore();
            (ran.unwrap_or_else(|panic| resume_unwind(panic)), restored)
        }
    };
    for result in [&outcome, &restored] {
        if let Err(stop @ (Stop::Port(_) | Stop::Lost(_))) = result {
            dead.get_or_insert_with(|| stop.to_string());
        }
    }
    let mut differences: Vec<Finding> = Vec::new();
    let ended = [&mut outcome, &mut restored].into_iter().filter_map(take_difference);
    for finding in harness.differences().into_iter().chain(ended) {
        if differences.iter().all(|known| known.reading != finding.reading) {
            differences.push(finding);
        }
    }
    let verdict = match verdict(outcome, restored) {
        Verdict::Passed | Verdict::Skipped(_) if !differences.is_empty() => Verdict::Reading,
        verdict => verdict,
    };
    (verdict, differences)
}

/// Takes the difference from a reading that ended a case. The case then counts as not failed.
fn take_difference(result: &mut Result<(), Stop>) -> Option<Finding> {
    let finding = match result {
        Err(Stop::Failed(finding)) if finding.reading.is_some() => (**finding).clone(),
        _ => return None,
    };
    *result = Ok(());
    Some(finding)
}

/// The verdict of a case and of restoring the drive.
fn verdict(outcome: Result<(), Stop>, restored: Result<(), Stop>) -> Verdict {
    match (outcome, restored) {
        (Err(Stop::Failed(mut finding)), Err(Stop::Failed(left))) => {
            let Finding { sent, expected, received, .. } = *left;
            finding.received += &format!(
                "; and the drive was not restored: sent {sent}, expected {expected}, received \
                 {received}"
            );
            Verdict::Failed(finding)
        }
        (Err(Stop::Failed(finding)), _) | (_, Err(Stop::Failed(finding))) => {
            Verdict::Failed(finding)
        }
        (Err(Stop::Port(error)), _) | (_, Err(Stop::Port(error))) => {
            Verdict::NotRun(error.to_string())
        }
        (Err(Stop::Lost(why)), _) | (_, Err(Stop::Lost(why))) => Verdict::NotRun(why),
        (Err(Stop::Skipped(why)), _) | (_, Err(Stop::Skipped(why))) => Verdict::Skipped(why),
        (Ok(()), Ok(())) => Verdict::Passed,
    }
}

impl Stop {
    /// The same without a reading as its reason.
    fn without_reading(mut self) -> Self {
        if let Stop::Failed(finding) = &mut self {
            finding.reading = None;
        }
        self
    }
}

impl Need {
    /// The advice to the user if the need is not met.
    pub const fn unmet(self) -> &'static str {
        match self {
            Need::Spin => "turns the motor: run with --spin",
            Need::Rom => "writes the drive's ROM, which wears: run with --write-rom",
            Need::PowerCycle => "needs the power cycled: give a command with --power-cycle",
            Need::Fault => "needs a fault caused: give commands with --fault-on and --fault-off",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reading::{S5, S20};

    /// A drive whose `begin` and `restore` return what the test chooses.
    #[derive(Default)]
    struct Scripted {
        begin: Option<Stop>,
        restore: Option<Stop>,
        restored: u32,
        differences: Differences,
    }

    impl Subject for Scripted {
        fn begin(&mut self) -> Result<(), Stop> {
            self.begin.take().map_or(Ok(()), Err)
        }

        fn restore(&mut self) -> Result<(), Stop> {
            self.restored += 1;
            self.restore.take().map_or(Ok(()), Err)
        }

        fn allows(&self, need: Need) -> bool {
            need == Need::Spin
        }

        fn transcript(&self) -> Vec<String> {
            Vec::new()
        }

        fn differences(&mut self) -> Vec<Finding> {
            self.differences.take()
        }
    }

    fn failed(what: &str) -> Stop {
        let [sent, expected, received] = ["sent", "expected", "received"].map(|s| s.to_owned());
        let expected = format!("{expected} {what}");
        Stop::Failed(Box::new(Finding { sent, expected, received, reading: None }))
    }

    fn lost() -> Stop {
        Stop::Lost("it is gone".to_owned())
    }

    /// Runs two cases. The first is `first`. Returns their verdicts.
    fn verdicts(drive: &mut Scripted, first: fn() -> Result<(), Stop>) -> [Verdict; 2] {
        let cases =
            [Case::new("first", &[], move |_| first()), Case::new("second", &[], |_| Ok(()))];
        let report = run(&cases, drive, |_| {});
        report
            .outcomes
            .into_iter()
            .map(|outcome| outcome.verdict)
            .collect::<Vec<_>>()
            .try_into()
            .unwrap()
    }

    #[test]
    fn a_case_that_cannot_be_undone_fails() {
        let mut drive = Scripted { restore: Some(failed("to be undone")), ..Scripted::default() };
        let [first, second] = verdicts(&mut drive, || Ok(()));
        assert!(matches!(first, Verdict::Failed(finding) if finding.expected.contains("undone")));
        assert_eq!(second, Verdict::Passed);

        let mut drive = Scripted { restore: Some(failed("to be undone")), ..Scripted::default() };
        let [first, _] = verdicts(&mut drive, || Err(failed("to hold")));
        let Verdict::Failed(finding) = first else { panic!("{first:?}") };
        assert_eq!(finding.expected, "expected to hold");
        assert!(
            finding
                .received
                .contains("the drive was not restored: sent sent, expected expected to be undone")
        );
    }

    #[test]
    fn a_lost_drive_ends_the_run_and_keeps_earlier_findings() {
        let mut drive = Scripted { restore: Some(lost()), ..Scripted::default() };
        let [first, second] = verdicts(&mut drive, || Err(failed("to hold")));
        assert!(matches!(first, Verdict::Failed(_)), "{first:?}");
        assert_eq!(second, Verdict::NotRun("it is gone".to_owned()));

        let mut drive = Scripted::default();
        let [first, second] = verdicts(&mut drive, || Err(lost()));
        assert_eq!([first, second], [(); 2].map(|()| Verdict::NotRun("it is gone".to_owned())));
        assert_eq!(drive.restored, 1, "what the case did is undone");

        let mut drive = Scripted { begin: Some(lost()), ..Scripted::default() };
        verdicts(&mut drive, || Ok(()));
        assert_eq!(drive.restored, 0, "nothing was done");
    }

    #[test]
    fn a_case_is_undone_after_a_panic() {
        let mut drive = Scripted::default();
        let run = || verdicts(&mut drive, || panic!("a fault of the case"));
        assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
        assert_eq!(drive.restored, 1);
    }

    #[test]
    fn a_case_without_permission_is_skipped_with_advice() {
        let cases =
            [Case::new("rom", &[], |_: &mut Scripted| Ok(())).needs(&[Need::Spin, Need::Rom])];
        let report = run(&cases, &mut Scripted::default(), |_| {});
        let Verdict::Skipped(why) = &report.outcomes[0].verdict else { panic!("not skipped") };
        assert!(why.contains("--write-rom"), "{why}");
    }

    #[test]
    fn a_difference_from_a_reading_fails_only_a_strict_report() {
        let cases = [
            Case::new("ends", &[], |_: &mut Scripted| Err(failed("S20").read_as(S20))),
            Case::new("goes on", &[], |drive: &mut Scripted| {
                drive.differences.note(S20, Err(failed("first")))?;
                drive.differences.note(S20, Err(failed("second")))?;
                drive.differences.note(S5, Err(failed("third")))?;
                Err(Stop::Skipped("enough".to_owned()))
            }),
            Case::new("all of it", &[], |_: &mut Scripted| Err(failed("S5"))).reading(S5),
            Case::new("fails", &[], |drive: &mut Scripted| {
                drive.differences.note(S5, Err(failed("beside")))?;
                Err(failed("a sentence"))
            }),
        ];
        let report = run(&cases, &mut Scripted::default(), |_| {});
        assert_eq!((report.count("reading"), report.failed().count()), (3, 1));
        assert_eq!(report.outcomes[1].differences.len(), 2, "the first of each reading");
        let clean = Report { outcomes: report.outcomes[..3].to_vec() };
        assert!(clean.is_clean() && !report.is_clean());
        let strict = clean.strict();
        assert_eq!((strict.failed().count(), strict.is_clean()), (3, false));
        let Verdict::Failed(finding) = &strict.outcomes[0].verdict else { panic!("not failed") };
        assert_eq!(finding.reading, Some(S20));
    }

    #[test]
    fn a_drive_that_cannot_be_started_fails_also_in_a_reading() {
        let mut drive =
            Scripted { begin: Some(failed("to begin").read_as(S5)), ..Scripted::default() };
        let cases = [Case::new("reading", &[], |_: &mut Scripted| Ok(())).reading(S5)];
        assert_eq!(run(&cases, &mut drive, |_| {}).failed().count(), 1);
    }
}
