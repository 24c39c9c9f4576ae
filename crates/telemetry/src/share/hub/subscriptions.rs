//! Subscriptions of programs, and the rates of their signals.

use std::collections::BTreeSet;

use litemap::LiteMap as Map;

use super::Hub;
use super::completion_types::WorkResult;
use super::line::SharedLine;
use super::requests::{Refused, ended, span, usage};
use super::session_id::SessionId;
use super::subscription_encoder::Feed;
use crate::acquisition::Acquisition;
use crate::share::message::{
    Answer, Column, DropRule, LONGEST_QUEUE, MOST_SIGNALS, MOST_SUBSCRIPTIONS, MotorName, Reason,
    SignalName,
};
use crate::signal::{Signal, Source};
use crate::subscription::Full;

/// The shortest period of a subscription, in seconds.
const SHORTEST_PERIOD: f64 = 1e-4;

impl Hub {
    pub(super) fn subscribe(
        &mut self,
        id: SessionId,
        signals: &[SignalName],
        period: f64,
        (queue, drop): (u32, DropRule),
        rows: bool,
    ) -> Result<u32, Refused> {
        let mut wanted: Map<usize, BTreeSet<Signal>> = Map::new();
        if signals.is_empty() || signals.len() > MOST_SIGNALS {
            return Err(usage(format!("a subscription has 1 to {MOST_SIGNALS} signals")));
        }
        if !(1..=LONGEST_QUEUE).contains(&queue) {
            return Err(usage(format!("a queue has 1 to {LONGEST_QUEUE} records")));
        }
        let period = span("the period", period, SHORTEST_PERIOD)?;
        for SignalName { line, motor, name } in signals {
            let (line, motor) = self.motor(&MotorName { line: line.clone(), motor: *motor })?;
            let signal = Signal::named(motor, name).map_err(|error| usage(error.to_string()))?;
            wanted.entry(line).or_default().insert(signal);
        }
        let full = match drop {
            DropRule::Oldest => Full::DropOldest,
            DropRule::Newest => Full::DropNewest,
        };
        let Some(session) = self.sessions.get_mut(&id) else { return Ok(0) };
        if session.feeds.len() >= MOST_SUBSCRIPTIONS {
            let message = format!("a program has up to {MOST_SUBSCRIPTIONS} subscriptions");
            return Err((Reason::Busy, message));
        }
        session.last_feed += 1;
        let mut feed = Feed::new(session.last_feed, rows);
        for (line, signals) in wanted {
            if let Some(held) = self.lines.get_mut(&line) {
                for signal in &signals {
                    held.motor_state(signal.motor).is_known = true;
                }
            }
            feed.add(&self.lines, line, signals, period, (queue as usize, full)).map_err(ended)?;
        }
        session.feeds.insert(session.last_feed, feed);
        Ok(session.last_feed)
    }

    pub(super) fn rates(
        &mut self,
        session: SessionId,
        id: u32,
        line: Option<&str>,
    ) -> Result<Option<Answer>, Refused> {
        let lines = match line {
            Some(line) => vec![self.line(line)?],
            None => self.lines.keys().copied().collect(),
        };
        let Some(asker) = self.sessions.get_mut(&session) else { return Ok(None) };
        if lines.is_empty() {
            return Ok(Some(Answer::Rates { rates: Vec::new() }));
        }
        let part = asker.gather(id, lines.len(), Vec::new());
        for line in lines {
            let held = &self.lines[&line];
            let tell = self.teller(session, None, line);
            let task = move |engine: &mut Acquisition| {
                tell(WorkResult::Rates(part, engine.rates().collect()));
            };
            held.remote().post(task).map_err(ended)?;
        }
        Ok(None)
    }
}

impl SharedLine {
    /// The signals of a motor.
    pub(super) fn columns(&self) -> Vec<Column> {
        let motor = self.speaks.motor(1);
        let column = |motor| move |source| Column::of(&Signal { motor, source });
        motor.into_iter().flat_map(|it| Source::all(it).into_iter().map(column(it))).collect()
    }
}
