//! Both ends of ST MCP behind embedded-io, on a simulated line and a virtual clock.

use crate::uart::{Uart, line};
use embedded_io::{ErrorKind, Write};
use motorlink_embedded::st::{Event, MasterPort, SlavePort};
use motorlink_proto::st::{
    Command, ErrorCode, ExchangeError, Master, MasterConfig, Profile, Ramp, RegisterId, Request,
    Slave,
};
use motorlink_proto::time::Instant;
use motorlink_sim::st::{StDrive, StMotor};

struct Pair {
    now: Instant,
    master: MasterPort<Uart>,
    slave: SlavePort<Uart>,
    drive: StDrive<[StMotor; 2]>,
}

impl Pair {
    fn new() -> Self {
        let mut bench = Pair::opened();
        bench.master.master_mut().trust_line();
        bench
    }

    /// On a line where a former master may have sent requests.
    fn opened() -> Self {
        let (ours, theirs) = line();
        let drive = StDrive::demo(Instant(0));
        let slave = Slave::new(Profile::Spec, drive.last());
        let master = Master::new(MasterConfig::default());
        Pair {
            now: Instant(0),
            master: MasterPort::new(ours, master),
            slave: SlavePort::new(theirs, slave),
            drive,
        }
    }

    fn serve(&mut self) -> Option<Instant> {
        loop {
            match self.slave.poll(self.now, &mut self.drive).expect("nothing was lost") {
                Some(at) if at <= self.now => {}
                next => return next,
            }
        }
    }

    /// Runs both ends until the exchange is over. Time advances when both wait.
    fn exchange(&mut self) -> Result<Vec<u8>, ExchangeError> {
        loop {
            let served = self.serve();
            match self.master.poll(self.now).expect("nothing was lost") {
                Event::Done(result) => return result.map(<[u8]>::to_vec),
                Event::Wait(next) => {
                    let next = next.into_iter().chain(served).min();
                    self.now = self.now.max(next.expect("an exchange is under way"));
                }
            }
        }
    }

    fn ask(&mut self, request: Request<'_>) -> Result<Vec<u8>, ExchangeError> {
        self.master.master_mut().request(1, &request).expect("the last exchange is over");
        self.exchange()
    }

    /// Takes the bytes that the slave has sent.
    fn sent(&mut self) -> Vec<u8> {
        let mut sent = self.master.uart_mut().received.borrow_mut();
        sent.drain(..).map(|byte| byte.expect("a byte")).collect()
    }
}

#[test]
fn a_master_behind_one_uart_commands_a_drive_behind_another() {
    let mut bench = Pair::new();
    assert_eq!(bench.ask(Request::SetRamp(Ramp { speed_rpm: 1200, duration_ms: 0 })), Ok(vec![]));
    let reference = bench.ask(Request::GetRegister(RegisterId::RAMP_FINAL_SPEED));
    assert_eq!(reference, Ok(1200_i32.to_le_bytes().to_vec()));
    assert_eq!(bench.ask(Request::GetBoardInfo).map(|info| info.len()), Ok(32));
    let unknown = bench.ask(Request::GetRegister(RegisterId(0xEE)));
    assert_eq!(unknown, Err(ExchangeError::Refused(ErrorCode::GetWriteOnly)));
    assert_eq!(bench.now, Instant(0), "no wait was needed");
}

#[test]
fn a_stop_on_a_just_opened_line_is_sent_at_once_and_again_after_two_silences() {
    let mut bench = Pair::opened();
    let stop = Request::ExecuteCommand(Command::StopMotor);
    bench.master.master_mut().request(1, &stop).unwrap();
    bench.master.poll(bench.now).expect("sent");
    let frame = [0x23, 0x01, 0x02, 0x26].map(Ok);
    assert_eq!(*bench.slave.uart_mut().received.borrow(), frame);
    assert_eq!(bench.exchange(), Ok(vec![]), "acknowledged after the recovery");
    let quiet = MasterConfig::default().quiet;
    assert_eq!(bench.now, Instant(0) + quiet + quiet);
}

#[test]
fn an_incomplete_command_is_answered_after_its_timeout() {
    let mut bench = Pair::new();
    assert_eq!(bench.serve(), None, "an idle line waits only for bytes");
    bench.master.uart_mut().write_all(&[0x22, 0x01]).unwrap();
    let deadline = bench.serve().expect("a command is under way");
    assert_eq!(deadline, Instant(25_000));
    assert_eq!(bench.sent(), []);
    bench.now = deadline;
    assert_eq!(bench.serve(), None);
    assert_eq!(bench.sent(), [0xFF, 0x01, 0x09, 0x0A]);
}

#[test]
fn lost_bytes_are_answered_with_overrun_and_the_next_command_is_executed() {
    let mut bench = Pair::new();
    bench.master.uart_mut().write_all(&[0x22, 0x01]).unwrap();
    bench.serve();
    bench.slave.uart_mut().received.borrow_mut().push_back(Err(ErrorKind::Other));
    assert_eq!(bench.slave.poll(bench.now, &mut bench.drive), Err(ErrorKind::Other));
    assert_eq!(bench.sent(), [0xFF, 0x01, 0x08, 0x09]);
    assert_eq!(bench.ask(Request::GetBoardInfo).map(|info| info.len()), Ok(32));
}

#[test]
fn a_call_does_a_bounded_amount_of_work_on_a_line_full_of_garbage() {
    let mut bench = Pair::new();
    bench.slave.uart_mut().received.borrow_mut().extend([Ok(0xA5); 1000]);
    assert_eq!(bench.slave.poll(bench.now, &mut bench.drive), Ok(Some(bench.now)));
    assert_eq!(bench.slave.uart_mut().received.borrow().len(), 1000 - 32);
}

#[test]
fn lost_bytes_of_a_reply_end_the_exchange_but_not_the_port() {
    let mut bench = Pair::new();
    bench.master.master_mut().request(1, &Request::GetBoardInfo).unwrap();
    bench.master.poll(bench.now).expect("sent");
    bench.master.uart_mut().received.borrow_mut().push_back(Err(ErrorKind::Other));
    assert_eq!(bench.master.poll(bench.now), Err(ErrorKind::Other));
    bench.serve();
    bench.master.uart_mut().received.borrow_mut().drain(..10);
    assert!(bench.exchange().is_err(), "a partial reply is not a reply");
    assert_eq!(bench.ask(Request::GetBoardInfo).map(|info| info.len()), Ok(32));
}
