//! A thread that sleeps until it is woken, as an engine does, and does nothing else.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use motorlink_kernels::result::Result;

/// The thread. It ends when this is dropped.
pub(super) struct Sleeper {
    wake: UnixStream,
    awake: Receiver<Instant>,
}

impl Sleeper {
    pub(super) fn start() -> Result<Self> {
        let (wake, mut woken) = UnixStream::pair()?;
        let (sender, awake) = mpsc::channel();
        thread::spawn(move || {
            while matches!(woken.read(&mut [0]), Ok(1)) && sender.send(Instant::now()).is_ok() {}
        });
        Ok(Sleeper { wake, awake })
    }

    /// How long it takes to wake it.
    pub(super) fn woken(&mut self) -> Result<Duration> {
        let called = Instant::now();
        self.wake.write_all(&[0])?;
        Ok(self.awake.recv()?.duration_since(called))
    }
}
