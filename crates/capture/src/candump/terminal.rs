//! ` (1436509053.249713)  can0  141   [8]  9A 00 00 00 00 00 00 00`

use super::log::stamp;
use super::{classic, dropped, id};
use crate::captured::{Direction, FdFrame, Stamp, Wire};
use crate::line::Entry;
use crate::text::{decimal, digit, nanoseconds, words};
use motorlink_proto::can::CanFrame;

const NOT_A_LINE: &str = "not a line of candump";

pub(crate) fn parse(line: &[u8]) -> Result<Option<Entry<'_>>, &'static str> {
    if let Some(entry) = dropped(line) {
        return Ok(Some(entry));
    }
    let mut words = words(line).peekable();
    let Some(first) = words.next() else { return Ok(None) };
    let (time, channel) = match first {
        [b'(', time @ .., b')'] => {
            (Some(stamp(nanoseconds(time).ok_or(NOT_A_LINE)?)), words.next().ok_or(NOT_A_LINE)?)
        }
        // -t A: a date and a time of the local clock.
        [b'(', b'0'..=b'9', ..] => {
            let (date, clock) = (&first[1..], words.next().ok_or(NOT_A_LINE)?);
            let ns = date_and_time(date, clock.strip_suffix(b")").ok_or(NOT_A_LINE)?);
            (Some(ns.ok_or(NOT_A_LINE)?), words.next().ok_or(NOT_A_LINE)?)
        }
        _ => (None, first),
    };
    let mut direction = None;
    if let Some(found) = words.peek().and_then(|word| with_x(word)) {
        direction = Some(found);
        words.next();
        // Bit rate switch and error state of a CAN FD frame.
        for mark in [b'B', b'E'] {
            if words.peek().is_some_and(|word| *word == [mark] || *word == b"-") {
                words.next();
            }
        }
    }
    let id = id(words.next().ok_or(NOT_A_LINE)?)
        .ok_or("the identifier is not 3 or 8 hexadecimal digits")?;
    let length = words.next().and_then(|word| word.strip_prefix(b"[")?.strip_suffix(b"]"));
    let length = length.ok_or(NOT_A_LINE)?;
    // CAN FD has two digits.
    let is_fd = length.len() == 2;
    let len = decimal(length).filter(|&len| len <= 64).ok_or(NOT_A_LINE)? as usize;
    if words.peek() == Some(&&b"remote"[..]) {
        if is_fd || id.is_error || len > 8 {
            return Err("not a remote frame");
        }
        let wire = Wire::Can(CanFrame::remote_frame(id.number, id.is_extended, len as u8));
        return Ok(Some(Entry { time, channel: Some(channel), direction, wire }));
    }
    let mut bytes = [0; 64];
    for slot in &mut bytes[..len] {
        *slot = words.next().and_then(byte).ok_or("the line has fewer bytes than it says")?;
    }
    // Behind the bytes there may be text: -a, ERRORFRAME.
    if words.peek().is_some_and(|word| byte(word).is_some()) && !id.is_error {
        return Err("the line has more bytes than it says");
    }
    let wire = match is_fd {
        true => Wire::Fd(Box::new(FdFrame {
            id: id.number,
            extended: id.is_extended,
            flags: 0,
            data: bytes[..len].to_vec(),
        })),
        false => classic(&id, &bytes[..len]).ok_or(NOT_A_LINE)?,
    };
    Ok(Some(Entry { time, channel: Some(channel), direction, wire }))
}

fn with_x(word: &[u8]) -> Option<Direction> {
    match word {
        b"RX" => Some(Direction::Received),
        b"TX" => Some(Direction::Sent),
        _ => None,
    }
}

fn byte(word: &[u8]) -> Option<u8> {
    let &[high, low] = word else { return None };
    Some(digit(high)? << 4 | digit(low)?)
}

/// `2015-07-10` and `08:17:33.249713`. The zone is not known, so the time counts from the start of
/// 1970 of that zone.
fn date_and_time(date: &[u8], clock: &[u8]) -> Option<Stamp> {
    let mut date = date.split(|&byte| byte == b'-').map(decimal);
    let (year, month, day) = (date.next()??, date.next()??, date.next()??);
    if date.next().is_some() || !(1970..=2261).contains(&year) || !(1..=12).contains(&month) {
        return None;
    }
    let mut clock = clock.splitn(3, |&byte| byte == b':');
    let (hours, minutes) = (decimal(clock.next()?)?, decimal(clock.next()?)?);
    let seconds = nanoseconds(clock.next()?)?;
    let minutes =
        i64::from(days(year, month, day)) * 1_440 + i64::from(hours) * 60 + i64::from(minutes);
    Some(Stamp::Relative(minutes.checked_mul(60_000_000_000)?.checked_add(seconds)?))
}

/// Days from the start of 1970 (civil calendar).
const fn days(year: u32, month: u32, day: u32) -> u32 {
    // The year begins in March, so that the leap day is its last.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let before = year * 365 + year / 4 - year / 100 + year / 400 + (month * 153 + 2) / 5;
    before.wrapping_add(day).wrapping_sub(719_469)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(line: &str) -> Entry<'_> {
        parse(line.as_bytes()).unwrap().unwrap()
    }

    #[test]
    fn every_time_format_of_candump_is_read() {
        let tail = "  can0  141   [8]  9A 00 00 00 00 00 00 00";
        let frame = Wire::Can(CanFrame::new(0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0]));
        for (time, expected) in [
            (" (1436509053.249713)", Some(Stamp::Wall(1_436_509_053_249_713_000))),
            (" (000.000123)", Some(Stamp::Relative(123_000))),
            (" (2015-07-10 06:17:33.249713)", Some(Stamp::Relative(1_436_509_053_249_713_000))),
            ("", None),
        ] {
            let line = format!("{time}{tail}");
            let entry = entry(&line);
            assert_eq!((entry.time, entry.channel), (expected, Some(&b"can0"[..])), "{line}");
            assert_eq!(entry.wire, frame);
        }
    }

    #[test]
    fn every_kind_of_frame_is_read() {
        let line = entry(" (1.0)  can0  TX - -  141   [2]  9A 00   '..'");
        assert_eq!(line.direction, Some(Direction::Sent));
        assert_eq!(line.wire, Wire::Can(CanFrame::data_frame(0x141, false, &[0x9A, 0])));
        assert_eq!(entry("  can0  RX B -  141  [01]  9A").direction, Some(Direction::Received));
        assert_eq!(
            entry("  can0  00000141   [4]  remote request").wire,
            Wire::Can(CanFrame::remote_frame(0x141, true, 4))
        );
        let error = entry("  can0  20000004   [8]  00 01 00 00 00 00 00 00   ERRORFRAME").wire;
        assert_eq!(error, Wire::Error { class: 4, data: [0, 1, 0, 0, 0, 0, 0, 0] });
        let Wire::Fd(fd) = entry("  can0  141  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B").wire
        else {
            panic!("no FD frame")
        };
        assert_eq!(fd.data.len(), 12);
    }

    #[test]
    fn what_is_no_frame_says_why() {
        for wrong in [
            "can0",
            "can0 141",
            "can0 141 [2] 00",
            "can0 141 [1] 00 11",
            "can0 141 [9] 00 00 00 00 00 00 00 00 00",
            "can0 141 [x]",
            "(x) can0 141 [0]",
            "(2015-13-01 00:00:00.0) can0 141 [0]",
        ] {
            assert!(parse(wrong.as_bytes()).is_err(), "{wrong}");
        }
    }
}
