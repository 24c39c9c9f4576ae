//! Classes of the Python files, imported at their first use.

use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyModule, PyTuple, PyType};

macro_rules! classes {
    ($( $function:ident $module:ident $name:literal; )+) => { $(
        pub(crate) fn $function<'py>(
            py: Python<'py>,
            fields: impl PyCallArgs<'py>,
        ) -> PyResult<Py<PyAny>> {
            static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
            let class = CLASS.import(py, concat!("motorlink.", stringify!($module)), $name)?;
            Ok(class.call1(fields)?.unbind())
        }
    )+ };
}

classes! {
    status _values "Status";
    control_mode _values "ControlMode";
    flags _values "Flags";
    board_info _values "BoardInfo";
    firmware_version _values "FirmwareVersion";
    revup_phase _values "RevupPhase";
    register_info _values "RegisterInfo";
    errors _values "Errors";
    scan_result _rmd "ScanResult";
    st_scan_result _scan "ScanResult";
    frame _values "Frame";
    setting_difference _settings "SettingDifference";
}

/// A reply of an RMD motor with several values, as an object of its class.
pub(crate) fn rmd_reply<'py>(
    py: Python<'py>,
    class: &str,
    fields: Bound<'py, PyTuple>,
) -> PyResult<Py<PyAny>> {
    static TABLE: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let import = || PyModule::import(py, "motorlink._rmd_table").map(Bound::unbind);
    let table = TABLE.get_or_try_init(py, import)?.bind(py);
    Ok(table.getattr(class)?.call1(fields)?.unbind())
}
