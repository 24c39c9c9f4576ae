//! Following a motor to its target, for both protocols and both APIs: requests and times out, replies in.

use motorlink::arrival::{NotArrived, Sampler, Step, Watch};
use motorlink_proto::time::{Instant, Micros};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

use crate::error::invalid_value;
use crate::number::span;
use crate::sampling::{instant, seconds};

/// What to ask a motor until it has arrived.
#[pyclass(module = "motorlink._core")]
pub(crate) struct Arrival(Box<Follow>);

/// Takes an event at a time; returns the next step after [`Event::Next`].
type Follow = dyn FnMut(Python<'_>, Instant, Event<'_>) -> PyResult<NextStep> + Send + Sync;
/// The name of a step, and its value.
type NextStep = (&'static str, Py<PyAny>);

enum Event<'a> {
    Next,
    Replied(&'a [u8]),
    Confirmed,
    Commanded,
    Lost,
}

impl Arrival {
    /// Follows a motor with this watch: its requests, replies, result and error in Python.
    pub(crate) fn new<S: Sampler<Request: Copy + Send + Sync> + 'static>(
        mut watch: Watch<S>,
        ask: fn(Python<'_>, S::Request) -> PyResult<Py<PyAny>>,
        reply: fn(S::Request, &[u8]) -> Option<S::Reply>,
        arrived: impl Fn(Python<'_>, S::Arrived) -> PyResult<Py<PyAny>> + Send + Sync + 'static,
        not_arrived: impl Fn(Python<'_>, NotArrived<S::Reason>) -> PyErr + Send + Sync + 'static,
    ) -> Self
    where
        Watch<S>: Send + Sync,
    {
        let mut request = None;
        Arrival(Box::new(move |py, now, event| {
            match event {
                Event::Next => {
                    return Ok(match watch.next(now) {
                        Step::Ask(next) => ("ask", ask(py, *request.insert(next))?),
                        Step::Confirm => ("confirm", py.None()),
                        Step::Command => ("command", py.None()),
                        Step::Wait(until) => ("wait", seconds(until.since(now)).into_py_any(py)?),
                        Step::Done(Ok(it)) => ("done", arrived(py, it)?),
                        Step::Done(Err(NotArrived::Silent { .. })) => ("silent", py.None()),
                        Step::Done(Err(why)) => return Err(not_arrived(py, why)),
                    });
                }
                Event::Replied(data) => match request.and_then(|request| reply(request, data)) {
                    Some(reply) => watch.replied(now, &reply),
                    None => watch.lost(now),
                },
                Event::Confirmed => watch.confirmed(now),
                Event::Commanded => watch.commanded(now),
                Event::Lost => watch.lost(now),
            }
            Ok(("", py.None()))
        }))
    }
}

#[pymethods]
impl Arrival {
    /// The next step at this time of the port's clock, s, with its value: `ask` and a request, `confirm`,
    /// `command`, `wait` and s, `done` and the result, `silent`.
    fn next(&mut self, py: Python<'_>, now: f64) -> PyResult<NextStep> {
        (self.0)(py, instant(now), Event::Next)
    }

    /// Takes the reply to the last request.
    fn replied(&mut self, py: Python<'_>, now: f64, data: &[u8]) -> PyResult<()> {
        (self.0)(py, instant(now), Event::Replied(data)).map(drop)
    }

    /// Records that the replies went to their own requests.
    fn confirmed(&mut self, py: Python<'_>, now: f64) -> PyResult<()> {
        (self.0)(py, instant(now), Event::Confirmed).map(drop)
    }

    /// Records that the motor was commanded.
    fn commanded(&mut self, py: Python<'_>, now: f64) -> PyResult<()> {
        (self.0)(py, instant(now), Event::Commanded).map(drop)
    }

    /// Records that the last reply cannot be trusted.
    fn lost(&mut self, py: Python<'_>, now: f64) -> PyResult<()> {
        (self.0)(py, instant(now), Event::Lost).map(drop)
    }
}

/// The checked tolerance and timeout of a wait.
pub(crate) fn options(
    py: Python<'_>,
    tolerance: Option<f64>,
    timeout: Option<f64>,
) -> PyResult<(Option<f64>, Option<Micros>)> {
    if tolerance.is_some_and(|tolerance| !(tolerance >= 0.0 && tolerance.is_finite())) {
        return Err(invalid_value(py, "a tolerance is 0 or more; nothing was sent"));
    }
    let timeout = timeout.map(|timeout| span(py, "a timeout", timeout)).transpose()?;
    Ok((tolerance, timeout.map(Into::into)))
}
