//! `motorlink st dump`, `diff` and `restore`.

use motorlink::settings::Unread;
use motorlink::st::{Error, Motor, RegisterId};

use super::read::note_other_profile;
use super::refusal;
use super::session::Session;
use crate::failure::Failure;
use crate::settings::{DumpArgs, FileArg, RestoreArgs, Tuned};

pub fn dump(session: &Session, args: &DumpArgs) -> Result<(), Failure> {
    note_other_profile(session, &session.client.board_info()?);
    with(session, |tuned| tuned.dump(args))
}

pub fn diff(session: &Session, args: &FileArg) -> Result<(), Failure> {
    with(session, |tuned| tuned.diff(args))
}

pub fn restore(session: &Session, args: &RestoreArgs) -> Result<(), Failure> {
    with(session, |tuned| tuned.restore(args))
}

/// The motor with its settings. They are in the units of the registers.
fn with(
    session: &Session,
    run: impl FnOnce(Tuned<'_, Motor<'_>>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let option = match session.full_scale {
        Some(_) => "--full-scale",
        None if session.raw => "--raw",
        None => "",
    };
    if !option.is_empty() {
        return Err(Failure::usage(format!(
            "a file has settings in the units of the registers, and {option} converts them; nothing was \
             sent"
        ))
        .trying(format!("leave out {option}")));
    }
    let unread = |unread: Unread<Error>| {
        let register = unread.settings.first().and_then(|name| RegisterId::named(name));
        match register {
            Some(register) => refusal::of_read(unread.error, register, session.client.profile()),
            None => unread.error.into(),
        }
    };
    let (output, line, motor) = (session.output, session.line(), session.motor()?);
    run(Tuned { motor, output, line, unread: &unread, write_rom: false })
}
