//! Every code with every value of every byte, through drive and host.

use crate::rmd_bench::{Node, motor, trusted_host};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::Instant;

/// The values of the bytes that are not varied.
const PATTERNS: [u8; 3] = [0x00, 0xFF, 0x5A];

/// Every value of every byte after the code, with the other bytes of each pattern.
fn frames(code: u8) -> impl Iterator<Item = [u8; 8]> {
    PATTERNS.into_iter().flat_map(move |pattern| {
        (1..8).flat_map(move |place| {
            (0..=255).map(move |value| {
                let mut data = [pattern; 8];
                (data[0], data[place]) = (code, value);
                data
            })
        })
    })
}

/// The bytes that a field covers; the others are NULL.
fn values(fields: &[Field], data: [u8; 8]) -> [u8; 8] {
    let mut kept = [0; 8];
    kept[0] = data[0];
    for field in fields {
        let (first, len) = (usize::from(field.offset), usize::from(field.len));
        kept[first..first + len].copy_from_slice(&data[first..first + len]);
    }
    kept
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn every_frame_gets_the_reply_of_its_code_or_none() {
    let id = motor(3);
    for code in 0..=255 {
        let row = Code::from(code).info();
        let (mut node, mut host) = (Node::new(3), trusted_host());
        for data in frames(code) {
            let (before, saved) = (*node.drive.settings(), node.motor.saved.len());
            let reply = node.raw(data);
            assert_eq!(reply.is_some(), row.is_some(), "{data:02x?}");
            let wrote = node.motor.saved.len() > saved;
            assert!(!wrote || row.is_some_and(|row| row.rom), "{data:02x?} wrote to ROM");
            let Some((row, mut reply)) = row.zip(reply) else {
                assert_eq!(*node.drive.settings(), before);
                continue;
            };
            let answered = if code == 0x9B { 0x9A } else { code };
            assert_eq!(reply[0], answered, "{data:02x?}");
            assert!(!row.echo || reply == data, "{data:02x?} echoed as {reply:02x?}");
            if !row.echo {
                assert_eq!(reply, values(row.reply, reply), "NULL bytes are sent as 0");
            }

            if code == 0x9A {
                // A motor that answers has a supply voltage.
                reply[3] = 240;
            }
            if let Ok(()) = host.request(Instant(0), id, data) {
                let frame = CanFrame::new(id.can_id(), data);
                assert_eq!(host.poll(Instant(0)), Output::Transmit(frame));
                host.receive(Instant(0), &CanFrame::new(id.can_id(), reply));
                assert_eq!(host.poll(Instant(0)), Output::Done { id, result: Ok(reply) });
            } else {
                assert!(row.motion.may_move(), "only motion commands are refused: {data:02x?}");
            }
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn only_a_reply_with_the_code_of_the_request_is_taken() {
    let id = motor(3);
    for code in 0..=255u8 {
        for answer in 0..=255u8 {
            let mut host = trusted_host();
            host.request(Instant(0), id, [code, 0, 0, 0, 0, 0, 0, 0]).unwrap();
            assert!(matches!(host.poll(Instant(0)), Output::Transmit(_)));
            host.receive(Instant(0), &CanFrame::new(id.can_id(), [answer, 1, 2, 3, 4, 5, 6, 7]));
            let taken = matches!(host.poll(Instant(0)), Output::Done { .. });
            let alike = code == answer || (code == 0x9B && answer == 0x9A);
            assert_eq!(taken, alike, "{code:#04x} answered by {answer:#04x}");
        }
    }
}

/// Decoding and encoding keeps the bytes that the fields cover.
fn kept<P: Payload>(code: u8) {
    for data in frames(code) {
        let again = P::decode(&data).encode_as(Code::from(code));
        assert_eq!(again, values(P::FIELDS, data), "{data:02x?}");
    }
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn null_bytes_of_a_request_are_ignored_and_sent_as_zero() {
    macro_rules! all_kept {
        ($($name:ident)+) => { $( kept::<$name>($name::CODE.into()); )+ };
    }
    motorlink_proto::for_each_rmd_command!(all_kept);
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn every_reply_keeps_its_values_and_leaves_null_bytes_zero() {
    macro_rules! all_kept {
        ($($name:ident)+) => { $( kept::<<$name as Command>::Reply>($name::CODE.into()); )+ };
    }
    motorlink_proto::for_each_rmd_command!(all_kept);
}
