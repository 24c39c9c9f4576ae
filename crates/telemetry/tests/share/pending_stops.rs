//! Stops that a motor has not taken: they are sent again until it confirms one.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::asking::command;
use crate::stopping::{
    Cable, READ_STATUS, START, STOP, frame, heard_and_unstopped, motors, read, request_of,
    share_of_a_lost_motor, share_of_a_turning_motor, share_while, stop_all_of, stop_times, stops,
};
use crate::virtual_share::VirtualShare;
use motorlink_telemetry::share::message::*;

fn stands(share: &VirtualShare) {
    share.reaches("st2.speed_rpm", |rpm| rpm.abs() < 30.0);
}

#[test]
fn a_motor_that_had_never_answered_is_stopped_when_it_does() {
    let (share, cut) = share_of_a_turning_motor(false);
    let mut program = share.join("stops");
    program.ask(command("st0", 1, &READ_STATUS)).unwrap();
    cut.store(true, Ordering::SeqCst);
    let stopped = stop_all_of(&mut program, "st0", &[1, 2]);
    assert_eq!(stopped, motors("st0", &[(1, "may turn")]));
    // Its precaution is given up, too.
    let mut before = 0;
    share.until(|| {
        program.ask(command("st0", 2, &READ_STATUS)).unwrap_err();
        let stops = stops(&mut program, 2);
        let is_over = stops > 0 && stops == before;
        before = stops;
        is_over
    });
    cut.store(false, Ordering::SeqCst);
    share.until(|| program.ask(command("st0", 2, &READ_STATUS)).is_ok());
    stands(&share);
}

#[test]
fn a_motor_that_nobody_reads_is_searched_until_it_stands() {
    let (share, is_lost) = share_of_a_lost_motor();
    let mut program = share.join("stops");
    program.ask(command("st0", 1, &READ_STATUS)).unwrap();
    let stopped = stop_all_of(&mut program, "st0", &[1, 2]);
    assert_eq!(stopped, motors("st0", &[(1, "confirmed")]));
    // All are tried for 2 s.
    let mut is_late = |motor| {
        let times = stop_times(&mut program, motor);
        times.first().zip(times.last()).is_some_and(|(first, last)| last - first > 3.0)
    };
    share.until(|| is_late(2));
    assert!(!is_late(5), "the drive says that it has no motor 5");
    is_lost.store(false, Ordering::SeqCst);
    stands(&share);
    share.until(|| heard_and_unstopped(&mut program, "st0") == (vec![1, 2], vec![]));
}

#[test]
fn motors_that_are_silent_do_not_keep_each_other_from_an_end() {
    let cut = Arc::new(AtomicBool::new(false));
    let is_cut = Arc::clone(&cut);
    let share =
        VirtualShare::with(Duration::from_secs(1), move |link| Cable::cut_while(link, &is_cut));
    let mut program = share.join("stops");
    // A motor that is read and silent has not answered.
    program.ask(read("st0", &[1, 2])).unwrap();
    share.until(|| heard_and_unstopped(&mut program, "st0").0 == [1, 2]);
    cut.store(true, Ordering::SeqCst);
    // The stops of the first answer are repeated meanwhile.
    for _ in 0..2 {
        let stopped = stop_all_of(&mut program, "st0", &[1, 2]);
        assert_eq!(stopped, motors("st0", &[(1, "may turn"), (2, "may turn")]));
    }
    cut.store(false, Ordering::SeqCst);
    share.until(|| heard_and_unstopped(&mut program, "st0").1.is_empty());
}

#[test]
fn a_motor_that_is_read_and_has_never_answered_is_not_heard() {
    let (share, _cut) = share_of_a_turning_motor(true);
    let mut program = share.join("reads");
    program.ask(read("st0", &[2])).unwrap();
    program.ask(read("rmd0", &[9])).unwrap();
    for _ in 0..2 {
        program.event(EventKind::Silent);
    }
    for line in ["st0", "rmd0"] {
        assert!(heard_and_unstopped(&mut program, line).0.is_empty(), "{line}");
    }
}

#[test]
fn motion_that_got_no_reply_does_not_end_a_stop() {
    let (share, cut) = share_of_a_turning_motor(false);
    let mut program = share.join("stops");
    program.ask(command("st0", 2, &READ_STATUS)).unwrap();
    cut.store(true, Ordering::SeqCst);
    let stopped = stop_all_of(&mut program, "st0", &[2]);
    assert_eq!(stopped, motors("st0", &[(2, "may turn")]));
    let mut other = share.join("starts");
    other.ask(command("st0", 2, &START)).unwrap_err();
    assert_eq!(heard_and_unstopped(&mut program, "st0"), (vec![2], vec![2]));
    cut.store(false, Ordering::SeqCst);
    stands(&share);
    share.until(|| heard_and_unstopped(&mut program, "st0").1.is_empty());
}

#[test]
fn motion_that_is_refused_does_not_end_a_stop_where_nothing_has_answered() {
    let (share, cut) = share_of_a_turning_motor(true);
    let mut program = share.join("stops");
    program.ask(Ask::Latch).unwrap();
    let stopped = stop_all_of(&mut program, "st0", &[ANY_MOTOR]);
    assert_eq!(stopped, motors("st0", &[(ANY_MOTOR, "may turn")]));
    let mut other = share.join("starts");
    let refused = other.ask(command("st0", 3, &START)).unwrap_err();
    assert_eq!(refused.reason, Reason::Latched);
    assert_eq!(heard_and_unstopped(&mut program, "st0").1, [ANY_MOTOR]);
    cut.store(false, Ordering::SeqCst);
    stands(&share);
}

#[test]
fn numbers_that_the_drive_does_not_have_are_no_answer_of_its_motors() {
    let is_of_motor = |bytes: &[u8]| [1, 2].contains(&request_of(bytes).0);
    let (share, is_lost) =
        share_while(true, move |bytes| (!is_of_motor(bytes)).then(|| bytes.to_vec()));
    let mut program = share.join("stops");
    for _ in 0..2 {
        let stopped = stop_all_of(&mut program, "st0", &[ANY_MOTOR, 1, 2]);
        assert_eq!(stopped, motors("st0", &[(ANY_MOTOR, "may turn")]));
    }
    is_lost.store(false, Ordering::SeqCst);
    stands(&share);
}

#[test]
fn a_drive_that_refuses_all_numbers_has_no_motor_that_stands() {
    let (share, is_refused) =
        share_while(true, |bytes| Some(frame(5 << 5 | bytes[0] & 0x1f, &[2])));
    let mut program = share.join("stops");
    for _ in 0..2 {
        let stopped = stop_all_of(&mut program, "st0", &[ANY_MOTOR]);
        assert_eq!(stopped, motors("st0", &[(ANY_MOTOR, "may turn")]));
    }
    is_refused.store(false, Ordering::SeqCst);
    stands(&share);
}

#[test]
fn a_stop_that_the_drive_refuses_is_repeated() {
    // As one for a motor that the drive does not have, and as a command that it does not know.
    for refused in [frame(5 << 5 | 3, &[2]), frame(2 << 5 | 3, &[0x7f])] {
        let is_stop = |bytes: &[u8]| request_of(bytes) == (2, STOP.to_vec());
        let (share, is_refused) = share_while(true, move |bytes| {
            Some(if is_stop(bytes) { refused.clone() } else { bytes.to_vec() })
        });
        let mut program = share.join("stops");
        program.ask(command("st0", 2, &READ_STATUS)).unwrap();
        let stopped = stop_all_of(&mut program, "st0", &[2]);
        assert_eq!(stopped, motors("st0", &[(2, "may turn")]));
        assert_eq!(heard_and_unstopped(&mut program, "st0").1, [2]);
        is_refused.store(false, Ordering::SeqCst);
        stands(&share);
        share.until(|| heard_and_unstopped(&mut program, "st0").1.is_empty());
    }
}

#[test]
fn a_release_keeps_the_stop_of_a_motor_that_is_read() {
    let (share, is_lost) = share_of_a_lost_motor();
    let mut program = share.join("stops");
    program.ask(read("st0", &[1, 2])).unwrap();
    share.until(|| heard_and_unstopped(&mut program, "st0").0 == [1]);
    program.ask(Ask::Latch).unwrap();
    let stopped = stop_all_of(&mut program, "st0", &[1, 2]);
    assert_eq!(stopped, motors("st0", &[(1, "confirmed"), (2, "may turn")]));
    program.ask(Ask::Release).unwrap();
    is_lost.store(false, Ordering::SeqCst);
    stands(&share);
}
