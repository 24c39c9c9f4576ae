//! The master's end: one exchange at a time.

use motorlink_proto::stmcp::{
    Command, Config, CurrentReference, Error, Failure, Line, MAX_PAYLOAD, Master, Motor, Output,
    PositionMove, Profile, REVUP_PHASES, Ramp, Recovery, RegisterId, Request, RequestError,
    TorqueRamp,
};
use motorlink_proto::time::{Duration, Instant};

use super::message::motorlink_st_revup_phase;
use super::{motorlink_st_master, profile};
use crate::bytes::{MOTORLINK_NEVER, motorlink_action, motorlink_bytes};
use crate::error::{answer, motorlink_error};
use crate::pointer::{Out, plain, promised};

/// How a line comes back on which an exchange failed.
#[repr(u8)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum motorlink_st_recovery {
    /// Not by itself: `motorlink_st_master_reopened` says that the caller opened it anew.
    None = 0,
    /// Waits for silence, asks a question, goes on when it was answered.
    Drain = 1,
    /// As `DRAIN`, behind bytes that complete a frame which a 5.x drive may still be waiting for.
    Pad = 2,
}

/// How a master behaves.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_master_config {
    /// How long to wait for a reply, µs.
    pub timeout_us: u32,
    /// The silence after which nothing more is expected to come, µs.
    pub quiet_us: u32,
    /// How the drive behaves: one of `motorlink_st_profile`.
    pub profile: u8,
    /// How a lost line comes back: one of `motorlink_st_recovery`.
    pub recovery: u8,
}

/// What to do next, or what became of the exchange.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_action {
    /// `WAIT`: the latest moment for the next poll; `MOTORLINK_NEVER` while there is no exchange.
    pub until_us: u64,
    /// `TRANSMIT`: what to send. `DONE`: the payload of the reply. They belong to the master, until
    /// the next call for it.
    pub bytes: motorlink_bytes,
    /// `DONE`: whether the drive did what was asked, and why not.
    pub result: motorlink_error,
    /// `DONE` of a register read: the register's value, the sign extended as its type has it; the
    /// bits of a floating-point register. 0 for anything else.
    pub value: i32,
    /// What this is: `WAIT`, `TRANSMIT` or `DONE`.
    pub kind: motorlink_action,
    /// `DONE` with `REFUSED` or `NOT_UNDERSTOOD`: one of `motorlink_st_refusal`, or a number that
    /// the document does not name.
    pub refusal: u8,
}

plain!(motorlink_st_master_config);

/// What the storage of a master holds.
pub(crate) struct State {
    master: Master,
    profile: Profile,
    /// The register whose value is asked for.
    asked: Option<RegisterId>,
}

/// The defaults: profile SPEC, the document's timeout of 1 s, DRAIN, 50 ms of silence.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_master_defaults() -> motorlink_st_master_config {
    let Config { timeout, quiet, .. } = Config::default();
    motorlink_st_master_config {
        timeout_us: timeout.0 as u32,
        quiet_us: quiet.0 as u32,
        profile: super::motorlink_st_profile::Spec as u8,
        recovery: motorlink_st_recovery::Drain as u8,
    }
}

/// Begins a master on a line that is up, whatever the storage held before.
///
/// `size` is `sizeof *master`. `config` is copied; NULL: the defaults.
///
/// `BAD_ARGUMENT`: `profile` or `recovery` is
/// not one of its enum's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_init(
    master: *mut motorlink_st_master,
    size: usize,
    config: *const motorlink_st_master_config,
) -> motorlink_error {
    promised!(master, config);
    answer(|| {
        let config = config.read_optional()?.unwrap_or_else(|| motorlink_st_master_defaults());
        let profile = self::profile(config.profile)?;
        let config = Config {
            timeout: Duration(config.timeout_us.into()),
            recovery: recovery(config.recovery)?,
            quiet: Duration(config.quiet_us.into()),
        };
        master.init(size, State { master: Master::new(config), profile, asked: None })
    })
}

fn recovery(number: u8) -> Result<Recovery, motorlink_error> {
    const NONE: u8 = motorlink_st_recovery::None as u8;
    const DRAIN: u8 = motorlink_st_recovery::Drain as u8;
    const PAD: u8 = motorlink_st_recovery::Pad as u8;
    match number {
        NONE => Ok(Recovery::None),
        DRAIN => Ok(Recovery::Drain),
        PAD => Ok(Recovery::Pad),
        _ => Err(motorlink_error::BadArgument),
    }
}

/// Begins an exchange; all requests end here.
fn request(
    master: Out<motorlink_st_master>,
    motor: u8,
    request: &Request<'_>,
) -> Result<(), motorlink_error> {
    let mut state = master.enter()?;
    check_motor(motor)?;
    state.master.request(motor, request).map_err(refused)?;
    state.asked = match request {
        Request::GetRegister(register) => Some(*register),
        _ => None,
    };
    Ok(())
}

fn check_motor(motor: u8) -> Result<(), motorlink_error> {
    if motor <= Motor::MAX { Ok(()) } else { Err(motorlink_error::BadArgument) }
}

fn refused(error: RequestError) -> motorlink_error {
    match error {
        RequestError::Busy => motorlink_error::Busy,
        RequestError::TooLong => motorlink_error::TooLong,
    }
}

/// Begins to read a register; `value` of the result is its value. Any number is taken.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_get_register(
    master: *mut motorlink_st_master,
    motor: u8,
    reg: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::GetRegister(RegisterId(reg))))
}

/// Begins to write a register, with as many low bytes of `value` as it has; of a floating-point
/// register `value` is the bits. Any number is taken.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_register(
    master: *mut motorlink_st_master,
    motor: u8,
    reg: u8,
    value: i32,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        let mut state = master.enter()?;
        check_motor(motor)?;
        let register = RegisterId(reg);
        let size = register.write_size(state.profile);
        let bytes = value.to_le_bytes();
        let value = bytes.get(..usize::from(size)).unwrap_or(&bytes);
        state.asked = None;
        let request = Request::SetRegister { register, value };
        state.master.request(motor, &request).map_err(refused)
    })
}

/// Begins to have a command executed, one of `motorlink_st_command`. Any number is taken.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_execute(
    master: *mut motorlink_st_master,
    motor: u8,
    command: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::Execute(Command::from(command))))
}

/// Begins to program a speed ramp (4.8): to `speed_rpm` in `duration_ms`; 0 ms is a step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_ramp(
    master: *mut motorlink_st_master,
    motor: u8,
    speed_rpm: i32,
    duration_ms: u16,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::Ramp(Ramp { speed_rpm, duration_ms })))
}

/// Begins to set the references of Iq and Id (4.11), s16A digits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_current(
    master: *mut motorlink_st_master,
    motor: u8,
    iq_s16a: i16,
    id_s16a: i16,
) -> motorlink_error {
    promised!(master);
    let reference = CurrentReference { iq_s16a, id_s16a };
    answer(|| request(master, motor, &Request::CurrentReference(reference)))
}

/// Begins to program a torque ramp (profile MCSDK 5.4): to `torque_s16a` in `duration_ms`; 0 ms is
/// a step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_torque_ramp(
    master: *mut motorlink_st_master,
    motor: u8,
    torque_s16a: i32,
    duration_ms: u16,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::TorqueRamp(TorqueRamp { torque_s16a, duration_ms })))
}

/// Begins a move to `angle_rad` in `duration_s` (profile MCSDK 5.4).
///
/// `BAD_ARGUMENT`: `motor` is over 7, or a value is not finite.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_move(
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
        request(master, motor, &Request::Position(PositionMove { angle_rad, duration_s }))
    })
}

/// Begins to read rev-up phase 0 to 4 (4.9); `motorlink_st_decode_revup` reads the result.
///
/// `BAD_ARGUMENT`: `motor` is over 7, or `phase` over 4.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_revup(
    master: *mut motorlink_st_master,
    motor: u8,
    phase: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::RevupData(check_phase(phase)?)))
}

fn check_phase(phase: u8) -> Result<u8, motorlink_error> {
    if phase < REVUP_PHASES { Ok(phase) } else { Err(motorlink_error::BadArgument) }
}

/// Begins to write rev-up phase 0 to 4 (4.10). `data` is copied.
///
/// `BAD_ARGUMENT`: `motor` is over 7, or `phase` over 4.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_revup(
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
pub unsafe extern "C" fn motorlink_st_master_board_info(
    master: *mut motorlink_st_master,
    motor: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::BoardInfo))
}

/// Begins to read the firmware's version (4.12); `motorlink_st_decode_firmware_version` reads the
/// result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_firmware_version(
    master: *mut motorlink_st_master,
    motor: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::FirmwareVersion))
}

/// Begins to choose the registers of a data segment (profile SPEC): `count` numbers, which are
/// copied.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_configure_segment(
    master: *mut motorlink_st_master,
    motor: u8,
    segment: u8,
    registers: *const u8,
    count: usize,
) -> motorlink_error {
    promised!(master, registers);
    answer(|| {
        let registers = registers.slice(count)?;
        request(master, motor, &Request::ConfigDynStruct { segment, registers })
    })
}

/// Begins to read a data segment (profile SPEC): the values of its registers, one behind the other,
/// little-endian, in the size that each has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_read_segment(
    master: *mut motorlink_st_master,
    motor: u8,
    segment: u8,
) -> motorlink_error {
    promised!(master);
    answer(|| request(master, motor, &Request::DataElement(segment)))
}

/// Begins to ask which registers steps of the motor profiler show (profile MCSDK 5.4): `count`
/// numbers of steps, which are copied. The result has the count and the registers of each step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_profiler_info(
    master: *mut motorlink_st_master,
    motor: u8,
    steps: *const u8,
    count: usize,
) -> motorlink_error {
    promised!(master, steps);
    answer(|| request(master, motor, &Request::ProfilerInfo(steps.slice(count)?)))
}

/// Begins an exchange with any header (5 bits of `motorlink_st_frame`, 3 bits of motor) and any
/// payload of up to 128 bytes, which is copied.
///
/// `TOO_LONG`: over 128 bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_raw(
    master: *mut motorlink_st_master,
    header: u8,
    payload: *const u8,
    size: usize,
) -> motorlink_error {
    promised!(master, payload);
    answer(|| {
        let payload = payload.slice(size)?;
        let mut state = master.enter()?;
        state.asked = None;
        state.master.request_raw(header, payload).map_err(refused)
    })
}

/// How long the longest thing that a master sends takes at `baud`, µs. Where the port takes bytes
/// faster than the line carries them, add this to `quiet_us`.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_longest_transmission_us(baud: u32) -> u64 {
    Master::longest_transmission(baud).0
}

/// What to do next. Poll again after each `TRANSMIT` (when the bytes are with the port) and each
/// `DONE`; after `WAIT` when something came or the time is over.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_poll(
    master: *mut motorlink_st_master,
    now_us: u64,
    action: *mut motorlink_st_action,
) -> motorlink_error {
    promised!(master, action);
    answer(|| {
        let place = action.place()?;
        let mut state = master.enter()?;
        let asked = state.asked;
        let mut action = motorlink_st_action {
            until_us: MOTORLINK_NEVER,
            bytes: (&[][..]).into(),
            result: motorlink_error::Ok,
            value: 0,
            kind: motorlink_action::Wait,
            refusal: 0,
        };
        match state.master.poll(Instant(now_us)) {
            Output::Wait(until) => action.until_us = until.map_or(MOTORLINK_NEVER, |at| at.0),
            Output::Transmit(bytes) => {
                action.kind = motorlink_action::Transmit;
                action.bytes = bytes.into();
            }
            Output::Done(result) => {
                action.kind = motorlink_action::Done;
                match result {
                    Ok(payload) => {
                        action.bytes = payload.into();
                        let value = asked.and_then(|register| register.decode(payload));
                        action.value = value.unwrap_or_default();
                    }
                    Err(error) => (action.result, action.refusal) = failed(error),
                }
            }
        }
        place.set(action);
        Ok(())
    })
}

fn failed(error: Error) -> (motorlink_error, u8) {
    let failure = match error {
        Error::Refused(code) => return (motorlink_error::Refused, code.number()),
        Error::Failed(failure) => failure,
    };
    let result = match failure {
        Failure::NotUnderstood(code) => return (motorlink_error::NotUnderstood, code.number()),
        Failure::Timeout => motorlink_error::Timeout,
        Failure::Incomplete { .. } => motorlink_error::Incomplete,
        Failure::Header(_) => motorlink_error::NotAReply,
        Failure::Ambiguous => motorlink_error::Ambiguous,
        Failure::Lost => motorlink_error::Lost,
        Failure::Noise => motorlink_error::Noise,
        _ => motorlink_error::Damaged,
    };
    (result, 0)
}

/// Takes what came from the drive at `now_us`, in any pieces. `bytes` may not lie in the storage.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_receive(
    master: *mut motorlink_st_master,
    now_us: u64,
    bytes: *const u8,
    size: usize,
) -> motorlink_error {
    promised!(master, bytes);
    answer(|| {
        let bytes = bytes.slice(size)?;
        master.enter()?.master.receive(Instant(now_us), bytes);
        Ok(())
    })
}

/// Gives up the exchange under way. Its reply may still come, so the line is lost.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_abandon(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        master.enter()?.master.abandon();
        Ok(())
    })
}

/// Tells that the line is out of step: something was sent or received beside the master. An
/// exchange under way ends without a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_lost(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        master.enter()?.master.lost();
        Ok(())
    })
}

/// Tells that the line was closed and opened again, with nothing left in it from before. An
/// exchange under way ends without a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_reopened(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        master.enter()?.master.reopened();
        Ok(())
    })
}

/// Sets `lost` to 1 where an exchange failed and the next one has to recover the line first, and to
/// 0 where the last one ended in step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_is_lost(
    master: *mut motorlink_st_master,
    lost: *mut u8,
) -> motorlink_error {
    promised!(master, lost);
    answer(|| {
        let place = lost.place()?;
        place.set(u8::from(master.enter()?.master.line() == Line::Lost));
        Ok(())
    })
}

/// The longest payload.
pub const MOTORLINK_ST_MAX_PAYLOAD: usize = 128;
const _: () = assert!(MOTORLINK_ST_MAX_PAYLOAD == MAX_PAYLOAD);
