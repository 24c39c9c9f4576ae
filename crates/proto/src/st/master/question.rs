//! Sent frames of a recovery: padding and questions. Also the bytes received instead of their
//! answers.

use super::scan::{Scan, Scanned};
use crate::st::{
    Command, ErrorCode, Failure, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, RegisterId,
    Request, RevupPhase,
};

/// A question with a reply of 32 bytes, like GET_BOARD_INFO.
pub(super) const INFO: u8 = 1;
/// A question with a reply of 8 bytes, like GET_REVUP_DATA.
pub(super) const REVUP: u8 = 2;
/// A question with a reply of 1 byte, like GET_REG STATUS.
pub(super) const STATUS: u8 = 4;
/// A question with a reply of 4 bytes, like GET_REG FLAGS.
pub(super) const FLAGS: u8 = 8;

/// A question to send after an acknowledge of `size` bytes or a refusal, and the size of its
/// answer. The two sizes differ, so the answer shows whether replies match requests. `turn`
/// alternates from question to question; consecutive answers also have different sizes.
pub const fn question_behind(size: Option<usize>, turn: bool) -> (Request<'static>, usize) {
    let size = match size {
        Some(size) if size <= u8::MAX as usize => Some(size as u8),
        _ => None,
    };
    let answer = size_behind(size, turn);
    (question_with_answer(answer), answer as usize)
}

/// The answer size of [`question_behind`].
pub const fn size_behind(size: Option<u8>, turn: bool) -> u8 {
    match (size, turn) {
        (Some(1 | 4), true) => 32,
        (Some(1), false) | (_, true) => 4,
        _ => 1,
    }
}

/// The question of [`question_behind`] with an answer of this size.
pub const fn question_with_answer(size: u8) -> Request<'static> {
    match size {
        1 => Request::GetRegister(RegisterId::STATUS),
        4 => Request::GetRegister(RegisterId::FLAGS),
        _ => Request::GetBoardInfo,
    }
}

/// Bytes that complete any frame. 5.x firmware drops 0xFF 0xFF as header and length. After them it
/// is in sync, or has read one 0xFF as header. In the first case it drops 0x00 0xFF. In the second
/// case it reads them as a frame for motor 7, which has no meaning.
pub(super) static PADDING: [u8; MAX_FRAME + 1] = {
    let mut bytes = [0xFF; MAX_FRAME + 1];
    bytes[MAX_FRAME - 1] = 0x00;
    bytes
};

/// A question, and the bytes received since it was sent.
#[derive(Debug, Clone)]
pub(super) struct Question {
    kind: u8,
    frame: [u8; 4],
    size: u8,
    /// Number of received bytes that equal the sent frame.
    echoed: u8,
    scan: Scan,
    /// Whether exactly one frame was received, the answer, and nothing else.
    is_alone: bool,
    received: Replies,
    /// The failure of the first bytes outside a frame, or of the first frame that the drive did not
    /// receive whole.
    trouble: Option<Failure>,
}

/// Replies received since a question was sent.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Replies {
    /// Replies that look like its answer.
    pub(super) answers: u8,
    pub(super) refusals: u8,
    /// Positive replies to something else.
    pub(super) others: u8,
}

impl Question {
    /// The state before the first question.
    pub(super) const NONE: Question = Question {
        kind: INFO,
        frame: [0; 4],
        size: 0,
        echoed: 0,
        scan: Scan::NONE,
        is_alone: true,
        received: Replies { answers: 0, refusals: 0, others: 0 },
        trouble: None,
    };

    /// Starts a question. Returns the frame to send.
    pub(super) fn ask(&mut self, kind: u8) -> &[u8] {
        *self = Question { kind, ..Question::NONE };
        let request = match kind {
            INFO => Request::GetBoardInfo,
            REVUP => Request::GetRevupData(0),
            STATUS => Request::GetRegister(RegisterId::STATUS),
            _ => Request::GetRegister(RegisterId::FLAGS),
        };
        let bytes = Frame::command(0, &request, &mut self.frame).unwrap_or(&[]);
        self.size = bytes.len() as u8;
        bytes
    }

    /// A STOP_MOTOR to send before a question.
    pub(super) fn stop(&mut self, motor: u8) -> &[u8] {
        let stop = Request::ExecuteCommand(Command::StopMotor);
        Frame::command(motor, &stop, &mut self.frame).unwrap_or(&[])
    }

    pub(super) const fn kind(&self) -> u8 {
        self.kind
    }

    /// Takes received bytes. Returns the replies so far.
    pub(super) fn receive(&mut self, bytes: &[u8]) -> Replies {
        for &byte in bytes {
            let scanned = self.scan.take(byte);
            // Bytes of a reply are not an echo, even if they equal the sent bytes.
            if let (Scanned::Stray(_), false) = (&scanned, self.is_echo()) {
                let is_next = |at: u8| self.frame.get(usize::from(at)) == Some(&byte);
                self.echoed =
                    if is_next(self.echoed) { self.echoed + 1 } else { is_next(0).into() };
            }
            match scanned {
                Scanned::More | Scanned::Frame(HEADER_ATR, ..) => {}
                Scanned::Frame(HEADER_NACK, 1, code) => match ErrorCode::from(code) {
                    code if code.is_damage() => self.fails(Failure::NotUnderstood(code)),
                    _ => count(&mut self.received.refusals),
                },
                Scanned::Frame(HEADER_ACK, length, _) if length == self.answer_size() => {
                    count(&mut self.received.answers);
                }
                Scanned::Frame(HEADER_ACK, ..) => count(&mut self.received.others),
                Scanned::Frame(..) => self.is_alone = false,
                Scanned::Stray(failure) => self.fails(failure),
            }
        }
        self.received
    }

    fn fails(&mut self, failure: Failure) {
        self.is_alone = false;
        self.trouble = self.trouble.or(Some(failure));
    }

    /// Whether the answer was received, and nothing else.
    pub(super) const fn is_alone(&self) -> bool {
        let Replies { answers, refusals, others } = self.received;
        self.is_alone && answers == 1 && refusals == 0 && others == 0 && self.scan.taken() == 0
    }

    /// Whether the received bytes equal the sent bytes.
    pub(super) const fn is_echo(&self) -> bool {
        self.echoed == self.size
    }

    /// The failure without an answer.
    pub(super) fn failure(&self) -> Failure {
        match self.scan.taken() {
            0 => self.trouble.unwrap_or(Failure::Timeout),
            received => Failure::Incomplete { received },
        }
    }

    const fn answer_size(&self) -> u8 {
        match self.kind {
            INFO => 32,
            REVUP => RevupPhase::SIZE as u8,
            STATUS => 1,
            _ => 4,
        }
    }
}

fn count(replies: &mut u8) {
    *replies = replies.saturating_add(1);
}
