//! Values with the time at which they were read.

use std::sync::Arc;

use motorlink_proto::st::{Implausible, Reading};
use motorlink_proto::time::Instant;

use crate::plan::Poll;
use crate::signal::Signal;

/// A value of a signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The integer that was read; the bits of a float that was read.
    pub digits: i64,
    /// The value in the unit of the signal.
    pub value: f64,
}

impl Sample {
    /// The value of a register.
    ///
    /// # Errors
    /// It is plausible in the other profile only. The error has the digits.
    pub(crate) fn of(reading: Reading) -> Result<Self, Implausible> {
        let reading = reading.plausible()?;
        Ok(Sample { digits: reading.digits(), value: reading.value() })
    }

    /// A value that another program has read. Its digits are not known: they are the rounded value.
    pub fn told(value: f64) -> Self {
        Sample { digits: value.round() as i64, value }
    }
}

/// Values, each or why it is not plausible.
pub type Samples = Vec<Result<Sample, Implausible>>;

/// The values of one reply.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// The exchange, with the signals in the order of [`samples`](Self::samples).
    pub poll: Arc<Poll>,
    /// The instant that the exchange was planned for.
    pub instant: Instant,
    /// When the request was sent.
    pub requested: Instant,
    /// When the reply was complete.
    pub replied: Instant,
    /// The values.
    pub samples: Samples,
}

impl Values {
    /// The time of the values: the middle of request and reply.
    pub fn time(&self) -> Instant {
        Instant(self.requested.0.midpoint(self.replied.0))
    }

    /// The value of a signal, if the reply has it and it is plausible.
    pub fn get(&self, signal: Signal) -> Option<Sample> {
        self.sample(signal)?.ok()
    }

    /// The value of a signal, or why it is not plausible; `None` if the reply does not have it.
    pub(crate) fn sample(&self, signal: Signal) -> Option<Result<Sample, Implausible>> {
        let at = self.poll.signals.iter().position(|it| *it == signal)?;
        self.samples.get(at).copied()
    }
}
