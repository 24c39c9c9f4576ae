//! A network with a router: certificates for all, and who may do what.
//!
//! Each member has one file: a Zenoh configuration with its certificate and its key. It holds wherever it
//! is copied to. The router's file has the access control. The folders of a site say who is a member:
//!
//! ```text
//! ca/ca.pem, ca/ca.key      the authority that signs certificates
//! router.json5              the router
//! nodes/arm1.json5          a node
//! operators/alice.json5     may do everything
//! viewers/bob.json5         may see
//! ```

mod access;
mod authority;
mod error;
mod folder;
mod role;
mod router_address;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::json;

use crate::certificate_info::Certificate;
use crate::key::Name;
use crate::zenoh_file::ConfigFile;
use authority::{Authority, Pair};
pub use error::SiteError;
pub use role::Role;
pub use router_address::{BadAddress, RouterAddress};

/// The name of the router in its certificate.
const ROUTER: &str = "router";
/// Where the router's file says how it is reached.
const REACHED_AT: &str = "metadata/reached_at";
/// Where the file of a member says its role.
pub(crate) const ROLE: &str = "metadata/role";

/// What a site shall have.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Its folder.
    pub folder: PathBuf,
    /// Where the router is reached. Empty: as before.
    pub router: Vec<RouterAddress>,
    /// Members, besides those that it has.
    pub members: Vec<(Role, Name)>,
    /// How long new certificates hold.
    pub days: u32,
}

/// A site.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Site {
    /// The router's file.
    pub router: PathBuf,
    /// Where it is reached.
    pub addresses: Vec<String>,
    /// The last day of its certificate.
    pub until: String,
    /// All members, by name.
    pub members: BTreeMap<Name, Member>,
}

/// A member of a site.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// What it may do.
    pub role: Role,
    /// Its file.
    pub file: PathBuf,
    /// Whether it is new.
    pub is_new: bool,
    /// The last day of its certificate, such as 2027-11-27.
    pub until: String,
}

/// Writes what a site does not have yet, and the rights of all members. Certificates and keys that are
/// there stay.
///
/// # Errors
/// A name has two roles, the router has no address, a file cannot be read or written.
pub fn init(plan: &Plan) -> Result<Site, SiteError> {
    let site = &plan.folder;
    if plan.router.is_empty() && !site.exists() {
        return Err(SiteError::NoRouter(site.clone()));
    }
    folder::create(site)?;
    let _lock = folder::lock(site)?;
    let mut known = BTreeMap::new();
    for role in Role::ALL {
        for (name, certificate) in folder::members(&role.folder(site))? {
            admit(&mut known, name, role, Some(certificate))?;
        }
    }
    for (role, name) in &plan.members {
        admit(&mut known, name.clone(), *role, None)?;
    }
    let file = site.join("router.json5");
    let wanted: Vec<_> = plan.router.iter().map(RouterAddress::connected).collect();
    let router = folder::read(&file)?;
    let addresses = match &router {
        Some(router) => router.texts(REACHED_AT),
        None if wanted.is_empty() => return Err(SiteError::NoRouter(site.clone())),
        None => wanted.clone(),
    };
    if !wanted.is_empty() && wanted != addresses {
        return Err(SiteError::OtherRouter(addresses.join(", ")));
    }
    let mut signer = Signer { site, days: plan.days, authority: None };
    let mut router = match router {
        Some(router) => router,
        None => signer.router(&plan.router)?,
    };
    let mut members = BTreeMap::new();
    for (name, (role, certificate)) in known {
        let folder = role.folder(site);
        let file = folder.join(format!("{name}.json5"));
        let is_new = certificate.is_none();
        let until = match certificate {
            Some(certificate) => certificate.last_day(),
            None => {
                folder::create(&folder)?;
                let config = signer.member(role, &name, &addresses)?;
                let comment = format!("// The key of {name} is in this file: keep its mode, 0600.");
                folder::write(&file, &format!("{comment}\n{config}\n"))?;
                last_day(&config)
            }
        };
        members.insert(name, Member { role, file, is_new, until });
    }
    let roles = members.iter().map(|(name, member)| (name.clone(), member.role)).collect();
    router.set("access_control", access::control(&roles));
    let comment = "// The key of the router is in this file: keep its mode, 0600. `motorlink fleet init` \
        writes access_control anew.";
    folder::write(&file, &format!("{comment}\n{router}\n"))?;
    Ok(Site { router: file, addresses, until: last_day(&router), members })
}

fn last_day(config: &ConfigFile) -> String {
    config.certificate().map(|it| it.last_day()).unwrap_or_default()
}

/// Members by name. Without a certificate they are new.
type Known = BTreeMap<Name, (Role, Option<Certificate>)>;

fn admit(
    known: &mut Known,
    name: Name,
    wanted: Role,
    certificate: Option<Certificate>,
) -> Result<(), SiteError> {
    match known.get(&name) {
        _ if name.as_str() == ROUTER => Err(SiteError::NameOfRouter),
        Some((has, _)) if *has != wanted => Err(SiteError::TwoRoles { name, has: *has, wanted }),
        Some(_) => Ok(()),
        None => {
            known.insert(name, (wanted, certificate));
            Ok(())
        }
    }
}

/// Makes files with certificates.
struct Signer<'a> {
    site: &'a Path,
    days: u32,
    /// It is read when it is needed: its key may be elsewhere otherwise.
    authority: Option<Authority>,
}

impl Signer<'_> {
    fn authority(&mut self) -> Result<&Authority, SiteError> {
        let authority = match self.authority.take() {
            Some(authority) => authority,
            None => Authority::of(folder::authority(&self.site.join("ca"))?)?,
        };
        Ok(self.authority.insert(authority))
    }

    fn router(&mut self, places: &[RouterAddress]) -> Result<ConfigFile, SiteError> {
        let days = self.days;
        let authority = self.authority()?;
        let hosts = places.iter().map(|it| it.host.clone()).collect();
        let pair = authority.for_router(ROUTER, hosts, days)?;
        let listen = RouterAddress::listened(places);
        let mut config = ConfigFile::new("router", "listen", &listen);
        set_tls(&mut config, "listen", authority, &pair);
        let reached_at: Vec<_> = places.iter().map(RouterAddress::connected).collect();
        config.set(REACHED_AT, json!(reached_at));
        Ok(config)
    }

    fn member(
        &mut self,
        role: Role,
        name: &Name,
        addresses: &[String],
    ) -> Result<ConfigFile, SiteError> {
        let days = self.days;
        let authority = self.authority()?;
        let pair = authority.for_member(name.as_str(), days)?;
        let mut config = ConfigFile::new("client", "connect", addresses);
        config.set(ROLE, json!(role.word()));
        set_tls(&mut config, "connect", authority, &pair);
        Ok(config)
    }
}

fn set_tls(config: &mut ConfigFile, side: &str, authority: &Authority, pair: &Pair) {
    let base64 = |pem: &str| BASE64_STANDARD.encode(pem);
    let tls = json!({
        "root_ca_certificate_base64": base64(&authority.certificate),
        format!("{side}_certificate_base64"): base64(&pair.certificate),
        format!("{side}_private_key_base64"): base64(&pair.key),
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
    });
    config.set("transport/link/tls", tls);
}
