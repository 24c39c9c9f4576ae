//! The simulated drives, in a process of their own: their work is not the engine's.

use std::env::current_exe;
use std::fmt::Write;
use std::io::{BufRead, BufReader, stdin};
use std::os::fd::AsFd;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use motorlink_testbench::{BenchConfig, SimServer};

use super::motors::{BUSES, MOTORS_OF_BUS, ST_LINES};
use motorlink_kernels::result::Result;

/// How long the drives wait for a request before they look at their clock.
const TURN: Duration = Duration::from_millis(100);

/// Serves the drives until the end of standard input. Prints the address of each port, the buses
/// first.
pub fn serve() -> Result<()> {
    let mut motors = String::new();
    for id in 1..=MOTORS_OF_BUS {
        writeln!(motors, "[[rmd.motor]]\nid = {id}")?;
    }
    let config = BenchConfig::parse(&motors)?;
    let port = "tcp-listen:127.0.0.1:0".parse()?;
    let mut server = SimServer::new();
    for _ in 0..BUSES {
        println!("{}", server.serve_rmd(&port, &config)?["path"].as_str().unwrap_or_default());
    }
    for _ in 0..ST_LINES {
        println!("{}", server.serve_st(&port, &config)?["path"].as_str().unwrap_or_default());
    }
    let input = stdin();
    while !server.turn(TURN, Some(input.as_fd()))?.extra_is_ready {}
    Ok(())
}

/// The process. It ends when this is dropped, which closes its input.
pub(super) struct Drives {
    process: Child,
    /// The addresses of the ports, the buses first.
    pub(super) addresses: Vec<String>,
}

impl Drives {
    pub(super) fn start() -> Result<Self> {
        let process = Command::new(current_exe()?)
            .arg("drives")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let mut drives = Drives { process, addresses: Vec::new() };
        let output = drives.process.stdout.take().ok_or("the drives have no output")?;
        for line in BufReader::new(output).lines().take(BUSES + ST_LINES) {
            drives.addresses.push(line?);
        }
        Ok(drives)
    }
}

impl Drop for Drives {
    fn drop(&mut self) {
        self.process.stdin.take();
        // Its exit code says nothing: the measurement is over.
        let _ = self.process.wait();
    }
}
