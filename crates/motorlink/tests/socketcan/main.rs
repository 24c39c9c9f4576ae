//! The port `socketcan:` in a kernel that has CAN: interfaces `can0` and `can1` on one bus, `vcan0`,
//! and `vcan1` for CAN FD. `make test-socketcan` boots such a kernel and runs each test on its own.

mod adapter;
mod peers;
#[path = "../served/mod.rs"]
mod served;

use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::list;
use motorlink::port::{CanLink, PortError, PortName};
use motorlink::rmd::{
    self, CentiDps, Client, Error, IqCommand, MotorSet, Pid, ScanResult, SetTorque4,
};
use motorlink::time::Instant;
use motorlink::{BackOff, LinkState};
use motorlink_link::serve::{Server, Station};
use socketcan::{
    CanDataFrame, CanFdFrame, CanFdSocket, CanRemoteFrame, EmbeddedFrame, ExtendedId, Socket,
    SocketOptions, StandardId,
};

use adapter::Adapter;
use peers::{Flood, ip, neighbour, report_error, until};
use served::Served;

/// Long enough for something that must not come.
const BRIEFLY: Option<Duration> = Some(Duration::from_millis(30));
const PATIENCE: Option<Duration> = Some(Duration::from_secs(5));

/// The request for temperature, voltage and errors.
const STATUS_1: [u8; 8] = [0x9A, 0, 0, 0, 0, 0, 0, 0];

/// A virtual machine may hold a motor up for longer than a motor would take.
fn bus(interface: &str) -> Client {
    bus_within(Duration::from_secs(5), interface)
}

/// A bus that soon takes a motor for silent.
fn hasty(interface: &str) -> Client {
    bus_within(Duration::from_millis(50), interface)
}

fn bus_within(timeout: Duration, interface: &str) -> Client {
    let ms = Duration::from_millis;
    let back_off = BackOff { first: ms(1), cap: ms(10) };
    let options = rmd::Options { timeout, quarantine: ms(1), back_off, ..rmd::Options::default() };
    Client::open(&port(interface), options).expect("the interface is up")
}

fn port(interface: &str) -> PortName {
    format!("socketcan:{interface}").parse().expect("a port")
}

fn open(interface: &str) -> Box<dyn CanLink> {
    port(interface).open_can().expect("the interface is up")
}

fn refusal(interface: &str) -> PortError {
    port(interface).open_can().err().expect("it cannot be opened")
}

/// Everything a host does, with simulated motors 1 to 4 at the other end.
fn drive(host: &str, drives: &str) {
    let mut motors = Served::on(drives, 4);
    let bus = bus(host);
    let mut found = Vec::new();
    bus.scan(MotorSet::TORQUE4, |motor| found.push(motor), |_| {}).expect("the port");
    assert_eq!(found.len(), 4);
    assert!(found.iter().all(|motor| matches!(motor, ScanResult::Motor(..))), "{found:?}");

    let motor = bus.motor(3).expect("1 to 32");
    assert!(motor.status().expect("an answer").voltage.volts() > 1.0);
    let gains = Pid { position_kp: 1, position_ki: 2, speed_kp: 3, ..motor.pid().expect("old") };
    motor.write_pid_ram(gains).expect("an answer");
    assert_eq!(motor.pid().expect("an answer"), gains);
    motor.set_speed(CentiDps(36_000)).expect("an answer");
    until("motor 3 turns with 360 °/s", || {
        (355..=365).contains(&motor.motion_status().expect("an answer").speed.0)
    });
    motor.off().expect("an answer");
    assert!(motors.state().contains("\"motor\":3,\"mode\":\"off\""));

    let torques = [100, -100, 0, 50].map(IqCommand);
    let replies = bus.set_torque4(SetTorque4(torques), MotorSet::TORQUE4).expect("the port");
    assert!(replies.iter().all(|reply| matches!(reply, Some(Ok(_)))), "{replies:?}");
    assert_eq!(motors.state().matches("\"mode\":\"torque\"").count(), 4);
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn motors_are_driven_across_two_cards_on_a_bus() {
    drive("can0", "can1");
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn motors_are_driven_on_an_interface_with_can_fd() {
    drive("vcan1", "vcan1");
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn cycles_over_32_motors_lose_nothing_across_two_cards() {
    let _motors = Served::on("can1", 32);
    let bus = bus("can0");
    let requests: Vec<_> = MotorSet::ALL.map(|id| (id, STATUS_1)).collect();
    for _ in 0..50 {
        let mut answered = MotorSet::EMPTY;
        bus.cycle(&requests, |id, outcome| {
            outcome.expect("an answer");
            answered.insert(id);
        })
        .expect("the port");
        assert_eq!(answered, MotorSet::ALL);
    }
    let counters = bus.counters();
    assert_eq!((counters.late, counters.unasked, counters.malformed), (0, 0, 0));
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn an_interface_that_cannot_be_opened_says_what_to_try() {
    ip("link set can0 down");
    ip("link set vcan0 down");
    for (interface, says) in [
        ("can0", "CAN interface `can0` is down: sudo ip link set can0 up type can bitrate 1000000"),
        ("vcan0", "CAN interface `vcan0` is down: sudo ip link set vcan0 up"),
        ("can7", "there is no CAN interface `can7`"),
        ("lo", "there is no CAN interface `lo`"),
    ] {
        assert_eq!(refusal(interface).to_string(), says);
    }
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn the_hosts_interface_goes_down_and_comes_back() {
    let _motors = Served::on("can1", 1);
    let bus = bus("can0");
    let motor = bus.motor(1).expect("1 to 32");
    motor.status().expect("an answer");
    ip("link set can0 down");
    let lost = motor.status().expect_err("the interface is down").to_string();
    assert!(lost.contains("`can0` is down: sudo ip link set can0 up type can"), "{lost}");
    for _ in 0..100 {
        assert_eq!(motor.status().expect_err("the interface is down").to_string(), lost);
    }
    assert!(matches!(bus.link_state(), LinkState::Closed { .. }));
    ip("link set can0 up");
    until("the motor answers again", || motor.status().is_ok());
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn an_exchange_ends_when_the_interface_goes_down_in_it() {
    let bus = bus("vcan0");
    let witness = neighbour("vcan0");
    let lost = std::thread::scope(|scope| {
        let exchange = scope.spawn(|| bus.motor(1).expect("1 to 32").status());
        witness.read_frame().expect("the request");
        ip("link set vcan0 down");
        exchange.join().expect("no panic").expect_err("nobody answers")
    });
    let Error::Port(lost) = lost else { panic!("not a failure of the port: {lost}") };
    assert_eq!(lost.to_string(), "CAN interface `vcan0` is down: sudo ip link set vcan0 up");
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn the_motors_interface_goes_down_and_comes_back() {
    let mut motors = Served::on("can1", 1);
    let bus = hasty("can0");
    let motor = bus.motor(1).expect("1 to 32");
    until("the motor turns", || motor.set_speed(CentiDps(36_000)).is_ok());
    ip("link set can1 down");
    assert!(matches!(motor.motion_status(), Err(Error::Timeout { .. })));
    ip("link set can1 up");
    until("the motor answers again", || motor.motion_status().is_ok());
    assert!(motors.state().contains("\"mode\":\"speed\""), "it went on turning");
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn an_interface_that_is_unplugged_is_told_and_used_when_it_is_back() {
    let plug = || {
        ip("link add vcan9 type vcan");
        ip("link set vcan9 up");
    };
    plug();
    let _motors = Served::on("vcan9", 1);
    let bus = hasty("vcan9");
    let motor = bus.motor(1).expect("1 to 32");
    until("the motor answers", || motor.status().is_ok());
    ip("link del vcan9");
    let lost = motor.status().expect_err("there is no interface").to_string();
    assert!(lost.contains("`vcan9`"), "{lost}");
    let mut gone = String::new();
    until("the next attempt says that it is gone", || {
        gone = motor.status().expect_err("there is no interface").to_string();
        gone.contains("there is no CAN interface `vcan9`")
    });
    plug();
    until("the motor answers again", || motor.status().is_ok());
    ip("link del vcan9");
}

/// The classes of error frames, each with a detail as drivers give it (linux/can/error.h).
const HARMLESS: [(&str, u32, [u8; 8]); 8] = [
    ("transmit timeout", 0x001, [0; 8]),
    ("lost arbitration", 0x002, [3, 0, 0, 0, 0, 0, 0, 0]),
    ("controller error-passive", 0x004, [0, 0x30, 0, 0, 0, 0, 128, 128]),
    ("protocol violation", 0x008, [0, 0, 0x08, 0x19, 0, 0, 0, 0]),
    ("transceiver", 0x010, [0, 0, 0, 0, 0x04, 0, 0, 0]),
    ("no acknowledgement", 0x020, [0; 8]),
    ("bus error", 0x080, [0; 8]),
    ("restarted", 0x100, [0; 8]),
];
const BUS_OFF: u32 = 0x040;

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn error_frames_short_of_bus_off_disturb_nobody() {
    let _motors = Served::on("vcan0", 1);
    let bus = bus("vcan0");
    let motor = bus.motor(1).expect("1 to 32");
    for (name, class, data) in HARMLESS {
        let witness = neighbour("vcan0");
        witness.set_error_filter_accept_all().expect("an option of the kernel");
        report_error("vcan0", class, data);
        let seen = witness.read_frame().expect("the kernel hands it on");
        assert!(matches!(seen, socketcan::CanFrame::Error(_)), "{name}: {seen:?}");
        motor.status().unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    assert_eq!(bus.counters().malformed, 0);
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn bus_off_is_told_and_the_port_is_opened_again() {
    let _motors = Served::on("vcan0", 1);
    let bus = hasty("vcan0");
    let motor = bus.motor(1).expect("1 to 32");
    until("the motor answers", || motor.status().is_ok());
    report_error("vcan0", BUS_OFF, [0; 8]);
    let lost = motor.status().expect_err("the controller is off the bus").to_string();
    assert!(lost.starts_with("`vcan0` is bus-off after too many errors: check wiring"), "{lost}");
    // The motors lost the bus too, and look for it ten times a second.
    until("the motor answers again", || motor.status().is_ok());
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn a_controller_that_is_bus_off_takes_no_request_until_it_is_restarted() {
    let adapter = Adapter::with_motors(Duration::ZERO);
    let bus = bus("slcan0");
    let motor = bus.motor(1).expect("1 to 32");
    motor.status().expect("an answer");
    adapter.report('p');
    motor.status().expect("error-passive is still on the bus");

    adapter.report('b');
    until("the kernel knows it", || {
        let is_told = |port: &list::PortInfo| {
            port.problem
                .as_ref()
                .is_some_and(|problem| problem.starts_with("bus-off: check wiring"))
        };
        list::ports().iter().any(|port| port.name == "socketcan:slcan0" && is_told(port))
    });
    until("the host is told", || motor.status().is_err());
    // The interface would take frames and drop them.
    for _ in 0..100 {
        let lost = motor.status().expect_err("the controller is off the bus").to_string();
        assert!(lost.starts_with("`slcan0` is bus-off after too many errors"), "{lost}");
    }
    assert!(matches!(refusal("slcan0"), PortError::BusOff(..)));

    ip("link set slcan0 down");
    ip("link set slcan0 up");
    until("the motor answers again", || motor.status().is_ok());
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn a_cycle_that_the_interface_has_no_room_for_is_sent_all_the_same() {
    // The driver's queue holds ten frames, and this adapter takes one in two milliseconds.
    let _adapter = Adapter::with_motors(Duration::from_millis(2));
    let bus = bus("slcan0");
    let requests: Vec<_> = MotorSet::ALL.map(|id| (id, STATUS_1)).collect();
    let mut answered = MotorSet::EMPTY;
    let sent = bus.cycle(&requests, |id, outcome| {
        outcome.expect("an answer");
        answered.insert(id);
    });
    sent.expect("there is room sooner or later");
    assert_eq!(answered, MotorSet::ALL);
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn a_bus_that_takes_nothing_is_told() {
    let _adapter = Adapter::deaf();
    let mut link = open("slcan0");
    let stalled = (0..).find_map(|_| link.send(&CanFrame::new(0x141, [0x9A; 8])).err());
    let says = stalled.expect("the queue is full at last").to_string();
    assert!(says.contains("takes no more data: no other node acknowledges the frames"), "{says}");
}

/// A node that answers each frame with the same.
struct Echo;

impl Station<CanFrame> for Echo {
    fn receive(&mut self, _: Instant, received: &[CanFrame], replies: &mut Vec<CanFrame>) {
        replies.extend(received);
    }
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn served_motors_wait_for_room_and_not_for_ever() {
    let adapter = Adapter::deaf();
    let motors = Served::on("slcan0", 32);
    adapter.ask_all();
    let mut answered = adapter.take(32, Duration::from_millis(2));
    answered.sort();
    let all: Vec<String> = (0x141..=0x160).map(|id| format!("{id:X}")).collect();
    assert_eq!(answered, all);
    drop(motors);

    let mut server = Server::new();
    server.serve_can(&"socketcan:slcan0".parse().expect("a port"), Box::new(Echo)).expect("up");
    adapter.ask_all();
    while server.dropped() == 0 {
        server.turn(Duration::from_secs(1), None).expect("a turn");
    }
    assert!(server.dropped() < 32 * 8, "the interface's queue took some");
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn a_link_does_not_hear_itself_and_hears_its_neighbours() {
    for interface in ["vcan0", "can0"] {
        let (mut one, mut other) = (open(interface), open(interface));
        let witness = neighbour(interface);
        let frame = CanFrame::new(0x141, [0x88, 1, 2, 3, 4, 5, 6, 7]);
        one.send(&frame).expect("room");
        assert_eq!(other.receive(PATIENCE).expect("up"), Some(frame));
        let seen = witness.read_frame().expect("the kernel hands it to everyone else");
        assert_eq!(seen.data(), frame.data());

        // A neighbour that receives its own frames changes nothing for us.
        let own = CanDataFrame::new(StandardId::new(0x142).expect("11 bits"), &[7; 8]);
        witness.write_frame(&own.expect("8 bytes")).expect("room");
        assert_eq!(witness.read_frame().expect("its own frame").data(), [7; 8]);
        for link in [&mut one, &mut other] {
            assert_eq!(link.receive(PATIENCE).expect("up"), Some(CanFrame::new(0x142, [7; 8])));
            assert_eq!(link.receive(BRIEFLY).expect("up"), None);
        }
    }
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn hosts_that_ask_different_motors_share_an_interface() {
    let _motors = Served::on("can1", 2);
    std::thread::scope(|scope| {
        for number in [1, 2] {
            scope.spawn(move || {
                let bus = bus("can0");
                let motor = bus.motor(number).expect("1 to 32");
                for k in 0..100 {
                    let gains = Pid { position_kp: k, ..Pid::default() };
                    motor.write_pid_ram(gains).expect("an answer");
                    assert_eq!(motor.pid().expect("an answer"), gains);
                }
            });
        }
    });
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn extended_remote_short_and_fd_frames_are_ignored_by_both_ends() {
    let mut motors = Served::on("vcan1", 1);
    let bus = bus("vcan1");
    let motor = bus.motor(1).expect("1 to 32");
    let stranger = CanFdSocket::open("vcan1").expect("the interface is there");
    let standard = StandardId::new(0x141).expect("11 bits");
    let extended = ExtendedId::new(0x141).expect("29 bits");
    // Turn with 360 °/s: a motor that took any of them would turn.
    let speed = [0xA2, 0, 0, 0, 0xA0, 0x8C, 0, 0];
    let classic: [socketcan::CanFrame; 4] = [
        CanDataFrame::new(extended, &speed).expect("8 bytes").into(),
        CanDataFrame::new(standard, &speed[..7]).expect("7 bytes").into(),
        CanRemoteFrame::new_remote(standard, 8).expect("8 bytes").into(),
        CanRemoteFrame::new_remote(extended, 8).expect("8 bytes").into(),
    ];
    const ROUNDS: u32 = 25;
    for _ in 0..ROUNDS {
        for frame in classic {
            stranger.write_frame(&frame).expect("room");
        }
        for len in [8, 64] {
            let mut data = speed.to_vec();
            data.resize(len, 0);
            let frame = CanFdFrame::new(standard, &data).expect("up to 64 bytes");
            stranger.write_frame(&frame).expect("room");
        }
        assert_eq!(motor.motion_status().expect("an answer").speed.0, 0);
    }
    assert!(motors.state().contains("\"mode\":\"off\""), "{}", motors.state());
    let counters = bus.counters();
    assert_eq!((counters.malformed, counters.unasked), (ROUNDS * classic.len() as u32, 0));
}

#[test]
#[ignore = "needs CAN: make test-socketcan"]
fn a_flood_of_other_frames_is_survived() {
    let _motors = Served::on("vcan0", 1);
    let bus = hasty("vcan0");
    let motor = bus.motor(1).expect("1 to 32");
    let frame = |id, data: [u8; 8]| -> socketcan::CanFrame {
        let id = StandardId::new(id).expect("11 bits");
        CanDataFrame::new(id, &data).expect("8 bytes").into()
    };
    let flood = Flood::on(
        "vcan0",
        vec![frame(0x7FF, [0xFF; 8]), frame(0x161, [0x9A; 8]), frame(0, [0; 8])],
    );
    until("some exchanges get through", || (0..20).filter(|_| motor.status().is_ok()).count() > 10);
    drop(flood);
    until("every exchange gets through", || (0..20).all(|_| motor.status().is_ok()));
}
