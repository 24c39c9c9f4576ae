//! The questions by which a line comes in step, and what comes instead of their answers.

use super::{
    Bad, Command, ErrorCode, Failure, Frame, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_PAYLOAD,
    RegisterId, Request, RevupPhase, frame,
};

/// The reply has 32 bytes, as that of GET_BOARD_INFO.
pub(super) const INFO: u8 = 1;
/// The reply has 8 bytes, as that of GET_REVUP_DATA.
pub(super) const REVUP: u8 = 2;
/// The reply has 1 byte, as that of GET_REG STATUS.
pub(super) const STATUS: u8 = 4;
/// The reply has 4 bytes, as that of GET_REG FLAGS.
pub(super) const FLAGS: u8 = 8;

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
            INFO => Request::BoardInfo,
            REVUP => Request::RevupData(0),
            STATUS => Request::GetRegister(RegisterId::STATUS),
            _ => Request::GetRegister(RegisterId::FLAGS),
        };
        let bytes = Frame::command(0, &request, &mut self.frame).unwrap_or(&[]);
        self.size = bytes.len() as u8;
        bytes
    }

    /// A STOP_MOTOR, which goes before a question.
    pub(super) fn stop(&mut self, motor: u8) -> &[u8] {
        let stop = Request::Execute(Command::StopMotor);
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
        self.is_alone && answers == 1 && refusals == 0 && others == 0 && self.scan.taken == 0
    }

    /// Whether what came is what was sent.
    pub(super) const fn is_echo(&self) -> bool {
        self.echoed == self.size
    }

    /// The reason if there is no answer.
    pub(super) fn failure(&self) -> Failure {
        match self.scan.taken {
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

/// Finds frames in a stream without keeping them.
#[derive(Debug, Clone, Copy)]
struct Scan {
    header: u8,
    length: u8,
    /// Bytes of the frame so far.
    taken: u8,
    sum: u16,
    /// The byte before the checksum.
    last: u8,
}

/// What a byte is to a [`Scan`].
enum Scanned {
    /// A part of a frame.
    More,
    /// The end of a frame: its header, its length, the last byte of its payload.
    Frame(u8, u8, u8),
    /// A part of none.
    Stray(Failure),
}

impl Scan {
    const NONE: Scan = Scan { header: 0, length: 0, taken: 0, sum: 0, last: 0 };

    fn take(&mut self, byte: u8) -> Scanned {
        let begins = matches!(byte, HEADER_ACK | HEADER_NACK | HEADER_ATR);
        match self.taken {
            0 if !begins => return Scanned::Stray(Failure::Header(byte)),
            0 => self.header = byte,
            1 if usize::from(byte) > MAX_PAYLOAD => {
                *self = Scan::NONE;
                return Scanned::Stray(Failure::Damaged(Bad::Length(byte)));
            }
            1 => self.length = byte,
            taken if taken == self.length.saturating_add(2) => {
                let Scan { header, length, sum, last, .. } = core::mem::replace(self, Scan::NONE);
                return match frame::fold(sum) {
                    expected if byte == expected => Scanned::Frame(header, length, last),
                    expected => {
                        Scanned::Stray(Failure::Damaged(Bad::Checksum { expected, received: byte }))
                    }
                };
            }
            _ => self.last = byte,
        }
        self.taken = self.taken.saturating_add(1);
        self.sum = self.sum.wrapping_add(u16::from(byte));
        Scanned::More
    }
}
