//! Identity and settings of a motor, read through the engine.

use std::sync::Arc;

use motorlink::settings::{Answer, Dump, Next, RmdTuning, StTuning, Step, StepError, Tuning};
use motorlink_proto::st::Profile;
use motorlink_proto::time::Micros;
use motorlink_telemetry::event::CommandError;
use motorlink_telemetry::line::{LineError, Reply, Request};
use motorlink_telemetry::runner::Remote;
use motorlink_telemetry::signal::Motor;

/// A question that is not sent in this time is given up.
const TIME_TO_LIVE: Micros = Micros(2_000_000);

/// Reads the settings of a motor.
///
/// # Errors
/// The motor does not answer, or the line fails.
pub(super) fn read(
    remote: &Remote,
    by: &Arc<str>,
    motor: Motor,
    profile: Profile,
) -> Result<Dump, CommandError> {
    match motor {
        Motor::St(number) => {
            let tuning = StTuning { motor: number, profile };
            dump(remote, by, motor, tuning, |(to, request)| Request::St(to, request))
        }
        Motor::Rmd(id) => {
            dump(remote, by, motor, RmdTuning { motor: id }, |data| Request::Rmd(id, data))
        }
    }
}

/// Why a step was not carried out.
struct Failed(CommandError);

impl StepError for Failed {
    fn is_refusal(&self) -> bool {
        match &self.0 {
            CommandError::Line(LineError::St(error)) => error.is_refusal(),
            // A motor that does not know a command is silent. The end of the dump asks whether it is
            // there.
            CommandError::Line(LineError::Rmd(error)) => error.is_line_failure(),
            _ => false,
        }
    }

    fn is_line_failure(&self) -> bool {
        matches!(&self.0, CommandError::Line(error) if error.is_line_failure())
    }

    fn is_interruption(&self) -> bool {
        false
    }
}

fn dump<T: Tuning + Clone + Send + Sync>(
    remote: &Remote,
    by: &Arc<str>,
    motor: Motor,
    tuning: T,
    request: impl Fn(T::Request) -> Request,
) -> Result<Dump, CommandError> {
    let mut procedure = Dump::reading::<T, Failed>(tuning.clone());
    loop {
        let outcome = match procedure.next() {
            Next::Done(dump) => return dump.map_err(|Failed(error)| error),
            Next::Step(Step::Ask(ask)) => {
                let reply = remote.command(by, request(tuning.request(&ask)), TIME_TO_LIVE);
                reply.and_then(|reply| {
                    let answer = match &reply {
                        Reply::St(payload) => tuning.answer(&ask, payload),
                        Reply::Rmd(data) => tuning.answer(&ask, data),
                        Reply::Confirmed => None,
                    };
                    answer.ok_or(CommandError::Line(LineError::Reply))
                })
            }
            // It writes nothing, so no limit forbids it.
            Next::Step(Step::Check(_)) => Ok(Answer::default()),
            Next::Step(Step::Confirm) => {
                remote.command(by, Request::Confirm(motor), TIME_TO_LIVE).map(|_| Answer::default())
            }
        };
        procedure.answered(outcome.map_err(Failed));
    }
}
