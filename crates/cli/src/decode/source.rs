//! Entries of captures, and of recordings.

use std::fs::File;
use std::io::{self, Read};
use std::sync::Arc;

use motorlink_capture::{Captured, Reader};
use motorlink_recording::read::{Frames, Line};

/// What gives entries, one after the other.
pub trait Source {
    /// Whether [`next`](Self::next) may wait.
    fn may_wait(&self) -> bool;

    /// The next entry; `None` at the end.
    fn next(&mut self) -> io::Result<Option<Captured>>;
}

impl<R: Read> Source for Reader<R> {
    fn may_wait(&self) -> bool {
        Reader::may_wait(self)
    }

    fn next(&mut self) -> io::Result<Option<Captured>> {
        Reader::next(self)
    }
}

/// The frames of the recorded lines with one protocol.
pub struct Recorded<'a> {
    frames: Frames<'a, File>,
    is_wanted: fn(&Line) -> bool,
    place: u64,
}

impl<'a> Recorded<'a> {
    pub fn new(frames: Frames<'a, File>, is_wanted: fn(&Line) -> bool) -> Self {
        Recorded { frames, is_wanted, place: 0 }
    }

    pub fn malformed(&self) -> u64 {
        self.frames.malformed()
    }
}

impl Source for Recorded<'_> {
    fn may_wait(&self) -> bool {
        false
    }

    fn next(&mut self) -> io::Result<Option<Captured>> {
        let mut wanted = |frame: &io::Result<(Arc<Line>, _)>| {
            frame.as_ref().map_or(true, |(line, _)| (self.is_wanted)(line))
        };
        let Some(frame) = self.frames.find(&mut wanted) else { return Ok(None) };
        let (line, frame) = frame?;
        self.place += 1;
        Ok(Some(frame.captured(self.place, &line)))
    }
}
