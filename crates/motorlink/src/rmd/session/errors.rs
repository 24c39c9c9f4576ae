//! Why a request was not sent, or has no reply, in words.

use super::*;

impl Session {
    pub(super) fn why_unsent(&self, id: MotorId) -> Error {
        match self.unsent_for {
            Some(RequestError::Quarantined { .. }) => self.shared(id),
            Some(why) => self.refused(why),
            None => self.quarantined(id),
        }
    }

    pub(super) fn quarantined(&self, id: MotorId) -> Error {
        Error::Quarantined { port: Arc::clone(&self.port), motor: id }
    }

    /// Of a motor that was waited for: it would have been trusted if it had been silent.
    pub(super) fn shared(&self, id: MotorId) -> Error {
        Error::Shared { port: Arc::clone(&self.port), motor: id }
    }

    pub(super) fn refused(&self, refused: RequestError) -> Error {
        match refused {
            RequestError::Quarantined { id, .. } => self.quarantined(id),
            RequestError::Limit { id, exceeded } => Error::Limit { motor: id, exceeded },
            RequestError::OutOfReach(id) => Error::OutOfReach(id),
            RequestError::Busy(id) => Error::Twice(id),
        }
    }

    /// If the motor does not answer the other program, or a reply of it cannot be trusted, the error is
    /// that of a port of one's own.
    pub(super) fn undone(&self, id: MotorId, why: PortError) -> Error {
        match why {
            PortError::NotDone { kind: NotDone::Unconfirmed, .. } => {
                Error::Unconfirmed { port: Arc::clone(&self.port), motor: id }
            }
            PortError::NotDone { kind: NotDone::Silent | NotDone::Unheard, .. } => {
                let [code, ..] = self.pending[id.index()].request;
                let port = Arc::clone(&self.port);
                Error::Timeout { port, motor: id, request: Code::from(code) }
            }
            why => why.into(),
        }
    }

    pub(super) fn failed(&self, id: MotorId, error: proto::Failure) -> Error {
        if self.is_held && error == proto::Failure::Timeout {
            return PortError::HolderSilent { port: self.port.to_string() }.into();
        }
        let port = Arc::clone(&self.port);
        let [code, ..] = self.pending[id.index()].request;
        let code = Code::from(code);
        match error {
            proto::Failure::Altered => Error::Altered { port, motor: id, request: code },
            proto::Failure::Echo => Error::Echo { port, motor: id },
            proto::Failure::Foreign(dialect) => Error::Foreign { port, motor: id, dialect },
            proto::Failure::Quarantined => Error::Quarantined { port, motor: id },
            _ => Error::Timeout { port, motor: id, request: code },
        }
    }
}
