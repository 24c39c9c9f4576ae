//! The port `zenoh:`: a line of a node.

use std::sync::Arc;

use motorlink_link::port::{self, Carries, Form, Given, NameError, PortName, Scheme};
use motorlink_telemetry::share::port::{deadline_of, line_port};

use crate::key::BadName;
use crate::network::Network;
use crate::remote::{self, DEADLINE, Remote};

/// Registers the port `zenoh:` in this process.
pub fn register() {
    port::register(&Zenoh);
}

/// `zenoh:NODE/LINE`.
struct Zenoh;

const EXAMPLE: &str = "zenoh:arm1/st0";

impl Scheme for Zenoh {
    fn name(&self) -> &'static str {
        "zenoh"
    }

    fn forms(&self) -> &'static [Form] {
        &[Form {
            text: "zenoh:NODE/LINE",
            help: "a line of a running `motorlink node`",
            carries: Carries::Both,
        }]
    }

    fn options(&self) -> &'static [&'static str] {
        &["via", "as", "deadline", "motion", "take", "raw"]
    }

    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError> {
        let (node, line) = rest.split_once('/').unwrap_or((rest, ""));
        given.present(node, "the name of the node", EXAMPLE)?;
        let what = BadName.to_string();
        let bad_node = |_| given.bad_option("the node", node, what.clone());
        let node = node.parse().map_err(bad_node)?;
        let network = match given.take("via") {
            Some(text) => text.parse().map_err(|_| {
                let what = "an address such as tcp/10.0.0.5:7447, or a file that ends with .json5";
                given.bad_option("via", text, what.to_owned())
            })?,
            None => Network::of_programs(),
        };
        let who = match given.take("as") {
            Some(text) => text.parse().map_err(|_| given.bad_option("as", text, what.clone()))?,
            None => remote::own_name(&network),
        };
        let deadline = deadline_of(given, "deadline")?.unwrap_or(DEADLINE);
        let motion = deadline_of(given, "motion")?;
        let takes = flag(given, "take")?;
        if flag(given, "raw")? {
            let what = "the port without it: there are no raw bytes of a node yet".to_owned();
            return Err(given.bad_option("raw", "set", what));
        }
        let remote = Remote { who, deadline, motion, takes, ..Remote::new(node, network) };
        line_port(Arc::new(remote), line).ok_or_else(|| NameError::Incomplete {
            name: given.name.to_owned(),
            what: "the line behind the node: st0, st1, .. or rmd0, rmd1, ..",
            example: EXAMPLE,
        })
    }
}

/// Whether an option without a value was given.
fn flag(given: &mut Given<'_>, option: &'static str) -> Result<bool, NameError> {
    match given.take(option) {
        None => Ok(false),
        Some("") => Ok(true),
        Some(text) => Err(given.bad_option(option, text, "it without a value".to_owned())),
    }
}
