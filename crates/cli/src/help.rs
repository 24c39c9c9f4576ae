//! Help that belongs to more than one command, and the manual pages.

use std::path::Path;

use clap::Command;
use motorlink::port::{Carries, schemes};

use crate::failure::Failure;
use crate::output::print_line;

/// Behind `motorlink --help`.
pub const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 the drive refused, 2 the command does not make sense, 3 the line failed.
`motorlink demo` needs no hardware; `motorlink ports` shows what is connected.";

/// Behind `motorlink st --help`.
pub fn st_ports() -> String {
    ports(Carries::Bytes) + ST_FAULTS
}

/// Behind `motorlink rmd --help`.
pub fn rmd_ports() -> String {
    ports(Carries::Frames) + RMD_FAULTS
}

/// How the names of ports that carry this are written.
fn ports(carries: Carries) -> String {
    let schemes = schemes();
    let forms = || {
        let forms = schemes.iter().flat_map(|scheme| scheme.forms());
        forms.filter(|form| form.carries.serves(carries))
    };
    let width = forms().map(|form| form.text.len()).max().unwrap_or(0);
    let rows = forms().map(|form| format!("  {:width$}   {}\n", form.text, form.help));
    "Ports:\n".to_owned() + &rows.collect::<String>()
}

const ST_FAULTS: &str = "\
MOTORLINK_PORT names the port where -p does not.
--fault damages what passes the port, both ways unless only=sent or
only=received:
  flip=RATE drop=RATE dup=RATE insert=RATE
                      a bit wrong, a byte lost, twice, or from nowhere
  delay=5ms..30ms     every write later by that much
  pause=TIME@RATE cut=TIME@RATE
                      all of it late, or lost, for a while
  flood=COUNT@RATE stuck0=TIME@RATE stuck1=TIME@RATE
                      garbage; only 0x00, or 0xFF
  seed=N              the same seed, the same damage
RATE is a chance a byte (flip: a bit). A damaged request may still pass for
another one: rehearse on simulated drives, or with the motor free to turn.";

const RMD_FAULTS: &str = "\
Behind slcan ports: baud=RATE for the adapter's own line, echo=1 if it sends
back what it is sent, clock=HOST:PORT for the time of an emulated board.
MOTORLINK_PORT names the port where -p does not.
--fault damages what passes the port, both ways unless only=sent or
only=received:
  flip=RATE drop=RATE dup=RATE insert=RATE
                      a bit wrong, a frame lost, twice, or from nowhere
  delay=5ms..30ms     every frame later by that much
  pause=TIME@RATE cut=TIME@RATE
                      all of it late, or lost, for a while
  flood=COUNT@RATE corrupt=RATE
                      foreign frames; a bit of the data wrong, unnoticed
  seed=N              the same seed, the same damage
RATE is a chance a frame (flip: a bit). A damaged request may still pass for
another one (corrupt): rehearse on simulated drives, or with the motor free to
turn.";

/// Writes a manual page for the program and each of its commands.
pub fn write_manual(command: Command, folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)?;
    clap_mangen::generate_to(command, folder)?;
    print_line(&folder.join("motorlink.1").display())
}
