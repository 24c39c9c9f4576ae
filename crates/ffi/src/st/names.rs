//! The document's names, for programs that print. One that calls none of this carries no names.

use motorlink_proto::st::{Command, ErrorCode, Profile, RegisterId, Status};

use crate::bytes::motorlink_bytes;
use crate::number::{
    motorlink_st_command, motorlink_st_error_code, motorlink_st_profile, motorlink_st_reg,
    motorlink_st_status, one_of,
};

fn text(text: Option<&'static str>) -> motorlink_bytes {
    text.unwrap_or_default().as_bytes().into()
}

/// The name of a register, UTF-8 without a NUL, constant: `printf("%.*s", (int)size, data)`. Empty
/// for a number without a name. This holds for all names here.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_reg_name(reg: motorlink_st_reg) -> motorlink_bytes {
    text(RegisterId(reg).text().map(|text| text.name))
}

/// The symbol of the unit of one digit of a register's value, in a profile; empty if it has none. FLUXWK_BUS
/// and FLUXWK_BUS_MEAS have `%` in profile SPEC and `0.1 %` in MCSDK54. All other units are the same.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_reg_unit(
    profile: motorlink_st_profile,
    reg: motorlink_st_reg,
) -> motorlink_bytes {
    let profile = one_of(&Profile::ALL, profile).ok();
    let shape = profile.zip(RegisterId(reg).shape());
    text(shape.map(|(profile, shape)| shape.unit.symbol_in(profile)))
}

/// The name of an error code.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_error_code_name(
    error_code: motorlink_st_error_code,
) -> motorlink_bytes {
    text(ErrorCode::from(error_code).name())
}

/// The name of a state.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_status_name(status: motorlink_st_status) -> motorlink_bytes {
    text(Status::from(status).name())
}

/// The name of a command.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_command_name(command: motorlink_st_command) -> motorlink_bytes {
    text(Command::from(command).name())
}
