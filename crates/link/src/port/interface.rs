//! The kernel's data on a CAN interface.

use std::fs;
use std::path::Path;

/// The interface flag for an interface that is up.
const UP: u32 = 0x1;
/// The interface flag for a driver that returns sent frames after they were on the bus. Virtual
/// interfaces and serial adapters (slcan) do not have it.
const ECHO: u32 = 0x40000;

/// The state of a CAN interface.
pub(crate) struct Interface {
    pub(crate) is_up: bool,
    /// Whether it needs a bitrate to be brought up. A virtual interface has none; for a serial
    /// adapter the program that attaches it sets the bitrate.
    pub(crate) needs_bitrate: bool,
    /// The controller left the bus after too many errors.
    pub(crate) is_bus_off: bool,
}

impl Interface {
    /// Reads the state from the kernel's file system at `sys`; `None` if there is no such
    /// interface.
    pub(crate) fn read(name: &str, sys: &Path) -> Option<Self> {
        let class = sys.join("class/net").join(name);
        let flags = fs::read_to_string(class.join("flags")).ok()?;
        let flags = u32::from_str_radix(flags.trim().strip_prefix("0x")?, 16).ok()?;
        // This file cannot be read while the interface is down.
        let carrier = fs::read_to_string(class.join("carrier")).unwrap_or_default();
        Some(Interface {
            is_up: flags & UP != 0,
            needs_bitrate: flags & ECHO != 0,
            is_bus_off: carrier.trim() == "0",
        })
    }
}

/// How to bring up a CAN interface.
pub(crate) fn up_hint(name: &str, sys: &Path) -> String {
    match Interface::read(name, sys) {
        Some(Interface { needs_bitrate: false, .. }) => format!("sudo ip link set {name} up"),
        _ => format!("sudo ip link set {name} up type can bitrate 1000000"),
    }
}
