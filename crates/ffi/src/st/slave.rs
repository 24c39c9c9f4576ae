//! The slave: takes bytes, calls a table of callbacks, gives replies.

use core::ffi::{c_char, c_void};
use core::ptr;

use motorlink_proto::st::{
    Command, CurrentReference, ErrorCode, Feature, Features, MotorControl, MotorNumber,
    PositionMove, Profile, Ramp, RegisterId, RevupPhase, Slave, TorqueRamp, Version,
};
use motorlink_proto::time::Instant;

use super::message::motorlink_st_revup_phase;
use super::motorlink_st_slave;
use crate::bytes::{MOTORLINK_NEVER, motorlink_bytes};
use crate::error::{answer, motorlink_error};
use crate::number::{
    motorlink_st_command, motorlink_st_error_code, motorlink_st_profile, motorlink_st_reg, one_of,
};
use crate::pointer::{Kept, ascii, plain, promised, same_layout, storage};
use crate::tag::Kind;

/// The firmware's version, as board information (4.7) and firmware version (4.12) tell it.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_version {
    /// Name of the SDK, ASCII, NUL-terminated; the replies have room for 28 and 15 bytes of it.
    /// NULL: no name.
    pub name: *const c_char,
    /// Type and number of a pre-release, such as "RC2", ASCII, NUL-terminated. NULL: a release.
    pub pre_release: *const c_char,
    /// Major version.
    pub major: u8,
    /// Minor version.
    pub minor: u8,
    /// Patch version.
    pub patch: u8,
}

/// The drive behind a slave. The slave has checked the frame, the motor, the register's existence and
/// access, and every size before it calls.
///
/// `execute` is required. Every other callback may be NULL. Callbacks are called from within
/// `motorlink_st_slave_receive`, and may not call for the same slave: such calls give `IN_USE`. `motor`
/// is 1 to 7, and exists.
///
/// `motorlink conformance st` checks such a drive. What it asks of a callback beyond the document is
/// a reading: a row of SPEC-NOTES.md, named in brackets. A drive that differs from readings
/// passes, and fails with `--readings strict`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_st_motor_control {
    /// Handed to each callback.
    pub context: *mut c_void,
    /// The firmware's version.
    pub version: motorlink_st_version,
    /// What this motor's control is built with: a sum of `MOTORLINK_ST_FEATURE_*`.
    /// NULL: nothing.
    pub features: Option<extern "C" fn(context: *mut c_void, motor: u8) -> u16>,
    /// The value of a register that exists with `features`. Not called for TARGET_MOTOR, which
    /// the slave keeps. FLUXWK_BUS and FLUXWK_BUS_MEAS have 0.1 % a digit here and in
    /// `set_register`, in both profiles; the slave converts. The value of a floating-point register is
    /// its bits. NULL: 0.
    ///
    /// STATUS is IDLE at rest and RUN once the motor runs, FAULT_NOW and FAULT_OVER in fault; FLAGS
    /// has the faults that occurred in the low half and those present in the high half (S14).
    /// CONTROL_MODE reads what was asked for last, at once: speed after a ramp, torque after
    /// current references (S15, S25). At rest TORQUE_REF and FLUX_REF read what was asked for last
    /// and SPEED_REF is 0; in RUN SPEED_REF follows the ramp (S48). In speed mode FLUX_REF reads what
    /// was written to IQ_SPEEDMODE (S22). RAMP_FINAL_SPEED is the end of the last ramp (S26).
    /// PFC_ENABLED is 0 or 1 (S50). Temperatures and power may be below 0 (S23).
    pub get_register:
        Option<extern "C" fn(context: *mut c_void, motor: u8, reg: motorlink_st_reg) -> i32>,
    /// Writes a register that may be written; gives `MOTORLINK_ST_ERROR_CODE_NONE`, or why not:
    /// WRONG_SET for a value that the register cannot take. NULL: WRONG_SET.
    ///
    /// Not called for TARGET_MOTOR, nor for a DAC channel with a register that it cannot show. Every
    /// value of the register's type is taken and read back, 70002 rpm too (S49): limit what the motor
    /// does, not what is kept. CONTROL_MODE from 2 on gives 0 and changes nothing (S15). IQ_SPEEDMODE
    /// is the Id reference of speed mode (S22), so that FLUX_REF reads it. RAMP_FINAL_SPEED begins a
    /// ramp of the last duration (S26). At rest nothing that is written starts the motor.
    pub set_register: Option<
        extern "C" fn(
            context: *mut c_void,
            motor: u8,
            reg: motorlink_st_reg,
            value: i32,
        ) -> motorlink_st_error_code,
    >,
    /// Executes a command. What the state does not allow has no effect (4.6). Required: the slave
    /// acknowledges the command, and a master relies on an acknowledged STOP_MOTOR.
    ///
    /// In fault START_MOTOR and START_STOP do nothing. While a fault is present FAULT_ACK changes
    /// neither STATUS nor FLAGS. STOP_RAMP leaves the motor at the speed it has. IQDREF_CLEAR brings
    /// TORQUE_REF, FLUX_REF and what IQ_SPEEDMODE was written back to their defaults. ENCODER_ALIGN
    /// does nothing in RUN, and STATUS is IDLE when it is over (S53). Commands of a PFC come with
    /// `MOTORLINK_ST_FEATURE_PFC` only.
    pub execute:
        Option<extern "C" fn(context: *mut c_void, motor: u8, command: motorlink_st_command)>,
    /// Programs a speed ramp: at once in RUN, else when RUN is reached (4.8). 0 ms is a step.
    /// NULL: acknowledged, without effect.
    pub set_ramp:
        Option<extern "C" fn(context: *mut c_void, motor: u8, speed_rpm: i32, duration_ms: u16)>,
    /// Gives rev-up phase 0 to 4 (4.9); what is not set is 0. NULL: all is 0.
    pub get_revup_data: Option<
        extern "C" fn(
            context: *mut c_void,
            motor: u8,
            phase: u8,
            data: *mut motorlink_st_revup_phase,
        ),
    >,
    /// Sets rev-up phase 0 to 4 (4.10). NULL: acknowledged, without effect.
    pub set_revup_data: Option<
        extern "C" fn(
            context: *mut c_void,
            motor: u8,
            phase: u8,
            data: *const motorlink_st_revup_phase,
        ),
    >,
    /// Sets the current references: at once in RUN, else when RUN is reached (4.11).
    /// NULL: acknowledged, without effect.
    pub set_current_reference:
        Option<extern "C" fn(context: *mut c_void, motor: u8, iq_s16a: i16, id_s16a: i16)>,
    /// Programs a torque ramp (profile MCSDK 5.4). NULL: acknowledged, without effect.
    pub set_torque_ramp:
        Option<extern "C" fn(context: *mut c_void, motor: u8, torque_s16a: i32, duration_ms: u16)>,
    /// Moves to an angle (profile MCSDK 5.4, with POSITION_CONTROL). NULL: acknowledged, without effect.
    pub set_position:
        Option<extern "C" fn(context: *mut c_void, motor: u8, angle_rad: f32, duration_s: f32)>,
    /// Registers that a step of the motor profiler shows (profile MCSDK 5.4, with PROFILER): gives
    /// how many there are and where, until the next call of a callback. NULL: none.
    pub profiler_step: Option<
        extern "C" fn(
            context: *mut c_void,
            motor: u8,
            step: u8,
            registers: *mut *const motorlink_st_reg,
        ) -> u8,
    >,
}

plain!(motorlink_st_motor_control);

// Pointers to the struct of C are cast to this one, and back.
same_layout!(motorlink_st_revup_phase = RevupPhase {
    speed_rpm = speed_rpm,
    torque_s16a = torque_s16a,
    duration_ms = duration_ms,
});

/// What the storage of a slave holds.
#[repr(C)]
pub(crate) struct State {
    drive: Kept<motorlink_st_motor_control>,
    slave: Slave,
}

storage!(motorlink_st_slave: State, Kind::StSlave);

impl MotorControl for Kept<motorlink_st_motor_control> {
    fn features(&self, motor: MotorNumber) -> Features {
        let drive = self.now();
        let bits = drive.features.map_or(0, |call| call(drive.context, motor.number()));
        let has = |feature: &&Feature| bits & 1u16.wrapping_shl(**feature as u32) != 0;
        Feature::ALL.iter().filter(has).fold(Features::NONE, |all, one| all.with(*one))
    }

    fn version(&self) -> Version<'_> {
        let drive = self.now();
        let motorlink_st_version { name, pre_release, major, minor, patch } = drive.version;
        let (name, pre_release) = (name.cast::<u8>(), pre_release.cast::<u8>());
        promised!(name, pre_release);
        let (name, pre_release) = (ascii(name, 32), ascii(pre_release, 32));
        Version { name, major, minor, patch, pre_release }
    }

    fn get_register(&mut self, motor: MotorNumber, register: RegisterId) -> i32 {
        let drive = self.now();
        drive.get_register.map_or(0, |call| call(drive.context, motor.number(), register.0))
    }

    fn set_register(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode> {
        let drive = self.now();
        let call = drive.set_register.ok_or(ErrorCode::WrongSet)?;
        match call(drive.context, motor.number(), register.0, value) {
            0 => Ok(()),
            error_code => Err(error_code.into()),
        }
    }

    fn execute(&mut self, motor: MotorNumber, command: Command) {
        let drive = self.now();
        if let Some(call) = drive.execute {
            call(drive.context, motor.number(), command.number());
        }
    }

    fn set_ramp(&mut self, motor: MotorNumber, ramp: Ramp) {
        let drive = self.now();
        if let Some(call) = drive.set_ramp {
            call(drive.context, motor.number(), ramp.speed_rpm, ramp.duration_ms);
        }
    }

    fn get_revup_data(&mut self, motor: MotorNumber, phase: u8) -> RevupPhase {
        let drive = self.now();
        let mut data = RevupPhase::default();
        if let Some(call) = drive.get_revup_data {
            call(drive.context, motor.number(), phase, (&raw mut data).cast());
        }
        data
    }

    fn set_revup_data(&mut self, motor: MotorNumber, phase: u8, data: RevupPhase) {
        let drive = self.now();
        if let Some(call) = drive.set_revup_data {
            call(drive.context, motor.number(), phase, ptr::from_ref(&data).cast());
        }
    }

    fn set_current_reference(&mut self, motor: MotorNumber, reference: CurrentReference) {
        let drive = self.now();
        if let Some(call) = drive.set_current_reference {
            call(drive.context, motor.number(), reference.iq_s16a, reference.id_s16a);
        }
    }

    fn set_torque_ramp(&mut self, motor: MotorNumber, ramp: TorqueRamp) {
        let drive = self.now();
        if let Some(call) = drive.set_torque_ramp {
            call(drive.context, motor.number(), ramp.torque_s16a, ramp.duration_ms);
        }
    }

    fn set_position(&mut self, motor: MotorNumber, target: PositionMove) {
        let drive = self.now();
        if let Some(call) = drive.set_position {
            call(drive.context, motor.number(), target.angle_rad, target.duration_s);
        }
    }

    fn profiler_step(&self, motor: MotorNumber, step: u8) -> &[u8] {
        let drive = self.now();
        let mut registers = core::ptr::null();
        let call = drive.profiler_step;
        let count =
            call.map_or(0, |call| call(drive.context, motor.number(), step, &raw mut registers));
        promised!(registers);
        registers.slice(count.into()).unwrap_or(&[])
    }
}

/// Begins a slave for a drive with motors 1 to `motors`, whatever the storage held before.
///
/// `size` is `sizeof *slave`. `drive` is kept: it has to live as long as the slave is used, and
/// may be constant. Not from a callback of the same slave.
///
/// `NULL_POINTER`: also if `execute` is NULL. `BAD_ARGUMENT`: `profile` has no name, or `motors` is not 1
/// to 7.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_slave_init(
    slave: *mut motorlink_st_slave,
    size: usize,
    profile: motorlink_st_profile,
    motors: u8,
    drive: *const motorlink_st_motor_control,
) -> motorlink_error {
    promised!(slave, drive);
    answer(|| {
        let drive = drive.keep()?;
        if drive.now().execute.is_none() {
            return Err(motorlink_error::NullPointer);
        }
        let profile = one_of(&Profile::ALL, profile)?;
        let motors = MotorNumber::new(motors).ok_or(motorlink_error::BadArgument)?;
        slave.init(size, State { slave: Slave::new(profile, motors), drive })
    })
}

/// Takes a byte that came at `now_us`. If it completes a command, the drive is called, and `reply` is what to
/// send before the next byte is handed in. Otherwise `reply` has no bytes.
///
/// The bytes belong to the slave, until the next call for it. A byte costs some instructions, a
/// complete command a checksum over it and the callbacks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_slave_receive(
    slave: *mut motorlink_st_slave,
    now_us: u64,
    byte: u8,
    reply: *mut motorlink_bytes,
) -> motorlink_error {
    promised!(slave, reply);
    answer(|| {
        let reply = reply.place()?;
        let mut state = slave.enter()?;
        let State { slave, drive } = &mut *state;
        let sent = slave.receive(Instant(now_us), byte, drive);
        reply.set(sent.unwrap_or(&[]).into());
        Ok(())
    })
}

/// Call it at the deadline. Gives the error reply to a command that did not arrive completely in time
/// (4.1), or no bytes. The bytes belong to the slave, until the next call for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_slave_poll(
    slave: *mut motorlink_st_slave,
    now_us: u64,
    reply: *mut motorlink_bytes,
) -> motorlink_error {
    promised!(slave, reply);
    answer(|| {
        let reply = reply.place()?;
        let mut state = slave.enter()?;
        reply.set(state.slave.poll(Instant(now_us)).unwrap_or(&[]).into());
        Ok(())
    })
}

/// Gives the moment at which `motorlink_st_slave_poll` must be called; `MOTORLINK_NEVER` if no command is
/// under way, and always in profile MCSDK 5.4, whose firmware has no timeout.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_slave_deadline(
    slave: *mut motorlink_st_slave,
    deadline_us: *mut u64,
) -> motorlink_error {
    promised!(slave, deadline_us);
    answer(|| {
        let place = deadline_us.place()?;
        let deadline = slave.enter()?.slave.deadline();
        place.set(deadline.map_or(MOTORLINK_NEVER, |deadline| deadline.0));
        Ok(())
    })
}

/// Call it after the receiver lost bytes (overrun, framing error, noise). Drops the command under way and
/// gives the error reply to send. The bytes belong to the slave, until the next call for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_st_slave_overrun(
    slave: *mut motorlink_st_slave,
    reply: *mut motorlink_bytes,
) -> motorlink_error {
    promised!(slave, reply);
    answer(|| {
        let reply = reply.place()?;
        let mut state = slave.enter()?;
        reply.set(state.slave.overrun().into());
        Ok(())
    })
}
