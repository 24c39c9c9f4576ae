//! Identifiers, forms, command bytes.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;

use super::{Mutant, are_caught, code, commands, frames, mutant};
use crate::drive::{Behaviour, Event};

#[test]
fn mutants_of_frames_and_command_bytes_are_caught() {
    are_caught(mutants());
}

fn mutants() -> Vec<Mutant> {
    let moved = |by: u16| {
        frames(move |_, reply| {
            let (id, data) = reply.eight_bytes().expect("a reply");
            vec![CanFrame::new(id + by, *data)]
        })
    };
    vec![
        mutant("replies_on_0x240_as_v3", "RMD-1-01", moved(0x100)),
        mutant("replies_on_0x180_as_lk", "RMD-1-01", moved(0x40)),
        mutant(
            "replies_of_7_bytes",
            "RMD-1-05",
            frames(|_, reply| vec![CanFrame::data_frame(reply.id(), false, &reply.data()[..7])]),
        ),
        mutant(
            "replies_with_29_bits",
            "RMD-1-04",
            frames(|_, reply| vec![CanFrame::data_frame(reply.id(), true, reply.data())]),
        ),
        mutant(
            "remote_replies",
            "RMD-1-03",
            frames(|_, reply| vec![CanFrame::remote_frame(reply.id(), false, 8)]),
        ),
        mutant("takes_7_bytes", "RMD-1-05", lenient(|frame| frame.len() == 7)),
        mutant("takes_29_bits", "RMD-1-04", lenient(CanFrame::is_extended)),
        mutant("takes_remote_frames", "RMD-1-03", lenient(CanFrame::is_remote)),
        mutant("takes_frames_for_a_neighbour", "RMD-1-06", lenient(|frame| frame.id() == 0x143)),
        mutant("takes_frames_for_nobody", "RMD-1-06", lenient(|frame| frame.id() == 0x140)),
        mutant("everything_twice", "RMD-9A-02", frames(|_, reply| vec![reply, reply])),
        mutant(
            "an_echo_twice",
            "RMD-81-04",
            frames(|_, reply| vec![reply; 1 + usize::from(reply.data()[0] == 0x81)]),
        ),
        mutant(
            "unknown_codes_are_echoed",
            "RMD-2-24",
            commands(|_, data| matches!(code(data), Code::Unknown(_)).then_some(Some(*data))),
        ),
        mutant(
            "a_code_of_v3_is_known",
            "RMD-2-24",
            commands(|_, data| (data[0] == 0xA8).then_some(Some(*data))),
        ),
        mutant(
            "a_code_is_not_known",
            "RMD-2-14",
            commands(|_, data| (code(data) == Code::ReadPhaseCurrents).then_some(None)),
        ),
        mutant(
            "a_reply_has_another_code",
            "RMD-94-02",
            commands(|motors, data| {
                (code(data) == Code::ReadSingleTurnAngle).then(|| {
                    let [_, rest @ ..] = motors.ask(*data);
                    let [a, b, c, d, e, f, g] = rest;
                    Some([0x93, a, b, c, d, e, f, g])
                })
            }),
        ),
        mutant(
            "stale_null_bytes_are_refused",
            "RMD-90-01",
            commands(|_, data| {
                let stale = data[1] != 0;
                (code(data) == Code::ReadEncoder && stale).then_some(None)
            }),
        ),
        mutant(
            "null_bytes_are_echoed_as_0",
            "RMD-31-04",
            commands(|motors, data| {
                let known = code(data).info().filter(|row| row.echo);
                known.map(|_| {
                    let mut reply = motors.ask(*data);
                    reply[1] = 0;
                    Some(reply)
                })
            }),
        ),
    ]
}

/// Also accepts these frames, as if they had the right form.
fn lenient(takes: impl Fn(&CanFrame) -> bool + Send + 'static) -> Behaviour {
    Box::new(move |motors, event| match event {
        Event::Frame(frame) if frame.id() & 0x1C0 == 0x140 && takes(frame) => {
            let mut data = Command::encode(&ReadStatus);
            data[..frame.data().len()].copy_from_slice(frame.data());
            let own = motors.first_id().can_id();
            motors.try_ask(data).map(|reply| CanFrame::new(own, reply)).into_iter().collect()
        }
        event => motors.pass(event),
    })
}
