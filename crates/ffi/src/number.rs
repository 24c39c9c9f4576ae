//! Numbers that have names. C has an enum for each set, written from proto's tables by `make header`.
//!
//! Here they are integers. A drive may send a number without a name and a caller may pass any, which
//! an enum of Rust must not hold; and the size of C's enums depends on the compiler's options. So C's
//! type is that integer, too.

use crate::bytes::MOTORLINK_NO_LIMIT;
use crate::error::motorlink_error;

/// One of `MOTORLINK_ST_PROFILE_*`.
pub type motorlink_st_profile = u8;
/// One of `MOTORLINK_ST_RECOVERY_*`.
pub type motorlink_st_recovery = u8;
/// One of `MOTORLINK_ST_REG_*`, or a register that the tables do not name.
pub type motorlink_st_reg = u8;
/// One of `MOTORLINK_ST_FRAME_CODE_*`, or a code that the document does not name.
pub type motorlink_st_frame_code = u8;
/// One of `MOTORLINK_ST_COMMAND_*`, or a command that the document does not name.
pub type motorlink_st_command = u8;
/// One of `MOTORLINK_ST_ERROR_CODE_*`, or a code that the document does not name.
pub type motorlink_st_error_code = u8;
/// One of `MOTORLINK_ST_STATUS_*`, or a state that the document does not name.
pub type motorlink_st_status = u8;
/// One of `MOTORLINK_RMD_SPIN_DIRECTION_*`.
pub type motorlink_rmd_spin_direction = u8;

/// What a caller allows, where it is a number of its kind.
pub(crate) fn limit<T: TryFrom<i32> + PartialOrd + Default>(
    digits: i32,
) -> Result<Option<T>, motorlink_error> {
    if digits == MOTORLINK_NO_LIMIT {
        return Ok(None);
    }
    let limit = T::try_from(digits).ok().filter(|limit| *limit >= T::default());
    limit.map(Some).ok_or(motorlink_error::BadArgument)
}

/// The entry of `all` with the caller's number.
pub(crate) fn one_of<T: Copy>(all: &[T], number: u8) -> Result<T, motorlink_error> {
    all.get(usize::from(number)).copied().ok_or(motorlink_error::BadArgument)
}
