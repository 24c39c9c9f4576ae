//! The document's names, for programs that print. One that calls none of this carries no names.

use motorlink_proto::st::{Command, ErrorCode, RegisterId, Status};

use crate::bytes::motorlink_bytes;

fn text(text: Option<&'static str>) -> motorlink_bytes {
    text.unwrap_or_default().as_bytes().into()
}

/// The name of a register, UTF-8 without a NUL, constant: `printf("%.*s", (int)size, data)`. Empty
/// for a number that nobody names, as all names here.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_register_name(reg: u8) -> motorlink_bytes {
    text(RegisterId(reg).text().map(|text| text.name))
}

/// The symbol of the unit of a register's value; empty where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_register_unit(reg: u8) -> motorlink_bytes {
    text(RegisterId(reg).shape().map(|shape| shape.unit.symbol()))
}

/// The name of a `motorlink_st_refusal`.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_refusal_name(refusal: u8) -> motorlink_bytes {
    text(ErrorCode::from(refusal).name())
}

/// The name of a `motorlink_st_status`.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_status_name(status: u8) -> motorlink_bytes {
    text(Status::from(status).name())
}

/// The name of a `motorlink_st_command`.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_command_name(command: u8) -> motorlink_bytes {
    text(Command::from(command).name())
}
