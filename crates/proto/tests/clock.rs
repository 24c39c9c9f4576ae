//! A clock that is set back, as by a counter of 32 bits that wraps around.

use crate::common::{Memory, SlaveFixture, answer};
use crate::rmd_bench::{Node, motor, trusted_host};
use crate::st_bench::{MS, STATUS, master};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{self, *};
use motorlink_proto::st::{self, Profile, Recovery};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::*;

/// The last moment of a counter of 32 bits.
const LAST: Instant = Instant(u32::MAX as u64);

#[test]
fn an_rmd_drive_switches_its_motor_off_when_the_clock_wraps() {
    let mut node = Node::new(1);
    node.drive.config.shutdown = Some(Micros(100 * MS));
    let speed = CanFrame::new(0x141, SetSpeed { speed: CentiDps(36_000) }.encode());
    node.receive(LAST, &speed).unwrap();
    node.drive.poll(Instant(10), &mut node.motor);
    assert_eq!(node.motor.mode, Mode::Off);
}

#[test]
fn a_time_that_was_taken_a_moment_before_is_no_wrap() {
    let mut node = Node::new(1);
    node.drive.config.shutdown = Some(Micros(100 * MS));
    let speed = CanFrame::new(0x141, SetSpeed { speed: CentiDps(36_000) }.encode());
    node.receive(Instant(1_000), &speed).unwrap();
    node.drive.poll(Instant(990), &mut node.motor);
    assert_eq!(node.motor.mode, Mode::Speed(CentiDps(36_000)));
}

#[test]
fn a_slave_drops_an_incomplete_command_when_the_clock_wraps() {
    let mut bench = SlaveFixture::new(Profile::Spec, 1, Memory::usual());
    assert_eq!(bench.slave.receive(LAST, 0x02, &mut bench.drive), None);
    let reply = bench.slave.poll(Instant(10)).map(<[u8]>::to_vec);
    assert_eq!(answer(&reply.unwrap()), Err(st::ErrorCode::Timeout));
}

#[test]
fn an_st_master_times_out_when_the_clock_wraps() {
    let mut master = master(Recovery::Drain);
    master.request(1, &STATUS).unwrap();
    assert!(matches!(master.poll(LAST), st::Output::Transmit(_)));
    assert!(matches!(master.poll(LAST), st::Output::Wait(Some(_))));
    let timeout = st::ExchangeError::Failed(st::Failure::Timeout);
    assert_eq!(master.poll(Instant(10)), st::Output::Done(Err(timeout)));
}

/// How long a recovery takes without an answer, on a clock that wraps after `before`, in ms.
fn recovery(before: u64) -> u64 {
    let mut master = master(Recovery::Drain);
    master.lost();
    master.request(1, &STATUS).unwrap();
    for ms in 0..30_000 {
        let clock = (u64::from(u32::MAX) - before + ms * MS) & u64::from(u32::MAX);
        if let st::Output::Done(result) = master.poll(Instant(clock)) {
            assert!(result.is_err());
            return ms;
        }
    }
    panic!("the master waits");
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn the_recovery_of_an_st_line_ends_when_the_clock_wraps() {
    for before in (0..1_200).step_by(7) {
        assert!(recovery(before * MS) < 3_000, "{before}");
    }
}

#[test]
fn an_rmd_host_times_out_when_the_clock_wraps() {
    let (mut host, id) = (trusted_host(), motor(1));
    host.request(LAST, id, ReadStatus.encode()).unwrap();
    assert!(matches!(host.poll(LAST), rmd::Output::Transmit(_)));
    assert!(matches!(host.poll(LAST), rmd::Output::Wait(Some(_))));
    let result = Err(rmd::Failure::Timeout);
    assert_eq!(host.poll(Instant(10)), rmd::Output::Done { id, result });
    let Err(RequestError::Quarantined { until, .. }) =
        host.request(Instant(20), id, ReadStatus.encode())
    else {
        panic!("no quarantine");
    };
    assert_eq!(until, Instant(10) + DEFAULT_QUARANTINE);
}

#[test]
fn a_quarantine_ends_when_the_clock_wraps() {
    let (mut host, id) = (trusted_host(), motor(1));
    let before = Instant(LAST.0 - 60 * MS);
    host.request(before, id, ReadStatus.encode()).unwrap();
    assert!(matches!(host.poll(before), rmd::Output::Transmit(_)));
    assert!(matches!(host.poll(LAST), rmd::Output::Done { .. }));
    assert!(host.request(Instant(0), id, ReadStatus.encode()).is_err());
    assert_eq!(host.request(Instant(100 * MS), id, ReadStatus.encode()), Ok(()));
}
