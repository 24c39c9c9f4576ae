//! The requests of a program on their way to the node: until it has them, they are sent again.
//!
//! It reads no clock: times are those of the program, in seconds, and come from the caller.

use std::collections::VecDeque;

use motorlink_telemetry::share::message::{Ask as ShareAsk, Request};

use crate::clock::NodeClock;
use crate::message::{Ask, Post};

/// The time to live of a request that has none of its own, in seconds.
const TIME_TO_LIVE: f64 = 2.0;
/// That of a release: motion may have been refused again meanwhile.
const RELEASE: f64 = 1.0;
/// When a request is sent again.
const AGAIN: f64 = 0.1;
/// The same of a stop.
const AGAIN_STOP: f64 = 0.05;

/// The requests that the node does not have yet.
#[derive(Debug)]
pub struct Outgoing {
    clock: NodeClock,
    last: u32,
    last_urgent: u32,
    posts: VecDeque<Sent>,
    urgent: VecDeque<Sent>,
}

#[derive(Debug)]
struct Sent {
    ask: Ask,
    number: u32,
    /// When it was made.
    made: f64,
    /// When it is sent next.
    due: f64,
}

impl Outgoing {
    /// To a node with this clock.
    pub fn new(clock: NodeClock) -> Self {
        let (posts, urgent) = (VecDeque::new(), VecDeque::new());
        Outgoing { clock, last: 0, last_urgent: 0, posts, urgent }
    }

    /// The node answered what was asked at a time.
    pub fn heard(&mut self, asked: f64, now: f64, t: f64) {
        self.clock.heard(asked, now, t);
    }

    /// A request of the program.
    pub fn post(&mut self, now: f64, request: Request) {
        self.last += 1;
        let number = self.last;
        let ask = Ask::Post(self.made(now, number, request));
        self.posts.push_back(Sent { ask, number, made: now, due: now });
    }

    /// A stop of the program.
    pub fn urgent(&mut self, now: f64, request: Request) {
        self.last_urgent += 1;
        let number = self.last_urgent;
        let ask = Ask::Urgent { after: self.last, post: self.made(now, number, request) };
        self.urgent.push_back(Sent { ask, number, made: now, due: now });
    }

    fn made(&self, now: f64, number: u32, request: Request) -> Post {
        let time_to_live = match &request.ask {
            ShareAsk::Command { time_to_live, .. } => *time_to_live,
            ShareAsk::Release => RELEASE,
            _ => TIME_TO_LIVE,
        };
        Post { number, sent: self.clock.at_least(now), time_to_live, request }
    }

    /// A sign of life.
    pub fn heartbeat(&self, now: f64) -> Ask {
        Ask::Alive { sent: self.clock.at_least(now) }
    }

    /// The node has all posts before this one.
    pub fn taken(&mut self, next: u32) {
        while self.posts.front().is_some_and(|sent| sent.number < next) {
            self.posts.pop_front();
        }
    }

    /// The node has this stop.
    pub fn taken_urgent(&mut self, number: u32) {
        self.urgent.retain(|sent| sent.number != number);
    }

    /// The node lacks posts before one that it got: they are sent at once.
    pub fn missed(&mut self, now: f64) {
        self.posts.iter_mut().for_each(|sent| sent.due = now);
    }

    /// What is sent now: stops first.
    pub fn due(&mut self, now: f64) -> Vec<Ask> {
        let pauses = [(&mut self.urgent, AGAIN_STOP), (&mut self.posts, AGAIN)];
        let mut due = Vec::new();
        for (waiting, pause) in pauses {
            for sent in waiting.iter_mut().filter(|sent| sent.due <= now) {
                sent.due = now + pause;
                due.push(sent.ask.clone());
            }
        }
        due
    }

    /// When something is due next.
    pub fn next_due(&self) -> Option<f64> {
        let all = self.urgent.iter().chain(&self.posts);
        all.map(|sent| sent.due).reduce(f64::min)
    }

    /// When the oldest request was made that the node does not have.
    pub fn oldest(&self) -> Option<f64> {
        self.urgent.iter().chain(&self.posts).map(|sent| sent.made).reduce(f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outgoing() -> Outgoing {
        Outgoing::new(NodeClock::new(0.0, 0.0, 1000.0))
    }

    fn request(id: u32, ask: ShareAsk) -> Request {
        Request::new(id, ask)
    }

    fn numbers(asks: &[Ask]) -> Vec<(char, u32)> {
        let number = |ask: &Ask| match ask {
            Ask::Post(post) => ('p', post.number),
            Ask::Urgent { post, .. } => ('u', post.number),
            other => panic!("{other:?}"),
        };
        asks.iter().map(number).collect()
    }

    #[test]
    fn requests_are_sent_until_the_node_has_them() {
        let mut out = outgoing();
        for id in 1..=3 {
            out.post(0.0, request(id, ShareAsk::Lines));
        }
        assert_eq!(numbers(&out.due(0.0)), [('p', 1), ('p', 2), ('p', 3)]);
        assert_eq!(out.due(0.05), []);
        out.taken(2);
        assert_eq!(numbers(&out.due(0.1)), [('p', 2), ('p', 3)]);
        out.missed(0.11);
        assert_eq!(numbers(&out.due(0.11)), [('p', 2), ('p', 3)]);
        assert_eq!(out.oldest(), Some(0.0));
        out.taken(4);
        assert_eq!((out.next_due(), out.oldest()), (None, None));
    }

    #[test]
    fn a_stop_is_sent_first_and_more_often_and_says_what_it_overtakes() {
        let mut out = outgoing();
        out.post(0.0, request(1, ShareAsk::Lines));
        out.urgent(0.0, request(2, ShareAsk::Stop { motor: None }));
        let due = out.due(0.0);
        assert_eq!(numbers(&due), [('u', 1), ('p', 1)]);
        assert!(matches!(&due[0], Ask::Urgent { after: 1, .. }));
        assert_eq!(numbers(&out.due(0.05)), [('u', 1)]);
        out.taken_urgent(1);
        assert_eq!(numbers(&out.due(0.1)), [('p', 1)]);
    }

    #[test]
    fn a_request_that_is_sent_again_does_not_become_younger() {
        let mut out = outgoing();
        out.post(1.0, request(1, ShareAsk::Release));
        let first = out.due(1.0);
        assert_eq!(out.due(2.0), first);
        let Ask::Post(post) = &first[0] else { panic!() };
        assert!((post.sent - 1001.0).abs() < 1e-2, "{}", post.sent);
        assert_eq!(post.time_to_live, RELEASE);
    }
}
