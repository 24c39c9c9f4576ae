//! Programs that own motors and do not seem to live.

use motorlink_proto::time::{Instant, Micros};

use super::line::SharedLine;
use super::session_id::SessionId;
use super::{Hub, event_text};
use crate::share::message::Ending;
use crate::signal::Motor;

/// The hub did not run for so long: no program could give it a sign of life.
const PAUSE: Micros = Micros::from_millis(200);

impl SharedLine {
    /// The motors of a program that it has not stopped.
    fn turning_for(&self, id: SessionId) -> Vec<Motor> {
        // The requests of others may all be refused.
        let mut own = self.owners.left_by(id, |_| false);
        own.retain(|motor| !self.owners.is_held(*motor));
        own
    }
}

impl Hub {
    /// It is this time now. Call it before [`received`](Self::received) and [`collect`](Self::collect). If
    /// the hub did not run since the last call, no program lapses because of that.
    pub fn at(&mut self, now: Instant) {
        let pause = now.since(self.now);
        self.now = now;
        // One that is always this slow has no pauses.
        let has_paused = std::mem::replace(&mut self.has_paused, pause > PAUSE);
        if pause > PAUSE && !has_paused {
            self.sessions.iter_mut().for_each(|(_, session)| session.life.shift(pause));
        }
    }

    /// The programs that have lapsed since the last call, and why. Their motors are stopped, and their
    /// connections have to be closed.
    pub fn take_lapsed(&mut self) -> Vec<(SessionId, String)> {
        std::mem::take(&mut self.lapsed)
    }

    /// Ends the sessions of programs that own motors and do not seem to live.
    pub(super) fn end_lapsed(&mut self) {
        let ids: Vec<SessionId> = self.sessions.keys().copied().collect();
        for id in ids {
            let Some(why) = self.why_lapsed(id) else { continue };
            self.leave_because(id, Some(&why));
            self.lapsed.push((id, why));
        }
    }

    fn why_lapsed(&self, id: SessionId) -> Option<String> {
        let session = self.sessions.get(&id)?;
        // A program that leaves its motors turning may leave.
        if session.ending == Ending::Nothing {
            return None;
        }
        if let Some(silent) = session.life.silent(self.now)
            && self.lines.values().any(|held| !held.turning_for(id).is_empty())
        {
            return Some(event_text::silent(silent));
        }
        session.life.late(self.now).find_map(|((line, motor), age)| {
            let held =
                self.lines.get(&line).filter(|held| held.turning_for(id).contains(&motor))?;
            Some(event_text::late(&held.name, motor.number(), age))
        })
    }
}
