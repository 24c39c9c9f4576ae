//! An engine on a line of a share.

use super::*;

/// An engine on a line of a share, which reads two registers, and what it gives.
fn reading(port: &PortName) -> (Acquisition, Subscription) {
    let line = StLine::open(port, Default::default()).unwrap();
    let mut engine = Acquisition::new(Box::new(line));
    let motor = Motor::St(MotorNumber::new(1).unwrap());
    let signals = ["SPEED_MEAS", "STATUS"].map(|name| Signal::named(motor, name).unwrap());
    let wants: Wants = signals.iter().map(|signal| (*signal, Micros(5_000))).collect();
    let subscription = Subscription::new(10_000, Full::DropOldest);
    engine.subscribe(subscription.clone(), wants);
    (engine, subscription)
}

#[test]
fn an_engine_reads_through_a_share_and_is_told_of_refusals() {
    let share = Share::new("engine");
    let (mut engine, subscription) = reading(&share.port("st0"));
    let program = latched(&share);
    let start = line::Request::st(1, Request::ExecuteCommand(Command::StartMotor));
    let command = engine.command(&"test".into(), start, Micros::from_millis(5_000)).unwrap();
    let (mut refused, mut values) = (None, 0);
    let end = Instant::now() + LIMIT;
    while refused.is_none() || values < 50 {
        assert!(Instant::now() < end, "{refused:?} {values}");
        let wait = engine.advance(&mut |id, result| {
            if id == command {
                refused = Some(result.unwrap_err().to_string());
            }
        });
        while let Some(record) = subscription.take() {
            values += usize::from(matches!(record, Record::Values(_)));
        }
        std::thread::sleep(wait.unwrap_or_default().min(Duration::from_millis(2)));
    }
    let refused = refused.unwrap();
    assert!(refused.contains("motion is refused until the latch is released"), "{refused}");
    drop(program);
}

#[test]
fn a_drive_that_never_answers_is_silent_and_nothing_else() {
    let share = deaf("silent");
    let (mut engine, subscription) = reading(&share.port("st0"));
    let mut told = Vec::new();
    let mut advance_while = |goes_on: &dyn Fn(u64) -> bool| {
        let end = Instant::now() + LIMIT;
        while goes_on(engine.tally().counts().exchanges) {
            assert!(Instant::now() < end, "{:?}", engine.tally().counts());
            let wait = engine.advance(&mut |_, _| {});
            while let Some(record) = subscription.take() {
                if let Record::Event(event) = record {
                    told.push(event.what.clone());
                }
            }
            std::thread::sleep(wait.unwrap_or_default().min(Duration::from_millis(5)));
        }
    };
    advance_while(&|exchanges| exchanges < 3);
    // The share does not send a request that it reads too late: the drive has not answered it.
    let (hold, frozen) = (share.freeze(), Instant::now());
    advance_while(&|_| frozen.elapsed() < Duration::from_millis(1_300));
    drop(hold);
    advance_while(&|exchanges| exchanges < 8);
    assert!(matches!(told[..], [What::Unanswered(..), What::Silent(..)]), "{told:?}");
}
