//! Lines of clients that have other users.

use std::time::Duration;

use motorlink::rmd::Asked;
use motorlink::st::{Counters, Exchanged};
use motorlink::{Clock, rmd, st};
use motorlink_link::fault::Faults;
use motorlink_proto::rmd::{Code, MotorId};
use motorlink_proto::st::{Failure, MotorNumber, Profile, Request};
use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::event::What;
use motorlink_telemetry::line::{
    Line, RmdLine, RmdOver, RmdRelay, StLine, StOver, StRelay, StStep,
};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::{Item, Rows, Trouble};
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Record, Subscription};
use motorlink_testbench::{Bench, BenchConfig};

const PERIOD: Micros = Micros(10_000);

/// An engine over a relay, on virtual time.
struct Relayed {
    engine: Acquisition,
    subscription: Subscription,
    rows: Rows,
    events: Vec<What>,
    clock: Clock,
}

impl Relayed {
    fn new(line: impl Line + 'static, signals: &[Signal]) -> Self {
        let mut engine = Acquisition::new(Box::new(line));
        engine.confirm_every(Micros(0));
        let subscription = Subscription::new(usize::MAX, Full::DropNewest);
        let wants: Wants = signals.iter().map(|signal| (*signal, PERIOD)).collect();
        engine.subscribe(subscription.clone(), wants);
        let (rows, clock) = (Rows::new(signals.to_vec()), engine.clock().clone());
        Relayed { engine, subscription, rows, events: Vec::new(), clock }
    }

    /// Advances the engine, 1 ms later.
    fn advance(&mut self) {
        self.clock.wait(self.clock.now() + Micros(1_000));
        if let Some(wait) = self.engine.advance(&mut |_, _| {}) {
            self.clock.wait(self.clock.now() + wait.into());
        }
        while let Some(record) = self.subscription.take() {
            self.rows.take(&record);
            if let Record::Event(event) = &record {
                self.events.push(event.what.clone());
            }
        }
    }
}

fn st_signals() -> [Signal; 2] {
    let motor = Motor::St(MotorNumber::new(1).unwrap());
    ["SPEED_MEAS", "BUS_VOLTAGE"].map(|name| Signal::named(motor, name).unwrap())
}

fn st_line(profile: Profile, segments: &[u8]) -> (StRelay, Relayed) {
    let (relay, clock) = (StRelay::default(), Clock::virtual_time());
    let line = StLine::relayed(relay.clone(), "st".into(), clock, profile);
    (relay, Relayed::new(line.using_segments(segments), &st_signals()))
}

/// Replies to what is pending as a drive would that has only zeros.
fn reply(step: &StStep) -> Vec<u8> {
    match step {
        StStep::Segment(..) => vec![0; 6],
        StStep::Request(_, request) => match request.request() {
            Request::GetRegister(register) => {
                vec![0; usize::from(register.shape().unwrap().ty(Profile::Spec).size())]
            }
            _ => Vec::new(),
        },
        StStep::Confirm | StStep::Raw(..) => Vec::new(),
    }
}

fn exchanged(sent: Instant, before: u32, after: u32) -> Option<Exchanged> {
    let [before, after] = [before, after].map(|losses| Counters { losses, ..Counters::default() });
    Some(Exchanged { before, after, sent })
}

/// Carries exchanges out until there are so many items. `losses` is those of the client by exchange.
fn items(
    relay: &StRelay,
    relayed: &mut Relayed,
    count: usize,
    losses: impl Fn(usize) -> u32,
) -> Vec<Item> {
    let (mut items, mut exchanges) = (Vec::new(), 0);
    while items.len() < count {
        assert!(exchanges < 100, "{items:?}");
        relayed.advance();
        items.extend(std::iter::from_fn(|| relayed.rows.next_item()));
        for ((), step) in relay.pending() {
            let losses = losses(exchanges);
            let exchanged = exchanged(relayed.clock.now(), losses, losses);
            relay.ended((), StOver { result: Ok(reply(&step)), exchanged });
            exchanges += 1;
        }
    }
    items
}

fn kinds(items: &[Item]) -> Vec<&'static str> {
    let kind = |item: &Item| match item {
        Item::Row(_) => "row",
        Item::Gap(gap) if matches!(gap.why, Trouble::Doubtful(_)) => "doubt",
        Item::Gap(_) | Item::Lost(_) => "failure",
    };
    items.iter().map(kind).collect()
}

#[test]
fn rows_come_through_a_segment_that_is_configured_first_and_without_one_in_the_other_profile() {
    for profile in Profile::ALL {
        let (relay, mut relayed) = st_line(profile, &[2]);
        relayed.advance();
        assert_eq!(relay.pending(), [((), StStep::Confirm)]);
        let exchanged = exchanged(Instant(0), 0, 0);
        relay.ended((), StOver { result: Ok(Vec::new()), exchanged });
        relayed.advance();
        relayed.advance();
        let pending = relay.pending();
        let [((), StStep::Request(1, request))] = &pending[..] else { panic!("{pending:?}") };
        match (profile, request.request()) {
            (Profile::Spec, Request::ConfigureSegment { segment: 2, .. }) => {}
            // There the frame codes of segments command the motor.
            (Profile::Mcsdk54, Request::GetRegister(_)) => {}
            (_, other) => panic!("{other:?}"),
        }
        assert_eq!(kinds(&items(&relay, &mut relayed, 3, |_| 0)), ["row"; 3]);
    }
}

#[test]
fn a_confirmation_says_nothing_about_replies_before_a_loss() {
    let (relay, mut relayed) = st_line(Profile::Mcsdk54, &[]);
    // Another user loses the line behind the fifth exchange: the confirmation, two rows of two reads.
    let found = items(&relay, &mut relayed, 3, |exchange| u32::from(exchange > 4));
    assert_eq!(kinds(&found), ["row", "doubt", "row"]);
}

#[test]
fn a_silent_drive_confirms_the_replies_before_unless_another_user_lost_the_line() {
    for (before, kind) in [(0, "row"), (1, "failure")] {
        let (relay, mut relayed) = st_line(Profile::Mcsdk54, &[]);
        let mut exchanges = 0;
        let first = loop {
            assert!(exchanges < 20);
            relayed.advance();
            if let Some(item) = relayed.rows.next_item() {
                break item;
            }
            for ((), step) in relay.pending() {
                // A confirmation, one row, and a confirmation that the drive does not hear.
                let (result, before, after) = match exchanges {
                    0..3 => (Ok(reply(&step)), 0, 0),
                    _ => (Err(timeout()), before, before + 1),
                };
                let exchanged = exchanged(relayed.clock.now(), before, after);
                relay.ended((), StOver { result, exchanged });
                exchanges += 1;
            }
        };
        assert_eq!(kinds(&[first]), [kind]);
    }
}

fn timeout() -> st::Error {
    st::Error::Failed {
        port: "st".into(),
        motor: st::Target(1),
        request: "reading".to_owned(),
        failure: Failure::Timeout,
        hint: "",
    }
}

#[test]
fn a_poll_that_is_given_up_is_not_pending() {
    let (relay, mut relayed) = st_line(Profile::Spec, &[]);
    relayed.advance();
    let over = || StOver { result: Ok(vec![9; 9]), exchanged: exchanged(Instant(0), 0, 0) };
    relay.ended((), over());
    relayed.advance();
    relayed.advance();
    let before = relay.pending();
    assert_eq!(before.len(), 1);
    relayed.engine.give_up_polls();
    assert_eq!(relay.pending(), []);
    // A late reply is ignored.
    relay.ended((), over());
    relayed.advance();
    assert_eq!(relay.pending(), before);
}

#[test]
fn a_client_that_waits_carries_the_steps_out() {
    let bench = Bench::new(&BenchConfig::default()).unwrap();
    let link = bench.bytes(&Faults::NONE);
    let client = st::Client::over("st", link, st::Options::default());
    let relay = StRelay::default();
    let line = StLine::relayed(relay.clone(), "st".into(), client.clock(), Profile::Spec);
    let mut relayed = Relayed::new(line, &st_signals());
    let mut found = Vec::new();
    while found.len() < 20 {
        relayed.advance();
        found.extend(std::iter::from_fn(|| relayed.rows.next_item()));
        for ((), step) in relay.pending() {
            relay.ended((), step.carry_out(&client));
        }
    }
    assert_eq!(kinds(&found), ["row"; 20]);
    for item in found {
        let Item::Row(row) = item else { continue };
        assert_eq!(row.values[1].as_ref().unwrap().value, 325.0);
        assert!(row.requested >= row.instant);
    }
}

#[test]
fn motors_of_a_bus_are_confirmed_each_by_its_own_losses() {
    let (relay, clock) = (RmdRelay::default(), Clock::virtual_time());
    let line = RmdLine::relayed(relay.clone(), "can".into(), clock);
    let ids = [1, 2].map(|id| MotorId::new(id).unwrap());
    let signals = ids.map(|id| Signal::named(Motor::Rmd(id), "voltage_volts").unwrap());
    let mut relayed = Relayed::new(line, &signals);
    let is_of =
        |event: &What, wanted| matches!(event, What::Doubtful(motor, _) if *motor == wanted);
    let mut confirmations = 0;
    while confirmations < 6 {
        relayed.advance();
        for (id, asked) in relay.pending() {
            confirmations += usize::from(asked == Asked::Confirmation);
            let losses = Some(u32::from(id == ids[1] && confirmations > 2));
            let result = Ok([Code::ReadStatus.number(), 0, 0, 0, 0, 0, 0, 0]);
            relay.ended(id, RmdOver { result, losses, sent: relayed.clock.now() });
        }
    }
    relayed.advance();
    assert!(relayed.events.iter().any(|event| is_of(event, Motor::Rmd(ids[1]))));
    assert!(!relayed.events.iter().any(|event| is_of(event, Motor::Rmd(ids[0]))));
}

#[test]
fn a_bus_that_was_lost_confirms_nothing() {
    let (relay, clock) = (RmdRelay::default(), Clock::virtual_time());
    let line = RmdLine::relayed(relay.clone(), "can".into(), clock);
    let id = MotorId::new(1).unwrap();
    let signal = Signal::named(Motor::Rmd(id), "voltage_volts").unwrap();
    let mut relayed = Relayed::new(line, &[signal]);
    let mut exchanges = 0;
    while exchanges < 4 {
        relayed.advance();
        for (id, _) in relay.pending() {
            // A confirmation, a row, and the port is lost.
            let (result, losses) = match exchanges < 2 {
                true => (Ok([Code::ReadStatus.number(), 0, 0, 0, 0, 0, 0, 0]), Some(0)),
                false => {
                    let request = Code::ReadStatus;
                    (Err(rmd::Error::Timeout { port: "can".into(), motor: id, request }), None)
                }
            };
            relay.ended(id, RmdOver { result, losses, sent: relayed.clock.now() });
            exchanges += 1;
        }
    }
    relayed.advance();
    let found: Vec<_> = std::iter::from_fn(|| relayed.rows.next_item()).collect();
    assert_eq!(kinds(&found), ["failure"]);
}

#[test]
fn a_client_that_its_owner_has_closed_loses_the_line_for_good() {
    let (relay, mut relayed) = st_line(Profile::Spec, &[]);
    items(&relay, &mut relayed, 2, |_| 0);
    relay.close();
    for _ in 0..100 {
        relayed.advance();
    }
    let lost = relayed.events.iter().filter(|event| matches!(event, What::Lost(_))).count();
    assert_eq!(lost, 1);
    assert!(!relayed.events.iter().any(|event| matches!(event, What::Back)));
    assert_eq!(relayed.engine.advance(&mut |_, _| {}), Some(Duration::MAX));
}

#[test]
fn an_owner_is_woken_when_an_exchange_is_pending() {
    let (relay, mut relayed) = st_line(Profile::Spec, &[]);
    let waiting = relay.clone();
    let owner = std::thread::spawn(move || {
        while waiting.pending().is_empty() {
            waiting.wait(Duration::from_secs(60));
        }
    });
    while relay.pending().is_empty() {
        relayed.advance();
    }
    owner.join().unwrap();
}
