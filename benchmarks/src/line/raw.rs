//! The same bytes with the same system calls, and nothing else: write, ppoll, read at the near end;
//! ppoll, read, write at the far end.

use std::os::fd::OwnedFd;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{self, Errno};

use motorlink_kernels::result::Result;

/// GET_REG SPEED_MEAS to motor 1, and a speed of 0.
const REQUEST: &[u8] = &[0x22, 0x01, 0x1E, 0x41];
const REPLY: &[u8] = &[0xF0, 0x04, 0x00, 0x00, 0x00, 0x00, 0xF4];
/// The client waits for a reply with this timeout. So the kernel sets a timer here, too.
const TIMEOUT: Timespec = Timespec { tv_sec: 1, tv_nsec: 0 };

/// How the loop calls the kernel.
pub(super) trait Calls {
    fn send(fd: &OwnedFd, bytes: &[u8]) -> io::Result<usize>;
    fn wait(fd: &OwnedFd, timeout: Option<&Timespec>) -> io::Result<usize>;
    fn take(fd: &OwnedFd, buffer: &mut [u8]) -> io::Result<usize>;
}

/// Each system call is a function that returns, as in libc.
pub(super) struct Functions;

impl Calls for Functions {
    #[inline(never)]
    fn send(fd: &OwnedFd, bytes: &[u8]) -> io::Result<usize> {
        Inlined::send(fd, bytes)
    }

    #[inline(never)]
    fn wait(fd: &OwnedFd, timeout: Option<&Timespec>) -> io::Result<usize> {
        Inlined::wait(fd, timeout)
    }

    #[inline(never)]
    fn take(fd: &OwnedFd, buffer: &mut [u8]) -> io::Result<usize> {
        Inlined::take(fd, buffer)
    }
}

/// Everything is inlined into one function. No real program is like this: no function returns after
/// a thread switch, where the processor mispredicts it.
pub(super) struct Inlined;

impl Calls for Inlined {
    #[inline(always)]
    fn send(fd: &OwnedFd, bytes: &[u8]) -> io::Result<usize> {
        io::write(fd, bytes)
    }

    #[inline(always)]
    fn wait(fd: &OwnedFd, timeout: Option<&Timespec>) -> io::Result<usize> {
        poll(&mut [PollFd::new(fd, PollFlags::IN)], timeout)
    }

    #[inline(always)]
    fn take(fd: &OwnedFd, buffer: &mut [u8]) -> io::Result<usize> {
        io::read(fd, buffer)
    }
}

/// The end that sends requests.
pub(super) struct Near(OwnedFd);

impl Near {
    pub(super) fn new(fd: OwnedFd) -> Result<Self> {
        nonblocking(fd).map(Near)
    }

    #[inline(always)]
    pub(super) fn exchange<C: Calls>(&self) -> Result<()> {
        C::send(&self.0, REQUEST)?;
        Ok(receive::<C>(&self.0, REPLY.len(), Some(&TIMEOUT))?)
    }
}

/// The end that replies.
pub(super) struct Far(OwnedFd);

impl Far {
    pub(super) fn new(fd: OwnedFd) -> Result<Self> {
        nonblocking(fd).map(Far)
    }

    /// Answers until the line is closed.
    pub(super) fn serve<C: Calls>(self) {
        while receive::<C>(&self.0, REQUEST.len(), None).is_ok() {
            if C::send(&self.0, REPLY).is_err() {
                return;
            }
        }
    }
}

/// Receives `size` bytes, which nearly always arrive at once.
#[inline(always)]
fn receive<C: Calls>(fd: &OwnedFd, size: usize, timeout: Option<&Timespec>) -> io::Result<()> {
    let mut buffer = [0; 256];
    let mut received = 0;
    while received < size {
        if C::wait(fd, timeout)? == 0 {
            return Err(Errno::TIMEDOUT);
        }
        match C::take(fd, &mut buffer)? {
            0 => return Err(Errno::PIPE),
            more => received += more,
        }
    }
    Ok(())
}

/// Non-blocking, like the client's line.
fn nonblocking(fd: OwnedFd) -> Result<OwnedFd> {
    fcntl_setfl(&fd, fcntl_getfl(&fd)? | OFlags::NONBLOCK)?;
    Ok(fd)
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_proto::st::{Frame, HEADER_ACK, RegisterId, Request};

    #[test]
    fn the_bytes_are_those_of_the_exchange() {
        let mut room = [0; 16];
        let request = Request::GetRegister(RegisterId::SPEED_MEAS);
        assert_eq!(Frame::command(1, &request, &mut room), Some(REQUEST));
        let reply = Frame { header: HEADER_ACK, payload: &[0; 4] };
        assert_eq!(reply.encode(&mut room), Some(REPLY));
    }
}
