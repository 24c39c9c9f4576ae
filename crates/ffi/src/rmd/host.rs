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
use crate::tag::Kind;

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
    /// When to ask again after the last `QUARANTINED`.
    retry: Instant,
    /// Motors with a confirmation under way.
    confirming: MotorSet,
}

storage!(motorlink_rmd_host: State, Kind::RmdHost);

fn id(motor: u8) -> Result<MotorId, motorlink_error> {
    MotorId::new(motor).ok_or(motorlink_error::BadArgument)
}

impl State {
    fn request(&mut self, now: Instant, id: MotorId, data: [u8; 8]) -> Result<(), motorlink_error> {
        self.host.request(now, id, data).map_err(|refused| self.refused(refused))
    }

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
    answer(|| {
        host.init(size, State { host: Host::new(), retry: Instant(0), confirming: MotorSet::EMPTY })
    })
}

/// Sets how long a reply may take, and how long after a timeout a late reply may still come. Effective
/// from the next request.
///
/// `BAD_ARGUMENT`: a time is 0. Without quarantine a late reply would be taken for another request's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_set_times(
    host: *mut motorlink_rmd_host,
    timeout_us: u32,
    quarantine_us: u32,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        if timeout_us == 0 || quarantine_us == 0 {
            return Err(motorlink_error::BadArgument);
        }
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
/// by two different questions; when it was silent for the quarantine time the request is taken.
///
/// Off and Stop are also sent during a quarantine. Exception: if the reply to an earlier Off is missing,
/// another Off gives `QUARANTINED` until the quarantine is over; the same for Stop. To a motor that was not
/// asked before, Off and Stop are sent before the questions.
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
    answer(|| host.enter()?.request(Instant(now_us), id(motor)?, request.bytes))
}

/// Begins a confirmation: a question to a motor that shows whether its replies since the last confirmation
/// belong to their own requests. A reply that comes twice answers the next request with the same code, which
/// no other exchange detects. Confirm what you read before you rely on it, and a stop before the program
/// ends.
///
/// The result is `MOTORLINK_OK`, `UNCONFIRMED`, or an error of the question. If it is not `MOTORLINK_OK`, do
/// not use what the motor replied since the last confirmation.
///
/// `BAD_ARGUMENT`, `BUSY`, `QUARANTINED`: as `motorlink_rmd_host_request`. Nothing is sent then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_confirm(
    host: *mut motorlink_rmd_host,
    now_us: u64,
    motor: u8,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        let mut state = host.enter()?;
        let id = id(motor)?;
        let question = state.host.confirmation(id);
        state.request(Instant(now_us), id, question)?;
        state.confirming.insert(id);
        Ok(())
    })
}

/// Begins an exchange with motors 1 to 4 in one frame (0x280): a torque current each, 0.016 A a
/// digit. `expect` has a bit for each motor that has to answer, bit 0 for motor 1. Each of them ends in a
/// `DONE`. The frame reaches all four motors. Those that are not in `expect` are in quarantine afterwards.
/// If a motor of `expect` did not answer its last request, or was not asked before, the frame is not sent:
/// each motor of `expect` is asked for its status, and its exchange ends in `QUARANTINED`.
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

/// Gives when to ask again after the last `QUARANTINED`, of a call or of an exchange, of any motor. Call it
/// before the next call for another motor. A reply may move the moment.
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
        let mut state = host.enter()?;
        let State { host, retry, confirming } = &mut *state;
        match host.poll(Instant(now_us)) {
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
                    Err(Failure::Quarantined) => {
                        output.result = motorlink_error::Quarantined;
                        *retry = Instant(now_us) + host.quarantine();
                    }
                    Err(Failure::Echo) => output.result = motorlink_error::Echo,
                    Err(_) => output.result = motorlink_error::Timeout,
                }
                if confirming.contains(id) {
                    confirming.remove(id);
                    if result.is_ok() && host.take_stray(id) {
                        output.result = motorlink_error::Unconfirmed;
                    }
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

/// Cancels the exchange with a motor, without a result. Another request can then be made. A frame of
/// `motorlink_rmd_host_set_torque4` that is not yet sent and would reach the motor is cancelled for all.
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
        let mut state = host.enter()?;
        let id = id(motor)?;
        state.host.cancel(Instant(now_us), id);
        state.confirming.remove(id);
        Ok(())
    })
}

/// Marks these motors as without a pending reply to an earlier host. No question is then sent before the
/// first request. `motors` has a bit for each, bit 0 for motor 1.
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

/// Call it after the bus was opened again. Late replies may still come, as after
/// `motorlink_rmd_host_init`. Exchanges under way end without a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_host_reopened(
    host: *mut motorlink_rmd_host,
    now_us: u64,
) -> motorlink_error {
    promised!(host);
    answer(|| {
        let mut state = host.enter()?;
        state.host.reopened(Instant(now_us));
        state.confirming = MotorSet::EMPTY;
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
