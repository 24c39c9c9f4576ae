//! Requests of a master: every function begins an exchange.

use motorlink_proto::st::{
    Command, CurrentReference, PositionMove, REVUP_PHASES, Ramp, RegisterId, Request, TorqueRamp,
};

use super::message::motorlink_st_revup_phase;
use super::motorlink_st_master;
use crate::error::{answer, motorlink_error};
use crate::number::{motorlink_st_command, motorlink_st_frame_code, motorlink_st_reg};
use crate::pointer::{Out, promised};

/// Begins an exchange.
fn request(
    master: Out<motorlink_st_master>,
    motor: u8,
    request: &Request<'_>,
) -> Result<(), motorlink_error> {
    let mut state = master.enter()?;
    state.begin(motor, request)
}

/// Begins to read a register; `value` of the result is its value. Any number is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_get_register(
    master: *mut motorlink_st_master,
    motor: u8,
    reg: motorlink_st_reg,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::GetRegister(RegisterId(reg))))
}

/// Begins to write a register. Of a floating-point register `value` is the bits, of a register of type u32
/// the value's cast to `int32_t`. Registers without a name are allowed; they are written with 4 bytes.
///
/// `BAD_ARGUMENT`: `motor` is over 7, or `value` is outside of the range of the register's type.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_register(
    master: *mut motorlink_st_master,
    motor: u8,
    reg: motorlink_st_reg,
    value: i32,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        let mut state = master.enter()?;
        let register = RegisterId(reg);
        if !register.holds(state.profile, value) {
            return Err(motorlink_error::BadArgument);
        }
        let size = register.write_size(state.profile);
        let bytes = value.to_le_bytes();
        let value = bytes.get(..usize::from(size)).unwrap_or(&bytes);
        state.begin(motor, &Request::SetRegister { register, value })
    })
}

/// Begins to execute a command. Any number is allowed.
///
/// A drive also acknowledges START_MOTOR and FAULT_ACK if they have no effect. After START_MOTOR read
/// STATUS: FAULT_NOW and FAULT_OVER mean that the motor did not start because of the faults in FLAGS,
/// ANY_STOP, STOP, STOP_IDLE and WAIT_STOP_MOTOR that it is still stopping. The motor starts in its
/// control mode, which a stop does not change: in torque mode with the last current reference.
///
/// What stops a motor (STOP_MOTOR, SC_STOP) is sent at once if the line is lost or was just opened, then
/// the line is recovered, then it is sent again. The result is that of the second. If it is not
/// `MOTORLINK_OK`, begin again: the motor may still turn. A drive acknowledges START_MOTOR also where it has
/// no effect: while the motor runs, is stopping or is in fault. Read STATUS.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_execute(
    master: *mut motorlink_st_master,
    motor: u8,
    command: motorlink_st_command,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::ExecuteCommand(Command::from(command))))
}

/// Begins to program a speed ramp (4.8): to `speed_rpm` in `duration_ms`; 0 ms is a step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_ramp(
    master: *mut motorlink_st_master,
    motor: u8,
    speed_rpm: i32,
    duration_ms: u16,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::SetRamp(Ramp { speed_rpm, duration_ms })))
}

/// Begins to set the references of Iq and Id (4.11), s16A digits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_current_reference(
    master: *mut motorlink_st_master,
    motor: u8,
    iq_s16a: i16,
    id_s16a: i16,
) -> motorlink_error {
    promised!(master);
    let reference = CurrentReference { iq_s16a, id_s16a };
    answer(|| request(master, motor, &Request::SetCurrentReference(reference)))
}

/// Begins to program a torque ramp (profile MCSDK 5.4): to `torque_s16a` in `duration_ms`; 0 ms is
/// a step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_torque_ramp(
    master: *mut motorlink_st_master,
    motor: u8,
    torque_s16a: i32,
    duration_ms: u16,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        request(master, motor, &Request::SetTorqueRamp(TorqueRamp { torque_s16a, duration_ms }))
    })
}

/// Begins a move to `angle_rad` in `duration_s` (profile MCSDK 5.4).
///
/// `BAD_ARGUMENT`: `motor` is over 7, or a value is not finite.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_position(
    master: *mut motorlink_st_master,
    motor: u8,
    angle_rad: f32,
    duration_s: f32,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        if !angle_rad.is_finite() || !duration_s.is_finite() {
            return Err(motorlink_error::BadArgument);
        }
        request(master, motor, &Request::SetPosition(PositionMove { angle_rad, duration_s }))
    })
}

/// Begins to read rev-up phase 0 to 4 (4.9); `motorlink_st_decode_revup_data` reads the result.
///
/// `BAD_ARGUMENT`: `motor` is over 7, or `phase` over 4.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_get_revup_data(
    master: *mut motorlink_st_master,
    motor: u8,
    phase: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::GetRevupData(check_phase(phase)?)))
}

fn check_phase(phase: u8) -> Result<u8, motorlink_error> {
    if phase < REVUP_PHASES { Ok(phase) } else { Err(motorlink_error::BadArgument) }
}

/// Begins to write rev-up phase 0 to 4 (4.10). `data` is copied.
///
/// `BAD_ARGUMENT`: `motor` is over 7, or `phase` over 4.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_revup_data(
    master: *mut motorlink_st_master,
    motor: u8,
    phase: u8,
    data: *const motorlink_st_revup_phase,
) -> motorlink_error {
    promised!(master, data);
    answer(|| {
        let data = data.read()?.into();
        request(master, motor, &Request::SetRevupData(check_phase(phase)?, data))
    })
}

/// Begins to read the SDK's version and name (4.7); `motorlink_st_decode_board_info` reads the
/// result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_get_board_info(
    master: *mut motorlink_st_master,
    motor: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::GetBoardInfo))
}

/// Begins to read the firmware's version (4.12); `motorlink_st_decode_firmware_version` reads the
/// result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_get_firmware_version(
    master: *mut motorlink_st_master,
    motor: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::GetFirmwareVersion))
}

/// Begins to choose the registers of a data segment (profile SPEC): `count` numbers, which are
/// copied. A slave of this library has segments 0 to 3, of up to 32 registers each.
///
/// `TOO_LONG`: over 127 registers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_configure_segment(
    master: *mut motorlink_st_master,
    motor: u8,
    segment: u8,
    registers: *const motorlink_st_reg,
    count: usize,
) -> motorlink_error {
    promised!(master, registers);
    answer(|| {
        let registers = registers.slice(count)?;
        request(master, motor, &Request::ConfigureSegment { segment, registers })
    })
}

/// Begins to read a data segment (profile SPEC): the values of its registers in their order,
/// little-endian, each in its own size.
///
/// `LIMIT`: this master has not configured the segment since the port was opened. Nothing is sent:
/// shipped firmware reads this request as a torque ramp.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_get_segment(
    master: *mut motorlink_st_master,
    motor: u8,
    segment: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::GetSegment(segment)))
}

/// Begins to ask which registers steps of the motor profiler show (profile MCSDK 5.4): `count`
/// numbers of steps, which are copied. The result has the count and the registers of each step.
///
/// `TOO_LONG`: over 128 steps.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_get_profiler_info(
    master: *mut motorlink_st_master,
    motor: u8,
    steps: *const u8,
    count: usize,
) -> motorlink_error {
    promised!(master, steps);
    answer(|| request(master, motor, &Request::GetProfilerInfo(steps.slice(count)?)))
}

/// Begins a confirmation: a question that shows whether the replies since the last confirmation belong to
/// their own requests. A reply that comes twice, or late, shifts all later replies by one, which no other
/// exchange detects. Confirm what you read before you rely on it, and a stop before the program ends.
///
/// The result is `MOTORLINK_OK` or `UNCONFIRMED`. After `UNCONFIRMED` do not use what was read or
/// acknowledged since the last confirmation; the line is recovered before the next request.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_confirm(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        let mut state = master.enter()?;
        let confirmation = state.last.confirm();
        state.ask(confirmation)
    })
}

/// Begins an exchange with any frame code and any payload of up to 128 bytes, which is copied.
///
/// `BAD_ARGUMENT`: `motor` is over 7, or `code` over 31. `TOO_LONG`: over 128 bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_raw(
    master: *mut motorlink_st_master,
    motor: u8,
    code: motorlink_st_frame_code,
    payload: *const u8,
    size: usize,
) -> motorlink_error {
    promised!(master, payload);
    answer(|| {
        let payload = payload.slice(size)?;
        let mut state = master.enter()?;
        state.begin_raw(motor, code, payload)
    })
}
