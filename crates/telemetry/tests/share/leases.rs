//! One program at a time changes a motor of a share that has leases.

use std::time::Duration;

use crate::asking::{Asker, command};
use crate::shared::PATIENT;
use crate::virtual_share::VirtualShare;
use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::message::*;

const RAMP: [u8; 7] = [7, 220, 5, 0, 0, 100, 0];
const FASTER: [u8; 7] = [7, 208, 7, 0, 0, 100, 0];
const START: [u8; 2] = [3, 1];
const STOP: [u8; 2] = [3, 2];
const SPEED: [u8; 2] = [2, 30];
/// SET_REG SPEED_KP 300.
const GAIN: [u8; 4] = [1, 5, 44, 1];

fn share(lease: Duration) -> VirtualShare {
    let share = VirtualShare::new();
    share.lease(lease);
    share
}

fn motor() -> MotorName {
    MotorName { line: "st0".to_owned(), motor: 1 }
}

fn held(program: &mut Asker, bytes: &[u8]) -> String {
    let refusal = program.ask(command("st0", 1, bytes)).unwrap_err();
    assert_eq!(refusal.reason, Reason::Held, "{}", refusal.message);
    refusal.message
}

fn turn(program: &mut Asker) {
    program.ask(command("st0", 1, &RAMP)).unwrap();
    program.ask(command("st0", 1, &START)).unwrap();
}

/// A share whose motor turns for Alice, and Bob.
fn turning_for_alice(lease: Duration) -> (VirtualShare, Asker, Asker) {
    let share = share(lease);
    let [mut alice, bob] = ["alice", "bob"].map(|who| share.join(who));
    turn(&mut alice);
    share.reaches("st1.speed_rpm", |rpm| rpm > 1400.0);
    (share, alice, bob)
}

/// Waits for the end of a lease, and changes the motor then.
fn gets(share: &VirtualShare, program: &mut Asker, bytes: &[u8]) {
    share.until(|| program.ask(command("st0", 1, bytes)).is_ok());
}

#[test]
fn only_the_program_that_turns_a_motor_changes_it_and_all_may_stop_it() {
    let (share, mut alice, mut bob) = turning_for_alice(Duration::from_millis(10));
    // The lease is over; the motor turns.
    for bytes in [&RAMP[..], &START, &GAIN] {
        assert_eq!(
            held(&mut bob, bytes),
            "st0: motor 1 turns for alice, who holds it; stop it or take it"
        );
    }
    bob.ask(command("st0", 1, &SPEED)).unwrap();
    alice.ask(command("st0", 1, &RAMP)).unwrap();
    bob.ask(command("st0", 1, &STOP)).unwrap();
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
    gets(&share, &mut bob, &RAMP);
}

#[test]
fn a_lease_ends_by_itself_and_when_its_program_leaves() {
    let share = share(Duration::from_secs(3600));
    let (mut alice, mut bob) = (share.join("alice"), share.join("bob"));
    // A read needs none, and gives none.
    alice.ask(command("st0", 1, &SPEED)).unwrap();
    bob.ask(command("st0", 1, &GAIN)).unwrap();
    let why = held(&mut alice, &GAIN);
    assert!(why.starts_with("st0: bob holds motor 1 for another 3"), "{why}");
    // Another motor is free.
    alice.ask(command("st0", 2, &RAMP)).unwrap();
    drop(bob);
    gets(&share, &mut alice, &GAIN);
}

#[test]
fn a_command_that_is_refused_gives_no_lease() {
    let share = share(Duration::from_secs(3));
    let [mut alice, mut bob] = ["alice", "bob"].map(|who| share.join(who));
    let ask = |own, continues, time_to_live| {
        let (line, bytes) = ("st0".to_owned(), GAIN.to_vec());
        Ask::Command { line, motor: 1, bytes, time_to_live, continues, own }
    };
    alice.ask(Ask::Latch).unwrap();
    assert_eq!(bob.ask(command("st0", 1, &START)).unwrap_err().reason, Reason::Latched);
    alice.ask(Ask::Release).unwrap();
    assert_eq!(bob.ask(ask(true, false, 1.0)).unwrap_err().reason, Reason::Held);
    alice.ask(Ask::Stop { motor: Some(motor()) }).unwrap();
    assert_eq!(bob.ask(ask(false, true, 1.0)).unwrap_err().reason, Reason::Overtaken);
    // None of that gave Bob the motor.
    alice.ask(command("st0", 1, &RAMP)).unwrap();
    held(&mut bob, &RAMP);
    alice.ask(ask(false, false, 1.0)).unwrap();
    held(&mut bob, &GAIN);
}

#[test]
fn a_motor_is_taken_explicitly_and_the_log_says_so() {
    let (share, mut alice, mut bob) = turning_for_alice(Duration::from_secs(3600));
    bob.ask(Ask::Take { motor: motor() }).unwrap();
    let taken = alice.event(EventKind::Taken);
    assert_eq!(taken.message, "st0, motor 1: bob takes it from alice");
    assert_eq!((taken.by.as_deref(), taken.motor), (Some("bob"), Some(1)));
    held(&mut alice, &RAMP);
    bob.ask(command("st0", 1, &FASTER)).unwrap();
    share.reaches("st1.speed_rpm", |rpm| rpm > 1900.0);
    // It turns for bob now, who has not started it.
    drop(alice);
    bob.event(EventKind::Left);
    bob.ask(command("st0", 1, &RAMP)).unwrap();
    share.reaches("st1.speed_rpm", |rpm| (1400.0..1600.0).contains(&rpm));
    drop(bob);
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
}

#[test]
fn a_taken_motor_stops_with_the_program_that_took_it() {
    let (share, mut alice, mut bob) = turning_for_alice(Duration::from_secs(3600));
    bob.ask(Ask::Take { motor: motor() }).unwrap();
    drop(bob);
    // Alice is still there.
    let stop = alice.event(EventKind::Stopped);
    assert_eq!((stop.motor, stop.line.as_deref()), (Some(1), Some("st0")));
    share.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0);
}

#[test]
fn a_share_without_leases_refuses_to_take() {
    let share = VirtualShare::new();
    let mut program = share.join("alice");
    let refusal = program.ask(Ask::Take { motor: motor() }).unwrap_err();
    assert_eq!(refusal.reason, Reason::Usage);
}

fn own(bytes: &[u8]) -> Ask {
    let Ask::Command { line, motor, bytes, time_to_live, continues, .. } = command("st0", 1, bytes)
    else {
        unreachable!()
    };
    Ask::Command { line, motor, bytes, time_to_live, continues, own: true }
}

#[test]
fn a_program_from_which_a_motor_was_taken_does_not_stop_it_at_its_end() {
    let (share, mut alice, mut bob) = turning_for_alice(PATIENT);
    let lost = |refusal: Result<Answer, Refusal>| {
        let Refusal { reason, message, .. } = refusal.unwrap_err();
        assert_eq!(reason, Reason::Held);
        assert_eq!(message, "st0: motor 1 does not belong to this program");
    };
    bob.ask(Ask::Take { motor: motor() }).unwrap();
    lost(alice.ask(own(&STOP)));
    share.reaches("st1.speed_rpm", |rpm| rpm > 1400.0);
    // The motor has no owner then.
    bob.ask(own(&STOP)).unwrap();
    lost(alice.ask(own(&STOP)));
    lost(bob.ask(own(&STOP)));
}
