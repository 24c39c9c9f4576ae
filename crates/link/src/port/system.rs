//! The kernel's data on devices.

use std::fs;
use std::path::Path;

use crate::text::printable;

/// Maximum number of directories from a tty up to its USB device.
const USB_DEPTH: usize = 4;

/// Manufacturer and product of a device, or its driver.
pub(super) fn description(device: &Path) -> Option<String> {
    usb_strings(device).or_else(|| driver(device))
}

/// Manufacturer and product of the USB device that contains `device`.
fn usb_strings(device: &Path) -> Option<String> {
    let device = device.canonicalize().ok()?;
    let usb = device.ancestors().take(USB_DEPTH).find(|dir| dir.join("idVendor").exists())?;
    let strings: Vec<_> =
        ["manufacturer", "product"].iter().filter_map(|name| read(&usb.join(name))).collect();
    if strings.is_empty() {
        let (vendor, product) = (read(&usb.join("idVendor"))?, read(&usb.join("idProduct"))?);
        return Some(format!("USB {vendor}:{product}"));
    }
    Some(strings.join(" "))
}

fn driver(device: &Path) -> Option<String> {
    let driver = device.join("driver").canonicalize().ok()?;
    Some(driver.file_name()?.to_string_lossy().into_owned())
}

/// The sorted names in a directory; empty if there is no such directory.
pub(super) fn names_in(directory: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(directory)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}

/// The text of a file, safe for a terminal; `None` if there is none.
pub(super) fn read(file: &Path) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    Some(printable(text.trim())).filter(|text| !text.is_empty())
}
