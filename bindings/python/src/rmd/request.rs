//! One request to an RMD motor: it checks its arguments and reads its reply. `tests/table.rs`
//! writes a constructor in Python for each row of the command table.

use std::hash::{Hash, Hasher};

use motorlink::rmd::{FullTurn, GearRatio};
use motorlink_proto::Hex;
use motorlink_proto::rmd::{
    Code, Command, CommandInfo, Field, Meaning, MotorId, Payload, SetSingleTurnPosition,
};
use motorlink_proto::units::{Quantity, TurnCentiDegrees};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString, PyTuple, PyType};

use super::gear::{behind, gear};
use crate::error::{invalid_value, rmd_error};
use crate::number::wanted;
use crate::values;

/// A request to an RMD motor.
#[pyclass(frozen, eq, hash, subclass, module = "motorlink._core")]
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RmdRequest {
    data: [u8; 8],
    /// Whether the reply is returned as bytes.
    raw: bool,
    /// Angles and speeds of the reply are those of the output shaft of this gear, as those of the
    /// request were.
    gear: Option<GearRatio>,
}

impl Hash for RmdRequest {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.data, self.raw).hash(state);
    }
}

impl RmdRequest {
    /// A typed command to a motor with this gear.
    pub(crate) fn of(command: impl Command, gear: Option<GearRatio>) -> Self {
        RmdRequest { data: command.encode(), raw: false, gear }
    }

    /// A command whose reply is returned as bytes.
    pub(crate) fn for_bytes(data: [u8; 8]) -> Self {
        RmdRequest { data, raw: true, gear: None }
    }

    /// The eight bytes of the request.
    pub(crate) fn data(&self) -> [u8; 8] {
        self.data
    }

    /// The gear that its angles and speeds are behind.
    pub(crate) fn gear(&self) -> Option<GearRatio> {
        self.gear
    }

    /// Whether the request or its reply has angles, speeds or accelerations.
    pub(crate) fn has_motion(&self) -> bool {
        let row = self.row().filter(|_| !self.raw);
        let fields = row.map(|row| row.request.iter().chain(row.reply));
        fields.is_some_and(|mut fields| fields.any(|field| field.scale.is_motion()))
    }

    fn row(&self) -> Option<&'static CommandInfo> {
        Code::from(self.data[0]).info()
    }

    /// The reply for Python: `None` if it repeats the request, otherwise its values.
    pub(crate) fn value(&self, py: Python<'_>, reply: &[u8; 8]) -> PyResult<Py<PyAny>> {
        match self.row().filter(|_| !self.raw) {
            Some(row) if row.echo => Ok(py.None()),
            Some(row) => fields(py, row.reply_name, row.reply, reply, self.gear),
            None => PyBytes::new(py, reply).into_py_any(py),
        }
    }
}

/// A reply of this type for Python, of a motor with this gear.
pub(crate) fn said<P: Payload>(
    py: Python<'_>,
    name: &str,
    reply: &P,
    gear: Option<GearRatio>,
) -> PyResult<Py<PyAny>> {
    fields(py, name, P::FIELDS, &reply.encode_as(0), gear)
}

/// A single value; several values in the class of this name.
fn fields(
    py: Python<'_>,
    class: &str,
    fields: &[Field],
    data: &[u8; 8],
    gear: Option<GearRatio>,
) -> PyResult<Py<PyAny>> {
    let values = fields.iter().map(|field| value(py, field, data, gear));
    let values: PyResult<Vec<_>> = values.collect();
    match values?.as_slice() {
        [] => Ok(py.None()),
        [one] => Ok(one.clone_ref(py)),
        several => values::rmd_reply(py, class, PyTuple::new(py, several)?),
    }
}

/// A value for Python: an integer if one digit is one unit, names for bits.
fn value(
    py: Python<'_>,
    field: &Field,
    data: &[u8; 8],
    gear: Option<GearRatio>,
) -> PyResult<Py<PyAny>> {
    let (digits, scale) = (field.raw(data), behind(gear, field.scale));
    match field.meaning {
        Meaning::Bits(bits) => {
            let active = bits.iter().filter(|(bit, _)| digits & i64::from(*bit) != 0);
            let names: Vec<_> = active.map(|(_, name)| name).collect();
            values::errors(py, (PyTuple::new(py, names)?, digits))
        }
        Meaning::Words(_) | Meaning::Number if scale.decimals == 0 => digits.into_py_any(py),
        _ => scale.value(digits).into_py_any(py),
    }
}

/// The digits of an argument for a field.
fn digits(field: &Field, value: &Bound<'_, PyAny>, gear: Option<GearRatio>) -> PyResult<i64> {
    let py = value.py();
    let refused =
        |why: String| invalid_value(py, format_args!("{}: {why}", field.name_with_unit()));
    if let Meaning::Words(words) = field.meaning {
        let given = value.cast::<PyString>()?.to_cow()?;
        let found = words.iter().find(|(_, word)| word.eq_ignore_ascii_case(&given));
        return found.map(|(number, _)| i64::from(*number)).ok_or_else(|| {
            let known: Vec<_> = words.iter().map(|(_, word)| *word).collect();
            let known = known.join(", ");
            refused(format!("unknown value `{given}`: the values are {known}"))
        });
    }
    let value: f64 = value.extract()?;
    if field.scale.suffix.is_empty() && value.is_finite() && value.fract() != 0.0 {
        return Err(refused(format!("{value} is not a whole number")));
    }
    let wanted = behind(gear, field.scale).wanted(value);
    wanted.map_err(|why| refused(format!("{why}; nothing was sent")))
}

/// The eight bytes of the command `code` with these values, in the order of its fields.
#[pyfunction]
#[pyo3(signature = (code, *values, gear_ratio = None))]
pub(crate) fn rmd_encode<'py>(
    py: Python<'py>,
    code: u8,
    values: Vec<Bound<'py, PyAny>>,
    gear_ratio: Option<f64>,
) -> PyResult<Bound<'py, PyBytes>> {
    let gear = gear(py, gear_ratio)?;
    let is_within_turn = matches!(
        Code::from(code),
        Code::SetSingleTurnPosition | Code::SetSingleTurnPositionLimited
    );
    if is_within_turn && gear.is_some_and(|gear| gear.ratio() != 1.0) {
        return Err(invalid_value(
            py,
            "the angle of this command is within one turn of the motor shaft, so the angle of the output \
             shaft is not determined: use set_position; nothing was sent",
        ));
    }
    let mut data = [0; 8];
    data[0] = code;
    let fields = Code::from(code).info().map_or(&[][..], |row| row.request);
    for (field, value) in fields.iter().zip(&values) {
        let (offset, len) = (usize::from(field.offset), usize::from(field.len));
        let bytes = digits(field, value, gear)?.to_le_bytes();
        data[offset..offset + len].copy_from_slice(&bytes[..len]);
    }
    Ok(PyBytes::new(py, &data))
}

/// Checks the tolerance of the full-turn check, ° past the target.
#[pyfunction]
pub(crate) fn rmd_full_turn_tolerance(py: Python<'_>, tolerance_degrees: f64) -> PyResult<()> {
    tolerance(py, tolerance_degrees).map(drop)
}

fn tolerance(py: Python<'_>, degrees: f64) -> PyResult<TurnCentiDegrees> {
    TurnCentiDegrees::wanted(degrees).map_err(|why| {
        invalid_value(py, format_args!("tolerance_degrees: {why}; nothing was sent"))
    })
}

#[pymethods]
impl RmdRequest {
    /// A request of eight bytes. `raw`: the reply is returned as bytes. `gear_ratio`: angles and
    /// speeds of the reply are those of the output shaft.
    #[new]
    #[pyo3(signature = (data, *, raw = false, gear_ratio = None))]
    fn new(py: Python<'_>, data: &[u8], raw: bool, gear_ratio: Option<f64>) -> PyResult<Self> {
        let request = RmdRequest { data: eight(py, data)?, raw, gear: gear(py, gear_ratio)? };
        if !raw && request.row().is_none() {
            let code = request.code();
            return Err(invalid_value(py, format_args!("{code:#04x} is not a command of V1.62")));
        }
        Ok(request)
    }

    /// A request of any eight bytes. Its reply is eight bytes. `rom` allows those that wear the
    /// ROM.
    #[classmethod]
    #[pyo3(signature = (data, *, rom = false))]
    fn raw<'py>(cls: &Bound<'py, PyType>, data: &[u8], rom: bool) -> PyResult<Bound<'py, PyAny>> {
        let py = cls.py();
        let request = Self::new(py, data, true, None)?;
        if request.is_rom() && !rom {
            let code = request.code();
            let why =
                format!("{code:#04x} writes to the motor's ROM, which wears: rom=True allows it");
            return Err(invalid_value(py, why));
        }
        let named = PyDict::new(py);
        named.set_item("raw", true)?;
        cls.call((data,), Some(&named))
    }

    /// A request from its eight bytes.
    #[classmethod]
    fn decode<'py>(cls: &Bound<'py, PyType>, data: &[u8]) -> PyResult<Bound<'py, PyAny>> {
        cls.call1((data,))
    }

    /// Raises `FullTurnError` if this move within the turn could be nearly a full turn, for a motor
    /// at `angle_degrees`.
    fn check_full_turn(
        &self,
        py: Python<'_>,
        motor: i64,
        angle_degrees: f64,
        tolerance_degrees: f64,
    ) -> PyResult<()> {
        let id = motor_id(py, motor)?;
        let (at, tolerance) = (wanted(py, angle_degrees)?, tolerance(py, tolerance_degrees)?);
        let SetSingleTurnPosition { direction, angle } = SetSingleTurnPosition::decode(&self.data);
        let checked = FullTurn::Refused { tolerance }.check(id, at, angle, direction);
        checked.map_err(|error| rmd_error(py, &error))
    }

    /// The eight bytes of the request.
    fn encode<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.data)
    }

    /// The value of a reply of eight bytes to this request.
    fn decode_reply(&self, py: Python<'_>, data: &[u8]) -> PyResult<Py<PyAny>> {
        self.value(py, &eight(py, data)?)
    }

    /// The command code, DATA[0].
    #[getter]
    fn code(&self) -> u8 {
        self.data[0]
    }

    /// The command's name in all languages: `set_speed`. `None` for a code without a name in V1.62.
    #[getter]
    fn stem(&self) -> Option<&'static str> {
        self.row().map(|row| row.stem)
    }

    /// The gear ratio of its angles and speeds. `None`: they are those of the motor shaft.
    #[getter]
    fn gear_ratio(&self) -> Option<f64> {
        self.gear.map(GearRatio::ratio)
    }

    /// Whether the command writes to the motor's ROM, which wears.
    #[getter]
    fn is_rom(&self) -> bool {
        self.row().is_some_and(|row| row.rom)
    }

    fn __repr__(&self) -> String {
        format!("<Request {} ({})>", Hex(&self.data), Code::from(self.data[0]))
    }
}

/// A motor ID, 1 to 32.
pub(crate) fn motor_id(py: Python<'_>, id: i64) -> PyResult<MotorId> {
    u8::try_from(id).ok().and_then(MotorId::new).ok_or_else(|| {
        invalid_value(py, format_args!("motor {id} does not exist: motor IDs are 1 to 32"))
    })
}

pub(crate) fn eight(py: Python<'_>, data: &[u8]) -> PyResult<[u8; 8]> {
    let size = data.len();
    data.try_into().map_err(|_| invalid_value(py, format_args!("a frame has 8 bytes, not {size}")))
}
