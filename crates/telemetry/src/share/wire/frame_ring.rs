//! What a tap has seen, for a while and in bounded memory.

use std::collections::VecDeque;
use std::sync::Arc;

use motorlink_capture::Direction;
use motorlink_proto::st::{Frame, FrameCode, Parse, SEGMENTS};
use motorlink_proto::time::{Instant, Micros};

use super::record::{LONGEST, Seen, What};

/// For how long frames are kept.
pub const KEPT: Micros = Micros::from_millis(120_000);
/// The memory for the frames of a line. A full CAN bus with 1 Mbit/s fills it in more than a minute.
pub const MEMORY: usize = 16 << 20;
/// The bytes of a block, about.
const BLOCK: usize = 16 << 10;
/// The most bytes that are kept of the configuration of a data segment.
const CONFIGURATION: usize = 1 << 10;

/// What was seen last.
#[derive(Debug, Default)]
pub(super) struct Memory {
    blocks: VecDeque<Arc<Block>>,
    bytes: usize,
    last: Block,
    /// The configuration that is sent now: its data segment, and what was seen of it so far.
    configuring: Option<(usize, Vec<u8>)>,
    configured: Configured,
}

/// The records of the exchanges that configured each data segment last. Without them the values of
/// a data segment have no names.
pub(super) type Configured = [Option<Arc<[u8]>>; SEGMENTS];

/// What was seen one after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct Block {
    /// The number of its first record. The numbers of records have no gaps.
    pub(super) first: u64,
    /// How many records it has.
    pub(super) count: u64,
    /// When the first and the last one were seen.
    pub(super) span: Option<(Instant, Instant)>,
    pub(super) bytes: Vec<u8>,
    /// Before the first record.
    pub(super) configured: Configured,
}

impl Memory {
    /// Adds what was seen now.
    pub(super) fn keep(&mut self, at: Instant, direction: Direction, what: What<'_>) {
        match what {
            What::Bytes(bytes) => {
                for part in bytes.chunks(LONGEST) {
                    let seen = Seen { at, direction, what: What::Bytes(part) };
                    self.follow(&seen, part);
                    self.add(&seen);
                }
            }
            What::Can(_) => self.add(&Seen { at, direction, what }),
        }
    }

    /// All that is kept, in its order.
    pub(super) fn blocks(&self) -> Vec<Arc<Block>> {
        let last = Some(&self.last).filter(|last| last.count > 0);
        self.blocks.iter().cloned().chain(last.cloned().map(Arc::new)).collect()
    }

    fn add(&mut self, seen: &Seen<'_>) {
        if self.last.bytes.len() >= BLOCK {
            self.close(seen.at);
        }
        let last = &mut self.last;
        seen.write(&mut last.bytes);
        last.count += 1;
        last.span = Some((last.span.map_or(seen.at, |(since, _)| since), seen.at));
    }

    /// Closes a block, and forgets those that are too old or too many.
    fn close(&mut self, now: Instant) {
        let next = Block {
            first: self.last.first + self.last.count,
            bytes: Vec::with_capacity(BLOCK + (BLOCK >> 3)),
            configured: self.configured.clone(),
            ..Block::default()
        };
        let full = std::mem::replace(&mut self.last, next);
        self.bytes += full.bytes.capacity();
        self.blocks.push_back(Arc::new(full));
        let is_old = |block: &Block| block.span.is_some_and(|(_, until)| now.since(until) > KEPT);
        while let Some(oldest) = self.blocks.front()
            && (self.bytes > MEMORY || is_old(oldest))
        {
            self.bytes -= oldest.bytes.capacity();
            self.blocks.pop_front();
        }
    }

    /// Notes the configurations of data segments.
    fn follow(&mut self, seen: &Seen<'_>, bytes: &[u8]) {
        if seen.direction == Direction::Sent {
            if let Some((segment, records)) = self.configuring.take() {
                self.configured[segment] = Some(records.into());
            }
            self.configuring = configured_segment(bytes).map(|segment| (segment, Vec::new()));
        }
        if let Some((_, records)) = &mut self.configuring
            && records.len() < CONFIGURATION
        {
            seen.write(records);
        }
    }
}

/// The data segment that a request configures.
fn configured_segment(bytes: &[u8]) -> Option<usize> {
    match Frame::parse(bytes) {
        Parse::Frame(frame, _) if frame.code() == FrameCode::ConfigDynStruct.number() => {
            frame.payload.first().map(|segment| usize::from(*segment)).filter(|it| *it < SEGMENTS)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use motorlink_proto::can::CanFrame;

    use super::*;

    fn filled(count: u64, apart: u64) -> Memory {
        let mut memory = Memory::default();
        for number in 0..count {
            let frame = CanFrame::new(0x141, number.to_le_bytes());
            memory.keep(Instant(number * apart), Direction::Sent, What::Can(frame));
        }
        memory
    }

    fn kept(memory: &Memory) -> (u64, u64, usize) {
        let blocks = memory.blocks();
        let bytes = blocks.iter().map(|block| block.bytes.capacity()).sum();
        let next = blocks.iter().fold(blocks[0].first, |next, block| {
            assert_eq!(block.first, next);
            next + block.count
        });
        (blocks[0].first, next, bytes)
    }

    #[test]
    fn memory_is_bounded() {
        let count = 1_500_000;
        let (first, next, bytes) = kept(&filled(count, 1));
        assert_eq!(next, count);
        assert!(first > count / 4 && bytes <= MEMORY + 2 * BLOCK, "{first} {bytes}");
        // A bus with 1 Mbit/s has 9009 frames of 8 bytes a second at most.
        assert!(next - first > 60 * 9009, "{}", next - first);
    }

    #[test]
    fn what_is_too_old_is_forgotten() {
        let (first, next, _) = kept(&filled(50_000, 10_000));
        let kept = (next - first) * 10_000;
        assert!((KEPT.0..KEPT.0 * 2).contains(&kept), "{kept}");
    }
}
