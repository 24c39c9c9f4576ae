//! Bytes of a file at any place, through a window that moves forward.

use std::io::{self, Read, Seek, SeekFrom};

/// Bytes that are read at least.
const BLOCK: u64 = 64 << 10;

pub struct Source<R> {
    file: R,
    /// Length of the file when it was opened. A recording may grow meanwhile.
    pub end: u64,
    /// Bytes from `start` on.
    window: Vec<u8>,
    start: u64,
}

impl<R: Read + Seek> Source<R> {
    pub fn new(mut file: R) -> io::Result<Self> {
        let end = file.seek(SeekFrom::End(0))?;
        Ok(Source { file, end, window: Vec::new(), start: 0 })
    }

    /// The bytes of a place, fewer at the end of the file.
    pub fn bytes(&mut self, at: u64, length: u64) -> io::Result<&[u8]> {
        let length = length.min(self.end.saturating_sub(at));
        let has = |window: &[u8]| at + length <= self.start + window.len() as u64;
        if at < self.start || !has(&self.window) {
            self.file.seek(SeekFrom::Start(at))?;
            self.window.clear();
            self.start = at;
            let wanted = length.max(BLOCK).min(self.end.saturating_sub(at));
            (&mut self.file).take(wanted).read_to_end(&mut self.window)?;
        }
        let from = self.window.len().min((at - self.start) as usize);
        let to = self.window.len().min(from.saturating_add(length as usize));
        Ok(&self.window[from..to])
    }

    /// The checksum of all bytes before a place.
    pub fn sum_before(&mut self, end: u64) -> io::Result<u32> {
        let mut hasher = crc32fast::Hasher::new();
        let mut at = 0;
        while at < end {
            let bytes = self.bytes(at, BLOCK.min(end - at))?;
            if bytes.is_empty() {
                break;
            }
            hasher.update(bytes);
            at += bytes.len() as u64;
        }
        Ok(hasher.finalize())
    }
}
