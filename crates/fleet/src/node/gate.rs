//! What a node demands of the requests of a session: their order, their age, signs of life.
//!
//! It reads no clock: all times are those of the node, in seconds, and come from the caller.

use std::collections::{BTreeMap, BTreeSet};

use motorlink_telemetry::share::message::{Ask, LONGEST_TIME, Reason, Request};
use motorlink_telemetry::share::request::Kind;

use crate::message::Post;

/// How long a session that commands nothing may be silent.
const PATIENCE: f64 = 60.0;

/// How many urgent requests are remembered.
const URGENT: usize = 1024;

/// The rules of one session.
#[derive(Debug)]
pub struct Gate {
    deadline: f64,
    motion: Option<f64>,
    /// The next post in the order.
    next: u32,
    /// The urgent requests that the node has. They may come in any order.
    urgent: BTreeSet<u32>,
    /// Posts up to this number came before a stop.
    overtaken: u32,
    /// The youngest sign of life.
    sign: f64,
    /// When the last message of any kind came.
    heard: f64,
    /// Whether it has changed something.
    has_commanded: bool,
    /// The motors that it turns, and when their last command was made.
    moved: BTreeMap<(String, u8), f64>,
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

impl Gate {
    /// A session that begins.
    pub fn new(now: f64, deadline: f64, motion: Option<f64>) -> Self {
        Gate {
            deadline,
            motion,
            next: 1,
            urgent: BTreeSet::new(),
            overtaken: 0,
            sign: now,
            heard: now,
            has_commanded: false,
            moved: BTreeMap::new(),
        }
    }

    /// The next post that is taken.
    pub fn next(&self) -> u32 {
        self.next
    }

    /// Any message came.
    pub fn heard(&mut self, now: f64) {
        self.heard = now;
    }

    /// A sign of life that was sent at this time.
    pub fn sign(&mut self, now: f64, sent: f64) {
        self.sign = self.sign.max(past(now, sent));
    }

    /// A request in the order.
    pub fn post(&mut self, now: f64, post: Post, kind: Kind) -> Verdict {
        match post.number.cmp(&self.next) {
            std::cmp::Ordering::Less => return Verdict::Again,
            std::cmp::Ordering::Greater => return Verdict::Early,
            std::cmp::Ordering::Equal => self.next = self.next.saturating_add(1),
        }
        let changes = matches!(kind, Kind::Changes | Kind::Moves);
        if changes && post.number <= self.overtaken {
            return refuse(&post, Reason::Overtaken, "a stop came first");
        }
        self.take(now, post, kind)
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
        self.take(now, post, Kind::Stops)
    }

    fn take(&mut self, now: f64, post: Post, kind: Kind) -> Verdict {
        let sent = past(now, post.sent);
        // A stop is never too old.
        let left = match kind {
            Kind::Stops => 0.0,
            _ => post.time_to_live.clamp(0.0, LONGEST_TIME) - (now - sent),
        };
        if left.is_nan() || left < 0.0 {
            return refuse(&post, Reason::Expired, "it came later than its time to live");
        }
        if matches!(kind, Kind::Changes | Kind::Moves) {
            if !self.has_commanded {
                // Those before had to give no sign of life.
                self.has_commanded = true;
                self.sign = sent;
            }
            self.sign(now, sent);
        }
        let Post { mut request, .. } = post;
        match &mut request.ask {
            Ask::Command { line, motor, time_to_live, .. } => {
                if kind != Kind::Stops {
                    *time_to_live = left.min(*time_to_live);
                }
                self.command(line, *motor, sent, kind);
            }
            Ask::Stop { motor: Some(motor) } => {
                self.command(&motor.line, motor.motor, sent, Kind::Stops);
            }
            Ask::Stop { motor: None } => self.moved.clear(),
            _ => {}
        }
        Verdict::Pass(request)
    }

    fn command(&mut self, line: &str, motor: u8, sent: f64, kind: Kind) {
        let place = (line.to_owned(), motor);
        match kind {
            Kind::Moves => drop(self.moved.insert(place, sent)),
            Kind::Changes => {
                if let Some(last) = self.moved.get_mut(&place) {
                    *last = last.max(sent);
                }
            }
            Kind::Stops => drop(self.moved.remove(&place)),
            Kind::Reads => {}
        }
    }

    /// Why the session is over, if it is.
    pub fn lapse(&self, now: f64) -> Option<String> {
        if self.has_commanded && now > self.sign + self.deadline {
            return Some(format!("no sign of life for {:.0} ms", (now - self.sign) * 1e3));
        }
        let motion = self.motion?;
        let late = self.moved.iter().find(|(_, last)| now > **last + motion);
        late.map(|((line, motor), last)| {
            format!("{line}, motor {motor}: no new command for {:.0} ms", (now - last) * 1e3)
        })
    }

    /// Whether it commands nothing, and has been silent for long.
    pub fn is_forgotten(&self, now: f64) -> bool {
        now > self.heard + PATIENCE
    }

    /// Whether its motors depend on its signs of life.
    pub fn has_commanded(&self) -> bool {
        self.has_commanded
    }

    /// When to ask for a lapse next.
    pub fn due(&self) -> f64 {
        let signs = self.has_commanded.then_some(self.sign + self.deadline);
        let motion = self.moved.values().filter_map(|last| Some(last + self.motion?));
        signs.into_iter().chain(motion).fold(self.heard + PATIENCE, f64::min)
    }
}

/// When a request was sent, at most now. NaN counts as long ago.
fn past(now: f64, sent: f64) -> f64 {
    if sent.is_nan() { f64::NEG_INFINITY } else { sent.min(now) }
}

fn refuse(post: &Post, reason: Reason, why: &str) -> Verdict {
    Verdict::Refuse(post.request.id, reason, format!("{why}; the drive did not get it"))
}

#[cfg(test)]
mod tests;
