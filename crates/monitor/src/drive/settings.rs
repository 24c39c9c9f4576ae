//! Settings of motors: dump, diff and restore of files, and single values.

use std::fmt;
use std::sync::Arc;

use motorlink::settings::{
    Ask, Cause, Comparison, Difference, Dump, FileError, Next, Permissions, Procedure,
    RestoreError, RmdTuning, SettingsFile, StTuning, Step, StepError, Tuning, Unread, Writing,
    identify,
};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::{MotorName, Reason};
use motorlink_telemetry::share::motor_exchange::{Exchanges, Target, is_refused_by_motor};
use motorlink_telemetry::signal::Motor;

use super::motion_control::Control;
use crate::message::{self, Answer};

/// The settings of a motor of either protocol.
pub(super) trait Tuned: Tuning<Id: 'static> + Copy + Send + Sync + 'static {
    /// The request that asks this.
    fn line_request(&self, ask: &Ask<Self::Id>) -> Request;
}

impl Tuned for StTuning {
    fn line_request(&self, ask: &Ask<Self::Id>) -> Request {
        let (motor, request) = self.request(ask);
        Request::St(motor, request)
    }
}

impl Tuned for RmdTuning {
    fn line_request(&self, ask: &Ask<Self::Id>) -> Request {
        Request::Rmd(self.motor, self.request(ask))
    }
}

/// Evaluates an expression with the tuning of a motor.
macro_rules! tuned {
    ($target:expr, |$tuning:ident| $then:expr) => {
        match ($target.motor, $target.speaks) {
            (Motor::St(motor), DriveProtocol::St(profile)) => {
                let $tuning = StTuning { motor, profile };
                $then
            }
            (Motor::Rmd(motor), _) => {
                let $tuning = RmdTuning { motor };
                $then
            }
            (Motor::St(_), DriveProtocol::Rmd) => {
                Err(Refusal::usage("the line has drives of another protocol"))
            }
        }
    };
}

/// An exchange that failed.
#[derive(Debug, Clone, PartialEq)]
struct Failed {
    refusal: Refusal,
    /// Whether the session has ended, so that nothing more can be sent.
    is_end: bool,
}

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.refusal.message)
    }
}

impl StepError for Failed {
    fn is_refusal(&self) -> bool {
        is_refused_by_motor(&self.refusal)
    }

    fn is_line_failure(&self) -> bool {
        use Reason::{Displaced, Line, Silent, Unconfirmed};
        !self.is_end && matches!(self.refusal.reason, Silent | Line | Unconfirmed | Displaced)
    }

    fn is_interruption(&self) -> bool {
        self.is_end
    }
}

/// Takes the steps of a procedure.
async fn run<T: Tuned, R>(
    control: &Control,
    exchanges: &Exchanges<'_>,
    tuning: &T,
    mut procedure: Procedure<'_, T::Id, Failed, R>,
) -> R {
    loop {
        let outcome = match procedure.next() {
            Next::Done(result) => return result,
            Next::Step(Step::Ask(ask)) => {
                let reply = exchanges.request(&tuning.line_request(&ask)).await;
                reply.and_then(|reply| tuning.answer(&ask, &reply).ok_or_else(|| exchanges.unfit()))
            }
            Next::Step(Step::Check(ask)) => {
                let request = tuning.line_request(&ask);
                control
                    .limited(exchanges.target, |limited| limited.check(&request))
                    .map(|_| Default::default())
            }
            Next::Step(Step::Confirm) => exchanges.confirm().await.map(|()| Default::default()),
        };
        let is_end = exchanges.program.has_ended();
        procedure.answered(outcome.map_err(|refusal| Failed { refusal, is_end }));
    }
}

/// What is known of a drive, in lines.
pub(super) async fn identity(
    control: &Control,
    exchanges: &Exchanges<'_>,
) -> Result<Vec<String>, Refusal> {
    let _lane = exchanges.lane().await;
    tuned!(exchanges.target, |tuning| {
        let lines = run(control, exchanges, &tuning, identify(tuning)).await;
        lines.map_err(|failed| failed.refusal)
    })
}

/// Reads all settings of a motor.
pub(super) async fn dump(control: &Control, exchanges: &Exchanges<'_>) -> Result<Dump, Refusal> {
    let _lane = exchanges.lane().await;
    tuned!(exchanges.target, |tuning| {
        let dump = run(control, exchanges, &tuning, Dump::reading(tuning)).await;
        dump.map_err(|failed| failed.refusal)
    })
}

/// A dump as the answer to a page.
pub(super) fn as_file(name: &MotorName, dump: &Dump) -> Answer {
    let file = format!("{}_motor{}.toml", name.line, name.motor);
    let refused = |name: &String| format!("the motor refuses to read {name}");
    let warnings = dump.absent().iter().map(refused).collect();
    Answer::Dump { text: dump.text(), file, warnings }
}

/// Compares a file with a motor.
pub(super) async fn diff(
    control: &Control,
    exchanges: &Exchanges<'_>,
    text: &str,
) -> Result<Answer, Refusal> {
    let _lane = exchanges.lane().await;
    let differences = tuned!(exchanges.target, |tuning| {
        let file = SettingsFile::parse(text, &tuning).map_err(not_a_file)?;
        let comparison = compare(control, exchanges, tuning, &file).await?;
        Ok(comparison.differences().map(|one| described(&one)).collect())
    })?;
    Ok(Answer::Diff { differences })
}

/// Writes what differs between a file and a motor. It has a session of its own, and continues if the page
/// leaves: a motor with settings of two files is worse than one with those of either.
pub(super) async fn restore(
    control: &Arc<Control>,
    view: &Program,
    target: Target,
    text: String,
    to_rom: bool,
) -> Result<Answer, Refusal> {
    let control = Arc::clone(control);
    // Nothing is sent for a file that is not one.
    tuned!(target, |tuning| SettingsFile::parse(&text, &tuning).map(drop).map_err(not_a_file))?;
    let (program, mut listener) = view.again("settings").await?;
    let restoring = tokio::spawn(async move {
        let work = async {
            let exchanges = Exchanges::new(&program, &target);
            let permissions = Permissions { rom: to_rom, running: false };
            tuned!(target, |tuning| {
                let file = SettingsFile::parse(&text, &tuning).map_err(not_a_file)?;
                let written = set(&control, &exchanges, tuning, &file, permissions).await?;
                Ok(Answer::Restore { written })
            })
        };
        let listening = async { while listener.next().await.is_ok() {} };
        tokio::pin!(work);
        tokio::select! {
            result = &mut work => result,
            // Whatever waits for an answer ends, too.
            () = listening => {
                program.close();
                work.await
            }
        }
    });
    let lost =
        || Refusal::new(Reason::Line, "the restore ended without a result; compare the settings");
    restoring.await.unwrap_or_else(|_| Err(lost()))
}

/// Writes one setting; gives the names of all settings that the same request writes.
pub(super) async fn write(
    control: &Control,
    exchanges: &Exchanges<'_>,
    name: &str,
    value: f64,
    to_rom: bool,
) -> Result<Vec<String>, Refusal> {
    let _lane = exchanges.lane().await;
    let permissions = Permissions { rom: to_rom, running: true };
    tuned!(exchanges.target, |tuning| {
        let file = SettingsFile::one(&tuning, name, value)
            .map_err(|problem| Refusal::usage(format!("{problem}; nothing was sent")))?;
        set(control, exchanges, tuning, &file, permissions).await?;
        let has = |names: &Vec<String>| names.iter().any(|one| one == name);
        let blocks = tuning.blocks().into_iter();
        let names = blocks.map(|block| block.settings.into_iter().map(|one| one.name).collect());
        Ok(names.into_iter().find(has).unwrap_or_default())
    })
}

/// Writes what differs, and gives it.
async fn set<T: Tuned>(
    control: &Control,
    exchanges: &Exchanges<'_>,
    tuning: T,
    file: &SettingsFile,
    permissions: Permissions,
) -> Result<Vec<message::Difference>, Refusal> {
    let comparison = compare(control, exchanges, tuning, file).await?;
    let restoring = comparison.restoring(permissions, || false);
    run(control, exchanges, &tuning, restoring).await.map_err(not_restored)?;
    Ok(comparison.differences().map(|one| described(&one)).collect())
}

async fn compare<T: Tuned>(
    control: &Control,
    exchanges: &Exchanges<'_>,
    tuning: T,
    file: &SettingsFile,
) -> Result<Comparison<T::Id>, Refusal> {
    let reading = Comparison::reading(tuning, file);
    run(control, exchanges, &tuning, reading).await.map_err(|unread: Unread<Failed>| {
        let message = unread.to_string();
        Refusal { message, ..unread.error.refusal }
    })
}

fn not_a_file(error: FileError) -> Refusal {
    Refusal::usage(format!("{error}; nothing was sent"))
}

fn not_restored(error: RestoreError<Failed>) -> Refusal {
    let message = match &error {
        RestoreError::Running { .. } => format!("{error}; stop it first"),
        _ => error.to_string(),
    };
    let reason = match &error {
        RestoreError::Fixed { .. } | RestoreError::Rom { .. } => Reason::Usage,
        RestoreError::Before(failed) => failed.refusal.reason,
        RestoreError::Undone(undone) => match &undone.cause {
            Cause::Exchange { error, .. } => error.refusal.reason,
            Cause::Differs { .. } | Cause::Interrupted => Reason::Refused,
        },
        _ => Reason::Refused,
    };
    Refusal::new(reason, message)
}

fn described(one: &Difference<'_>) -> message::Difference {
    let fixed = "the motor cannot change it: the file is for another kind of drive";
    message::Difference {
        name: one.setting.name.clone(),
        unit: one.setting.scale.symbol.to_owned(),
        now: one.setting.number(one.now),
        file: one.setting.number(one.file),
        wears_rom: one.writing == Writing::Permanent,
        fixed: (one.writing == Writing::Fixed).then(|| fixed.to_owned()),
    }
}
