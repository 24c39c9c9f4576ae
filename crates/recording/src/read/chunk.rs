//! Chunks: groups of records, compressed and with a checksum.

use std::io::Read;

use lz4_flex::frame::FrameDecoder;

use super::damage::{Damage, LARGEST};
use super::record::{ChunkHead, split};

/// A run of zeros as long as this at the end of a cut file was never written: the file system had
/// made room for it when the machine lost power.
const HOLE: usize = 32;

/// Records of a whole chunk. All or nothing: with a wrong checksum any value may be wrong.
pub fn whole(head: &ChunkHead, stored: &[u8]) -> Result<Vec<u8>, Damage> {
    if head.size > LARGEST || head.stored > LARGEST {
        return Err(Damage::TooLarge);
    }
    let records = inflated(&head.compression, stored, head.size).map_err(|(damage, _)| damage)?;
    let is_right = head.sum == 0 || crc32fast::hash(&records) == head.sum;
    if !is_right || records.len() as u64 != head.size {
        return Err(Damage::Checksum);
    }
    Ok(records)
}

/// The whole records at the beginning of a chunk whose end is missing.
pub fn beginning(head: &ChunkHead, stored: &[u8]) -> Vec<u8> {
    let zeros = stored.iter().rev().take_while(|byte| **byte == 0).count();
    let written = if zeros >= HOLE { stored.len() - zeros } else { stored.len() };
    let inflated = inflated(&head.compression, &stored[..written], LARGEST);
    let mut records = inflated.unwrap_or_else(|(_, records)| records);
    let mut rest = &records[..];
    while let Some((_, _, behind)) = split(rest) {
        rest = behind;
    }
    let length = records.len() - rest.len();
    records.truncate(length);
    records
}

/// At most `limit` bytes. The error has the bytes that were read before it.
fn inflated(compression: &str, stored: &[u8], limit: u64) -> Result<Vec<u8>, (Damage, Vec<u8>)> {
    let mut records = Vec::new();
    let read = match compression {
        "" => stored.take(limit).read_to_end(&mut records),
        "zstd" => zstd::stream::read::Decoder::new(stored)
            .and_then(|decoder| decoder.take(limit).read_to_end(&mut records)),
        "lz4" => FrameDecoder::new(stored).take(limit).read_to_end(&mut records),
        _ => return Err((Damage::Compression(compression.to_owned()), records)),
    };
    match read {
        Ok(_) => Ok(records),
        Err(_) => Err((Damage::Checksum, records)),
    }
}
