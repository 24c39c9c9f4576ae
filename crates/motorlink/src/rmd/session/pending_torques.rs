//! A frame with four torques that waits for motors which are not ready.

use super::*;

impl Session {
    pub(super) fn awaits_torques(&self, id: MotorId) -> bool {
        self.torques.is_some_and(|torques| torques.expect.contains(id))
    }

    /// A motor that torques are held for answered the questions, or failed to: then they are sent for the
    /// others.
    pub(super) fn torques_answered(
        &mut self,
        id: MotorId,
        result: Result<[u8; 8], proto::Failure>,
    ) -> Option<SessionOutput> {
        let torques = self.torques.as_mut()?;
        match result {
            Ok(_) | Err(proto::Failure::Quarantined) => {
                torques.answered.insert(id);
                None
            }
            Err(error) => {
                torques.expect.remove(id);
                // To a motor of another protocol the frame may mean anything.
                if torques.expect.is_empty() || matches!(error, proto::Failure::Foreign(_)) {
                    self.drop_torques(None);
                }
                Some(SessionOutput::Done(id, Err(self.failed(id, error))))
            }
        }
    }

    /// Sends the torques that are held, if their motors can be trusted; when to try again.
    pub(super) fn send_torques(&mut self, now: Instant) -> Option<Instant> {
        let PendingTorques { torques, expect, until, .. } =
            self.torques.filter(|it| it.answered == it.expect)?;
        match self.host.set_torque4(now, torques, expect) {
            Err(RequestError::Quarantined { until: free, .. }) if now < until => return Some(free),
            Ok(()) => self.torques = None,
            Err(why) => self.drop_torques(Some(why)),
        }
        None
    }

    /// Gives the torques that are held up. Motors whose questions are under way end in quarantine.
    pub(super) fn drop_torques(&mut self, why: Option<RequestError>) {
        if let Some(torques) = self.torques.take() {
            (self.unsent, self.unsent_for) = (torques.answered, why);
        }
    }
}
