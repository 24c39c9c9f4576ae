//! Settings of motors at a share: steps of their procedures as exchanges, and reading them.

use std::fmt;

use motorlink::settings::{Ask, Dump, Next, Procedure, Step, StepError, Tuning, identify};
pub use motorlink::settings::{RmdTuning, StTuning};

use super::client::Refusal;
use super::message::Reason;
use super::motor_exchange::{Exchanges, is_refused_by_motor};
use crate::line::Request;

/// The settings of a motor of either protocol.
pub trait Tuned: Tuning<Id: Send + Sync + 'static> + Copy + Send + Sync + 'static {
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
#[macro_export]
macro_rules! tuned {
    ($target:expr, |$tuning:ident| $then:expr) => {{
        use $crate::share::drive_protocol::DriveProtocol;
        use $crate::share::drive_settings::{RmdTuning, StTuning};
        use $crate::signal::Motor;
        match ($target.motor, $target.speaks) {
            (Motor::St(motor), DriveProtocol::St(profile)) => {
                let $tuning = StTuning { motor, profile };
                $then
            }
            (Motor::Rmd(motor), _) => {
                let $tuning = RmdTuning { motor };
                $then
            }
            (Motor::St(_), DriveProtocol::Rmd) => Err($crate::share::client::Refusal::usage(
                "the line has drives of another protocol",
            )),
        }
    }};
}

/// An exchange that failed.
#[derive(Debug, Clone, PartialEq)]
pub struct Failed {
    /// Why.
    pub refusal: Refusal,
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

/// Takes the steps of a procedure. `check` says which writes are refused.
pub async fn run<T: Tuned, R>(
    check: impl Fn(&Request) -> Result<(), Refusal>,
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
                check(&tuning.line_request(&ask)).map(|()| Default::default())
            }
            Next::Step(Step::Confirm) => exchanges.confirm().await.map(|()| Default::default()),
        };
        let is_end = exchanges.program.has_ended();
        procedure.answered(outcome.map_err(|refusal| Failed { refusal, is_end }));
    }
}

/// What is known of a drive, in lines: [`Dump::identity`], without the settings.
///
/// # Errors
/// The line fails. The motor is unknown or silent.
pub async fn identity(exchanges: &Exchanges<'_>) -> Result<Vec<String>, Refusal> {
    let _lane = exchanges.lane().await;
    tuned!(exchanges.target, |tuning| {
        let lines = run(reads, exchanges, &tuning, identify(tuning)).await;
        lines.map_err(|failed| failed.refusal)
    })
}

/// Reads all settings of a motor.
///
/// # Errors
/// The line fails. The motor is unknown or silent.
pub async fn dump(exchanges: &Exchanges<'_>) -> Result<Dump, Refusal> {
    let _lane = exchanges.lane().await;
    tuned!(exchanges.target, |tuning| {
        let dump = run(reads, exchanges, &tuning, Dump::reading(tuning)).await;
        dump.map_err(|failed| failed.refusal)
    })
}

/// Reading checks nothing.
fn reads(_: &Request) -> Result<(), Refusal> {
    Ok(())
}
