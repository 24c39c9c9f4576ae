//! Settings of motors: dump, diff and restore of files, and single values.

use std::sync::Arc;

use motorlink::settings::{
    Cause, Comparison, Difference, Dump, Permissions, Procedure, RestoreError, SettingsFile,
    Tuning as _, Unread, Writing,
};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::drive_settings::{self, Failed, Tuned};
use motorlink_telemetry::share::message::{MotorName, Reason};
use motorlink_telemetry::share::motor_exchange::{Exchanges, Target};
use motorlink_telemetry::tuned;

use super::motion_control::Control;
use crate::message::{self, Answer};

/// Takes the steps of a procedure, within the limits of the motor.
async fn run<T: Tuned, R>(
    control: &Control,
    exchanges: &Exchanges<'_>,
    tuning: &T,
    procedure: Procedure<'_, T::Id, Failed, R>,
) -> R {
    let check = |request: &Request| {
        control.limited(exchanges.target, |limited| limited.check(request)).map(drop)
    };
    drive_settings::run(check, exchanges, tuning, procedure).await
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
        let file = SettingsFile::parse(text, &tuning).map_err(Refusal::unsent)?;
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
    tuned!(target, |tuning| SettingsFile::parse(&text, &tuning)
        .map(drop)
        .map_err(Refusal::unsent))?;
    let (program, mut listener) = view.again("settings").await?;
    let restoring = tokio::spawn(async move {
        let work = async {
            let exchanges = Exchanges::new(&program, &target);
            let permissions = Permissions { rom: to_rom, running: false };
            tuned!(target, |tuning| {
                let file = SettingsFile::parse(&text, &tuning).map_err(Refusal::unsent)?;
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
        let file = SettingsFile::one(&tuning, name, value).map_err(Refusal::unsent)?;
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
