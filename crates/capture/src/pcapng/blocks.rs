//! The blocks of a pcapng file (draft-ietf-opsawg-pcapng).

use std::io::{self, ErrorKind, Read};

use crate::captured::Direction;

pub(super) const SECTION: u32 = 0x0A0D_0D0A;
pub(super) const INTERFACE: u32 = 1;
/// Of older programs.
const OLD_PACKET: u32 = 2;
const SIMPLE_PACKET: u32 = 3;
const STATISTICS: u32 = 5;
pub(super) const PACKET: u32 = 6;
/// Shows the byte order of a section.
pub(super) const ORDER: u32 = 0x1A2B_3C4D;
/// Option of a packet: its direction in the lowest two bits.
pub(super) const FLAGS: u16 = 2;
pub(super) const INBOUND: u32 = 1;
pub(super) const OUTBOUND: u32 = 2;
/// Option of a packet: packets lost before it.
const DROPPED: u16 = 4;
/// Options of statistics: packets that the interface lost, and that the system lost.
const LOST: [u16; 2] = [5, 7];
/// A block is not larger; a damaged file may say anything.
const MOST: usize = 1 << 24;

/// The byte order of a section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

impl Order {
    fn u16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Order::Little => u16::from_le_bytes(bytes),
            Order::Big => u16::from_be_bytes(bytes),
        }
    }

    pub(super) fn u32(self, bytes: [u8; 4]) -> u32 {
        match self {
            Order::Little => u32::from_le_bytes(bytes),
            Order::Big => u32::from_be_bytes(bytes),
        }
    }

    pub(super) fn i64(self, bytes: [u8; 8]) -> i64 {
        match self {
            Order::Little => i64::from_le_bytes(bytes),
            Order::Big => i64::from_be_bytes(bytes),
        }
    }
}

/// A block with a meaning for us.
pub(super) enum Block<'a> {
    Section,
    Interface {
        link_type: u16,
        /// Bytes that a packet has at most; 0 for any number.
        snap_length: u32,
        options: Options<'a>,
    },
    /// How many packets of an interface were lost so far.
    Lost {
        interface: u32,
        count: u64,
    },
    Packet {
        number: u64,
        interface: u32,
        /// The time in units of the interface.
        units: Option<u64>,
        data: &'a [u8],
        original: u32,
        direction: Option<Direction>,
        dropped: u64,
    },
}

/// Why the next block cannot be read.
pub(super) enum BrokenFile {
    Io(io::Error),
    Content(&'static str),
}

impl From<io::Error> for BrokenFile {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::UnexpectedEof => BrokenFile::Content("the file ends within a packet"),
            _ => BrokenFile::Io(error),
        }
    }
}

const BROKEN: BrokenFile =
    BrokenFile::Content("the file is damaged here, and the rest cannot be read");

/// The blocks of a stream.
pub(super) struct Blocks<R> {
    input: R,
    order: Order,
    block: Vec<u8>,
    /// How many packets there were.
    pub(super) packets: u64,
}

impl<R: Read> Blocks<R> {
    pub(super) fn new(input: R) -> Self {
        Blocks { input, order: Order::Little, block: Vec::new(), packets: 0 }
    }

    /// The next block with a meaning for us.
    pub(super) fn next(&mut self) -> Result<Option<Block<'_>>, BrokenFile> {
        let kind = loop {
            let Some(kind) = self.read()? else { return Ok(None) };
            if matches!(
                kind,
                SECTION | INTERFACE | OLD_PACKET | SIMPLE_PACKET | STATISTICS | PACKET
            ) {
                break kind;
            }
        };
        self.packets += u64::from(matches!(kind, OLD_PACKET | SIMPLE_PACKET | PACKET));
        let (number, order) = (self.packets, self.order);
        let mut rest = &self.block[..];
        Ok(Some(match kind {
            SECTION => Block::Section,
            INTERFACE => {
                let link_type = order.u16(take(&mut rest)?);
                let _reserved: [u8; 2] = take(&mut rest)?;
                let snap_length = order.u32(take(&mut rest)?);
                Block::Interface { link_type, snap_length, options: Options { rest, order } }
            }
            STATISTICS => {
                let interface = order.u32(take(&mut rest)?);
                let _time: [u8; 8] = take(&mut rest)?;
                let mut count = 0u64;
                for (code, value) in (Options { rest, order }) {
                    if LOST.contains(&code) {
                        let lost = value.first_chunk().map_or(0, |bytes| order.i64(*bytes));
                        count = count.saturating_add(lost as u64);
                    }
                }
                Block::Lost { interface, count }
            }
            SIMPLE_PACKET => {
                let original = order.u32(take(&mut rest)?);
                let data = &rest[..rest.len().min(original as usize)];
                let (direction, dropped) = (None, 0);
                Block::Packet {
                    number,
                    interface: 0,
                    units: None,
                    data,
                    original,
                    direction,
                    dropped,
                }
            }
            _ => {
                let interface = take(&mut rest)?;
                let (interface, mut dropped) = match interface {
                    [a, b, c, d] if kind == OLD_PACKET => {
                        // All bits set: not known.
                        let dropped = order.u16([c, d]);
                        (
                            order.u16([a, b]).into(),
                            if dropped == u16::MAX { 0 } else { dropped.into() },
                        )
                    }
                    interface => (order.u32(interface), 0),
                };
                let [high, low, captured, original] = [
                    order.u32(take(&mut rest)?),
                    order.u32(take(&mut rest)?),
                    order.u32(take(&mut rest)?),
                    order.u32(take(&mut rest)?),
                ];
                let captured = captured as usize;
                let (data, options) =
                    rest.split_at_checked(captured.next_multiple_of(4)).ok_or(BROKEN)?;
                let mut direction = None;
                for (code, value) in (Options { rest: options, order }) {
                    match code {
                        FLAGS => {
                            let flags = value.first_chunk().map_or(0, |bytes| order.u32(*bytes));
                            direction = match flags & 3 {
                                INBOUND => Some(Direction::Received),
                                OUTBOUND => Some(Direction::Sent),
                                _ => None,
                            };
                        }
                        DROPPED if kind == PACKET => {
                            let count = value.first_chunk().map_or(0, |bytes| order.i64(*bytes));
                            dropped = count.unsigned_abs();
                        }
                        _ => {}
                    }
                }
                let units = Some(u64::from(high) << 32 | u64::from(low));
                let data = &data[..captured];
                Block::Packet { number, interface, units, data, original, direction, dropped }
            }
        }))
    }

    /// Reads a block; its type, or `None` at the end.
    fn read(&mut self) -> Result<Option<u32>, BrokenFile> {
        let mut head = [0; 8];
        if !fill(&mut self.input, &mut head)? {
            return Ok(None);
        }
        let [a, b, c, d, length @ ..] = head;
        let kind = self.order.u32([a, b, c, d]);
        let mut taken = head.len();
        self.block.clear();
        if kind == SECTION {
            let mut order = [0; 4];
            self.input.read_exact(&mut order)?;
            taken += order.len();
            self.order = match (Order::Little.u32(order), Order::Big.u32(order)) {
                (ORDER, _) => Order::Little,
                (_, ORDER) => Order::Big,
                _ => return Err(BROKEN),
            };
        }
        let length = self.order.u32(length) as usize;
        // The length is repeated at the end.
        let body =
            length.checked_sub(taken + 4).filter(|_| length.is_multiple_of(4) && length <= MOST);
        self.block.resize(body.ok_or(BROKEN)?, 0);
        self.input.read_exact(&mut self.block)?;
        let mut again = [0; 4];
        self.input.read_exact(&mut again)?;
        if self.order.u32(again) as usize != length {
            return Err(BROKEN);
        }
        Ok(Some(kind))
    }
}

/// Fills `out`; false if the stream ended before.
fn fill(input: &mut impl Read, out: &mut [u8]) -> io::Result<bool> {
    loop {
        match input.read(&mut out[..1]) {
            Ok(0) => return Ok(false),
            Ok(_) => return input.read_exact(&mut out[1..]).map(|()| true),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], BrokenFile> {
    let (taken, behind) = rest.split_first_chunk().ok_or(BROKEN)?;
    *rest = behind;
    Ok(*taken)
}

/// The options of a block: codes and values.
#[derive(Clone, Copy)]
pub(super) struct Options<'a> {
    rest: &'a [u8],
    order: Order,
}

impl Options<'_> {
    pub(super) fn order(&self) -> Order {
        self.order
    }
}

impl<'a> Iterator for Options<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (&[a, b, c, d], rest) = self.rest.split_first_chunk()?;
        let (code, len) = (self.order.u16([a, b]), usize::from(self.order.u16([c, d])));
        if code == 0 {
            return None;
        }
        let value = rest.get(..len)?;
        self.rest = rest.get(len.next_multiple_of(4)..)?;
        Some((code, value))
    }
}
