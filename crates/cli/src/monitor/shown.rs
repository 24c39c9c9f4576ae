//! What the monitor shows, if it runs in another program.

use std::sync::Arc;

use motorlink::port::PortName;
use motorlink_telemetry::share::address::{Address, Local};
use motorlink_telemetry::share::port::place_of;

use crate::failure::Failure;
use crate::share::{self, Lines};

#[derive(clap::Args)]
pub struct Running {
    /// Show a share that runs: unix:PATH. Its drives are not opened again
    #[arg(long, value_name = "PORT", conflicts_with_all = ["at", "timeout"],
        value_hint = clap::ValueHint::AnyPath)]
    share: Option<String>,
    /// Show the nodes of a network (`motorlink node`) and their drives
    #[cfg(feature = "fleet")]
    #[arg(long, conflicts_with_all = ["at", "share", "timeout"])]
    fleet: bool,
    /// With --fleet: only this node; may be repeated
    #[cfg(feature = "fleet")]
    #[arg(long = "node", value_name = "NAME", requires = "fleet")]
    nodes: Vec<motorlink_fleet::key::Name>,
    /// With --fleet: addresses with commas between them, of which the first that answers is used, or a Zenoh configuration (.json5)
    #[cfg(feature = "fleet")]
    #[arg(long, value_name = "NETWORK", requires = "fleet")]
    via: Option<motorlink_fleet::network::Network>,
}

/// A share of another program.
pub struct Shown {
    pub share: Arc<dyn Address>,
    /// Where it is, for people.
    pub at: String,
    /// Its lines are those of nodes, which come and go.
    pub is_fleet: bool,
}

impl Running {
    /// The share that is shown, if it runs in another program.
    pub fn shown(&self, lines: &Lines, has_at: bool) -> Result<Option<Shown>, Failure> {
        #[cfg(feature = "fleet")]
        if self.fleet {
            return match lines.is_empty() {
                true => Ok(Some(self.nodes())),
                false => Err(Failure::usage("--fleet shows nodes that have their ports")
                    .trying("leave -p out, and unset MOTORLINK_PORT")),
            };
        }
        let of_share = |share, at| Shown { share, at, is_fleet: false };
        if let Some(share) = &self.share {
            return match lines.is_empty() {
                true => Ok(Some(of_share(Arc::new(Local(share::path(share)?)), share.clone()))),
                false => Err(Failure::usage("--share shows a share that has its ports")
                    .trying("leave -p out, and unset MOTORLINK_PORT")),
            };
        }
        let port = |name: &String| name.parse().ok().and_then(|port: PortName| place_of(&port));
        let places: Vec<_> = lines.ports.iter().map(port).collect();
        let Some((share, _)) = places.iter().flatten().next().cloned() else { return Ok(None) };
        if lines.ports.iter().any(|name| name.starts_with("zenoh:")) {
            return Err(Failure::usage("a node is shown with all its lines")
                .trying("give --fleet, with --node NAME for one of them, without -p"));
        }
        let is_same = |place: &Option<(Arc<dyn Address>, String)>| {
            place.as_ref().is_some_and(|(other, _)| other.port("") == share.port(""))
        };
        if !places.iter().all(is_same) || has_at {
            return Err(Failure::usage("a running share is shown alone")
                .trying("give --share unix:PATH without -p and --at"));
        }
        let path = share.port("");
        let path = path.trim_start_matches("share:").trim_end_matches('/');
        Ok(Some(of_share(share, format!("unix:{path}"))))
    }

    #[cfg(feature = "fleet")]
    fn nodes(&self) -> Shown {
        use motorlink_fleet::network::Network;
        use motorlink_fleet::whole::Whole;
        let network = self.via.clone().unwrap_or_else(Network::of_programs);
        let at = network.to_string();
        let share = Arc::new(Whole::new(network, self.nodes.iter().cloned().collect()));
        Shown { share, at, is_fleet: true }
    }
}
