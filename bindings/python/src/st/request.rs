//! One request to an ST drive: it checks its arguments and reads its reply.

use motorlink::st::{Error, Target};
use motorlink_proto::st::{
    Command, CurrentReference, ErrorCode, Frame, HEADER_ACK, HEADER_NACK, MAX_FRAME, MotorNumber,
    OwnedRequest, PositionMove, REVUP_PHASES, Ramp, RegisterId, Request, RevupPhase, SEGMENTS,
    TorqueRamp,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};

use super::frame;
use super::reply::{Answer, Reply};
use super::scale::{Scale, register};
use crate::error::{implausible, invalid_value, refusal};
use crate::number::{digits, milliseconds};

/// A request to an ST drive, in the units of one motor. It checks its arguments and reads its
/// reply.
#[pyclass(frozen, eq, module = "motorlink._core")]
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StRequest {
    request: OwnedRequest,
    scale: Scale,
    reply: Reply,
}

impl StRequest {
    fn told(scale: Scale, request: Request<'_>) -> Self {
        Self::asked(scale, request, Reply::Nothing)
    }

    fn asked(scale: Scale, request: Request<'_>, reply: Reply) -> Self {
        StRequest { request: request.into(), scale, reply }
    }

    /// A message whose reply is returned as bytes.
    pub(crate) fn for_bytes(request: OwnedRequest) -> Self {
        StRequest { request, scale: Scale::plain(), reply: Reply::Bytes }
    }

    /// The request for a client.
    pub(crate) fn request(&self) -> Request<'_> {
        self.request.request()
    }

    /// Reads the payload of a positive acknowledge; `None` if it does not fit the request.
    pub(crate) fn understand(&self, payload: &[u8]) -> Option<Answer> {
        self.reply.understand(self.scale.profile, payload)
    }

    /// Checks that the profile may be right for the values of a reply.
    pub(crate) fn plausible(&self, port: &str, motor: u8, answer: &Answer) -> Result<(), Error> {
        let (port, motor) = (port.into(), Target(motor));
        let plausible = self.reply.plausible(&self.scale, answer);
        plausible.map_err(|why| Error::Implausible { port, motor, why })
    }

    /// Reads a register.
    pub(super) fn reading(scale: Scale, register: RegisterId, raw: bool) -> Self {
        Self::asked(scale, Request::GetRegister(register), Reply::Number { register, raw })
    }

    /// Writes these bytes to a register.
    pub(super) fn writing(register: RegisterId, value: &[u8]) -> Self {
        Self::told(Scale::plain(), Request::SetRegister { register, value })
    }

    /// Selects the registers of a data segment.
    pub(super) fn choosing(segment: u8, registers: &[RegisterId]) -> Self {
        let registers: Vec<u8> = registers.iter().map(|register| register.0).collect();
        let request = Request::ConfigureSegment { segment, registers: &registers };
        Self::told(Scale::plain(), request)
    }

    /// Reads a data segment that has these registers.
    pub(super) fn sampling(scale: Scale, segment: u8, registers: &[RegisterId], raw: bool) -> Self {
        let reply = Reply::Segment { registers: registers.to_vec(), raw };
        Self::asked(scale, Request::GetSegment(segment), reply)
    }

    /// The value for Python.
    pub(crate) fn value(&self, py: Python<'_>, answer: Answer) -> PyResult<Py<PyAny>> {
        self.reply.value(py, &self.scale, answer)
    }
}

#[pymethods]
impl StRequest {
    /// Reads a register (0x02, 4.5).
    #[staticmethod]
    #[pyo3(signature = (register, *, profile = "spec", raw = false, full_scale_amps = None))]
    fn get_register(
        py: Python<'_>,
        #[pyo3(from_py_with = super::scale::register)] register: RegisterId,
        profile: &str,
        raw: bool,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        Ok(Self::reading(Scale::new(py, profile, full_scale_amps)?, register, raw))
    }

    /// Writes a register (0x01, 4.4).
    #[staticmethod]
    #[pyo3(signature = (register, value, *, profile = "spec", raw = false, full_scale_amps = None))]
    fn set_register(
        py: Python<'_>,
        #[pyo3(from_py_with = super::scale::register)] register: RegisterId,
        value: &Bound<'_, PyAny>,
        profile: &str,
        raw: bool,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let scale = Scale::new(py, profile, full_scale_amps)?;
        let bits = scale.bits(register, value, raw)?;
        let size = usize::from(register.write_size(scale.profile).min(4));
        let value = &bits.to_le_bytes()[..size];
        Ok(Self::told(scale, Request::SetRegister { register, value }))
    }

    /// Writes any bytes to any register (0x01, 4.4).
    #[staticmethod]
    fn set_register_bytes(
        py: Python<'_>,
        #[pyo3(from_py_with = super::scale::register)] register: RegisterId,
        value: Vec<u8>,
    ) -> PyResult<Self> {
        Self::writing(register, &value).fitting(py)
    }

    /// Reads the register STATUS. The value is a `Status`.
    #[staticmethod]
    fn status() -> Self {
        Self::asked(Scale::plain(), Request::GetRegister(RegisterId::STATUS), Reply::Status)
    }

    /// Reads the register FLAGS. The value is a `Flags`.
    #[staticmethod]
    fn flags() -> Self {
        Self::asked(Scale::plain(), Request::GetRegister(RegisterId::FLAGS), Reply::Flags)
    }

    /// Reads the register CONTROL_MODE. The value is a `ControlMode`.
    #[staticmethod]
    fn control_mode() -> Self {
        let request = Request::GetRegister(RegisterId::CONTROL_MODE);
        Self::asked(Scale::plain(), request, Reply::ControlMode)
    }

    /// Executes a command by name or number (0x03, 4.6).
    #[staticmethod]
    fn execute_command(py: Python<'_>, command: &Bound<'_, PyAny>) -> PyResult<Self> {
        let command = match command.cast::<PyString>() {
            Ok(name) => named_command(py, &name.to_cow()?)?,
            Err(_) => {
                let number: i64 = command.extract()?;
                Command::from(u8::try_from(number).map_err(|_| {
                    invalid_value(py, format_args!("commands are 0 to 255, not {number}"))
                })?)
            }
        };
        Ok(Self::told(Scale::plain(), Request::ExecuteCommand(command)))
    }

    /// Reads version and name of the SDK (0x06, 4.7).
    #[staticmethod]
    fn get_board_info() -> Self {
        Self::asked(Scale::plain(), Request::GetBoardInfo, Reply::BoardInfo)
    }

    /// Reads name and version of the firmware (0x0C, 4.12).
    #[staticmethod]
    fn get_firmware_version() -> Self {
        Self::asked(Scale::plain(), Request::GetFirmwareVersion, Reply::FirmwareVersion)
    }

    /// Programs a speed ramp: rpm, s (0x07, 4.8).
    #[staticmethod]
    fn set_ramp(py: Python<'_>, speed_rpm: f64, duration_s: f64) -> PyResult<Self> {
        let speed_rpm = rpm(py, speed_rpm)?;
        let ramp = Ramp { speed_rpm, duration_ms: milliseconds(py, duration_s)? };
        if !ramp.is_possible() {
            let most = Ramp::MAX_SPEED_RPM;
            let why = format_args!(
                "a drive can hold -{most} to {most} rpm, not {speed_rpm} rpm; nothing was sent"
            );
            return Err(invalid_value(py, why));
        }
        Ok(Self::told(Scale::plain(), Request::SetRamp(ramp)))
    }

    /// Programs a torque ramp: Iq, s (0x0D of profile `mcsdk-5.4`).
    #[staticmethod]
    #[pyo3(signature = (torque, duration_s, *, full_scale_amps = None))]
    fn set_torque_ramp(
        py: Python<'_>,
        torque: f64,
        duration_s: f64,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let scale = Scale::plain().with_full_scale(py, full_scale_amps)?;
        let torque_s16a = scale.digits(py, torque)?;
        let ramp = TorqueRamp { torque_s16a, duration_ms: milliseconds(py, duration_s)? };
        Ok(Self::told(scale, Request::SetTorqueRamp(ramp)))
    }

    /// Sets the current references Iq and Id (0x0A, 4.11).
    #[staticmethod]
    #[pyo3(signature = (iq, id, *, full_scale_amps = None))]
    fn set_current_reference(
        py: Python<'_>,
        iq: f64,
        id: f64,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let scale = Scale::plain().with_full_scale(py, full_scale_amps)?;
        let (iq_s16a, id_s16a) = (scale.digits(py, iq)?, scale.digits(py, id)?);
        let request = Request::SetCurrentReference(CurrentReference { iq_s16a, id_s16a });
        Ok(Self::told(scale, request))
    }

    /// Turns to an angle: rad, s (0x12 of profile `mcsdk-5.4`).
    #[staticmethod]
    fn set_position(py: Python<'_>, angle_rad: f64, duration_s: f64) -> PyResult<Self> {
        let (angle, duration) = (angle_rad as f32, duration_s as f32);
        if !angle.is_finite() || !duration.is_finite() || duration < 0.0 {
            let move_ =
                format!("{angle_rad} rad in {duration_s} s is not a move; nothing was sent");
            return Err(invalid_value(py, move_));
        }
        let target = PositionMove { angle_rad: angle, duration_s: duration };
        Ok(Self::told(Scale::plain(), Request::SetPosition(target)))
    }

    /// Reads a rev-up phase, 0 to 4 (0x08, 4.9).
    #[staticmethod]
    #[pyo3(signature = (phase, *, full_scale_amps = None))]
    fn get_revup_data(py: Python<'_>, phase: i64, full_scale_amps: Option<f64>) -> PyResult<Self> {
        let scale = Scale::plain().with_full_scale(py, full_scale_amps)?;
        let phase = below(py, "rev-up phase", phase, REVUP_PHASES.into())?;
        Ok(Self::asked(scale, Request::GetRevupData(phase), Reply::Revup))
    }

    /// Sets a rev-up phase, 0 to 4: rpm, Iq, s (0x09, 4.10).
    #[staticmethod]
    #[pyo3(signature = (phase, speed_rpm, torque, duration_s, *, full_scale_amps = None))]
    fn set_revup_data(
        py: Python<'_>,
        phase: i64,
        speed_rpm: f64,
        torque: f64,
        duration_s: f64,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let scale = Scale::plain().with_full_scale(py, full_scale_amps)?;
        let phase = below(py, "rev-up phase", phase, REVUP_PHASES.into())?;
        let data = RevupPhase {
            speed_rpm: rpm(py, speed_rpm)?,
            torque_s16a: scale.digits(py, torque)?,
            duration_ms: milliseconds(py, duration_s)?,
        };
        Ok(Self::told(scale, Request::SetRevupData(phase, data)))
    }

    /// Selects the registers of a data segment, 0 to 3, at most 32 (0x0E, profile `spec`).
    #[staticmethod]
    fn configure_segment(
        py: Python<'_>,
        segment: i64,
        registers: Vec<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let segment = below(py, "data segment", segment, SEGMENTS)?;
        let registers: PyResult<Vec<_>> = registers.iter().map(register).collect();
        Self::choosing(segment, &registers?).fitting(py)
    }

    /// Reads a data segment that was configured with these registers (0x0D, profile `spec`).
    #[staticmethod]
    #[pyo3(signature = (segment, registers, *, raw = false, full_scale_amps = None))]
    fn get_segment(
        py: Python<'_>,
        segment: i64,
        registers: Vec<Bound<'_, PyAny>>,
        raw: bool,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let scale = Scale::plain().with_full_scale(py, full_scale_amps)?;
        let segment = below(py, "data segment", segment, SEGMENTS)?;
        let registers = segment_registers(py, &registers)?;
        Ok(Self::sampling(scale, segment, &registers, raw))
    }

    /// Lists the registers of motor profiler steps (0x0B of profile `mcsdk-5.4`).
    #[staticmethod]
    fn get_profiler_info(py: Python<'_>, steps: Vec<u8>) -> PyResult<Self> {
        Self::asked(Scale::plain(), Request::GetProfilerInfo(&steps), Reply::Bytes).fitting(py)
    }

    /// The motor and the request of a frame.
    #[staticmethod]
    #[pyo3(signature = (frame, *, profile = "spec"))]
    fn decode(py: Python<'_>, frame: &[u8], profile: &str) -> PyResult<(u8, Self)> {
        let scale = Scale::new(py, profile, None)?;
        let parsed = frame::parse(py, frame)?;
        let request = parsed.request(scale.profile).map_err(|code| {
            let header = parsed.header;
            invalid_value(
                py,
                format_args!("{header:#04x} does not begin a request of profile {profile}: {code}"),
            )
        })?;
        Ok((parsed.motor(), Self::decoded(scale, request)))
    }

    /// The frame for a motor, 1 to 7. Motor 0 is the one that the drive has selected.
    #[pyo3(signature = (motor = 0))]
    fn encode<'py>(&self, py: Python<'py>, motor: i64) -> PyResult<Bound<'py, PyBytes>> {
        let motor = motor_number(py, motor)?;
        let mut out = [0; MAX_FRAME];
        match Frame::command(motor, &self.request(), &mut out) {
            Some(frame) => Ok(PyBytes::new(py, frame)),
            None => Err(frame::too_long(py)),
        }
    }

    /// The value of a reply frame to this request.
    ///
    /// Raises `RefusedError` for a negative acknowledge, `ImplausibleValueError` for a value of
    /// another profile, `InvalidValueError` for another frame.
    fn decode_reply(&self, py: Python<'_>, frame: &[u8]) -> PyResult<Py<PyAny>> {
        let parsed = frame::parse(py, frame)?;
        let answer = match (parsed.header, parsed.payload) {
            (HEADER_ACK, payload) => self.understand(payload),
            (HEADER_NACK, [code, ..]) => return Err(refusal(py, ErrorCode::from(*code))),
            _ => None,
        };
        let code = self.code();
        match answer {
            Some(answer) => {
                let plausible = self.reply.plausible(&self.scale, &answer);
                plausible.map_err(|why| implausible(py, &why))?;
                self.value(py, answer)
            }
            None => Err(invalid_value(py, format_args!("these bytes are not a reply to {code}"))),
        }
    }

    /// The document's name of the frame code: `GET_REG`.
    #[getter]
    fn code(&self) -> &'static str {
        self.request().code().name()
    }

    /// Whether the request only reads. Other requests change something in the drive.
    #[getter]
    fn is_read(&self) -> bool {
        self.request().is_read()
    }

    /// The raw protocol values of the request, by name.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        frame::fields(py, self.request())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<Request {} {}>", self.code(), self.fields(py)?))
    }
}

impl StRequest {
    /// What the reply to a decoded request becomes. Its numbers are digits.
    fn decoded(scale: Scale, request: Request<'_>) -> Self {
        Self::asked(scale, request, frame::reply(request))
    }

    /// The request, if it fits a frame.
    fn fitting(self, py: Python<'_>) -> PyResult<Self> {
        let fits = Frame::command(0, &self.request(), &mut [0; MAX_FRAME]).is_some();
        if fits { Ok(self) } else { Err(frame::too_long(py)) }
    }

    /// The register and the bits of a write. Other requests cannot be verified.
    pub(super) fn verifiable(&self, py: Python<'_>) -> PyResult<(RegisterId, i32)> {
        let Request::SetRegister { register, value } = self.request() else {
            return Err(invalid_value(py, "only a write can be verified"));
        };
        let mut bits = [0; 4];
        bits.iter_mut().zip(value).for_each(|(slot, byte)| *slot = *byte);
        Ok((register, i32::from_le_bytes(bits)))
    }
}

/// A motor number, 0 to 7, where 0 is the motor that the drive has selected.
pub(crate) fn motor_number(py: Python<'_>, motor: i64) -> PyResult<u8> {
    let number = u8::try_from(motor).ok().filter(|number| *number <= MotorNumber::MAX);
    number.ok_or_else(|| no_such_motor(py, motor))
}

/// The error of a motor number that no drive has.
pub(crate) fn no_such_motor(py: Python<'_>, motor: i64) -> PyErr {
    invalid_value(py, format_args!("motor {motor} does not exist: motor numbers are 1 to 7"))
}

fn named_command(py: Python<'_>, name: &str) -> PyResult<Command> {
    let known =
        |command: &&Command| command.name().is_some_and(|known| known.eq_ignore_ascii_case(name));
    Command::ALL.iter().find(known).copied().ok_or_else(|| {
        let names: Vec<_> = Command::ALL.iter().filter_map(|command| command.name()).collect();
        invalid_value(
            py,
            format_args!("unknown command `{name}`: the commands are {}", names.join(", ")),
        )
    })
}

fn rpm(py: Python<'_>, speed: f64) -> PyResult<i32> {
    digits(py, "a speed", speed, 1.0, "rpm")
}

fn below(py: Python<'_>, what: &str, number: i64, end: usize) -> PyResult<u8> {
    let fits = usize::try_from(number).is_ok_and(|number| number < end);
    let number = u8::try_from(number).ok().filter(|_| fits);
    number.ok_or_else(|| invalid_value(py, format_args!("{what}s are 0 to {}", end - 1)))
}

/// Registers whose sizes are known.
fn segment_registers(py: Python<'_>, names: &[Bound<'_, PyAny>]) -> PyResult<Vec<RegisterId>> {
    if names.is_empty() {
        return Err(invalid_value(
            py,
            "the registers of this data segment are unknown: give `registers`",
        ));
    }
    let known = |name| {
        let found = register(name)?;
        match found.shape() {
            Some(_) => Ok(found),
            None => Err(invalid_value(py, format_args!("the size of register {found} is unknown"))),
        }
    };
    names.iter().map(known).collect()
}
