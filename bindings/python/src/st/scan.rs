//! Scans for the baud rate of a drive.

use std::time::Duration;

use motorlink::port::{Carries, PortError, PortName};
use motorlink::st::{Error, ScanResult, scan};
use motorlink_telemetry::share::message::Finding;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::error::{invalid_value, st_error};
use crate::number::span;
use crate::values;

fn line(py: Python<'_>, name: &str) -> PyResult<PortName> {
    let port: PortName = name.parse().map_err(|error| invalid_value(py, error))?;
    if !port.carries(Carries::Bytes) || port.is_in_process() {
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
    let port = port.at_baud(baud).unwrap_or(port);
    let result = py.detach(|| scan(&port, timeout));
    let mut board = py.None();
    let finding = match result {
        Ok(result) => {
            if let ScanResult::Drive(info) = &result {
                let version = PyTuple::new(py, info.version)?;
                board = values::board_info(py, (version, &info.name))?;
            }
            Finding::from(&result)
        }
        Err(Error::Port(PortError::BaudRefused { .. })) => Finding::Impossible,
        Err(error) => return Err(st_error(py, &error)),
    };
    values::st_scan_result(py, (baud, finding.word(), board))
}
