//! UARTs: received bytes wait in a queue that the interrupt fills, sent bytes are waited for.

use core::cell::RefCell;
use core::ops::{Add, Deref};

use critical_section::Mutex;
use embedded_io::{Error, ErrorKind, ErrorType, Read, ReadReady, Write};
use heapless::Deque;
use stm32f4::stm32f405::usart1::RegisterBlock;

/// Bytes that wait: more than the longest frame of either protocol.
const WAITING: usize = 256;

/// What the interrupt has received.
pub struct Received {
    bytes: Deque<u8, WAITING>,
    lost: bool,
}

/// [`Received`], where the interrupt and the main loop find it.
pub type Line = Mutex<RefCell<Received>>;

/// Nothing received.
pub const fn line() -> Line {
    Mutex::new(RefCell::new(Received { bytes: Deque::new(), lost: false }))
}

/// What the receive interrupt of a UART does.
pub fn interrupt(registers: &RegisterBlock, line: &Line) {
    // The overrun flag goes with the reading of both registers, in this order.
    let overran = registers.sr().read().ore().bit();
    let byte = registers.dr().read().dr().bits() as u8;
    critical_section::with(|cs| {
        let received = &mut *line.borrow_ref_mut(cs);
        let full = received.bytes.push_back(byte).is_err();
        received.lost |= overran || full;
    });
}

/// How many bytes were taken from a UART's [`Line`] and sent. The numbers wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Traffic {
    taken: u32,
    sent: u32,
}

impl Traffic {
    /// How many bytes were taken since `earlier`; 254 for more.
    pub fn taken_since(self, earlier: Traffic) -> u8 {
        count(self.taken.wrapping_sub(earlier.taken))
    }

    /// How many bytes were sent since `earlier`; 254 for more.
    pub fn sent_since(self, earlier: Traffic) -> u8 {
        count(self.sent.wrapping_sub(earlier.sent))
    }
}

/// A number of bytes; 254 for more.
fn count(bytes: u32) -> u8 {
    bytes.min(254) as u8
}

impl Add for Traffic {
    type Output = Traffic;
    fn add(self, other: Traffic) -> Traffic {
        Traffic {
            taken: self.taken.wrapping_add(other.taken),
            sent: self.sent.wrapping_add(other.sent),
        }
    }
}

/// A UART that is read through its [`Line`].
pub struct Uart<R> {
    registers: R,
    line: &'static Line,
    traffic: Traffic,
}

impl<R> Uart<R> {
    /// What has moved so far.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }
}

impl<R: Deref<Target = RegisterBlock>> Uart<R> {
    /// Switches the UART on, with its receive interrupt. Baud rate and pins are QEMU's business
    /// here; on a board they belong to its HAL.
    pub fn new(registers: R, line: &'static Line) -> Self {
        registers
            .cr1()
            .write(|w| w.ue().enabled().te().enabled().re().enabled().rxneie().enabled());
        Uart { registers, line, traffic: Traffic::default() }
    }
}

/// Bytes came faster than they were taken.
#[derive(Debug, Clone, Copy)]
pub struct Overrun;

impl core::fmt::Display for Overrun {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("bytes came faster than they were taken")
    }
}

impl core::error::Error for Overrun {}

impl Error for Overrun {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl<R> ErrorType for Uart<R> {
    type Error = Overrun;
}

impl<R> ReadReady for Uart<R> {
    fn read_ready(&mut self) -> Result<bool, Overrun> {
        Ok(critical_section::with(|cs| {
            let received = self.line.borrow_ref(cs);
            received.lost || !received.bytes.is_empty()
        }))
    }
}

impl<R> Read for Uart<R> {
    /// Gives what waits. Where bytes were lost, what waits with them is dropped.
    fn read(&mut self, room: &mut [u8]) -> Result<usize, Overrun> {
        critical_section::with(|cs| {
            let received = &mut *self.line.borrow_ref_mut(cs);
            let waiting = received.bytes.len();
            if core::mem::take(&mut received.lost) {
                received.bytes.clear();
                self.traffic.taken = self.traffic.taken.wrapping_add(waiting as u32);
                return Err(Overrun);
            }
            let taken = room.iter_mut().map_while(|slot| {
                *slot = received.bytes.pop_front()?;
                Some(())
            });
            let taken = taken.count();
            self.traffic.taken = self.traffic.taken.wrapping_add(taken as u32);
            Ok(taken)
        })
    }
}

impl<R: Deref<Target = RegisterBlock>> Write for Uart<R> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Overrun> {
        for &byte in bytes {
            while self.registers.sr().read().txe().bit_is_clear() {}
            self.registers.dr().write(|w| w.dr().set(u16::from(byte)));
        }
        self.traffic.sent = self.traffic.sent.wrapping_add(bytes.len() as u32);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Overrun> {
        while self.registers.sr().read().tc().bit_is_clear() {}
        Ok(())
    }
}
