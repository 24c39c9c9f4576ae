//! The values that can be sampled, under names with units.

use std::cmp::Reverse;

use motorlink_proto::rmd::{COMMANDS, Code, CommandInfo, Field};
use pyo3::prelude::*;

use crate::error::invalid_value;

/// A value of a reply.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Quantity {
    pub(crate) code: Code,
    pub(crate) field: &'static Field,
}

impl Quantity {
    /// Every quantity with its name. Reads with the most values come first.
    pub(crate) fn all() -> Vec<(String, Quantity)> {
        let mut reads: Vec<_> = COMMANDS.iter().filter(|row| row.sampled).collect();
        reads.sort_by_key(|row| Reverse(row.reply.len()));
        let mut all: Vec<(String, Quantity)> = Vec::new();
        for &row in &reads {
            for field in row.reply {
                let name = quantity_name(row, field, &reads);
                if !all.iter().any(|(known, _)| *known == name) {
                    all.push((name, Quantity { code: row.code, field }));
                }
            }
        }
        all
    }

    /// The quantity of this name.
    pub(crate) fn named(py: Python<'_>, name: &str) -> PyResult<Quantity> {
        let found = Self::all().into_iter().find(|(known, _)| known == name);
        found.map(|(_, quantity)| quantity).ok_or_else(|| {
            let known = rmd_quantities().join(", ");
            invalid_value(py, format_args!("unknown quantity `{name}`: the quantities are {known}"))
        })
    }
}

/// The field's name. If another read has the same name, it is the noun of the read.
fn quantity_name(row: &CommandInfo, field: &Field, reads: &[&CommandInfo]) -> String {
    let mut fields = reads.iter().flat_map(|read| read.reply);
    let name = field.name_with_unit().to_string();
    match row.stem.strip_prefix("read_") {
        Some(noun) if fields.any(|it| it.name == field.name && it.scale != field.scale) => {
            name.replacen(field.name, noun, 1)
        }
        _ => name,
    }
}

/// The names that can be sampled.
#[pyfunction]
pub(crate) fn rmd_quantities() -> Vec<String> {
    Quantity::all().into_iter().map(|(name, _)| name).collect()
}
