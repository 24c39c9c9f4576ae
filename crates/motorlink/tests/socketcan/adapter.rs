//! A serial CAN adapter on a pty, which the kernel's own slcan driver makes an interface of. Unlike
//! the virtual cards it can be slow, deaf, and off the bus.

use std::ffi::OsStr;
use std::fs::{File, OpenOptions};
use std::io::{BufReader, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::process::Command;
use std::thread::JoinHandle;
use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::slcan::Device;
use motorlink::time::Instant;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use crate::peers::ip;

/// The adapter's interface is `slcan0` while this lives.
pub struct Adapter {
    line: File,
    /// While someone has it open, the driver stays attached.
    slave: Option<File>,
    thread: Option<JoinHandle<()>>,
}

impl Adapter {
    /// Attaches an adapter that takes nothing from the kernel.
    pub fn deaf() -> Self {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let line: OwnedFd = openpt(flags).expect("a pty");
        grantpt(&line).and_then(|()| unlockpt(&line)).expect("a pty");
        let name = ptsname(&line, Vec::new()).expect("a pty");
        let path = OsStr::from_bytes(name.as_bytes());
        let slave = OpenOptions::new().read(true).write(true).open(path).expect("the pty opens");
        let attach = Command::new("slcan_attach").args(["-n", "slcan0"]).arg(path).output();
        assert!(attach.as_ref().is_ok_and(|done| done.status.success()), "{attach:?}");
        ip("link set slcan0 up");
        Adapter { line: line.into(), slave: Some(slave), thread: None }
    }

    /// Attaches an adapter with a motor behind it that answers every request with the same frame,
    /// `pause` after having taken it.
    pub fn with_motors(pause: Duration) -> Self {
        let mut adapter = Self::deaf();
        let line = adapter.line.try_clone().expect("a descriptor");
        adapter.thread = Some(std::thread::spawn(move || answer(&line, pause)));
        adapter
    }

    /// Puts a request to each of motors 1 to 32 on the bus: status 1.
    pub fn ask_all(&self) {
        for id in 0x141..=0x160 {
            write!(&self.line, "t{id:03x}89a00000000000000\r").expect("the driver takes it");
        }
    }

    /// Takes `count` frames from the kernel, with a pause before each; gives their identifiers.
    /// The kernel sends as it is read, so that is byte by byte.
    pub fn take(&self, count: usize, pause: Duration) -> Vec<String> {
        let mut bytes = BufReader::with_capacity(1, &self.line).bytes();
        let mut frame = || -> Option<String> {
            std::thread::sleep(pause);
            let line = bytes.by_ref().map_while(Result::ok).take_while(|&byte| byte != b'\r');
            let line = String::from_utf8(line.collect()).ok()?;
            Some(line.get(1..4)?.to_owned())
        };
        (0..count).map(|_| frame().expect("a data frame")).collect()
    }

    /// Reports the state of the controller: `a` active, `p` passive, `b` bus-off.
    pub fn report(&self, state: char) {
        write!(&self.line, "s{state}128128\r").expect("the driver takes it");
    }
}

fn answer(mut line: &File, pause: Duration) {
    let mut device = Device::default();
    let mut said = Vec::new();
    for byte in *b"S8\rO\r" {
        device.receive(byte, |_| {});
    }
    let mut bytes = [0; 64];
    while let Ok(len @ 1..) = line.read(&mut bytes) {
        for &byte in &bytes[..len] {
            let answer = |answer: &[u8]| said.extend_from_slice(answer);
            let Some(frame) = device.receive(byte, answer) else { continue };
            std::thread::sleep(pause);
            let mut data = [0; 8];
            data.copy_from_slice(frame.data());
            data[1] = 25;
            let reply = CanFrame::new(frame.id() as u16, data);
            device.deliver(Instant(0), &reply, |line| said.extend_from_slice(line));
        }
        if line.write_all(&said).is_err() {
            return;
        }
        said.clear();
    }
}

impl Drop for Adapter {
    fn drop(&mut self) {
        // Without the far end's last descriptor the pty hangs up, and reading it ends.
        self.slave = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
