//! A line of a share, with and without the frames that it keeps for views of the wire.

use std::collections::VecDeque;
use std::hint::black_box;
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use motorlink::port::{ByteLink, CanLink, EventBytes, EventCan, Evented, Link, PortError};
use motorlink::time::Instant as Moment;
use motorlink::time::Micros;
use motorlink::{rmd, st};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, MotorId};
use motorlink_proto::st::{MotorNumber, RegisterId, Request as StRequest, Slave};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::{Line, Request, RmdLine, StLine};
use motorlink_telemetry::share::wire::Tap;

use crate::line::Spread;
use crate::report::{Goal, Section};
use motorlink_kernels::exchange::{Memory, slave};
use motorlink_kernels::kernel::{Counter, Kernel, NOT_COUNTED};
use motorlink_kernels::result::Result;

/// Pairs of rounds.
const ROUNDS: usize = 200;
/// Exchanges in a round.
const EXCHANGES: u32 = 1_000;
const TIME_TO_LIVE: Micros = Micros::from_millis(1_000);

pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let counter = Counter::find();
    let rows = [ST, RMD].iter().map(|kind| kind.row(counter.as_ref())).collect::<Result<_>>()?;
    let section = Section {
        title: "A line of a share with and without the frames that are kept",
        note: format!(
            "\
- A share keeps the frames of each line for the [view of the wire](MONITOR.md#views). One operation:
  a command of a program, from the engine to the reply, with two frames. The drive only stores
  registers, the motor only replies. Without I/O, in user space.
- Instructions are counted by callgrind, without those of reading the clock. They depend on the time
  that passes, and vary by a few percent.
- *ratio*: time with the frames over time without them. {ROUNDS} rounds of {EXCHANGES} exchanges
  of each in turn, in one process. The median of neighbouring rounds."
        ),
        columns: vec!["exchange", "instructions without", "with", "more", "ratio, median"],
        rows,
    };
    Ok((vec![section], Vec::new()))
}

/// The line of each protocol, with and without a tap around it.
pub fn kernels() -> impl Iterator<Item = Kernel> {
    [ST, RMD].into_iter().flat_map(|kind| [false, true].map(|keeps| kind.kernel(keeps)))
}

/// An exchange that is measured.
#[derive(Clone, Copy)]
struct Kind {
    name: &'static str,
    /// The line, through a tap or not.
    line: fn(Option<&Tap>) -> Result<Box<dyn Line>>,
    request: fn() -> Request,
}

const ST: Kind = Kind {
    name: "ST, GET_REG",
    line: |tap| {
        let mut link: Box<dyn EventBytes> = Box::new(Wire::to_drive());
        if let Some(tap) = tap {
            link = tap.around_line(link);
        }
        let mut link = Some(link);
        let open = move || link.take().ok_or_else(|| PortError::NotFound("memory".to_owned()));
        let client = st::EventClient::open_with("memory", Box::new(open), st::Options::default())?;
        Ok(Box::new(StLine::new(client)))
    },
    request: || Request::st(1, StRequest::GetRegister(RegisterId::SPEED_MEAS)),
};

const RMD: Kind = Kind {
    name: "RMD, 0x9C",
    line: |tap| {
        let mut link: Box<dyn EventCan> = Box::new(Bus::default());
        if let Some(tap) = tap {
            link = tap.around_bus(link);
        }
        let client = rmd::EventClient::over("memory", link, rmd::Options::default());
        Ok(Box::new(RmdLine::new(client)))
    },
    request: || {
        let first = MotorId::new(1).expect("the first motor of a bus");
        Request::Rmd(first, [Code::ReadMotionStatus.number(), 0, 0, 0, 0, 0, 0, 0])
    },
};

impl Kind {
    fn kernel(self, keeps: bool) -> Kernel {
        let name = format!("{} {} frames", self.name, if keeps { "with" } else { "without" });
        let tap = keeps.then(Tap::default);
        let line = (self.line)(tap.as_ref()).expect("memory can be opened");
        let mut engine = Acquisition::new(line);
        let (by, request) = ("bench".into(), (self.request)());
        Kernel::new(name, move || {
            engine.command(&by, request.clone(), TIME_TO_LIVE).expect("nothing else waits");
            let mut reply = None;
            while reply.is_none() {
                engine.advance(&mut |_, ended| reply = Some(ended));
            }
            assert!(black_box(reply).is_some_and(|reply| reply.is_ok()), "an exchange failed");
        })
    }

    fn row(&self, counter: Option<&Counter>) -> Result<Vec<String>> {
        let [mut without, mut with] = [false, true].map(|keeps| self.kernel(keeps));
        let counts = match counter {
            Some(counter) => Some((counter.count(&without.name)?, counter.count(&with.name)?)),
            None => None,
        };
        without.repeat(EXCHANGES);
        with.repeat(EXCHANGES);
        let rounds = (0..ROUNDS).map(|_| {
            let without = time(&mut without);
            time(&mut with).div_duration_f64(without)
        });
        let ratio = Spread::of(rounds.collect());
        let figure = |of: fn((f64, f64)) -> f64| match counts {
            Some(counts) => format!("{:.0}", of(counts)),
            None => NOT_COUNTED.to_owned(),
        };
        Ok(vec![
            self.name.to_owned(),
            figure(|(without, _)| without),
            figure(|(_, with)| with),
            figure(|(without, with)| with - without),
            format!("{:.3}", ratio.median),
        ])
    }
}

fn time(kernel: &mut Kernel) -> Duration {
    let began = Instant::now();
    kernel.repeat(EXCHANGES);
    began.elapsed()
}

/// A serial line to a drive that replies at once.
struct Wire {
    slave: Slave,
    drive: Memory,
    reply: Vec<u8>,
}

impl Wire {
    fn to_drive() -> Self {
        let (slave, drive) = (slave(MotorNumber::FIRST), Memory { registers: [1_500; 256] });
        Wire { slave, drive, reply: Vec::new() }
    }
}

impl Link for Wire {
    fn is_fresh(&self) -> bool {
        true
    }
}

impl ByteLink for Wire {
    fn write(&mut self, bytes: &[u8]) -> std::result::Result<(), PortError> {
        for &byte in bytes {
            let reply = self.slave.receive(Moment(0), byte, &mut self.drive);
            self.reply.extend_from_slice(reply.unwrap_or_default());
        }
        Ok(())
    }

    fn read(
        &mut self,
        buffer: &mut [u8],
        _: Option<Duration>,
    ) -> std::result::Result<usize, PortError> {
        let size = self.reply.len().min(buffer.len());
        buffer[..size].copy_from_slice(&self.reply[..size]);
        self.reply.drain(..size);
        Ok(size)
    }
}

/// A bus with motors that reply at once.
#[derive(Default)]
struct Bus(VecDeque<CanFrame>);

impl Link for Bus {
    fn is_fresh(&self) -> bool {
        true
    }
}

impl CanLink for Bus {
    fn send(&mut self, frame: &CanFrame) -> std::result::Result<(), PortError> {
        // A reply has the identifier and the code of its request.
        self.0.push_back(*frame);
        Ok(())
    }

    fn receive(&mut self, _: Option<Duration>) -> std::result::Result<Option<CanFrame>, PortError> {
        Ok(self.0.pop_front())
    }
}

macro_rules! is_there_at_once {
    ($($link:ty)+) => { $(
        impl Evented for $link {
            fn descriptor(&self) -> Option<BorrowedFd<'_>> {
                None
            }

            fn flush(&mut self) -> std::result::Result<bool, PortError> {
                Ok(false)
            }
        }
    )+ };
}

is_there_at_once!(Wire Bus);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_exchanges_again_and_again() {
        kernels().for_each(|mut kernel| kernel.repeat(3));
    }
}
