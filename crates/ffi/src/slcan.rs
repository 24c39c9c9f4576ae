//! slcan: CAN frames as lines of text on a serial line, both ends.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;
use motorlink_slcan::{Answer, AnswerParser, Bitrate, Device, LONGEST_FRAME, encode};

use crate::error::{answer, motorlink_error};
use crate::frame::{NO_FRAME, motorlink_can_frame};
use crate::pointer::{promised, storage};
pub use crate::storage::{motorlink_slcan_device, motorlink_slcan_host};
use crate::tag::Kind;

storage!(motorlink_slcan_host: AnswerParser, Kind::SlcanHost);
storage!(motorlink_slcan_device: Device, Kind::SlcanDevice);

/// The longest line: a frame of 8 bytes with 29 bits of identifier and a timestamp.
pub const MOTORLINK_SLCAN_LINE_SIZE: usize = 31;
const _: () = assert!(MOTORLINK_SLCAN_LINE_SIZE == LONGEST_FRAME + 4);

/// Characters to send on the serial line.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_slcan_line {
    /// The characters, of which the first `size` are used.
    pub bytes: [u8; MOTORLINK_SLCAN_LINE_SIZE],
    /// The number of characters; 0: nothing to send.
    pub size: u8,
}

/// What an adapter has sent.
#[repr(u8)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum motorlink_slcan_answer {
    /// Nothing yet.
    None = 0,
    /// A frame came from the bus.
    Frame = 1,
    /// A command or a frame was taken.
    Taken = 2,
    /// A command or a frame was refused.
    Refused = 3,
    /// The answer to a question about version, serial number or status.
    Info = 4,
}

impl motorlink_slcan_line {
    const EMPTY: Self = Self { bytes: [0; MOTORLINK_SLCAN_LINE_SIZE], size: 0 };

    fn push(&mut self, text: &[u8]) {
        for &byte in text {
            if let Some(slot) = self.bytes.get_mut(usize::from(self.size)) {
                *slot = byte;
                self.size = self.size.wrapping_add(1);
            }
        }
    }
}

/// Begins the host's end, for the adapter on a serial line. `size` is `sizeof *host`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_slcan_host_init(
    host: *mut motorlink_slcan_host,
    size: usize,
) -> motorlink_error {
    promised!(host);
    answer(|| host.init(size, AnswerParser::default()))
}

/// Takes a byte from the adapter. `kind` is what the byte completes, `frame` the frame if it completes
/// one. Lines that are no answer are ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_slcan_host_receive(
    host: *mut motorlink_slcan_host,
    byte: u8,
    kind: *mut motorlink_slcan_answer,
    frame: *mut motorlink_can_frame,
) -> motorlink_error {
    promised!(host, kind, frame);
    answer(|| {
        let (kind, place) = (kind.place()?, frame.place()?);
        let said = host.enter()?.receive(byte);
        place.set(match said {
            Some(Answer::Frame(frame)) => frame.into(),
            _ => NO_FRAME,
        });
        kind.set(match said {
            None => motorlink_slcan_answer::None,
            Some(Answer::Frame(_)) => motorlink_slcan_answer::Frame,
            Some(Answer::Done) => motorlink_slcan_answer::Taken,
            Some(Answer::Refused) => motorlink_slcan_answer::Refused,
            Some(Answer::Info) => motorlink_slcan_answer::Info,
        });
        Ok(())
    })
}

/// Gives the lines that open an adapter's channel: end of an earlier line, close, bitrate, open. The
/// adapter answers each of the four, some, or none. RMD motors have 1 000 000 bit/s.
///
/// `BAD_ARGUMENT`: slcan has no such bitrate (10, 20, 50, 100, 125, 250, 500, 800 or 1000 kbit/s).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_slcan_open(
    bits_per_second: u32,
    line: *mut motorlink_slcan_line,
) -> motorlink_error {
    promised!(line);
    answer(|| {
        let place = line.place()?;
        let bitrate = Bitrate::from_bits_per_second(bits_per_second);
        let mut line = motorlink_slcan_line::EMPTY;
        line.push(b"\rC\r");
        line.push(&bitrate.ok_or(motorlink_error::BadArgument)?.command());
        line.push(b"O\r");
        place.set(line);
        Ok(())
    })
}

/// Gives the line that makes an adapter send a frame.
///
/// `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_slcan_encode(
    frame: *const motorlink_can_frame,
    line: *mut motorlink_slcan_line,
) -> motorlink_error {
    promised!(frame, line);
    answer(|| {
        let place = line.place()?;
        let frame = CanFrame::try_from(frame.read()?)?;
        let mut line = motorlink_slcan_line::EMPTY;
        line.push(encode(&frame, &mut [0; LONGEST_FRAME]));
        place.set(line);
        Ok(())
    })
}

/// Begins the adapter's end, for a drive that speaks slcan itself. `size` is `sizeof *device`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_slcan_device_init(
    device: *mut motorlink_slcan_device,
    size: usize,
) -> motorlink_error {
    promised!(device);
    answer(|| device.init(size, Device::default()))
}

/// Takes a byte from the host. `line` is the answer to send, if any. `frame` is the frame that the host
/// sends to the bus; its id is `MOTORLINK_NO_FRAME` if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_slcan_device_receive(
    device: *mut motorlink_slcan_device,
    byte: u8,
    line: *mut motorlink_slcan_line,
    frame: *mut motorlink_can_frame,
) -> motorlink_error {
    promised!(device, line, frame);
    answer(|| {
        let (answer, place) = (line.place()?, frame.place()?);
        let mut line = motorlink_slcan_line::EMPTY;
        let frame = device.enter()?.receive(byte, |said| line.push(said));
        answer.set(line);
        place.set(frame.map_or(NO_FRAME, motorlink_can_frame::from));
        Ok(())
    })
}

/// Gives the line for a frame that came from the bus at `now_us`; an empty one if the host has not opened
/// the channel.
///
/// `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_slcan_device_deliver(
    device: *mut motorlink_slcan_device,
    now_us: u64,
    frame: *const motorlink_can_frame,
    line: *mut motorlink_slcan_line,
) -> motorlink_error {
    promised!(device, frame, line);
    answer(|| {
        let place = line.place()?;
        let frame = CanFrame::try_from(frame.read()?)?;
        let mut line = motorlink_slcan_line::EMPTY;
        device.enter()?.deliver(Instant(now_us), &frame, |said| line.push(said));
        place.set(line);
        Ok(())
    })
}
