//! A bench on ports.

use std::sync::{Mutex, PoisonError};

use motorlink_link::serve::ServeName;
use motorlink_link::serve::Served;
use motorlink_testbench::{Bench, Serving};
use pyo3::prelude::*;

use crate::error::{invalid_value, port_error};

/// Ports on which a bench is served until it ends.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct SimServing {
    serving: Mutex<Option<Serving>>,
    st: Option<(String, String)>,
    rmd: Option<(String, String)>,
}

impl SimServing {
    pub(super) fn new(
        py: Python<'_>,
        bench: &Bench,
        st: Option<&str>,
        rmd: Option<&str>,
    ) -> PyResult<Self> {
        let name = |text: Option<&str>| -> PyResult<Option<ServeName>> {
            text.map(str::parse).transpose().map_err(|error| invalid_value(py, error))
        };
        let (st, rmd) = (name(st)?, name(rmd)?);
        let serving = py.detach(|| bench.serve(st, rmd)).map_err(|error| port_error(py, &error))?;
        let told = |served: &Served| (served.port.clone(), served.path.clone());
        let (st, rmd) = (serving.st().map(told), serving.rmd().map(told));
        Ok(SimServing { serving: Mutex::new(Some(serving)), st, rmd })
    }
}

#[pymethods]
impl SimServing {
    /// The name of the ST drive's port, and its path or address.
    #[getter]
    fn st(&self) -> Option<(String, String)> {
        self.st.clone()
    }

    /// The name of the RMD motors' port, and its path or address.
    #[getter]
    fn rmd(&self) -> Option<(String, String)> {
        self.rmd.clone()
    }

    /// Closes the ports. A second call does nothing.
    fn end(&self, py: Python<'_>) -> PyResult<()> {
        let serving = self.serving.lock().unwrap_or_else(PoisonError::into_inner).take();
        let ended = serving.map_or(Ok(()), |serving| py.detach(|| serving.end()));
        ended.map_err(|error| port_error(py, &error))
    }
}
