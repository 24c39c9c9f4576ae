//! Cases: what is done to a drive and what must come of it.

use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use motorlink::port::PortError;

use crate::finding::Finding;
use crate::reading::Reading;
use crate::report::{Outcome, Report, Verdict};
use crate::world::Unavailable;

/// What a case needs the user's leave or help for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Need {
    /// The motor turns.
    Spin,
    /// The drive's ROM is written, which wears.
    Rom,
    /// The drive's power is cycled.
    PowerCycle,
    /// A fault is caused from outside.
    Fault,
}

/// A test of one or a few clauses on a drive behind a harness `B`.
pub struct Case<B> {
    /// What must hold, as a sentence in snake case; a subject may follow in brackets:
    /// `registers_read_in_their_size[SPEED_MEAS]`.
    pub name: Cow<'static, str>,
    /// Ids of the clauses that it tests.
    pub clauses: &'static [&'static str],
    /// What it needs.
    pub needs: &'static [Need],
    /// The reading that all of it demands; `None` where sentences of the document do.
    pub reading: Option<Reading>,
    /// The test.
    pub run: Run<B>,
}

/// What a case does.
pub type Run<B> = Box<dyn Fn(&mut B) -> Result<(), Stop>>;

/// Why a case did not pass.
#[derive(Debug, thiserror::Error)]
pub enum Stop {
    /// The drive did something else.
    #[error("{0:?}")]
    Failed(Box<Finding>),
    /// The case does not apply to this drive, or cannot be run; why.
    #[error("{0}")]
    Skipped(String),
    /// The port failed: nothing is known about the drive.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The drive cannot be tested any further, such as one that does not answer at all; why.
    #[error("{0}")]
    Lost(String),
}

impl From<Unavailable> for Stop {
    fn from(error: Unavailable) -> Self {
        Stop::Skipped(error.0)
    }
}

/// Says that what failed is demanded by a reading, not by a sentence.
pub(crate) trait ReadAs {
    /// The same with the reading, unless it has one.
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
pub(crate) struct Beside(Vec<Finding>);

impl Beside {
    /// Notes what failed, if anything, and lets the case go on.
    pub(crate) fn note(&mut self, reading: Reading, result: Result<(), Stop>) -> Result<(), Stop> {
        match result.read_as(reading) {
            Err(Stop::Failed(finding)) => {
                self.0.push(*finding);
                Ok(())
            }
            other => other,
        }
    }

    /// What was noted; it is forgotten.
    pub(crate) fn take(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.0)
    }
}

/// A drive under test, as [`run`] sees it.
pub trait Subject {
    /// Brings drive and line to where a case may begin: the line silent and in step, the motor at
    /// rest. Forgets the transcript.
    fn begin(&mut self) -> Result<(), Stop>;

    /// Undoes what the case wrote and started, whatever came of it.
    fn restore(&mut self) -> Result<(), Stop>;

    /// Whether the user allowed this.
    fn allows(&self, need: Need) -> bool;

    /// What passed the wire since [`begin`](Self::begin), a line each: `> 02 01 1e 21`.
    fn transcript(&self) -> Vec<String>;

    /// Differences from readings that did not end the case; they are forgotten.
    fn differences(&mut self) -> Vec<Finding>;
}

impl<B> Case<B> {
    /// A case without a subject that needs nothing.
    pub fn new(
        name: impl Into<Cow<'static, str>>,
        clauses: &'static [&'static str],
        run: impl Fn(&mut B) -> Result<(), Stop> + 'static,
    ) -> Self {
        Case { name: name.into(), clauses, needs: &[], reading: None, run: Box::new(run) }
    }

    /// The same with needs.
    pub fn needs(self, needs: &'static [Need]) -> Self {
        Case { needs, ..self }
    }

    /// The same, all of which a reading demands.
    pub(crate) fn reading(self, reading: Reading) -> Self {
        Case { reading: Some(reading), ..self }
    }
}

/// Puts a drive through the cases; `progress` sees each outcome as it comes. When the port fails, or
/// the drive is lost, the rest is not run, and the report says so.
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

/// A case between `begin` and `restore`. A drive that cannot be restored fails the case, too: the
/// user has to know. `dead` is told why nothing more can be run. Gives the differences from readings,
/// the first of each.
fn conduct<B: Subject>(
    case: &Case<B>,
    harness: &mut B,
    dead: &mut Option<String>,
) -> (Verdict, Vec<Finding>) {
    let begun = harness.begin().map_err(Stop::without_reading);
    // What cannot be begun with has nothing to be restored.
    let (mut outcome, mut restored) = match begun {
        Err(stop @ (Stop::Port(_) | Stop::Lost(_))) => (Err(stop), Ok(())),
        begun => {
            // A fault of this kit must not leave a motor turning.
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

/// The difference from a reading that ended a case, which is then no failure.
fn take_difference(result: &mut Result<(), Stop>) -> Option<Finding> {
    let finding = match result {
        Err(Stop::Failed(finding)) if finding.reading.is_some() => (**finding).clone(),
        _ => return None,
    };
    *result = Ok(());
    Some(finding)
}

/// What came of a case, and of restoring the drive.
fn verdict(outcome: Result<(), Stop>, restored: Result<(), Stop>) -> Verdict {
    match (outcome, restored) {
        (Err(Stop::Failed(mut finding)), Err(Stop::Failed(left))) => {
            let Finding { sent, expected, received, .. } = *left;
            finding.received += &format!(
                "; and it was not left as it was found: sent {sent}, expected {expected}, received \
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
    /// The same, of which no reading is the reason.
    fn without_reading(mut self) -> Self {
        if let Stop::Failed(finding) = &mut self {
            finding.reading = None;
        }
        self
    }
}

impl Need {
    /// What to say where it is not met.
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

    /// A drive whose `begin` and `restore` end as they are told to.
    #[derive(Default)]
    struct Told {
        begin: Option<Stop>,
        restore: Option<Stop>,
        restored: u32,
        beside: Beside,
    }

    impl Subject for Told {
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
            self.beside.take()
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

    /// Runs two cases, of which the first ends as told; their verdicts.
    fn verdicts(told: &mut Told, first: fn() -> Result<(), Stop>) -> [Verdict; 2] {
        let cases =
            [Case::new("first", &[], move |_| first()), Case::new("second", &[], |_| Ok(()))];
        let report = run(&cases, told, |_| {});
        report
            .outcomes
            .into_iter()
            .map(|outcome| outcome.verdict)
            .collect::<Vec<_>>()
            .try_into()
            .unwrap()
    }

    #[test]
    fn a_case_that_cannot_be_undone_fails_and_says_so() {
        let mut told = Told { restore: Some(failed("to be undone")), ..Told::default() };
        let [first, second] = verdicts(&mut told, || Ok(()));
        assert!(matches!(first, Verdict::Failed(finding) if finding.expected.contains("undone")));
        assert_eq!(second, Verdict::Passed);

        let mut told = Told { restore: Some(failed("to be undone")), ..Told::default() };
        let [first, _] = verdicts(&mut told, || Err(failed("to hold")));
        let Verdict::Failed(finding) = first else { panic!("{first:?}") };
        assert_eq!(finding.expected, "expected to hold");
        assert!(
            finding
                .received
                .contains("not left as it was found: sent sent, expected expected to be undone")
        );
    }

    #[test]
    fn a_drive_that_is_lost_ends_the_run_and_keeps_what_was_found() {
        let mut told = Told { restore: Some(lost()), ..Told::default() };
        let [first, second] = verdicts(&mut told, || Err(failed("to hold")));
        assert!(matches!(first, Verdict::Failed(_)), "{first:?}");
        assert_eq!(second, Verdict::NotRun("it is gone".to_owned()));

        let mut told = Told::default();
        let [first, second] = verdicts(&mut told, || Err(lost()));
        assert_eq!([first, second], [(); 2].map(|()| Verdict::NotRun("it is gone".to_owned())));
        assert_eq!(told.restored, 1, "what the case did is undone");

        let mut told = Told { begin: Some(lost()), ..Told::default() };
        verdicts(&mut told, || Ok(()));
        assert_eq!(told.restored, 0, "nothing was done");
    }

    #[test]
    fn what_a_case_did_is_undone_when_it_panics() {
        let mut told = Told::default();
        let run = || verdicts(&mut told, || panic!("a fault of the case"));
        assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
        assert_eq!(told.restored, 1);
    }

    #[test]
    fn what_is_not_allowed_is_skipped_with_what_to_do() {
        let cases = [Case::new("rom", &[], |_: &mut Told| Ok(())).needs(&[Need::Spin, Need::Rom])];
        let report = run(&cases, &mut Told::default(), |_| {});
        let Verdict::Skipped(why) = &report.outcomes[0].verdict else { panic!("not skipped") };
        assert!(why.contains("--write-rom"), "{why}");
    }

    #[test]
    fn a_difference_from_a_reading_is_no_failure_unless_readings_are_strict() {
        let cases = [
            Case::new("ends", &[], |_: &mut Told| Err(failed("S20").read_as(S20))),
            Case::new("goes on", &[], |told: &mut Told| {
                told.beside.note(S20, Err(failed("first")))?;
                told.beside.note(S20, Err(failed("second")))?;
                told.beside.note(S5, Err(failed("third")))?;
                Err(Stop::Skipped("enough".to_owned()))
            }),
            Case::new("all of it", &[], |_: &mut Told| Err(failed("S5"))).reading(S5),
            Case::new("fails", &[], |told: &mut Told| {
                told.beside.note(S5, Err(failed("beside")))?;
                Err(failed("a sentence"))
            }),
        ];
        let report = run(&cases, &mut Told::default(), |_| {});
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
    fn a_drive_that_cannot_be_begun_with_fails_whatever_the_case_reads() {
        let mut told = Told { begin: Some(failed("to begin").read_as(S5)), ..Told::default() };
        let cases = [Case::new("reading", &[], |_: &mut Told| Ok(())).reading(S5)];
        assert_eq!(run(&cases, &mut told, |_| {}).failed().count(), 1);
    }
}
