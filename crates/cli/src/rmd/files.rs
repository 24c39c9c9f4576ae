//! `motorlink rmd dump`, `diff` and `restore`.

use motorlink::rmd::{Error, Motor};
use motorlink::settings::Unread;

use super::session::Session;
use crate::failure::Failure;
use crate::settings::{DumpArgs, FileArg, RestoreArgs, Tuned};

pub fn dump(session: &Session, args: &DumpArgs) -> Result<(), Failure> {
    with(session, |tuned| tuned.dump(args))
}

pub fn diff(session: &Session, args: &FileArg) -> Result<(), Failure> {
    with(session, |tuned| tuned.diff(args))
}

pub fn restore(session: &Session, args: &RestoreArgs) -> Result<(), Failure> {
    with(session, |tuned| tuned.restore(args))
}

/// The motor with its settings. They are those of the motor shaft.
fn with(
    session: &Session,
    run: impl FnOnce(Tuned<'_, Motor<'_>>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let units = &session.units;
    let option = match (units.gear, units.encoder_bits) {
        (Some(_), _) => "--gear-ratio",
        (None, Some(_)) => "--encoder-bits",
        (None, None) if units.raw => "--raw",
        (None, None) => "",
    };
    if !option.is_empty() {
        return Err(Failure::usage(format!(
            "a file has the settings of the motor shaft in their own units, and {option} converts them; \
             nothing was sent"
        ))
        .trying(format!("leave out {option}")));
    }
    let unread = |unread: Unread<Error>| unread.error.into();
    let (output, line, motor) = (session.output, session.line(session.id), session.motor()?);
    run(Tuned { motor, output, line, unread: &unread, write_rom: session.write_rom })
}
