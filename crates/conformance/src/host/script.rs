//! What an adversarial drive sends, when, and what it means by it.

use motorlink_proto::time::Micros;

/// Something that a drive sends.
#[derive(Debug, Clone)]
pub(super) struct Send<D> {
    pub when: When,
    pub data: D,
    /// Whether it is part of the reply, of which no request may overtake the rest.
    pub is_reply: bool,
    pub claim: Option<Claim>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    /// This long after the request, though not before what the motor still has to send.
    After(Micros),
    /// When the host sends something again.
    NextRequest,
    /// Again and again, for ever.
    Every(Micros),
}

/// A value that a drive sends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Claim {
    pub value: i64,
    pub lie: Option<&'static str>,
}

impl<D> Send<D> {
    /// A reply, or a part of it, without a value.
    pub fn reply(data: D) -> Self {
        Send { when: When::After(Micros(0)), data, is_reply: true, claim: None }
    }

    /// Something that belongs to no request.
    pub fn stray(data: D) -> Self {
        Send { is_reply: false, ..Self::reply(data) }
    }

    /// It carries this value, which answers the request while the exchange lasts.
    pub fn telling(self, value: i64) -> Self {
        Send { claim: Some(Claim { value, lie: None }), ..self }
    }

    /// A host may take it for this value, which is wrong because of `why`.
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

/// A part of a stated time.
pub(super) fn share(time: Micros, numerator: u64, denominator: u64) -> Micros {
    Micros(time.as_micros() * numerator / denominator)
}
