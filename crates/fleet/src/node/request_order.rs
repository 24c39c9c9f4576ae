//! What a node demands of the requests of a session: their order and their age.
//!
//! It reads no clock: all times are those of the node, in seconds, and come from the caller.

use std::collections::BTreeSet;

use motorlink_telemetry::share::command_kind::CommandKind;
use motorlink_telemetry::share::message::{Ask, LONGEST_TIME, Reason, Request};

use crate::message::Post;

/// How many urgent requests are remembered.
const URGENT: usize = 1024;

/// The rules of one session.
#[derive(Debug)]
pub struct RequestOrder {
    /// The next post in the order.
    next: u32,
    /// The urgent requests that the node has. They may come in any order.
    urgent: BTreeSet<u32>,
    /// Posts up to this number came before a stop.
    overtaken: u32,
}

/// What becomes of a request.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// The share gets it.
    Pass(Request),
    /// The program gets a refusal.
    Refuse(u32, Reason, String),
    /// The node has it already.
    Again,
    /// Those before it are missing.
    Early,
}

impl RequestOrder {
    /// A session that begins.
    pub fn new() -> Self {
        RequestOrder { next: 1, urgent: BTreeSet::new(), overtaken: 0 }
    }

    /// The next post that is taken.
    pub fn next(&self) -> u32 {
        self.next
    }

    /// A request in the order.
    pub fn post(&mut self, now: f64, post: Post, kind: CommandKind) -> Verdict {
        match post.number.cmp(&self.next) {
            std::cmp::Ordering::Less => return Verdict::Again,
            std::cmp::Ordering::Greater => return Verdict::Early,
            std::cmp::Ordering::Equal => self.next = self.next.saturating_add(1),
        }
        if kind.changes() && post.number <= self.overtaken {
            return refuse(&post, Reason::Overtaken, "a stop came first");
        }
        take(now, post, kind)
    }

    /// A stop or a latch. Posts up to `after` that come later change nothing.
    pub fn urgent(&mut self, now: f64, after: u32, post: Post) -> Verdict {
        if !self.urgent.insert(post.number) {
            return Verdict::Again;
        }
        // Those long ago are not sent again.
        if self.urgent.len() > URGENT {
            self.urgent.pop_first();
        }
        self.overtaken = self.overtaken.max(after);
        take(now, post, CommandKind::Stops)
    }
}

fn take(now: f64, post: Post, kind: CommandKind) -> Verdict {
    let age = age(now, post.sent);
    let is_young = age < LONGEST_TIME && age <= post.time_to_live.max(0.0);
    // A stop is never too old.
    if kind != CommandKind::Stops && !is_young {
        return refuse(&post, Reason::Expired, "it came later than its time to live");
    }
    let Post { mut request, time_to_live: most, .. } = post;
    if let Ask::Command { time_to_live, .. } = &mut request.ask
        && kind != CommandKind::Stops
    {
        *time_to_live = most.min(*time_to_live);
    }
    request.age = Some(age);
    Verdict::Pass(request)
}

/// How long ago something was sent. It was not sent in the future. NaN counts as long ago.
pub fn age(now: f64, sent: f64) -> f64 {
    if sent.is_nan() { LONGEST_TIME } else { (now - sent).clamp(0.0, LONGEST_TIME) }
}

fn refuse(post: &Post, reason: Reason, why: &str) -> Verdict {
    Verdict::Refuse(post.request.id, reason, format!("{why}; the drive did not get it"))
}

#[cfg(test)]
mod tests;
