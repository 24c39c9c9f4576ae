//! What a node says without being asked: events, the state of its lines, the main values of its motors.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::sync::Arc;
use std::time::Duration;

use motorlink_telemetry::overview::Overview;
use motorlink_telemetry::share::client::{Listener, Program};
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::frame::{Frame, FrameKind};
use motorlink_telemetry::share::message::{
    Answer, Ask, DropRule, Event, EventKind, Group, Line, SignalName, Text, decode,
};
use motorlink_telemetry::share::motor_exchange::{Exchanges, Target};
use motorlink_telemetry::signal::Signal;
use serde::Serialize;
use tokio::runtime::Handle;
use tokio::task::block_in_place;
use tokio::time::{MissedTickBehavior, interval, sleep, timeout};
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;

use super::node_state::{Common, covers, reply};
use crate::key;
use crate::message::Info;
use crate::request_permission::Lines;

/// How often the state is published.
const STATE: Duration = Duration::from_secs(1);
/// A state that is younger than this, in seconds, is as good as a new one.
const FRESH: f64 = 0.02;
/// The longest time until the share says which lines it has.
const LINES: Duration = Duration::from_secs(5);
/// Rows of a motor that wait.
const QUEUE: u32 = 1000;
/// The time to live of a question whether a motor is there, in seconds.
const SEARCH: f64 = 5.0;
/// The pause until a line without a motor is searched again: a drive may be switched on after its node.
const SEARCH_AGAIN: Duration = Duration::from_secs(5);

/// Follows the share from now on, once its lines are known.
pub(super) async fn start(common: &Arc<Common>, period: Duration) -> io::Result<()> {
    let (program, listener, _) = Program::connect(&common.share, "node").await?;
    tokio::spawn(Arc::clone(common).follow(listener));
    timeout(LINES, common.learn(&program))
        .await
        .map_err(|_| io::Error::from(io::ErrorKind::TimedOut))??;
    // Before anybody can ask.
    let names = common.known_lines().into_iter().map(|line| line.line);
    common.state.write().searching.extend(names);
    let columns = Arc::clone(common);
    let handle = Handle::current();
    let asked = move |query: Query| {
        let columns = Arc::clone(&columns);
        // A program that does not read may hold up its answer.
        handle.spawn(async move { block_in_place(|| columns.say_columns(&query)) });
    };
    let key = key::of_all_motors(&common.name, key::COLUMNS);
    let declared = common.zenoh.declare_queryable(key).callback(asked).background();
    declared.wait().map_err(io::Error::other)?;
    let own = common.own.get_or_init(|| program);
    tokio::spawn(Arc::clone(common).tell_state(own.clone(), period));
    Ok(())
}

impl Common {
    /// Publishes what the share says.
    async fn follow(self: Arc<Self>, mut listener: Listener) {
        let mut groups = BTreeMap::new();
        while let Ok(Frame { kind, payload }) = listener.next().await {
            match kind {
                FrameKind::Text => match decode(&payload) {
                    Ok(Text::Event(event)) => {
                        self.follow_port(&event);
                        self.publish_event(&event);
                    }
                    Ok(Text::Group(group)) => {
                        let key = key::of_motor(&self.name, &group.line, group.motor, key::COLUMNS);
                        self.put(&key, &group);
                        groups.insert(group.group, (group.line.clone(), group.motor));
                        self.columns_of(group);
                    }
                    // It may be the event that a port is back.
                    Ok(Text::Missed { .. }) => self.state.write().lost.clear(),
                    _ => {}
                },
                FrameKind::Data => {
                    let of = Data::decode(&payload).ok().and_then(|data| groups.get(&data.group));
                    let Some((line, motor)) = of else { continue };
                    let key = key::of_motor(&self.name, line, *motor, key::SAMPLES);
                    // A network that is slow loses samples. Nothing waits for it.
                    let _ = self
                        .zenoh
                        .put(key, payload)
                        .congestion_control(CongestionControl::Drop)
                        .wait();
                }
            }
        }
    }

    /// Asks for the lines and the state of the share.
    async fn learn(&self, program: &Program) -> io::Result<()> {
        match program.ask(Ask::Lines).await {
            Ok(Answer::Lines { lines, latched_by }) => {
                let mut state = self.state.write();
                let known = Lines::of(&lines);
                if *state.lines != known {
                    state.lines = Arc::new(known);
                }
                (state.known, state.latched_by) = (lines, latched_by);
                state.t = self.clock.now();
                Ok(())
            }
            Ok(_) => Err(io::Error::other("it gives another answer")),
            Err(refusal) => Err(io::Error::other(refusal.message)),
        }
    }

    /// Publishes the state again and again, and subscribes to the main values of motors that answer.
    async fn tell_state(self: Arc<Self>, program: Program, period: Duration) {
        let mut ticks = interval(STATE);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (mut searched, mut subscribed) = (BTreeSet::new(), BTreeSet::new());
        loop {
            ticks.tick().await;
            // The share ends with the node.
            if self.learn(&program).await.is_err() {
                return;
            }
            self.put(&key::state(&self.name), &self.info());
            for line in self.known_lines() {
                if searched.insert(line.line.clone()) {
                    Arc::clone(&self).search(&program, &line);
                }
                for motor in &line.heard {
                    let name = (line.line.clone(), *motor);
                    if !subscribed.contains(&name)
                        && subscribe(&program, &line, *motor, period).await
                    {
                        subscribed.insert(name);
                    }
                }
            }
        }
    }

    /// Reads something of each motor that a line can have. The share remembers those that answer. A line
    /// that was silent at the first question is searched again: its drives may be switched on in between.
    fn search(self: Arc<Self>, program: &Program, line: &Line) {
        let Some(speaks) = DriveProtocol::of(line) else { return };
        let motors: Vec<_> = (1..=u8::MAX).map_while(|number| speaks.motor(number)).collect();
        let (program, name) = (program.clone(), line.line.clone());
        self.state.write().searching.insert(name.clone());
        tokio::spawn(async move {
            loop {
                let Ok(heard) = self.heard(&program, &name).await else { return };
                for motor in motors.iter().filter(|motor| !heard.contains(&motor.number())) {
                    let target = Target::of(&name, *motor, speaks);
                    // Those that are there answer.
                    let _ = Exchanges::new(&program, &target).within(SEARCH).touch().await;
                }
                self.state.write().searching.remove(&name);
                match self.heard(&program, &name).await {
                    // The first question is that for motor 1.
                    Ok(now) if heard.is_empty() && !now.contains(&1) => sleep(SEARCH_AGAIN).await,
                    _ => return,
                }
            }
        });
    }

    /// The motors of a line that have answered.
    async fn heard(&self, program: &Program, name: &str) -> io::Result<BTreeSet<u8>> {
        self.learn(program).await?;
        let of = self.known_lines().into_iter().find(|line| line.line == name);
        Ok(of.into_iter().flat_map(|line| line.heard).collect())
    }

    pub(super) fn known_lines(&self) -> Vec<Line> {
        self.state.read().known.clone()
    }

    /// What the node says of itself.
    pub(super) fn info(&self) -> Info {
        let state = self.state.read();
        Info {
            node: self.name.to_string(),
            protocol: crate::VERSION,
            program: self.program.clone(),
            boot: self.boot.to_string(),
            t: self.clock.now(),
            wall: self.clock.wall(),
            lines: state.known.clone(),
            searching: state.searching.iter().cloned().collect(),
            latched_by: state.latched_by.clone(),
            away: self.members.lock().away(),
        }
    }

    /// Learns the state of the share as it is now. Without an answer the last one is kept.
    pub(super) async fn refresh(&self) {
        let age = self.clock.now() - self.state.read().t;
        if age > FRESH
            && let Some(own) = self.own.get()
        {
            let _ = timeout(STATE, self.learn(own)).await;
        }
    }

    /// Answers what the node is, as it is now.
    pub(super) async fn say_info(&self, query: &Query) {
        self.refresh().await;
        reply(query, &key::info(&self.name, &self.boot), &self.info());
    }

    /// Remembers whether the port of a line is lost.
    fn follow_port(&self, event: &Event) {
        let Event { line: Some(line), event, message, .. } = event else { return };
        match event {
            EventKind::Lost => self.state.write().lost.insert(line.clone(), message.clone()),
            EventKind::Back | EventKind::Closed => self.state.write().lost.remove(line),
            _ => None,
        };
    }

    /// What the share says of a line whose port is lost.
    pub(super) fn lost(&self, line: &str) -> Option<String> {
        self.state.read().lost.get(line).cloned()
    }

    fn columns_of(&self, group: Group) {
        let mut state = self.state.write();
        let key = key::of_motor(&self.name, &group.line, group.motor, key::COLUMNS);
        state.columns.insert(key, group);
    }

    fn say_columns(&self, query: &Query) {
        let state = self.state.read();
        let meant = state.columns.iter().filter(|(key, _)| covers(query.key_expr(), key));
        let meant: Vec<_> = meant.map(|(key, group)| (key.clone(), group.clone())).collect();
        drop(state);
        for (key, group) in meant {
            reply(query, &key, &group);
        }
    }

    fn publish_event(&self, event: &Event) {
        self.put(&key::events(&self.name, event.line.as_deref()), event);
    }

    /// Publishes a text. If the network does not take it, nothing waits.
    fn put(&self, key: &str, value: &impl Serialize) {
        let text = serde_json::to_vec(value).unwrap_or_default();
        let _ = self
            .zenoh
            .put(key, text)
            .encoding(Encoding::APPLICATION_JSON)
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::DataHigh)
            .wait();
    }
}

/// Subscribes to the main values of a motor. Gives whether the share has taken it.
async fn subscribe(program: &Program, line: &Line, motor: u8, period: Duration) -> bool {
    let Some(motor) = DriveProtocol::of(line).and_then(|speaks| speaks.motor(motor)) else {
        return false;
    };
    let main = Overview::of(motor);
    let sources = main.fast().chain(main.slow()).chain(main.angle);
    let signals = sources.map(|source| SignalName::of(&line.line, Signal { motor, source }));
    let signals = signals.collect();
    let period = period.as_secs_f64();
    let (queue, drop) = (QUEUE, DropRule::Oldest);
    program.ask(Ask::Subscribe { signals, period, queue, drop, rows: true }).await.is_ok()
}
