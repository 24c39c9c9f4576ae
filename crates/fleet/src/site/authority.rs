//! The certificates of a site, and the authority that signs them.

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

/// How long the authority holds.
const DAYS: u32 = 20 * 365;
/// The name of the authority.
const NAME: &str = "Motorlink site";

/// A certificate and its key, in PEM.
pub(super) struct Pair {
    pub(super) certificate: String,
    pub(super) key: String,
}

/// Signs the certificates of a site.
pub(super) struct Authority {
    pub(super) certificate: String,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    /// A new one.
    pub(super) fn generate() -> Result<Pair, rcgen::Error> {
        let key = KeyPair::generate()?;
        let mut certificate = params(NAME, Vec::new(), DAYS)?;
        certificate.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
        certificate.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        let certificate = certificate.self_signed(&key)?.pem();
        Ok(Pair { certificate, key: key.serialize_pem() })
    }

    /// The one with this certificate and key.
    pub(super) fn of(pair: Pair) -> Result<Self, rcgen::Error> {
        let issuer = Issuer::new(params(NAME, Vec::new(), DAYS)?, KeyPair::from_pem(&pair.key)?);
        Ok(Authority { certificate: pair.certificate, issuer })
    }

    /// A certificate for a router that is reached by these names and IP addresses.
    pub(super) fn for_router(
        &self,
        name: &str,
        hosts: Vec<String>,
        days: u32,
    ) -> Result<Pair, rcgen::Error> {
        self.sign(params(name, hosts, days)?, ExtendedKeyUsagePurpose::ServerAuth)
    }

    /// A certificate for what connects to the router.
    pub(super) fn for_member(&self, name: &str, days: u32) -> Result<Pair, rcgen::Error> {
        self.sign(params(name, Vec::new(), days)?, ExtendedKeyUsagePurpose::ClientAuth)
    }

    fn sign(
        &self,
        mut certificate: CertificateParams,
        usage: ExtendedKeyUsagePurpose,
    ) -> Result<Pair, rcgen::Error> {
        let key = KeyPair::generate()?;
        certificate.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        certificate.extended_key_usages = vec![usage];
        certificate.use_authority_key_identifier_extension = true;
        let certificate = certificate.signed_by(&key, &self.issuer)?.pem();
        Ok(Pair { certificate, key: key.serialize_pem() })
    }
}

fn params(name: &str, hosts: Vec<String>, days: u32) -> Result<CertificateParams, rcgen::Error> {
    let mut params = CertificateParams::new(hosts)?;
    params.distinguished_name.push(DnType::CommonName, name);
    let now = OffsetDateTime::now_utc();
    // Clocks differ.
    params.not_before = now - Duration::days(1);
    params.not_after = now + Duration::days(days.into());
    Ok(params)
}
