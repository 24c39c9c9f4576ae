//! The data of a scripted drive: what it sends, when, and which values they carry.

use motorlink_proto::time::Micros;

/// Data that a drive sends.
#[derive(Debug, Clone)]
pub(super) struct Send<D> {
    pub when: When,
    pub data: D,
    /// Whether it is part of a reply. No other reply is sent between the parts.
    pub is_reply: bool,
    pub claim: Option<Claim>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    /// This time after the request, but not before earlier data of the motor.
    After(Micros),
    /// When the host sends data again.
    NextRequest,
    /// Periodically, without end.
    Every(Micros),
}

/// A value in the sent data.
#[derive(Debug, Clone, Copy)]
pub(super) struct Claim {
    pub value: i64,
    pub lie: Option<&'static str>,
}

impl<D> Send<D> {
    /// A reply or a part of it, without a value.
    pub fn reply(data: D) -> Self {
        Send { when: When::After(Micros(0)), data, is_reply: true, claim: None }
    }

    /// Data that answer no request.
    pub fn stray(data: D) -> Self {
        Send { is_reply: false, ..Self::reply(data) }
    }

    /// Adds a value, which answers the request during the exchange.
    pub fn telling(self, value: i64) -> Self {
        Send { claim: Some(Claim { value, lie: None }), ..self }
    }

    /// Adds a value that a host may read. It is wrong; `why` is the reason.
    pub fn lying(self, value: i64, why: &'static str) -> Self {
        Send { claim: Some(Claim { value, lie: Some(why) }), ..self }
    }

    pub fn after(self, delay: Micros) -> Self {
        Send { when: When::After(delay), ..self }
    }

    pub fn held(self) -> Self {
        Send { when: When::NextRequest, ..self }
    }

    pub fn every(self, period: Micros) -> Self {
        Send { when: When::Every(period), ..self }
    }
}

/// A fraction of a time.
pub(super) fn share(time: Micros, numerator: u64, denominator: u64) -> Micros {
    Micros(time.as_micros() * numerator / denominator)
}
