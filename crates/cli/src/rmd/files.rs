//! `motorlink rmd dump`, `diff` and `restore`.

use motorlink::rmd::Error;
use motorlink::settings::Unread;

use super::session::Session;
use crate::failure::Failure;
use crate::settings::{Task, Tuned, refuse_conversion};

/// Carries out a task for the motor. Its settings are those of the motor shaft.
pub fn run(session: &Session, task: Task<'_>) -> Result<(), Failure> {
    let units = &session.units;
    let option = match (units.gear, units.encoder_bits) {
        (Some(_), _) => "--gear-ratio",
        (None, Some(_)) => "--encoder-bits",
        (None, None) if units.raw => "--raw",
        (None, None) => "",
    };
    refuse_conversion(option, "the settings of the motor shaft in their own units")?;
    let unread = |unread: Unread<Error>| unread.error.into();
    let (output, line, motor) = (session.output, session.line(session.id), session.motor()?);
    let write_rom = session.write_rom;
    Tuned { motor, output, line, unread: &unread, write_rom }.carry_out(task)
}
