//! What a certificate says.

use std::time::{SystemTime, UNIX_EPOCH};

use time::OffsetDateTime;
use x509_parser::pem::Pem;

/// A certificate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Certificate {
    /// Whose it is.
    pub(crate) name: String,
    /// When it begins to hold and when it ends, in seconds since 1970.
    begins: i64,
    ends: i64,
}

impl Certificate {
    /// Reads the first certificate of a text in PEM.
    pub(crate) fn read(pem: &[u8]) -> Option<Self> {
        let pem = Pem::iter_from_buffer(pem).next()?.ok()?;
        let certificate = pem.parse_x509().ok()?;
        let name = certificate.subject().iter_common_name().next()?.as_str().ok()?.to_owned();
        let validity = certificate.validity();
        let (begins, ends) = (validity.not_before.timestamp(), validity.not_after.timestamp());
        Some(Certificate { name, begins, ends })
    }

    /// Why it does not hold now, by the clock of this computer.
    pub(crate) fn fault(&self) -> Option<String> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let now = i64::try_from(now.as_secs()).unwrap_or(i64::MAX);
        let name = &self.name;
        match () {
            () if now > self.ends => {
                Some(format!("the certificate of {name} has expired on {}", day(self.ends)))
            }
            () if now < self.begins => Some(format!(
                "the certificate of {name} holds from {} on, but the clock of this computer says {}",
                day(self.begins),
                day(now)
            )),
            () => None,
        }
    }

    /// The last day on which it holds.
    pub(crate) fn last_day(&self) -> String {
        day(self.ends)
    }
}

/// The day of a time, such as 2027-11-27.
fn day(seconds: i64) -> String {
    OffsetDateTime::from_unix_timestamp(seconds)
        .map_or_else(|_| "?".to_owned(), |it| it.date().to_string())
}
