//! `motorlink._core`: what the Python package `motorlink` is made of.
//!
//! Requests are objects that check their arguments and read their replies ([`st::StRequest`],
//! [`rmd::RmdRequest`]); clients, blocking or not, carry them. Everything typed and documented for
//! people is in the Python files on top.

mod can;
mod error;
mod machine;
mod number;
mod rmd;
mod sampling;
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

    use super::*;

    #[pymodule_export]
    use super::can::CanPort;
    #[pymodule_export]
    use super::machine::{RmdMachine, StMachine};
    #[pymodule_export]
    use super::rmd::{
        RmdBus, RmdOptions, RmdRequest, RmdSampling, rmd_decode, rmd_errors_text, rmd_motor,
        rmd_quantities,
    };
    #[pymodule_export]
    use super::sim::{SimBench, SimPort, SimRecording, SimServing, sim_presets, sim_run};
    #[pymodule_export]
    use super::st::{
        StClient, StOptions, StRequest, StSampling, StVerifiedWrite, st_flags_text, st_motor,
        st_register, st_register_name, st_registers,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        motorlink_testbench::register();
        module.add("ST_SEGMENTS", motorlink::st::SEGMENTS)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }

    /// The descriptors of ports that this process has open.
    #[pyfunction]
    fn open_descriptors() -> Vec<i32> {
        motorlink::port::open_descriptors().collect()
    }

    /// The command line, the program's name first; gives the exit code. It takes over the process's
    /// signals.
    #[pyfunction]
    fn cli(py: Python<'_>, words: Vec<OsString>) -> u8 {
        py.detach(|| motorlink_cli::run(words))
    }
}
