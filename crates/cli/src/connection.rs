//! Options of every command that opens a port.

use std::sync::Arc;

use motorlink::port::{
    ByteLink, CanLink, EventBytes, EventCan, FaultBytes, FaultCan, PortName, Tap,
};
use motorlink::rmd::IDENTIFIERS;
use motorlink::st::Profile;
use motorlink_link::fault::{FaultError, Faults};

use crate::failure::Failure;
use crate::help;
use crate::output::{Printer, note};
use crate::trace;

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

    /// Wraps a serial line each time it is opened, for --trace and --fault. Each opening has other damage.
    pub fn around_line(
        &self,
        profile: Profile,
    ) -> Result<impl FnMut(Box<dyn ByteLink>) -> Box<dyn ByteLink> + Send + 'static, Failure> {
        let mut wrap = Wrap::new(self, Faults::on_serial)?;
        Ok(move |link| {
            let faulty = |link: Box<dyn ByteLink>, faults: &Faults| -> Box<dyn ByteLink> {
                Box::new(FaultBytes::new(link, faults))
            };
            wrap.around(link, faulty, |link| Box::new(Tap::bytes(link, trace::bytes(profile))))
        })
    }

    /// As [`around_line`](Self::around_line), for an event loop.
    pub fn around_event_line(
        &self,
        profile: Profile,
    ) -> Result<impl FnMut(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static, Failure>
    {
        let mut wrap = Wrap::new(self, Faults::on_serial)?;
        Ok(move |link| {
            let faulty = |link: Box<dyn EventBytes>, faults: &Faults| -> Box<dyn EventBytes> {
                Box::new(FaultBytes::new(link, faults))
            };
            wrap.around(link, faulty, |link| Box::new(Tap::bytes(link, trace::bytes(profile))))
        })
    }

    /// As [`around_line`](Self::around_line), for a CAN bus.
    pub fn around_bus(
        &self,
    ) -> Result<impl FnMut(Box<dyn CanLink>) -> Box<dyn CanLink> + Send + 'static, Failure> {
        let mut wrap = Wrap::new(self, Faults::on_can)?;
        Ok(move |link| {
            let faulty = |link: Box<dyn CanLink>, faults: &Faults| -> Box<dyn CanLink> {
                Box::new(FaultCan::new(link, faults, IDENTIFIERS))
            };
            wrap.around(link, faulty, |link| Box::new(Tap::frames(link, trace::frames())))
        })
    }

    /// As [`around_bus`](Self::around_bus), for an event loop.
    pub fn around_event_bus(
        &self,
    ) -> Result<impl FnMut(Box<dyn EventCan>) -> Box<dyn EventCan> + Send + 'static, Failure> {
        let mut wrap = Wrap::new(self, Faults::on_can)?;
        Ok(move |link| {
            let faulty = |link: Box<dyn EventCan>, faults: &Faults| -> Box<dyn EventCan> {
                Box::new(FaultCan::new(link, faults, IDENTIFIERS))
            };
            wrap.around(link, faulty, |link| Box::new(Tap::frames(link, trace::frames())))
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

/// What is put around a port.
struct Wrap {
    trace: bool,
    faults: Option<Faults>,
}

impl Wrap {
    fn new(
        connection: &Connection,
        check: impl FnOnce(Faults) -> Result<Faults, FaultError>,
    ) -> Result<Self, Failure> {
        let faults = connection.fault.map(check).transpose()?;
        if connection.port()?.is_held() {
            if faults.is_some() {
                let refused =
                    "--fault damages frames, and a port of a share or node carries requests";
                return Err(
                    Failure::usage(refused).trying("use it on the port of the drive itself")
                );
            }
            if connection.trace {
                note(
                    "--trace shows no frames here: a share or node has the line. `motorlink monitor` shows \
                     the frames on its wire",
                );
            }
        }
        Ok(Wrap { trace: connection.trace, faults })
    }

    fn around<L>(
        &mut self,
        mut link: L,
        faulty: impl FnOnce(L, &Faults) -> L,
        tapped: impl FnOnce(L) -> L,
    ) -> L {
        if let Some(faults) = &mut self.faults {
            link = faulty(link, faults);
            faults.seed = faults.seed.wrapping_add(1);
        }
        if self.trace { tapped(link) } else { link }
    }
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
