//! CAN adapters with slcan on any serial line.

use motorlink_slcan::Bitrate;

use super::super::carries::Carries;
use super::super::echo::EchoCanceller;
use super::super::error::PortError;
use super::super::event::EventCan;
use super::super::link::CanLink;
use super::super::name::NameError;
use super::super::place::Place;
use super::super::scheme::{CanPort, Form, Given, LinePort, Port, PortName, Scheme, parse};
use super::super::slcan::SlcanLink;
use super::serial::{Device, Serial};

/// `slcan:/dev/ttyACM0?bitrate=1000000`, `slcan:tcp:HOST:PORT`.
pub(super) struct Slcan;

impl Scheme for Slcan {
    fn name(&self) -> &'static str {
        "slcan"
    }

    fn forms(&self) -> &'static [Form] {
        const ADAPTER: Form = Form {
            text: "slcan:/dev/ttyACM0?bitrate=1000000",
            help: "a CAN adapter that speaks slcan",
            carries: Carries::Frames,
        };
        &[
            ADAPTER,
            Form { text: "slcan:tcp:HOST:PORT", help: "the same behind a TCP server", ..ADAPTER },
            Form { text: "slcan:unix:PATH", help: "the same behind a Unix socket", ..ADAPTER },
        ]
    }

    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError> {
        let rest = given.present(rest, "a device", "slcan:/dev/ttyACM0")?;
        let bitrate = match given.take("bitrate") {
            Some(value) => value
                .parse()
                .ok()
                .and_then(Bitrate::from_bits_per_second)
                .ok_or_else(|| given.bad_option("bitrate", value, bitrates()))?,
            None => Bitrate::DEFAULT,
        };
        let echo = match given.take("echo") {
            Some("1") => true,
            Some("0") | None => false,
            Some(value) => return Err(given.bad_option("echo", value, "0 or 1".to_owned())),
        };
        let (scheme, line) =
            parse(rest, given).unwrap_or_else(|| (&Serial, Device::at(rest).with_options(given)));
        let adapter = Adapter { line: line?, bitrate, echo };
        if adapter.line.as_line().is_none() {
            let (name, behind) = (given.name.to_owned(), rest.to_owned());
            return Err(NameError::NoLineBehind { name, behind });
        }
        given.refuse_others(&[self.options(), scheme.options()].concat())?;
        Ok(PortName::new(adapter))
    }

    fn options(&self) -> &'static [&'static str] {
        &["bitrate", "echo"]
    }
}

fn bitrates() -> String {
    Bitrate::ALL.map(|rate| rate.bits_per_second().to_string()).join(", ")
}

/// An adapter and its bus.
#[derive(Debug, Clone)]
struct Adapter {
    /// The port of the adapter.
    line: PortName,
    bitrate: Bitrate,
    /// Whether the adapter echoes sent frames.
    echo: bool,
}

impl Adapter {
    fn line(&self) -> Result<&dyn LinePort, PortError> {
        let closed = || PortError::Closed(self.line.to_string());
        self.line.as_line().ok_or_else(closed)
    }
}

impl Port for Adapter {
    fn body(&self) -> String {
        let line = self.line.body();
        // The part before a colon would be parsed as a scheme.
        let is_plain = |path: &&str| path.starts_with(['/', '.']) || !path.contains(':');
        let bare = line.strip_prefix("serial:").filter(is_plain);
        format!("slcan:{}", bare.unwrap_or(&line))
    }

    fn options(&self) -> Vec<String> {
        let mut options = Vec::new();
        if self.bitrate != Bitrate::DEFAULT {
            options.push(format!("bitrate={}", self.bitrate.bits_per_second()));
        }
        options.extend(self.line.options());
        options.extend(self.echo.then(|| "echo=1".to_owned()));
        options
    }

    fn as_can(&self) -> Option<&dyn CanPort> {
        Some(self)
    }

    fn is_in_process(&self) -> bool {
        self.line.is_in_process()
    }

    fn is_device(&self) -> bool {
        self.line.is_device()
    }

    fn is_address(&self) -> bool {
        self.line.is_address()
    }

    fn place(&self) -> Place {
        self.line.place()
    }
}

impl CanPort for Adapter {
    fn open(&self) -> Result<Box<dyn CanLink>, PortError> {
        let line = self.line()?;
        let link = SlcanLink::open(line.open()?, line.label(), self.bitrate)?;
        Ok(if self.echo { Box::new(EchoCanceller::new(link)) } else { Box::new(link) })
    }

    fn open_event(&self) -> Result<Box<dyn EventCan>, PortError> {
        let line = self.line()?;
        let link = SlcanLink::open(line.open_event()?, line.label(), self.bitrate)?;
        Ok(if self.echo { Box::new(EchoCanceller::new(link)) } else { Box::new(link) })
    }

    fn bitrate(&self) -> Option<u32> {
        Some(self.bitrate.bits_per_second())
    }

    fn bitrates(&self) -> Vec<u32> {
        Bitrate::ALL.iter().rev().map(|rate| rate.bits_per_second()).collect()
    }

    fn at_bitrate(&self, bitrate: u32) -> Option<PortName> {
        let bitrate = Bitrate::from_bits_per_second(bitrate)?;
        Some(PortName::new(Adapter { bitrate, ..self.clone() }))
    }
}
