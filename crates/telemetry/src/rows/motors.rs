//! Rows of several motors.

use litemap::LiteMap as Map;
use motorlink_proto::time::Instant;

use super::{Item, Rows};
use crate::event::What;
use crate::signal::{Motor, Signal};
use crate::subscription::Record;

/// As [`Rows`], with rows of its own for each motor of a line.
#[derive(Debug, Default)]
pub struct MotorRows {
    motors: Map<Motor, Rows>,
}

impl MotorRows {
    /// Rows of these signals. Those of a row are in the order of this list.
    pub fn new(signals: impl IntoIterator<Item = Signal>) -> Self {
        let mut of: Map<Motor, Vec<Signal>> = Map::new();
        for signal in signals {
            of.entry(signal.motor).or_default().push(signal);
        }
        let motors = of.into_iter().map(|(motor, signals)| (motor, Rows::new(signals)));
        MotorRows { motors: motors.collect() }
    }

    /// Takes the next record of the subscription.
    pub fn take(&mut self, record: &Record) {
        let concerned = match record {
            Record::Values(values) => Some(values.poll.motor),
            Record::Event(event) => motor_of(&event.what),
            Record::Lost(_) => None,
        };
        match concerned {
            Some(motor) => self.motors.get_mut(&motor).into_iter().for_each(|it| it.take(record)),
            None => self.motors.iter_mut().for_each(|(_, it)| it.take(record)),
        }
    }

    /// The next item of any motor, if one is known.
    pub fn next_item(&mut self) -> Option<(Motor, Item)> {
        self.motors.iter_mut().find_map(|(motor, rows)| Some((*motor, rows.next_item()?)))
    }

    /// Whether a row of an earlier instant than this one is not complete or not confirmed.
    pub fn is_pending_before(&self, instant: Instant) -> bool {
        self.motors.values().any(|rows| rows.is_pending_before(instant))
    }
}

/// The motor that an event concerns; `None`: all motors of the line.
fn motor_of(what: &What) -> Option<Motor> {
    match what {
        What::Unanswered(motor, _)
        | What::Silent(motor, _)
        | What::Answers(motor)
        | What::Heard(motor)
        | What::Doubtful(motor, _)
        | What::Confirmed(motor, _) => Some(*motor),
        What::Refused(signals, _) => signals.first().map(|signal| signal.motor),
        _ => None,
    }
}
