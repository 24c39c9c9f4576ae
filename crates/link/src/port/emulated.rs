//! Lines to emulated boards whose time their host advances.
//!
//! A slow emulator is slow for both ends: no deadline passes at one end while the other cannot run.
//! firmware/README.md describes the clock port.

use std::sync::{Mutex, PoisonError};
use std::time;

use motorlink_proto::time::{Instant, Micros};

use super::error::PortError;
use super::fd::FdLink;
use super::link::{ByteLink, Link};
use crate::clock::Clock;

/// One step of a board's time.
const TICK: Micros = Micros(100);
/// Maximum number of ticks per command.
const MOST_TICKS: u64 = 254;
/// The command that requests the number of bytes that the board has received.
const COUNT: u8 = 0;
/// The first command of a new host, and both bytes of its answer. No other answer has this byte.
const SYNC: u8 = 255;
/// Timeout of bytes that the board has sent, in the machine's time. Bytes of the board's other line
/// never arrive here.
const ARRIVAL: time::Duration = time::Duration::from_secs(1);
/// Interval between [`SYNC`]s that are not answered, in the machine's time.
const ASK_AGAIN: time::Duration = time::Duration::from_millis(100);
/// Maximum number of bytes that the board has not confirmed: it counts up to 254.
const CHUNK: usize = 128;

/// A [`ByteLink`] on the time of an emulated board. The time advances only during waits.
///
/// The board receives all bytes before its time advances. A write takes a tick, so time also passes
/// for a client that sends requests without a pause.
#[derive(Debug)]
pub(super) struct EmulatedBytes {
    data: FdLink,
    board: FdLink,
    clock: Clock,
    /// The board's time, on `clock`.
    reached: Instant,
    /// Number of bytes that the board has sent and that were not read yet.
    due: usize,
    /// Timeout of the emulator's answers, in the machine's time.
    patience: time::Duration,
    /// The clock port, for messages.
    name: String,
}

impl EmulatedBytes {
    /// The line `data` of the board whose clock port is `board`. `name` is the clock port in
    /// messages, and identifies the board.
    pub(super) fn new(data: FdLink, board: FdLink, name: String) -> Result<Self, PortError> {
        Self::patient(data, board, name, time::Duration::from_secs(10))
    }

    fn patient(
        data: FdLink,
        board: FdLink,
        name: String,
        patience: time::Duration,
    ) -> Result<Self, PortError> {
        let clock = clock_of(&name);
        let reached = clock.now();
        let mut line = EmulatedBytes { data, board, clock, reached, due: 0, patience, name };
        line.synchronise()?;
        Ok(line)
    }

    /// Drops pending answers of the board to a former host. Repeats the command until the board is
    /// ready.
    fn synchronise(&mut self) -> Result<(), PortError> {
        let began = time::Instant::now();
        let mut byte = [0];
        while began.elapsed() < self.patience {
            self.board.write(&[SYNC])?;
            while self.board.read(&mut byte, Some(ASK_AGAIN.min(self.patience)))? > 0 {
                if byte == [SYNC] {
                    return Ok(());
                }
            }
        }
        Err(self.stopped())
    }

    /// Sends a command to the clock port. Returns the answer.
    fn ask(&mut self, command: u8) -> Result<u8, PortError> {
        self.board.write(&[command])?;
        let mut answer = self.answer()?;
        while answer == SYNC {
            answer = self.answer()?;
        }
        self.due += usize::from(self.answer()?);
        Ok(answer)
    }

    /// The next byte of an answer.
    fn answer(&mut self) -> Result<u8, PortError> {
        let mut byte = [0];
        match self.board.read(&mut byte, Some(self.patience))? {
            0 => Err(self.stopped()),
            _ => Ok(byte[0]),
        }
    }

    fn stopped(&self) -> PortError {
        PortError::ClockStopped { port: self.name.clone(), after: self.patience }
    }

    /// Advances the board's time towards `end`. Stops early when bytes are transferred.
    fn step(&mut self, end: Instant) -> Result<(), PortError> {
        let ticks = end.since(self.reached).0.div_ceil(TICK.0).min(MOST_TICKS) as u8;
        let done = self.ask(ticks)?;
        self.reached += Micros(u64::from(done) * TICK.0);
        self.clock.wait(self.reached);
        Ok(())
    }

    fn step_to(&mut self, end: Instant) -> Result<(), PortError> {
        while self.reached < end {
            self.step(end)?;
        }
        Ok(())
    }

    /// Waits until the board has received `count` bytes. Its time does not advance.
    fn delivered(&mut self, count: usize) -> Result<(), PortError> {
        let mut left = count;
        let mut last = time::Instant::now();
        while left > 0 {
            let taken = usize::from(self.ask(COUNT)?);
            left = left.saturating_sub(taken);
            if taken > 0 {
                last = time::Instant::now();
            } else if last.elapsed() > self.patience {
                return Err(self.data.stalled());
            }
        }
        Ok(())
    }
}

impl Link for EmulatedBytes {
    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }
}

impl ByteLink for EmulatedBytes {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.step_to(self.clock.now() + TICK)?;
        for chunk in bytes.chunks(CHUNK) {
            self.data.write(chunk)?;
            self.delivered(chunk.len())?;
        }
        Ok(())
    }

    fn read(
        &mut self,
        buffer: &mut [u8],
        timeout: Option<time::Duration>,
    ) -> Result<usize, PortError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let now = self.clock.now();
        let end = timeout.map_or(Instant(u64::MAX), |timeout| {
            // Part of a microsecond counts as one.
            let part = u64::from(!timeout.subsec_nanos().is_multiple_of(1000));
            now + timeout.into() + Micros(part)
        });
        self.step_to(now)?;
        loop {
            let wait = if self.due > 0 { ARRIVAL } else { time::Duration::ZERO };
            let size = self.data.read(buffer, Some(wait))?;
            self.due = if size > 0 { self.due.saturating_sub(size) } else { 0 };
            if size > 0 || self.reached >= end {
                return Ok(size);
            }
            self.step(end)?;
        }
    }
}

/// The clock of the board `name`. A line that is opened again continues with it.
fn clock_of(name: &str) -> Clock {
    static CLOCKS: Mutex<Vec<(String, Clock)>> = Mutex::new(Vec::new());
    let mut clocks = CLOCKS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, clock)) = clocks.iter().find(|(known, _)| known == name) {
        return clock.clone();
    }
    let clock = Clock::virtual_time();
    clocks.push((name.to_owned(), clock.clone()));
    clock
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::io::{Read, Write};
    use std::net::{TcpListener, TcpStream};
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::thread::JoinHandle;

    use super::*;

    const MS: time::Duration = time::Duration::from_millis(1);

    fn pair() -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let near = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let far = listener.accept().unwrap().0;
        far.set_nodelay(true).unwrap();
        (near, far)
    }

    /// A board that answers each received byte with the next value, `delay` ticks later. Returns
    /// the number of ticks until the clock port was closed.
    fn board(mut clock: TcpStream, mut data: TcpStream, delay: u64) -> JoinHandle<u64> {
        data.set_nonblocking(true).unwrap();
        std::thread::spawn(move || {
            let (mut now, mut due, mut late) = (0, VecDeque::new(), Vec::new());
            let (mut moved, mut sent) = (0, 0);
            let mut command = [0];
            while clock.read_exact(&mut command).is_ok() {
                // One byte per command, as in QEMU.
                let mut byte = [0];
                if data.read(&mut byte).is_ok_and(|size| size > 0) {
                    due.push_back((now + delay, byte[0].wrapping_add(1)));
                    moved += 1;
                }
                if command[0] == SYNC {
                    clock.write_all(&[SYNC; 2]).unwrap();
                    moved = 0;
                    continue;
                }
                let mut answer = 0;
                if command[0] == COUNT {
                    answer = moved;
                }
                while answer < command[0] && moved == 0 {
                    answer += 1;
                    now += 1;
                    if due.front().is_some_and(|(at, _)| *at <= now) {
                        late.push(due.pop_front().unwrap().1);
                        (moved, sent) = (moved + 1, sent + 1);
                    }
                }
                moved = 0;
                clock.write_all(&[answer, sent]).unwrap();
                // The order between two connections is not defined.
                if sent > 0 {
                    std::thread::sleep(5 * MS);
                    data.write_all(&late).unwrap();
                    (sent, late) = (0, Vec::new());
                }
            }
            now
        })
    }

    /// A line to a board of its own.
    fn line(delay: u64) -> (EmulatedBytes, JoinHandle<u64>) {
        let ((data, far_data), (clock, far_clock)) = (pair(), pair());
        let board = board(far_clock, far_data, delay);
        let data = FdLink::new(data, "data").unwrap();
        (EmulatedBytes::new(data, link(clock), name()).unwrap(), board)
    }

    fn link(stream: TcpStream) -> FdLink {
        stream.set_nodelay(true).unwrap();
        FdLink::new(stream, "clock").unwrap()
    }

    fn name() -> String {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        format!("clock {}", COUNT.fetch_add(1, Ordering::Relaxed))
    }

    #[test]
    fn pending_answers_to_a_former_host_are_dropped() {
        let ((data, far_data), (clock, mut far_clock)) = (pair(), pair());
        // The former host exited during a step, or in the middle of an answer.
        far_clock.write_all(&[7, 250, 3]).unwrap();
        let board = board(far_clock, far_data, 250);
        let data = FdLink::new(data, "data").unwrap();
        let mut line = EmulatedBytes::new(data, link(clock), name()).unwrap();
        line.write(&[7]).unwrap();
        let mut byte = [0];
        assert_eq!(line.read(&mut byte, None).unwrap(), 1);
        assert_eq!((byte[0], line.clock.now()), (8, Instant(25_100)));
        drop(line);
        assert_eq!(board.join().unwrap(), 251);
    }

    #[test]
    fn a_wait_uses_the_boards_time_and_not_the_machines() {
        let (mut line, board) = line(0);
        let began = time::Instant::now();
        assert_eq!(line.read(&mut [0; 8], Some(60_000 * MS)).unwrap(), 0);
        assert!(began.elapsed() < 50_000 * MS);
        assert_eq!(line.clock.now(), Instant(60_000_000));
        drop(line);
        assert_eq!(board.join().unwrap(), 600_000);
    }

    #[test]
    fn received_bytes_have_the_time_of_their_sending() {
        let (mut line, _board) = line(250);
        line.write(&[7, 8]).unwrap();
        assert_eq!(line.clock.now(), Instant(100), "a write takes a tick");
        let mut byte = [0];
        assert_eq!(line.read(&mut byte, Some(24 * MS)).unwrap(), 0);
        assert_eq!(line.clock.now(), Instant(24_100));
        assert_eq!(line.read(&mut byte, None).unwrap(), 1);
        assert_eq!((byte[0], line.clock.now()), (8, Instant(25_100)));
        assert_eq!(line.read(&mut byte, None).unwrap(), 1);
        assert_eq!(byte[0], 9);
    }

    #[test]
    fn a_wait_ends_with_the_first_tick_at_or_after_its_end() {
        let (mut line, _board) = line(0);
        let mut wait = |nanos| {
            line.read(&mut [0], Some(time::Duration::from_nanos(nanos))).unwrap();
            line.clock.now()
        };
        assert_eq!(wait(0), Instant(0));
        assert_eq!(wait(1), Instant(100));
        assert_eq!(wait(100_000), Instant(200));
        assert_eq!(wait(100_001), Instant(400));
        assert_eq!(line.read(&mut [], None).unwrap(), 0, "the buffer is empty");
    }

    #[test]
    fn the_board_catches_up_with_a_clock_that_others_moved() {
        let (mut line, board) = line(0);
        line.clock().unwrap().wait(Instant(1_234_567));
        line.read(&mut [0], Some(time::Duration::ZERO)).unwrap();
        assert_eq!(line.clock.now(), Instant(1_234_600));
        line.clock.wait(Instant(2_000_000));
        line.write(&[1]).unwrap();
        assert_eq!(line.clock.now(), Instant(2_000_100));
        drop(line);
        assert_eq!(board.join().unwrap(), 20_001);
    }

    #[test]
    fn a_long_write_is_delivered_at_one_moment() {
        let (mut line, _board) = line(1);
        line.write(&[3; 600]).unwrap();
        assert_eq!(line.clock.now(), Instant(100));
    }

    #[test]
    fn a_reopened_line_continues_with_its_clock() {
        let (mut first, _board) = line(0);
        first.read(&mut [0], Some(MS)).unwrap();
        let (clock, name) = (first.clock().unwrap(), first.name.clone());
        drop(first);
        let ((data, far_data), (pulse, far_pulse)) = (pair(), pair());
        let _board = board(far_pulse, far_data, 0);
        let data = FdLink::new(data, "data").unwrap();
        let mut again = EmulatedBytes::new(data, link(pulse), name).unwrap();
        again.read(&mut [0], Some(MS)).unwrap();
        assert_eq!(clock.now(), Instant(2_000));
    }

    #[test]
    fn a_clock_port_that_is_closed_or_silent_is_an_error() {
        let (data, _far) = pair();
        let (clock, far_clock) = pair();
        let data = FdLink::new(data, "data").unwrap();
        let error = EmulatedBytes::patient(data, link(clock), "clock=h:1".to_owned(), MS);
        let error = error.expect_err("silence").to_string();
        assert!(error.contains("`clock=h:1`: the board's clock did not answer"), "{error}");
        drop(far_clock);

        let ((data, _far), (clock, far_clock)) = (pair(), pair());
        drop(far_clock);
        let data = FdLink::new(data, "data").unwrap();
        let error = EmulatedBytes::new(data, link(clock), name()).expect_err("closed");
        assert!(matches!(error, PortError::Closed(..)), "{error}");
    }

    #[test]
    fn bytes_that_the_board_does_not_take_are_an_error() {
        let ((data, far_data), (clock, far_clock)) = (pair(), pair());
        let (_near, elsewhere) = pair();
        let _board = board(far_clock, elsewhere, 0);
        let data = FdLink::new(data, "data").unwrap();
        let mut line = EmulatedBytes::patient(data, link(clock), name(), 100 * MS).unwrap();
        let error = line.write(&[1]).expect_err("nobody reads");
        assert!(matches!(error, PortError::Stalled { .. }), "{error}");
        drop(far_data);
    }
}
