//! Register values between digits and units.

use motorlink::st::register::{Type, Unit};
use motorlink::st::{
    FullScale, Implausible, Profile, Reading, RegisterId, find_register, parse_value,
};
use motorlink_proto::units;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyString;

use super::profile;
use crate::error::{invalid_value, unknown_register};
use crate::number::inward_digits;

/// The value of a digit of a motor's registers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    pub(crate) profile: Profile,
    /// `None` if the full scale is unknown. Currents are in digits then.
    full_scale: Option<FullScale>,
}

impl Scale {
    pub(crate) fn new(
        py: Python<'_>,
        profile: &str,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let profile = profile::named(py, profile)?;
        Scale { profile, full_scale: None }.with_full_scale(py, full_scale_amps)
    }

    /// For a request that neither profile nor full scale affects.
    pub(crate) fn plain() -> Self {
        Scale { profile: Profile::default(), full_scale: None }
    }

    /// The same with currents in A.
    pub(crate) fn with_full_scale(
        self,
        py: Python<'_>,
        full_scale_amps: Option<f64>,
    ) -> PyResult<Self> {
        let full_scale = full_scale_amps.map(FullScale::from_amps).transpose();
        let full_scale = full_scale.map_err(|error| invalid_value(py, error))?;
        Ok(Scale { profile: self.profile, full_scale })
    }

    /// One digit of a current, and the unit it is in.
    pub(crate) fn current(&self) -> (f64, &'static str) {
        self.full_scale.map_or((1.0, Unit::S16A.symbol()), |full_scale| {
            let scale = full_scale.scale();
            (scale.digit, scale.symbol)
        })
    }

    /// A current as digits, rounded towards 0.
    pub(crate) fn digits<T: TryFrom<i64>>(&self, py: Python<'_>, current: f64) -> PyResult<T> {
        let (scale, unit) = self.current();
        inward_digits(py, "a current", current, scale, unit)
    }

    /// Digits as a current: a float in A, an integer in s16A.
    pub(crate) fn amps(&self, py: Python<'_>, digits: i32) -> PyResult<Py<PyAny>> {
        match self.full_scale {
            Some(full_scale) => full_scale.scale().value(digits.into()).into_py_any(py),
            None => digits.into_py_any(py),
        }
    }

    /// The unit of a register's values.
    pub(crate) fn unit(&self, register: RegisterId) -> &'static str {
        if is_current(register) { self.current().1 } else { self.reading(register, 0).unit() }
    }

    /// A read value, in [`unit`](Self::unit)s.
    pub(crate) fn physical(&self, register: RegisterId, bits: i32) -> f64 {
        match self.full_scale {
            Some(full_scale) if is_current(register) => full_scale.scale().value(bits.into()),
            _ => self.reading(register, bits).value(),
        }
    }

    /// The scale of a register that is a current, if the full scale is known.
    pub(super) fn of_current(&self, register: RegisterId) -> Option<units::Scale> {
        self.full_scale.filter(|_| is_current(register)).map(|full_scale| full_scale.scale())
    }

    /// Checks that the profile may be right for a read value.
    pub(crate) fn plausible(&self, register: RegisterId, bits: i32) -> Result<(), Implausible> {
        self.reading(register, bits).plausible().map(drop)
    }

    /// A read value as an integer; the bits of a float.
    pub(crate) fn raw(&self, register: RegisterId, bits: i32) -> i64 {
        self.reading(register, bits).digits()
    }

    /// A read value for Python: an integer if one digit is one unit.
    pub(crate) fn value(
        &self,
        py: Python<'_>,
        register: RegisterId,
        bits: i32,
        raw: bool,
    ) -> PyResult<Py<PyAny>> {
        let (digits, value) = (self.raw(register, bits), self.physical(register, bits));
        let float = register.shape().is_some_and(|shape| shape.ty(self.profile) == Type::F32);
        if raw || !float && self.is_whole(register) {
            return digits.into_py_any(py);
        }
        value.into_py_any(py)
    }

    /// The bits of an argument: a number, or a name where values have names.
    pub(crate) fn bits(
        &self,
        register: RegisterId,
        value: &Bound<'_, PyAny>,
        raw: bool,
    ) -> PyResult<i32> {
        let py = value.py();
        if !raw && self.full_scale.is_some() && is_current(register) {
            return self.digits::<i16>(py, value.extract()?).map(i32::from);
        }
        let text = if let Ok(text) = value.cast::<PyString>() {
            text.to_string()
        } else if let Ok(whole) = value.extract::<i64>() {
            whole.to_string()
        } else {
            value.extract::<f64>()?.to_string()
        };
        parse_value(register, &text, self.profile, raw).map_err(|error| invalid_value(py, error))
    }

    fn is_whole(&self, register: RegisterId) -> bool {
        self.physical(register, 1) == 1.0
    }

    fn reading(&self, register: RegisterId, bits: i32) -> Reading {
        Reading { register, bits, profile: self.profile }
    }
}

fn is_current(register: RegisterId) -> bool {
    Reading { register, bits: 0, profile: Profile::default() }.is_current()
}

/// A register by name or number.
pub(crate) fn register(name: &Bound<'_, PyAny>) -> PyResult<RegisterId> {
    let py = name.py();
    if let Ok(text) = name.cast::<PyString>() {
        return find_register(&text.to_cow()?).map_err(|error| unknown_register(py, error));
    }
    let number: i64 = name.extract()?;
    u8::try_from(number).map(RegisterId).map_err(|_| {
        unknown_register(py, format_args!("{number} is not a register: numbers are 0 to 255"))
    })
}
