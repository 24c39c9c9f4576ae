//! The computer that this program runs on.

use std::collections::BTreeSet;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::key::Name;

/// The name of this computer.
pub fn name() -> Name {
    Name::near(&rustix::system::uname().nodename().to_string_lossy())
}

/// A number that this computer keeps, and that a copy of its disk in another computer does not have: the
/// addresses of network cards differ.
pub(crate) fn fingerprint() -> u32 {
    let read = |path: String| fs::read_to_string(path).ok();
    let cards = fs::read_dir("/sys/class/net").into_iter().flatten().flatten();
    let cards = cards.map(|card| card.path()).filter(|card| card.join("device").exists());
    let addresses: BTreeSet<_> =
        cards.filter_map(|card| read(format!("{}/address", card.display()))).collect();
    let mut hasher = DefaultHasher::new();
    (read("/etc/machine-id".to_owned()), name().as_str(), addresses).hash(&mut hasher);
    hasher.finish() as u32
}
