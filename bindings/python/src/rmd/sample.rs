//! Sampling what motors tell, all of them in the same cycles.

use motorlink::rmd::{Bus, Error, MotorId};
use motorlink_proto::rmd::Code;
use pyo3::prelude::*;

use super::quantity::Quantity;
use crate::clock::Clock;
use crate::error::rmd_error;
use crate::number::physical;
use crate::sampling::{Plan, Rows, cell};

/// The quantities of one motor.
pub(super) struct Lane {
    pub(super) id: MotorId,
    pub(super) quantities: Vec<Quantity>,
}

/// Samples until the plan is done or something fails; gives what was sampled in either case. With
/// `skip` a motor that fails to answer costs the row and nothing else.
pub(super) fn sample(
    bus: &Bus,
    clock: &dyn Clock,
    look: impl Fn(Python<'_>) -> PyResult<()>,
    plan: &Plan,
    lanes: &[Lane],
    raw: bool,
    skip: bool,
) -> (Rows, PyResult<()>) {
    let mut rows = Rows::default();
    let cycles = cycles(lanes);
    let outcome = plan.run(clock, look, |time| match row(bus, lanes, &cycles, raw) {
        Ok(values) => {
            rows.push(time, &values);
            Ok(())
        }
        Err(error) if skip && error.is_line_failure() => Ok(()),
        Err(error) => Err(Python::attach(|py| rmd_error(py, &error))),
    });
    (rows, outcome)
}

/// Each motor once a cycle, until every motor has been asked all of its questions.
fn cycles(lanes: &[Lane]) -> Vec<Vec<(MotorId, [u8; 8])>> {
    let mut cycles: Vec<Vec<(MotorId, [u8; 8])>> = Vec::new();
    for lane in lanes {
        let mut codes: Vec<Code> = Vec::new();
        for quantity in &lane.quantities {
            if !codes.contains(&quantity.code) {
                codes.push(quantity.code);
            }
        }
        cycles.resize_with(cycles.len().max(codes.len()), Vec::new);
        for (cycle, code) in cycles.iter_mut().zip(codes) {
            // A read has nothing but its code.
            cycle.push((lane.id, [code.number(), 0, 0, 0, 0, 0, 0, 0]));
        }
    }
    cycles
}

fn row(
    bus: &Bus,
    lanes: &[Lane],
    cycles: &[Vec<(MotorId, [u8; 8])>],
    raw: bool,
) -> Result<Vec<[u8; 8]>, Error> {
    let mut replies: Vec<(MotorId, Code, [u8; 8])> = Vec::new();
    for requests in cycles {
        let mut failed = None;
        bus.cycle(requests, |id, outcome| match outcome {
            Ok(reply) => {
                let asked = requests.iter().find(|(of, _)| *of == id);
                replies.extend(asked.map(|(_, request)| (id, Code::from(request[0]), reply)));
            }
            Err(error) => failed = Some(error),
        })?;
        if let Some(error) = failed {
            return Err(error);
        }
    }
    let mut values = Vec::new();
    for lane in lanes {
        for Quantity { code, field } in &lane.quantities {
            let reply = replies.iter().find(|(id, of, _)| *id == lane.id && of == code);
            // Every request was answered, or the row has failed above.
            let digits = reply.map_or(0, |(.., reply)| field.raw(reply));
            values.push(cell(raw, digits, physical(digits, field.scale)));
        }
    }
    Ok(values)
}
