//! What every command that opens a port takes.

use motorlink::port::PortName;

use crate::failure::Failure;
use crate::output::Output;

#[derive(clap::Args)]
pub struct Connection {
    #[command(flatten)]
    port: Port,
    /// Print JSON, an object a line
    #[arg(long, global = true)]
    json: bool,
    /// Take and print values as the digits that travel instead of physical units
    #[arg(long, global = true)]
    pub raw: bool,
    /// Show every frame on stderr
    #[arg(long, global = true)]
    pub trace: bool,
}

/// Which port.
#[derive(clap::Args)]
pub struct Port {
    /// The port: /dev/ttyACM0, tcp:HOST:PORT, slcan:DEVICE, socketcan:can0, sim: and more
    #[arg(short, long, env = "MOTORLINK_PORT", global = true)]
    port: Option<String>,
}

impl Connection {
    /// The port that -p or MOTORLINK_PORT names.
    pub fn port(&self) -> Result<PortName, Failure> {
        self.port.name()
    }

    /// Where results go.
    pub fn output(&self) -> Output {
        Output { json: self.json }
    }
}

impl Port {
    /// The port that -p or MOTORLINK_PORT names.
    pub fn name(&self) -> Result<PortName, Failure> {
        match self.port.as_deref() {
            Some(name) if !name.is_empty() => Ok(name.parse()?),
            _ => Err(Failure::Usage(
                "which port? give -p PORT or set MOTORLINK_PORT; `motorlink ports` lists what is \
                 connected, and `-p sim:` needs no hardware"
                    .to_owned(),
            )),
        }
    }
}
