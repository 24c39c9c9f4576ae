//! Physical values into the integers of the wire. What does not fit is refused, never cut.

use std::time::Duration;

use motorlink_proto::units::{SpeedLimit, inward};
use pyo3::prelude::*;

use crate::error::bad_value;

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
        bad_value(
            py,
            format_args!("{what} of {value} {unit} does not fit the frame; nothing was sent"),
        )
    })
}

/// Digits of `scale` in the physical unit: 239 of 0.1 are 23.9, and not 23.900000000000002.
pub(crate) fn physical(digits: i64, scale: f64) -> f64 {
    let parts = scale.recip().round();
    if parts > 1.0 && parts.recip() == scale {
        digits as f64 / parts
    } else {
        digits as f64 * scale
    }
}

/// A limit, which no value may exceed; rounded towards 0, so that no digit does.
pub(crate) fn limit<T: TryFrom<i64>>(
    py: Python<'_>,
    value: f64,
    scale: f64,
    unit: &str,
) -> PyResult<T> {
    if value.is_nan() || value < 0.0 {
        return Err(bad_value(py, format_args!("{value} {unit} is no limit: give 0 or more")));
    }
    fitting(py, "a limit", value, Some(inward(value, scale)), unit)
}

/// A greatest speed in °/s, rounded towards 0. What would be 0 is refused: to a drive it may mean any
/// speed, or that the motor never moves.
pub(crate) fn greatest_speed(py: Python<'_>, dps: f64) -> PyResult<SpeedLimit> {
    let digits = inward(dps, SpeedLimit::SCALE);
    if digits < 1 {
        let (least, unit) = (SpeedLimit(1).dps(), SpeedLimit::SYMBOL);
        let why = format!("a max speed of {dps} {unit} is too small: give {least} {unit} or more");
        return Err(bad_value(py, format_args!("{why}; nothing was sent")));
    }
    fitting(py, "a max speed", dps, Some(digits), SpeedLimit::SYMBOL).map(SpeedLimit)
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
        _ => {
            Err(bad_value(py, format_args!("{what} of {seconds} s: give more than 0, up to a day")))
        }
    }
}
