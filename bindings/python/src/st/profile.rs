//! Profiles by their names.

use motorlink::st::Profile;
use pyo3::prelude::*;

use crate::error::bad_value;

/// The profile of this name.
pub(super) fn named(py: Python<'_>, name: &str) -> PyResult<Profile> {
    Profile::ALL.into_iter().find(|profile| profile.name() == name).ok_or_else(|| {
        let names = Profile::ALL.map(Profile::name).join("` and `");
        bad_value(py, format_args!("there is no profile `{name}`; there are `{names}`"))
    })
}
