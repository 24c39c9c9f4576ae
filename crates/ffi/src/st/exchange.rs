//! What a master holds, and how an exchange begins.

use motorlink_proto::st::{
    Account, Confirmation, Frame, LastExchange, LimitError, Master, MotorNumber, Profile,
    RegisterId, Request, RequestError,
};

use super::motorlink_st_master;
use crate::error::motorlink_error;
use crate::pointer::storage;
use crate::tag::Kind;

/// What the storage of a master holds.
pub(crate) struct State {
    pub(super) master: Master,
    pub(super) account: Account,
    pub(super) profile: Profile,
    /// The register whose value is asked for.
    pub(super) asked: Option<RegisterId>,
    pub(super) last: LastExchange,
    /// The confirmation under way.
    pub(super) confirmation: Option<Confirmation>,
}

storage!(motorlink_st_master: State, Kind::StMaster);

impl State {
    /// Begins any request. A refused request changes nothing.
    pub(super) fn begin(
        &mut self,
        motor: u8,
        request: &Request<'_>,
    ) -> Result<(), motorlink_error> {
        self.send(motor, request)?;
        self.last.requested(self.master.counters());
        Ok(())
    }

    fn send(&mut self, motor: u8, request: &Request<'_>) -> Result<(), motorlink_error> {
        check_motor(motor)?;
        let seen = self.master.counters();
        let effect = self.account.check(seen, motor, request).map_err(limited)?;
        self.master.request(motor, request).map_err(refused)?;
        self.account.sent(motor, effect);
        self.asked = match request {
            Request::GetRegister(register) => Some(*register),
            _ => None,
        };
        self.confirmation = None;
        Ok(())
    }

    /// Begins an exchange with any frame code. A refused request changes nothing.
    pub(super) fn begin_raw(
        &mut self,
        motor: u8,
        code: u8,
        payload: &[u8],
    ) -> Result<(), motorlink_error> {
        check_motor(motor)?;
        let frame = Frame { header: Frame::header(code, motor), payload };
        if frame.code() != code {
            return Err(motorlink_error::BadArgument);
        }
        let seen = self.master.counters();
        let effect = self.account.check_frame(seen, &frame).map_err(limited)?;
        self.master.request_raw(frame.header, payload).map_err(refused)?;
        self.account.sent_frame(&frame, effect);
        self.asked = None;
        self.confirmation = None;
        self.last.requested(self.master.counters());
        Ok(())
    }

    /// Begins the question of a confirmation.
    pub(super) fn ask(&mut self, confirmation: Confirmation) -> Result<(), motorlink_error> {
        self.send(0, &confirmation.request())?;
        self.asked = None;
        self.confirmation = Some(confirmation);
        Ok(())
    }
}

fn check_motor(motor: u8) -> Result<(), motorlink_error> {
    if motor <= MotorNumber::MAX { Ok(()) } else { Err(motorlink_error::BadArgument) }
}

fn limited(_: LimitError) -> motorlink_error {
    motorlink_error::Limit
}

fn refused(error: RequestError) -> motorlink_error {
    match error {
        RequestError::Busy => motorlink_error::Busy,
        RequestError::TooLong => motorlink_error::TooLong,
    }
}
