//! The drive's end: frames in, replies out, a table of callbacks to the motor.

use core::ffi::c_void;
use core::ptr;

use motorlink_proto::rmd::{
    Drive, DriveConfig, EncoderBits, Mode, MotorControl, MotorId, Sense, Settings,
};
use motorlink_proto::time::{Instant, Micros};

use super::message::motorlink_rmd_pid;
use super::motorlink_rmd_drive;
use crate::bytes::MOTORLINK_NEVER;
use crate::error::{answer, motorlink_error};
use crate::frame::{NO_FRAME, motorlink_can_frame};
use crate::pointer::{Kept, plain, promised, same_layout, storage};
use crate::tag::Kind;

/// What a motor does.
#[repr(u8)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum motorlink_rmd_mode {
    /// No current.
    Off = 0,
    /// Brakes to a standstill and stays there.
    Stopped = 1,
    /// Holds `iq_16ma`.
    Torque = 2,
    /// Holds `speed_centidps`.
    Speed = 3,
    /// Turns to `target_counts` and holds it.
    Position = 4,
}

/// What a motor does. Values that its kind does not use are 0.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_motion {
    /// `POSITION`: encoder counts as in `motorlink_rmd_sense`.
    pub target_counts: i64,
    /// `SPEED`: 0.01 °/s a digit, positive is clockwise.
    pub speed_centidps: i32,
    /// `POSITION`: highest speed of the move, °/s; -1: the drive's own.
    pub max_speed_dps: i32,
    /// `TORQUE`: torque current, 0.016 A a digit, -2000 to 2000.
    pub iq_16ma: i16,
    /// `POSITION`: 1 if the drive's greatest angle limits the move, 0 for moves within the turn.
    pub within_max_angle: u8,
    /// Which kind it is.
    pub kind: motorlink_rmd_mode,
}

/// What the sensors read.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_sense {
    /// Encoder counts, in the encoder's own resolution. They grow clockwise and continue beyond a
    /// turn. Within a turn at power-on.
    pub encoder_counts: i64,
    /// Torque current, 33/2048 A a digit.
    pub iq_digits: i16,
    /// Speed, °/s, positive is clockwise.
    pub speed_dps: i16,
    /// Supply voltage, 0.1 V a digit.
    pub voltage_decivolts: u16,
    /// Currents of the phases A, B and C, 1/64 A a digit.
    pub phase_digits: [i16; 3],
    /// Motor temperature, °C.
    pub temperature_celsius: i8,
    /// Faults that are present now, a sum of `MOTORLINK_RMD_ERROR_*`; the drive latches them.
    pub faults: u8,
}

/// What a host can set. Commands use the copy in RAM; power-on copies ROM to RAM.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_settings {
    /// Acceleration limit, °/s²; 0 or less: not limited.
    pub acceleration_dps2: i32,
    /// Encoder value of the zero position, as in frames: at most 16 bits.
    pub encoder_offset: u16,
    /// Gains of the three loops.
    pub pid: motorlink_rmd_pid,
}

/// Settings of the vendor's tool or of a switch, which no command changes.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_rmd_drive_config {
    /// Switches the motor off after this long without a command, µs; 0 is never.
    pub shutdown_us: u64,
    /// The ID that the drive answers to, 1 to 32.
    pub id: u8,
    /// Width of the encoder, 12 to 18 bits; 0 is the document's 14.
    pub encoder_bits: u8,
    /// The code of the reply to 0x9B: 1 for 0x9B, as in related protocols, 0 for 0x9A, as in the document
    /// (SPEC-NOTES.md R1).
    pub clear_reply_0x9b: u8,
}

/// The motor behind a drive: the power stage, its control loops and its sensors.
///
/// `set_mode` is required. Every other callback may be NULL. Callbacks are called from within
/// `motorlink_rmd_drive_power_on`, `_receive` and `_poll`, and may not call for the same drive: such calls
/// give `IN_USE`.
///
/// `motorlink conformance rmd` checks such a drive. What it asks of a callback beyond the document is
/// a reading: a row of SPEC-NOTES.md, named in brackets. A drive that differs from readings
/// passes, and fails with `--readings strict`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct motorlink_rmd_motor_control {
    /// Handed to each callback.
    pub context: *mut c_void,
    /// Does this from now on. Required: the drive acknowledges Off and Stop, and a host relies on that.
    ///
    /// Positive speed and torque turn clockwise, to larger counts (R36). A move is as fast as
    /// `max_speed_dps` lets it be, and does not turn with 0 (R13, R40).
    pub set_mode: Option<extern "C" fn(context: *mut c_void, motion: *const motorlink_rmd_motion)>,
    /// Uses these gains and this acceleration limit from now on. NULL: acknowledged, without effect.
    ///
    /// The limit holds for all motion commands but torque (R39); 0 or less means no limit (R24). Without
    /// position gains the motor does not go to a position (R41).
    pub configure:
        Option<extern "C" fn(context: *mut c_void, settings: *const motorlink_rmd_settings)>,
    /// Reads the sensors. Values that are not set are 0. NULL: all values are 0.
    ///
    /// Phase currents sum to 0 and have about the size of the torque current (R38). Within 5 ms of a
    /// torque command the torque current is as commanded.
    pub sense: Option<extern "C" fn(context: *mut c_void, sense: *mut motorlink_rmd_sense)>,
    /// Keeps what `motorlink_rmd_drive_init` gets after a power cycle. Wears a real ROM.
    /// NULL: forgotten at power-off.
    pub save: Option<extern "C" fn(context: *mut c_void, rom: *const motorlink_rmd_settings)>,
}

plain!(motorlink_rmd_drive_config, motorlink_rmd_motor_control, Settings);

// Pointers to the structs of C are cast to these, and back.
same_layout!(motorlink_rmd_settings = Settings {
    acceleration_dps2 = acceleration,
    encoder_offset = encoder_offset,
    pid.position_kp = gains.position_kp,
    pid.position_ki = gains.position_ki,
    pid.speed_kp = gains.speed_kp,
    pid.speed_ki = gains.speed_ki,
    pid.torque_kp = gains.torque_kp,
    pid.torque_ki = gains.torque_ki,
});
same_layout!(motorlink_rmd_sense = Sense {
    encoder_counts = encoder,
    iq_digits = iq,
    speed_dps = speed,
    voltage_decivolts = voltage,
    phase_digits = phase_currents.phase_a,
    temperature_celsius = temperature,
    faults = faults,
});

/// What the storage of a drive holds.
pub(crate) struct State {
    drive: Drive,
    motor: Kept<motorlink_rmd_motor_control>,
}

storage!(motorlink_rmd_drive: State, Kind::RmdDrive);

impl From<Mode> for motorlink_rmd_motion {
    fn from(mode: Mode) -> Self {
        let mut all = motorlink_rmd_motion {
            target_counts: 0,
            speed_centidps: 0,
            max_speed_dps: 0,
            iq_16ma: 0,
            within_max_angle: 0,
            kind: motorlink_rmd_mode::Off,
        };
        let kind = match mode {
            Mode::Off => motorlink_rmd_mode::Off,
            Mode::Stopped => motorlink_rmd_mode::Stopped,
            Mode::Torque(torque) => {
                all.iq_16ma = torque.0;
                motorlink_rmd_mode::Torque
            }
            Mode::Speed(speed) => {
                all.speed_centidps = speed.0;
                motorlink_rmd_mode::Speed
            }
            Mode::Position { target, max_speed, within_max_angle } => {
                all.target_counts = target;
                all.max_speed_dps = max_speed.map_or(-1, |limit| limit.0.into());
                all.within_max_angle = within_max_angle.into();
                motorlink_rmd_mode::Position
            }
        };
        motorlink_rmd_motion { kind, ..all }
    }
}

impl MotorControl for Kept<motorlink_rmd_motor_control> {
    fn set_mode(&mut self, mode: Mode) {
        let motor = self.now();
        if let Some(call) = motor.set_mode {
            call(motor.context, &motorlink_rmd_motion::from(mode));
        }
    }

    fn configure(&mut self, settings: &Settings) {
        let motor = self.now();
        if let Some(call) = motor.configure {
            call(motor.context, ptr::from_ref(settings).cast());
        }
    }

    fn sense(&mut self) -> Sense {
        let motor = self.now();
        let mut sense = Sense::default();
        if let Some(call) = motor.sense {
            call(motor.context, (&raw mut sense).cast());
        }
        sense
    }

    fn save(&mut self, rom: &Settings) {
        let motor = self.now();
        if let Some(call) = motor.save {
            call(motor.context, ptr::from_ref(rom).cast());
        }
    }
}

/// Begins a drive, whatever the storage held before. Before `motorlink_rmd_drive_power_on` it ignores all
/// frames, and does not command its motor.
///
/// `size` is `sizeof *drive`. `config` and `rom` (what the ROM holds; NULL: zeros) are copied.
/// `motor` is kept: it has to live as long as the drive is used, and may be constant. Not from a
/// callback of the same drive.
///
/// `NULL_POINTER`: also if `set_mode` is NULL. `BAD_ARGUMENT`: `id` is not 1 to 32, or `encoder_bits`
/// neither 0 nor 12 to 18.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_init(
    drive: *mut motorlink_rmd_drive,
    size: usize,
    config: *const motorlink_rmd_drive_config,
    rom: *const motorlink_rmd_settings,
    motor: *const motorlink_rmd_motor_control,
) -> motorlink_error {
    let rom = rom.cast::<Settings>();
    promised!(drive, config, rom, motor);
    answer(|| {
        let motor = motor.keep()?;
        if motor.now().set_mode.is_none() {
            return Err(motorlink_error::NullPointer);
        }
        let config = config.read()?;
        let rom = rom.read_optional()?.unwrap_or_default();
        let bits = match config.encoder_bits {
            0 => EncoderBits::default().bits(),
            bits => bits,
        };
        let config = DriveConfig {
            id: MotorId::new(config.id).ok_or(motorlink_error::BadArgument)?,
            encoder: EncoderBits::new(bits).ok_or(motorlink_error::BadArgument)?,
            shutdown: (config.shutdown_us != 0).then_some(Micros(config.shutdown_us)),
            clear_reply_0x9b: config.clear_reply_0x9b != 0,
        };
        drive.init(size, State { drive: Drive::new(config, rom), motor })
    })
}

/// Starts, also after a power cycle: settings come from ROM, the motor is off, no error is latched
/// and nothing is left to resume.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_power_on(
    drive: *mut motorlink_rmd_drive,
    now_us: u64,
) -> motorlink_error {
    promised!(drive);
    answer(|| {
        let mut state = drive.enter()?;
        let State { drive, motor } = &mut *state;
        drive.power_on(Instant(now_us), motor);
        Ok(())
    })
}

/// Takes a frame from the bus that came at `now_us`. `reply` is the frame to send; its id is
/// `MOTORLINK_NO_FRAME` where there is none: frames for others, unknown codes and frames that are
/// not eight bytes of standard data are not answered. `reply` and `frame` may be the same.
///
/// `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_receive(
    drive: *mut motorlink_rmd_drive,
    now_us: u64,
    frame: *const motorlink_can_frame,
    reply: *mut motorlink_can_frame,
) -> motorlink_error {
    promised!(drive, frame, reply);
    answer(|| {
        let frame = frame.read()?.try_into()?;
        let place = reply.place()?;
        let mut state = drive.enter()?;
        let State { drive, motor } = &mut *state;
        let reply = drive.receive(Instant(now_us), &frame, motor);
        place.set(reply.map_or(NO_FRAME, motorlink_can_frame::from));
        Ok(())
    })
}

/// Latches faults, and switches the motor off after a fault or the shutdown time. Call it each millisecond,
/// also while no frame arrives.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_poll(
    drive: *mut motorlink_rmd_drive,
    now_us: u64,
) -> motorlink_error {
    promised!(drive);
    answer(|| {
        let mut state = drive.enter()?;
        let State { drive, motor } = &mut *state;
        drive.poll(Instant(now_us), motor);
        Ok(())
    })
}

/// Gives the end of the shutdown time; `MOTORLINK_NEVER` if the motor is off or has no shutdown time. It
/// does not know of faults.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_deadline(
    drive: *mut motorlink_rmd_drive,
    deadline_us: *mut u64,
) -> motorlink_error {
    promised!(drive, deadline_us);
    answer(|| {
        let place = deadline_us.place()?;
        let deadline = drive.enter()?.drive.deadline();
        place.set(deadline.map_or(MOTORLINK_NEVER, |at| at.0));
        Ok(())
    })
}

/// Gives what the motor does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_motion(
    drive: *mut motorlink_rmd_drive,
    motion: *mut motorlink_rmd_motion,
) -> motorlink_error {
    promised!(drive, motion);
    answer(|| {
        let place = motion.place()?;
        place.set(drive.enter()?.drive.mode().into());
        Ok(())
    })
}

/// Gives the latched errors, a sum of `MOTORLINK_RMD_ERROR_*`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_errors(
    drive: *mut motorlink_rmd_drive,
    errors: *mut u8,
) -> motorlink_error {
    promised!(drive, errors);
    answer(|| {
        let place = errors.place()?;
        place.set(drive.enter()?.drive.errors().0);
        Ok(())
    })
}

/// Gives the settings in RAM, which commands use.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_rmd_drive_settings(
    drive: *mut motorlink_rmd_drive,
    settings: *mut motorlink_rmd_settings,
) -> motorlink_error {
    let settings = settings.cast::<Settings>();
    promised!(drive, settings);
    answer(|| {
        let place = settings.place()?;
        let settings = *drive.enter()?.drive.settings();
        place.set(settings);
        Ok(())
    })
}
