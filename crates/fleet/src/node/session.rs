//! A program of another computer, at this node.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use motorlink_link::is_printable;
use motorlink_telemetry::share::client::{Listener, OWN_IDS, Program, Refusal, UNAWAITED};
use motorlink_telemetry::share::command_kind::CommandKind;
use motorlink_telemetry::share::frame::{Frame, FrameKind};
use motorlink_telemetry::share::message::{Ask as ShareAsk, Reason, Request, Text, decode, encode};
use tokio::sync::mpsc::Receiver;
use tokio::time::{sleep, timeout};
use zenoh::query::Query;

use super::node_state::{Common, answer, answer_with};
use super::request_order::{RequestOrder, Verdict, age};
use super::send_buffer::SendBuffer;
use super::sessions::{Asked, Asking};
use crate::clock::span;
use crate::key::Scope;
use crate::message::{Answer, AnswerKind, Ask, LONGEST_WAIT, LONGEST_WHY, Post};
use crate::request_permission;

/// Requests without an answer. A share that has 256 answers for a program takes no more of its requests.
const REQUESTS: usize = 128;
/// The same with stops.
const WITH_STOPS: usize = 192;
/// The longest time for a request into the socket of the share.
const TAKEN: Duration = Duration::from_millis(500);
/// How long a session may be silent, in seconds.
const PATIENCE: f64 = 60.0;

/// What a session task has.
pub(super) struct Session {
    pub(super) common: Arc<Common>,
    pub(super) order: RequestOrder,
    /// When the last message of any kind came.
    pub(super) heard: f64,
    /// Whether it has changed something.
    pub(super) has_commanded: bool,
    pub(super) program: Program,
    pub(super) listener: Listener,
    pub(super) deadline: f64,
    pub(super) motion: Option<f64>,
    pub(super) outbox: SendBuffer,
    /// The requests that the share has not answered.
    pub(super) waiting: BTreeSet<u32>,
    pub(super) pull: Option<Pull>,
    pub(super) last_pull: u32,
    /// Why the share closes the connection.
    pub(super) closing: Option<String>,
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
            if self.outbox.is_over() {
                break "it does not take what the share says".to_owned();
            }
            if now > self.heard + PATIENCE {
                break "nothing was heard of it for a minute".to_owned();
            }
            self.answer_pull(now);
            match self.next(now, &mut asked).await {
                Next::Due => {}
                Next::Said(Ok(frame)) => self.said(&frame),
                Next::Said(Err(_)) => {
                    let why = || "the share has closed the connection".to_owned();
                    break self.closing.take().unwrap_or_else(why);
                }
                Next::Asked(None) => {
                    break "the node ends, or other programs need its place".to_owned();
                }
                Next::Asked(Some(Asked::Gone)) if self.has_commanded => {
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
        let refusal = Refusal::new(Reason::Lapsed, &why);
        self.program.close_because(refusal);
        if let Some(Pull { query, .. }) = self.pull.take() {
            answer(&query, self.now(), AnswerKind::Over { why: why.clone() });
        }
        why
    }

    fn now(&self) -> f64 {
        self.common.clock.now()
    }

    async fn next(&mut self, now: f64, asked: &mut Receiver<Asked>) -> Next {
        let until = self.pull.as_ref().map_or(f64::INFINITY, |pull| pull.until);
        let wait =
            span((until.min(self.heard + PATIENCE) - now).max(0.0)) + Duration::from_millis(1);
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
        self.heard = now;
        match ask {
            Ask::Join { .. } => {
                let (deadline, motion) = (self.deadline, self.motion);
                let lines = self.common.known_lines();
                answer(&query, now, AnswerKind::Joined { deadline, motion, lines });
            }
            Ask::Alive { sent, .. } => {
                let age = Some(age(now, sent));
                self.program.offer(&Request { id: UNAWAITED, age, ask: ShareAsk::Alive });
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
                return Some(
                    why.chars().filter(|it| is_printable(*it)).take(LONGEST_WHY).collect(),
                );
            }
            Ask::Post(post) => {
                let kind = self.common.lines().kind(&post.request.ask);
                if let Some(why) = forbidden(&post, kind, scope) {
                    answer(&query, now, AnswerKind::Refused { why });
                } else {
                    let verdict = self.order.post(now, post, kind);
                    self.taken(&query, now);
                    return self.carry_out(verdict).await;
                }
            }
            Ask::Urgent { after, post } => {
                let kind = self.common.lines().kind(&post.request.ask);
                if kind != CommandKind::Stops || scope < Scope::Stop {
                    let why =
                        "an urgent request is a stop or a latch, with a key of `stop` or `act`"
                            .to_owned();
                    answer(&query, now, AnswerKind::Refused { why });
                } else {
                    let verdict = self.order.urgent(now, after, post);
                    self.taken(&query, now);
                    return self.carry_out(verdict).await;
                }
            }
        }
        None
    }

    fn taken(&self, query: &Query, now: f64) {
        answer(query, now, AnswerKind::Taken { next: self.order.next() });
    }

    /// Gives the end of the session, if this is it.
    async fn carry_out(&mut self, verdict: Verdict) -> Option<String> {
        match verdict {
            Verdict::Again | Verdict::Early => None,
            Verdict::Refuse(id, reason, message) => {
                self.refuse(id, reason, message);
                None
            }
            Verdict::Pass(request) => {
                // The share takes requests only as long as few of its answers wait.
                let kind = self.common.lines().kind(&request.ask);
                let most = if kind == CommandKind::Stops { WITH_STOPS } else { REQUESTS };
                self.has_commanded |= kind.changes();
                if self.waiting.len() >= most {
                    let why = "too many requests wait for their answers".to_owned();
                    self.refuse(request.id, Reason::Busy, why);
                    return None;
                }
                // It has no answer.
                if request.ask != ShareAsk::Alive {
                    self.waiting.insert(request.id);
                }
                match timeout(TAKEN, self.program.pass(&request)).await {
                    Ok(Ok(())) => None,
                    Ok(Err(error)) => Some(format!("the share is lost: {error}")),
                    Err(_) => Some("the share takes no requests".to_owned()),
                }
            }
        }
    }

    fn refuse(&mut self, id: u32, reason: Reason, message: String) {
        let text = Text::Refusal { id, refusal: Refusal::new(reason, message) };
        self.outbox.push(&Frame::text(encode(&text)));
    }

    /// The share has said something.
    fn said(&mut self, frame: &Frame) {
        if frame.kind == FrameKind::Text {
            match decode(&frame.payload) {
                Ok(Text::Answer { id, .. } | Text::Refusal { id, .. }) => {
                    self.waiting.remove(&id);
                }
                Ok(Text::Closing { message }) => self.closing = Some(message),
                _ => {}
            }
        }
        self.outbox.push(frame);
    }

    fn answer_pull(&mut self, now: f64) {
        let is_due = |pull: &Pull| now >= pull.until;
        if self.outbox.is_empty() && !self.pull.as_ref().is_some_and(is_due) {
            return;
        }
        let Some(Pull { query, .. }) = self.pull.take() else { return };
        let (first, count, bytes) = self.outbox.next();
        let head = Answer { kind: AnswerKind::Pulled { first, count }, t: now };
        answer_with(&query, bytes, &head);
    }
}

/// Why a request may not be sent with this key.
fn forbidden(post: &Post, kind: CommandKind, scope: Scope) -> Option<String> {
    let is_own = post.request.id >= OWN_IDS;
    let is_of_session = matches!(
        post.request.ask,
        ShareAsk::Hello { .. } | ShareAsk::Deadline { .. } | ShareAsk::Leave { .. }
    );
    match () {
        () if is_own => Some(format!("the id of a request is below {OWN_IDS}")),
        () if is_of_session => Some(
            "a session begins with join, which says its deadlines, and ends with leave".to_owned(),
        ),
        () if scope < request_permission::scope(kind) => Some(format!(
            "this request needs the key of `{}`",
            request_permission::scope(kind).word()
        )),
        () => None,
    }
}
