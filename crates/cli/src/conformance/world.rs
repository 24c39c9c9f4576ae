//! The user's hands: shell commands for what the wire cannot do.

use std::process::{Command, Stdio};

use motorlink_conformance::{Unavailable, World};

use super::args::Run;
use crate::interrupt::interrupted;

/// Runs what the user gave.
pub struct Commands(pub Run);

impl World for Commands {
    fn power_cycle(&mut self) -> Result<(), Unavailable> {
        shell(self.0.power_cycle.as_deref(), "--power-cycle")
    }

    fn fault(&mut self, present: bool) -> Result<(), Unavailable> {
        let (command, option) = match present {
            true => (&self.0.fault_on, "--fault-on"),
            false => (&self.0.fault_off, "--fault-off"),
        };
        shell(command.as_deref(), option)
    }

    fn interrupted(&self) -> bool {
        interrupted()
    }
}

fn shell(command: Option<&str>, option: &str) -> Result<(), Unavailable> {
    let command = command.ok_or_else(|| Unavailable(format!("{option} was not given")))?;
    let status = Command::new("sh")
        .args(["-c", command])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .status()
        .map_err(|error| Unavailable(format!("{option}: cannot run sh: {error}")))?;
    if status.success() {
        return Ok(());
    }
    Err(Unavailable(format!("{option}: `{command}` failed: {status}")))
}
