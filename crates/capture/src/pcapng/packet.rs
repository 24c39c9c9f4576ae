//! The content of packets.

use super::blocks::Order;
use crate::candump::{ERROR, EXTENDED, IDENTIFIER, REMOTE};
use crate::captured::{Damage, Direction, FdFrame, Wire};
use motorlink_proto::can::CanFrame;

/// Numbers of <https://www.tcpdump.org/linktypes.html>.
pub(super) const LINKTYPE_SOCKETCAN: u16 = 227;
pub(super) const LINKTYPE_RTAC_SERIAL: u16 = 250;
const LINKTYPE_LINUX_SLL: u16 = 113;
const LINKTYPE_LINUX_SLL2: u16 = 276;
/// Protocols of LINKTYPE_LINUX_SLL: CAN and CAN FD.
const SLL_CAN: [[u8; 2]; 2] = [[0, 0x0C], [0, 0x0D]];
/// The type of a packet that this machine sent.
const SLL_OUTGOING: u8 = 4;

/// The bit of a CAN FD frame in its flags.
pub(super) const FD: u8 = 0x04;
/// The head of a packet of LINKTYPE_RTAC_SERIAL: time, event, control lines, two more bytes.
pub(super) const RTAC_HEAD: usize = 12;
/// Events of LINKTYPE_RTAC_SERIAL.
pub(super) const TX_START: u8 = 1;
pub(super) const RX_START: u8 = 2;
const TX_END: u8 = 3;
const RX_END: u8 = 4;

/// A packet, and the direction that it has in itself.
pub(super) fn parse(
    (link_type, order): (u16, Order),
    data: &[u8],
    original: u32,
) -> (Wire, Option<Direction>) {
    let damage = |damage| (Wire::Damage(damage), None);
    if data.len() < original as usize {
        return damage(Damage::Cut { captured: data.len() as u32, original });
    }
    let parsed = match link_type {
        LINKTYPE_SOCKETCAN => can(data).map(|wire| (wire, None)),
        LINKTYPE_RTAC_SERIAL => serial(data),
        LINKTYPE_LINUX_SLL => match data.split_first_chunk::<16>() {
            Some((&[_, kind, .., a, b], frame)) => cooked([a, b], kind, frame, order),
            None => Err(SHORT),
        },
        LINKTYPE_LINUX_SLL2 => match data.split_first_chunk::<20>() {
            Some((&[a, b, _, _, _, _, _, _, _, _, kind, ..], frame)) => {
                cooked([a, b], kind, frame, order)
            }
            None => Err(SHORT),
        },
        _ => Err("a packet of an interface that is neither CAN nor a serial line"),
    };
    parsed.unwrap_or_else(|why| damage(Damage::Packet(why)))
}

const SHORT: &str = "the packet is too short for a CAN frame";

/// A packet of the interface `any` of Linux: its protocol, its type, its content. The identifier has the
/// byte order of the machine that captured.
fn cooked(
    protocol: [u8; 2],
    kind: u8,
    frame: &[u8],
    order: Order,
) -> Result<(Wire, Option<Direction>), &'static str> {
    if !SLL_CAN.contains(&protocol) {
        return Err("a packet of an interface that is neither CAN nor a serial line");
    }
    let mut frame = frame.to_vec();
    let id = frame.first_chunk_mut::<4>().ok_or(SHORT)?;
    *id = order.u32(*id).to_be_bytes();
    let is_sent = kind == SLL_OUTGOING;
    let direction = if is_sent { Direction::Sent } else { Direction::Received };
    Ok((can(&frame)?, Some(direction)))
}

fn can(data: &[u8]) -> Result<Wire, &'static str> {
    let (&[a, b, c, d, len, flags, ..], data) = data.split_first_chunk::<8>().ok_or(SHORT)?;
    let word = u32::from_be_bytes([a, b, c, d]);
    let (id, extended) = (word & IDENTIFIER, word & EXTENDED != 0);
    let len = usize::from(len);
    let most = if flags & FD != 0 { 64 } else { 8 };
    if len > most || !extended && word & ERROR == 0 && id > 0x7FF {
        return Err("not a CAN frame");
    }
    if word & REMOTE != 0 && word & ERROR == 0 {
        return Ok(Wire::Can(CanFrame::remote_frame(id, extended, len as u8)));
    }
    let data = data.get(..len).ok_or(SHORT)?;
    if word & ERROR != 0 {
        let mut bytes = [0; 8];
        bytes[..len.min(8)].copy_from_slice(&data[..len.min(8)]);
        return Ok(Wire::Error { class: id, data: bytes });
    }
    if flags & FD != 0 {
        let flags = flags & 0x03;
        return Ok(Wire::Fd(Box::new(FdFrame { id, extended, flags, data: data.to_vec() })));
    }
    Ok(Wire::Can(CanFrame::data_frame(id, extended, data)))
}

fn serial(data: &[u8]) -> Result<(Wire, Option<Direction>), &'static str> {
    let (head, bytes) = data
        .split_first_chunk::<RTAC_HEAD>()
        .ok_or("the packet is too short for a serial event")?;
    let direction = match head[8] {
        TX_START | TX_END => Direction::Sent,
        RX_START | RX_END => Direction::Received,
        5 => return Err("the capture lost bytes here"),
        7 => return Err("framing error on the line"),
        8 => return Err("parity error on the line"),
        9 => return Err("break on the line"),
        10 => return Err("the receiver overflowed and lost bytes"),
        _ if !bytes.is_empty() => return Err("a serial event of a kind that should have no bytes"),
        // Changes of control lines, and the end of the capture.
        _ => return Ok((Wire::Serial(Vec::new()), None)),
    };
    Ok((Wire::Serial(bytes.to_vec()), Some(direction)))
}
