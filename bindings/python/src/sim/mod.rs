//! Simulated drives in the process.

mod bench;
mod port;
mod scenario;
mod serving;

pub(crate) use bench::{SimBench, SimRecording};
pub(crate) use port::{Port, SimPort};
pub(crate) use scenario::sim_run;
pub(crate) use serving::SimServing;

use motorlink_testbench::preset;
use pyo3::prelude::*;

use crate::error::invalid_value;

/// The presets as JSON, by name. Numbers have the fewest digits that identify them.
#[pyfunction]
pub(crate) fn sim_presets(py: Python<'_>) -> PyResult<String> {
    let presets = preset::ALL.iter().map(|(name, config)| {
        let plant = serde_json::to_string(&config());
        Ok(format!("{name:?}:{}", plant.map_err(|error| invalid_value(py, error))?))
    });
    Ok(format!("{{{}}}", presets.collect::<PyResult<Vec<_>>>()?.join(",")))
}
