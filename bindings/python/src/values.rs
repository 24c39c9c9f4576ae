//! The classes of `motorlink._values`, found when they are first needed.

use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

macro_rules! classes {
    ($( $function:ident $name:literal; )+) => { $(
        pub(crate) fn $function<'py>(
            py: Python<'py>,
            fields: impl PyCallArgs<'py>,
        ) -> PyResult<Py<PyAny>> {
            static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
            let class = CLASS.import(py, "motorlink._values", $name)?;
            Ok(class.call1(fields)?.unbind())
        }
    )+ };
}

classes! {
    state "State";
    control_mode "ControlMode";
    faults "Faults";
    info "Info";
    firmware_version "FirmwareVersion";
    revup_phase "RevupPhase";
    register_info "RegisterInfo";
    motion_status "MotionStatus";
    motor_errors "MotorErrors";
    motor_status "MotorStatus";
    phase_currents "PhaseCurrents";
    gains "Gains";
    encoder "Encoder";
    found "Found";
    frame "Frame";
}
