//! Options of every command that opens a port.

use std::sync::Arc;

use motorlink::port::PortName;
use motorlink_link::fault::{FaultError, Faults};

use crate::failure::Failure;
use crate::help;
use crate::output::{Printer, note};

#[derive(clap::Args)]
#[command(next_help_heading = help::GLOBAL)]
pub struct Connection {
    #[command(flatten)]
    port: Port,
    /// Print JSON, one object per line
    #[arg(long, global = true)]
    json: bool,
    /// Read and print raw protocol values instead of physical units
    #[arg(long, global = true)]
    pub raw: bool,
    /// Show every frame on stderr
    #[arg(long, global = true)]
    trace: bool,
    /// Damage the data on the port, to rehearse errors: flip=1e-4,delay=5ms..30ms; `motorlink st
    /// --help` and `motorlink rmd --help` list all faults
    #[arg(long, global = true, value_name = "SPEC")]
    pub fault: Option<Faults>,
}

/// Which port.
#[derive(clap::Args)]
pub struct Port {
    /// The port: /dev/ttyACM0, tcp:HOST:PORT, slcan:DEVICE, socketcan:can0, sim: and more
    #[arg(short, long, env = "MOTORLINK_PORT", global = true, value_hint = clap::ValueHint::AnyPath)]
    port: Option<String>,
}

impl Connection {
    /// The port that -p or MOTORLINK_PORT names.
    pub fn port(&self) -> Result<PortName, Failure> {
        self.port.name()
    }

    /// The port as the user wrote it.
    pub fn port_text(&self) -> &str {
        self.port.port.as_deref().unwrap_or_default()
    }

    /// What is put around a port each time it is opened, for --trace and --fault. Each opening has other
    /// damage. `check` refuses faults that the port cannot have.
    pub fn around<L>(
        &self,
        check: fn(Faults) -> Result<Faults, FaultError>,
        faulty: impl Fn(L, &Faults) -> L + Send + 'static,
        tapped: impl Fn(L) -> L + Send + 'static,
    ) -> Result<impl FnMut(L) -> L + Send + 'static, Failure> {
        let mut faults = self.fault.map(check).transpose()?;
        let trace = self.trace;
        if self.port()?.is_held() {
            if faults.is_some() {
                let refused =
                    "--fault damages frames, and a port of a share or node carries requests";
                return Err(
                    Failure::usage(refused).trying("use it on the port of the drive itself")
                );
            }
            if trace {
                note(
                    "--trace shows no frames here: a share or node has the line. `motorlink monitor` shows \
                     the frames on its wire",
                );
            }
        }
        Ok(move |mut link| {
            if let Some(faults) = &mut faults {
                link = faulty(link, faults);
                faults.seed = faults.seed.wrapping_add(1);
            }
            if trace { tapped(link) } else { link }
        })
    }

    /// Where results go.
    pub fn output(&self) -> Printer {
        Printer { json: self.json }
    }
}

impl Port {
    /// The port that -p or MOTORLINK_PORT names.
    pub fn name(&self) -> Result<PortName, Failure> {
        match self.port.as_deref() {
            Some(name) if !name.is_empty() => Ok(name.parse()?),
            _ => Err(missing_port()),
        }
    }
}

/// Neither -p nor MOTORLINK_PORT names a port.
pub fn missing_port() -> Failure {
    Failure::usage("the port is missing").trying(
        "give -p PORT or set MOTORLINK_PORT; `motorlink ports` lists what is connected, and \
         `-p sim:` needs no hardware",
    )
}

/// Says, after a command that changes the motion of motors, that the holder of the port stops them now.
pub fn tell_of_stop(port: &PortName) {
    if port.is_held() {
        note(
            "the share stops the motor now, because this command ends: on a share a motor turns as long \
             as the program that last changed its motion. Use a move with --wait, or a program that stays",
        );
    }
}

/// The name of a port in the messages of clients.
pub fn name_in_messages(port: &str) -> Arc<str> {
    port.trim_end_matches(':').into()
}
