//! Contents of messages, as structs of C.

use core::ffi::c_char;

use motorlink_proto::st::{BoardInfo, FirmwareVersion, Profile, RegisterId, RevupPhase};

use crate::error::{answer, motorlink_error};
use crate::number::{motorlink_st_profile, motorlink_st_reg, one_of};
use crate::pointer::{In, plain, promised};

/// A phase of the rev-up (4.9).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_st_revup_phase {
    /// Mechanical speed at the end of the phase, rpm.
    pub speed_rpm: i32,
    /// Iq at the end of the phase, s16A digits.
    pub torque_s16a: i16,
    /// Length of the phase, ms.
    pub duration_ms: u16,
}

/// Bytes for a text of a reply, with its NUL.
pub const MOTORLINK_ST_TEXT_SIZE: usize = 33;

/// The answer to a board information request (4.7).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_st_board_info {
    /// Major version of the SDK.
    pub major: u8,
    /// Minor version of the SDK.
    pub minor: u8,
    /// Patch version of the SDK.
    pub patch: u8,
    /// Name of the SDK, UTF-8, with a NUL at its end.
    pub name: [c_char; MOTORLINK_ST_TEXT_SIZE],
}

/// The answer to a firmware version request (4.12).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_st_firmware_version {
    /// Name of the firmware, UTF-8, with a NUL at its end.
    pub name: [c_char; MOTORLINK_ST_TEXT_SIZE],
    /// Its version, such as `Ver.5.4.4`, UTF-8, with a NUL at its end.
    pub version: [c_char; MOTORLINK_ST_TEXT_SIZE],
}

plain!(motorlink_st_revup_phase);

impl From<RevupPhase> for motorlink_st_revup_phase {
    fn from(phase: RevupPhase) -> Self {
        let RevupPhase { speed_rpm, torque_s16a, duration_ms } = phase;
        motorlink_st_revup_phase { speed_rpm, torque_s16a, duration_ms }
    }
}

impl From<motorlink_st_revup_phase> for RevupPhase {
    fn from(phase: motorlink_st_revup_phase) -> Self {
        let motorlink_st_revup_phase { speed_rpm, torque_s16a, duration_ms } = phase;
        RevupPhase { speed_rpm, torque_s16a, duration_ms }
    }
}

/// The text with a NUL at its end, cut where the room ends.
fn terminated(text: &str) -> [c_char; MOTORLINK_ST_TEXT_SIZE] {
    let mut out = [0; MOTORLINK_ST_TEXT_SIZE];
    let end = (0..MOTORLINK_ST_TEXT_SIZE).rev().find(|&end| text.is_char_boundary(end));
    for (slot, byte) in out.iter_mut().zip(text.bytes().take(end.unwrap_or(0))) {
        *slot = byte as c_char;
    }
    out
}

/// Reads the payload of an answer to `motorlink_st_master_get_board_info`.
///
/// `BAD_ARGUMENT`: the payload is too short to be one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_decode_board_info(
    payload: *const u8,
    size: usize,
    info: *mut motorlink_st_board_info,
) -> motorlink_error {
    promised!(payload, info);
    answer(|| {
        let payload: In<u8> = payload;
        let (payload, place) = (payload.slice(size)?, info.place()?);
        let info = BoardInfo::decode(payload).ok_or(motorlink_error::BadArgument)?;
        let [major, minor, patch] = info.version;
        let name = terminated(info.name);
        place.set(motorlink_st_board_info { major, minor, patch, name });
        Ok(())
    })
}

/// Reads the payload of an answer to `motorlink_st_master_get_firmware_version`. Texts that are not
/// UTF-8 are cut there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_decode_firmware_version(
    payload: *const u8,
    size: usize,
    version: *mut motorlink_st_firmware_version,
) -> motorlink_error {
    promised!(payload, version);
    answer(|| {
        let (payload, place) = (payload.slice(size)?, version.place()?);
        let FirmwareVersion { name, version } = FirmwareVersion::decode(payload);
        let (name, version) = (terminated(name), terminated(version));
        place.set(motorlink_st_firmware_version { name, version });
        Ok(())
    })
}

/// Reads the payload of an answer to `motorlink_st_master_get_revup_data`.
///
/// `BAD_ARGUMENT`: the payload is too short to be one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_decode_revup_data(
    payload: *const u8,
    size: usize,
    phase: *mut motorlink_st_revup_phase,
) -> motorlink_error {
    promised!(payload, phase);
    answer(|| {
        let (payload, place) = (payload.slice(size)?, phase.place()?);
        let phase = RevupPhase::decode(payload).ok_or(motorlink_error::BadArgument)?;
        place.set(phase.into());
        Ok(())
    })
}

/// Checks whether `profile` may be right for a register's value that was read, from
/// `motorlink_st_output` or from `motorlink_st_decode_segment`. Call it for values that you show or
/// compute with: without it a wrong profile gives wrong values.
///
/// `IMPLAUSIBLE`: the value is possible in the other profile only. For example, HEATS_TEMP of -10 °C in
/// MCSDK54 is 65526 °C in SPEC. `BAD_ARGUMENT`: `profile` is not one of its enum's.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_check_value(
    profile: motorlink_st_profile,
    reg: motorlink_st_reg,
    value: i32,
) -> motorlink_error {
    answer(|| {
        let profile = one_of(&Profile::ALL, profile)?;
        match RegisterId(reg).value_of_other_profile(profile, value) {
            None => Ok(()),
            Some(_) => Err(motorlink_error::Implausible),
        }
    })
}

/// Reads the payload of an answer to `motorlink_st_master_get_segment`: the values of the `count`
/// registers that the segment was configured with, in the same order, into as many `values`, each
/// as in `motorlink_st_output`. The payload has no register numbers: other registers of the same sizes, or
/// another order, are not detected.
///
/// `BAD_ARGUMENT`: the payload has not the size of these registers; `values` are unchanged.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_decode_segment(
    payload: *const u8,
    size: usize,
    registers: *const motorlink_st_reg,
    count: usize,
    values: *mut i32,
) -> motorlink_error {
    promised!(payload, registers, values);
    answer(|| {
        let (payload, registers) = (payload.slice(size)?, registers.slice(count)?);
        let values = values.places(count)?;
        let sizes = registers.iter().map(|&id| {
            let shape = RegisterId(id).shape().ok_or(motorlink_error::BadArgument);
            shape.map(|shape| usize::from(shape.ty(Profile::Spec).size()))
        });
        let mut total = 0usize;
        for size in sizes.clone() {
            total = total.saturating_add(size?);
        }
        if total != payload.len() {
            return Err(motorlink_error::BadArgument);
        }
        let mut rest = payload;
        for ((value, &id), size) in values.iter_mut().zip(registers).zip(sizes) {
            let (bytes, behind) = rest.split_at_checked(size?).unwrap_or((rest, &[]));
            value.write(RegisterId(id).decode(Profile::Spec, bytes).unwrap_or_default());
            rest = behind;
        }
        Ok(())
    })
}
