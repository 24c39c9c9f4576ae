//! The search for the motors of a line.

use std::sync::Arc;

use motorlink::st::Error;
use motorlink_proto::rmd::{MotorId, MotorSet, ReadStatus};
use motorlink_proto::st::{ErrorCode, MotorNumber, RegisterId, Request as StRequest};
use motorlink_proto::time::Micros;

use crate::event::CommandError;
use crate::line::{LineError, Request};
use crate::runner::Remote;
use crate::share::message::Protocol;
use crate::signal::Motor;

/// A question that is not sent in this time is given up.
const TIME_TO_LIVE: Micros = Micros(2_000_000);

/// Searches for motors. Returns those that reply.
///
/// # Errors
/// No motor replies.
pub fn motors(
    remote: &Remote,
    by: &Arc<str>,
    protocol: Protocol,
) -> Result<Vec<Motor>, CommandError> {
    match protocol {
        Protocol::St => st_motors(remote, by),
        // On a busy machine the replies of all may be late.
        Protocol::Rmd => rmd_motors(remote, by).or_else(|_| rmd_motors(remote, by)),
    }
}

/// The motors that the drive has.
fn st_motors(remote: &Remote, by: &Arc<str>) -> Result<Vec<Motor>, CommandError> {
    let mut found = Vec::new();
    for number in (1..=u8::MAX).map_while(MotorNumber::new) {
        let read = Request::st(number.number(), StRequest::GetRegister(RegisterId::STATUS));
        match remote.command(by, read, TIME_TO_LIVE) {
            Ok(_) => found.push(Motor::St(number)),
            Err(CommandError::Line(LineError::St(Error::Refused { code, .. }))) => {
                if code != ErrorCode::BadMotorSelected {
                    found.push(Motor::St(number));
                }
            }
            // The drive no longer replies: do not wait for the other numbers.
            Err(error) if found.is_empty() => return Err(error),
            Err(_) => break,
        }
    }
    Ok(found)
}

fn rmd_motors(remote: &Remote, by: &Arc<str>) -> Result<Vec<Motor>, CommandError> {
    // One reply may be late.
    let ask_once = |id: MotorId| remote.command(by, Request::rmd(id, &ReadStatus), TIME_TO_LIVE);
    let ask = |id: MotorId| ask_once(id).or_else(|_| ask_once(id));
    let answers: Vec<_> = std::thread::scope(|scope| {
        let asked: Vec<_> = MotorSet::ALL.map(|id| (id, scope.spawn(move || ask(id)))).collect();
        let joined = asked.into_iter().map(|(id, asked)| (id, asked.join()));
        joined.filter_map(|(id, answer)| Some((id, answer.ok()?))).collect()
    });
    let answer = answers.iter().filter(|(_, answer)| answer.is_ok());
    let found: Vec<Motor> = answer.map(|(id, _)| Motor::Rmd(*id)).collect();
    match answers.into_iter().find_map(|(_, answer)| answer.err()) {
        Some(error) if found.is_empty() => Err(error),
        _ => Ok(found),
    }
}
