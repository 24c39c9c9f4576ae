//! The drive: answers the host and commands its motor, without I/O.

use super::command::{
    Code, Command, SetPosition, SetPositionLimited, SetSingleTurnPosition, SetSpeed, SetTorque,
};
use super::encoder::{EncoderBits, FULL_TURN};
use super::message::{SetTorque4, SpinDirection};
use super::motor::{MotorId, MotorSet, TORQUE4_ID};
use super::payload::Payload;
use super::reply::*;
use crate::can::CanFrame;
use crate::time::{Instant, Micros};
use crate::units::*;

/// The motor of a drive: the power stage, its control loops and its sensors. Angles are encoder
/// counts; only the drive knows the zero point.
pub trait MotorControl {
    /// Starts `mode`. Called once for each command that requests it.
    fn set_mode(&mut self, mode: Mode);

    /// Sets the gains and the acceleration limit.
    fn configure(&mut self, settings: &Settings);

    /// Reads the sensors.
    fn sense(&mut self) -> Sense;

    /// Stores the settings in ROM. [`Drive::new`] gets them after a power cycle. Wears a real ROM.
    fn save(&mut self, rom: &Settings);
}

/// The motion of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mode {
    /// No current (3, Motor off command).
    #[default]
    Off,
    /// Braked to standstill and held there (3, Motor stop command).
    Stopped,
    /// Holds a torque current within ±[`IqCommand::MAX`]. The drive's own maximum torque current
    /// does not limit it (3, Torque current control command).
    Torque(IqCommand),
    /// Holds a speed (3, Speed control command).
    Speed(CentiDps),
    /// Turns to a position and holds it (3, Position control command 1 to 4).
    Position {
        /// Encoder counts as in [`Sense::encoder`].
        target: i64,
        /// Maximum speed during the move; `None` selects the drive's own maximum.
        max_speed: Option<SpeedLimit>,
        /// Whether the drive's Max Angle applies: for commands 1 and 2, not for 3 and 4.
        within_max_angle: bool,
    },
}

/// Sensor values.
// The layout of C's struct, so that the C interface needs no conversion.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sense {
    /// Encoder counts in the encoder's own width. They grow clockwise and do not wrap at the ends
    /// of the turn. At power-on they are within the turn: 0 to 2^width - 1.
    pub encoder: i64,
    /// Torque current.
    pub iq: IqFeedback,
    /// Speed, positive is clockwise.
    pub speed: Dps,
    /// Supply voltage.
    pub voltage: DeciVolts,
    /// Currents of the three phases.
    pub phase_currents: PhaseCurrents,
    /// Motor temperature.
    pub temperature: Celsius,
    /// Faults that are present now. The drive latches them.
    pub faults: Errors,
}

/// The settings of a host. There are two copies: RAM, which commands use, and ROM, which power-on
/// copies to RAM.
// The layout of C's struct, so that the C interface needs no conversion.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Settings {
    /// Acceleration limit (0x33, 0x34), 1 °/s² a digit. No command writes it to ROM. 0 and negative
    /// values mean no limit, as in the vendor's tool.
    pub acceleration: DpsPerSecond,
    /// Encoder value of the zero point (0x90, 0x91, 0x19), as in the frame: at most 16 bits.
    pub encoder_offset: u16,
    /// Gains of the three loops (0x30 to 0x32).
    pub gains: Pid,
}

/// Configuration by the vendor's tool or by a switch. No command changes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
// Bytes come first: offsets below 32 make shorter instructions on a Cortex-M.
#[repr(C)]
pub struct DriveConfig {
    /// The ID of the drive.
    pub id: MotorId,
    /// Width of the encoder (docs/SPEC-NOTES.md R6).
    pub encoder: EncoderBits,
    /// Answers 0x9B with 0x9B, as related drives do, instead of 0x9A as printed (3, Clear motor
    /// error flag command; docs/SPEC-NOTES.md R1).
    pub clear_reply_0x9b: bool,
    /// Switches the motor off after this time without a command (docs/SPEC-NOTES.md R12).
    pub shutdown: Option<Micros>,
}

impl DriveConfig {
    /// A drive as the document describes it: 14-bit encoder, no shutdown.
    pub fn new(id: MotorId) -> Self {
        let encoder = EncoderBits::default();
        DriveConfig { id, encoder, shutdown: None, clear_reply_0x9b: false }
    }
}

/// Counts frames for this drive that it did not answer. Each count saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Ignored {
    /// Not standard data frames of eight bytes (docs/SPEC-NOTES.md R11).
    pub malformed: u32,
    /// Codes that the document does not name.
    pub unknown: u32,
}

/// The drive's side of the protocol, for one motor.
#[derive(Debug, Clone)]
// Bytes come first: offsets below 32 make shorter instructions on a Cortex-M.
#[repr(C)]
pub struct Drive {
    /// The vendor's configuration. It may change at any time.
    pub config: DriveConfig,
    stopped: bool,
    is_on: bool,
    errors: Errors,
    /// The single-turn command from which `mode` was derived.
    circle: Option<Circle>,
    ram: Settings,
    rom: Settings,
    last_command: Instant,
    mode: Mode,
    ignored: Ignored,
}

/// A single-turn command that the drive executes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Circle {
    clockwise: bool,
    angle: TurnCentiDegrees,
}

impl Circle {
    /// `None` if a value is outside the document's range.
    fn of(command: SetSingleTurnPosition) -> Option<Self> {
        let SetSingleTurnPosition { direction, angle } = command;
        let clockwise = match direction {
            SpinDirection::Clockwise => true,
            SpinDirection::Counterclockwise => false,
            SpinDirection::Unknown(_) => return None,
        };
        (angle.0 < FULL_TURN).then_some(Circle { clockwise, angle })
    }
}

impl Drive {
    /// A drive with these ROM contents. Before [`power_on`](Self::power_on) it ignores all frames,
    /// and does not command its motor.
    pub fn new(config: DriveConfig, rom: Settings) -> Self {
        Drive {
            config,
            ram: rom,
            rom,
            mode: Mode::Off,
            stopped: false,
            circle: None,
            errors: Errors::NONE,
            last_command: Instant(0),
            ignored: Ignored::default(),
            is_on: false,
        }
    }

    /// Starts the drive, also after a power cycle: settings come from ROM, the motor is off, no
    /// error is latched, and Run has no motion to resume.
    pub fn power_on(&mut self, now: Instant, motor: &mut impl MotorControl) {
        // Field by field takes less flash than `Drive::new`.
        self.ram = self.rom;
        self.errors = Errors::NONE;
        self.last_command = now;
        self.ignored = Ignored::default();
        self.is_on = true;
        motor.configure(&self.ram);
        self.off(motor);
    }

    /// Takes a frame from the bus and returns the reply. There is no reply to frames for other
    /// motors, to unknown codes, and to frames other than standard data frames of eight bytes.
    pub fn receive(
        &mut self,
        now: Instant,
        frame: &CanFrame,
        motor: &mut impl MotorControl,
    ) -> Option<CanFrame> {
        let id = self.config.id;
        let own = u32::from(id.can_id());
        let everyones = frame.id() == u32::from(TORQUE4_ID) && reached(id);
        if !self.is_on || (frame.id() != own && !everyones) {
            return None;
        }
        let Some((_, data)) = frame.eight_bytes() else {
            count(&mut self.ignored.malformed);
            return None;
        };
        let sense = self.watch(now, motor);
        let reply = if everyones {
            // Executed and answered like the single-motor command (chapter 4).
            let torque = SetTorque4::decode(data).of(id)?;
            self.answer(&SetTorque { iq: torque }.encode(), &sense, motor)?
        } else {
            self.answer(data, &sense, motor)?
        };
        self.last_command = now;
        Some(CanFrame::new(id.can_id(), reply))
    }

    /// Latches faults and checks the shutdown time. Call it at [`deadline`](Self::deadline), and
    /// often enough to switch the motor off in time after a fault.
    pub fn poll(&mut self, now: Instant, motor: &mut impl MotorControl) {
        self.watch(now, motor);
    }

    /// End of the shutdown time; `None` while the motor is off or no shutdown time is set.
    pub fn deadline(&self) -> Option<Instant> {
        let shutdown = self.config.shutdown?;
        (self.mode != Mode::Off).then_some(self.last_command + shutdown)
    }

    /// The last commanded mode.
    pub const fn mode(&self) -> Mode {
        if self.stopped { Mode::Stopped } else { self.mode }
    }

    /// The latched errors.
    pub const fn errors(&self) -> Errors {
        self.errors
    }

    /// The settings in RAM, which commands use.
    pub const fn settings(&self) -> &Settings {
        &self.ram
    }

    /// The settings in ROM, which the next power-on copies to RAM.
    pub const fn rom(&self) -> &Settings {
        &self.rom
    }

    /// Frames that were not answered since power-on.
    pub const fn ignored(&self) -> &Ignored {
        &self.ignored
    }

    fn answer(
        &mut self,
        data: &[u8; 8],
        sense: &Sense,
        motor: &mut impl MotorControl,
    ) -> Option<[u8; 8]> {
        let [number, ..] = *data;
        let code = Code::from(number);
        let position = sense.encoder.wrapping_sub(self.zero());
        Some(match code {
            Code::ReadPid => self.ram.gains.encode_as(number),
            Code::WritePidRam | Code::WritePidRom => {
                self.ram.gains = Pid::decode(data);
                motor.configure(&self.ram);
                if code == Code::WritePidRom {
                    self.rom.gains = self.ram.gains;
                    motor.save(&self.rom);
                }
                *data
            }
            Code::ReadAcceleration => {
                Acceleration { acceleration: self.ram.acceleration }.encode_as(number)
            }
            Code::WriteAccelerationRam => {
                self.ram.acceleration = Acceleration::decode(data).acceleration;
                motor.configure(&self.ram);
                *data
            }
            Code::ReadEncoder => {
                let bits = self.config.encoder;
                let (position, raw) = (bits.narrow(position), bits.narrow(sense.encoder));
                Encoder { position, raw, offset: self.ram.encoder_offset }.encode_as(number)
            }
            Code::WriteEncoderOffsetRom => {
                let offset = self.config.encoder.cut(EncoderOffset::decode(data).offset);
                self.ram.encoder_offset = offset;
                self.circle = None;
                self.store_offset(number, offset, motor)
            }
            Code::WriteZeroRom => {
                let offset = self.config.encoder.narrow(sense.encoder);
                self.store_offset(number, offset, motor)
            }
            Code::ReadMultiTurnAngle => {
                MultiTurnAngle { angle: self.config.encoder.multi_turn(position) }.encode_as(number)
            }
            Code::ReadSingleTurnAngle => {
                SingleTurnAngle { angle: self.config.encoder.circle(position) }.encode_as(number)
            }
            Code::ReadStatus => self.status1(number, sense),
            Code::ClearErrors => {
                self.errors = self.errors.intersection(sense.faults);
                let own = self.config.clear_reply_0x9b;
                self.status1(if own { number } else { Code::ReadStatus.into() }, sense)
            }
            Code::ReadMotionStatus => self.motion_status(number, sense),
            Code::ReadPhaseCurrents => sense.phase_currents.encode_as(number),
            Code::Off => {
                self.off(motor);
                *data
            }
            Code::Stop => {
                if self.mode != Mode::Off {
                    self.stopped = true;
                    self.start(motor);
                }
                *data
            }
            Code::Run => {
                if self.stopped {
                    self.stopped = false;
                    self.start(motor);
                }
                *data
            }
            Code::SetTorque
            | Code::SetSpeed
            | Code::SetPosition
            | Code::SetPositionLimited
            | Code::SetSingleTurnPosition
            | Code::SetSingleTurnPositionLimited => {
                if let Some((mode, circle)) = self.request_mode(code, data, sense) {
                    self.circle = circle;
                    self.go(mode, motor);
                }
                self.motion_status(number, sense)
            }
            Code::Unknown(_) => {
                count(&mut self.ignored.unknown);
                return None;
            }
        })
    }

    /// The mode that a motion command requests, and the command if it is a single-turn command.
    /// `None` if a value is outside the document's range: the drive ignores the command
    /// (docs/SPEC-NOTES.md R15).
    fn request_mode(
        &self,
        code: Code,
        data: &[u8; 8],
        sense: &Sense,
    ) -> Option<(Mode, Option<Circle>)> {
        let max_speed = match code {
            Code::SetPositionLimited | Code::SetSingleTurnPositionLimited => {
                Some(SetPositionLimited::decode(data).max_speed)
            }
            _ => None,
        };
        Some(match code {
            Code::SetTorque => (Mode::Torque(saturated(SetTorque::decode(data).iq)), None),
            Code::SetSpeed => (Mode::Speed(SetSpeed::decode(data).speed), None),
            Code::SetPosition | Code::SetPositionLimited => {
                let target = self.counts(SetPosition::decode(data).angle);
                (Mode::Position { target, max_speed, within_max_angle: true }, None)
            }
            _ => {
                let circle = Circle::of(SetSingleTurnPosition::decode(data))?;
                let target = match self.mode {
                    // Repeating the command does not start another turn (R16).
                    Mode::Position { target, .. } if self.circle == Some(circle) => target,
                    _ => self.circle_target(circle, sense),
                };
                (Mode::Position { target, max_speed, within_max_angle: false }, Some(circle))
            }
        })
    }

    fn circle_target(&self, circle: Circle, sense: &Sense) -> i64 {
        let angle = CentiDegrees(circle.angle.0.into());
        let bits = self.config.encoder;
        let clockwise = bits.within_turn(self.counts(angle).wrapping_sub(sense.encoder));
        let way = if circle.clockwise || clockwise == 0 {
            clockwise
        } else {
            clockwise.wrapping_sub(bits.turn().into())
        };
        sense.encoder.wrapping_add(way)
    }

    /// Starts a mode, also when the motor is stopped (docs/SPEC-NOTES.md R17). Does nothing while
    /// an error is latched (R18).
    fn go(&mut self, mode: Mode, motor: &mut impl MotorControl) {
        if !self.errors.is_empty() {
            return;
        }
        self.mode = mode;
        self.stopped = false;
        self.start(motor);
    }

    /// Commands the motor. One call takes less flash than a copy of it for each mode.
    #[inline(never)]
    fn start(&self, motor: &mut impl MotorControl) {
        motor.set_mode(self.mode());
    }

    #[inline(never)]
    fn off(&mut self, motor: &mut impl MotorControl) {
        self.mode = Mode::Off;
        self.stopped = false;
        self.circle = None;
        self.start(motor);
    }

    /// Whether the shutdown time is over. A clock that was set back by as much ends it, too.
    fn is_silent(&self, now: Instant) -> bool {
        self.config.shutdown.is_some_and(|shutdown| now.distance(self.last_command) >= shutdown)
    }

    fn watch(&mut self, now: Instant, motor: &mut impl MotorControl) -> Sense {
        let sense = motor.sense();
        self.errors = self.errors.union(sense.faults);
        if self.mode != Mode::Off && (self.is_silent(now) || !self.errors.is_empty()) {
            self.off(motor);
        }
        sense
    }

    fn store_offset(&mut self, number: u8, offset: u16, motor: &mut impl MotorControl) -> [u8; 8] {
        self.rom.encoder_offset = offset;
        motor.save(&self.rom);
        EncoderOffset { offset }.encode_as(number)
    }

    fn status1(&self, number: u8, sense: &Sense) -> [u8; 8] {
        let Sense { temperature, voltage, .. } = *sense;
        Status { temperature, voltage, errors: self.errors }.encode_as(number)
    }

    fn motion_status(&self, number: u8, sense: &Sense) -> [u8; 8] {
        let Sense { temperature, iq, speed, .. } = *sense;
        let position = sense.encoder.wrapping_sub(self.zero());
        let encoder = self.config.encoder.narrow(position);
        MotionStatus { temperature, iq, speed, encoder }.encode_as(number)
    }

    /// Encoder counts at an angle from zero.
    fn counts(&self, angle: CentiDegrees) -> i64 {
        self.config.encoder.counts(angle).wrapping_add(self.zero())
    }

    /// Encoder counts at zero.
    fn zero(&self) -> i64 {
        self.config.encoder.widen(self.ram.encoder_offset)
    }
}

/// Whether the frame 0x280 reaches this motor (chapter 4).
fn reached(id: MotorId) -> bool {
    MotorSet::TORQUE4.contains(id)
}

/// Clamped to the document's range (docs/SPEC-NOTES.md R3).
fn saturated(torque: IqCommand) -> IqCommand {
    let IqCommand(most) = IqCommand::MAX;
    IqCommand(torque.0.min(most).max(most.wrapping_neg()))
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
