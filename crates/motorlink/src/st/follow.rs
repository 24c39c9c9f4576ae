//! Follows what somebody else's master says to a drive: which motors it may have set in motion.

use motorlink_proto::st::{
    Command, Effect, ErrorCode, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, Parse,
    Profile, Request, Started,
};

/// Reads along on a line, from the host's bytes and the drive's.
///
/// It errs to one side. A request that starts or changes a motion counts wherever in the stream its
/// bytes stand: a drive that is out of step, or that completes a frame which was cut off, may take them
/// for one. A STOP counts only
/// when it was one whole request and was acknowledged, on a line that has been in sync all the time.
/// So it is with PFC_ENABLE and PFC_DISABLE.
#[derive(Debug, Default)]
pub(crate) struct Follower {
    pub(crate) started: Started,
    /// The PFC may be enabled; the motor number that this was said with.
    pub(crate) pfc: Option<u8>,
    /// Sent since the last whole reply.
    request: Vec<u8>,
    /// What came for it.
    reply: Vec<u8>,
    /// The reply is whole.
    is_answered: bool,
    /// Something did not look like requests and replies in turn.
    out_of_sync: bool,
    /// The last bytes that were sent, as many as the longest frame has.
    recent: Vec<u8>,
}

impl Follower {
    /// On a line where these motors were started before, and the PFC was enabled with this number.
    pub(crate) fn with(started: Started, pfc: Option<u8>) -> Self {
        Follower { started, pfc, ..Follower::default() }
    }

    /// The bytes whose reply may still come, or that a drive may take for half a frame; `None` when
    /// the line is at rest.
    pub(crate) fn unanswered(&self) -> Option<&[u8]> {
        let is_at_rest = !self.out_of_sync && (self.is_answered || self.request.is_empty());
        (!is_at_rest).then_some(self.request.as_slice())
    }

    /// The host sends `bytes`.
    pub(crate) fn sent(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if self.is_answered {
                self.request.clear();
                self.reply.clear();
                self.is_answered = false;
            }
            if !self.reply.is_empty() || self.request.len() == MAX_FRAME {
                self.lose();
            }
            if self.request.len() < MAX_FRAME {
                self.request.push(byte);
            }
            if self.recent.len() == MAX_FRAME {
                self.recent.remove(0);
            }
            self.recent.push(byte);
            self.look_for_motion();
        }
    }

    /// The drive sends `bytes`.
    pub(crate) fn heard(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if self.is_answered || self.request.is_empty() {
                self.lose();
                continue;
            }
            self.reply.push(byte);
            match Frame::parse(&self.reply) {
                Parse::More => {}
                Parse::Frame(Frame { header: HEADER_ATR, .. }, _) => {
                    self.reply.clear();
                    // The drive has just been reset.
                    self.started.forget_current();
                }
                Parse::Frame(Frame { header, payload }, _) => {
                    let (header, code) = (header, payload.first().copied().map(ErrorCode::from));
                    self.conclude(header, code);
                }
                Parse::Bad(_) => {
                    self.is_answered = true;
                    self.lose();
                }
            }
        }
    }

    fn conclude(&mut self, header: u8, code: Option<ErrorCode>) {
        use ErrorCode::{BadCrc, Overrun, Timeout};
        self.is_answered = true;
        let frame = match Frame::parse(&self.request) {
            Parse::Frame(frame, size) if size == self.request.len() => frame,
            _ => return self.lose(),
        };
        let effect = Effect::of_frame(&frame);
        let addressed = self.started.request_sent(frame.motor(), effect);
        match (header, code) {
            (HEADER_ACK, _) if !self.out_of_sync => {
                if command(&frame) == Some(Command::PfcDisable) {
                    self.pfc = None;
                }
                self.started.acknowledged(addressed, effect);
            }
            (HEADER_ACK, _) => {}
            // The drive may take the rest of a damaged frame for another.
            (HEADER_NACK, Some(BadCrc | Timeout | Overrun)) => self.lose(),
            (HEADER_NACK, _) => {}
            _ => self.lose(),
        }
    }

    /// Declares that replies without a waiting request may come.
    pub(crate) fn lose(&mut self) {
        self.out_of_sync = true;
        self.started.forget_current();
    }

    /// Whether the bytes up to the last one end in a request that starts or changes a motion.
    fn look_for_motion(&mut self) {
        for begin in 0..self.recent.len() {
            let (frame, size) = match Frame::parse(&self.recent[begin..]) {
                Parse::Frame(frame, size) if begin + size == self.recent.len() => (frame, size),
                _ => continue,
            };
            if Effect::of_frame(&frame).motion().is_owned() {
                // What is unanswered before it may change the current motor.
                if self.out_of_sync || self.request.len() != size {
                    self.started.forget_current();
                }
                self.started.presume(frame.motor());
            }
            if command(&frame) == Some(Command::PfcEnable) {
                self.pfc = Some(frame.motor());
            }
        }
    }
}

/// Commands are the same in every profile.
fn command(frame: &Frame<'_>) -> Option<Command> {
    match frame.request(Profile::Spec) {
        Ok(Request::ExecuteCommand(command)) => Some(command),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use motorlink_proto::st::RegisterId;

    use super::*;

    const ACK: [u8; 3] = [0xF0, 0x00, 0xF0];

    fn frame(motor: u8, request: &Request<'_>) -> Vec<u8> {
        let mut bytes = [0; MAX_FRAME];
        Frame::command(motor, request, &mut bytes).unwrap().to_vec()
    }

    fn command(motor: u8, command: Command) -> Vec<u8> {
        frame(motor, &Request::ExecuteCommand(command))
    }

    fn motors(follower: &Follower) -> Vec<u8> {
        follower.started.motors().map(|motor| motor.number()).collect()
    }

    #[test]
    fn a_start_counts_at_once_and_a_stop_when_it_is_acknowledged() {
        for start in [Command::StartMotor, Command::StartStop, Command::ScStart] {
            let mut follower = Follower::default();
            follower.sent(&command(2, start));
            assert_eq!(motors(&follower), [2]);
            assert!(follower.unanswered().is_some());
            follower.heard(&ACK);
            assert_eq!(follower.unanswered(), None);
            follower.sent(&command(2, Command::StopMotor));
            assert_eq!(motors(&follower), [2]);
            follower.heard(&ACK);
            assert!(follower.started.is_empty());
        }
    }

    #[test]
    fn the_pfc_is_enabled_until_its_end_is_acknowledged() {
        let mut follower = Follower::default();
        follower.sent(&command(1, Command::PfcEnable));
        assert_eq!(follower.pfc, Some(1));
        assert!(follower.started.is_empty());
        follower.heard(&ACK);
        follower.sent(&command(1, Command::PfcDisable));
        assert_eq!(follower.pfc, Some(1));
        follower.heard(&ACK);
        assert_eq!(follower.pfc, None);
        // Wherever it stands, as a START.
        follower.sent(&[&[0xFF; 9][..], &command(2, Command::PfcEnable)].concat());
        assert_eq!(follower.pfc, Some(2));
    }

    #[test]
    fn a_refused_stop_stops_nothing() {
        let mut follower = Follower::default();
        follower.sent(&command(1, Command::StartMotor));
        follower.heard(&ACK);
        follower.sent(&command(1, Command::StopMotor));
        follower.heard(&[0xFF, 0x01, 0x0B, 0x0C]);
        assert_eq!(motors(&follower), [1]);
    }

    /// A drive whose supply failed for a moment has another current motor, and says nothing of it.
    #[test]
    fn motor_number_0_is_every_motor_until_it_is_stopped_as_number_0() {
        let select = |motor| frame(motor, &Request::GetRegister(RegisterId::STATUS));
        let (start, stop) = (command(0, Command::StartMotor), command(0, Command::StopMotor));
        let after = |requests: &[&Vec<u8>]| -> Vec<u8> {
            let mut follower = Follower::default();
            for request in requests {
                follower.sent(request);
                let is_read = request[0] & 0x1F == 0x02;
                follower.heard(if is_read { &[0xF0, 0x01, 0x00, 0xF1] } else { &ACK });
            }
            motors(&follower)
        };
        let all = [1, 2, 3, 4, 5, 6, 7];
        assert_eq!(after(&[&start]), all);
        assert_eq!(after(&[&select(3), &start]), all);
        assert_eq!(after(&[&select(3), &start, &stop]), [0; 0]);
        let first = command(1, Command::StartMotor);
        assert_eq!(after(&[&first, &select(3), &start, &start, &stop]), [1]);
        // Number 0 is another motor then.
        assert_eq!(after(&[&select(3), &start, &select(2), &stop]), [1, 3, 4, 5, 6, 7]);
        let target = Request::SetRegister { register: RegisterId::TARGET_MOTOR, value: &[0] };
        assert_eq!(after(&[&select(3), &start, &frame(0, &target), &stop]), all);
        assert_eq!(after(&[&start, &stop]), [0; 0], "whichever it is");
    }

    #[test]
    fn a_start_counts_wherever_it_stands() {
        let start = command(4, Command::StartMotor);
        for before in 0..=MAX_FRAME {
            let mut follower = Follower::default();
            follower.sent(&vec![0xFF; before]);
            start.iter().for_each(|&byte| follower.sent(&[byte]));
            assert_eq!(motors(&follower), [4], "{before} bytes before");
        }
        // The payload may be longer than the command (SPEC-NOTES S35).
        let mut follower = Follower::default();
        let mut long = [0; MAX_FRAME];
        let payload = &[&[0x01][..], &[0x55; 127]].concat()[..];
        let long = Frame { header: Frame::header(3, 5), payload }.encode(&mut long).unwrap();
        follower.sent(long);
        assert_eq!(motors(&follower), [5]);
    }

    #[test]
    fn on_a_line_that_was_out_of_sync_no_stop_counts() {
        let disturbances: [(&[u8], &[u8]); 5] = [
            // A reply without a request, bytes that are no reply, a reply that is cut off, bytes that
            // are no request, and two requests at once.
            (&[], &ACK),
            (&[0x06, 0x00, 0x06], &[0xF0, 0x00, 0x00]),
            (&[0x06, 0x00, 0x06], &[0xF0]),
            (&[0x06, 0x00, 0x07], &[0xFF, 0x01, 0x0A, 0x0B]),
            (&[0x06, 0x00, 0x06, 0x06, 0x00, 0x06], &ACK),
        ];
        for (sent, heard) in disturbances {
            let mut follower = Follower::default();
            follower.sent(&command(1, Command::StartMotor));
            follower.heard(&ACK);
            follower.sent(sent);
            follower.heard(heard);
            follower.sent(&command(1, Command::StopMotor));
            follower.heard(&ACK);
            assert_eq!(motors(&follower), [1], "{sent:02x?} {heard:02x?}");
            assert!(follower.unanswered().is_some());
        }
    }

    #[test]
    fn a_request_that_is_not_answered_yet_may_change_the_current_motor() {
        let before: [Vec<u8>; 3] = [
            frame(1, &Request::GetRegister(RegisterId::STATUS)),
            frame(1, &Request::GetRegister(RegisterId(0xFF))),
            frame(0, &Request::SetRegister { register: RegisterId::TARGET_MOTOR, value: &[0] }),
        ];
        for before in before {
            let mut follower = Follower::default();
            follower.sent(&frame(2, &Request::GetRegister(RegisterId::STATUS)));
            follower.heard(&[0xF0, 0x01, 0x00, 0xF1]);
            follower.sent(&[before.clone(), command(0, Command::StartMotor)].concat());
            assert_eq!(motors(&follower).len(), 7, "{before:02x?}");
        }
    }

    #[test]
    fn a_drive_that_was_reset_has_another_current_motor() {
        let mut follower = Follower::default();
        follower.sent(&frame(2, &Request::GetRegister(RegisterId::STATUS)));
        follower.heard(&[0xF0, 0x01, 0x00, 0xF1]);
        follower.sent(&command(0, Command::StartMotor));
        follower.heard(&ACK);
        follower.sent(&command(0, Command::StopMotor));
        follower.heard(&[HEADER_ATR, 0x00, HEADER_ATR]);
        follower.heard(&ACK);
        assert_eq!(motors(&follower).len(), 7);
    }

    #[test]
    fn half_a_request_is_not_at_rest() {
        let mut follower = Follower::default();
        assert_eq!(follower.unanswered(), None);
        follower.sent(&[0x23, 0x01]);
        assert_eq!(follower.unanswered(), Some(&[0x23, 0x01][..]));
    }
}
