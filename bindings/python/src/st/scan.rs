//! Scans for the baud rate of a drive.

use std::time::Duration;

use motorlink::port::{PortError, PortName};
use motorlink::st::{Error, ScanResult, scan_baud};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::error::{invalid_value, st_error};
use crate::number::span;
use crate::values;

fn line(py: Python<'_>, name: &str) -> PyResult<PortName> {
    let port: PortName = name.parse().map_err(|error| invalid_value(py, error))?;
    if port.as_line().is_none() || port.is_in_process() {
        return Err(invalid_value(py, format_args!("`{port}` has no baud rate to scan")));
    }
    Ok(port)
}

/// The rates to ask at: one for a port without a baud rate.
#[pyfunction]
pub(crate) fn st_scan_rates(py: Python<'_>, port: &str, mut rates: Vec<u32>) -> PyResult<Vec<u32>> {
    let port = line(py, port)?;
    if rates.first().is_some_and(|rate| port.at_baud(*rate).is_none()) {
        rates.truncate(1);
    }
    Ok(rates)
}

/// Asks at one rate. Waits `timeout` s for each of two replies.
#[pyfunction]
pub(crate) fn st_scan_baud(
    py: Python<'_>,
    port: &str,
    baud: u32,
    timeout: f64,
) -> PyResult<Py<PyAny>> {
    let (port, timeout): (_, Duration) = (line(py, port)?, span(py, "a timeout", timeout)?);
    let result = py.detach(|| scan_baud(&port, baud, timeout));
    let mut board = py.None();
    let kind = match result {
        Ok(ScanResult::Drive(info)) => {
            board = values::board_info(py, (PyTuple::new(py, info.version)?, info.name))?;
            "drive"
        }
        Ok(ScanResult::Refuses(_)) => "refuses",
        Ok(ScanResult::Garbage) => "garbage",
        Ok(ScanResult::Echo) => "echo",
        Ok(ScanResult::Silence) => "silence",
        Err(Error::Port(PortError::BaudRefused { .. })) => "impossible",
        Err(error) => return Err(st_error(py, &error)),
    };
    values::st_scan_result(py, (baud, kind, board))
}
