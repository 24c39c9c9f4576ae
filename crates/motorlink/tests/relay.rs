//! The relay behind `motorlink guard`, without a process of its own.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::served::Served;
use motorlink::relay::{Event, Part, Reason, Relay, RelayError, RelayOptions};
use motorlink::rmd::StopAction;
use motorlink::st::{Client, Options, Status};

const START: [u8; 4] = [0x23, 0x01, 0x01, 0x25];
const ACK: [u8; 3] = [0xF0, 0x00, 0xF0];

/// A relay on a drive, and where it is served.
fn relay(drives: &Served, options: RelayOptions) -> (Relay, String) {
    let mut relay = Relay::st(&drives.st.parse().expect("a port"), options).expect("opened");
    let served = relay.serve(&"tcp-listen:127.0.0.1:0".parse().expect("a name")).expect("served");
    (relay, served.path)
}

/// Turns until the last event is as wanted; gives all.
fn turn_until(relay: &mut Relay, wanted: impl Fn(&Event) -> bool) -> Vec<Event> {
    let give_up = Instant::now() + Duration::from_secs(20);
    let mut events = Vec::new();
    while !events.last().is_some_and(&wanted) {
        assert!(Instant::now() < give_up, "{events:?}");
        events.extend(relay.turn(Duration::from_millis(10)).expect("a turn"));
    }
    events
}

/// Starts motor 1 through the relay.
fn start(relay: &mut Relay, address: &str) -> TcpStream {
    let mut client = TcpStream::connect(address).expect("connected");
    client.write_all(&START).expect("written");
    client.set_nonblocking(true).expect("set");
    let (mut reply, mut read) = ([0; 3], 0);
    let give_up = Instant::now() + Duration::from_secs(20);
    while read < reply.len() {
        assert!(Instant::now() < give_up);
        relay.turn(Duration::from_millis(1)).expect("a turn");
        read += client.read(&mut reply[read..]).unwrap_or(0);
    }
    assert_eq!(reply, ACK);
    client
}

fn has_stopped(event: &Event, wanted: Reason) -> bool {
    let Event::Stopped { reason, halts } = event else { return false };
    assert_eq!(*reason, wanted);
    assert!(halts.iter().all(|halt| halt.is_stopped()), "{halts:?}");
    halts.iter().map(|halt| halt.part).eq([Part::Motor(1)])
}

#[test]
fn the_motor_is_stopped_when_its_client_leaves() {
    let drives = Served::new("relay-leaves");
    let (mut relay, address) = relay(&drives, RelayOptions::default());
    for _ in 0..2 {
        drop(start(&mut relay, &address));
        let events = turn_until(&mut relay, |event| has_stopped(event, Reason::ClientGone));
        assert!(
            matches!(events[..], [Event::Left { dropped: 0 }, Event::Stopped { .. }]),
            "{events:?}"
        );
    }
    assert!(relay.end().is_empty(), "nothing is left to stop");
}

/// Until something tells which motor is the current one, number 0 may be any of seven.
#[test]
fn motors_that_the_drive_lacks_keep_nobody_out() {
    let drives = Served::new("relay-lacks");
    let (mut relay, address) = relay(&drives, RelayOptions::default());
    let mut client = TcpStream::connect(&address).expect("connected");
    client.write_all(&[0x03, 0x01, 0x01, 0x05]).expect("written");
    turn_until(&mut relay, |event| matches!(event, Event::Came { .. }));
    drop(client);
    let events = turn_until(&mut relay, |event| matches!(event, Event::Stopped { .. }));
    let Some(Event::Stopped { halts, .. }) = events.last() else { unreachable!() };
    assert!(halts.iter().all(|halt| halt.is_stopped()), "{halts:?}");
    drop(start(&mut relay, &address));
    turn_until(&mut relay, |event| has_stopped(event, Reason::ClientGone));
    assert!(relay.end().is_empty(), "nothing is left to stop");
}

#[test]
fn the_motor_is_stopped_when_its_client_is_silent() {
    let drives = Served::new("relay-silent");
    // The reply of the drive comes within it, also on a busy machine.
    let options = RelayOptions { silence: Some(Duration::from_secs(2)) };
    let (mut relay, address) = relay(&drives, options);
    let mut silent = start(&mut relay, &address);
    turn_until(&mut relay, |event| has_stopped(event, Reason::ClientSilent));
    // A START that it sends too late is dropped with its connection.
    silent.write_all(&START).expect("the kernel takes it");
    turn_until(&mut relay, |event| matches!(event, Event::Disconnected));
    silent.set_nonblocking(false).expect("set");
    assert_eq!(silent.read(&mut [0; 8]).unwrap_or(0), 0, "closed or reset");
    let events = relay.turn(Duration::from_millis(50)).expect("a turn");
    assert!(events.is_empty(), "{events:?}");
    let mut next = TcpStream::connect(&address).expect("connected");
    next.write_all(&START).expect("written");
    turn_until(&mut relay, |event| matches!(event, Event::Resumed));
    drop(next);
    turn_until(&mut relay, |event| has_stopped(event, Reason::ClientGone));
    assert!(relay.end().is_empty(), "nothing is left to stop");
}

#[test]
fn the_motor_is_stopped_when_the_relay_ends() {
    let drives = Served::new("relay-ends");
    let (mut relay, address) = relay(&drives, RelayOptions::default());
    let _client = start(&mut relay, &address);
    let last = relay.end();
    assert!(last.iter().any(|event| has_stopped(event, Reason::Ending)), "{last:?}");
}

#[test]
fn the_motor_is_stopped_when_the_relay_is_dropped_in_a_panic() {
    let drives = Served::new("relay-panics");
    let (mut relay, address) = relay(&drives, RelayOptions::default());
    let _client = start(&mut relay, &address);
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(move || {
        let _relay = relay;
        panic!("as programs do");
    }));
    assert!(panicked.is_err());
    let client = Client::open(&drives.st.parse().expect("a port"), Options::default());
    let client = client.expect("the relay has let go of the port");
    let motor = client.motor(1).expect("a motor");
    // A rotor that turned already has to come to rest first.
    let give_up = Instant::now() + Duration::from_secs(20);
    loop {
        let status = motor.status().expect("an answer");
        let stops = [Status::AnyStop, Status::Stop, Status::WaitStopMotor, Status::StopIdle];
        if status == Status::Idle {
            break;
        }
        assert!(stops.contains(&status) && Instant::now() < give_up, "{status}");
    }
}

#[test]
fn a_second_client_is_closed_and_told_of() {
    let drives = Served::new("relay-second");
    let (mut relay, address) = relay(&drives, RelayOptions::default());
    let _client = start(&mut relay, &address);
    let mut second = TcpStream::connect(&address).expect("the kernel takes it");
    turn_until(&mut relay, |event| matches!(event, Event::TurnedAway { .. }));
    assert_eq!(second.read(&mut [0; 8]).expect("closed in order"), 0);
}

#[test]
fn a_port_of_the_other_kind_and_drives_within_the_process_are_refused() {
    use motorlink::port::PortError::{NotFound, WrongKind};
    let options = RelayOptions::default();
    let st = |name: &str| Relay::st(&name.parse().expect("a name"), options).err();
    let rmd =
        |name: &str| Relay::rmd(&name.parse().expect("a name"), StopAction::Off, options).err();
    assert!(matches!(st("slcan:/dev/ttyACM0"), Some(RelayError::Port(WrongKind { .. }))));
    assert!(matches!(st("socketcan:can0"), Some(RelayError::Port(WrongKind { .. }))));
    assert!(matches!(rmd("/dev/ttyACM0"), Some(RelayError::Port(WrongKind { .. }))));
    assert!(matches!(st("/dev/ttyNONE0"), Some(RelayError::Port(NotFound(..)))));
    assert!(matches!(rmd("slcan:/dev/ttyNONE0"), Some(RelayError::Port(NotFound(..)))));
    motorlink_testbench::register();
    for refused in [st("sim:"), rmd("sim:")] {
        assert!(matches!(refused, Some(RelayError::Simulated(_))));
    }
}
