//! `motorlink fleet init`

use std::path::{Path, PathBuf};

use motorlink_fleet::key::Name;
use motorlink_fleet::site::{self, Member, Plan, Role, RouterAddress, Site, SiteError};
use serde_json::json;

use crate::failure::Failure;
use crate::output::print_line;
use crate::pasteable::quoted;

#[derive(clap::Args)]
#[command(after_help = "\
Each node, operator and viewer gets one file: a Zenoh configuration with its certificate and its key. Copy \
it to the computer of its owner, and nowhere else. The name in the certificate is who it is.

Run it again with more names to add them. Certificates and keys that are there stay. Remove a file and run \
it again to withdraw what it allows. Then copy router.json5 to the router, and start the router again.

DIR has the keys of all: keep it where only you can read it.")]
pub struct Args {
    /// The folder of the site
    #[arg(value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    folder: PathBuf,
    /// Where the router is reached; may be repeated. Needed the first time
    #[arg(long, value_name = "HOST[:PORT]")]
    router: Vec<RouterAddress>,
    /// A computer with drives; may be repeated
    #[arg(long = "node", value_name = "NAME")]
    nodes: Vec<Name>,
    /// Who may see, stop and command motors; may be repeated
    #[arg(long = "operator", value_name = "NAME")]
    operators: Vec<Name>,
    /// Who may see values and events; may be repeated
    #[arg(long = "viewer", value_name = "NAME")]
    viewers: Vec<Name>,
    /// How many days new certificates hold
    #[arg(long, value_name = "N", default_value_t = 365,
        value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<(), Failure> {
    let Args { folder, router, nodes, operators, viewers, days, json } = args;
    let of = |role, names: Vec<Name>| names.into_iter().map(move |name| (role, name));
    let members = of(Role::Node, nodes)
        .chain(of(Role::Operator, operators))
        .chain(of(Role::Viewer, viewers))
        .collect();
    let site = site::init(&Plan { folder, router, members, days })?;
    if json {
        return print_line(&object(&site));
    }
    let addresses = site.addresses.join(", ");
    print_line(&format!("{}  router at {addresses}, until {}", shown(&site.router), site.until))?;
    for (name, Member { role, file, is_new, until }) in &site.members {
        let new = if *is_new { "new, " } else { "" };
        print_line(&format!("{}  {} {name}, {new}until {until}", shown(file), role.word()))?;
    }
    next(&site)
}

/// Says which commands use the files.
fn next(site: &Site) -> Result<(), Failure> {
    let first = |wanted: Role| {
        let member = site.members.values().find(|it| it.role == wanted);
        member.map(|it| shown(&it.file))
    };
    print_line(&"")?;
    print_line(&format!("motorlink fleet router --network {}", shown(&site.router)))?;
    if let Some(file) = first(Role::Node) {
        print_line(&format!("motorlink node -p sim: --network {file}"))?;
    }
    if let Some(file) = first(Role::Operator).or_else(|| first(Role::Viewer)) {
        print_line(&format!("motorlink fleet list --via {file}"))?;
    }
    Ok(())
}

fn object(site: &Site) -> serde_json::Value {
    let members = site.members.iter().map(|(name, member)| {
        json!({
            "name": name.as_str(), "role": member.role.word(), "file": member.file,
            "new": member.is_new, "until": member.until,
        })
    });
    json!({
        "site": site.router.parent(), "router": site.router, "addresses": site.addresses,
        "until": site.until, "members": members.collect::<Vec<_>>(),
    })
}

fn shown(path: &Path) -> String {
    quoted(&path.display().to_string())
}

impl From<SiteError> for Failure {
    fn from(error: SiteError) -> Self {
        let failure = Failure::usage(error.to_string());
        match error {
            SiteError::NoRouter(_) => failure.trying("give --router HOST[:PORT]"),
            SiteError::OtherRouter(_) => failure.trying("leave --router out, or name a new folder"),
            _ => failure,
        }
    }
}
