//! Ports of every kind, served and opened in one process.

mod running;

use std::cell::RefCell;
use std::error::Error;
use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use motorlink_link::port::{
    ByteLink, CanLink, Direction, FdLink, PortError, PortName, SlcanLink, Tap,
};
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Server, Station};
use motorlink_link::slcan::Bitrate;
use motorlink_proto::time::Instant;
use running::{Echo, Late, Place, Running, reply_of, request};
use rustix::pty::{OpenptFlags, openpt, ptsname};

type Outcome = Result<(), Box<dyn Error>>;

/// Timeout of all waits here.
const PATIENCE: Option<Duration> = Some(Duration::from_secs(5));
/// Long enough to see that nothing comes.
const BRIEFLY: Option<Duration> = Some(Duration::from_millis(30));

fn open_line(name: &str) -> Result<Box<dyn ByteLink>, Box<dyn Error>> {
    Ok(name.parse::<PortName>()?.open_bytes()?)
}

fn open_can(name: &str) -> Result<Box<dyn CanLink>, Box<dyn Error>> {
    Ok(name.parse::<PortName>()?.open_can()?)
}

fn refusal(name: &str) -> PortError {
    match name.parse::<PortName>().expect("a good name").open_bytes() {
        Ok(_) => panic!("{name} was opened"),
        Err(error) => error,
    }
}

/// Reads exactly `len` bytes.
fn gather(link: &mut dyn ByteLink, len: usize) -> Result<Vec<u8>, PortError> {
    let mut bytes = vec![0; len];
    let mut filled = 0;
    while filled < len {
        match link.read(&mut bytes[filled..], PATIENCE)? {
            0 => break,
            more => filled += more,
        }
    }
    bytes.truncate(filled);
    Ok(bytes)
}

#[test]
fn a_pty_transmits_every_byte_for_one_client_after_the_other() -> Outcome {
    let place = Place::new("pty");
    let server = Running::bytes(&place.as_port("pty"))?;
    assert_eq!(server.served.port, place.as_port("pty"));
    assert_eq!(fs::read_link(&place.0)?, PathBuf::from(&server.served.path));

    let all: Vec<u8> = (0..=255).collect();
    for _ in 0..2 {
        let mut line = open_line(&place.as_port("serial"))?;
        line.write(&all)?;
        assert_eq!(gather(&mut *line, all.len())?, all);
        assert_eq!(line.read(&mut [0; 8], BRIEFLY)?, 0);
    }
    drop(server);
    assert!(!place.0.exists(), "the link goes with the server");
    Ok(())
}

#[test]
fn bytes_that_one_client_left_unread_are_not_shown_to_the_next() -> Outcome {
    let place = Place::new("unread");
    let name: ServeName = place.as_port("pty").parse()?;
    let mut server = Server::new();
    server.serve_bytes(&name, Box::new(Echo))?;
    // A program that neither configures the line nor drops bytes.
    let plain = || OpenOptions::new().read(true).write(true).open(&place.0);
    let mut seen = [0; 3];
    for words in [b"new", b"two"] {
        let mut former = plain()?;
        former.write_all(b"old")?;
        server.turn(Duration::ZERO, None)?;
        former.read_exact(&mut seen[..1])?;
        drop(former);
        server.turn(Duration::ZERO, None)?;

        let mut next = plain()?;
        next.write_all(words)?;
        server.turn(Duration::ZERO, None)?;
        next.read_exact(&mut seen)?;
        assert_eq!(&seen, words);
    }
    Ok(())
}

/// A client that opens a pty and sends one request during a turn of the server.
struct Caller {
    pty: PathBuf,
    line: Rc<RefCell<Option<File>>>,
}

impl Station<u8> for Caller {
    fn receive(&mut self, _: Instant, _: &[u8], _: &mut Vec<u8>) {}
    fn poll(&mut self, _: Instant, _: &mut Vec<u8>) {
        let mut line = OpenOptions::new().read(true).write(true).open(&self.pty).expect("opened");
        line.write_all(b"hello").expect("written");
        *self.line.borrow_mut() = Some(line);
    }
    fn deadline(&self) -> Option<Instant> {
        self.line.borrow().is_none().then_some(Instant(0))
    }
}

#[test]
fn a_client_that_connects_during_a_turn_gets_its_reply() -> Outcome {
    let (calling, called) = (Place::new("calling"), Place::new("called"));
    let mut server = Server::new();
    let line = Rc::new(RefCell::new(None));
    let caller = Caller { pty: called.0.clone(), line: Rc::clone(&line) };
    server.serve_bytes(&calling.as_port("pty").parse()?, Box::new(caller))?;
    server.serve_bytes(&called.as_port("pty").parse()?, Box::new(Echo))?;
    for _ in 0..3 {
        server.turn(Duration::ZERO, None)?;
    }
    let mut line = FdLink::new(line.take().ok_or("it called")?, "plain")?;
    assert_eq!(gather(&mut line, 5)?, b"hello");
    Ok(())
}

#[test]
fn a_pty_has_one_owner_and_ends_with_its_server() -> Outcome {
    let place = Place::new("owner");
    let server = Running::bytes(&place.as_port("pty"))?;
    let mut line = open_line(&place.as_port("serial"))?;
    let second = refusal(&place.as_port("serial"));
    assert!(matches!(second, PortError::Busy(..)), "{second}");

    drop(server);
    let lost = line.read(&mut [0; 8], PATIENCE).expect_err("the server is gone");
    assert!(matches!(lost, PortError::Closed(..)), "{lost}");
    let lost = line.write(&[1]).expect_err("the server is gone");
    assert!(matches!(lost, PortError::Closed(..)), "{lost}");
    Ok(())
}

#[test]
fn a_link_is_replaced_and_a_file_is_not() -> Outcome {
    let place = Place::new("link");
    symlink("/dev/pts/does-not-exist", &place.0)?;
    drop(Running::bytes(&place.as_port("pty"))?);

    fs::write(&place.0, "precious")?;
    let error = Running::bytes(&place.as_port("pty")).err().ok_or("a file was replaced")?;
    assert!(error.to_string().contains("is not a link to a pty"), "{error}");
    assert_eq!(fs::read_to_string(&place.0)?, "precious");
    Ok(())
}

#[test]
fn a_link_of_a_killed_server_is_replaced_when_its_pty_number_is_reused() -> Outcome {
    let place = Place::new("reused");
    let pty = || openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY);
    let name = loop {
        let former = pty()?;
        let name = PathBuf::from(ptsname(&former, Vec::new())?.to_str()?);
        symlink(&name, &place.0)?;
        drop(former);
        // The clock of the file system must have advanced.
        std::thread::sleep(Duration::from_millis(50));
        if !name.exists() {
            break name;
        }
        // If another program got the number too soon, the owners cannot be distinguished.
        std::fs::remove_file(&place.0)?;
    };
    let mut others = vec![pty()?];
    while !name.exists() {
        others.push(pty()?);
    }
    drop(Running::bytes(&place.as_port("pty"))?);
    Ok(())
}

#[test]
fn a_station_is_polled_at_its_deadline() -> Outcome {
    let name: ServeName = "tcp-listen:127.0.0.1:0".parse()?;
    let server =
        Running::start(move |server| server.serve_bytes(&name, Box::new(Late::default())))?;
    let mut line = open_line(&format!("tcp:{}", server.served.path))?;
    line.write(&[1])?;
    assert_eq!(gather(&mut *line, 1)?, [0x55]);
    Ok(())
}

#[test]
fn a_tcp_line_has_one_client_and_takes_the_next_when_it_left() -> Outcome {
    let server = Running::bytes("tcp-listen:127.0.0.1:0")?;
    let port = format!("tcp:{}", server.served.path);
    for _ in 0..3 {
        let mut line = open_line(&port)?;
        line.write(b"hello")?;
        assert_eq!(gather(&mut *line, 5)?, b"hello");
        let mut second = open_line(&port)?;
        let closed = second.read(&mut [0; 8], PATIENCE).expect_err("one client at a time");
        assert!(matches!(closed, PortError::Closed(..)), "{closed}");
    }
    let mut line = open_line(&port)?;
    drop(server);
    let lost = line.read(&mut [0; 8], PATIENCE).expect_err("the server is gone");
    assert!(matches!(lost, PortError::Closed(..)), "{lost}");
    Ok(())
}

#[test]
fn a_client_that_does_not_read_does_not_delay_others() -> Outcome {
    let place = Place::new("flood");
    let name: ServeName = place.as_port("pty").parse()?;
    let mut server = Server::new();
    server.serve_bytes(&name, Box::new(Echo))?;
    let mut line = open_line(&place.as_port("serial"))?;
    while server.dropped() == 0 {
        line.write(&[0x55; 1024])?;
        server.turn(Duration::ZERO, None)?;
    }
    Ok(())
}

#[test]
fn slcan_on_a_pty_is_a_can_bus() -> Outcome {
    let place = Place::new("slcan");
    let _server = Running::can(&place.as_port("slcan-pty"))?;
    for _ in 0..2 {
        let mut bus = open_can(&place.as_port("slcan"))?;
        for number in 0..20 {
            bus.send(&request(number))?;
        }
        for number in 0..20 {
            assert_eq!(bus.receive(PATIENCE)?, Some(reply_of(&request(number))));
        }
        assert_eq!(bus.receive(BRIEFLY)?, None);
    }
    Ok(())
}

#[test]
fn slcan_over_tcp_is_one_bus_for_all_clients() -> Outcome {
    let server = Running::can("tcp-listen:127.0.0.1:0")?;
    let port = format!("slcan:tcp:{}", server.served.path);
    let mut bus = open_can(&port)?;
    let mut neighbour = open_can(&port)?;
    bus.send(&request(1))?;
    assert_eq!(bus.receive(PATIENCE)?, Some(reply_of(&request(1))), "no echo");
    assert_eq!(neighbour.receive(PATIENCE)?, Some(request(1)));
    assert_eq!(neighbour.receive(PATIENCE)?, Some(reply_of(&request(1))));
    Ok(())
}

#[test]
fn a_device_that_is_not_an_slcan_adapter_is_reported() -> Outcome {
    // An echo, as from a modem or a console.
    let server = Running::bytes("tcp-listen:127.0.0.1:0")?;
    let error = open_can(&format!("slcan:tcp:{}", server.served.path)).err().ok_or("opened")?;
    assert!(error.to_string().contains("does not answer like an slcan adapter"), "{error}");

    // An adapter may be silent. Bytes without a line end, and BEL, are not from an adapter.
    for (answer, is_adapter) in [(&b""[..], true), (b"\r\r\r\r", true), (b"\x07\x07\r\r", true)] {
        assert_eq!(answer_opening(answer)?.is_ok(), is_adapter, "{answer:?}");
    }
    for answer in [&b"\xFF\x01\x0E\x0E"[..], b"\x07\x07\x07\x07", b"$GPGGA,1\r\n$GPGGA,2\r\n"] {
        let error = answer_opening(answer)?.expect_err("no adapter");
        assert!(matches!(error, PortError::NotSlcan { .. }), "{answer:?}: {error}");
    }
    let error = answer_opening(b"\r\r\x07\r")?.expect_err("no such bitrate");
    assert!(error.to_string().contains("refuses 1000000 bit/s"), "{error}");
    Ok(())
}

/// Opens an adapter that has already sent all its answers.
fn answer_opening(answer: &[u8]) -> Result<Result<SlcanLink<FdLink>, PortError>, Box<dyn Error>> {
    let (mut adapter, ours) = UnixStream::pair()?;
    adapter.write_all(answer)?;
    let opened = SlcanLink::open(FdLink::new(ours, "adapter")?, "adapter", Bitrate::DEFAULT);
    let mut said = [0; 8];
    adapter.read_exact(&mut said)?;
    assert_eq!(&said, b"\rC\rS8\rO\r");
    Ok(opened)
}

#[test]
fn a_tap_sees_what_passes_in_both_directions() -> Outcome {
    let server = Running::bytes("tcp-listen:127.0.0.1:0")?;
    let seen = Arc::new(Mutex::new(Vec::new()));
    let log = seen.clone();
    let mut line = Tap::bytes(
        open_line(&format!("tcp:{}", server.served.path))?,
        move |direction, at: Duration, bytes: &[u8]| {
            log.lock().expect("no panic before").push((direction, at, bytes.to_vec()));
        },
    );
    line.write(&[1, 2])?;
    assert_eq!(gather(&mut line, 2)?, [1, 2]);
    assert_eq!(line.read(&mut [0; 8], BRIEFLY)?, 0);
    let seen = seen.lock().expect("no panic before");
    let directions: Vec<_> = seen.iter().map(|(direction, ..)| *direction).collect();
    assert_eq!(directions, [Direction::Sent, Direction::Received]);
    assert!(seen.iter().all(|(.., bytes)| bytes == &[1, 2]));
    assert!(seen.is_sorted_by_key(|(_, at, _)| *at));

    let place = Place::new("tap");
    let _server = Running::can(&place.as_port("slcan-pty"))?;
    let mut frames = Vec::new();
    let mut bus = Tap::frames(open_can(&place.as_port("slcan"))?, |direction, _, frame: &_| {
        frames.push((direction, *frame));
    });
    bus.send(&request(7))?;
    bus.receive(PATIENCE)?;
    drop(bus);
    let expected = [(Direction::Sent, request(7)), (Direction::Received, reply_of(&request(7)))];
    assert_eq!(frames, expected);
    Ok(())
}

#[test]
fn a_port_that_cannot_be_opened_reports_the_reason() -> Outcome {
    let closed = TcpListener::bind("127.0.0.1:0")?.local_addr()?;
    for (name, says) in [
        ("/dev/ttyNONE0", "there is no `/dev/ttyNONE0`: is it plugged in?"),
        ("/dev", "`/dev` is not a serial device"),
        ("/dev/null", "`/dev/null` is not a serial device"),
        (&format!("tcp:{closed}"), "refuses the connection"),
        ("tcp:no..host:1", "cannot find the host"),
        ("socketcan:can0", "cannot be used as a serial line"),
    ] {
        let message = refusal(name).to_string();
        assert!(message.contains(says), "{name}: {message}");
    }
    let error = open_can("/dev/ttyNONE0").err().ok_or("opened")?;
    assert!(error.to_string().contains("cannot be used as a CAN bus"), "{error}");
    let error = Running::can("pty:./never").err().ok_or("served")?;
    assert!(error.to_string().contains("use slcan-pty:PATH"), "{error}");
    let error = Running::bytes("socketcan:nocan9").err().ok_or("served")?;
    assert!(error.to_string().contains("cannot be used as a serial line"), "{error}");
    let error = Running::can("socketcan:nocan9").err().ok_or("served")?.to_string();
    assert!(
        error.contains("there is no CAN interface `nocan9`") || error.contains("no CAN support"),
        "{error}"
    );

    let taken = TcpListener::bind("127.0.0.1:0")?;
    let error = Running::bytes(&format!("tcp-listen:{}", taken.local_addr()?)).err();
    assert!(error.ok_or("served")?.to_string().contains("is taken by another program"));
    Ok(())
}
