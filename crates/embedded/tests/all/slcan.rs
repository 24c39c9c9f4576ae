//! A drive behind a UART that speaks slcan.

use crate::uart::{Uart, line};
use embedded_can::Frame as _;
use embedded_io::{ErrorKind, Write};
use motorlink_embedded::rmd::{DrivePort, from_can, to_can};
use motorlink_embedded::slcan::{Adapter, Error, Frame};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Drive, DriveConfig, MotorId};
use motorlink_proto::time::Instant;
use motorlink_sim::rmd::{RmdConfig, RmdMotor};

struct Pair {
    host: Uart,
    port: DrivePort<Adapter<Uart>, 1>,
    motors: [RmdMotor; 1],
}

impl Pair {
    fn new() -> Self {
        let (host, board) = line();
        let config = RmdConfig::default();
        let id = MotorId::new(config.id).expect("ID 1");
        let drive = Drive::new(DriveConfig::new(id), config.factory_rom());
        let mut motors = [RmdMotor::new(config).expect("a preset")];
        let mut port = DrivePort::new(Adapter::new(board), [drive]);
        port.power_on(Instant(0), &mut motors);
        Pair { host, port, motors }
    }

    fn say(&mut self, text: &str) {
        self.host.write_all(text.as_bytes()).unwrap();
    }

    fn serve(&mut self) -> Result<(), Error<ErrorKind>> {
        for _ in 0..20 {
            self.port.poll(Instant(0), &mut self.motors)?;
        }
        Ok(())
    }

    fn heard(&mut self) -> String {
        let mut heard = self.host.received.borrow_mut();
        heard.drain(..).map(|byte| char::from(byte.expect("a byte"))).collect()
    }
}

#[test]
fn a_host_opens_the_channel_and_gets_a_reply() {
    let mut bench = Pair::new();
    bench.say("t14189C00000000000000\r");
    bench.serve().unwrap();
    assert_eq!(bench.heard(), "\u{7}", "the channel is closed");
    bench.say("S8\rO\rt14189200000000000000\rt1418FF00000000000000\r");
    bench.serve().unwrap();
    assert_eq!(bench.heard(), "\r\rz\rt14189200000000000000\rz\r");
    bench.say("Z1\rt14189200000000000000\r");
    bench.port.can_mut().set_time(Instant(59_000_000));
    bench.serve().unwrap();
    assert_eq!(bench.heard(), "\rz\rt14189200000000000000E678\r");
}

#[test]
fn a_line_with_lost_bytes_is_refused_and_the_next_is_read() {
    let mut bench = Pair::new();
    bench.say("O\rt14188");
    bench.serve().unwrap();
    assert_eq!(bench.heard(), "\r");
    bench.port.can_mut().uart_mut().received.borrow_mut().push_back(Err(ErrorKind::Other));
    assert_eq!(bench.serve(), Err(Error(ErrorKind::Other)));
    bench.say("000000000000000\rt14189200000000000000\r");
    bench.serve().unwrap();
    assert_eq!(bench.heard(), "\u{7}z\rt14189200000000000000\r");
}

#[test]
fn frames_are_converted_from_and_to_the_protocol() {
    for frame in [
        CanFrame::new(0x141, [1, 2, 3, 4, 5, 6, 7, 8]),
        CanFrame::data_frame(0x1ABC_DEF0, true, &[1, 2, 3]),
        CanFrame::remote_frame(0x7FF, false, 8),
        CanFrame::remote_frame(0x1FFF_FFFF, true, 0),
    ] {
        let taken: Frame = to_can(&frame).expect("every frame");
        assert_eq!((taken.0, from_can(&taken)), (frame, frame));
    }
    assert_eq!(Frame::new(Frame(CanFrame::new(1, [0; 8])).id(), &[0; 9]), None);
}
