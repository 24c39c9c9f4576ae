//! What stops a motor does not wait until a lost line has recovered.

use std::time::Duration;

use crate::wire::{ACK, Fresh, GET_SPEED, START, STOP, Wire};
use motorlink::st::{
    Client, Command, EventClient, Options, Progress, Request, SyncState, register,
};

/// GET_BOARD_INFO and GET_REVUP_DATA: the questions of recovery.
const INFO: [u8; 3] = [0x06, 0x00, 0x06];
const REVUP: [u8; 4] = [0x08, 0x01, 0x00, 0x09];

/// With short timeouts: this drive never answers in any case.
fn options() -> Options {
    Options {
        timeout: Duration::from_millis(20),
        quiet: Duration::from_millis(5),
        ..Options::default()
    }
}

#[test]
fn a_stop_on_a_lost_line_is_sent_before_the_line_has_recovered() {
    let wire = Wire::new();
    let client = Client::over("wire", Box::new(Fresh(wire.clone())), options());
    let motor = client.motor(1).unwrap();
    motor.get(register::SPEED_MEAS).expect_err("nothing answers");
    assert_eq!(client.sync_state(), SyncState::Lost);
    motor.stop().expect_err("nothing answers");
    client.raw(1, 0x03, &[0x02]).expect_err("nothing answers");
    // What starts a motor waits, as everything else does.
    motor.start().expect_err("nothing answers");
    let expected = [&GET_SPEED[..], &STOP, &INFO, &STOP, &REVUP, &INFO].concat();
    assert_eq!(wire.sent(), expected);
}

#[test]
fn a_stop_on_a_line_that_was_just_opened_is_sent_before_the_questions() {
    let wire = Wire::new();
    let client = Client::over("wire", Box::new(wire.clone()), options());
    let motor = client.motor(1).unwrap();
    // The acknowledge of the first STOP_MOTOR, and nothing else any more.
    wire.say_to(&STOP, &ACK);
    motor.stop().expect_err("no question is answered");
    motor.start().expect_err("no question is answered");
    assert_eq!(wire.sent(), [&STOP[..], &INFO, &INFO].concat());
}

#[test]
fn only_the_reply_on_the_recovered_line_counts() {
    let wire = Wire::new();
    let client = Client::over("wire", Box::new(Fresh(wire.clone())), options());
    let motor = client.motor(1).unwrap();
    motor.start().expect_err("nothing answers");
    // The acknowledge of the first STOP_MOTOR, and nothing else any more.
    wire.say_to(&STOP, &ACK);
    motor.stop().expect_err("the line does not recover");
    assert_eq!(client.started().count(), 1);
    assert_eq!(wire.sent(), [&START[..], &STOP, &INFO].concat());
}

#[test]
fn a_guard_tells_every_motor_of_a_silent_drive_before_it_waits() {
    let wire = Wire::new();
    let client = Client::over("wire", Box::new(Fresh(wire.clone())), options());
    for motor in 1..=3 {
        client.motor(motor).unwrap().start().expect_err("nothing answers");
    }
    let before = wire.sent().len();
    let stopped = client.stop_on_drop().stop_now();
    assert_eq!(stopped.iter().filter(|one| one.result.is_err()).count(), 3);
    let mut told: Vec<u8> = wire.sent()[before..].chunks(4).take(3).map(|stop| stop[0]).collect();
    told.sort_unstable();
    assert_eq!(told, [0x23, 0x43, 0x63]);
    let sent = wire.sent();
    let again = sent[before..].windows(4).filter(|frame| *frame == STOP).count();
    assert!(again >= 2, "{again}");
}

#[test]
fn so_it_is_for_event_loops() {
    let wire = Wire::new();
    let link = wire.clone();
    let open = Box::new(move || Ok(Box::new(Fresh(link.clone())) as _));
    let mut client = EventClient::open_with("wire", open, options()).unwrap();
    let stop = Request::ExecuteCommand(Command::StopMotor);
    client.begin(1, &Request::ExecuteCommand(Command::StartMotor)).unwrap();
    assert!(matches!(client.advance(|_| Some(())), Progress::Wait(Some(_))));
    // The START is given up, and the line with it.
    client.begin(1, &stop).unwrap();
    assert!(matches!(client.advance(|_| Some(())), Progress::Wait(Some(_))));
    assert_eq!(wire.sent(), [START, STOP].concat());
    // One that is given up itself is not sent later.
    client.begin(1, &stop).unwrap();
    client.abandon();
    client.begin(1, &Request::GetBoardInfo).unwrap();
    assert!(matches!(client.advance(|_| Some(())), Progress::Wait(Some(_))));
    assert_eq!(wire.sent(), [START, STOP].concat());
}
