//! `--trace`: prints every frame on stderr, as bytes and with its meaning.

use std::fmt::Arguments;
use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::port::Direction;
use motorlink::rmd;
use motorlink::st::Profile;
use motorlink_capture::{Stamp, st::Transcript};

use crate::output::{hex, print_message};

/// Prints the bytes of a serial line, with what they mean.
pub fn bytes(profile: Profile) -> impl FnMut(Direction, Duration, &[u8]) + Send {
    let mut transcript = Transcript::new(profile);
    move |direction, at, bytes| {
        let sent = direction == Direction::Sent;
        let time = i64::try_from(at.as_nanos()).ok().map(Stamp::Relative);
        let meaning = transcript.note(time, sent, bytes);
        print(direction, at, format_args!("{:<24} {meaning}", hex(bytes)));
    }
}

/// Prints the frames of a CAN bus, with what they mean.
pub fn frames() -> impl FnMut(Direction, Duration, &CanFrame) + Send {
    move |direction, at, frame| {
        let way = match direction {
            Direction::Sent => rmd::Direction::HostToDrive,
            Direction::Received => rmd::Direction::DriveToHost,
        };
        let (id, data) = (frame.id(), hex(frame.data()));
        let meaning = rmd::describe(*frame, way);
        print(direction, at, format_args!("{id:03x}#{data:<24} {meaning}"));
    }
}

fn print(direction: Direction, at: Duration, what: Arguments<'_>) {
    let arrow = match direction {
        Direction::Sent => "->",
        Direction::Received => "<-",
    };
    print_message(&format!("{:>10.6} {arrow} {what}", at.as_secs_f64()));
}
