//! What all pages may ask of a motor at most.

use motorlink_proto::rmd;
use motorlink_proto::st::register::Unit;
use motorlink_proto::st::{self, Account, Counters, Effect, LimitError, Ramp};
use motorlink_proto::units::{CentiDegrees, IqCommand, Quantity, Rounding, Scale, SpeedLimit};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::signal::Motor;

use crate::message::Mode;

/// The limits of a motor, and what they need to know of it.
#[derive(Default)]
pub(super) struct Limited {
    st: st::Limits,
    rmd: rmd::Limits,
    account: Account,
    losses: u32,
}

impl Limited {
    /// Sets a limit of all pages; `None` removes it. It is effective from the next request.
    ///
    /// # Errors
    /// No motor of this kind can have it.
    pub(super) fn set(
        &mut self,
        motor: Motor,
        mode: Mode,
        most: Option<f64>,
    ) -> Result<(), Refusal> {
        match (motor, mode) {
            (Motor::St(_), Mode::Speed) => {
                let most = within(
                    most,
                    Scale {
                        symbol: Unit::Rpm.symbol(),
                        ..Scale::plain(0, Ramp::MAX_SPEED_RPM.into())
                    },
                )?;
                self.st.speed_rpm = most.map(|digits| digits as u32);
            }
            (Motor::St(_), Mode::Torque) => {
                let most = within(
                    most,
                    Scale { symbol: Unit::S16A.symbol(), ..Scale::plain(0, i16::MAX.into()) },
                )?;
                self.st.current_s16a = most.map(|digits| digits as u16);
            }
            (Motor::St(_), Mode::Position) => {
                return Err(Refusal::usage("the position of an ST motor cannot be limited"));
            }
            (Motor::Rmd(_), Mode::Speed) => {
                let most = within(most, SpeedLimit::UNIT)?;
                self.rmd.speed = most.map(SpeedLimit::from_digits);
            }
            (Motor::Rmd(_), Mode::Torque) => {
                let most = within(most, positive(IqCommand::UNIT))?;
                self.rmd.current = most.map(IqCommand::from_digits);
            }
            (Motor::Rmd(_), Mode::Position) => {
                let most = within(most, positive(CentiDegrees::UNIT))?;
                self.rmd.angle = most.map(CentiDegrees::from_digits);
            }
        }
        self.account.set_limits(self.st);
        Ok(())
    }

    /// A limit, in the unit of the mode.
    pub(super) fn most(&self, motor: Motor, mode: Mode) -> Option<f64> {
        match (motor, mode) {
            (Motor::St(_), Mode::Speed) => self.st.speed_rpm.map(f64::from),
            (Motor::St(_), Mode::Torque) => self.st.current_s16a.map(f64::from),
            (Motor::St(_), Mode::Position) => None,
            (Motor::Rmd(_), Mode::Speed) => self.rmd.speed.map(SpeedLimit::dps),
            (Motor::Rmd(_), Mode::Torque) => self.rmd.current.map(IqCommand::amps),
            (Motor::Rmd(_), Mode::Position) => self.rmd.angle.map(CentiDegrees::degrees),
        }
    }

    /// Checks a request. The error says why it is not sent.
    pub(super) fn check(&mut self, request: &Request) -> Result<Effect, Refusal> {
        match request {
            Request::St(motor, request) => {
                let seen = self.seen();
                let request = request.request();
                self.account.check(seen, *motor, &request).map_err(|why| Refusal::usage(words(why)))
            }
            Request::Rmd(_, data) => {
                self.rmd.check(data).map(|()| Effect::None).map_err(Refusal::unsent)
            }
            _ => Ok(Effect::None),
        }
    }

    /// A request is sent.
    pub(super) fn sent(&mut self, request: &Request, effect: Effect) {
        if let Request::St(motor, _) = request {
            self.account.sent(*motor, effect);
        }
    }

    /// The drive acknowledged it, or not.
    pub(super) fn ended(&mut self, is_acknowledged: bool) {
        match is_acknowledged {
            true => self.account.acknowledged(),
            false => self.forget(),
        }
    }

    /// Ramps that the drive acknowledged so far may be lost.
    pub(super) fn forget(&mut self) {
        self.losses = self.losses.wrapping_add(1);
    }

    fn seen(&self) -> Counters {
        Counters { losses: self.losses, ..Counters::default() }
    }
}

/// Why a request to an ST drive is not sent, and what a page can do.
fn words(why: LimitError) -> String {
    match why {
        LimitError::NoRamp { limit_rpm } => format!(
            "under the limit of {limit_rpm} rpm: use Run to target, or set a ramp within the limit first; \
             nothing was sent"
        ),
        why => why.to_string(),
    }
}

/// The same scale without negative values.
fn positive(scale: Scale) -> Scale {
    Scale { least: 0, ..scale }
}

/// The digits of a limit: none of them exceeds it.
fn within(most: Option<f64>, scale: Scale) -> Result<Option<i64>, Refusal> {
    let scale = Scale { rounding: Rounding::Inward, ..scale };
    most.map(|most| scale.wanted(most))
        .transpose()
        .map_err(|why| Refusal::usage(format!("a limit: {why}")))
}
