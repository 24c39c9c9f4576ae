//! The ends of exchanges, and of the port.

use std::sync::Arc;
use std::time::Duration;

use super::{Acquisition, Ended, Finished};
use crate::event::{CommandError, What};
use crate::line::{LineError, Over, Shows};
use crate::schedule::{CommandId, Lane, Outcome, Verdict};

impl Acquisition {
    /// The exchange of a lane is over: the lane is free for another one.
    pub(super) fn finish(&mut self, over: Over) -> Finished {
        let at = self.clock.now();
        self.tally.ended(&over.result);
        let outcome = match &over.result {
            Ok(_) => Outcome::Answered,
            // The motor answered, and the lane is in sync again.
            Err(error) if error.is_unconfirmed() => Outcome::Answered,
            Err(error) if self.line.is_given_up(error) => Outcome::GivenUp,
            Err(error) if !error.is_answer() => Outcome::Failed,
            Err(_) => Outcome::Refused,
        };
        if matches!(outcome, Outcome::Failed | Outcome::GivenUp) {
            for motor in self.motors(over.lane) {
                self.answering.remove(&motor);
            }
        }
        let verdict = self.schedule.ended(at, over.lane, outcome);
        Finished { over, at, verdict }
    }

    /// Tells those who wait for an exchange how it ended.
    pub(super) fn pass_on(&mut self, finished: Finished, ended: &mut Ended<'_>) {
        let Finished { over: Over { lane, result, sent, shows }, at, verdict } = finished;
        match (shows, &verdict) {
            (Shows::Match, _) => {
                self.confirmed.insert(lane, sent);
                self.tell_each(lane, |motor| What::Confirmed(motor, sent));
            }
            // The reason of a failed poll comes first.
            (Shows::Nothing, _) | (Shows::Doubt, Some(Verdict::Poll(_))) => {}
            (Shows::Doubt, _) => self.doubt(lane),
        }
        match verdict {
            Some(Verdict::Poll(id)) => {
                self.polled(lane, id, (sent, at), result);
                if shows == Shows::Doubt {
                    self.doubt(lane);
                }
            }
            Some(Verdict::Command(id)) => ended(id, result.map_err(CommandError::Line)),
            Some(Verdict::Stopped(ids)) => {
                let result = result.map_err(CommandError::Line);
                for id in ids {
                    if let Some((by, request)) = self.untold_stops.remove(&id) {
                        self.tell(What::Stopping(id, by, request));
                    }
                    self.tell(What::Stopped(id));
                    ended(id, result.clone());
                }
            }
            Some(Verdict::StopFailed(ids)) => {
                let result = result.map_err(CommandError::Line);
                for id in ids {
                    if let Err(error) = &result {
                        self.stop_failed(id, error);
                    }
                    ended(id, result.clone());
                }
            }
            Some(Verdict::StopAgain | Verdict::Recovered) | None => {}
        }
    }

    /// The values of a lane since its last confirmation may be those of other signals.
    fn doubt(&mut self, lane: Lane) {
        let since = self.confirmed.get(&lane).copied().unwrap_or_default();
        self.tell_each(lane, |motor| What::Doubtful(motor, since));
        self.distrust(lane);
    }

    pub(super) fn stop_failed(&mut self, id: CommandId, why: &CommandError) {
        if self.untold_stops.remove(&id).is_none() {
            self.tell(What::StopFailed(id, Arc::new(why.clone())));
        }
    }

    /// The port is closed. Gives no time: its back-off is in [`retry_in`](Self::retry_in).
    pub(super) fn closed(&mut self, why: LineError, ended: &mut Ended<'_>) -> Option<Duration> {
        let now = self.clock.now();
        self.is_open = false;
        self.answering.clear();
        self.tally.lost();
        for (_, verdict) in self.schedule.closed(now) {
            match verdict {
                Verdict::Command(id) => ended(id, Err(CommandError::Closed)),
                Verdict::StopFailed(ids) => {
                    for id in ids {
                        self.stop_failed(id, &CommandError::Closed);
                        ended(id, Err(CommandError::Closed));
                    }
                }
                Verdict::Poll(_)
                | Verdict::Stopped(_)
                | Verdict::StopAgain
                | Verdict::Recovered => {}
            }
        }
        self.tell(What::Lost(Arc::new(why)));
        None
    }
}
