//! Physical values as integers of the wire. A value that does not fit is refused, never clipped.

use std::time::Duration;

use motorlink_proto::units::{Quantity, inward};
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::error::invalid_value;

/// The digit nearest to `value`; a digit is `scale` `unit`s.
pub(crate) fn digits<T: TryFrom<i64>>(
    py: Python<'_>,
    what: &str,
    value: f64,
    scale: f64,
    unit: &str,
) -> PyResult<T> {
    let nearest = value.is_finite().then(|| (value / scale).round() as i64);
    fitting(py, what, value, nearest, unit)
}

/// As [`digits`], rounded towards 0 as a [`limit`] is: a value equal to its limit is within the limit.
pub(crate) fn inward_digits<T: TryFrom<i64>>(
    py: Python<'_>,
    what: &str,
    value: f64,
    scale: f64,
    unit: &str,
) -> PyResult<T> {
    let rounded = value.is_finite().then(|| inward(value, scale));
    fitting(py, what, value, rounded, unit)
}

/// The digits, if the value has some and they fit the field.
fn fitting<T: TryFrom<i64>>(
    py: Python<'_>,
    what: &str,
    value: f64,
    digits: Option<i64>,
    unit: &str,
) -> PyResult<T> {
    digits.and_then(|digits| T::try_from(digits).ok()).ok_or_else(|| {
        invalid_value(
            py,
            format_args!("{what} of {value} {unit} does not fit the frame; nothing was sent"),
        )
    })
}

/// A limit in digits. It is rounded towards 0, so that no digit exceeds it.
pub(crate) fn limit<T: TryFrom<i64>>(
    py: Python<'_>,
    value: f64,
    scale: f64,
    unit: &str,
) -> PyResult<T> {
    if value.is_nan() || value < 0.0 {
        return Err(invalid_value(
            py,
            format_args!("{value} {unit} is not a limit: give 0 or more"),
        ));
    }
    fitting(py, "a limit", value, Some(inward(value, scale)), unit)
}

/// A quantity in its unit. Refused if no frame can carry it.
pub(crate) fn wanted<Q: Quantity>(py: Python<'_>, value: f64) -> PyResult<Q> {
    Q::wanted(value).map_err(|error| invalid_value(py, format_args!("{error}; nothing was sent")))
}

/// A duration in s as ms.
pub(crate) fn milliseconds(py: Python<'_>, seconds: f64) -> PyResult<u16> {
    digits(py, "a duration", seconds, 1e-3, "s")
}

/// A wait in s: more than 0, at most a day.
pub(crate) fn span(py: Python<'_>, what: &str, seconds: f64) -> PyResult<Duration> {
    let day = Duration::from_secs(86_400);
    match Duration::try_from_secs_f64(seconds) {
        Ok(span) if !span.is_zero() && span <= day => Ok(span),
        _ => Err(invalid_value(
            py,
            format_args!("{what} of {seconds} s: give more than 0, up to a day"),
        )),
    }
}

/// A number of an array.
pub(crate) trait Native: Copy {
    /// Writes the bytes in native order, as NumPy reads them.
    fn write(self, to: &mut [u8]);
}

macro_rules! native {
    ($($kind:ty),+) => {
        $(impl Native for $kind {
            fn write(self, to: &mut [u8]) {
                to.copy_from_slice(&self.to_ne_bytes());
            }
        })+
    };
}

native!(f64, u64, u32);

/// Numbers in native byte order, which NumPy takes without a copy.
pub(crate) fn array_bytes<'py, T: Native>(
    py: Python<'py>,
    numbers: &[T],
) -> PyResult<Bound<'py, PyByteArray>> {
    PyByteArray::new_with(py, size_of_val(numbers), |bytes| {
        let places = bytes.chunks_exact_mut(size_of::<T>());
        places.zip(numbers).for_each(|(place, number)| number.write(place));
        Ok(())
    })
}
