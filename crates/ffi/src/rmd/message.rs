//! Requests and replies, by value: what goes in a frame as numbers with their units.

use motorlink_proto::rmd::{self as proto, Command, EncoderBits, FULL_TURN, Payload};
use motorlink_proto::units::Quantity;

use crate::error::{answer, motorlink_error};
use crate::number::motorlink_rmd_spin_direction;
use crate::pointer::promised;

/// The eight bytes of a request or a reply.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_data {
    /// DATA\[0\] to DATA\[7\].
    pub bytes: [u8; 8],
}

fn data(command: impl Command) -> motorlink_rmd_data {
    motorlink_rmd_data { bytes: command.encode() }
}

/// The values of a reply with one of these codes.
fn decode<T: Payload>(reply: &motorlink_rmd_data, codes: &[u8]) -> Result<T, motorlink_error> {
    let [code, ..] = reply.bytes;
    match codes.contains(&code) {
        true => Ok(T::decode(&reply.bytes)),
        false => Err(motorlink_error::BadArgument),
    }
}

// From the rows of the command table, by build.rs.
include!(concat!(env!("OUT_DIR"), "/rmd_commands.rs"));

/// An encoder value of a reply as an angle, 0.01° a digit; `encoder_bits` is the encoder's width,
/// 12 to 18. 0 for any other width.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_encoder_centidegrees(counts: u16, encoder_bits: u8) -> u16 {
    let Some(bits) = EncoderBits::new(encoder_bits) else { return 0 };
    // Of a wider encoder the upper 16 bits travel.
    let width = u32::from(bits.bits().min(16));
    (u32::from(counts) * u32::from(FULL_TURN)).wrapping_shr(width) as u16
}
