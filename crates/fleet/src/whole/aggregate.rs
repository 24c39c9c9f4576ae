//! From the requests of one program to those of all nodes, and back.
//!
//! It has no socket and reads no clock. Times come from the caller, in seconds.

mod node_answers;
mod rounds;
mod subscriptions;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use motorlink_telemetry::share::VERSION;
use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::data;
use motorlink_telemetry::share::frame::{Frame, FrameKind};
use motorlink_telemetry::share::message::{
    Answer, Ask, Event, EventKind, Line, Reason, Request, SignalName, Text, decode, encode,
};

use super::member::{Member, State};
use super::names;
use super::process_latch::Latches;
use super::round::{Round, RoundKind};
use crate::key::Name;

/// How long a stop waits for a node that is away, in seconds.
const PENDING: f64 = 10.0;

/// What is sent next.
#[derive(Debug, PartialEq)]
pub(super) enum Out {
    Program(Frame),
    Node(Name, Request),
}

/// A request to a node.
#[derive(Debug)]
struct Asked {
    node: Name,
    of: RequestPurpose,
    /// When, by the wall clock.
    wall: f64,
}

/// Why a node was asked.
#[derive(Debug)]
enum RequestPurpose {
    /// For the request of the program with this id, about this line of the node.
    One(u32, Option<String>),
    Round(u64),
    /// The lines of a node that came.
    Lines,
    /// Whether the latch of this number holds, after somebody has released the node.
    Released(u64),
    /// A subscription of the program, at a node that is back.
    Again(u32),
    /// The answer does not matter.
    Nothing,
}

/// A request to a node that is being connected for the first time.
#[derive(Debug)]
struct Waiting {
    node: Name,
    id: u32,
    ask: Ask,
    line: String,
    since: f64,
}

/// A subscription of the program.
#[derive(Debug)]
struct Subscription {
    /// What each node is asked for.
    parts: BTreeMap<Name, Ask>,
}

#[derive(Debug)]
pub(super) struct Aggregate {
    /// The name of the program in the log of each node.
    who: String,
    members: BTreeMap<Name, Member>,
    last_id: u32,
    asked: BTreeMap<u32, Asked>,
    last_round: u64,
    rounds: BTreeMap<u64, Round>,
    waiting: Vec<Waiting>,
    last_subscription: u32,
    subscriptions: BTreeMap<u32, Subscription>,
    last_group: u32,
    /// Whether a node is latched before its motors can move. The program is one of those that may latch.
    latches: Latches,
    program: Arc<()>,
    /// Until when a node that comes is stopped first.
    stops_until: f64,
    /// The nodes that have answered the last stop. What turns there since then was started on purpose.
    stopped: BTreeSet<Name>,
    /// Now, by the clock of stops and by the wall clock.
    now: f64,
    wall: f64,
    out: Vec<Out>,
}

impl Aggregate {
    pub(super) fn new(who: String, latches: Latches) -> Self {
        Aggregate {
            who,
            members: BTreeMap::new(),
            last_id: 0,
            asked: BTreeMap::new(),
            last_round: 0,
            rounds: BTreeMap::new(),
            waiting: Vec::new(),
            last_subscription: 0,
            subscriptions: BTreeMap::new(),
            last_group: 0,
            latches,
            program: Arc::default(),
            stops_until: f64::NEG_INFINITY,
            stopped: BTreeSet::new(),
            now: 0.0,
            wall: 0.0,
            out: Vec::new(),
        }
    }

    /// It is this time, by a clock that only goes forward and by the wall clock.
    pub(super) fn at(&mut self, now: f64, wall: f64) {
        (self.now, self.wall) = (now, wall);
    }

    /// What is to be sent, in this order.
    pub(super) fn take(&mut self) -> Vec<Out> {
        std::mem::take(&mut self.out)
    }

    /// A node is there, and is being connected. It may be known.
    pub(super) fn coming(&mut self, node: Name) {
        self.members.entry(node).or_insert_with(Member::new);
    }

    /// A node that other programs of this process knew is away.
    pub(super) fn remember(&mut self, node: Name, lines: Vec<Line>) {
        let member = self.members.entry(node).or_insert_with(Member::new);
        member.state = State::Away("it was there before".to_owned());
        member.lines = lines;
    }

    /// The lines of a node, as it told them last.
    pub(super) fn lines_of(&self, node: &Name) -> Option<&[Line]> {
        self.members.get(node).map(|member| &member.lines[..])
    }

    /// A node is connected.
    pub(super) fn came(&mut self, node: &Name) {
        let Some(member) = self.members.get_mut(node) else { return };
        member.state = State::Here;
        member.closing = None;
        // Before anything else can move its motors.
        member.latch = 0;
        self.latch_first(node);
        if self.now < self.stops_until && !self.stopped.contains(node) {
            self.ask(node, Ask::Stop { motor: None }, RequestPurpose::Nothing);
        }
        self.ask(node, Ask::Lines, RequestPurpose::Lines);
        let waiting = self.rounds.iter().filter(|(_, round)| round.waits.contains(node));
        let waiting: Vec<_> = waiting.map(|(number, round)| (*number, round.kind)).collect();
        for (number, kind) in waiting {
            if let Some(ask) = self.ask_of(kind, node) {
                self.ask(node, ask, RequestPurpose::Round(number));
            }
        }
        let pending = |number: &u32| {
            self.rounds.values().any(|round| round.kind == RoundKind::Subscribe(*number))
        };
        let again = self.subscriptions.iter().filter(|(number, _)| !pending(number));
        let again = again.filter_map(|(number, it)| Some((*number, it.parts.get(node)?.clone())));
        for (number, ask) in again.collect::<Vec<_>>() {
            self.ask(node, ask, RequestPurpose::Again(number));
        }
        self.end_waiting(node);
    }

    /// Asks, or refuses, what waited for a node.
    fn end_waiting(&mut self, node: &Name) {
        let (ended, waiting): (Vec<_>, _) =
            std::mem::take(&mut self.waiting).into_iter().partition(|it| it.node == *node);
        self.waiting = waiting;
        for Waiting { id, mut ask, line, since, .. } in ended {
            if let Ask::Command { time_to_live, .. } = &mut ask {
                *time_to_live -= self.now - since;
                if *time_to_live <= 0.0 {
                    self.end(id, Err(expired(node)));
                    continue;
                }
            }
            self.one(id, ask, &names::in_fleet(node, &line));
        }
    }

    /// A node cannot be reached any more, or could not be reached.
    pub(super) fn gone(&mut self, node: &Name, why: &str) {
        let Some(member) = self.members.get_mut(node) else { return };
        let why = member.closing.take().unwrap_or_else(|| why.to_owned());
        member.subscriptions.clear();
        member.groups.clear();
        let before = std::mem::replace(&mut member.state, State::Away(why.clone()));
        let (asked, others): (BTreeMap<_, _>, _) =
            std::mem::take(&mut self.asked).into_iter().partition(|(_, it)| it.node == *node);
        self.asked = others;
        for asked in asked.into_values() {
            self.ended(node, asked.of, Err(away(node, &why)));
        }
        if before == State::Coming {
            self.fail_rounds(node, &why);
            self.end_waiting(node);
        }
        if before == State::Here {
            self.tell_lost(node, &why);
        }
    }

    /// Tells a program that comes which lines are lost.
    fn tell_away(&mut self) {
        let away = |(node, member): (&Name, &Member)| match &member.state {
            State::Away(why) => Some((node.clone(), why.clone())),
            State::Coming | State::Here => None,
        };
        for (node, why) in self.members.iter().filter_map(away).collect::<Vec<_>>() {
            self.tell_lost(&node, &why);
        }
    }

    fn tell_lost(&mut self, node: &Name, why: &str) {
        let lines = self.lines_of(node).unwrap_or_default();
        for line in lines.iter().map(|line| line.line.clone()).collect::<Vec<_>>() {
            let message = format!("node {node} is away: {why}");
            self.tell(node, EventKind::Lost, &line, message);
        }
    }

    /// A request of the program. `false`: it leaves.
    pub(super) fn asked(&mut self, Request { id, mut ask, .. }: Request) -> bool {
        match &ask {
            Ask::Hello { protocol, .. } if *protocol != VERSION => {
                let message = format!("the fleet speaks version {VERSION}");
                self.end(id, Err(Refusal::usage(message)));
            }
            Ask::Hello { .. } => {
                let share = "fleet".to_owned();
                let name = self.who.clone();
                self.end(id, Ok(Answer::Hello { protocol: VERSION, share, name }));
                self.tell_away();
            }
            Ask::Lines => self.all(id, RoundKind::Lines),
            Ask::Rates { line: None } => self.all(id, RoundKind::Rates),
            Ask::Stop { motor: None } => {
                self.stops_until = self.now + PENDING;
                self.stopped.clear();
                self.all(id, RoundKind::Stop);
            }
            Ask::Latch => {
                self.latches.add(&self.program);
                self.all(id, RoundKind::Latch);
            }
            Ask::Release => {
                self.latches.clear();
                self.all(id, RoundKind::Release);
            }
            Ask::Subscribe { .. } => self.subscribe(id, ask),
            Ask::Unsubscribe { subscription } => {
                let answer = match self.unsubscribe(*subscription) {
                    true => Ok(Answer::Unsubscribe),
                    false => {
                        Err(Refusal::usage(format!("there is no subscription {subscription}")))
                    }
                };
                self.end(id, answer);
            }
            Ask::Leave { .. } => return false,
            Ask::Alive => {}
            Ask::Ports | Ask::Scan { .. } | Ask::Open { .. } => {
                let why = "ports of a node are opened at the node: `motorlink node -p PORT`";
                self.end(id, Err(Refusal::usage(why)));
            }
            _ => match names::line_of(&mut ask).map(std::mem::take) {
                Some(line) => self.one(id, ask, &line),
                None => self.end(id, Err(Refusal::usage("the fleet does not know this request"))),
            },
        }
        true
    }

    /// A message of a node.
    pub(super) fn heard(&mut self, node: &Name, Frame { kind, payload }: Frame) {
        if kind == FrameKind::Data {
            return self.rows(node, payload);
        }
        // What a later version says besides.
        let Ok(text) = decode(&payload) else { return };
        match text {
            Text::Answer { id, answer } => self.answered(node, id, Ok(answer)),
            Text::Refusal { id, refusal } => self.answered(node, id, Err(refusal)),
            Text::Event(event) => {
                // A busy line tells late of a release that came before a newer latch: the node knows.
                if event.event == EventKind::Released
                    && let Some(number) = self.latches.watched_by(&self.program)
                {
                    self.ask(node, Ask::Lines, RequestPurpose::Released(number));
                }
                let ahead = self.members.get(node).map_or(0.0, Member::ahead);
                self.say(&Text::Event(names::event(node, event, ahead)));
            }
            Text::Group(mut group) => {
                let Some(member) = self.members.get_mut(node) else { return };
                let Some(subscription) = member.subscriptions.get(&group.subscription) else {
                    return;
                };
                self.last_group += 1;
                member.groups.insert(group.group, self.last_group);
                group.group = self.last_group;
                group.subscription = *subscription;
                group.line = names::in_fleet(node, &group.line);
                self.say(&Text::Group(group));
            }
            Text::Unconfirmed { subscription, line, motor, rows } => {
                let member = self.members.get(node);
                let ours = member.and_then(|it| it.subscriptions.get(&subscription));
                if let Some(&subscription) = ours {
                    let line = names::in_fleet(node, &line);
                    self.say(&Text::Unconfirmed { subscription, line, motor, rows });
                }
            }
            Text::Missed { .. } => self.say(&text),
            Text::Closing { message } => {
                if let Some(member) = self.members.get_mut(node) {
                    member.closing = Some(message);
                }
            }
            Text::Later => {}
        }
    }

    /// Latches a node, unless this connection has asked for the latch that holds.
    fn latch_first(&mut self, node: &Name) {
        let before = self.members.get(node).map_or(0, |member| member.latch);
        if self.latches.number().is_some_and(|number| number > before) {
            self.ask(node, Ask::Latch, RequestPurpose::Nothing);
        }
    }

    fn rows(&mut self, node: &Name, mut payload: Vec<u8>) {
        let member = self.members.get(node);
        let group = data::group_of(&payload);
        let ours = group.and_then(|group| member?.groups.get(&group));
        if let Some(&group) = ours {
            data::regroup(&mut payload, group);
            self.out.push(Out::Program(Frame::data(payload)));
        }
    }

    /// Asks the node of a line.
    fn one(&mut self, id: u32, mut ask: Ask, line: &str) {
        let (node, there) = match self.known(line) {
            Ok(place) => place,
            Err(why) => return self.end(id, Err(why)),
        };
        match self.members.get(&node).map(|it| &it.state) {
            Some(State::Away(why)) => {
                let why = away(&node, why);
                self.end(id, Err(why));
            }
            Some(State::Here) => {
                if let Some(line) = names::line_of(&mut ask) {
                    line.clone_from(&there);
                }
                if matches!(ask, Ask::Command { .. }) {
                    self.latch_first(&node);
                }
                self.ask(&node, ask, RequestPurpose::One(id, Some(there)));
            }
            // It does not take long until it is known whether the node is there.
            Some(State::Coming) | None => {
                self.waiting.push(Waiting { node, id, ask, line: there, since: self.now });
            }
        }
    }

    /// The node of a line, and the name of the line there.
    fn known(&self, line: &str) -> Result<(Name, String), Refusal> {
        match names::at_node(line) {
            Some((node, line)) if self.members.contains_key(&node) => Ok((node, line.to_owned())),
            Some((node, _)) => Err(Refusal::usage(format!("the fleet has no node {node}"))),
            None => Err(Refusal::usage(format!("a line of the fleet is NODE/LINE, not `{line}`"))),
        }
    }

    fn ask(&mut self, node: &Name, ask: Ask, of: RequestPurpose) {
        if let (Ask::Latch, Some(member)) = (&ask, self.members.get_mut(node)) {
            member.latch = self.latches.number().unwrap_or(member.latch);
        }
        self.last_id += 1;
        let asked = Asked { node: node.clone(), of, wall: self.wall };
        self.asked.insert(self.last_id, asked);
        self.out.push(Out::Node(node.clone(), Request::new(self.last_id, ask)));
    }

    fn end(&mut self, id: u32, result: Result<Answer, Refusal>) {
        self.say(&Text::end(id, result));
    }

    /// Something happened to a line of a node.
    fn tell(&mut self, node: &Name, event: EventKind, line: &str, message: String) {
        let line = names::in_fleet(node, line);
        let message = format!("{line}: {message}");
        self.say(&Text::Event(Event {
            wall: self.wall,
            line: Some(line),
            t: None,
            since: None,
            motor: None,
            by: None,
            event,
            message,
        }));
    }

    fn say(&mut self, text: &Text) {
        self.out.push(Out::Program(Frame::text(encode(text))));
    }
}

/// A node came too late for a command.
fn expired(node: &Name) -> Refusal {
    let message =
        format!("node {node} was not connected within the time to live; nothing was sent");
    Refusal::new(Reason::Expired, message)
}

/// A node did not get a request, or did not answer it.
fn away(node: &Name, why: &str) -> Refusal {
    Refusal::new(Reason::Line, format!("node {node} is away: {why}"))
}

#[cfg(test)]
mod tests;
