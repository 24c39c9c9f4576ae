//! Printing that never blocks the program: a thread writes. Lines that the reader does not take in time
//! are dropped and counted.

use std::fmt::Display;
use std::io::Write;
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use rustix::process::getpgrp;
use rustix::termios::{LocalModes, isatty, tcgetattr, tcgetpgrp};

use crate::terminal::safe;

/// Lines that wait to be written.
const WAITING: usize = 256;
/// How long a reader may leave one line at the end.
const PATIENCE: Duration = Duration::from_millis(500);

/// A stream to print on.
pub struct NonblockingWriter {
    words: SyncSender<Word>,
    state: Arc<State>,
}

#[derive(Default)]
struct State {
    waiting: AtomicUsize,
    dropped: AtomicU64,
    /// How often a line was begun and ended: odd while one is written.
    marks: AtomicUsize,
}

enum Word {
    Line(String),
    /// Told when all before it is written.
    End(SyncSender<()>),
}

impl NonblockingWriter {
    /// Prints on `out`; `missed` puts into words how many lines were dropped.
    pub fn new(out: impl Write + AsFd + Send + 'static, missed: fn(u64) -> String) -> Self {
        let (words, spoken) = sync_channel(WAITING);
        let state = Arc::new(State::default());
        let shared = Arc::clone(&state);
        std::thread::spawn(move || speak(out, &spoken, &shared, missed));
        NonblockingWriter { words, state }
    }

    /// Prints a line, unless too many wait already.
    pub fn say(&self, text: impl Display) {
        self.state.waiting.fetch_add(1, Ordering::SeqCst);
        if self.words.try_send(Word::Line(safe(&text.to_string()).into_owned())).is_err() {
            self.state.waiting.fetch_sub(1, Ordering::SeqCst);
            self.state.dropped.fetch_add(1, Ordering::SeqCst);
        }
    }

    /// Prints a line that is worth less than others: it leaves half of the places to them.
    pub fn say_beside(&self, text: impl Display) {
        match self.state.waiting.load(Ordering::SeqCst) < WAITING / 2 {
            true => self.say(text),
            false => drop(self.state.dropped.fetch_add(1, Ordering::SeqCst)),
        }
    }

    /// Whether the next line would not be dropped.
    pub fn has_room(&self) -> bool {
        self.state.waiting.load(Ordering::SeqCst) < WAITING
    }

    /// Waits until all is written, unless the reader takes nothing. A busy machine that gives the thread no
    /// time loses nothing.
    pub fn finish(&self) {
        let (written, told) = sync_channel(1);
        if self.words.try_send(Word::End(written)).is_err() {
            return;
        }
        let mut last = 0;
        while told.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
            let marks = self.state.marks.load(Ordering::SeqCst);
            if marks % 2 == 1 && marks == last {
                return;
            }
            last = marks;
        }
    }
}

fn speak(
    mut out: impl Write + AsFd,
    words: &Receiver<Word>,
    state: &State,
    missed: fn(u64) -> String,
) {
    for word in words {
        let line = match word {
            Word::Line(line) => line,
            Word::End(written) => {
                let _ = written.send(());
                continue;
            }
        };
        let dropped = state.dropped.swap(0, Ordering::SeqCst);
        let missed = if dropped > 0 { missed(dropped) + "\n" } else { String::new() };
        state.marks.fetch_add(1, Ordering::SeqCst);
        let is_written =
            may_write(&out) && writeln!(out, "{missed}{line}").and_then(|()| out.flush()).is_ok();
        state.marks.fetch_add(1, Ordering::SeqCst);
        if !is_written {
            state.dropped.fetch_add(dropped + 1, Ordering::SeqCst);
        }
        state.waiting.fetch_sub(1, Ordering::SeqCst);
    }
}

/// A process in the background is stopped when it writes to a terminal that is set so (`stty tostop`).
fn may_write(out: &impl AsFd) -> bool {
    !isatty(out)
        || tcgetpgrp(out).is_ok_and(|group| group == getpgrp())
        || !tcgetattr(out).is_ok_and(|modes| modes.local_modes.contains(LocalModes::TOSTOP))
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader};
    use std::os::unix::net::UnixStream;

    use super::*;

    #[test]
    fn what_nobody_reads_is_dropped_and_counted_and_nothing_waits() {
        let (near, far) = UnixStream::pair().unwrap();
        let writer = NonblockingWriter::new(near, |lines| format!("{lines} missed"));
        let said = 20_000;
        for n in 0..said {
            writer.say(format_args!("{n} {}", "x".repeat(200)));
        }
        assert!(!writer.has_room());
        let mut reader = BufReader::new(far).lines().map(Result::unwrap);
        let mut lines = Vec::new();
        while !writer.has_room() {
            lines.extend(reader.next());
        }
        writer.say("last");
        drop(writer);
        lines.extend(reader);
        let missed = lines.iter().filter_map(|line| line.strip_suffix(" missed"));
        let missed: Vec<u64> = missed.map(|lines| lines.parse().unwrap()).collect();
        assert!(missed.iter().sum::<u64>() > 0);
        assert_eq!(lines.last().map(String::as_str), Some("last"));
        let told = (lines.len() - missed.len() - 1) as u64;
        assert_eq!(told + missed.iter().sum::<u64>(), said);
    }

    #[test]
    fn the_end_waits_for_what_is_written_and_not_for_a_reader_that_takes_nothing() {
        let (near, far) = UnixStream::pair().unwrap();
        let writer = NonblockingWriter::new(near, |lines| format!("{lines} missed"));
        // More than the socket takes.
        writer.say("x".repeat(1 << 20));
        writer.say("last");
        writer.finish();
        // It has not waited for it. A reader that reads gets all of it.
        let reader =
            std::thread::spawn(move || BufReader::new(far).lines().last().unwrap().unwrap());
        writer.finish();
        drop(writer);
        assert_eq!(reader.join().unwrap(), "last");
    }

    #[test]
    fn a_reader_that_is_gone_ends_nothing() {
        let (near, far) = UnixStream::pair().unwrap();
        drop(far);
        let writer = NonblockingWriter::new(near, |lines| format!("{lines} missed"));
        for n in 0..1000 {
            writer.say(n);
        }
        writer.finish();
        while !writer.has_room() {
            std::thread::yield_now();
        }
    }
}
