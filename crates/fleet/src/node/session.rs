//! A program of another computer, at this node.

use std::sync::Arc;
use std::time::Duration;

use motorlink_telemetry::share::frame::Frame;
use motorlink_telemetry::share::message::{Ask as ShareAsk, Reason, Text, encode};
use motorlink_telemetry::share::program::{Listener, OWN_IDS, Program, Refusal};
use motorlink_telemetry::share::request::Kind;
use tokio::sync::mpsc::Receiver;
use tokio::time::sleep;
use zenoh::query::Query;

use super::common::{Common, answer, answer_with};
use super::gate::{Gate, Verdict};
use super::outbox::Outbox;
use super::sessions::{Asked, Asking};
use crate::clock::span;
use crate::key::Scope;
use crate::message::{Answer, Ask, LONGEST_WAIT, Post};
use crate::weight;

/// What a session task has.
pub(super) struct Session {
    pub(super) common: Arc<Common>,
    pub(super) gate: Gate,
    pub(super) program: Program,
    pub(super) listener: Listener,
    pub(super) deadline: f64,
    pub(super) motion: Option<f64>,
    pub(super) outbox: Outbox,
    pub(super) pull: Option<Pull>,
    pub(super) last_pull: u32,
}

/// A query that waits for something to say.
pub(super) struct Pull {
    query: Query,
    until: f64,
}

/// What happens next to a session.
enum Next {
    Asked(Option<Asked>),
    Said(std::io::Result<Frame>),
    Due,
}

impl Session {
    /// Serves the program until its session is over. Gives the reason.
    pub(super) async fn serve(mut self, mut asked: Receiver<Asked>) -> String {
        let why = loop {
            let now = self.now();
            if let Some(why) = self.gate.lapse(now) {
                break why;
            }
            if self.gate.is_forgotten(now) {
                break "nothing was heard of it for a minute".to_owned();
            }
            self.answer_pull(now);
            match self.next(now, &mut asked).await {
                Next::Due => {}
                Next::Said(Ok(frame)) => self.outbox.push(&frame),
                Next::Said(Err(_)) => break "the share has closed the connection".to_owned(),
                Next::Asked(None) => break "the node ends".to_owned(),
                Next::Asked(Some(Asked::Gone)) if self.gate.has_commanded() => {
                    break "its program or its network has gone".to_owned();
                }
                Next::Asked(Some(Asked::Gone)) => {}
                Next::Asked(Some(Asked::Query(asking))) => {
                    if let Some(why) = self.asked(*asking).await {
                        break why;
                    }
                }
            }
        };
        let refusal = Refusal { reason: Reason::Lapsed, message: why.clone(), code: None };
        self.program.close_because(refusal);
        if let Some(Pull { query, .. }) = self.pull.take() {
            answer(&query, &Answer::Over { t: self.now(), why: why.clone() });
        }
        why
    }

    fn now(&self) -> f64 {
        self.common.clock.now()
    }

    async fn next(&mut self, now: f64, asked: &mut Receiver<Asked>) -> Next {
        let until = self.pull.as_ref().map_or(f64::INFINITY, |pull| pull.until);
        let wait = span((self.gate.due().min(until) - now).max(0.0)) + Duration::from_millis(1);
        tokio::select! {
            biased;
            asked = asked.recv() => Next::Asked(asked),
            said = self.listener.next(), if self.outbox.has_room() => Next::Said(said),
            () = sleep(wait) => Next::Due,
        }
    }

    /// Gives the end of the session, if this is it.
    async fn asked(&mut self, Asking { query, ask, scope }: Asking) -> Option<String> {
        let now = self.now();
        self.gate.heard(now);
        let boot = match &ask {
            Ask::Join { .. } => {
                let (boot, deadline, motion) =
                    (self.common.boot.clone(), self.deadline, self.motion);
                let lines = self.common.known_lines();
                answer(&query, &Answer::Joined { t: now, boot, deadline, motion, lines });
                return None;
            }
            Ask::Post(post) | Ask::Urgent { post, .. } => &post.boot,
            Ask::Alive { boot, .. } | Ask::Pull { boot, .. } | Ask::Leave { boot, .. } => boot,
        };
        if *boot != self.common.boot {
            let why = "the node was started again".to_owned();
            answer(&query, &Answer::Over { t: now, why });
            return None;
        }
        match ask {
            Ask::Join { .. } => {}
            Ask::Alive { sent, .. } => {
                self.gate.sign(now, sent);
                self.taken(&query, now);
            }
            Ask::Pull { number, after, wait, .. } => {
                if number > self.last_pull {
                    self.last_pull = number;
                    self.outbox.acknowledged(after);
                    let until = now + wait.clamp(0.0, LONGEST_WAIT);
                    self.pull = Some(Pull { query, until });
                }
            }
            Ask::Leave { why, .. } => {
                self.taken(&query, now);
                return Some(why);
            }
            Ask::Post(post) => {
                let kind = self.common.lines().kind(&post.request.ask);
                if let Some(why) = forbidden(&post, kind, scope) {
                    answer(&query, &Answer::Refused { t: now, why });
                } else {
                    let verdict = self.gate.post(now, post, kind);
                    self.taken(&query, now);
                    return self.carry_out(verdict).await;
                }
            }
            Ask::Urgent { after, post } => {
                let kind = self.common.lines().kind(&post.request.ask);
                if kind != Kind::Stops || scope < Scope::Stop {
                    let why =
                        "an urgent request is a stop or a latch, with a key of `stop` or `act`"
                            .to_owned();
                    answer(&query, &Answer::Refused { t: now, why });
                } else {
                    let verdict = self.gate.urgent(now, after, post);
                    self.taken(&query, now);
                    return self.carry_out(verdict).await;
                }
            }
        }
        None
    }

    fn taken(&self, query: &Query, now: f64) {
        answer(query, &Answer::Taken { t: now, next: self.gate.next() });
    }

    async fn carry_out(&mut self, verdict: Verdict) -> Option<String> {
        match verdict {
            Verdict::Again | Verdict::Early => None,
            Verdict::Refuse(id, reason, message) => {
                let text = Text::Refusal { id, reason, message, code: None };
                self.outbox.push(&Frame::text(encode(&text)));
                None
            }
            Verdict::Pass(request) => match self.program.pass(&request).await {
                Ok(()) => None,
                Err(error) => Some(format!("the share is lost: {error}")),
            },
        }
    }

    fn answer_pull(&mut self, now: f64) {
        let is_due = |pull: &Pull| now >= pull.until;
        if self.outbox.is_empty() && !self.pull.as_ref().is_some_and(is_due) {
            return;
        }
        let Some(Pull { query, .. }) = self.pull.take() else { return };
        let (first, count, bytes) = self.outbox.next();
        let head = Answer::Pulled { t: now, first, count };
        answer_with(&query, bytes, &head);
    }
}

/// Why a request may not be sent with this key.
fn forbidden(post: &Post, kind: Kind, scope: Scope) -> Option<String> {
    let is_own = post.request.id >= OWN_IDS;
    let is_of_session = matches!(post.request.ask, ShareAsk::Hello { .. } | ShareAsk::Leave { .. });
    match () {
        () if is_own => Some(format!("the id of a request is below {OWN_IDS}")),
        () if is_of_session => Some("a session begins with join and ends with leave".to_owned()),
        () if scope < weight::scope(kind) => {
            Some(format!("this request needs the key of `{}`", weight::scope(kind).word()))
        }
        () => None,
    }
}
