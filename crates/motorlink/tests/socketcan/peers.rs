//! What is on the bus besides the host under test.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use socketcan::{CanErrorFrame, CanFrame, CanSocket, Socket, SocketOptions};

/// Waits until something is so; longer than anything here takes.
pub fn until(what: &str, mut reached: impl FnMut() -> bool) {
    let give_up = Instant::now() + Duration::from_secs(20);
    while !reached() {
        assert!(Instant::now() < give_up, "{what}");
        std::thread::yield_now();
    }
}

/// Runs `ip` of iproute2; busybox has one that knows no CAN.
pub fn ip(arguments: &str) {
    let done = Command::new("/sbin/ip").args(arguments.split_whitespace()).output().expect("ip");
    assert!(done.status.success(), "ip {arguments}: {}", String::from_utf8_lossy(&done.stderr));
}

/// Another program on the interface, which hears what it sends itself as well.
pub fn neighbour(interface: &str) -> CanSocket {
    let socket = CanSocket::open(interface).expect("the interface is there");
    socket.set_recv_own_msgs(true).expect("an option of the kernel");
    socket.set_read_timeout(Duration::from_secs(5)).expect("an option of the kernel");
    socket
}

/// Sends an error frame as a controller's driver would hand it up.
pub fn report_error(interface: &str, class: u32, data: [u8; 8]) {
    let frame = CanErrorFrame::new_error(class, &data).expect("eight bytes");
    neighbour(interface).write_frame(&CanFrame::Error(frame)).expect("the kernel takes it");
}

/// Sends frames again and again until it is dropped.
pub struct Flood {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Flood {
    pub fn on(interface: &str, frames: Vec<CanFrame>) -> Self {
        let socket = CanSocket::open(interface).expect("the interface is there");
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            for frame in frames.iter().cycle() {
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                // A full queue is part of a flood.
                let _ = socket.write_frame(frame);
            }
        });
        Flood { stop, thread: Some(thread) }
    }
}

impl Drop for Flood {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
