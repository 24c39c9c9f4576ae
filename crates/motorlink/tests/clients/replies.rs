//! Replies that come twice, or answer something else.

use std::collections::VecDeque;
use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Link, PortError};
use motorlink::rmd::{self, MotorId};
use motorlink::st::{self, register};

use crate::wire::Fresh;

/// Says everything twice; the copy waits in the port until it is read. Replies are numbered.
struct Twice<T> {
    unread: VecDeque<T>,
    asked: u8,
}

impl<T> Twice<T> {
    fn new() -> Box<Fresh<Self>> {
        Box::new(Fresh(Twice { unread: VecDeque::new(), asked: 0 }))
    }
}

impl<T: Send> Link for Twice<T> {}

impl CanLink for Twice<CanFrame> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.asked += 1;
        let reply = CanFrame::new(0x141, [frame.data()[0], 0, 0, 0, 0, 0, 0, self.asked]);
        self.unread.extend([reply, reply]);
        Ok(())
    }

    fn receive(&mut self, _timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        Ok(self.unread.pop_front())
    }
}

impl ByteLink for Twice<Vec<u8>> {
    fn write(&mut self, _bytes: &[u8]) -> Result<(), PortError> {
        self.asked += 1;
        let reply = vec![0xF0, 0x01, self.asked, 0xF1 + self.asked];
        self.unread.extend([reply.clone(), reply]);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let Some(bytes) = self.unread.pop_front() else {
            std::thread::sleep(timeout.unwrap_or_default());
            return Ok(0);
        };
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

#[test]
fn a_copy_of_a_reply_is_not_taken_for_the_next_one_however_soon_that_is_asked() {
    let bus = rmd::Client::over("twice", Twice::<CanFrame>::new(), rmd::Options::default());
    for number in 1..=3 {
        let reply = bus.raw(MotorId::new(1).unwrap(), [0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        assert_eq!(reply[7], number);
    }
}

#[test]
fn a_copy_of_a_reply_that_comes_in_a_pause_is_not_the_answer_to_the_next_question() {
    let options = st::Options {
        timeout: Duration::from_millis(20),
        quiet: Duration::from_millis(5),
        ..st::Options::default()
    };
    let client = st::Client::over("twice", Twice::<Vec<u8>>::new(), options);
    let ask = || client.motor(1).unwrap().get(register::CONTROL_MODE);
    assert_eq!(ask().unwrap(), 1);
    // Long for bytes, short for a program.
    std::thread::sleep(Duration::from_millis(2));
    assert!(!matches!(ask(), Ok(1)), "that is the copy");
}

/// A motor that misses the first request; what else it is asked it repeats, with another last byte.
#[derive(Default)]
struct Absent(u32, Vec<CanFrame>);

impl Link for Absent {}

impl CanLink for Absent {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        if self.0 > 0 {
            self.1.push(CanFrame::new(0x141, [frame.data()[0], 0, 0, 0, 0, 0, 0, 1]));
        }
        self.0 += 1;
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        if self.1.is_empty() {
            std::thread::sleep(timeout.unwrap_or_default());
        }
        Ok(self.1.pop())
    }
}

#[test]
fn the_answer_of_a_motor_in_doubt_is_nobodys_reply() {
    let ms = Duration::from_millis;
    let options = rmd::Options { timeout: ms(5), quarantine: ms(5), ..rmd::Options::default() };
    let bus = rmd::Client::over("absent", Box::new(Fresh(Absent::default())), options);
    let id = MotorId::new(1).unwrap();
    assert!(matches!(bus.raw(id, [0x9C, 0, 0, 0, 0, 0, 0, 0]), Err(rmd::Error::Timeout { .. })));
    std::thread::sleep(ms(20));
    let mut outcomes = Vec::new();
    let requests = [0x9C, 0x92].map(|code| (id, [code, 0, 0, 0, 0, 0, 0, 0]));
    bus.cycle(&requests, |_, result| outcomes.push(result)).unwrap();
    assert!(
        matches!(outcomes[..], [Err(rmd::Error::Twice(_)), Err(rmd::Error::Quarantined { .. })]),
        "{outcomes:?}"
    );
    assert_eq!(bus.raw(id, requests[0].1).unwrap()[0], 0x9C);
}
