//! `motorlink st dump`, `diff` and `restore`.

use motorlink::settings::Unread;
use motorlink::st::{Error, RegisterId};

use super::read::note_other_profile;
use super::refusal;
use super::session::Session;
use crate::failure::Failure;
use crate::settings::{Task, Tuned, refuse_conversion};

/// Carries out a task for the motor. Its settings are in the units of the registers.
pub fn run(session: &Session, task: Task<'_>) -> Result<(), Failure> {
    let option = match session.full_scale {
        Some(_) => "--full-scale",
        None if session.raw => "--raw",
        None => "",
    };
    refuse_conversion(option, "settings in the units of the registers")?;
    if matches!(task, Task::Dump(_)) {
        note_other_profile(session, &session.client.board_info()?);
    }
    let unread = |unread: Unread<Error>| {
        let register = unread.settings.first().and_then(|name| RegisterId::named(name));
        match register {
            Some(register) => refusal::of_read(unread.error, register, session.client.profile()),
            None => unread.error.into(),
        }
    };
    let (output, line, motor) = (session.output, session.line(), session.motor()?);
    Tuned { motor, output, line, unread: &unread, write_rom: false }.carry_out(task)
}
