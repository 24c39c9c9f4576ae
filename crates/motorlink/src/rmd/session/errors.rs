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

    pub(super) fn failed(&self, id: MotorId, error: proto::Failure) -> Error {
        let port = Arc::clone(&self.port);
        let [code, ..] = self.pending[id.index()].request;
        let code = Code::from(code);
        let failed = match error {
            proto::Failure::Altered => Error::Altered { port, motor: id, request: code },
            proto::Failure::Echo => Error::Echo { port, motor: id },
            proto::Failure::Foreign(dialect) => Error::Foreign { port, motor: id, dialect },
            proto::Failure::Quarantined => Error::Quarantined { port, motor: id },
            _ => Error::Timeout { port, motor: id, request: code },
        };
        debug!("{failed}");
        failed
    }
}
