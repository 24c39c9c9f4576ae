//! CAN frames as C has them.

use motorlink_proto::can::CanFrame;

use crate::error::motorlink_error;
use crate::pointer::plain;

/// The `id` if a call returns no frame.
pub const MOTORLINK_NO_FRAME: u32 = u32::MAX;

/// A classic CAN frame of any kind.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_can_frame {
    /// The identifier: 11 bits, or 29.
    pub id: u32,
    /// 1 if the identifier has 29 bits.
    pub extended: u8,
    /// 1 for a remote transmission request.
    pub remote: u8,
    /// The length code, 0 to 8.
    pub size: u8,
    /// The bytes, of which the first `size` are used.
    pub data: [u8; 8],
}

plain!(motorlink_can_frame);

impl From<CanFrame> for motorlink_can_frame {
    fn from(frame: CanFrame) -> Self {
        motorlink_can_frame {
            id: frame.id(),
            extended: frame.is_extended().into(),
            remote: frame.is_remote().into(),
            size: frame.len(),
            data: frame.padded_data(),
        }
    }
}

impl TryFrom<motorlink_can_frame> for CanFrame {
    type Error = motorlink_error;

    fn try_from(frame: motorlink_can_frame) -> Result<Self, motorlink_error> {
        let extended = frame.extended != 0;
        let data = frame.data.get(..usize::from(frame.size)).ok_or(motorlink_error::BadArgument)?;
        let highest = if extended { 0x1FFF_FFFF } else { 0x7FF };
        if frame.id > highest {
            return Err(motorlink_error::BadArgument);
        }
        Ok(match frame.remote {
            0 => CanFrame::data_frame(frame.id, extended, data),
            _ => CanFrame::remote_frame(frame.id, extended, frame.size),
        })
    }
}

pub(crate) const NO_FRAME: motorlink_can_frame =
    motorlink_can_frame { id: MOTORLINK_NO_FRAME, extended: 0, remote: 0, size: 0, data: [0; 8] };
