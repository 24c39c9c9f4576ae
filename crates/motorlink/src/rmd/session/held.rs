//! A frame with four torques that waits for motors which are not ready.

use super::*;

impl Session {
    pub(super) fn is_held(&self, id: MotorId) -> bool {
        self.held.is_some_and(|held| held.expect.contains(id))
    }

    /// A motor that torques are held for answered the questions, or failed to: then they are sent for the
    /// others.
    pub(super) fn held_answered(
        &mut self,
        id: MotorId,
        result: Result<[u8; 8], proto::Failure>,
    ) -> Option<SessionOutput> {
        let held = self.held.as_mut()?;
        match result {
            Ok(_) | Err(proto::Failure::Quarantined) => {
                held.answered.insert(id);
                None
            }
            Err(error) => {
                held.expect.remove(id);
                // To a motor of another protocol the frame may mean anything.
                if held.expect.is_empty() || matches!(error, proto::Failure::Foreign(_)) {
                    self.drop_held(None);
                }
                Some(SessionOutput::Done(id, Err(self.failed(id, error))))
            }
        }
    }

    /// Sends the torques that are held, if their motors can be trusted; when to try again.
    pub(super) fn send_held(&mut self, now: Instant) -> Option<Instant> {
        let Held { torques, expect, until, .. } =
            self.held.filter(|held| held.answered == held.expect)?;
        match self.host.set_torque4(now, torques, expect) {
            Err(RequestError::Quarantined { until: free, .. }) if now < until => return Some(free),
            Ok(()) => self.held = None,
            Err(why) => self.drop_held(Some(why)),
        }
        None
    }

    /// Gives the torques that are held up. Motors whose questions are under way end in quarantine.
    pub(super) fn drop_held(&mut self, why: Option<RequestError>) {
        if let Some(held) = self.held.take() {
            (self.unsent, self.unsent_for) = (held.answered, why);
        }
    }
}
