//! Between the socket of a program and a node.

use std::io;
use std::os::unix::net::UnixStream as StdStream;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use motorlink_telemetry::share::address::Unreachable;
use motorlink_telemetry::share::command_kind::CommandKind;
use motorlink_telemetry::share::frame::{self, FrameKind, Reader};
use motorlink_telemetry::share::message::{
    Answer as ShareAnswer, Ask as ShareAsk, Request, Text, decode, encode,
};
use motorlink_telemetry::share::port::own_name;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::time::{sleep, timeout};
use tracing::info;
use zenoh::Session as Zenoh;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::Priority;
use zenoh::sample::{Sample, SampleKind};

use super::node_queries::{ASKED, NodeQueries, PAUSE, first_of, run_of};
use super::outgoing::Outgoing;
use crate::VERSION;
use crate::clock::{Boot, Clock, NodeClock, span};
use crate::key::{self, Name, Scope};
use crate::message::{Answer, AnswerKind, Ask, LONGEST_PROGRAM};
use crate::request_permission::{self, Lines};

/// How long a node keeps a pull, in seconds.
const WAIT: f64 = 0.25;
/// How long an answer to it may take besides.
const ANSWER: Duration = Duration::from_millis(1000);
/// How long a node that is there may take to begin a session, in seconds.
const JOINED: f64 = 2.0;
/// How long a node may be silent whose next run has begun, in seconds: more than a pull takes.
const RESTARTED: f64 = 1.5;
/// A program that has ended waits so long for the node to know it.
const LEAVING: Duration = Duration::from_millis(300);
/// The longest request of a program.
const LONGEST: usize = frame::LONGEST_REQUEST;

/// Each open tunnel has a clone.
static OPEN: LazyLock<Arc<()>> = LazyLock::new(Arc::default);

/// How many programs of this process have not left yet.
pub(super) fn open_tunnels() -> usize {
    Arc::strong_count(&OPEN) - 1
}

/// The node, and the values of `join`.
pub(super) struct SessionParams {
    pub(super) node: Name,
    /// Its run; `None`: the only one that is there.
    pub(super) boot: Option<Name>,
    pub(super) who: Name,
    pub(super) deadline: Duration,
    pub(super) motion: Option<Duration>,
    pub(super) stops: bool,
    /// How long it may be silent.
    pub(super) patience: Duration,
}

/// An answer, and when it was asked for.
struct Answered {
    of: QueryKind,
    asked: f64,
    answer: Option<(Answer, Vec<u8>)>,
}

/// What was asked.
enum QueryKind {
    Pull,
    Post(u32),
    Urgent(u32),
    Sign,
}

/// What happens next.
enum Next {
    Read(io::Result<usize>),
    Answered(Answered),
    Written(io::Result<OwnedWriteHalf>),
    Seen(Sample),
    Due,
}

pub(super) struct Tunnel {
    link: NodeQueries,
    outgoing: Outgoing,
    lines: Lines,
    deadline: f64,
    /// How long the node may be silent.
    patience: f64,
    reader: OwnedReadHalf,
    frames: Reader,
    /// `None` while a task writes.
    writer: Option<OwnedWriteHalf>,
    /// What is written next.
    coming: Vec<u8>,
    answers: UnboundedSender<Answered>,
    answered: UnboundedReceiver<Answered>,
    written: UnboundedSender<io::Result<OwnedWriteHalf>>,
    done: UnboundedReceiver<io::Result<OwnedWriteHalf>>,
    is_pulling: bool,
    pulls: u32,
    after: u64,
    /// When the next pull may be sent.
    pull_from: f64,
    /// When the node was heard last.
    heard: f64,
    /// The next sign of life, once it has commanded something.
    sign: Option<f64>,
    /// Which runs of nodes with this name begin or go away.
    runs: Runs,
    /// Whether the node has begun again, or another one has its name.
    has_successor: bool,
    _here: LivelinessToken,
    _open: Arc<()>,
}

impl Tunnel {
    /// Begins a session at the node, and serves the socket from then on.
    pub(super) async fn open(
        whom: SessionParams,
        zenoh: Arc<Zenoh>,
        socket: StdStream,
    ) -> Result<(), Unreachable> {
        let failed = |error: String| Unreachable::Failed(error);
        let SessionParams { node, boot, who, deadline, motion, stops, patience } = whom;
        let scope = if stops { Scope::Stop } else { Scope::See };
        let boot = match boot {
            Some(boot) => boot,
            None => run_of(&zenoh, &node).await?,
        };
        let session = Name::random().map_err(|error| failed(error.to_string()))?;
        let link = NodeQueries { zenoh, node, who, session, boot };
        let here = key::session_token(&link.node, &link.boot, &link.who, &link.session);
        let here = link.zenoh.liveliness().declare_token(here).await;
        let here = here.map_err(|error| failed(error.to_string()))?;
        let (deadline, motion) = (deadline.as_secs_f64(), motion.map(|it| it.as_secs_f64()));
        let runs = link.zenoh.liveliness().declare_subscriber(key::alive_of(&link.node)).await;
        let runs = runs.map_err(|error| failed(error.to_string()))?;
        let join =
            Ask::Join { protocol: VERSION, program: own_name(LONGEST_PROGRAM), deadline, motion };
        let begun = Boot.now();
        let (asked, answer) = loop {
            let asked = Boot.now();
            match link.ask(scope, &join, Priority::RealTime, ASKED).await {
                Some((answer, _)) => break (asked, answer),
                // The nodes of a network that was just joined may not be known yet.
                None if Boot.now() > begun + JOINED => {
                    return Err(failed(link.unanswered(scope)));
                }
                None => sleep(PAUSE).await,
            }
        };
        let now = Boot.now();
        let Answer { kind, t } = answer;
        let lines = match kind {
            AnswerKind::Joined { lines, .. } => lines,
            AnswerKind::Over { why } | AnswerKind::Refused { why } => return Err(failed(why)),
            _ => return Err(failed("the node gives another answer".to_owned())),
        };
        let socket = UnixStream::from_std(socket).map_err(|error| failed(error.to_string()))?;
        let (reader, writer) = socket.into_split();
        let (answers, answered) = unbounded_channel();
        let (written, done) = unbounded_channel();
        let tunnel = Tunnel {
            link,
            outgoing: Outgoing::new(NodeClock::new(asked, now, t)),
            lines: Lines::of(&lines),
            deadline,
            patience: patience.as_secs_f64(),
            reader,
            frames: Reader::new(LONGEST),
            writer: Some(writer),
            coming: Vec::new(),
            answers,
            answered,
            written,
            done,
            is_pulling: false,
            pulls: 0,
            after: 0,
            pull_from: now,
            heard: now,
            sign: None,
            runs,
            has_successor: false,
            _here: here,
            _open: Arc::clone(&OPEN),
        };
        tokio::spawn(tunnel.serve());
        Ok(())
    }

    async fn serve(mut self) {
        let mut bytes = vec![0; 1 << 14];
        let why = loop {
            let now = Boot.now();
            self.write();
            self.send(now);
            if let Some(why) = self.is_lost(now) {
                break Some(why);
            }
            match self.next(now, &mut bytes).await {
                Next::Due => {}
                Next::Seen(sample) => self.saw(&sample),
                Next::Read(Ok(0) | Err(_)) => break None,
                Next::Read(Ok(size)) => {
                    self.frames.push(&bytes[..size]);
                    if let Err(why) = self.requests() {
                        break Some(why);
                    }
                }
                Next::Answered(answered) => {
                    if let Some(why) = self.answered(answered) {
                        break Some(why);
                    }
                }
                Next::Written(Ok(writer)) => self.writer = Some(writer),
                Next::Written(Err(_)) => break None,
            }
        };
        self.end(why).await;
    }

    async fn next(&mut self, now: f64, bytes: &mut [u8]) -> Next {
        let pull = self.may_pull().then_some(self.pull_from);
        let lost = Some(self.heard + self.patience());
        let due = [self.outgoing.next_due(), self.sign, pull, lost].into_iter().flatten();
        let wait = span((due.fold(f64::INFINITY, f64::min) - now).max(0.0));
        tokio::select! {
            read = self.reader.read(bytes) => Next::Read(read),
            Some(answered) = self.answered.recv() => Next::Answered(answered),
            Some(written) = self.done.recv() => Next::Written(written),
            Ok(sample) = self.runs.recv_async() => Next::Seen(sample),
            () = sleep(wait) => Next::Due,
        }
    }

    /// A run of a node with this name has begun or is away.
    fn saw(&mut self, sample: &Sample) {
        let run = key::run_of(sample.key_expr().as_str());
        let is_other = run.is_some_and(|(_, boot)| boot != self.link.boot);
        self.has_successor |= is_other && sample.kind() == SampleKind::Put;
    }

    /// How long the node may be silent. If it has begun again, its last run says nothing any more.
    fn patience(&self) -> f64 {
        if self.has_successor { self.patience.min(RESTARTED) } else { self.patience }
    }

    /// Takes the requests of the program.
    fn requests(&mut self) -> Result<(), String> {
        while let Some(frame) = self.frames.take().map_err(|error| error.to_string())? {
            if frame.kind != FrameKind::Text {
                return Err("a program sends requests only".to_owned());
            }
            let request: Request = decode(&frame.payload).map_err(|error| error.to_string())?;
            let now = Boot.now();
            match request.ask {
                // The node has said hello to its share.
                ShareAsk::Hello { .. } => self.hello(request.id),
                _ if self.lines.kind(&request.ask) == CommandKind::Stops => {
                    self.outgoing.urgent(now, request);
                }
                _ => self.outgoing.post(now, request),
            }
        }
        Ok(())
    }

    /// Sends what is due.
    fn send(&mut self, now: f64) {
        for ask in self.outgoing.due(now) {
            let (of, scope, priority) = match &ask {
                Ask::Urgent { post, .. } => {
                    (QueryKind::Urgent(post.number), Scope::Stop, Priority::RealTime)
                }
                Ask::Post(post) => {
                    let scope = request_permission::scope(self.lines.kind(&post.request.ask));
                    let priority = match scope {
                        Scope::Act => Priority::InteractiveHigh,
                        Scope::See | Scope::Stop => Priority::DataHigh,
                    };
                    (QueryKind::Post(post.number), scope, priority)
                }
                _ => continue,
            };
            if scope == Scope::Act && self.sign.is_none() {
                self.sign = Some(now);
            }
            self.ask(of, scope, &ask, priority, ANSWER, now);
        }
        if self.sign.is_some_and(|sign| sign <= now) {
            self.sign = Some(now + self.deadline / 5.0);
            let ask = self.outgoing.heartbeat(now);
            self.ask(QueryKind::Sign, Scope::Act, &ask, Priority::RealTime, ANSWER, now);
        }
        if self.may_pull() && self.pull_from <= now {
            self.is_pulling = true;
            self.pulls += 1;
            let (number, after) = (self.pulls, self.after);
            let pull = Ask::Pull { number, after, wait: WAIT };
            self.ask(QueryKind::Pull, Scope::See, &pull, Priority::Data, span(WAIT) + ANSWER, now);
        }
    }

    /// The answer to hello of the program.
    fn hello(&mut self, id: u32) {
        let answer = ShareAnswer::Hello {
            protocol: motorlink_telemetry::share::VERSION,
            share: format!("node {}", self.link.node),
            name: self.link.who.to_string(),
        };
        let text = encode(&Text::Answer { id, answer });
        // It is short.
        let _ = frame::append(FrameKind::Text, &text, &mut self.coming);
    }

    /// Whether the program takes more, and nothing is asked for yet.
    fn may_pull(&self) -> bool {
        self.writer.is_some() && self.coming.is_empty() && !self.is_pulling
    }

    fn ask(
        &self,
        of: QueryKind,
        scope: Scope,
        ask: &Ask,
        priority: Priority,
        timeout: Duration,
        asked: f64,
    ) {
        // In this order on the network. The answers come in any order.
        let replies = self.link.send(scope, ask, priority, timeout);
        let answers = self.answers.clone();
        tokio::spawn(async move {
            let answer = match replies {
                Some(replies) => first_of(replies).await,
                None => None,
            };
            // The tunnel may have ended.
            let _ = answers.send(Answered { of, asked, answer });
        });
    }

    /// Gives the reason if the session is over.
    fn answered(&mut self, Answered { of, asked, answer }: Answered) -> Option<String> {
        let now = Boot.now();
        let is_pull = matches!(of, QueryKind::Pull);
        if is_pull {
            self.is_pulling = false;
            self.pull_from = now;
        }
        let Some((Answer { kind, t }, stream)) = answer else {
            self.pull_from = self.pull_from.max(if is_pull { now + 0.05 } else { 0.0 });
            return None;
        };
        self.heard = now;
        self.outgoing.heard(asked, now, t);
        match (kind, of) {
            (AnswerKind::Over { why } | AnswerKind::Refused { why }, _) => return Some(why),
            (AnswerKind::Taken { .. }, QueryKind::Urgent(number)) => {
                self.outgoing.taken_urgent(number)
            }
            (AnswerKind::Taken { next }, of) => {
                self.outgoing.taken(next);
                if matches!(of, QueryKind::Post(number) if number > next) {
                    self.outgoing.missed(now);
                }
            }
            (AnswerKind::Pulled { first, count }, QueryKind::Pull) if first == self.after + 1 => {
                self.after += count;
                self.coming.extend(stream);
            }
            _ => {}
        }
        None
    }

    /// Writes to the program, which may be slow. Nothing more is pulled meanwhile.
    fn write(&mut self) {
        let Some(mut writer) = self.writer.take_if(|_| !self.coming.is_empty()) else { return };
        let (bytes, written) = (std::mem::take(&mut self.coming), self.written.clone());
        tokio::spawn(async move {
            let result = writer.write_all(&bytes).await;
            let _ = written.send(result.map(|()| writer));
        });
    }

    /// Why the node cannot be used any more.
    fn is_lost(&self, now: f64) -> Option<String> {
        if now > self.heard + self.patience() {
            if self.has_successor {
                return Some("it was started again".to_owned());
            }
            let why = "it does not answer: it is away, or the network is cut; motors of this program \
                stop at the node";
            return Some(format!("{why} (nothing for {:.1} s)", now - self.heard));
        }
        let waits = now - self.outgoing.oldest()?;
        (waits > self.patience).then(|| {
            let who = &self.link.who;
            format!("it answers, but not to this request: {who} may be allowed to see only")
        })
    }

    async fn end(mut self, why: Option<String>) {
        info!(node = %self.link.node, why, "no longer used");
        if let Some(message) = why
            && let Some(mut writer) = self.writer.take()
        {
            let mut bytes = Vec::new();
            let closing = encode(&Text::Closing { message });
            if frame::append(FrameKind::Text, &closing, &mut bytes).is_ok() {
                // The program may not read.
                let _ = timeout(LEAVING, writer.write_all(&bytes)).await;
            }
            return;
        }
        // The stops that the program has asked for just before.
        self.send(Boot.now());
        let leave = Ask::Leave { why: "the program has ended".to_owned() };
        let left = self.link.ask(Scope::See, &leave, Priority::RealTime, LEAVING);
        // The node notices it otherwise, later.
        let _ = timeout(LEAVING, left).await;
    }
}

type Runs = zenoh::pubsub::Subscriber<zenoh::handlers::FifoChannelHandler<Sample>>;
