//! One request to an RMD motor: checked when it is made, and able to read its reply.

use motorlink::rmd::FullTurn;
use motorlink_proto::Hex;
use motorlink_proto::rmd::{
    Acceleration, ClearErrors, Code, Command, Encoder, EncoderOffset, Errors, MotionStatus,
    MotorId, MultiTurnAngle, Off, Payload, PhaseCurrents, Pid, ReadAcceleration, ReadEncoder,
    ReadMotionStatus, ReadMultiTurnAngle, ReadPhaseCurrents, ReadPid, ReadSingleTurnAngle,
    ReadStatus, Run, SetPosition, SetPositionLimited, SetSingleTurnPosition,
    SetSingleTurnPositionLimited, SetSpeed, SetTorque, SingleTurnAngle, SpinDirection, Status,
    Stop, WriteAccelerationRam, WriteEncoderOffsetRom, WritePidRam, WritePidRom, WriteZeroRom,
};
use motorlink_proto::units::{DeciVolts, Quantity, TurnCentiDegrees, WideCentiDegrees};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};

use crate::error::{bad_value, rmd_error};
use crate::number::{digits, wanted};
use crate::values;

/// A request to an RMD motor.
#[pyclass(frozen, eq, hash, module = "motorlink._core")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct RmdRequest {
    data: [u8; 8],
    /// Whether the reply is wanted as bytes.
    plain: bool,
}

impl RmdRequest {
    /// A typed command.
    pub(crate) fn of(command: impl Command) -> Self {
        RmdRequest { data: command.encode(), plain: false }
    }

    /// A command whose reply is wanted as bytes.
    pub(super) fn plain(data: [u8; 8]) -> Self {
        RmdRequest { data, plain: true }
    }

    /// The eight bytes of the request.
    pub(crate) fn data(&self) -> [u8; 8] {
        self.data
    }

    /// The reply for Python.
    pub(crate) fn value(&self, py: Python<'_>, reply: &[u8; 8]) -> PyResult<Py<PyAny>> {
        if self.plain {
            return PyBytes::new(py, reply).into_py_any(py);
        }
        match Code::from(self.data[0]) {
            Code::ReadPid | Code::WritePidRam | Code::WritePidRom => {
                let gains = Pid::decode(reply);
                let Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki } =
                    gains;
                values::gains(
                    py,
                    (position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki),
                )
            }
            Code::ReadAcceleration | Code::WriteAccelerationRam => {
                Acceleration::decode(reply).acceleration.0.into_py_any(py)
            }
            Code::ReadEncoder => {
                let Encoder { position, raw, offset } = Encoder::decode(reply);
                values::encoder(py, (position, raw, offset))
            }
            Code::WriteEncoderOffsetRom | Code::WriteZeroRom => {
                EncoderOffset::decode(reply).offset.into_py_any(py)
            }
            Code::ReadMultiTurnAngle => {
                WideCentiDegrees::UNIT.value(MultiTurnAngle::decode(reply).angle.0).into_py_any(py)
            }
            Code::ReadSingleTurnAngle => TurnCentiDegrees::UNIT
                .value(SingleTurnAngle::decode(reply).angle.0.into())
                .into_py_any(py),
            Code::ReadStatus | Code::ClearErrors => motor_status(py, &Status::decode(reply)),
            Code::ReadPhaseCurrents => {
                let PhaseCurrents { phase_a, phase_b, phase_c } = PhaseCurrents::decode(reply);
                values::phase_currents(py, (phase_a.amps(), phase_b.amps(), phase_c.amps()))
            }
            Code::Off | Code::Stop | Code::Run => Ok(py.None()),
            Code::ReadMotionStatus
            | Code::SetTorque
            | Code::SetSpeed
            | Code::SetPosition
            | Code::SetPositionLimited
            | Code::SetSingleTurnPosition
            | Code::SetSingleTurnPositionLimited => motion_status(py, &MotionStatus::decode(reply)),
            Code::Unknown(_) => PyBytes::new(py, reply).into_py_any(py),
        }
    }
}

/// The reply to 0x9C and to commands that move a motor.
pub(crate) fn motion_status(py: Python<'_>, status: &MotionStatus) -> PyResult<Py<PyAny>> {
    let MotionStatus { temperature, iq, speed, encoder } = status;
    values::motion_status(py, (temperature.0, iq.amps(), speed.0, *encoder))
}

/// The reply to 0x9A.
pub(crate) fn motor_status(py: Python<'_>, status: &Status) -> PyResult<Py<PyAny>> {
    let errors = values::motor_errors(py, (errors(py, status.errors)?, status.errors.0))?;
    let voltage = DeciVolts::UNIT.value(status.voltage.0.into());
    values::motor_status(py, (status.temperature.0, voltage, errors))
}

/// The document's words for error bits; the number of a bit that has none.
fn errors(py: Python<'_>, errors: Errors) -> PyResult<Bound<'_, PyTuple>> {
    PyTuple::new(py, errors.words().collect::<Vec<_>>())
}

#[pymethods]
impl RmdRequest {
    /// Holds a torque current, A (0xA1).
    #[staticmethod]
    fn torque(py: Python<'_>, amps: f64) -> PyResult<Self> {
        Ok(Self::of(SetTorque { iq: wanted(py, amps)? }))
    }

    /// Holds a speed, °/s (0xA2).
    #[staticmethod]
    fn speed(py: Python<'_>, dps: f64) -> PyResult<Self> {
        Ok(Self::of(SetSpeed { speed: wanted(py, dps)? }))
    }

    /// Turns to an angle over all turns, ° (0xA3), no faster than `max_speed`, °/s (0xA4).
    #[staticmethod]
    #[pyo3(signature = (degrees, max_speed = None))]
    fn move_to(py: Python<'_>, degrees: f64, max_speed: Option<f64>) -> PyResult<Self> {
        let angle = wanted(py, degrees)?;
        Ok(match max_speed {
            None => Self::of(SetPosition { angle }),
            Some(dps) => Self::of(SetPositionLimited { max_speed: wanted(py, dps)?, angle }),
        })
    }

    /// Turns to an angle within the turn, ° (0xA5), no faster than `max_speed`, °/s (0xA6).
    #[staticmethod]
    #[pyo3(signature = (degrees, max_speed = None, *, clockwise = true))]
    fn turn_to(
        py: Python<'_>,
        degrees: f64,
        max_speed: Option<f64>,
        clockwise: bool,
    ) -> PyResult<Self> {
        let angle = wanted(py, degrees)?;
        let direction =
            if clockwise { SpinDirection::Clockwise } else { SpinDirection::Counterclockwise };
        Ok(match max_speed {
            None => Self::of(SetSingleTurnPosition { direction, angle }),
            Some(dps) => {
                let max_speed = wanted(py, dps)?;
                Self::of(SetSingleTurnPositionLimited { direction, max_speed, angle })
            }
        })
    }

    /// Refuses this `turn_to` for a motor at `angle`, °, from where it could be nearly a full turn.
    fn check_full_turn(
        &self,
        py: Python<'_>,
        motor: i64,
        angle: f64,
        tolerance: f64,
    ) -> PyResult<()> {
        let id = motor_id(py, motor)?;
        let at = wanted(py, angle)?;
        let tolerance = TurnCentiDegrees::wanted(tolerance)
            .map_err(|error| bad_value(py, format_args!("tolerance: {error}; nothing was sent")))?;
        let SetSingleTurnPosition { direction, angle } = SetSingleTurnPosition::decode(&self.data);
        let checked = FullTurn::Refused { tolerance }.check(id, at, angle, direction);
        checked.map_err(|error| rmd_error(py, &error))
    }

    /// Switches the motor off and forgets what it was doing (0x80).
    #[staticmethod]
    fn off() -> Self {
        Self::of(Off)
    }

    /// Stops the motor and remembers what it was doing (0x81).
    #[staticmethod]
    fn stop() -> Self {
        Self::of(Stop)
    }

    /// Resumes what a stop stopped (0x88).
    #[staticmethod]
    fn run() -> Self {
        Self::of(Run)
    }

    /// Reads temperature, voltage and errors (0x9A).
    #[staticmethod]
    fn read_status() -> Self {
        Self::of(ReadStatus)
    }

    /// Clears the errors whose cause is gone (0x9B).
    #[staticmethod]
    fn clear_errors() -> Self {
        Self::of(ClearErrors)
    }

    /// Reads temperature, torque current, speed and encoder (0x9C).
    #[staticmethod]
    fn read_motion() -> Self {
        Self::of(ReadMotionStatus)
    }

    /// Reads the phase currents (0x9D).
    #[staticmethod]
    fn read_phase_currents() -> Self {
        Self::of(ReadPhaseCurrents)
    }

    /// Reads the gains in RAM (0x30).
    #[staticmethod]
    fn read_gains() -> Self {
        Self::of(ReadPid)
    }

    /// Sets the gains until power-off (0x31), or for good (0x32), which wears the ROM.
    #[staticmethod]
    #[pyo3(signature = (
        position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki, *, rom = false,
    ))]
    fn write_gains(
        py: Python<'_>,
        position_kp: i64,
        position_ki: i64,
        speed_kp: i64,
        speed_ki: i64,
        torque_kp: i64,
        torque_ki: i64,
        rom: bool,
    ) -> PyResult<Self> {
        let gain = |value: i64| -> PyResult<u8> {
            let gain = u8::try_from(value);
            gain.map_err(|_| bad_value(py, format_args!("gains are 0 to 255, not {value}")))
        };
        let gains = Pid {
            position_kp: gain(position_kp)?,
            position_ki: gain(position_ki)?,
            speed_kp: gain(speed_kp)?,
            speed_ki: gain(speed_ki)?,
            torque_kp: gain(torque_kp)?,
            torque_ki: gain(torque_ki)?,
        };
        Ok(if rom { Self::of(WritePidRom(gains)) } else { Self::of(WritePidRam(gains)) })
    }

    /// Reads the acceleration limit (0x33).
    #[staticmethod]
    fn read_acceleration() -> Self {
        Self::of(ReadAcceleration)
    }

    /// Sets the acceleration limit until power-off, °/s² (0x34).
    #[staticmethod]
    fn write_acceleration(py: Python<'_>, dps2: f64) -> PyResult<Self> {
        let acceleration = wanted(py, dps2)?;
        Ok(Self::of(WriteAccelerationRam(Acceleration { acceleration })))
    }

    /// Reads encoder position, original position and offset (0x90).
    #[staticmethod]
    fn read_encoder() -> Self {
        Self::of(ReadEncoder)
    }

    /// Sets the encoder offset, at once and for good (0x91). Wears the ROM.
    #[staticmethod]
    fn write_encoder_offset_to_rom(py: Python<'_>, counts: f64) -> PyResult<Self> {
        let offset = digits(py, "an offset", counts, 1.0, "counts")?;
        Ok(Self::of(WriteEncoderOffsetRom(EncoderOffset { offset })))
    }

    /// Makes the current position the zero from the next power-on on (0x19). Wears the ROM.
    #[staticmethod]
    fn write_zero_to_rom() -> Self {
        Self::of(WriteZeroRom)
    }

    /// Reads the angle over all turns (0x92).
    #[staticmethod]
    fn read_angle() -> Self {
        Self::of(ReadMultiTurnAngle)
    }

    /// Reads the angle within the turn (0x94).
    #[staticmethod]
    fn read_circle_angle() -> Self {
        Self::of(ReadSingleTurnAngle)
    }

    /// Eight bytes as they are, answered with eight bytes. `rom` allows those that wear the ROM.
    #[staticmethod]
    #[pyo3(signature = (data, *, rom = false))]
    fn raw(py: Python<'_>, data: &[u8], rom: bool) -> PyResult<Self> {
        let request = RmdRequest { data: eight(py, data)?, plain: true };
        if request.is_rom() && !rom {
            let code = request.code();
            let why = format!("{code:#04x} writes to the motor's ROM, which wears: say rom=True");
            return Err(bad_value(py, why));
        }
        Ok(request)
    }

    /// The request in eight bytes.
    #[staticmethod]
    fn decode(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        let data = eight(py, data)?;
        if Code::from(data[0]).info().is_none() {
            return Err(bad_value(py, format_args!("{:#04x} is no command of V1.62", data[0])));
        }
        Ok(RmdRequest { data, plain: false })
    }

    /// The eight bytes of the request.
    fn encode<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.data)
    }

    /// What eight bytes say as the reply to this request.
    fn decode_reply(&self, py: Python<'_>, data: &[u8]) -> PyResult<Py<PyAny>> {
        self.value(py, &eight(py, data)?)
    }

    /// DATA[0]: what is asked for.
    #[getter]
    fn code(&self) -> u8 {
        self.data[0]
    }

    /// Whether the motor writes to its ROM, which wears.
    #[getter]
    fn is_rom(&self) -> bool {
        Code::from(self.data[0]).info().is_some_and(|row| row.rom)
    }

    fn __repr__(&self) -> String {
        format!("<Request {} ({})>", Hex(&self.data), Code::from(self.data[0]))
    }
}

/// A motor ID, 1 to 32.
pub(crate) fn motor_id(py: Python<'_>, id: i64) -> PyResult<MotorId> {
    u8::try_from(id).ok().and_then(MotorId::new).ok_or_else(|| {
        bad_value(py, format_args!("motor {id} does not exist: motor IDs are 1 to 32"))
    })
}

pub(crate) fn eight(py: Python<'_>, data: &[u8]) -> PyResult<[u8; 8]> {
    let size = data.len();
    data.try_into().map_err(|_| bad_value(py, format_args!("a frame has 8 bytes, not {size}")))
}
