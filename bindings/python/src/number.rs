//! Physical values into the integers of the wire. What does not fit is refused, never cut.

use std::time::Duration;

use motorlink_proto::units::{Quantity, inward};
use pyo3::prelude::*;

use crate::error::invalid_value;

/// The nearest digit to `value` in `unit`s, of which a digit has `scale`.
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

/// The digits of `value`, if there are any and the frame has room for them.
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

/// A limit, which no value may exceed; rounded towards 0, so that no digit does.
pub(crate) fn limit<T: TryFrom<i64>>(
    py: Python<'_>,
    value: f64,
    scale: f64,
    unit: &str,
) -> PyResult<T> {
    if value.is_nan() || value < 0.0 {
        return Err(invalid_value(py, format_args!("{value} {unit} is no limit: give 0 or more")));
    }
    fitting(py, "a limit", value, Some(inward(value, scale)), unit)
}

/// The quantity that a program wants, in its unit. What no frame of the protocol says is refused.
pub(crate) fn wanted<Q: Quantity>(py: Python<'_>, value: f64) -> PyResult<Q> {
    Q::wanted(value).map_err(|error| invalid_value(py, format_args!("{error}; nothing was sent")))
}

/// A duration in s as the wire's ms.
pub(crate) fn milliseconds(py: Python<'_>, seconds: f64) -> PyResult<u16> {
    digits(py, "a duration", seconds, 1e-3, "s")
}

/// A time in s that a program waits for; more than 0, up to a day.
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
