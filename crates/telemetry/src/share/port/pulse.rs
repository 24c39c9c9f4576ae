//! Signs of life of a program that moves motors through a share.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::{Arc, Mutex, PoisonError, TryLockError, Weak};
use std::thread;
use std::time::Duration;

use motorlink::port::{FdLink, PortError};

use crate::share::frame::{FrameKind, append};
use crate::share::message::{Ask, Request, encode};

/// Signs of life within a deadline.
const SIGNS: u32 = 4;

/// The socket of a program.
pub(super) struct Socket(Arc<Shared>);

struct Shared {
    link: FdLink,
    /// A message is written as a whole.
    writing: Mutex<()>,
}

impl Socket {
    pub(super) fn new(link: FdLink) -> Self {
        Socket(Arc::new(Shared { link, writing: Mutex::default() }))
    }

    pub(super) fn descriptor(&self) -> BorrowedFd<'_> {
        self.0.link.as_fd()
    }

    pub(super) fn write(&self, bytes: &[u8]) -> Result<(), PortError> {
        let _turn = self.0.writing.lock().unwrap_or_else(PoisonError::into_inner);
        self.0.link.put(bytes)
    }

    pub(super) fn read(
        &self,
        buffer: &mut [u8],
        timeout: Option<Duration>,
    ) -> Result<usize, PortError> {
        self.0.link.fetch(buffer, timeout)
    }

    /// Gives signs of life from now on, as long as the socket is open. This is the only thread that the
    /// library starts for a client. It runs whatever the others do, so it shows that the process runs, and
    /// not that its loop does.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn live(&self, silence: Duration) -> io::Result<()> {
        let shared = Arc::downgrade(&self.0);
        let alive = thread::Builder::new().name("motorlink-alive".to_owned());
        alive.spawn(move || give_signs(&shared, silence / SIGNS)).map(drop)
    }
}

fn give_signs(shared: &Weak<Shared>, period: Duration) {
    let mut sign = Vec::new();
    // It is not too long.
    let _ = append(FrameKind::Text, &encode(&Request::new(0, Ask::Alive)), &mut sign);
    loop {
        thread::sleep(period);
        let Some(shared) = shared.upgrade() else { return };
        match shared.writing.try_lock() {
            // A share that does not read has no room for it. The kernel takes so short a message as a whole or
            // not at all.
            Ok(_turn) if shared.link.offer(&sign).is_ok() => {}
            // A message that is written is a sign of life.
            Err(TryLockError::WouldBlock) => {}
            Ok(_) | Err(TryLockError::Poisoned(_)) => return,
        }
    }
}
