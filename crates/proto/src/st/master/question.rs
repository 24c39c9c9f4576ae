//! What recovery sends: padding, questions by which a line comes in step, and what comes instead of
//! their answers.

use super::scan::{Scan, Scanned};
use crate::st::{
    Command, ErrorCode, Failure, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, RegisterId,
    Request, RevupPhase,
};

/// The reply has 32 bytes, as that of GET_BOARD_INFO.
pub(super) const INFO: u8 = 1;
/// The reply has 8 bytes, as that of GET_REVUP_DATA.
pub(super) const REVUP: u8 = 2;
/// The reply has 1 byte, as that of GET_REG STATUS.
pub(super) const STATUS: u8 = 4;
/// The reply has 4 bytes, as that of GET_REG FLAGS.
pub(super) const FLAGS: u8 = 8;

/// A question behind an acknowledge of `size` bytes, or a refusal, and the size of its answer. It has
/// another size, so that the answer shows whether replies and requests go together. `turn` changes with
/// each question: the answer to the one before has another size, too.
pub const fn question_behind(size: Option<usize>, turn: bool) -> (Request<'static>, usize) {
    match (size, turn) {
        (Some(1 | 4), true) => (Request::GetBoardInfo, 32),
        (Some(1), false) | (_, true) => (Request::GetRegister(RegisterId::FLAGS), 4),
        _ => (Request::GetRegister(RegisterId::STATUS), 1),
    }
}

/// Completes any frame. 5.x firmware drops 0xFF 0xFF as header and length, so it is left in step or
/// with one 0xFF as header: 0x00 0xFF is dropped by the one and a frame of motor 7, which has no
/// meaning, to the other.
pub(super) static PADDING: [u8; MAX_FRAME + 1] = {
    let mut bytes = [0xFF; MAX_FRAME + 1];
    bytes[MAX_FRAME - 1] = 0x00;
    bytes
};

/// A question, and what came since it was asked.
#[derive(Debug, Clone)]
pub(super) struct Question {
    kind: u8,
    frame: [u8; 4],
    size: u8,
    /// How many bytes of the frame came back.
    echoed: u8,
    scan: Scan,
    /// Whether one frame came, which answers it, and nothing else.
    is_alone: bool,
    came: Came,
    /// The first bytes that are no frame.
    trouble: Option<Failure>,
}

/// Replies that came since a question was asked.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Came {
    /// Those that look like its answer.
    pub(super) answers: u8,
    pub(super) refusals: u8,
    /// Positive ones that answer something else.
    pub(super) others: u8,
}

impl Question {
    /// Before the first one.
    pub(super) const NONE: Question = Question {
        kind: INFO,
        frame: [0; 4],
        size: 0,
        echoed: 0,
        scan: Scan::NONE,
        is_alone: true,
        came: Came { answers: 0, refusals: 0, others: 0 },
        trouble: None,
    };

    /// Asks; gives the frame.
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

    /// A STOP_MOTOR, which goes before a question.
    pub(super) fn stop(&mut self, motor: u8) -> &[u8] {
        let stop = Request::ExecuteCommand(Command::StopMotor);
        Frame::command(motor, &stop, &mut self.frame).unwrap_or(&[])
    }

    pub(super) const fn kind(&self) -> u8 {
        self.kind
    }

    /// Takes what came; gives the replies so far.
    pub(super) fn hear(&mut self, bytes: &[u8]) -> Came {
        for &byte in bytes {
            let scanned = self.scan.take(byte);
            // What belongs to a reply is no echo, whatever it looks like.
            if let (Scanned::Stray(_), false) = (&scanned, self.is_echo()) {
                let is_next = |at: u8| self.frame.get(usize::from(at)) == Some(&byte);
                self.echoed =
                    if is_next(self.echoed) { self.echoed + 1 } else { is_next(0).into() };
            }
            match scanned {
                Scanned::More | Scanned::Frame(HEADER_ATR, ..) => {}
                Scanned::Frame(HEADER_NACK, 1, code) if !ErrorCode::from(code).is_damage() => {
                    count(&mut self.came.refusals);
                }
                Scanned::Frame(HEADER_ACK, length, _) if length == self.answer_size() => {
                    count(&mut self.came.answers);
                }
                Scanned::Frame(HEADER_ACK, ..) => count(&mut self.came.others),
                Scanned::Frame(..) => self.is_alone = false,
                Scanned::Stray(failure) => {
                    self.is_alone = false;
                    self.trouble = self.trouble.or(Some(failure));
                }
            }
        }
        self.came
    }

    /// Whether the answer came, and nothing else.
    pub(super) const fn is_alone(&self) -> bool {
        let Came { answers, refusals, others } = self.came;
        self.is_alone && answers == 1 && refusals == 0 && others == 0 && self.scan.taken() == 0
    }

    /// Whether what came is what was sent.
    pub(super) const fn is_echo(&self) -> bool {
        self.echoed == self.size
    }

    /// The reason if there is no answer.
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
