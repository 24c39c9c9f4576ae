//! `motorlink._core`: the extension module of the Python package `motorlink`.
//!
//! Requests are objects that check their arguments and read their replies ([`st::StRequest`],
//! [`rmd::RmdRequest`]). Clients, blocking or not, send them. The typed and documented classes for
//! users are in the Python files.
//!
//! No code of Python runs while a line is locked, because it may run signal handlers, which may use the
//! line. No constant of a protocol is defined in Python: `make python-table` writes `_rmd_table.py`.

mod arrival;
mod can;
mod error;
mod event;
mod number;
mod recording;
mod rmd;
mod sampling;
mod settings;
mod shared;
mod signals;
mod sim;
mod st;
mod values;

use pyo3::prelude::*;

/// The extension module of the package `motorlink`.
#[pymodule]
mod _core {
    use std::ffi::OsString;

    use motorlink_proto::time::Micros;
    use motorlink_proto::units::{Quantity, TurnCentiDegrees};
    use pyo3::types::PyTuple;

    use super::*;

    #[pymodule_export]
    use super::arrival::Arrival;
    #[pymodule_export]
    use super::can::CanPort;
    #[pymodule_export]
    use super::event::{RmdEventClient, StEventClient};
    #[pymodule_export]
    use super::recording::{
        RecordedClient, RecordingFile, RecordingInProgress, recorded_directions, recorded_results,
    };
    #[pymodule_export]
    use super::rmd::{
        RmdClient, RmdOptions, RmdRequest, RmdSampling, rmd_arrival, rmd_decode, rmd_encode,
        rmd_encoder_degrees, rmd_errors_text, rmd_full_turn_tolerance, rmd_motor, rmd_quantities,
    };
    #[pymodule_export]
    use super::settings::{MotorSettings, SettingsComparison, SettingsSteps};
    #[pymodule_export]
    use super::sim::{SimBench, SimPort, SimRecording, SimServing, sim_presets, sim_run};
    #[pymodule_export]
    use super::st::{
        StClient, StOptions, StRequest, StSampling, StStarting, StVerifiedWrite, st_arrival,
        st_flags_text, st_motor, st_register, st_register_name, st_registers, st_scan_baud,
        st_scan_rates,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        motorlink_testbench::register();
        motorlink_telemetry::share::port::register();
        motorlink_fleet::port_scheme::register();
        let finish = wrap_pyfunction!(leave_nodes, module)?;
        module.py().import("atexit")?.call_method1("register", (finish,))?;
        module.add("ST_SEGMENTS", motorlink_proto::st::SEGMENTS)?;
        module.add("ST_TIMEOUT", seconds(motorlink_proto::st::TIMEOUT))?;
        module.add("ST_BAUD_RATES", PyTuple::new(module.py(), motorlink::st::BAUD_RATES)?)?;
        module.add("ST_SCAN_TIMEOUT", motorlink::st::SCAN_TIMEOUT.as_secs_f64())?;
        module.add("ST_ATTEMPTS", motorlink_proto::st::VERIFY_ATTEMPTS)?;
        module.add("RMD_TIMEOUT", seconds(motorlink_proto::rmd::DEFAULT_TIMEOUT))?;
        module.add("RMD_STOP_ATTEMPTS", motorlink::STOP_ATTEMPTS)?;
        module.add("RMD_STOP_PATIENCE", motorlink::STOP_PATIENCE.as_secs_f64())?;
        module.add("RMD_STOP_PAUSE", seconds(motorlink::STOP_PAUSE))?;
        module.add("RMD_STOP_TIME", seconds(motorlink::STOP_TIME))?;
        module.add("RMD_QUARANTINE", seconds(motorlink_proto::rmd::DEFAULT_QUARANTINE))?;
        let tolerance = motorlink::rmd::FullTurn::TOLERANCE;
        module.add("RMD_FULL_TURN_TOLERANCE", TurnCentiDegrees::UNIT.value(tolerance.digits()))?;
        module.add("RMD_SCAN_WIDTH", motorlink::rmd::SCAN_WIDTH)?;
        let most = motorlink::settings::SettingsFile::MAX_SIZE;
        module.add("SETTINGS_MAX_SIZE", most)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }

    /// Waits until the nodes know that the clients of this process have left.
    #[pyfunction]
    fn leave_nodes(py: Python<'_>) {
        py.detach(motorlink_fleet::remote::finish);
    }

    fn seconds(span: Micros) -> f64 {
        span.0 as f64 / 1e6
    }

    /// The descriptors of ports that this process has open.
    #[pyfunction]
    fn open_descriptors() -> Vec<i32> {
        motorlink::port::open_descriptors().collect()
    }

    /// The command line; `words` begin with the program's name. Returns the exit code. `program` starts
    /// the command in another process. The command installs its own signal handlers.
    #[pyfunction]
    fn cli(py: Python<'_>, program: Vec<OsString>, words: Vec<OsString>) -> u8 {
        py.detach(|| motorlink_cli::run(&program, words))
    }
}
