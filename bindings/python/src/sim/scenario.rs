//! Runs of scenarios.

use std::path::{Path, PathBuf};

use motorlink_testbench::scenario::{Run, Scenario};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::invalid_value;
use crate::number::array_bytes;
use crate::signals::attended;

/// Runs a scenario, from its text or from a file. Returns the result.
#[pyfunction]
#[pyo3(signature = (text, path = None))]
pub(crate) fn sim_run<'py>(
    py: Python<'py>,
    text: &str,
    path: Option<PathBuf>,
) -> PyResult<Bound<'py, PyDict>> {
    let scenario = match path {
        Some(path) => Scenario::read(&path).map_err(|error| invalid_value(py, error))?,
        None => Scenario::parse(text, Path::new("")).map_err(|why| invalid_value(py, why))?,
    };
    let (title, about) = (scenario.title.clone(), scenario.about.clone());
    let run = attended(py, move || scenario.run())?.map_err(|error| invalid_value(py, error))?;
    let told = PyDict::new(py);
    told.set_item("title", title)?;
    told.set_item("about", about)?;
    fill(&told, &run)?;
    Ok(told)
}

fn fill(told: &Bound<'_, PyDict>, run: &Run) -> PyResult<()> {
    let py = told.py();
    let signals = run.signals.iter().map(|signal| (signal.name.as_str(), signal.kind.unit()));
    told.set_item("signals", signals.collect::<Vec<_>>())?;
    let columns = run.columns.iter().map(|column| array_bytes(py, column));
    told.set_item("columns", columns.collect::<PyResult<Vec<_>>>()?)?;
    told.set_item("sample", run.sample.0)?;
    let verdicts = run.verdicts.iter().map(|one| (&one.why, &one.signal, one.holds, &one.found));
    told.set_item("expectations", verdicts.collect::<Vec<_>>())?;
    let refusals = run.refusals.iter().map(|one| {
        (
            one.at,
            &one.motor,
            &one.event,
            one.reply.as_ref(),
            one.announced.as_ref(),
            one.to_string(),
        )
    });
    told.set_item("refusals", refusals.collect::<Vec<_>>())?;
    let marks = run.marks.iter().map(|mark| (mark.at, &mark.label));
    told.set_item("marks", marks.collect::<Vec<_>>())?;
    told.set_item("state_hash", run.state_hash)?;
    told.set_item("as_expected", run.as_expected())
}
