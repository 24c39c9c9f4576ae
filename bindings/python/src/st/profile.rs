//! Profiles by their names.

use motorlink::st::Profile;
use pyo3::prelude::*;

use crate::error::invalid_value;

/// The profile of this name.
pub(crate) fn named(py: Python<'_>, name: &str) -> PyResult<Profile> {
    let unknown = |error| invalid_value(py, format_args!("unknown profile `{name}`: {error}"));
    name.parse().map_err(unknown)
}
