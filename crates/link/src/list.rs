//! The ports of this machine, and their problems.

use std::path::Path;

use crate::port::schemes;

pub use crate::port::PortInfo;

/// The ports of this machine that a scheme can find, sorted by name. No port is opened, because
/// that would reset some boards.
pub fn ports() -> Vec<PortInfo> {
    ports_below(Path::new("/"))
}

fn ports_below(root: &Path) -> Vec<PortInfo> {
    schemes().iter().flat_map(|scheme| scheme.list(root)).collect()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;
    use std::path::PathBuf;
    use std::{fs, io};

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
