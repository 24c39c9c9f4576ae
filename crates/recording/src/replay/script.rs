//! Which recorded reply comes next.

use std::collections::HashMap;
use std::hash::Hash;

use motorlink_proto::rmd::MotorSet;
use motorlink_proto::time::{Instant, Micros};

/// The requests of a recording and their replies.
#[derive(Debug)]
pub(super) struct Script<F> {
    exchanges: Vec<Exchange<F>>,
    asked: HashMap<F, Asked>,
    /// The last exchange of each lane.
    last: [Option<usize>; LANES],
    /// For each lane: where replies are taken from. Those of earlier exchanges are over.
    place: [usize; LANES],
}

/// A motor on a CAN bus is a lane. A serial line is one lane.
const LANES: usize = 32;

/// The lanes that an exchange uses.
pub(super) type Lanes = MotorSet;

/// The only lane of a serial line.
pub(super) const LINE: Lanes = MotorSet::from_bits(1);

#[derive(Debug)]
struct Exchange<F> {
    at: Instant,
    lanes: Lanes,
    is_read: bool,
    replies: Vec<(Micros, F)>,
}

/// The places of a request in the recording.
#[derive(Debug, Default)]
struct Asked {
    exchanges: Vec<usize>,
    /// Index of the next one in `exchanges`.
    next: usize,
}

/// The answer to a request.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Answer<'a, F> {
    /// Each reply and its delay. None if the drive was silent.
    Recorded(&'a [(Micros, F)]),
    /// All recorded replies to this request were given. This is the last one again.
    Repeated(&'a [(Micros, F)]),
    /// The recording does not have this request.
    Unknown,
}

impl<F> Default for Script<F> {
    fn default() -> Self {
        Script {
            exchanges: Vec::new(),
            asked: HashMap::new(),
            last: [None; LANES],
            place: [0; LANES],
        }
    }
}

impl<F: Clone + Eq + Hash> Script<F> {
    /// Adds a request of the recording.
    pub fn asked(&mut self, at: Instant, lanes: Lanes, is_read: bool, request: F) {
        let index = self.exchanges.len();
        self.exchanges.push(Exchange { at, lanes, is_read, replies: Vec::new() });
        self.asked.entry(request).or_default().exchanges.push(index);
        for lane in lanes {
            self.last[lane.index()] = Some(index);
        }
    }

    /// Adds a reply of the recording. It belongs to the last request of its lane, as on the line.
    pub fn replied(&mut self, at: Instant, lane: Lanes, reply: F) {
        let last = lane.filter_map(|lane| self.last[lane.index()]).max();
        if let Some(exchange) = last.and_then(|last| self.exchanges.get_mut(last)) {
            exchange.replies.push((at.since(exchange.at), reply));
        }
    }

    /// The recording ends here. Whether a reply to the last request of a lane would have come is not
    /// known: these requests are left out.
    pub fn ended(&mut self) {
        let open: Vec<usize> = self.last.iter().flatten().copied().collect();
        let is_open = |index: &usize| {
            open.contains(index)
                && self.exchanges.get(*index).is_some_and(|exchange| exchange.replies.is_empty())
        };
        for asked in self.asked.values_mut() {
            asked.exchanges.retain(|index| !is_open(index));
        }
        self.asked.retain(|_, asked| !asked.exchanges.is_empty());
    }

    /// The number of different requests.
    pub fn requests(&self) -> usize {
        self.asked.len()
    }

    /// The answer to a request.
    pub fn answer(&mut self, request: &F) -> Answer<'_, F> {
        let Some(asked) = self.asked.get_mut(request) else { return Answer::Unknown };
        let place = |exchange: &Exchange<F>| {
            exchange.lanes.map(|lane| self.place[lane.index()]).max().unwrap_or_default()
        };
        let is_over = |index: &usize| {
            self.exchanges.get(*index).is_some_and(|exchange| *index < place(exchange))
        };
        let later = asked.exchanges.iter().skip(asked.next);
        asked.next += later.take_while(|index| is_over(index)).count();
        let (index, is_repeated) = match asked.exchanges.get(asked.next) {
            Some(index) => (*index, false),
            None => (asked.exchanges.last().copied().unwrap_or_default(), true),
        };
        let Some(exchange) = self.exchanges.get(index) else { return Answer::Unknown };
        if is_repeated {
            return Answer::Repeated(&exchange.replies);
        }
        asked.next += 1;
        if !exchange.is_read {
            for lane in exchange.lanes {
                self.place[lane.index()] = index;
            }
        }
        Answer::Recorded(&exchange.replies)
    }
}

#[cfg(test)]
mod tests {
    use super::Answer::{Recorded, Repeated, Unknown};
    use super::*;

    /// A line on which each letter was a request, answered after 10 µs by a reply with its number.
    /// Capital letters are commands.
    fn line(requests: &str) -> Script<String> {
        let mut script = Script::default();
        for (number, request) in requests.chars().enumerate() {
            let at = Instant(number as u64 * 1000);
            script.asked(at, LINE, request.is_lowercase(), request.to_string());
            script.replied(at + Micros(10), LINE, number.to_string());
        }
        script.ended();
        script
    }

    /// The numbers of the replies; `r` behind a repeated one, `-` for no answer.
    fn played(script: &mut Script<String>, requests: &str) -> String {
        let mut numbers = |request: char| match script.answer(&request.to_string()) {
            Recorded([(Micros(10), number)]) => number.clone(),
            Repeated([(Micros(10), number)]) => format!("{number}r"),
            Unknown => "-".to_owned(),
            other => panic!("{other:?}"),
        };
        requests.chars().map(&mut numbers).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn what_was_recorded_is_answered_as_it_was() {
        assert_eq!(played(&mut line("abSabSab"), "abSabSab"), "0 1 2 3 4 5 6 7");
    }

    #[test]
    fn each_request_has_its_own_order() {
        assert_eq!(played(&mut line("ababab"), "aaabbb"), "0 2 4 1 3 5");
    }

    #[test]
    fn after_the_last_reply_it_is_repeated() {
        assert_eq!(played(&mut line("aab"), "aaaab"), "0 1 1r 1r 2");
    }

    #[test]
    fn a_command_ends_the_replies_before_it() {
        // Fewer reads than recorded before the command: the state before it does not come back.
        assert_eq!(played(&mut line("aaaaSaa"), "aSaaa"), "0 4 5 6 6r");
        // A read that was recorded only before the command gives what is known of it.
        assert_eq!(played(&mut line("abSa"), "Sbab"), "2 1r 3 1r");
    }

    #[test]
    fn a_request_that_was_not_recorded_has_no_answer() {
        assert_eq!(played(&mut line("ab"), "xaXb"), "- 0 - 1");
    }

    #[test]
    fn a_request_at_the_end_of_the_recording_is_left_out_if_nothing_answered() {
        let mut script = line("aba");
        script.asked(Instant(9000), LINE, true, "b".to_owned());
        script.ended();
        assert_eq!(played(&mut script, "abba"), "0 1 1r 2");
    }

    #[test]
    fn silence_in_the_recording_is_silence_again() {
        let mut script = Script::default();
        script.asked(Instant(0), LINE, true, "a");
        script.asked(Instant(5), LINE, true, "a");
        script.replied(Instant(7), LINE, "late");
        script.ended();
        assert_eq!(script.answer(&"a"), Recorded(&[]));
        assert_eq!(script.answer(&"a"), Recorded(&[(Micros(2), "late")]));
    }

    #[test]
    fn a_command_to_one_motor_does_not_move_another() {
        let lanes = |bits| MotorSet::from_bits(bits);
        let mut script = Script::default();
        for (request, bits, is_read) in [
            ("a", 0b01, true),
            ("b", 0b10, true),
            ("A", 0b01, false),
            ("a", 0b01, true),
            ("b", 0b10, true),
        ] {
            let at = Instant(script.exchanges.len() as u64);
            script.asked(at, lanes(bits), is_read, request);
            script.replied(at, lanes(bits), request);
        }
        script.ended();
        for request in ["A", "b", "b", "a"] {
            assert_eq!(script.answer(&request), Recorded(&[(Micros(0), request)]), "{request}");
        }
        assert_eq!(script.answer(&"b"), Repeated(&[(Micros(0), "b")]));
    }
}
