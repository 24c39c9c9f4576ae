//! The master's end: one exchange at a time.

use motorlink_proto::st::{
    Account, Confirmation, ExchangeError, Failure, LastExchange, Limits, MAX_PAYLOAD, Master,
    MasterConfig, Output, Profile, Recovery, SyncState,
};
use motorlink_proto::time::{Instant, Micros};

use super::exchange::State;
use super::motorlink_st_master;
use crate::bytes::{MOTORLINK_NEVER, motorlink_bytes, motorlink_output};
use crate::error::{answer, motorlink_error};
use crate::number::{
    limit, motorlink_st_error_code, motorlink_st_profile, motorlink_st_recovery, one_of,
};
use crate::pointer::{plain, promised};

/// How a master behaves. Begin with `motorlink_st_master_defaults()`, then change fields. A field that is 0
/// has its default.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_master_config {
    /// How long to wait for a reply, µs. 0: 1 s, as in the document.
    pub timeout_us: u32,
    /// The line counts as silent after this time without a byte, µs. 0: 50 ms.
    pub quiet_us: u32,
    /// The line's baud rate, for ports that take bytes faster than the line sends them, as ports of computers
    /// do. The silence of a recovery then begins when its bytes have left the port. 0: not known.
    pub baud: u32,
    /// How the drive behaves.
    pub profile: motorlink_st_profile,
    /// How the master recovers a line that is out of sync.
    pub recovery: motorlink_st_recovery,
}

/// What to do next, or the result of the exchange.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_output {
    /// `WAIT`: the latest moment for the next poll, `MOTORLINK_NEVER` outside of an exchange.
    pub until_us: u64,
    /// `TRANSMIT`: what to send. `DONE`: the payload of the reply. They belong to the master, until
    /// the next call for it.
    pub bytes: motorlink_bytes,
    /// `DONE`: whether the drive executed the request, or why not.
    pub result: motorlink_error,
    /// `DONE` of a register read: the register's value, the sign extended as its type has it; the
    /// bits of a floating-point register; of a register of type u32 the cast to `uint32_t` is the
    /// value. `motorlink_st_check_value` checks the profile. 0 for anything else.
    pub value: i32,
    /// What this is: `WAIT`, `TRANSMIT` or `DONE`.
    pub kind: motorlink_output,
    /// `DONE` with `REFUSED` or `NOT_UNDERSTOOD`: why, which may be a number that the document does
    /// not name.
    pub error_code: motorlink_st_error_code,
}

/// Limits of requests. They hold for every function.
///
/// While `speed_rpm` is set, a motor is started only after a speed ramp to it was acknowledged: else the
/// drive goes to a speed of its own. The ramp may be `motorlink_st_master_set_ramp` or a write of
/// RAMP_FINAL_SPEED. It no longer counts after a later ramp that was not acknowledged, after a torque
/// command, a write of CONTROL_MODE or a RESET, and after the drive identified itself anew or the line
/// was lost or opened again. Position commands carry no speed and are refused.
///
/// A limit bounds requests. `speed_rpm` does not bound a torque command (the motor turns as fast
/// as its load allows), speeds of the drive's own (rev-up, alignment, motor profiler), what its
/// regulator overshoots, a motor that was running before, nor a start after the drive was reset without
/// a sign on the line.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_st_limits {
    /// Highest speed in either direction, rpm, or `MOTORLINK_NO_LIMIT`.
    pub speed_rpm: i32,
    /// Highest reference of Iq or Id in either direction, s16A digits, or `MOTORLINK_NO_LIMIT`.
    pub current_s16a: i32,
}

plain!(motorlink_st_master_config, motorlink_st_limits);

/// The defaults: profile SPEC, the document's timeout of 1 s, DRAIN, 50 ms of silence, no baud rate.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_st_master_defaults() -> motorlink_st_master_config {
    let MasterConfig { timeout, quiet, profile, recovery } = MasterConfig::default();
    motorlink_st_master_config {
        timeout_us: timeout.0 as u32,
        quiet_us: quiet.0 as u32,
        baud: 0,
        profile: profile as u8,
        recovery: recovery as u8,
    }
}

/// Begins a master on a line that was just opened, whatever the storage held before. Replies to an
/// earlier master may still come. With recovery DRAIN or PAD, the master therefore waits for silence, asks
/// three questions and waits again before the first request. `motorlink_st_master_trust_line` skips that.
///
/// `size` is `sizeof *master`. `config` is copied; NULL: the defaults.
///
/// `BAD_ARGUMENT`: `profile` or `recovery` is not one of its enum's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_init(
    master: *mut motorlink_st_master,
    size: usize,
    config: *const motorlink_st_master_config,
) -> motorlink_error {
    promised!(master, config);
    answer(|| {
        let config = config.read_optional()?.unwrap_or_else(|| motorlink_st_master_defaults());
        let profile = one_of(&Profile::ALL, config.profile)?;
        let default = MasterConfig::default();
        let behaviour = MasterConfig {
            timeout: time_or(config.timeout_us, default.timeout),
            recovery: one_of(&Recovery::ALL, config.recovery)?,
            quiet: time_or(config.quiet_us, default.quiet),
            profile,
        };
        let behaviour = match config.baud {
            0 => behaviour,
            baud => behaviour.at_baud(baud),
        };
        let state = State {
            master: Master::new(behaviour),
            account: Account::default(),
            profile,
            asked: None,
            last: LastExchange::default(),
            confirmation: None,
        };
        master.init(size, state)
    })
}

fn time_or(us: u32, default: Micros) -> Micros {
    if us == 0 { default } else { Micros(us.into()) }
}

/// Sets the limits. Effective from the next request. Ramps that were acknowledged before no longer allow
/// a start.
///
/// `BAD_ARGUMENT`: a limit is neither `MOTORLINK_NO_LIMIT` nor 0 and more, of currents 0 to 65535.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_set_limits(
    master: *mut motorlink_st_master,
    limits: *const motorlink_st_limits,
) -> motorlink_error {
    promised!(master, limits);
    answer(|| {
        let motorlink_st_limits { speed_rpm, current_s16a } = limits.read()?;
        let (speed_rpm, current_s16a) = (limit(speed_rpm)?, limit(current_s16a)?);
        master.enter()?.account.set_limits(Limits { speed_rpm, current_s16a });
        Ok(())
    })
}

/// Gives what to do next. Poll again after each `TRANSMIT` (when the bytes are with the port) and each
/// `DONE`; after `WAIT` when bytes have arrived or the time is over.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_poll(
    master: *mut motorlink_st_master,
    now_us: u64,
    output: *mut motorlink_st_output,
) -> motorlink_error {
    promised!(master, output);
    answer(|| {
        let place = output.place()?;
        place.set(master.enter()?.poll(Instant(now_us))?);
        Ok(())
    })
}

impl State {
    fn poll(&mut self, now: Instant) -> Result<motorlink_st_output, motorlink_error> {
        loop {
            let (mut output, end) = self.poll_exchange(now);
            let Some(outcome) = end else { return Ok(output) };
            let Some(mut confirmation) = self.confirmation.take() else { return Ok(output) };
            if matches!(outcome, Err(ExchangeError::Refused(_)))
                && confirmation.repeat(&mut self.last)
            {
                self.ask(confirmation)?;
                continue;
            }
            output.result = self.confirmed(&confirmation, outcome);
            output.bytes = (&[][..]).into();
            output.error_code = 0;
            return Ok(output);
        }
    }

    /// What to do next, and the payload's size or the error if the exchange is over.
    fn poll_exchange(
        &mut self,
        now: Instant,
    ) -> (motorlink_st_output, Option<Result<usize, ExchangeError>>) {
        let mut output = motorlink_st_output {
            until_us: MOTORLINK_NEVER,
            bytes: (&[][..]).into(),
            result: motorlink_error::Ok,
            value: 0,
            kind: motorlink_output::Wait,
            error_code: 0,
        };
        let result = match self.master.poll(now) {
            Output::Wait(until) => {
                output.until_us = until.map_or(MOTORLINK_NEVER, |at| at.0);
                return (output, None);
            }
            Output::Transmit(bytes) => {
                output.kind = motorlink_output::Transmit;
                output.bytes = bytes.into();
                return (output, None);
            }
            Output::Done(result) => result,
        };
        output.kind = motorlink_output::Done;
        match result {
            Ok(payload) => {
                self.account.acknowledged();
                output.bytes = payload.into();
                match self.asked.map(|register| register.decode(self.profile, payload)) {
                    Some(Some(value)) => output.value = value,
                    Some(None) => output.result = motorlink_error::WrongReply,
                    None => {}
                }
            }
            Err(error) => (output.result, output.error_code) = failed(error),
        }
        let outcome = result.map(<[u8]>::len);
        self.last.finished(outcome.ok());
        if matches!(outcome, Err(ExchangeError::Failed(_))) {
            self.last.restart();
        }
        (output, Some(outcome))
    }

    fn confirmed(
        &mut self,
        confirmation: &Confirmation,
        outcome: Result<usize, ExchangeError>,
    ) -> motorlink_error {
        self.last.restart();
        match outcome {
            Ok(size) if confirmation.accepts(size) => {
                match confirmation.is_the_same(self.master.counters()) {
                    true => motorlink_error::Ok,
                    false => motorlink_error::Unconfirmed,
                }
            }
            _ => {
                self.master.lost();
                motorlink_error::Unconfirmed
            }
        }
    }
}

fn failed(error: ExchangeError) -> (motorlink_error, motorlink_st_error_code) {
    let failure = match error {
        ExchangeError::Refused(code) => return (motorlink_error::Refused, code.number()),
        ExchangeError::Failed(failure) => failure,
    };
    let result = match failure {
        Failure::NotUnderstood(code) => return (motorlink_error::NotUnderstood, code.number()),
        Failure::Timeout => motorlink_error::Timeout,
        Failure::Incomplete { .. } => motorlink_error::Incomplete,
        Failure::Header(_) => motorlink_error::NotAReply,
        Failure::Ambiguous => motorlink_error::Ambiguous,
        Failure::Size { .. } => motorlink_error::WrongReply,
        Failure::Lost => motorlink_error::Lost,
        Failure::Noise => motorlink_error::Noise,
        Failure::Echo => motorlink_error::Echo,
        _ => motorlink_error::Damaged,
    };
    (result, 0)
}

/// Takes bytes that came from the drive at `now_us`, in any pieces. `bytes` must not be in the storage.
///
/// Only `motorlink_st_master_poll` ends an exchange with TIMEOUT. If no poll came after the deadline, a reply
/// that is handed in now ends the exchange, because it may have waited in a buffer. Poll first if a reply
/// after the deadline must not count.
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

/// Cancels the exchange under way. Its reply may still come, so the line is out of sync.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_abandon(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        let mut state = master.enter()?;
        state.master.abandon();
        state.last.restart();
        Ok(())
    })
}

/// Marks the line as out of sync: something else has sent or received on it. An exchange under way ends
/// without a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_lost(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        let mut state = master.enter()?;
        state.master.lost();
        state.last.restart();
        Ok(())
    })
}

/// Call it after the line was opened again. Late replies may still come, as after
/// `motorlink_st_master_init`; with recovery NONE the caller guarantees that none come. An exchange under
/// way ends without a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_reopened(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        let mut state = master.enter()?;
        state.account.reopened();
        state.master.reopened();
        state.last.restart();
        Ok(())
    })
}

/// Marks the line as in sync: no late reply can come, because nothing was asked on it. An exchange under
/// way ends without a result.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_trust_line(
    master: *mut motorlink_st_master,
) -> motorlink_error {
    promised!(master);
    answer(|| {
        master.enter()?.master.trust_line();
        Ok(())
    })
}

/// Sets `lost` to 1 if the line is out of sync: it was just opened, or an exchange failed. The next
/// request then recovers it first. Sets `lost` to 0 otherwise.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_master_is_lost(
    master: *mut motorlink_st_master,
    lost: *mut u8,
) -> motorlink_error {
    promised!(master, lost);
    answer(|| {
        let place = lost.place()?;
        place.set(u8::from(master.enter()?.master.sync_state() == SyncState::Lost));
        Ok(())
    })
}

/// The longest payload.
pub const MOTORLINK_ST_MAX_PAYLOAD: usize = 128;
const _: () = assert!(MOTORLINK_ST_MAX_PAYLOAD == MAX_PAYLOAD);
