//! Messages that a recorder had to drop, said in the file.

use super::topics::Topics;
use crate::schema::{Loss, Time};
use crate::write::{Entry, Queue};

/// Whom losses of the recorder itself concern, in events.
const RECORDER: &str = "recorder";

/// Messages that did not fit into the queue of the writer.
#[derive(Default)]
pub(super) struct Losses {
    pub(super) known: u64,
    told: u64,
}

impl Losses {
    /// Says how many were lost, as soon as there is room to say it.
    pub(super) fn tell(&mut self, now: Time, queue: &Queue<Entry>) {
        self.known = queue.lost();
        let new = self.known - self.told;
        let said = || Entry::message(Topics::EVENTS, now, &Loss::Messages.log(now, RECORDER, new));
        if new > 0 && queue.has_room() && queue.push(said()) {
            self.told = self.known;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schema::{Log, Message, Severity};

    #[test]
    fn losses_are_written_once_there_is_room_again() {
        let queue = Queue::new(1_000);
        let mut losses = Losses::default();
        let message = || Entry::Message { topic: 0, time: 0, data: vec![0; 300] };
        let taken = (0..10).filter(|_| queue.push(message())).count();
        losses.tell(Time(7), &queue);
        let items = queue.take().items;
        assert_eq!((losses.known, losses.told), (10 - taken as u64, 0));
        assert_eq!(items.len(), taken);
        losses.tell(Time(8), &queue);
        losses.tell(Time(9), &queue);
        let [Entry::Message { time: 8, data, .. }] = &Vec::from(queue.take().items)[..] else {
            panic!("one event");
        };
        let log = Log::decode(data).unwrap();
        assert_eq!(
            (&*log.kind, &*log.name, log.severity),
            ("lost_records", RECORDER, Severity::Error)
        );
        assert!(log.message.starts_with(&format!("{} messages are lost here", 10 - taken)));
    }
}
