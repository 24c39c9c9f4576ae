//! What a node needs of others to read its drives.
//!
//! `cli` implements [`Reader`] with `motorlink_monitor::drive`, so this crate does not depend on the monitor.

use std::collections::BTreeMap;
use std::pin::Pin;

use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::message::Line;

use crate::message::Value;

/// A motor that is read.
#[derive(Clone)]
pub struct Drive {
    /// Asks the share of the node.
    pub program: Program,
    /// The line of the motor.
    pub line: Line,
    /// Its number or ID.
    pub motor: u8,
}

/// What comes when a drive has been read.
pub type Reading<'a, T> = Pin<Box<dyn Future<Output = Result<T, Refusal>> + Send + 'a>>;

/// Reads drives for queries of programs. It knows the protocols of drives; a node does not.
pub trait Reader: Send + Sync {
    /// The names of the registers of a line's motors that can be read.
    fn registers(&self, line: &Line) -> Vec<String>;

    /// Reads registers, in the order of their names. One that the drive refuses does not hide the others.
    fn read(&self, drive: Drive, names: Vec<String>) -> Reading<'_, Vec<Result<Value, Refusal>>>;

    /// What the drive says of itself, such as its `firmware`.
    fn identity(&self, drive: Drive) -> Reading<'_, BTreeMap<String, String>>;

    /// All settings of the motor, as the text of a file.
    fn settings(&self, drive: Drive) -> Reading<'_, String>;
}
