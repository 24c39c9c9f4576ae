//! The slave: takes bytes, returns replies (4.1).

use super::payload::Payload;
use super::register::{Conversion, Row, Type, Writing};
use super::{
    BoardInfo, Command, ErrorCode, Feature, Features, FirmwareVersion, Frame, FrameCode,
    HEADER_ACK, HEADER_NACK, MAX_FRAME, MAX_PAYLOAD, MotorControl, MotorNumber, Profile,
    REVUP_PHASES, RegisterId, Request, checksum, frame,
};
use crate::time::{Instant, Micros};

/// Reception timeout: the maximum time for a whole command (4.1).
pub const RECEPTION_TIMEOUT: Micros = Micros::from_millis(25);
/// Number of data segments of a slave (profile `spec`, SPEC-NOTES S7).
pub const SEGMENTS: usize = 4;
/// Maximum number of registers in a data segment. Their values always fit into a reply.
pub const SEGMENT_REGISTERS: usize = 32;

/// In place of a number of bytes: a length over 128 was received. All bytes are dropped until the
/// line was silent.
const SKIPPING: u8 = u8::MAX;

/// The slave's side of the protocol. It collects a command, checks checksum, motor and frame code
/// in this order (4.1), calls the [`MotorControl`], and replies.
///
/// The caller passes every byte with its time of arrival, and calls [`poll`](Self::poll) at
/// [`deadline`](Self::deadline). It sends each returned reply before it passes the next byte: a
/// real slave does not receive while it replies.
#[derive(Debug, Clone)]
// What is used most comes first: offsets below 32 make shorter instructions on a Cortex-M.
#[repr(C)]
pub struct Slave {
    /// While a command is under way. Profile `mcsdk-5.4` does not use it.
    deadline: Instant,
    profile: Profile,
    motors: u8,
    current: MotorNumber,
    /// Bytes of the command so far, or [`SKIPPING`].
    received: u8,
    /// The command so far, then the reply to it.
    buffer: [u8; MAX_FRAME],
    segments: [Segment; SEGMENTS],
}

impl Slave {
    /// A slave for a drive with motors 1 to `motors`. Motor 1 is the current one (3.2).
    pub const fn new(profile: Profile, motors: MotorNumber) -> Self {
        Slave {
            profile,
            motors: motors.number(),
            current: MotorNumber::FIRST,
            buffer: [0; MAX_FRAME],
            received: 0,
            deadline: Instant(0),
            segments: Segment::NONE,
        }
    }

    /// The profile that the slave follows.
    pub const fn profile(&self) -> Profile {
        self.profile
    }

    /// The motor that motor number 0 addresses (3.2).
    pub const fn current_motor(&self) -> MotorNumber {
        self.current
    }

    /// Whether a command was received in part. The next byte belongs to it.
    pub const fn is_receiving(&self) -> bool {
        self.received > 0
    }

    /// When to call [`poll`](Self::poll). `None` between frames, and always in profile `mcsdk-5.4`,
    /// whose firmware has no reception timeout (SPEC-NOTES S11).
    pub fn deadline(&self) -> Option<Instant> {
        let timed = self.profile == Profile::Spec && self.is_receiving();
        timed.then_some(self.deadline)
    }

    /// Returns the NACK TIMEOUT for a command that was not complete in time (4.1).
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn poll(&mut self, now: Instant) -> Option<&[u8]> {
        if !self.deadline()?.is_over(RECEPTION_TIMEOUT, now) {
            return None;
        }
        self.restart();
        Some(&TIMEOUT_REPLY)
    }

    /// Takes a byte received at `now`. Returns the reply if the byte completes a command. A byte
    /// after the deadline starts a new command; the NACK for the old command is returned first.
    pub fn receive(
        &mut self,
        now: Instant,
        byte: u8,
        drive: &mut impl MotorControl,
    ) -> Option<&[u8]> {
        let expired = self.poll(now).is_some();
        let size = self.take(now, byte);
        if expired {
            return Some(&TIMEOUT_REPLY);
        }
        self.answer(size?, drive)
    }

    /// Executes the command of this size, and returns the reply.
    // A host would otherwise prepare the stack for it at each byte. Firmware takes less flash without
    // the call.
    #[cfg_attr(not(target_os = "none"), inline(never))]
    fn answer(&mut self, size: usize, drive: &mut impl MotorControl) -> Option<&[u8]> {
        let (&received, body) = self.buffer.get(..size)?.split_last()?;
        let answer = if checksum(body) == received {
            let [header, length, payload @ .., _] = self.buffer;
            let payload = payload.get(..usize::from(length))?;
            self.process(&Frame { header, payload }, drive)
        } else {
            Err(ErrorCode::BadCrc.into())
        };
        self.restart();
        Some(self.reply(answer))
    }

    /// Reports that the receiver lost bytes. Drops the current command and returns the NACK OVERRUN
    /// (table 2).
    pub fn overrun(&mut self) -> &[u8] {
        self.restart();
        self.reply(Err(ErrorCode::Overrun.into()))
    }

    /// Takes a byte. Returns the command's size when it is complete.
    fn take(&mut self, now: Instant, byte: u8) -> Option<usize> {
        let begins = self.received == 0;
        let size = self.store(byte);
        if begins || self.received == SKIPPING {
            self.deadline = now + RECEPTION_TIMEOUT;
        }
        size
    }

    fn store(&mut self, byte: u8) -> Option<usize> {
        // There is no room while bytes are skipped.
        *self.buffer.get_mut(usize::from(self.received))? = byte;
        self.received = self.received.saturating_add(1);
        let [_, length, ..] = self.buffer;
        let timed = self.profile == Profile::Spec;
        // Shipped firmware accepts at most 127 bytes; it then expects the next header at once.
        let most = MAX_PAYLOAD - usize::from(!timed);
        if self.received == 2 && usize::from(length) > most {
            self.received = if timed { SKIPPING } else { 0 };
            return None;
        }
        // Before there is a length, fewer bytes were received than any command has.
        let size = usize::from(length) + super::OVERHEAD;
        (usize::from(self.received) == size).then_some(size)
    }

    fn restart(&mut self) {
        self.received = 0;
    }

    /// Checks motor and frame code, then executes, in this order (4.1). Returns the size of the
    /// ACK's payload, which is then in the buffer.
    fn process(&mut self, frame: &Frame<'_>, drive: &mut impl MotorControl) -> Result<usize, Nack> {
        if frame.motor() != 0 {
            self.select(frame.motor()).ok_or(ErrorCode::BadMotorSelected)?;
        }
        let motor = self.current;
        let features = drive.features(motor);
        let code = FrameCode::from_number(frame.code(), self.profile);
        if code == Some(FrameCode::SetPositionCmd) && !features.has(Feature::PositionControl) {
            return Err(ErrorCode::BadFrameId.into());
        }
        let request = frame.request(self.profile)?;
        let [_, _, room @ .., _] = &mut self.buffer;
        let mut out = Payload::new(room);
        match request {
            Request::SetRegister { register, value } => {
                self.write(motor, register, value, features, drive)?;
                return Ok(0);
            }
            Request::GetRegister(register) => {
                let refused = Nack::from(ErrorCode::GetWriteOnly);
                let Some(row) = register.row() else { return Err(refused) };
                let Some(size) = row.read_size(self.profile, features) else {
                    return Err(refused);
                };
                out.value(read(self.profile, motor, register, row, drive), size.get());
            }
            Request::ExecuteCommand(command) => {
                execute(self.profile, motor, command, features, drive)?
            }
            Request::GetBoardInfo => BoardInfo::encode(self.profile, &drive.version(), &mut out),
            Request::GetFirmwareVersion => FirmwareVersion::encode(&drive.version(), &mut out),
            Request::SetRamp(mut ramp) => {
                ramp.speed_rpm = speed(self.profile, ramp.speed_rpm);
                drive.set_ramp(motor, ramp);
            }
            Request::GetRevupData(phase) => {
                let phase = revup_phase(phase)?;
                let mut data = drive.get_revup_data(motor, phase);
                data.speed_rpm = speed(self.profile, data.speed_rpm);
                out.bytes(&data.to_bytes());
            }
            Request::SetRevupData(phase, mut data) => {
                data.speed_rpm = speed(self.profile, data.speed_rpm);
                drive.set_revup_data(motor, revup_phase(phase)?, data);
            }
            Request::SetCurrentReference(reference) => {
                drive.set_current_reference(motor, reference)
            }
            Request::GetProfilerInfo(steps) => {
                if !features.has(Feature::Profiler) {
                    return Err(ErrorCode::MpNotEnabled.into());
                }
                for &step in steps {
                    let registers = drive.profiler_step(motor, step);
                    out.byte(registers.len() as u8).bytes(registers);
                }
            }
            Request::GetSegment(segment) => {
                let segment = self.segments.get(usize::from(segment)).ok_or(ErrorCode::WrongSet)?;
                for register in segment.registers() {
                    let refused = Nack::from(ErrorCode::GetWriteOnly);
                    let Some(row) = register.row() else { return Err(refused) };
                    let Some(size) = row.segment_size(features) else { return Err(refused) };
                    out.value(read(self.profile, motor, register, row, drive), size.get());
                }
            }
            Request::ConfigureSegment { segment, registers } => {
                let fits = |&id: &u8| {
                    RegisterId(id).row().is_some_and(|row| row.segment_size(features).is_some())
                };
                let slot = self.segments.get_mut(usize::from(segment));
                let slot = slot.filter(|_| registers.iter().all(fits));
                slot.and_then(|slot| slot.set(registers)).ok_or(ErrorCode::WrongSet)?;
            }
            Request::SetTorqueRamp(ramp) => drive.set_torque_ramp(motor, ramp),
            Request::SetPosition(target) => drive.set_position(motor, target),
        }
        Ok(out.finish().ok_or(ErrorCode::WrongSet)?)
    }

    /// Makes a motor the current one; `None` if it does not exist (3.2).
    fn select(&mut self, number: u8) -> Option<()> {
        let motor = MotorNumber::new(number).filter(|motor| motor.number() <= self.motors)?;
        self.current = motor;
        Some(())
    }

    /// SET_REG (4.4). Surplus bytes are ignored. If the value is too short, profile `spec` keeps
    /// the register's other bytes, and `mcsdk-5.4` refuses it.
    fn write(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: &[u8],
        features: Features,
        drive: &mut impl MotorControl,
    ) -> Result<(), Nack> {
        let row = register.row().ok_or(ErrorCode::SetReadOnly)?;
        let size = match row.writing(self.profile, features) {
            Writing::Takes(size) => usize::from(size),
            Writing::ReadOnly => return Err(ErrorCode::SetReadOnly.into()),
            Writing::Refused => return Err(ErrorCode::WrongSet.into()),
        };
        let mut bytes = [0; 4];
        if value.len() < size {
            if self.profile == Profile::Mcsdk54 {
                return Err(ErrorCode::WrongSet.into());
            }
            bytes = read(self.profile, motor, register, row, drive).to_le_bytes();
        }
        for (slot, byte) in bytes.iter_mut().zip(value.iter().take(size)) {
            *slot = *byte;
        }
        let bits = row.table_type().fit(i32::from_le_bytes(bytes));
        let bits = match register {
            RegisterId::TARGET_MOTOR => {
                let number = (bits as u8).saturating_add(1);
                return Ok(self.select(number).ok_or(ErrorCode::WrongSet)?);
            }
            RegisterId::DAC_OUT1 | RegisterId::DAC_OUT2 => {
                let shown = RegisterId(bits as u8).row();
                if shown.is_none_or(|row| !row.shows_on_dac(features)) {
                    // Firmware acknowledges registers that it cannot show; a slave of profile
                    // `spec` refuses them.
                    return match self.profile {
                        Profile::Spec => Err(ErrorCode::WrongSet.into()),
                        Profile::Mcsdk54 => Ok(()),
                    };
                }
                bits
            }
            _ => to_drive(self.profile, row, bits),
        };
        Ok(drive.set_register(motor, register, bits)?)
    }

    fn reply(&mut self, answer: Result<usize, Nack>) -> &[u8] {
        let (header, size) = match answer {
            Ok(size) => (HEADER_ACK, size),
            Err(Nack(code)) => {
                let [_, _, slot, ..] = &mut self.buffer;
                *slot = code;
                (HEADER_NACK, 1)
            }
        };
        frame::seal(&mut self.buffer, header, size).unwrap_or(&[])
    }
}

/// The error code that is sent. A number takes less flash than an [`ErrorCode`].
struct Nack(u8);

impl From<ErrorCode> for Nack {
    fn from(code: ErrorCode) -> Self {
        Nack(code.number())
    }
}

/// EXECUTE_CMD (4.6).
fn execute(
    profile: Profile,
    motor: MotorNumber,
    command: Command,
    features: Features,
    drive: &mut impl MotorControl,
) -> Result<(), Nack> {
    let firmware = profile == Profile::Mcsdk54;
    let (possible, command) = match command {
        Command::PfcEnable | Command::PfcDisable | Command::PfcFaultAck => {
            (features.has(Feature::Pfc), command)
        }
        Command::ScStart => (firmware && features.has(Feature::Profiler), command),
        Command::ScStop => (firmware, Command::StopMotor),
        Command::Reset | Command::Ping if firmware => return Ok(()),
        Command::Reset | Command::Ping | Command::Unknown(_) => (false, command),
        _ => (true, command),
    };
    if !possible {
        return Err(ErrorCode::WrongCmd.into());
    }
    drive.execute(motor, command);
    Ok(())
}

/// A register's value as it is sent.
fn read(
    profile: Profile,
    motor: MotorNumber,
    register: RegisterId,
    row: Row,
    drive: &mut impl MotorControl,
) -> i32 {
    if register == RegisterId::TARGET_MOTOR {
        return i32::from(motor.number() - 1);
    }
    let bits = drive.get_register(motor, register);
    match (profile, row.conversion()) {
        (Profile::Spec, Conversion::Percent) => bits / 10,
        // Table 3 has no sign for some values that can be negative (SPEC-NOTES S23).
        (Profile::Spec, _) if row.table_type() == Type::U16 => bits.max(0),
        (Profile::Mcsdk54, Conversion::Speed) => speed(profile, bits),
        _ => bits,
    }
}

/// A received value as the drive gets it.
fn to_drive(profile: Profile, row: Row, bits: i32) -> i32 {
    match row.conversion() {
        Conversion::Speed => speed(profile, bits),
        Conversion::Percent if profile == Profile::Spec => bits.saturating_mul(10),
        _ => bits,
    }
}

/// Shipped firmware stores speeds in tenths of a hertz, 6 rpm each (SPEC-NOTES S12).
#[inline(never)]
pub(super) fn speed(profile: Profile, rpm: i32) -> i32 {
    match profile {
        Profile::Spec => rpm,
        Profile::Mcsdk54 => rpm / 6 * 6,
    }
}

fn revup_phase(phase: u8) -> Result<u8, ErrorCode> {
    if phase < REVUP_PHASES { Ok(phase) } else { Err(ErrorCode::WrongSet) }
}

/// A NACK frame. The sum of header and length has one carry into the high byte, so the checksum is
/// the code plus one.
const fn nack(code: ErrorCode) -> [u8; 4] {
    let code = code.number();
    [HEADER_NACK, 1, code, code.wrapping_add(1)]
}

static TIMEOUT_REPLY: [u8; 4] = nack(ErrorCode::Timeout);

#[derive(Debug, Clone, Copy)]
struct Segment {
    len: u8,
    registers: [u8; SEGMENT_REGISTERS],
}

impl Segment {
    const EMPTY: Segment = Segment { len: 0, registers: [0; SEGMENT_REGISTERS] };
    // A constant is cleared at once, an expression segment by segment.
    const NONE: [Segment; SEGMENTS] = [Segment::EMPTY; SEGMENTS];

    /// `None` if there are too many.
    fn set(&mut self, registers: &[u8]) -> Option<()> {
        self.registers.get_mut(..registers.len())?.copy_from_slice(registers);
        self.len = u8::try_from(registers.len()).ok()?;
        Some(())
    }

    fn registers(&self) -> impl Iterator<Item = RegisterId> {
        self.registers.iter().take(usize::from(self.len)).copied().map(RegisterId)
    }
}
