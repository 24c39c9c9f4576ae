//! What differs between drives.

use motorlink_proto::st::Profile;

use crate::error::motorlink_error;

/// How a drive behaves where the document and shipped firmware differ.
#[repr(u8)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum motorlink_st_profile {
    /// The document as written.
    Spec = 0,
    /// What firmware of MCSDK 5.4 does on the wire.
    Mcsdk54 = 1,
}

pub(super) fn profile(number: u8) -> Result<Profile, motorlink_error> {
    const SPEC: u8 = motorlink_st_profile::Spec as u8;
    const MCSDK54: u8 = motorlink_st_profile::Mcsdk54 as u8;
    match number {
        SPEC => Ok(Profile::Spec),
        MCSDK54 => Ok(Profile::Mcsdk54),
        _ => Err(motorlink_error::BadArgument),
    }
}
