//! Text files of Vector's CANalyzer and CANoe (`.asc`), as python-can and others write them, too.
//!
//! Times count from the start of the measurement: the date in the head of the file has no time zone.

mod writer;

pub use writer::Writer;

use crate::captured::{Damage, Direction, FdFrame, Stamp, Wire};
use crate::line::Entry;
use crate::text::{self, decimal, digit, hex, nanoseconds, word};
use motorlink_proto::can::CanFrame;

/// The bit of a CAN FD frame in the flags of a `CANFD` line.
pub(super) const FD: u32 = 0x1000;
const NOT_A_LINE: &str = "not a line of an asc file";

/// Words with which the lines of an asc file begin that have no time.
const HEADS: [&[u8]; 9] =
    [b"date", b"base", b"internal", b"no", b"Begin", b"End", b"//", b"begin", b"end"];
/// Events that have no frame: what stands behind the time.
const EVENTS: [&[u8]; 10] =
    [b"Start", b"Stop", b"CAN", b"SV:", b"J1939TP", b"//", b"log", b"Begin", b"End", b"TFS:"];

/// What the head of a file says, and the time of the last line.
#[derive(Debug, Default)]
pub(crate) struct Asc {
    is_decimal: bool,
    is_relative: bool,
    now: i64,
}

/// Whether a file with this first line is an asc file.
pub(crate) fn is_head(line: &[u8]) -> bool {
    let mut rest = line;
    let first = word(&mut rest);
    first.is_some_and(|first| matches!(first, b"date" | b"base" | b"//" | b"Begin" | b"internal"))
}

impl Asc {
    pub(crate) fn parse<'a>(&mut self, line: &'a [u8]) -> Result<Option<Entry<'a>>, &'static str> {
        let mut rest = line;
        let Some(first) = word(&mut rest) else { return Ok(None) };
        if HEADS.contains(&first) || first.starts_with(b"//") {
            return self.head(first, rest).map(|()| None);
        }
        let time = nanoseconds(first).ok_or(NOT_A_LINE)?;
        self.now = if self.is_relative { self.now.saturating_add(time) } else { time };
        let time = Some(Stamp::Relative(self.now));
        let channel = word(&mut rest).ok_or(NOT_A_LINE)?;
        if channel == b"CANFD" {
            return self.fd(time, rest).map(Some);
        }
        if EVENTS.contains(&channel) {
            return Ok(None);
        }
        let id = word(&mut rest).ok_or(NOT_A_LINE)?;
        match id {
            b"ErrorFrame" => {
                let wire = Wire::Error { class: 0, data: [0; 8] };
                return Ok(Some(Entry { time, channel: Some(channel), direction: None, wire }));
            }
            b"Statistic:" => return Ok(None),
            b"OverrunError" | b"Overrun" | b"OVERRUN" => {
                let wire = Wire::Damage(Damage::Dropped(1));
                return Ok(Some(Entry { time, channel: Some(channel), direction: None, wire }));
            }
            _ => {}
        }
        let (id, extended) = self.id(id)?;
        let direction = direction(word(&mut rest).ok_or(NOT_A_LINE)?)?;
        let wire = match word(&mut rest).ok_or(NOT_A_LINE)? {
            b"r" => {
                let len = word(&mut rest).and_then(decimal).unwrap_or(0);
                if len > 8 {
                    return Err("a CAN frame has at most 8 bytes");
                }
                Wire::Can(CanFrame::remote_frame(id, extended, len as u8))
            }
            b"d" => {
                let len = word(&mut rest).and_then(length).ok_or(NOT_A_LINE)?;
                let mut data = [0; 8];
                let data = data.get_mut(..len).ok_or("a CAN frame has at most 8 bytes")?;
                self.data(&mut rest, data)?;
                // Behind the bytes there may be `Length = ..`.
                if word(&mut rest)
                    .is_some_and(|word| word.len() <= 3 && word[0].is_ascii_hexdigit())
                {
                    return Err("the line has more bytes than it says");
                }
                Wire::Can(CanFrame::data_frame(id, extended, data))
            }
            _ => return Err(NOT_A_LINE),
        };
        Ok(Some(Entry { time, channel: Some(channel), direction, wire }))
    }

    fn head(&mut self, first: &[u8], rest: &[u8]) -> Result<(), &'static str> {
        let mut rest = rest;
        if first == b"base" {
            self.is_decimal = match word(&mut rest) {
                Some(b"dec") => true,
                Some(b"hex") => false,
                _ => return Err("the base is neither hex nor dec"),
            };
            let kind = (word(&mut rest) == Some(b"timestamps")).then(|| word(&mut rest)).flatten();
            self.is_relative = kind == Some(b"relative");
        }
        Ok(())
    }

    /// `CANFD 1 Rx 141 [name] 1 0 d 12 00 11 .. `: channel, direction, identifier, perhaps a name,
    /// bit rate switch, error state, length code, number of bytes, bytes, and more. A file of a bus
    /// with CAN FD has all its frames in this form, also the classic ones.
    fn fd<'a>(&self, time: Option<Stamp>, rest: &'a [u8]) -> Result<Entry<'a>, &'static str> {
        const WRONG: &str = "not a CAN FD line of an asc file";
        let mut rest = rest;
        let channel = word(&mut rest).ok_or(WRONG)?;
        let direction = direction(word(&mut rest).ok_or(WRONG)?)?;
        let id = word(&mut rest).ok_or(WRONG)?;
        if id == b"ErrorFrame" {
            let wire = Wire::Error { class: 0, data: [0; 8] };
            return Ok(Entry { time, channel: Some(channel), direction, wire });
        }
        let (id, extended) = self.id(id)?;
        let mut flag = word(&mut rest).ok_or(WRONG)?;
        if !matches!(flag, b"0" | b"1") {
            flag = word(&mut rest).ok_or(WRONG)?;
        }
        let brs = u8::from(flag == b"1");
        let esi = u8::from(word(&mut rest).ok_or(WRONG)? == b"1");
        let code = word(&mut rest).ok_or(WRONG)?;
        let len = word(&mut rest).and_then(decimal).filter(|&len| len <= 64).ok_or(WRONG)?;
        let mut data = vec![0; len as usize];
        self.data(&mut rest, &mut data)?;
        // Duration, length in bits, flags.
        let is_fd = text::words(rest).nth(2).and_then(hex).is_none_or(|flags| flags & FD != 0);
        let wire = match (is_fd, data.len()) {
            (false, 0) if code != b"0" => {
                let len = length(code).filter(|&len| len <= 8).ok_or(WRONG)?;
                Wire::Can(CanFrame::remote_frame(id, extended, len as u8))
            }
            (false, 0..=8) => Wire::Can(CanFrame::data_frame(id, extended, &data)),
            _ => Wire::Fd(Box::new(FdFrame { id, extended, flags: brs | esi << 1, data })),
        };
        Ok(Entry { time, channel: Some(channel), direction, wire })
    }

    /// An identifier; one of 29 bits has an `x` behind it.
    fn id(&self, word: &[u8]) -> Result<(u32, bool), &'static str> {
        let (digits, extended) = match word {
            [digits @ .., b'x' | b'X'] => (digits, true),
            digits => (digits, false),
        };
        let id = if self.is_decimal { decimal(digits) } else { hex(digits) };
        let most = if extended { 0x1FFF_FFFF } else { 0x7FF };
        let id = id.filter(|&id| id <= most).ok_or("not an identifier of CAN")?;
        Ok((id, extended))
    }

    fn data(&self, rest: &mut &[u8], out: &mut [u8]) -> Result<(), &'static str> {
        for slot in out {
            let text = word(rest).ok_or("the line has fewer bytes than it says")?;
            let byte = if self.is_decimal { decimal(text) } else { hex(text) };
            *slot = byte
                .and_then(|byte| byte.try_into().ok())
                .ok_or("a byte is not a number of the base")?;
        }
        Ok(())
    }
}

fn direction(word: &[u8]) -> Result<Option<Direction>, &'static str> {
    match word {
        b"Rx" => Ok(Some(Direction::Received)),
        b"Tx" => Ok(Some(Direction::Sent)),
        // Asked for, and not yet on the wire: the frame has a line of its own when it is.
        b"TxRq" => Err("a frame that was to be sent, and may not have been on the wire"),
        _ => Err("the direction is not Rx or Tx"),
    }
}

/// The length code has one hexadecimal digit.
fn length(word: &[u8]) -> Option<usize> {
    let &[code] = word else { return None };
    digit(code).map(usize::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(text: &str) -> Vec<Result<Entry<'_>, &'static str>> {
        let mut asc = Asc::default();
        text.lines().filter_map(|line| asc.parse(line.as_bytes()).transpose()).collect()
    }

    const HEAD: &str = "date Sat Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\n\
        internal events logged\n// version 9.0.0\nBegin Triggerblock Sat Sep 30 15:06:13.191 2017\n\
        \x20  0.000000 Start of measurement\n";

    #[test]
    fn a_file_of_vector_is_read() {
        assert!(is_head(HEAD.lines().next().unwrap().as_bytes()));
        let text = format!(
            "{HEAD}   2.501000 1  141             Tx   d 8 9A 00 00 00 00 00 00 00  Length = 0\n\
             17.876707 CAN 1 Status:chip status error active\n\
             18.000000 2  18EBFF00x       Rx   d 2 01 A0\n\
             18.100000 1  ErrorFrame\n\
             18.200000 1  142             Rx   r 8\n\
             19.0 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n\
             20.0 CANFD   1 Rx        300                                  1 0 9 12 00 01 02 03 04 05 06 07 08 09 0a 0b\n\
             21.0 CANFD   1 Rx        141                                  0 0 8  8 9a 19 00 f0 00 00 00 09   130000  130        0 46500250 0 0 0 0\n\
             22.0 CANFD   1 Rx        141                                  0 0 8  0   130000  130       10 46500250 0 0 0 0\n\
             23.0 CANFD   1 Rx        141                                  0 0 8  8 9a 19 00 f0 00 00 00 09   130000  130     1000 46500250 0 0 0 0\n\
             End TriggerBlock\n"
        );
        let found: Vec<_> = entries(&text).into_iter().map(Result::unwrap).collect();
        assert_eq!(found.len(), 8);
        assert_eq!(found[0].time, Some(Stamp::Relative(2_501_000_000)));
        assert_eq!(
            (found[0].channel, found[0].direction),
            (Some(&b"1"[..]), Some(Direction::Sent))
        );
        assert_eq!(found[0].wire, Wire::Can(CanFrame::new(0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0])));
        assert_eq!(found[1].wire, Wire::Can(CanFrame::data_frame(0x18EB_FF00, true, &[1, 0xA0])));
        assert!(matches!(found[2].wire, Wire::Error { .. }));
        assert_eq!(found[3].wire, Wire::Can(CanFrame::remote_frame(0x142, false, 8)));
        let Wire::Fd(fd) = &found[4].wire else { panic!("no FD frame") };
        assert_eq!((fd.id, fd.flags, fd.data.len()), (0x300, 1, 12));
        // A bus with CAN FD has classic frames, too.
        let status = CanFrame::new(0x141, [0x9A, 0x19, 0, 0xF0, 0, 0, 0, 0x09]);
        assert_eq!(found[5].wire, Wire::Can(status));
        assert_eq!(found[6].wire, Wire::Can(CanFrame::remote_frame(0x141, false, 8)));
        assert!(matches!(found[7].wire, Wire::Fd(_)));
    }

    #[test]
    fn decimal_numbers_and_relative_times_are_read() {
        let text = "base dec  timestamps relative\n0.5 1 321 Rx d 2 154 255\n0.25 1 321 Rx d 0\n";
        let found: Vec<_> = entries(text).into_iter().map(Result::unwrap).collect();
        assert_eq!(found[0].wire, Wire::Can(CanFrame::data_frame(0x141, false, &[154, 255])));
        assert_eq!(found[1].time, Some(Stamp::Relative(750_000_000)));
    }

    #[test]
    fn what_is_no_frame_says_why() {
        for wrong in [
            "hello",
            "1.0",
            "1.0 1",
            "1.0 1 141",
            "1.0 1 141 Rx",
            "1.0 1 141 Rx d",
            "1.0 1 141 Rx d 2 00",
            "1.0 1 141 Rx d 9 0 0 0 0 0 0 0 0 0",
            "1.0 1 141 Rx d 1 100",
            "1.0 1 800 Rx d 0",
            "1.0 1 141 Up d 0",
            "1.0 1 141 TxRq d 0",
            "1.0 CANFD 1 Rx 141 1 0 9 65",
            "1.0 1 141 Rx d 1 00 11",
            "base oct  timestamps absolute",
        ] {
            assert!(matches!(&entries(wrong)[..], [Err(_)]), "{wrong}");
        }
    }
}
