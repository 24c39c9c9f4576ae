//! What ports a machine has, and what could be wrong with them.

use std::fs;
use std::path::{Path, PathBuf};

use rustix::fs::{Access, access};

use crate::port::{Interface, owning_group, permission_hint, up_hint};
use crate::text::printable;

/// The kernel's hardware type of CAN interfaces.
const ARPHRD_CAN: &str = "280";
/// From a tty up to its USB device there are at most this many directories.
const USB_DEPTH: usize = 4;

/// A port that this machine has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortInfo {
    /// The port's name, as every command takes it.
    pub name: String,
    /// What kind of port it is.
    pub kind: PortKind,
    /// Manufacturer and product, or the kernel driver.
    pub description: Option<String>,
    /// A second path that stays the same when devices are plugged in in another order.
    pub stable_path: Option<PathBuf>,
    /// Why it cannot be used at once, and what to do.
    pub problem: Option<String>,
}

/// Kinds of ports that a machine has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PortKind {
    /// A serial device.
    Serial,
    /// A CAN interface.
    Can,
}

/// The serial devices and CAN interfaces of this machine, by name. No port is opened: that would
/// reset some boards.
pub fn ports() -> Vec<PortInfo> {
    ports_below(Path::new("/"))
}

fn ports_below(root: &Path) -> Vec<PortInfo> {
    let ttys = names_in(&root.join("sys/class/tty"));
    let interfaces = names_in(&root.join("sys/class/net"));
    let serial = ttys.iter().filter_map(|name| serial_port(root, name));
    let can = interfaces.iter().filter_map(|name| can_port(root, name));
    serial.chain(can).collect()
}

fn serial_port(root: &Path, name: &str) -> Option<PortInfo> {
    let class = root.join("sys/class/tty").join(name);
    let device = class.join("device");
    // A console has no device; the kernel's spare UARTs have type 0.
    if !device.exists() || read(&class.join("type")).as_deref() == Some("0") {
        return None;
    }
    let path = root.join("dev").join(name);
    let problem = match access(&path, Access::READ_OK | Access::WRITE_OK) {
        Ok(()) => None,
        Err(rustix::io::Errno::NOENT) => Some("the device has no node in /dev".to_owned()),
        Err(_) => {
            let group = owning_group(&path, root);
            Some(format!("no permission: {}", permission_hint(group.as_deref())))
        }
    };
    Some(PortInfo {
        name: format!("/dev/{name}"),
        kind: PortKind::Serial,
        description: usb_strings(&device).or_else(|| driver(&device)),
        stable_path: stable_path(root, name),
        problem,
    })
}

fn can_port(root: &Path, name: &str) -> Option<PortInfo> {
    let class = root.join("sys/class/net").join(name);
    if read(&class.join("type"))? != ARPHRD_CAN {
        return None;
    }
    let sys = root.join("sys");
    let interface = Interface::read(name, &sys)?;
    let problem = match interface {
        Interface { is_up: false, .. } => Some(format!("down: {}", up_hint(name, &sys))),
        Interface { is_bus_off: true, .. } => Some(format!(
            "bus-off: check wiring, termination and bitrate, then \
             sudo ip link set {name} down && sudo ip link set {name} up"
        )),
        _ => None,
    };
    let device = class.join("device");
    let soft = (!interface.needs_bitrate).then(|| "virtual or serial CAN".to_owned());
    Some(PortInfo {
        name: format!("socketcan:{name}"),
        kind: PortKind::Can,
        description: usb_strings(&device).or_else(|| driver(&device)).or(soft),
        stable_path: None,
        problem,
    })
}

/// Manufacturer and product of the USB device that `device` is a part of.
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

fn stable_path(root: &Path, name: &str) -> Option<PathBuf> {
    let links = root.join("dev/serial/by-id");
    let points_here =
        |link: &String| fs::read_link(links.join(link)).is_ok_and(|target| target.ends_with(name));
    let link = names_in(&links).into_iter().find(points_here)?;
    Some(Path::new("/dev/serial/by-id").join(link))
}

/// The names in a directory, sorted; none when there is no such directory.
fn names_in(directory: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(directory)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}

fn read(file: &Path) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    Some(printable(text.trim())).filter(|text| !text.is_empty())
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::os::unix::fs::symlink;

    use super::*;

    /// A file tree that looks like a machine's.
    struct Machine(PathBuf);

    impl Machine {
        fn new() -> io::Result<Self> {
            let root = std::env::temp_dir().join(format!("motorlink-list-{}", std::process::id()));
            fs::create_dir_all(&root)?;
            Ok(Machine(root))
        }

        fn file(&self, path: &str, text: &str) -> io::Result<()> {
            let path = self.0.join(path);
            fs::create_dir_all(path.parent().unwrap_or(&self.0))?;
            fs::write(path, text)
        }
    }

    impl Drop for Machine {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_machine_lists_what_it_has_and_what_is_wrong() -> io::Result<()> {
        let machine = Machine::new()?;
        let usb = "sys/devices/usb1/1-1";
        machine.file(&format!("{usb}/idVendor"), "0483\n")?;
        machine.file(&format!("{usb}/manufacturer"), "STMicroelectronics\n")?;
        machine.file(&format!("{usb}/product"), "STM32 \x1B[2JSTLink\n")?;
        machine.file(&format!("{usb}/1-1:1.2/driver"), "")?;
        machine.file("sys/class/tty/ttyACM0/dev", "166:0")?;
        machine.file("sys/class/tty/tty0/dev", "4:0")?;
        machine.file("sys/class/tty/ttyS1/type", "0\n")?;
        machine.file("sys/class/tty/ttyS1/device/dev", "")?;
        machine.file("dev/ttyACM0", "")?;
        machine.file("dev/serial/by-id/other", "")?;
        symlink(
            machine.0.join(usb).join("1-1:1.2"),
            machine.0.join("sys/class/tty/ttyACM0/device"),
        )?;
        symlink("../../ttyACM0", machine.0.join("dev/serial/by-id/usb-STLink"))?;
        machine.file("sys/class/net/eth0/type", "1\n")?;
        for (name, flags, carrier) in [
            ("can0", "0x40080", ""),
            ("can1", "0x40081", "0"),
            ("can2", "0x80", ""),
            ("vcan0", "0x81", "1"),
        ] {
            machine.file(&format!("sys/class/net/{name}/type"), "280\n")?;
            machine.file(&format!("sys/class/net/{name}/flags"), flags)?;
            machine.file(&format!("sys/class/net/{name}/carrier"), carrier)?;
        }

        let found = ports_below(&machine.0);
        let names: Vec<_> = found.iter().map(|port| port.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "/dev/ttyACM0",
                "socketcan:can0",
                "socketcan:can1",
                "socketcan:can2",
                "socketcan:vcan0"
            ]
        );
        let [acm, down, bus_off, virtual_down, fine] = found.as_slice() else {
            unreachable!("five")
        };
        assert_eq!(acm.description.as_deref(), Some("STMicroelectronics STM32 \u{FFFD}[2JSTLink"));
        assert_eq!(acm.stable_path.as_deref(), Some(Path::new("/dev/serial/by-id/usb-STLink")));
        assert_eq!(acm.problem, None);
        let problem = |port: &PortInfo| port.problem.clone().unwrap_or_default();
        assert!(problem(down).starts_with("down: sudo ip link set can0 up type can"));
        assert!(problem(bus_off).starts_with("bus-off"));
        assert_eq!(problem(virtual_down), "down: sudo ip link set can2 up");
        assert_eq!(
            (problem(fine), fine.description.as_deref()),
            (String::new(), Some("virtual or serial CAN"))
        );
        Ok(())
    }
}
