//! Servers in threads, and their stations.

use std::error::Error;
use std::fs;
use std::io::Write;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::JoinHandle;
use std::time::Duration;

use motorlink_link::port::PortError;
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Served, Server, Station};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// Returns each chunk.
pub(crate) struct Echo;

impl Station<u8> for Echo {
    fn receive(&mut self, _: Instant, bytes: &[u8], reply: &mut Vec<u8>) {
        reply.extend_from_slice(bytes);
    }
}

/// Sends a byte one millisecond after each chunk.
#[derive(Default)]
pub(crate) struct Late(Option<Instant>);

impl Station<u8> for Late {
    fn receive(&mut self, now: Instant, _: &[u8], _: &mut Vec<u8>) {
        self.0 = Some(Instant(now.0 + 1_000));
    }
    fn poll(&mut self, _: Instant, reply: &mut Vec<u8>) {
        self.0 = None;
        reply.push(0x55);
    }
    fn deadline(&self) -> Option<Instant> {
        self.0
    }
}

/// A motor that answers its frames with one byte changed.
pub(crate) struct Motor;

impl Station<CanFrame> for Motor {
    fn receive(&mut self, _: Instant, received: &[CanFrame], replies: &mut Vec<CanFrame>) {
        replies.extend(received.iter().filter(|frame| frame.id() == 0x141).map(reply_of));
    }
}

pub(crate) fn reply_of(frame: &CanFrame) -> CanFrame {
    let mut data = [0; 8];
    data.copy_from_slice(frame.data());
    data[7] ^= 0xFF;
    CanFrame::new(0x141, data)
}

pub(crate) fn request(number: u8) -> CanFrame {
    CanFrame::new(0x141, [0x9C, number, 0, 0, 0, 0, 0, 0])
}

/// A server in its own thread. Dropping this ends it.
pub(crate) struct Running {
    pub(crate) served: Served,
    stop: Arc<AtomicBool>,
    wake: UnixStream,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    pub(crate) fn start(
        serve: impl FnOnce(&mut Server) -> Result<Served, PortError> + Send + 'static,
    ) -> Result<Self, Box<dyn Error>> {
        let (wake, woken) = UnixStream::pair()?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let (tell, told) = mpsc::channel();
        let thread = std::thread::spawn(move || {
            let mut server = Server::new();
            let served = serve(&mut server);
            let is_served = served.is_ok();
            tell.send(served).expect("the test waits for it");
            while is_served && !stopped.load(Ordering::Relaxed) {
                server.turn(Duration::from_secs(5), Some(woken.as_fd())).expect("a turn");
            }
        });
        Ok(Running { served: told.recv()??, stop, wake, thread: Some(thread) })
    }

    pub(crate) fn bytes(name: &str) -> Result<Self, Box<dyn Error>> {
        let name: ServeName = name.parse()?;
        Self::start(move |server| server.serve_bytes(&name, Box::new(Echo)))
    }

    pub(crate) fn can(name: &str) -> Result<Self, Box<dyn Error>> {
        let name: ServeName = name.parse()?;
        Self::start(move |server| server.serve_can(&name, Box::new(Motor)))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.wake.write_all(b"x");
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A path for one test, removed at the end.
pub(crate) struct Place(pub(crate) PathBuf);

impl Place {
    pub(crate) fn new(name: &str) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let unique = format!("motorlink-{name}-{}-{number}", std::process::id());
        Place(std::env::temp_dir().join(unique))
    }

    pub(crate) fn as_port(&self, scheme: &str) -> String {
        format!("{scheme}:{}", self.0.display())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}
