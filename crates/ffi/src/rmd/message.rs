//! Requests and replies, by value: what goes in a frame as numbers with their units.

use motorlink_proto::rmd::{
    Acceleration, ClearErrors, Command, Encoder, EncoderBits, EncoderOffset, FULL_TURN,
    MotionStatus, MultiTurnAngle, Off, Payload, PhaseCurrents, Pid, ReadAcceleration, ReadEncoder,
    ReadMotionStatus, ReadMultiTurnAngle, ReadPhaseCurrents, ReadPid, ReadSingleTurnAngle,
    ReadStatus, Run, SetPosition, SetPositionLimited, SetSingleTurnPosition,
    SetSingleTurnPositionLimited, SetSpeed, SetTorque, SingleTurnAngle, SpinDirection, Status,
    Stop, WriteAccelerationRam, WriteEncoderOffsetRom, WritePidRam, WritePidRom, WriteZeroRom,
};
use motorlink_proto::units::{
    CentiDegrees, CentiDps, DpsPerSecond, IqCommand, SpeedLimit, TurnCentiDegrees,
};

use crate::number::motorlink_rmd_spin_direction;

/// The eight bytes of a request or a reply.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_data {
    /// DATA\[0\] to DATA\[7\].
    pub bytes: [u8; 8],
}

/// Gains of the three loops, without unit.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct motorlink_rmd_pid {
    pub position_kp: u8,
    pub position_ki: u8,
    pub speed_kp: u8,
    pub speed_ki: u8,
    pub torque_kp: u8,
    pub torque_ki: u8,
}

/// What the encoder reads, in counts of its width, or of 16 bits when it is wider.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_encoder {
    /// `raw` minus `offset`, modulo one turn.
    pub position: u16,
    /// The original position.
    pub raw: u16,
    /// The zero point.
    pub offset: u16,
}

/// Temperature, voltage and errors: the reply to 0x9A and 0x9B.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_status {
    /// Supply voltage, 0.1 V a digit.
    pub voltage_decivolts: u16,
    /// Motor temperature, °C.
    pub temperature_celsius: i8,
    /// Which protections are active: a sum of `MOTORLINK_RMD_ERROR_*`.
    pub errors: u8,
}

/// The reply to 0x9C, to every motion command and to 0x280.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_motion_status {
    /// Torque current, 33/2048 A a digit.
    pub iq_digits: i16,
    /// Speed, °/s, positive is clockwise.
    pub speed_dps: i16,
    /// Encoder position in counts of its width, the upper 16 bits of a wider one.
    pub encoder_counts: u16,
    /// Motor temperature, °C.
    pub temperature_celsius: i8,
}

/// Phase currents: the reply to 0x9D.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct motorlink_rmd_phase_currents {
    /// Phase A, 1/64 A a digit.
    pub phase_a_digits: i16,
    /// Phase B, 1/64 A a digit.
    pub phase_b_digits: i16,
    /// Phase C, 1/64 A a digit.
    pub phase_c_digits: i16,
}

impl From<Pid> for motorlink_rmd_pid {
    fn from(gains: Pid) -> Self {
        let Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki } = gains;
        motorlink_rmd_pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki }
    }
}

impl From<motorlink_rmd_pid> for Pid {
    fn from(gains: motorlink_rmd_pid) -> Self {
        let motorlink_rmd_pid {
            position_kp,
            position_ki,
            speed_kp,
            speed_ki,
            torque_kp,
            torque_ki,
        } = gains;
        Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki }
    }
}

fn data(command: impl Command) -> motorlink_rmd_data {
    motorlink_rmd_data { bytes: command.encode() }
}

/// Request 0x30: reads the gains in RAM.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_pid() -> motorlink_rmd_data {
    data(ReadPid)
}

/// Request 0x33: reads the acceleration limit.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_acceleration() -> motorlink_rmd_data {
    data(ReadAcceleration)
}

/// Request 0x90: reads the encoder.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_encoder() -> motorlink_rmd_data {
    data(ReadEncoder)
}

/// Request 0x19: makes the current position the zero from the next power-on on. Wears the ROM.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_write_zero_rom() -> motorlink_rmd_data {
    data(WriteZeroRom)
}

/// Request 0x92: reads the angle over all turns.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_multi_turn_angle() -> motorlink_rmd_data {
    data(ReadMultiTurnAngle)
}

/// Request 0x94: reads the angle within the turn.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_single_turn_angle() -> motorlink_rmd_data {
    data(ReadSingleTurnAngle)
}

/// Request 0x9A: reads temperature, voltage and errors.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_status() -> motorlink_rmd_data {
    data(ReadStatus)
}

/// Request 0x9B: clears the errors whose cause is gone. The reply is that to 0x9A.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_clear_errors() -> motorlink_rmd_data {
    data(ClearErrors)
}

/// Request 0x9C: reads temperature, torque current, speed and encoder.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_motion_status() -> motorlink_rmd_data {
    data(ReadMotionStatus)
}

/// Request 0x9D: reads the phase currents.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_read_phase_currents() -> motorlink_rmd_data {
    data(ReadPhaseCurrents)
}

/// Request 0x80: switches the motor off and forgets what it was doing.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_off() -> motorlink_rmd_data {
    data(Off)
}

/// Request 0x81: stops the motor and remembers what it was doing.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_stop() -> motorlink_rmd_data {
    data(Stop)
}

/// Request 0x88: resumes what 0x81 stopped. The motor may turn.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_run() -> motorlink_rmd_data {
    data(Run)
}

/// Request 0x31: sets the gains until power-off.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_write_pid_ram(pid: motorlink_rmd_pid) -> motorlink_rmd_data {
    data(WritePidRam(pid.into()))
}

/// Request 0x32: sets the gains for good. Wears the ROM.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_write_pid_rom(pid: motorlink_rmd_pid) -> motorlink_rmd_data {
    data(WritePidRom(pid.into()))
}

/// Request 0x34: sets the acceleration limit, °/s², until power-off.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_write_acceleration_ram(
    acceleration_dps2: i32,
) -> motorlink_rmd_data {
    data(WriteAccelerationRam(Acceleration { acceleration: DpsPerSecond(acceleration_dps2) }))
}

/// Request 0x91: sets the encoder's zero point, in counts, at once and for good. Wears the ROM.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_write_encoder_offset_rom(offset: u16) -> motorlink_rmd_data {
    data(WriteEncoderOffsetRom(EncoderOffset { offset }))
}

/// Request 0xA1: holds a torque current, 0.016 A a digit, -2000 to 2000.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_set_torque(iq_16ma: i16) -> motorlink_rmd_data {
    data(SetTorque { iq: IqCommand(iq_16ma) })
}

/// Request 0xA2: holds a speed, 0.01 °/s a digit, positive is clockwise.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_set_speed(speed_centidps: i32) -> motorlink_rmd_data {
    data(SetSpeed { speed: CentiDps(speed_centidps) })
}

/// Request 0xA3: turns to a multi-turn angle, 0.01° a digit, positive is clockwise from zero.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_set_position(angle_centidegrees: i32) -> motorlink_rmd_data {
    data(SetPosition { angle: CentiDegrees(angle_centidegrees) })
}

/// Request 0xA4: turns to a multi-turn angle, 0.01° a digit, no faster than a limit, °/s.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_set_position_limited(
    angle_centidegrees: i32,
    max_speed_dps: u16,
) -> motorlink_rmd_data {
    data(SetPositionLimited {
        max_speed: SpeedLimit(max_speed_dps),
        angle: CentiDegrees(angle_centidegrees),
    })
}

/// Request 0xA5: turns to an angle within the turn, 0.01° a digit, 0 to 35999.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_set_single_turn_position(
    direction: motorlink_rmd_spin_direction,
    angle_centidegrees: u16,
) -> motorlink_rmd_data {
    data(SetSingleTurnPosition {
        direction: SpinDirection::from(direction),
        angle: TurnCentiDegrees(angle_centidegrees),
    })
}

/// Request 0xA6: as 0xA5, no faster than a limit, °/s.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_set_single_turn_position_limited(
    direction: motorlink_rmd_spin_direction,
    angle_centidegrees: u16,
    max_speed_dps: u16,
) -> motorlink_rmd_data {
    data(SetSingleTurnPositionLimited {
        direction: SpinDirection::from(direction),
        max_speed: SpeedLimit(max_speed_dps),
        angle: TurnCentiDegrees(angle_centidegrees),
    })
}

/// Reads the gains in the reply to 0x30, 0x31 and 0x32.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_pid(reply: motorlink_rmd_data) -> motorlink_rmd_pid {
    Pid::decode(&reply.bytes).into()
}

/// Reads the acceleration limit in the reply to 0x33 and 0x34, °/s².
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_acceleration(reply: motorlink_rmd_data) -> i32 {
    Acceleration::decode(&reply.bytes).acceleration.0
}

/// Reads the encoder in the reply to 0x90.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_encoder(reply: motorlink_rmd_data) -> motorlink_rmd_encoder {
    let Encoder { position, raw, offset } = Encoder::decode(&reply.bytes);
    motorlink_rmd_encoder { position, raw, offset }
}

/// Reads the zero point in the reply to 0x91 and 0x19, in encoder counts.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_encoder_offset(reply: motorlink_rmd_data) -> u16 {
    EncoderOffset::decode(&reply.bytes).offset
}

/// Reads the angle over all turns in the reply to 0x92, 0.01° a digit, positive is clockwise.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_multi_turn_angle(reply: motorlink_rmd_data) -> i64 {
    MultiTurnAngle::decode(&reply.bytes).angle.0
}

/// Reads the angle within the turn in the reply to 0x94, 0.01° a digit, 0 to 35999.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_single_turn_angle(reply: motorlink_rmd_data) -> u16 {
    SingleTurnAngle::decode(&reply.bytes).angle.0
}

/// Reads temperature, voltage and errors in the reply to 0x9A and 0x9B.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_status(reply: motorlink_rmd_data) -> motorlink_rmd_status {
    let Status { temperature, voltage, errors } = Status::decode(&reply.bytes);
    motorlink_rmd_status {
        voltage_decivolts: voltage.0,
        temperature_celsius: temperature.0,
        errors: errors.0,
    }
}

/// Reads the status in the reply to 0x9C, to every motion command and to 0x280.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_motion_status(
    reply: motorlink_rmd_data,
) -> motorlink_rmd_motion_status {
    let MotionStatus { temperature, iq, speed, encoder } = MotionStatus::decode(&reply.bytes);
    motorlink_rmd_motion_status {
        iq_digits: iq.0,
        speed_dps: speed.0,
        encoder_counts: encoder,
        temperature_celsius: temperature.0,
    }
}

/// Reads the phase currents in the reply to 0x9D.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_decode_phase_currents(
    reply: motorlink_rmd_data,
) -> motorlink_rmd_phase_currents {
    let PhaseCurrents { phase_a, phase_b, phase_c } = PhaseCurrents::decode(&reply.bytes);
    motorlink_rmd_phase_currents {
        phase_a_digits: phase_a.0,
        phase_b_digits: phase_b.0,
        phase_c_digits: phase_c.0,
    }
}

/// An encoder value of a reply as an angle, 0.01° a digit; `encoder_bits` is the encoder's width,
/// 12 to 18. 0 for any other width.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_rmd_encoder_centidegrees(counts: u16, encoder_bits: u8) -> u16 {
    let Some(bits) = EncoderBits::new(encoder_bits) else { return 0 };
    // Of a wider encoder the upper 16 bits travel.
    let width = u32::from(bits.bits().min(16));
    (u32::from(counts) * u32::from(FULL_TURN)).wrapping_shr(width) as u16
}
