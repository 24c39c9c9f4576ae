//! The lines of a share: what their exchanges came to.

mod asking;
mod drives;
mod shared;

use asking::Asker;
use motorlink_telemetry::share::message::*;
use shared::Share;

fn command(line: &str, motor: u8, bytes: &[u8]) -> Ask {
    Ask::Command {
        line: line.to_owned(),
        motor,
        bytes: bytes.to_vec(),
        time_to_live: 10.0,
        continues: false,
    }
}

#[test]
fn a_line_counts_its_exchanges_and_what_went_wrong() {
    let share = Share::new("counts");
    let mut program = Asker::join(&share.path, "counts");
    let counts = |program: &mut Asker| program.lines()[0].counts.unwrap();
    let before = counts(&mut program);
    assert_eq!((before.refused, before.silent, before.failed, before.lost), (0, 0, 0, 0));
    // GET_REG of SPEED_MEAS, then of a register that no drive has.
    program.ask(command("st0", 1, &[2, 30])).unwrap();
    program.ask(command("st0", 1, &[2, 250])).unwrap_err();
    let after = counts(&mut program);
    assert!(after.exchanges >= before.exchanges + 2, "{before:?} {after:?}");
    assert_eq!((after.refused, after.silent, after.failed, after.lost), (1, 0, 0, 0));
}
