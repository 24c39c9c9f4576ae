//! `motorlink st set`: the value before and after.

use std::convert::Infallible;

use motorlink::st::{
    Error, Reading, RegisterId, Request, Unverified, VerifiedWrite, find_register,
};

use super::session::Session;
use super::{mode, refusal};
use crate::failure::Failure;
use crate::json::Line;

/// The result of reading a register.
enum Look {
    Value(Reading),
    /// Why there is no value.
    Unreadable(String),
}

pub fn run(session: &Session, name: &str, text: &str, attempts: Option<u8>) -> Result<(), Failure> {
    let register = find_register(name)?;
    let profile = session.client.profile();
    let bits = session.bits(register, text)?;
    let motor = session.motor()?;
    let (bytes, size) = (bits.to_le_bytes(), usize::from(register.write_size(profile)));
    let write = Request::SetRegister { register, value: &bytes[..size.min(bytes.len())] };
    session.client.check(session.motor, &write)?;
    let comparable = VerifiedWrite::new::<Infallible>(profile, register, bits);
    if let (Some(attempts), Err(_)) = (attempts, comparable) {
        // Refused by the library: nothing is sent.
        motor.set_raw_verified(register, bits, attempts)?;
    }
    let before = look(session, register, attempts.unwrap_or(1))
        .map_err(|failure| failure.with_fact(format!("{register} was not written")))?;
    let (attempt, after) = match (attempts, &comparable) {
        (Some(attempts), Ok(write)) => {
            let attempt = motor.set_raw_verified(register, bits, attempts)?;
            (Some(attempt), Look::Value(session.reading(register, write.expected())))
        }
        _ => {
            let done = motor.set_raw(register, bits, register.write_size(profile));
            done.map_err(|error| match refusal::is_about_register(&error) {
                true => refusal::of_write(error, register, profile),
                false => error.into(),
            })?;
            let after = look(session, register, 1).map_err(|failure| {
                failure.with_fact(format!(
                    "the drive acknowledged writing {register}, but it could not be read back"
                ))
            })?;
            (None, after)
        }
    };
    let output = session.confirmed()?;
    if let (Ok(write), Look::Value(after)) = (comparable, &after)
        && after.bits != write.expected()
    {
        let (expected, read) = (write.expected(), after.bits);
        return Err(Error::Differs { motor: motor.number(), register, expected, read }.into());
    }
    if let Look::Value(after) = &after
        && register == RegisterId::CONTROL_MODE
        && after.bits != bits
    {
        let read = after.bits;
        return Err(Error::Differs { motor: motor.number(), register, expected: bits, read }.into());
    }
    let mut said = format!("{}: {}", motor.number(), words(session, register, &before, &after));
    if let (Err(Unverified::Acts), Look::Value(after)) = (comparable, &after)
        && after.bits != bits
    {
        let written = session.text(&session.reading(register, bits));
        said +=
            &format!("; {written} was written, and the drive may change this register by itself");
    }
    if mode::is_torque_command(register, bits) {
        said += &format!("; {}", session.torque_control());
    }
    if let Some(attempt @ 2..) = attempt {
        said += &format!(" (written {attempt} times)");
    }
    let mut object = session.line().ok(true);
    object = with_look(object, session, "before", &before);
    object = with_look(object, session, "values", &after);
    if let Some(attempt) = attempt {
        object = object.with("attempts", attempt);
    }
    output.result(said, object)
}

/// Reads the register, unless the table says that it cannot be read. A line that fails in each of
/// `attempts` is an error.
fn look(session: &Session, register: RegisterId, attempts: u8) -> Result<Look, Failure> {
    if let Some(known) = refusal::unreadable(register, session.client.profile()) {
        return Ok(Look::Unreadable(known.fact));
    }
    let motor = session.motor()?;
    let mut read = motor.get_raw(register);
    for _ in 1..attempts {
        if read.as_ref().is_err_and(Error::is_line_failure) {
            read = motor.get_raw(register);
        }
    }
    match read {
        Ok(bits) => session.plausible(register, bits).map(Look::Value),
        Err(Error::Refused { code, .. }) => {
            Ok(Look::Unreadable(format!("the drive refuses to read it ({code})")))
        }
        Err(error) => Err(error.into()),
    }
}

fn words(session: &Session, register: RegisterId, before: &Look, after: &Look) -> String {
    match (before, after) {
        (Look::Value(before), Look::Value(after)) => {
            let [before, after] = [before, after].map(|reading| session.text(reading));
            format!("{register} was {before}, is {after}")
        }
        (Look::Unreadable(why), Look::Value(after)) => {
            let after = session.text(after);
            format!("{register} is {after}; its old value is unknown: {why}")
        }
        (Look::Value(before), Look::Unreadable(why)) => {
            let before = session.text(before);
            format!("{register} was {before} and is written; its new value is unknown: {why}")
        }
        (Look::Unreadable(why), Look::Unreadable(_)) => {
            format!("{register} is written; its value is unknown: {why}")
        }
    }
}

fn with_look(object: Line, session: &Session, name: &str, look: &Look) -> Line {
    match look {
        Look::Value(reading) => object.with_values(name, &[session.row(reading)]),
        Look::Unreadable(_) => object,
    }
}
