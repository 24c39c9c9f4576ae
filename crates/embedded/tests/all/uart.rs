//! UARTs at both ends of a line without transmission time.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};

/// The receive queue of a UART: bytes, or the loss of bytes.
pub type Received = Rc<RefCell<VecDeque<Result<u8, ErrorKind>>>>;

/// One end of a line without transmission time.
pub struct Uart {
    pub received: Received,
    pub other: Received,
}

pub fn line() -> (Uart, Uart) {
    let (one, other) = (Received::default(), Received::default());
    (Uart { received: one.clone(), other: other.clone() }, Uart { received: other, other: one })
}

impl ErrorType for Uart {
    type Error = ErrorKind;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        Ok(!self.received.borrow().is_empty())
    }
}

impl Read for Uart {
    fn read(&mut self, room: &mut [u8]) -> Result<usize, ErrorKind> {
        let mut received = self.received.borrow_mut();
        assert!(!received.is_empty(), "a read without data would block a board");
        if let Some(&Err(error)) = received.front() {
            received.pop_front();
            return Err(error);
        }
        let mut len = 0;
        while let (Some(slot), Some(&Ok(byte))) = (room.get_mut(len), received.front()) {
            (*slot, len) = (byte, len + 1);
            received.pop_front();
        }
        Ok(len)
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        // Like a FIFO, it accepts a few bytes at a time.
        let taken = &bytes[..bytes.len().min(7)];
        self.other.borrow_mut().extend(taken.iter().map(|&byte| Ok(byte)));
        Ok(taken.len())
    }
    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}
