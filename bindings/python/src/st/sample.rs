//! Sampling registers: in data segments where the drive has them, else one by one.

use motorlink::stmcp::register::Access;
use motorlink::stmcp::{
    Client, Error, MotorHandle, Profile, RegisterId, SEGMENT_REGISTERS, SEGMENTS,
};
use pyo3::prelude::*;

use super::scale::Scale;
use crate::clock::Clock;
use crate::error::st_error;
use crate::sampling::{Plan, Rows, cell};

/// The registers of one motor.
pub(super) struct Lane {
    pub(super) motor: u8,
    pub(super) registers: Vec<RegisterId>,
    pub(super) scale: Scale,
}

/// A lane on its drive.
struct Reader<'a> {
    motor: MotorHandle<'a>,
    lane: &'a Lane,
    /// The data segment that has its registers.
    segment: Option<u8>,
}

/// Samples until the plan is done or something fails; gives what was sampled in either case. With
/// `skip` a line that fails costs the row and nothing else.
pub(super) fn sample(
    client: &Client,
    clock: &dyn Clock,
    look: impl Fn(Python<'_>) -> PyResult<()>,
    plan: &Plan,
    lanes: &[Lane],
    raw: bool,
    skip: bool,
) -> (Rows, PyResult<()>) {
    let mut rows = Rows::default();
    let raised = |error: Error| Python::attach(|py| st_error(py, &error));
    let readers: Result<Vec<Reader<'_>>, Error> = lanes
        .iter()
        .zip((0..SEGMENTS as u8).rev().map(Some).chain(std::iter::repeat(None)))
        .map(|(lane, segment)| Reader::new(client, lane, segment))
        .collect();
    let mut readers = match readers {
        Ok(readers) => readers,
        Err(error) => return (rows, Err(raised(error))),
    };
    let mut values = Vec::new();
    let outcome = plan.run(clock, look, |time| {
        values.clear();
        for reader in &mut readers {
            match reader.read(raw, &mut values) {
                Ok(()) => {}
                Err(error) if skip && error.is_line_failure() => return Ok(()),
                Err(error) => return Err(raised(error)),
            }
        }
        rows.push(time, &values);
        Ok(())
    });
    (rows, outcome)
}

impl<'a> Reader<'a> {
    /// Chooses how to read, and configures the segment if there is one.
    fn new(client: &'a Client, lane: &'a Lane, segment: Option<u8>) -> Result<Self, Error> {
        let only_there = |register: &RegisterId| {
            register.shape().is_some_and(|shape| shape.access == Access::Dac)
        };
        let registers = &lane.registers;
        let known = registers.iter().all(|register| register.shape().is_some());
        // In the other profile the same frame codes command the motor.
        let possible =
            client.profile() == Profile::Spec && known && registers.len() <= SEGMENT_REGISTERS;
        let worth = registers.len() > 1 || registers.iter().any(only_there);
        let motor = client.motor(lane.motor)?;
        let mut reader = Reader { motor, lane, segment: segment.filter(|_| possible && worth) };
        reader.configure()?;
        Ok(reader)
    }

    /// A drive that refuses the segment has its registers read one by one.
    fn configure(&mut self) -> Result<(), Error> {
        let Some(segment) = self.segment else { return Ok(()) };
        match self.motor.configure_segment(segment, &self.lane.registers) {
            Err(error) if error.is_refusal() => self.segment = None,
            other => return other,
        }
        Ok(())
    }

    fn read(&mut self, raw: bool, values: &mut Vec<[u8; 8]>) -> Result<(), Error> {
        let Lane { registers, scale, .. } = self.lane;
        let mut bits = [0; SEGMENT_REGISTERS];
        let mut read = self.read_segment(&mut bits);
        if read.as_ref().is_err_and(Error::is_refusal) {
            // A drive that was restarted has forgotten the segment.
            self.configure()?;
            read = self.read_segment(&mut bits);
        }
        let segmented = read?;
        for (n, &register) in registers.iter().enumerate() {
            let bits = if segmented { bits[n] } else { self.motor.read_raw(register)? };
            values.push(cell(raw, scale.raw(register, bits), scale.physical(register, bits)));
        }
        Ok(())
    }

    /// Whether there is a segment, which has been read.
    fn read_segment(&self, bits: &mut [i32]) -> Result<bool, Error> {
        let Some(segment) = self.segment else { return Ok(false) };
        self.motor.read_segment(segment, &self.lane.registers, bits).map(|()| true)
    }
}
