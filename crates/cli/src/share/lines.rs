//! The ports that a share holds.

use std::time::Duration;

use motorlink::port::PortName;
use motorlink::st::Profile;
use motorlink::{rmd, st};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::{RmdLine, StLine};
use motorlink_telemetry::share::hub::Held;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::share::wire::Tap;
use motorlink_telemetry::share::words::Speaks;

use crate::connection::missing_port;
use crate::failure::Failure;
use crate::hint;
use crate::span::span_up_to;

#[derive(clap::Args)]
pub struct Lines {
    /// A port to hold: /dev/ttyACM0, slcan:DEVICE, socketcan:can0, sim: and more; may be repeated
    #[arg(short, long = "port", value_name = "PORT", env = "MOTORLINK_PORT",
        value_hint = clap::ValueHint::AnyPath)]
    pub ports: Vec<String>,
    /// What the ST drives speak: the document, or the firmware of MCSDK 5.4
    #[arg(long, env = "MOTORLINK_PROFILE", default_value = "spec", value_parser = hint::profile())]
    profile: Profile,
    /// How long to wait for a reply, 1ms to 60s [default: 1s, on a CAN bus 50ms]
    #[arg(long, value_name = "TIME", value_parser = span_up_to(Duration::from_secs(60)))]
    pub timeout: Option<Duration>,
}

impl Lines {
    /// Whether no port is named.
    pub fn is_empty(&self) -> bool {
        self.ports.iter().all(String::is_empty)
    }

    /// Opens each port, once for each protocol that it can have.
    pub fn open(&self) -> Result<Vec<Held>, Failure> {
        let (mut held, mut st, mut rmd) = (Vec::new(), 0, 0);
        if self.is_empty() {
            return Err(missing_port());
        }
        for text in &self.ports {
            let port: PortName = text.parse()?;
            if port.as_line().is_some() {
                let defaults = st::Options::default();
                let timeout = self.timeout.unwrap_or(defaults.timeout);
                let options = st::Options { profile: self.profile, timeout, ..defaults };
                let (tap, around) = taps();
                let wrap = move |link| around.around_line(link);
                let client = st::EventClient::open_wrapped(&port, wrap, options)?;
                let engine = Acquisition::new(Box::new(StLine::new(client)));
                let name = format!("{}{st}", Protocol::St.word());
                let speaks = Speaks::St(self.profile);
                held.push(Held::start(&name, &port.to_string(), speaks, engine, tap)?);
                st += 1;
            }
            if port.as_can().is_some() {
                let defaults = rmd::Options::default();
                let timeout = self.timeout.unwrap_or(defaults.timeout);
                let options = rmd::Options { timeout, ..defaults };
                let (tap, around) = taps();
                let wrap = move |link| around.around_bus(link);
                let client = rmd::EventClient::open_wrapped(&port, wrap, options)?;
                let engine = Acquisition::new(Box::new(RmdLine::new(client)));
                let name = format!("{}{rmd}", Protocol::Rmd.word());
                held.push(Held::start(&name, &port.to_string(), Speaks::Rmd, engine, tap)?);
                rmd += 1;
            }
        }
        Ok(held)
    }
}

/// A tap, for the line and to put around its port.
fn taps() -> (Tap, Tap) {
    let tap = Tap::default();
    (tap.clone(), tap)
}
