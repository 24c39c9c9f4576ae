//! `(1436509053.249713) can0 141#9A00000000000000`

use super::{Id, classic, dropped, id};
use crate::captured::{Direction, FdFrame, Stamp, Wire};
use crate::line::Entry;
use crate::text::{digit, nanoseconds, word};
use motorlink_proto::can::CanFrame;

const NOT_A_LINE: &str = "not a line of `candump -L`";

pub(crate) fn parse(line: &[u8]) -> Result<Option<Entry<'_>>, &'static str> {
    if let Some(entry) = dropped(line) {
        return Ok(Some(entry));
    }
    let mut rest = line;
    let Some(time) = word(&mut rest) else { return Ok(None) };
    let time = time
        .strip_prefix(b"(")
        .and_then(|time| time.strip_suffix(b")"))
        .and_then(nanoseconds)
        .ok_or(NOT_A_LINE)?;
    let channel = word(&mut rest).ok_or(NOT_A_LINE)?;
    let wire = frame(word(&mut rest).ok_or(NOT_A_LINE)?)?;
    let direction = match word(&mut rest) {
        None => None,
        Some(b"R") => Some(Direction::Received),
        Some(b"T") => Some(Direction::Sent),
        Some(_) => return Err("behind the frame there is more than `R` or `T`"),
    };
    if word(&mut rest).is_some() {
        return Err(NOT_A_LINE);
    }
    Ok(Some(Entry { time: Some(stamp(time)), channel: Some(channel), direction, wire }))
}

/// candump has no mark for a time that is not since 1970. A time in the first year is none.
pub(crate) const fn stamp(ns: i64) -> Stamp {
    const YEAR_NS: i64 = 365 * 86_400 * 1_000_000_000;
    if ns >= YEAR_NS { Stamp::Wall(ns) } else { Stamp::Relative(ns) }
}

/// A frame as candump and cansend write it: `141#9A00000000000000`, `141#R`, `123##1AABB`.
pub(crate) fn frame(word: &[u8]) -> Result<Wire, &'static str> {
    let mark = word.iter().position(|&byte| byte == b'#').ok_or("a frame without `#`")?;
    let (before, data) = (&word[..mark], &word[mark + 1..]);
    let id = id(before).ok_or("the identifier is not 3 or 8 hexadecimal digits")?;
    match data {
        [b'#', flags, data @ ..] => fd(&id, *flags, data),
        [b'R' | b'r', length @ ..] => remote(&id, length),
        data => {
            let mut bytes = [0; 8];
            let len =
                hex_into(data, &mut bytes).ok_or("the data is not 0 to 8 bytes in hexadecimal")?;
            classic(&id, &bytes[..len]).ok_or("the data is not 0 to 8 bytes in hexadecimal")
        }
    }
}

fn fd(id: &Id, flags: u8, data: &[u8]) -> Result<Wire, &'static str> {
    const WRONG: &str = "not a CAN FD frame";
    let mut bytes = [0; 64];
    let flags = digit(flags).filter(|_| !id.is_error).ok_or(WRONG)?;
    let len = hex_into(data, &mut bytes).ok_or(WRONG)?;
    let (id, extended) = (id.number, id.is_extended);
    Ok(Wire::Fd(Box::new(FdFrame { id, extended, flags, data: bytes[..len].to_vec() })))
}

fn remote(id: &Id, length: &[u8]) -> Result<Wire, &'static str> {
    let len = match length {
        _ if id.is_error => None,
        [] => Some(0),
        // With the raw length code behind `_`, if it is not 8.
        [len @ b'0'..=b'8'] | [len @ b'8', b'_', b'9'..=b'F'] => Some(len - b'0'),
        _ => None,
    };
    let len = len.ok_or("not a remote frame")?;
    Ok(Wire::Can(CanFrame::remote_frame(id.number, id.is_extended, len)))
}

/// Bytes with two digits each, between which there may be dots. Behind 8 bytes there may be `_` and
/// the raw length code. Returns their number.
fn hex_into(text: &[u8], out: &mut [u8]) -> Option<usize> {
    let mut len = 0;
    let mut text = text;
    loop {
        match text {
            [] => return Some(len),
            [b'.', rest @ ..] => text = rest,
            [b'_', b'9'..=b'F'] if len == 8 => return Some(len),
            [high, low, rest @ ..] => {
                *out.get_mut(len)? = digit(*high)? << 4 | digit(*low)?;
                len += 1;
                text = rest;
            }
            _ => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(line: &str) -> Entry<'_> {
        parse(line.as_bytes()).unwrap().unwrap()
    }

    #[test]
    fn a_line_has_time_channel_frame_and_direction() {
        let line = entry("(1436509053.249713) can0 141#9A00000000000000");
        assert_eq!(line.time, Some(Stamp::Wall(1_436_509_053_249_713_000)));
        assert_eq!((line.channel, line.direction), (Some(&b"can0"[..]), None));
        assert_eq!(line.wire, Wire::Can(CanFrame::new(0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0])));
        assert_eq!(entry("(0.1) can0 141#9a R").direction, Some(Direction::Received));
        assert_eq!(entry("(0.1) can0 141#9a T").direction, Some(Direction::Sent));
        assert_eq!(entry("(000.100000) can0 141#").time, Some(Stamp::Relative(100_000_000)));
    }

    #[test]
    fn every_kind_of_frame_is_read() {
        let wire = |text: &str| frame(text.as_bytes()).unwrap();
        assert_eq!(wire("00000141#"), Wire::Can(CanFrame::data_frame(0x141, true, &[])));
        assert_eq!(
            wire("141#11.22.33"),
            Wire::Can(CanFrame::data_frame(0x141, false, &[0x11, 0x22, 0x33]))
        );
        assert_eq!(wire("141#R"), Wire::Can(CanFrame::remote_frame(0x141, false, 0)));
        assert_eq!(wire("141#R8"), Wire::Can(CanFrame::remote_frame(0x141, false, 8)));
        assert_eq!(wire("20000004#0001"), Wire::Error { class: 4, data: [0, 1, 0, 0, 0, 0, 0, 0] });
        let Wire::Fd(fd) = wire("141##1AABB") else { panic!("no FD frame") };
        assert_eq!((fd.id, fd.flags, &fd.data[..]), (0x141, 1, &[0xAA, 0xBB][..]));
        assert_eq!(wire("141#0000000000000000_F"), Wire::Can(CanFrame::new(0x141, [0; 8])));
    }

    #[test]
    fn what_is_no_frame_says_why() {
        for wrong in [
            "141",
            "14#00",
            "800#00",
            "141#0",
            "141#001122334455667788",
            "141#xx",
            "A0000000#",
            "141#R9",
            "141##",
            "20000001#R",
        ] {
            assert!(frame(wrong.as_bytes()).is_err(), "{wrong}");
        }
        for wrong in [
            "can0 141#00",
            "(x) can0 141#00",
            "(1.0) can0",
            "(1.0) can0 141#00 X",
            "(1.0) can0 141#00 R x",
        ] {
            assert!(parse(wrong.as_bytes()).is_err(), "{wrong}");
        }
        assert_eq!(parse(b"  "), Ok(None));
    }

    #[test]
    fn a_loss_is_not_skipped() {
        let line = "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 7)";
        let expected = Wire::Damage(crate::captured::Damage::Dropped(3));
        assert_eq!(entry(line).wire, expected);
    }
}
