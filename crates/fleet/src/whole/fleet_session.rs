//! The sockets of one program and of all nodes.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::os::unix::net::UnixStream as StdStream;
use std::sync::Arc;
use std::time::Duration;

use motorlink_telemetry::share::address::Unreachable;
use motorlink_telemetry::share::frame::{self, Frame, Reader};
use motorlink_telemetry::share::message::{Line, Request, decode, encode};
use parking_lot::Mutex;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::mpsc::{Receiver, Sender, UnboundedSender, channel, unbounded_channel};
use tokio::time::{Instant, sleep_until};
use zenoh::Session as Zenoh;
use zenoh::handlers::{FifoChannelHandler, RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

use super::aggregate::{Aggregate, Out};
use crate::clock::{Boot, Clock};
use crate::directory::{self, Run};
use crate::key::{self, Name};
use crate::message::Info;
use crate::remote::{PATIENCE, Remote};

/// The pause between two attempts to connect to a node.
const AGAIN: Duration = Duration::from_millis(500);
/// Bytes that wait for the program. Nothing more is read from nodes meanwhile: their shares drop samples.
const WAITING: usize = 1 << 20;
/// The longest request of a program: one may have the signals of all drives.
const LONGEST: usize = frame::LONGEST;
/// How long nodes may take at first to say who went away.
const FIRST: Duration = Duration::from_millis(500);
/// Messages of nodes that wait.
const QUEUE: usize = 64;
/// The same of what nodes say of themselves. Older ones are dropped: they are said again.
const STATES: usize = 64;

/// What a node has said.
struct NodeEvent {
    node: Name,
    /// Which connection of it.
    run: u64,
    what: NodeEventKind,
}

enum NodeEventKind {
    Connected(Result<StdStream, Unreachable>),
    Said(Frame),
    Ended,
}

/// A node that was seen.
struct Link {
    /// Its name in the network. Several nodes may have it.
    node: Name,
    /// Its run, if that is known.
    boot: Option<Name>,
    run: u64,
    /// Its requests, while it is connected.
    requests: Option<UnboundedSender<Vec<u8>>>,
    /// When it is tried to connect next. `None`: it is connected, or is being connected.
    next: Option<Instant>,
}

/// A program that sees all nodes.
pub(super) struct FleetSession {
    aggregate: Aggregate,
    /// What a node is, besides its name.
    pattern: Remote,
    is_meant: Box<dyn Fn(&Name) -> bool + Send + Sync>,
    /// The runs that are there.
    here: BTreeSet<Run>,
    /// The nodes by their names in the fleet.
    links: BTreeMap<Name, Link>,
    reader: OwnedReadHalf,
    frames: Reader,
    writer: OwnedWriteHalf,
    out: Vec<u8>,
    news: Receiver<NodeEvent>,
    told: Sender<NodeEvent>,
    /// Nodes that come and go.
    seen: Subscriber<FifoChannelHandler<Sample>>,
    /// What nodes say of themselves.
    states: Subscriber<RingChannelHandler<Sample>>,
    known: AbsentNodes,
    zenoh: Arc<Zenoh>,
}

/// Nodes that went away, by their names in the fleet, for programs that come later.
pub(super) type AbsentNodes = Arc<Mutex<BTreeMap<Name, Absent>>>;

/// A node that went away.
#[derive(Debug, Clone)]
pub(super) struct Absent {
    run: Run,
    lines: Vec<Line>,
}

impl FleetSession {
    /// Looks for nodes, and serves the socket from then on. `known` has nodes that were there before.
    pub(super) async fn open(
        aggregate: Aggregate,
        pattern: Remote,
        is_meant: impl Fn(&Name) -> bool + Send + Sync + 'static,
        known: AbsentNodes,
        zenoh: Arc<Zenoh>,
        socket: StdStream,
    ) -> io::Result<()> {
        // Those that are there already are asked for below. While a subscriber gets them too, the answer is
        // empty.
        let seen = zenoh.liveliness().declare_subscriber(key::all_alive()).await;
        let seen = seen.map_err(io::Error::other)?;
        let states = zenoh.declare_subscriber(key::state(&Name::any()));
        let states = states.with(RingChannel::new(STATES)).await;
        let states = states.map_err(io::Error::other)?;
        let (reader, writer) = UnixStream::from_std(socket)?.into_split();
        let (told, news) = channel(QUEUE);
        let mut serving = FleetSession {
            aggregate,
            pattern,
            is_meant: Box::new(is_meant),
            here: BTreeSet::new(),
            links: BTreeMap::new(),
            reader,
            frames: Reader::new(LONGEST),
            writer,
            out: Vec::new(),
            news,
            told,
            seen,
            states,
            known,
            zenoh: Arc::clone(&zenoh),
        };
        // Those that are there already, so that the first answer has their lines.
        let tokens = zenoh.liveliness().get(key::all_alive()).await.map_err(io::Error::other)?;
        while let Ok(reply) = tokens.recv_async().await {
            if let Ok(sample) = reply.into_result() {
                serving.saw(&sample);
            }
        }
        let infos = directory::ask_all(&zenoh, key::info(&Name::any(), &Name::any()), FIRST).await;
        let infos = infos.map_err(io::Error::other)?;
        while let Ok(reply) = infos.recv_async().await {
            if let Ok(sample) = reply.into_result() {
                serving.told_away(&sample);
            }
        }
        serving.remember();
        tokio::spawn(async move {
            // The program has ended. So do the sessions at the nodes, with their sockets.
            let _ = serving.serve().await;
        });
        Ok(())
    }

    async fn serve(&mut self) -> io::Result<()> {
        let mut bytes = vec![0; 1 << 14];
        loop {
            self.connect();
            self.pass();
            let next = self.links.values().filter_map(|link| link.next).min();
            let next = next.unwrap_or_else(|| Instant::now() + AGAIN);
            tokio::select! {
                biased;
                read = self.reader.read(&mut bytes) => match read? {
                    0 => return Ok(()),
                    size => {
                        self.frames.push(&bytes[..size]);
                        if !self.requests()? {
                            return Ok(());
                        }
                    }
                },
                ready = self.writer.writable(), if !self.out.is_empty() => {
                    ready?;
                    self.write()?;
                }
                Some(news) = self.news.recv(), if self.out.len() < WAITING => self.heard(news),
                Ok(sample) = self.seen.recv_async() => self.saw(&sample),
                Ok(sample) = self.states.recv_async() => self.told_away(&sample),
                () = sleep_until(next) => {}
            }
        }
    }

    /// Takes the requests of the program. `false`: it leaves.
    fn requests(&mut self) -> io::Result<bool> {
        self.aggregate.at(Boot.now(), Boot.wall());
        while let Some(frame) = self.frames.take().map_err(io::Error::other)? {
            let request: Request = decode(&frame.payload).map_err(io::Error::other)?;
            if !self.aggregate.asked(request) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Passes on what the aggregate says.
    fn pass(&mut self) {
        for out in self.aggregate.take() {
            match out {
                Out::Program(Frame { kind, payload }) => {
                    // It was made from messages that were not too long.
                    let _ = frame::append(kind, &payload, &mut self.out);
                }
                Out::Node(node, request) => {
                    let requests = self.links.get(&node).and_then(|link| link.requests.as_ref());
                    let mut bytes = Vec::new();
                    let _ = frame::append(frame::FrameKind::Text, &encode(&request), &mut bytes);
                    // If it has ended, that is heard soon.
                    let _ = requests.map(|it| it.send(bytes));
                }
            }
        }
    }

    fn write(&mut self) -> io::Result<()> {
        match self.writer.try_write(&self.out) {
            Ok(size) => drop(self.out.drain(..size)),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// A node came or went. One that went ends its connection itself, sooner or later.
    fn saw(&mut self, sample: &Sample) {
        let Some((node, boot)) = key::run_of(sample.key_expr().as_str()) else { return };
        let run = (node, boot);
        if sample.kind() != SampleKind::Put {
            self.here.remove(&run);
            return;
        }
        if !(self.is_meant)(&run.0) {
            return;
        }
        let name = self.name_of(&run);
        self.here.insert(run.clone());
        self.aggregate.coming(name.clone());
        let (now, (node, boot)) = (Instant::now(), run);
        let new = Link { node, boot: None, run: 0, requests: None, next: Some(now) };
        let link = self.links.entry(name).or_insert(new);
        link.boot = Some(boot);
        link.next = link.next.map(|_| now);
    }

    /// The name of a run in the fleet: that of its node, unless another one that is there has it.
    fn name_of(&self, run: &Run) -> Name {
        let (node, boot) = run;
        let is_own = |link: &Link| link.node == *node && link.boot.as_ref() == Some(boot);
        if let Some((name, _)) = self.links.iter().find(|(_, link)| is_own(link)) {
            return name.clone();
        }
        let other = self.links.get(node).and_then(|link| link.boot.clone());
        match other.is_some_and(|other| self.here.contains(&(node.clone(), other))) {
            true => node.of_run(boot),
            false => node.clone(),
        }
    }

    /// A node says which others went away before this program came.
    fn told_away(&mut self, sample: &Sample) {
        let info: Option<Info> = serde_json::from_slice(&sample.payload().to_bytes()).ok();
        let is_known = |(node, boot): &Run| {
            self.links.values().any(|it| it.node == *node && it.boot.as_ref() == Some(boot))
        };
        let away = directory::away(info.iter(), is_known);
        if away.is_empty() {
            return;
        }
        let mut known = self.known.lock();
        for run in away.into_keys().filter(|(node, _)| (self.is_meant)(node)) {
            let lines = Vec::new();
            known.entry(self.name_of(&run)).or_insert(Absent { run, lines });
        }
        drop(known);
        self.remember();
    }

    /// Nodes that were there before keep their lines.
    fn remember(&mut self) {
        let known = self.known.lock().clone();
        for (name, Absent { run: (node, boot), lines }) in known {
            if !self.links.contains_key(&name) {
                let next = Some(Instant::now() + AGAIN);
                let link = Link { node, boot: Some(boot), run: 0, requests: None, next };
                self.links.insert(name.clone(), link);
                self.aggregate.remember(name, lines);
            }
        }
    }

    /// Connects to nodes, if it is time.
    fn connect(&mut self) {
        let now = Instant::now();
        for (name, link) in &mut self.links {
            if link.next.is_none_or(|next| next > now) {
                continue;
            }
            let runs = self.here.iter().filter(|(node, _)| *node == link.node);
            let boots: Vec<_> = runs.map(|(_, boot)| boot).collect();
            let boot = link.boot.clone().filter(|boot| boots.contains(&boot));
            // By its name another node would be reached.
            if boot.is_none() && (!boots.is_empty() || *name != link.node) {
                link.next = Some(now + AGAIN);
                continue;
            }
            link.next = None;
            link.run += 1;
            let remote = Remote { node: link.node.clone(), boot, ..self.pattern.clone() };
            let (zenoh, told) = (Arc::clone(&self.zenoh), self.told.clone());
            let (node, run) = (name.clone(), link.run);
            tokio::spawn(async move {
                let connected = remote.open(zenoh, PATIENCE).await;
                // The program may have ended.
                let _ = told
                    .send(NodeEvent { node, run, what: NodeEventKind::Connected(connected) })
                    .await;
            });
        }
    }

    fn heard(&mut self, NodeEvent { node, run, what }: NodeEvent) {
        self.aggregate.at(Boot.now(), Boot.wall());
        if self.links.get(&node).is_none_or(|link| link.run != run) {
            return;
        }
        let lost = match what {
            NodeEventKind::Said(frame) => return self.aggregate.heard(&node, frame),
            NodeEventKind::Connected(Ok(socket)) => match self.begin(&node, run, socket) {
                Ok(()) => return self.aggregate.came(&node),
                Err(error) => error.to_string(),
            },
            NodeEventKind::Connected(Err(error)) => error.to_string(),
            NodeEventKind::Ended => "the connection has ended".to_owned(),
        };
        if let Some(link) = self.links.get_mut(&node) {
            link.requests = None;
            link.next = Some(Instant::now() + AGAIN);
        }
        self.aggregate.gone(&node, &lost);
        let lines = self.aggregate.lines_of(&node).filter(|lines| !lines.is_empty());
        let run = self.links.get(&node).and_then(|it| Some((it.node.clone(), it.boot.clone()?)));
        if let Some((lines, run)) = lines.zip(run) {
            let mut known = self.known.lock();
            known.insert(node, Absent { run, lines: lines.to_vec() });
        }
    }

    /// Passes on what a node says, and what it is asked.
    fn begin(&mut self, node: &Name, run: u64, socket: StdStream) -> io::Result<()> {
        socket.set_nonblocking(true)?;
        let (mut reader, mut writer) = UnixStream::from_std(socket)?.into_split();
        let (requests, mut asked) = unbounded_channel::<Vec<u8>>();
        tokio::spawn(async move {
            while let Some(bytes) = asked.recv().await {
                if writer.write_all(&bytes).await.is_err() {
                    return;
                }
            }
        });
        let (told, name) = (self.told.clone(), node.clone());
        tokio::spawn(async move {
            let (mut frames, mut bytes) = (Reader::default(), vec![0; 1 << 14]);
            let said = |what| told.send(NodeEvent { node: name.clone(), run, what });
            while let Ok(size @ 1..) = reader.read(&mut bytes).await {
                frames.push(&bytes[..size]);
                while let Ok(Some(frame)) = frames.take() {
                    if said(NodeEventKind::Said(frame)).await.is_err() {
                        return;
                    }
                }
            }
            let _ = said(NodeEventKind::Ended).await;
        });
        if let Some(link) = self.links.get_mut(node) {
            link.requests = Some(requests);
        }
        Ok(())
    }
}
