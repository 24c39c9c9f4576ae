//! Values behind a gear, and angles of encoder counts.

use motorlink::rmd::{EncoderBits, GearRatio, Scale};
use pyo3::prelude::*;

use crate::error::invalid_value;

/// A gear ratio.
pub(crate) fn gear(py: Python<'_>, ratio: Option<f64>) -> PyResult<Option<GearRatio>> {
    let gear = ratio.map(GearRatio::new).transpose();
    gear.map_err(|error| invalid_value(py, error))
}

/// A scale of the motor shaft as that of the output shaft, if there is a gear.
pub(crate) fn behind(gear: Option<GearRatio>, scale: Scale) -> Scale {
    gear.map_or(scale, |gear| gear.scale(scale))
}

/// The angle of encoder counts, °.
#[pyfunction]
#[pyo3(signature = (counts, *, encoder_bits, gear_ratio = None))]
pub(crate) fn rmd_encoder_degrees(
    py: Python<'_>,
    counts: i64,
    encoder_bits: i64,
    gear_ratio: Option<f64>,
) -> PyResult<f64> {
    let bits = u8::try_from(encoder_bits).ok().and_then(EncoderBits::new);
    let bits = bits.ok_or_else(|| {
        let why = format!("encoder_bits={encoder_bits}: an encoder has 12 to 18 bits");
        invalid_value(py, why)
    })?;
    let scale = bits.scale();
    if !(scale.least..=scale.most).contains(&counts) {
        let (bits, most) = (bits.bits(), scale.most);
        let why = format!("{counts} counts: an encoder of {bits} bits has 0 to {most}");
        return Err(invalid_value(py, why));
    }
    Ok(behind(gear(py, gear_ratio)?, scale).value(counts))
}
