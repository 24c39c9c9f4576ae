//! Queries of programs, and the sessions that they belong to.

use std::collections::BTreeSet;
use std::sync::Arc;

use motorlink_telemetry::share::client::{Program, UNAWAITED};
use motorlink_telemetry::share::message::{Ask as ShareAsk, Request};
use tokio::runtime::{Handle, Runtime};
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::mpsc::{Receiver, channel};
use tracing::info;
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::Query;
use zenoh::sample::SampleKind;

use super::node_state::{Common, answer};
use super::request_order::RequestOrder;
use super::send_buffer::SendBuffer;
use super::session::Session;
use super::sessions::{Asked, Asking, Open};
use crate::VERSION;
use crate::key::{self, Asker, Name, Scope};
use crate::message::{
    AnswerKind, Ask, LONGEST_ASK, LONGEST_DEADLINE, LONGEST_PROGRAM, SHORTEST_DEADLINE,
};

/// Sessions at one time: a share has 64 programs.
const MOST_SESSIONS: usize = 48;
/// The same with those that come to stop motors.
const WITH_STOPS: usize = 60;
/// Queries of a session that wait.
const QUERIES: usize = 256;
/// Sessions that are over and whose reason is remembered.
const REASONS: usize = 256;

/// Takes queries from now on.
pub(super) fn open(common: &Arc<Common>, runtime: &Runtime) -> zenoh::Result<LivelinessToken> {
    let zenoh = &common.zenoh;
    let (router, handle) = (Arc::clone(common), runtime.handle().clone());
    let asked = move |query: Query| router.asked(query, &handle);
    zenoh
        .declare_queryable(key::all_asks(&common.name, &common.boot))
        .callback(asked)
        .background()
        .wait()?;
    let (router, handle) = (Arc::clone(common), runtime.handle().clone());
    let said = move |query: Query| {
        let router = Arc::clone(&router);
        handle.spawn(async move { router.say_info(&query).await });
    };
    let info = key::info(&common.name, &common.boot);
    zenoh.declare_queryable(info).callback(said).background().wait()?;
    let (router, handle) = (Arc::clone(common), runtime.handle().clone());
    let here = move |sample: zenoh::sample::Sample| {
        if sample.kind() == SampleKind::Delete
            && let Some((who, session)) = key::parse_session_token(sample.key_expr().as_str())
        {
            router.gone(&who, &session, &handle);
        }
    };
    let all = key::session_token(&common.name, &common.boot, &Name::any(), &Name::any());
    zenoh.liveliness().declare_subscriber(all).callback(here).background().wait()?;
    zenoh.liveliness().declare_token(key::alive(&common.name, &common.boot)).wait()
}

impl Common {
    fn asked(self: &Arc<Self>, query: Query, handle: &Handle) {
        let t = self.clock.now();
        let refuse = |why: String| answer(&query, t, AnswerKind::Refused { why });
        let Some(asker) = Asker::of(query.key_expr().as_str()) else {
            return refuse("the key does not say who asks for what".to_owned());
        };
        let bytes = query.payload().map(|payload| payload.to_bytes());
        if bytes.as_ref().is_some_and(|bytes| bytes.len() > LONGEST_ASK) {
            return refuse(format!("a request has up to {LONGEST_ASK} bytes"));
        }
        let ask: Ask = match serde_json::from_slice(&bytes.unwrap_or_default()) {
            Ok(ask) => ask,
            Err(error) => return refuse(format!("the request cannot be read: {error}")),
        };
        let Asker { scope, who, session } = asker;
        let mut sessions = self.sessions.lock();
        sessions.heard(&session, t);
        if matches!(ask, Ask::Join { .. }) && sessions.open.len() >= session_limit(scope) {
            sessions.forget_silent(t);
        }
        let known = sessions.open.get(&session);
        if let Some(Open { who: owner, .. }) = known
            && *owner != who
        {
            return refuse("this is the session of somebody else".to_owned());
        }
        let sender = match (known, &ask) {
            (Some(Open { asked, .. }), _) => asked.clone(),
            (None, Ask::Join { .. }) if sessions.open.len() >= session_limit(scope) => {
                return refuse(format!("the node has {MOST_SESSIONS} programs, its most"));
            }
            (None, Ask::Join { protocol, program, deadline, motion }) => {
                let (deadline, motion) = (*deadline, *motion);
                if let Err(why) = check_join(*protocol, program, deadline, motion) {
                    return refuse(why);
                }
                let (sender, asked) = channel(QUERIES);
                let open = Open { who: who.clone(), asked: sender.clone(), heard: t };
                sessions.open.insert(session.clone(), open);
                let name = format!("{who} ({program})");
                let serving = Arc::clone(self).serve(session, name, deadline, motion, asked);
                handle.spawn(serving);
                sender
            }
            (None, _) => {
                let over = sessions.over.iter().find(|(it, _)| *it == session);
                let why = over.map_or("no such session at this node", |(_, why)| why);
                return answer(&query, t, AnswerKind::Over { why: why.to_owned() });
            }
        };
        drop(sessions);
        let asking = Box::new(Asking { query, ask, scope });
        if let Err(TrySendError::Full(Asked::Query(asking))) = sender.try_send(Asked::Query(asking))
        {
            let query = asking.query;
            let why = "too many requests of this session wait".to_owned();
            answer(&query, t, AnswerKind::Refused { why });
        }
    }

    /// A program or its network has gone. What it sees is kept for a moment; its motors stop now.
    fn gone(self: &Arc<Self>, who: &Name, session: &Name, handle: &Handle) {
        let sessions = self.sessions.lock();
        let open = sessions.open.get(session).filter(|open| open.who == *who);
        let asked = open.map(|open| open.asked.clone());
        drop(sessions);
        if let Some(asked) = asked {
            handle.spawn(async move { asked.send(Asked::Gone).await });
        }
    }

    /// Serves one session of a program with this name.
    async fn serve(
        self: Arc<Self>,
        session: Name,
        name: String,
        deadline: f64,
        motion: Option<f64>,
        asked: Receiver<Asked>,
    ) {
        info!(program = name, "session opened");
        let why = match Program::connect(&self.share, &name).await {
            Err(error) => format!("the share of the node: {error}"),
            Ok((program, listener, _)) => {
                let ask = ShareAsk::Deadline { silence: Some(deadline), motion };
                // A share that is lost is noticed when it is read.
                let _ = program.pass(&Request::new(UNAWAITED, ask)).await;
                let served = Session {
                    common: Arc::clone(&self),
                    order: RequestOrder::new(),
                    heard: self.clock.now(),
                    has_commanded: false,
                    deadline,
                    motion,
                    program,
                    listener,
                    outbox: SendBuffer::default(),
                    waiting: BTreeSet::new(),
                    pull: None,
                    last_pull: 0,
                    closing: None,
                };
                served.serve(asked).await
            }
        };
        info!(program = name, why, "session over");
        let mut sessions = self.sessions.lock();
        sessions.open.remove(&session);
        if sessions.over.len() >= REASONS {
            sessions.over.pop_front();
        }
        sessions.over.push_back((session, why));
    }
}

/// How many sessions there are before one with this key.
fn session_limit(scope: Scope) -> usize {
    match scope {
        Scope::Stop => WITH_STOPS,
        Scope::See | Scope::Act => MOST_SESSIONS,
    }
}

/// Checks the values of a session that may begin.
fn check_join(
    protocol: u32,
    program: &str,
    deadline: f64,
    motion: Option<f64>,
) -> Result<(), String> {
    if protocol != VERSION {
        return Err(format!("this node speaks version {VERSION}, the program {protocol}"));
    }
    let is_name = (1..=LONGEST_PROGRAM).contains(&program.len());
    if !is_name || !program.chars().all(motorlink_link::is_printable) {
        return Err(format!(
            "the name of a program has 1 to {LONGEST_PROGRAM} bytes that can be printed"
        ));
    }
    let possible = SHORTEST_DEADLINE..=LONGEST_DEADLINE;
    if !possible.contains(&deadline) || motion.is_some_and(|it| !possible.contains(&it)) {
        return Err(format!("a deadline is {SHORTEST_DEADLINE} to {LONGEST_DEADLINE} s"));
    }
    Ok(())
}
