//! The host's end: many motors, an exchange each.

use motorlink_proto::rmd::{
    Failure, Host, Limits, MotorId, MotorSet, Output, RequestError, SetTorque4,
};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::{CentiDegrees, IqCommand, SpeedLimit};

use super::message::motorlink_rmd_data;
use super::motorlink_rmd_host;
use crate::bytes::{MOTORLINK_NEVER, motorlink_output};
use crate::error::{answer, motorlink_error};
use crate::frame::{NO_FRAME, motorlink_can_frame};
use crate::number::limit;
use crate::pointer::{plain, promised, storage};
use crate::tag;

/// Limits of requests to a motor, in addition to the document's ranges. Each holds in both directions.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_limits {
    /// Greatest torque current of 0xA1 and 0x280, 0.016 A a digit, or `MOTORLINK_NO_LIMIT`.
    pub current_16ma: i32,
    /// Greatest speed of 0xA2, 0xA4 and 0xA6, °/s, or `MOTORLINK_NO_LIMIT`. 0xA3 and 0xA5
    /// carry no speed and are refused while this is set, as are 0xA4 and 0xA6 with 0. It does not
    /// limit torque commands: the motor turns as fast as its load allows.
    pub speed_dps: i32,
    /// Greatest distance from zero in 0xA3 and 0xA4, 0.01° a digit, or `MOTORLINK_NO_LIMIT`.
    pub angle_centidegrees: i32,
}

/// What to do next, or the result of an exchange.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_rmd_output {
    /// `WAIT`: the latest moment for the next poll, `MOTORLINK_NEVER` outside of an exchange.
    pub until_us: u64,
    /// `TRANSMIT`: the frame to send.
    pub frame: motorlink_can_frame,
    /// `DONE`: the motor's reply, for the `motorlink_rmd_decode_*` functions.
    pub reply: motorlink_rmd_data,
    /// `DONE`: the result of the exchange.
    pub result: motorlink_error,
    /// What this is: `WAIT`, `TRANSMIT` or `DONE`.
    pub kind: motorlink_output,
    /// `DONE`: the motor, 1 to 32.
    pub motor: u8,
}

plain!(motorlink_rmd_limits);

/// What the storage of a host holds.
pub(crate) struct State {
    host: Host,
    /// When what was last refused may be asked again.
    retry: Instant,
}

storage!(motorlink_rmd_host: State, tag::RMD_HOST);

fn id(motor: u8) -> Result<MotorId, motorlink_error> {
    MotorId::new(motor).ok_or(motorlink_error::BadArgument)
}

impl State {
    fn refused(&mut self, refused: RequestError) -> motorlink_error {
        match refused {
            RequestError::Busy(_) => motorlink_error::Busy,
            RequestError::Quarantined { until, .. } => {
                self.retry = until;
                motorlink_error::Quarantined
            }
            RequestError::Limit { .. } => motorlink_error::Limit,
            RequestError::OutOfReach(_) => motorlink_error::BadArgument,
        }
    }
}

/// Begins a host, whatever the storage held before: 50 ms for a reply, 100 ms of quarantine, no
/// limits. `size` is `sizeof *host`. Replies to an earlier host may still come: the first request to
/// each motor is `QUARANTINED`, unless `motorlink_rmd_host_trust` was called.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_init(
    host: *mut motorlink_rmd_host,
    size: usize,
) -> motorlink_error {
    promised!(host);
    answer(|| host.init(size, State { host: Host::new(), retry: Instant(0) }))
}

/// Sets how long a reply may take, and how long after a timeout a late reply may still come. Effective
/// from the next request.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_set_times(
    host: *mut motorlink_rmd_host,
    timeout_us: u32,
    quarantine_us: u32,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        let mut state = host.enter()?;
        state.host.set_timeout(Micros(timeout_us.into()));
        state.host.set_quarantine(Micros(quarantine_us.into()));
        Ok(())
    })
}

/// Sets the limits of a motor. Effective from the next request.
///
/// `BAD_ARGUMENT`: `motor` is not 1 to 32, or a limit is neither `MOTORLINK_NO_LIMIT` nor in
/// the range of its kind: 0 to 32767, 0 to 65535, 0 and more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_set_limits(
    host: *mut motorlink_rmd_host,
    motor: u8,
    limits: *const motorlink_rmd_limits,
) -> motorlink_error {
    promised!(host, limits);
    answer(|| {
        let limits = limits.read()?;
        let limits = Limits {
            current: limit(limits.current_16ma)?.map(IqCommand),
            speed: limit(limits.speed_dps)?.map(SpeedLimit),
            angle: limit(limits.angle_centidegrees)?.map(CentiDegrees),
        };
        host.enter()?.host.set_limits(id(motor)?, limits);
        Ok(())
    })
}

/// Begins an exchange with a motor: `request` is what one of the functions for requests gives, or
/// any eight bytes.
///
/// A motor that did not answer before may be asked for its status instead; the exchange ends in
/// `QUARANTINED` then. So does the first one with each motor, in which it is asked for its status
/// by two different questions; when it was silent for the quarantine time the request is taken. Off and
/// Stop are taken and sent during a quarantine, unless it is their own late reply that is awaited;
/// to a motor that was not asked before they go out ahead of the questions.
///
/// `BAD_ARGUMENT`: `motor` is not 1 to 32. `BUSY`: its last exchange is not over. `LIMIT`: a limit
/// or the document's range is exceeded. `QUARANTINED`: ask again at the time that
/// `motorlink_rmd_host_retry` tells. Nothing is sent then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_request(
    host: *mut motorlink_rmd_host,
    now_us: u64,
    motor: u8,
    request: motorlink_rmd_data,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        let mut state = host.enter()?;
        let taken = state.host.request(Instant(now_us), id(motor)?, request.bytes);
        taken.map_err(|refused| state.refused(refused))
    })
}

/// Begins an exchange with motors 1 to 4 in one frame (0x280): a torque current each, 0.016 A a
/// digit. `expect` has a bit a motor that has to answer, bit 0 for motor 1. Each of them ends in a
/// `DONE`. All four are told; those that are not expected to answer are in quarantine afterwards.
/// Where one of `expect` did not answer before or was not asked before, each of them is asked for
/// its status instead.
///
/// As `motorlink_rmd_host_request`: `BUSY` and `LIMIT` of any of the four, `QUARANTINED` of `expect`.
/// `BAD_ARGUMENT`: a bit above 3 is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_set_torque4(
    host: *mut motorlink_rmd_host,
    now_us: u64,
    iq_16ma: *const i16,
    expect: u8,
) -> motorlink_error {
    promised!(host, iq_16ma);
    answer(|| {
        let &[one, two, three, four] = iq_16ma.slice(4)? else {
            return Err(motorlink_error::BadArgument);
        };
        if expect > 0b1111 {
            return Err(motorlink_error::BadArgument);
        }
        let torques = SetTorque4([one, two, three, four].map(IqCommand));
        let expect =
            MotorSet::TORQUE4.filter(|id| expect & 1u8.wrapping_shl(id.number() as u32 - 1) != 0);
        let expect = expect.collect();
        let mut state = host.enter()?;
        let taken = state.host.set_torque4(Instant(now_us), torques, expect);
        taken.map_err(|refused| state.refused(refused))
    })
}

/// When to ask again what was last refused with `QUARANTINED`; a reply may make it sooner or later.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_retry(
    host: *mut motorlink_rmd_host,
    at_us: *mut u64,
) -> motorlink_error {
    promised!(host, at_us);
    answer(|| {
        let place = at_us.place()?;
        place.set(host.enter()?.retry.0);
        Ok(())
    })
}

/// What to do next. Call until it is `WAIT`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_poll(
    host: *mut motorlink_rmd_host,
    now_us: u64,
    output: *mut motorlink_rmd_output,
) -> motorlink_error {
    promised!(host, output);
    answer(|| {
        let place = output.place()?;
        let mut output = motorlink_rmd_output {
            until_us: MOTORLINK_NEVER,
            frame: NO_FRAME,
            reply: motorlink_rmd_data { bytes: [0; 8] },
            result: motorlink_error::Ok,
            kind: motorlink_output::Wait,
            motor: 0,
        };
        match host.enter()?.host.poll(Instant(now_us)) {
            Output::Wait(until) => output.until_us = until.map_or(MOTORLINK_NEVER, |at| at.0),
            Output::Transmit(frame) => {
                output.kind = motorlink_output::Transmit;
                output.frame = frame.into();
            }
            Output::Done { id, result } => {
                output.kind = motorlink_output::Done;
                output.motor = id.number();
                match result {
                    Ok(bytes) => output.reply = motorlink_rmd_data { bytes },
                    Err(Failure::Foreign(_)) => output.result = motorlink_error::Foreign,
                    Err(Failure::Altered) => output.result = motorlink_error::Altered,
                    Err(Failure::Quarantined) => output.result = motorlink_error::Quarantined,
                    Err(Failure::Echo) => output.result = motorlink_error::Echo,
                    Err(_) => output.result = motorlink_error::Timeout,
                }
            }
        }
        place.set(output);
        Ok(())
    })
}

/// Takes a frame that came from the bus at `now_us`. Frames that belong to no exchange are dropped.
/// An adapter that echoes what was sent looks like a motor that answers: drop its echoes.
///
/// `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_receive(
    host: *mut motorlink_rmd_host,
    now_us: u64,
    frame: *const motorlink_can_frame,
) -> motorlink_error {
    promised!(host, frame);
    answer(|| {
        let frame = frame.read()?.try_into()?;
        host.enter()?.host.receive(Instant(now_us), &frame);
        Ok(())
    })
}

/// Gives up the exchange with a motor without a result, so that another request can be made. A frame
/// of `motorlink_rmd_host_set_torque4` that still waits and would reach the motor is given up for all.
///
/// `BAD_ARGUMENT`: `motor` is not 1 to 32.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_cancel(
    host: *mut motorlink_rmd_host,
    now_us: u64,
    motor: u8,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        host.enter()?.host.cancel(Instant(now_us), id(motor)?);
        Ok(())
    })
}

/// Tells that these motors owe no earlier host a reply, so that no question goes before the first
/// request: a bit each, bit 0 for motor 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_trust(
    host: *mut motorlink_rmd_host,
    motors: u32,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        host.enter()?.host.trust(MotorSet::from_bits(motors));
        Ok(())
    })
}

/// Tells that the bus was opened anew: what the motors may still answer is not known, as after
/// `motorlink_rmd_host_init`. Exchanges under way end without a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_reopened(
    host: *mut motorlink_rmd_host,
    now_us: u64,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        host.enter()?.host.reopened(Instant(now_us));
        Ok(())
    })
}

/// The motors with an exchange under way: a bit each, bit 0 for motor 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_busy(
    host: *mut motorlink_rmd_host,
    motors: *mut u32,
) -> motorlink_error {
    promised!(host, motors);
    answer(|| {
        let place = motors.place()?;
        place.set(host.enter()?.host.busy().bits());
        Ok(())
    })
}
