//! What the kernel says about a CAN interface.

use std::fs;
use std::path::Path;

/// The interface flag of one that is up.
const UP: u32 = 0x1;
/// The interface flag of one whose driver hands sent frames back once they were on the bus. Virtual
/// interfaces and serial adapters (slcan) do not.
const ECHO: u32 = 0x40000;

/// The state of a CAN interface.
pub(crate) struct Interface {
    pub(crate) is_up: bool,
    /// It cannot be brought up without a bitrate. A virtual one has none, and that of a serial
    /// adapter is set by who attaches it.
    pub(crate) needs_bitrate: bool,
    /// The controller left the bus after too many errors.
    pub(crate) is_bus_off: bool,
}

impl Interface {
    /// Reads it from the kernel's file system at `sys`; nothing when there is no such interface.
    pub(crate) fn read(name: &str, sys: &Path) -> Option<Self> {
        let class = sys.join("class/net").join(name);
        let flags = fs::read_to_string(class.join("flags")).ok()?;
        let flags = u32::from_str_radix(flags.trim().strip_prefix("0x")?, 16).ok()?;
        // Cannot be read while the interface is down.
        let carrier = fs::read_to_string(class.join("carrier")).unwrap_or_default();
        Some(Interface {
            is_up: flags & UP != 0,
            needs_bitrate: flags & ECHO != 0,
            is_bus_off: carrier.trim() == "0",
        })
    }
}

/// How a CAN interface is brought up.
pub(crate) fn up_hint(name: &str, sys: &Path) -> String {
    match Interface::read(name, sys) {
        Some(Interface { needs_bitrate: false, .. }) => format!("sudo ip link set {name} up"),
        _ => format!("sudo ip link set {name} up type can bitrate 1000000"),
    }
}
