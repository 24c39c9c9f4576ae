//! A wire on which a test is the drive.
#![allow(dead_code, reason = "no test needs all of it")]

use std::collections::VecDeque;
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Evented, FdLink, Link, PortError};

/// What a drive was sent, and what it will say.
#[derive(Clone)]
pub struct Wire<T>(Arc<Mutex<Ends<T>>>);

struct Ends<T> {
    sent: Vec<T>,
    said: VecDeque<T>,
    /// What is said when what was sent ends so, once.
    reply: Option<(Vec<T>, Vec<T>)>,
}

impl<T: Clone + PartialEq> Wire<T> {
    pub fn new() -> Self {
        Wire(Arc::new(Mutex::new(Ends { sent: Vec::new(), said: VecDeque::new(), reply: None })))
    }

    pub fn sent(&self) -> Vec<T> {
        self.0.lock().unwrap().sent.clone()
    }

    pub fn say(&self, said: impl IntoIterator<Item = T>) {
        self.0.lock().unwrap().said.extend(said);
    }

    /// Says `reply` when what was sent ends in `request`, once.
    pub fn say_to(&self, request: &[T], reply: &[T]) {
        self.0.lock().unwrap().reply = Some((request.to_vec(), reply.to_vec()));
    }

    fn hear(&self, sent: &[T]) {
        let mut ends = self.0.lock().unwrap();
        ends.sent.extend_from_slice(sent);
        let Ends { sent, said, reply } = &mut *ends;
        if let Some((_, reply)) = reply.take_if(|(request, _)| sent.ends_with(request)) {
            said.extend(reply);
        }
    }

    fn take(&self, timeout: Option<Duration>) -> Option<T> {
        let end = timeout.map(|timeout| Instant::now() + timeout);
        loop {
            let said = self.0.lock().unwrap().said.pop_front();
            if said.is_some() || end.is_some_and(|end| end <= Instant::now()) {
                return said;
            }
            thread::sleep(Duration::from_millis(1));
        }
    }
}

impl<T: Send> Link for Wire<T> {}

impl ByteLink for Wire<u8> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.hear(bytes);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let Some(first) = self.take(timeout) else { return Ok(0) };
        buffer[0] = first;
        Ok(1)
    }
}

impl CanLink for Wire<CanFrame> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.hear(&[*frame]);
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        Ok(self.take(timeout))
    }
}

/// A link whose drives have no reply to an earlier host outstanding.
pub struct Fresh<L>(pub L);

impl<L: Send> Link for Fresh<L> {
    fn is_fresh(&self) -> bool {
        true
    }
}

impl<L: ByteLink> ByteLink for Fresh<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.0.read(buffer, timeout)
    }
}

impl<L: CanLink> CanLink for Fresh<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.0.receive(timeout)
    }
}

/// For an event loop, which has nothing to wait for.
impl Evented for Fresh<Wire<u8>> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}

impl Evented for Fresh<FdLink> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.0.as_fd())
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}

/// START_MOTOR for motor 1.
pub const START: [u8; 4] = [0x23, 0x01, 0x01, 0x25];
/// STOP_MOTOR for motor 1.
pub const STOP: [u8; 4] = [0x23, 0x01, 0x02, 0x26];
/// GET_REG of SPEED_MEAS for motor 1.
pub const GET_SPEED: [u8; 4] = [0x22, 0x01, 0x1E, 0x41];
/// The acknowledge of a command.
pub const ACK: [u8; 3] = [0xF0, 0x00, 0xF0];
/// The reply to `GET_SPEED`: 42 rpm.
pub const SPEED: [u8; 7] = [0xF0, 0x04, 0x2A, 0, 0, 0, 0x1F];

/// Motor off command.
pub const OFF: u8 = 0x80;
