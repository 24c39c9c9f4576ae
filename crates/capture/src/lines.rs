//! Lines of a stream, without a copy of each.

use std::io::{self, ErrorKind, Read};

use memchr::memchr;

/// Bytes that are read at once.
const SIZE: usize = 1 << 16;

/// A stream of lines. A line of more than 64 KiB comes in parts, divided between words.
pub(crate) struct Lines<R> {
    input: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// The number of the last line.
    number: u64,
    is_within_line: bool,
}

impl<R: Read> Lines<R> {
    pub(crate) fn new(input: R) -> Self {
        Lines { input, buffer: vec![0; SIZE], start: 0, end: 0, number: 0, is_within_line: false }
    }

    /// Whether the next line is there already.
    pub(crate) fn has_line(&self) -> bool {
        memchr(b'\n', &self.buffer[self.start..self.end]).is_some()
    }

    /// The number of the next line, which is 1 for the first one, and the line without its end. `None` at
    /// the end of the stream.
    pub(crate) fn line(&mut self) -> io::Result<Option<(u64, &[u8])>> {
        let mut searched = self.start;
        self.number += u64::from(!self.is_within_line);
        loop {
            if let Some(at) = memchr(b'\n', &self.buffer[searched..self.end]) {
                let (from, to) = (self.start, searched + at);
                self.start = to + 1;
                self.is_within_line = false;
                let line = &self.buffer[from..to];
                return Ok(Some((self.number, line.strip_suffix(b"\r").unwrap_or(line))));
            }
            searched = self.end;
            let moved = self.start;
            let is_full = self.end - self.start == SIZE;
            if is_full || !self.more()? {
                let space = self.buffer[..self.end].iter().rposition(u8::is_ascii_whitespace);
                let (from, to) = (self.start, space.filter(|_| is_full).unwrap_or(self.end));
                self.start = to;
                self.is_within_line = is_full;
                return Ok((from < to).then(|| (self.number, &self.buffer[from..to])));
            }
            // The bytes were moved to the front.
            searched -= moved - self.start;
        }
    }

    /// The next bytes, at least `count` of them unless the stream ends before.
    pub(crate) fn peek(&mut self, count: usize) -> io::Result<&[u8]> {
        while self.end - self.start < count.min(SIZE) && self.more()? {}
        Ok(&self.buffer[self.start..self.end])
    }

    /// Reads once; false at the end of the stream.
    fn more(&mut self) -> io::Result<bool> {
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        loop {
            match self.input.read(&mut self.buffer[self.end..]) {
                Ok(count) => {
                    self.end += count;
                    return Ok(count > 0);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// The rest of the stream as bytes.
impl<R: Read> Read for Lines<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.start == self.end {
            return self.input.read(out);
        }
        let count = out.len().min(self.end - self.start);
        out[..count].copy_from_slice(&self.buffer[self.start..self.start + count]);
        self.start += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives a few bytes at a time.
    struct Trickle<'a>(&'a [u8], usize);

    impl Read for Trickle<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(self.0.len()).min(out.len());
            out[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    #[test]
    fn lines_are_the_same_however_they_arrive() {
        let long = vec![b'x'; SIZE + 3];
        let text = [&b"a\n\nbcd\r\n"[..], &long, b"\nlast"].concat();
        for step in [1, 2, 3, 7, SIZE - 1, SIZE, 2 * SIZE] {
            let mut lines = Lines::new(Trickle(&text, step));
            let mut all = Vec::new();
            while let Some((_, line)) = lines.line().unwrap() {
                all.push(line.to_vec());
            }
            let expected: [&[u8]; 6] = [b"a", b"", b"bcd", &long[..SIZE], &long[SIZE..], b"last"];
            assert_eq!(all, expected, "{step}");
        }
    }

    #[test]
    fn a_long_line_is_divided_between_words_and_has_one_number() {
        let text = format!("a\n{}\nb\n", "0f ".repeat(SIZE));
        let mut lines = Lines::new(text.as_bytes());
        let (mut words, mut numbers) = (0, Vec::new());
        while let Some((number, line)) = lines.line().unwrap() {
            words += crate::text::words(line).filter(|word| *word == b"0f").count();
            numbers.push(number);
        }
        assert_eq!(words, SIZE);
        assert_eq!(numbers, [1, 2, 2, 2, 2, 3]);
    }

    #[test]
    fn what_was_peeked_is_still_there() {
        let mut lines = Lines::new(Trickle(b"abc\ndef", 1));
        assert_eq!(lines.peek(4).unwrap(), b"abc\n");
        assert!(lines.has_line());
        assert_eq!(lines.line().unwrap(), Some((1, &b"abc"[..])));
        let mut rest = Vec::new();
        lines.read_to_end(&mut rest).unwrap();
        assert_eq!(rest, b"def");
    }
}
