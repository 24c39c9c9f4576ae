//! Requests of a master: every function begins an exchange.

use motorlink_proto::st::{
    Command, CurrentReference, Effect, Frame, LimitError, MotorNumber, PositionMove, REVUP_PHASES,
    Ramp, RegisterId, Request, RequestError, TorqueRamp,
};

use super::master::State;
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
    begin(&mut state, motor, request)
}

/// Begins any request. A refused request changes nothing.
fn begin(state: &mut State, motor: u8, request: &Request<'_>) -> Result<(), motorlink_error> {
    check_motor(motor)?;
    let effect = state.account.check(state.master.counters(), motor, request).map_err(limited)?;
    state.master.request(motor, request).map_err(refused)?;
    state.send_stop_ahead(effect);
    state.account.sent(motor, effect);
    state.asked = match request {
        Request::GetRegister(register) => Some(*register),
        _ => None,
    };
    Ok(())
}

impl State {
    /// What stops a motor does not wait for the recovery of a lost line.
    fn send_stop_ahead(&mut self, effect: Effect) {
        if effect == Effect::Stops {
            self.master.send_ahead();
        }
    }
}

fn check_motor(motor: u8) -> Result<(), motorlink_error> {
    if motor <= MotorNumber::MAX { Ok(()) } else { Err(motorlink_error::BadArgument) }
}

fn limited(_: LimitError) -> motorlink_error {
    motorlink_error::Limit
}

fn refused(error: RequestError) -> motorlink_error {
    match error {
        RequestError::Busy => motorlink_error::Busy,
        RequestError::TooLong => motorlink_error::TooLong,
    }
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

/// Begins to write a register, with as many low bytes of `value` as it has; of a floating-point
/// register `value` is the bits. Any number is allowed.
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
        let size = register.write_size(state.profile);
        let bytes = value.to_le_bytes();
        let value = bytes.get(..usize::from(size)).unwrap_or(&bytes);
        begin(&mut state, motor, &Request::SetRegister { register, value })
    })
}

/// Begins to execute a command. Any number is allowed.
///
/// What stops a motor (STOP_MOTOR, SC_STOP) is sent at once if the line is lost or was just opened, then
/// the line is recovered, then it is sent again. The result is that of the second. If it is not
/// `MOTORLINK_OK`, begin again: the motor may still turn.
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
        check_motor(motor)?;
        let frame = Frame { header: Frame::header(code, motor), payload };
        if frame.code() != code {
            return Err(motorlink_error::BadArgument);
        }
        let counters = state.master.counters();
        let effect = state.account.check_frame(counters, &frame).map_err(limited)?;
        state.master.request_raw(frame.header, payload).map_err(refused)?;
        state.send_stop_ahead(effect);
        state.account.sent_frame(&frame, effect);
        state.asked = None;
        Ok(())
    })
}
