//! A node of the fleet, as a program sees it.

use std::collections::{BTreeMap, BTreeSet};

use motorlink_telemetry::share::clock::Clock;
use motorlink_telemetry::share::message::{ANY_MOTOR, Line, MotorName, StoppedMotor};

use super::names::in_fleet;
use crate::key::Name;

/// Whether a node can be asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum State {
    /// It is connected for the first time. Requests to all nodes wait for it.
    Coming,
    Here,
    /// And why.
    Away(String),
}

#[derive(Debug)]
pub(super) struct Member {
    pub(super) state: State,
    /// Its lines, as it told them last.
    pub(super) lines: Vec<Line>,
    pub(super) latched_by: Option<String>,
    /// The number of the last latch that this connection has asked for.
    pub(super) latch: u64,
    /// The clocks of its lines, by the wall clock of this computer.
    clocks: BTreeMap<String, Clock>,
    /// The program's subscription of each of its subscriptions.
    pub(super) subscriptions: BTreeMap<u32, u32>,
    /// The program's group of each of its groups.
    pub(super) groups: BTreeMap<u32, u32>,
    /// Why it closes the connection.
    pub(super) closing: Option<String>,
}

impl Member {
    pub(super) fn new() -> Self {
        Member {
            state: State::Coming,
            lines: Vec::new(),
            latched_by: None,
            latch: 0,
            clocks: BTreeMap::new(),
            subscriptions: BTreeMap::new(),
            groups: BTreeMap::new(),
            closing: None,
        }
    }

    /// Its lines were asked for and told at these times of this computer's wall clock, in seconds. Times of
    /// its own are replaced by those. Gives the lines before.
    pub(super) fn learn(&mut self, lines: &[Line], asked: f64, told: f64) -> Vec<Line> {
        let (asked, told) = (nanos(asked), nanos(told));
        let before = std::mem::take(&mut self.clocks);
        self.clocks.extend(lines.iter().map(|line| {
            // Another line of this name begins its clock anew.
            let known = before.get(&line.line).filter(|it| it.is_before(line.t));
            let clock = match known {
                Some(clock) => clock.corrected(line, asked, told),
                None => Clock::new(line, asked, told),
            };
            (line.line.clone(), clock)
        }));
        let own = |line: &Line| {
            let own = self.clocks.get(&line.line).map(|it| it.own(line.t) as f64 / 1e9);
            Line { wall: own.unwrap_or(line.wall), ..line.clone() }
        };
        let lines = lines.iter().map(own).collect();
        std::mem::replace(&mut self.lines, lines)
    }

    /// How far its wall clock is ahead of that of this computer, in seconds.
    pub(super) fn ahead(&self) -> f64 {
        self.clocks.values().next().map_or(0.0, |it| it.ahead().0)
    }

    /// Its motors after a stop that it did not answer: none confirmed it.
    pub(super) fn unstopped(&self, node: &Name, why: &str) -> Vec<StoppedMotor> {
        let failed = |line: String, motor| StoppedMotor {
            motor: MotorName { line, motor },
            failure: Some(why.to_owned()),
            absent: false,
        };
        if self.lines.is_empty() {
            return vec![failed(node.to_string(), ANY_MOTOR)];
        }
        let of_line = |line: &Line| {
            let known: BTreeSet<u8> = line.heard.iter().chain(&line.unstopped).copied().collect();
            let name = in_fleet(node, &line.line);
            match known.is_empty() {
                true => vec![failed(name, ANY_MOTOR)],
                false => known.into_iter().map(|motor| failed(name.clone(), motor)).collect(),
            }
        };
        self.lines.iter().flat_map(of_line).collect()
    }
}

/// Seconds since 1970 in ns.
fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9) as u64
}
