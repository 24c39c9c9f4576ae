//! What a recording says of its own losses, as events.

use super::{Log, Severity, Time};

/// A kind of loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Loss {
    /// Messages did not fit into a queue: the recorder or the disk was too slow.
    Messages,
    /// Rows are left out, because nothing confirms their values.
    Rows,
}

impl Loss {
    const ALL: [Loss; 2] = [Loss::Messages, Loss::Rows];

    /// The kind of the event.
    const fn kind(self) -> &'static str {
        match self {
            Loss::Messages => "lost_records",
            Loss::Rows => "unconfirmed",
        }
    }

    /// The event that this number is missing here.
    pub fn log(self, stamp: Time, name: &str, count: u64) -> Log {
        let (severity, why) = match self {
            Loss::Messages => {
                (Severity::Error, "messages are lost here: this program or the disk was too slow")
            }
            Loss::Rows => (Severity::Warn, "rows are left out here: nothing confirms their values"),
        };
        Log {
            stamp,
            severity,
            name: name.to_owned(),
            message: format!("{count} {why}"),
            by: String::new(),
            kind: self.kind().to_owned(),
        }
    }

    /// The loss that an event tells of, and how many are missing.
    pub fn of(log: &Log) -> Option<(Loss, u64)> {
        let loss = Loss::ALL.into_iter().find(|loss| loss.kind() == log.kind)?;
        let (count, _) = log.message.split_once(' ')?;
        Some((loss, count.parse().ok()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_is_read_from_its_event() {
        for loss in Loss::ALL {
            let log = loss.log(Time(7), "st0", 12);
            assert_eq!(Loss::of(&log), Some((loss, 12)));
            assert_eq!(Loss::of(&Log { kind: "stopped".to_owned(), ..log }), None);
        }
    }
}
