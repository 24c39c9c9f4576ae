//! What can be read of a motor, value by value, under names with units.

use motorlink_proto::rmd::{Code, Field};
use pyo3::prelude::*;

use crate::error::bad_value;

/// Reads whose values a program may sample, the one that tells most first.
const READS: [Code; 5] = [
    Code::ReadMotionStatus,
    Code::ReadStatus,
    Code::ReadPhaseCurrents,
    Code::ReadMultiTurnAngle,
    Code::ReadSingleTurnAngle,
];

/// A value of a reply.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Quantity {
    pub(crate) code: Code,
    pub(crate) field: &'static Field,
}

/// The name of a value with its unit behind it: `speed_dps`.
pub(crate) fn named(field: &Field) -> String {
    let unit = match field.scale.symbol {
        "°C" => "_c",
        "V" => "_v",
        "A" => "_a",
        "°" => "_deg",
        "°/s" => "_dps",
        "°/s²" => "_dps2",
        _ => "",
    };
    format!("{}{unit}", field.name)
}

impl Quantity {
    /// Every quantity with its name. Of two with the same name the second has its command's.
    pub(crate) fn all() -> Vec<(String, Quantity)> {
        let mut all: Vec<(String, Quantity)> = Vec::new();
        for code in READS {
            for field in code.info().map_or(&[][..], |row| row.reply) {
                let name = named(field);
                let taken = |name: &str| all.iter().any(|(known, _)| known == name);
                let name = match taken(&name) {
                    false => name,
                    true if code == Code::ReadSingleTurnAngle => format!("circle_{name}"),
                    true => continue,
                };
                all.push((name, Quantity { code, field }));
            }
        }
        all
    }

    /// The quantity of this name.
    pub(crate) fn named(py: Python<'_>, name: &str) -> PyResult<Quantity> {
        let found = Self::all().into_iter().find(|(known, _)| known == name);
        found.map(|(_, quantity)| quantity).ok_or_else(|| {
            let known = rmd_quantities().join(", ");
            bad_value(py, format_args!("motors do not tell `{name}`; there are {known}"))
        })
    }
}

/// Names of what can be sampled.
#[pyfunction]
pub(crate) fn rmd_quantities() -> Vec<String> {
    Quantity::all().into_iter().map(|(name, _)| name).collect()
}
