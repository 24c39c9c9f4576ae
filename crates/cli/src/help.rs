//! Help that belongs to more than one command, and the manual pages.

use std::path::Path;

use clap::Command;

use crate::failure::Failure;

/// Behind `motorlink --help`.
pub const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 the drive refused, 2 the command does not make sense, 3 the line failed.
`motorlink demo` needs no hardware; `motorlink ports` shows what is connected.";

/// Behind `motorlink st --help`.
pub const ST_PORTS: &str = "\
Ports:
  /dev/ttyACM0, serial:/dev/ttyUSB0?baud=115200   a UART
  tcp:HOST:PORT                                   a serial line behind a TCP server
  sim:, sim:bench.toml                            simulated drives inside this process
MOTORLINK_PORT names the port where -p does not.";

/// Behind `motorlink rmd --help`.
pub const RMD_PORTS: &str = "\
Ports:
  slcan:/dev/ttyACM0?bitrate=1000000   a CAN adapter that speaks slcan
  slcan:tcp:HOST:PORT                  the same behind a TCP server
  socketcan:can0                       a CAN interface of Linux
  sim:, sim:bench.toml                 simulated motors inside this process
Behind slcan ports: baud=RATE for the adapter's own line, echo=1 if it sends back what it is sent.
MOTORLINK_PORT names the port where -p does not.";

/// Writes a manual page for the program and each of its commands.
pub fn write_manual(command: Command, folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)?;
    clap_mangen::generate_to(command, folder)?;
    println!("{}", folder.join("motorlink.1").display());
    Ok(())
}
