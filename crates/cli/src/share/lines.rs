//! The ports that a share holds.

use std::time::Duration;

use motorlink::port::PortName;
use motorlink::st::Profile;
use motorlink_telemetry::share::hub::SharedLine;
use motorlink_telemetry::share::message::{Line, Protocol};
use motorlink_telemetry::share::port_config::{Limits, PortConfig, protocols_of};

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

    /// Refuses a share whose ST drives have another profile than the one that was asked for.
    pub fn check(&self, lines: &[Line]) -> Result<(), Failure> {
        let asked = self.profile.name();
        let mut profiles = lines.iter().filter_map(|one| Some((&one.line, one.profile.as_ref()?)));
        match profiles.find(|(_, profile)| *profile != asked) {
            Some((line, profile)) if self.profile != Profile::default() => Err(Failure::usage(
                format!("{line} of the share has the profile {profile}, not {asked}"),
            )
            .trying("leave --profile out, and unset MOTORLINK_PROFILE")),
            _ => Ok(()),
        }
    }

    /// Opens each port, once for each protocol that it can have. `limits` hold for all programs.
    pub fn open(&self, limits: Limits) -> Result<Vec<SharedLine>, Failure> {
        let (mut held, mut st, mut rmd) = (Vec::new(), 0_usize, 0_usize);
        if self.is_empty() {
            return Err(missing_port());
        }
        for text in &self.ports {
            let (profile, timeout) = (self.profile, self.timeout);
            let port: PortName = text.parse()?;
            if port.is_held() {
                // Two shares would own the same motor, each for a program of its own.
                return Err(Failure::usage(format!(
                    "{port}: a share or node already holds this line"
                ))
                .trying("use that one: programs connect to it"));
            }
            let wish = PortConfig { port, profile, timeout, limits };
            for protocol in protocols_of(&wish.port) {
                let number = match protocol {
                    Protocol::St => &mut st,
                    Protocol::Rmd => &mut rmd,
                };
                let name = format!("{}{number}", protocol.word());
                let opened = wish.open(protocol).map_err(|error| Failure::from(&error))?;
                held.push(SharedLine::start(&name, opened)?);
                *number += 1;
            }
        }
        Ok(held)
    }
}
