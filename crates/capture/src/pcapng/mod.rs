//! Files of Wireshark: CAN as LINKTYPE_CAN_SOCKETCAN, and as LINKTYPE_LINUX_SLL and LINKTYPE_LINUX_SLL2 of
//! all interfaces together; serial lines as LINKTYPE_RTAC_SERIAL.

mod blocks;
mod packet;
mod writer;

pub use writer::Writer;

use std::io::{self, Read};

use crate::captured::{Damage, Direction, Stamp, Wire};
use blocks::{Block, Blocks, BrokenFile, Order};

/// The packets of a file.
pub(crate) struct Packets<R> {
    blocks: Blocks<R>,
    interfaces: Vec<Interface>,
    /// A frame behind a loss that was reported first.
    waiting: Option<Packet>,
    is_at_end: bool,
}

/// An interface of the file.
#[derive(Debug, Clone)]
struct Interface {
    link_type: u16,
    order: Order,
    /// Bytes that a simple packet has at most.
    snap_length: usize,
    /// Packets that were lost so far.
    lost: u64,
    name: Option<String>,
    resolution: Resolution,
    offset_s: i64,
}

/// Units of a time.
#[derive(Debug, Clone, Copy)]
enum Resolution {
    /// 10 to the power of this number, a second.
    Decimal(u8),
    /// 2 to the power of this number, a second.
    Binary(u8),
}

/// A packet that says something.
#[derive(Debug)]
pub(crate) struct Packet {
    pub(crate) number: u64,
    pub(crate) time: Option<Stamp>,
    pub(crate) channel: Option<String>,
    pub(crate) direction: Option<Direction>,
    pub(crate) wire: Wire,
}

impl Packet {
    /// A place of the file that is not a frame.
    fn damaged(number: u64, damage: Damage) -> Self {
        let wire = Wire::Damage(damage);
        Packet { number, time: None, channel: None, direction: None, wire }
    }
}

impl<R: Read> Packets<R> {
    pub(crate) fn new(input: R) -> Self {
        let blocks = Blocks::new(input);
        Packets { blocks, interfaces: Vec::new(), waiting: None, is_at_end: false }
    }

    pub(crate) fn next(&mut self) -> io::Result<Option<Packet>> {
        if let Some(packet) = self.waiting.take() {
            return Ok(Some(packet));
        }
        while !self.is_at_end {
            let block = match self.blocks.next() {
                Ok(Some(block)) => block,
                Ok(None) => break,
                Err(BrokenFile::Io(error)) => return Err(error),
                Err(BrokenFile::Content(why)) => {
                    self.is_at_end = true;
                    return Ok(Some(Packet::damaged(self.blocks.packets + 1, Damage::End(why))));
                }
            };
            match block {
                Block::Section => self.interfaces.clear(),
                Block::Interface { link_type, snap_length, options } => {
                    self.interfaces.push(Interface::new(link_type, snap_length, options));
                }
                Block::Lost { interface, count } => {
                    let Some(interface) = self.interfaces.get_mut(interface as usize) else {
                        continue;
                    };
                    let lost = count.saturating_sub(interface.lost);
                    if lost > 0 {
                        interface.lost = count;
                        let channel = interface.name.clone();
                        let packet = Packet::damaged(self.blocks.packets, Damage::LostBefore(lost));
                        return Ok(Some(Packet { channel, ..packet }));
                    }
                }
                Block::Packet { number, interface, units, data, original, direction, dropped } => {
                    let Some(interface) = self.interfaces.get_mut(interface as usize) else {
                        let why = "a packet of an interface that the file does not have";
                        return Ok(Some(Packet::damaged(number, Damage::Packet(why))));
                    };
                    let time = units.and_then(|units| interface.time(units));
                    // A simple packet does not say how many bytes of it are padding.
                    let len = if units.is_none() { interface.snap_length } else { usize::MAX };
                    let data = &data[..data.len().min(len)];
                    let link = (interface.link_type, interface.order);
                    let (wire, seen) = packet::parse(link, data, original);
                    interface.lost = interface.lost.saturating_add(dropped);
                    let channel = interface.name.clone();
                    let direction = direction.or(seen);
                    let packet = Packet { number, time, channel: channel.clone(), direction, wire };
                    if dropped == 0 {
                        return Ok(Some(packet));
                    }
                    self.waiting = Some(packet);
                    let wire = Wire::Damage(Damage::Dropped(dropped));
                    return Ok(Some(Packet { number, time, channel, direction: None, wire }));
                }
            }
        }
        Ok(None)
    }
}

impl Interface {
    fn new(link_type: u16, snap_length: u32, options: blocks::Options<'_>) -> Self {
        const NAME: u16 = 2;
        const RESOLUTION: u16 = 9;
        const OFFSET: u16 = 14;
        let mut interface = Interface {
            link_type,
            order: options.order(),
            snap_length: if snap_length == 0 { usize::MAX } else { snap_length as usize },
            lost: 0,
            name: None,
            resolution: Resolution::Decimal(6),
            offset_s: 0,
        };
        for (code, value) in options {
            match (code, value) {
                (NAME, name) => interface.name = Some(String::from_utf8_lossy(name).into_owned()),
                (RESOLUTION, [power, ..]) => {
                    interface.resolution = match power & 0x80 {
                        0 => Resolution::Decimal(*power),
                        _ => Resolution::Binary(power & 0x7F),
                    };
                }
                (OFFSET, value) => {
                    if let Some(bytes) = value.first_chunk() {
                        interface.offset_s = options.order().i64(*bytes);
                    }
                }
                _ => {}
            }
        }
        interface
    }

    fn time(&self, units: u64) -> Option<Stamp> {
        const NS: i128 = 1_000_000_000;
        let units = i128::from(units);
        let ns = match self.resolution {
            Resolution::Decimal(power) => match 10i128.checked_pow(power.into()) {
                Some(second) => units * NS / second,
                None => 0,
            },
            Resolution::Binary(power) => (units * NS).checked_shr(power.into()).unwrap_or(0),
        };
        let ns = i64::try_from(ns + i128::from(self.offset_s) * NS).ok()?;
        Some(crate::candump::stamp(ns))
    }
}
