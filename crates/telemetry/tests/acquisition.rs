//! The engine of a line against simulated drives on virtual time.

use std::sync::Arc;

use motorlink_proto::rmd::{Code, MotorId, Off, ReadStatus, SetSpeed, Stop};
use motorlink_proto::st::{self, Profile, RegisterId};
use motorlink_proto::time::Micros;
use motorlink_proto::units::CentiDps;
use motorlink_telemetry::event::{CommandError, What};
use motorlink_telemetry::line::{LineError, Reply, Request};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::Rows;
use motorlink_telemetry::schedule::CommandId;
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Subscription};
use motorlink_testbench::Bench;

use crate::engine::{Engine, SECOND, bench, rmd, signals, spec, st, st_options};
use crate::got::Got;

const CENTISECOND: Micros = Micros(10_000);

/// The engine of the line to the ST drive of a bench.
fn st_engine(bench: &Bench, faults: &str) -> Engine {
    Engine::st(bench.bytes(&spec(faults)), st_options(bench.profile()))
}

/// The engine of the bus of a bench.
fn rmd_engine(bench: &Bench, faults: &str) -> Engine {
    Engine::rmd(bench.can(&spec(faults)))
}

impl Engine {
    fn command(&mut self, request: Request) -> Result<CommandId, CommandError> {
        self.acquisition.command(&"test".into(), request, SECOND)
    }

    fn latch(&mut self) {
        let ended = &mut self.ended;
        self.acquisition.latch(&"operator".into(), &mut |id, result| ended.push((id, result)));
    }
}

#[test]
fn four_motors_are_read_at_100_hz_without_a_gap() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    let wanted: Vec<Signal> = (1..=4)
        .flat_map(|id| {
            signals(
                rmd(id),
                &["iq_amps", "speed_dps", "encoder", "temperature_celsius", "voltage_volts"],
            )
        })
        .collect();
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(Micros(3 * SECOND.0));
    let got = Got::of(&subscription);
    for signal in &wanted {
        let values = got.values(*signal);
        assert!((298..=301).contains(&values.len()), "{signal:?}: {}", values.len());
        for pair in values.windows(2) {
            let gap = pair[1].0.since(pair[0].0);
            assert!((5_000..15_000).contains(&gap.0), "{gap:?}");
        }
    }
    // One exchange for all values of a reply: the temperature comes with the current.
    let polls = engine.acquisition.rates().count();
    assert_eq!(polls, wanted.len());
    assert!((got.replies() as f64 / 3.0 - 800.0).abs() < 8.0, "{}", got.replies());
    assert!(engine.acquisition.is_predicted());
    for rate in engine.acquisition.rates() {
        assert_eq!((rate.asked, rate.predicted), (CENTISECOND, CENTISECOND));
        assert!((rate.achieved - 100.0).abs() < 1.5, "{}", rate.achieved);
    }
    assert!(got.events().all(is_good));
    let heard = got.events().filter(|what| matches!(what, What::Heard(_))).count();
    assert_eq!(heard, 4);
}

#[test]
fn two_consumers_of_one_signal_cost_one_exchange() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    let speed = signals(rmd(1), &["speed_dps"]);
    let fast = engine.subscribe(&speed, CENTISECOND);
    let slow = engine.subscribe(&speed, Micros(100_000));
    engine.run(SECOND);
    let (fast, slow) = (Got::of(&fast).replies(), Got::of(&slow).replies());
    assert!((99..=101).contains(&fast) && (9..=11).contains(&slow), "{fast} {slow}");
    assert_eq!(engine.acquisition.rates().count(), 1);
}

#[test]
fn a_consumer_that_leaves_is_not_read_for_any_more() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    let subscription = Subscription::new(10, Full::DropOldest);
    let wants = Wants::from([(signals(rmd(1), &["speed_dps"])[0], CENTISECOND)]);
    let id = engine.acquisition.subscribe(subscription.clone(), wants);
    engine.run(SECOND);
    assert!(subscription.lost() > 50);
    engine.acquisition.unsubscribe(id);
    assert!(subscription.is_closed());
    assert_eq!(engine.acquisition.rates().count(), 0);
    let rest = std::iter::from_fn(|| subscription.take()).count();
    engine.run(SECOND);
    assert!(rest <= 11 && subscription.take().is_none());
}

#[test]
fn a_motor_is_commanded_watched_and_stopped() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    let speed = signals(rmd(2), &["speed_dps"]);
    let subscription = engine.subscribe(&speed, CENTISECOND);
    engine.run(Micros(100_000));
    let id = MotorId::new(2).unwrap();
    let turn = SetSpeed { speed: CentiDps::from_dps(360.0) };
    let started = engine.command(Request::rmd(id, &turn)).unwrap();
    engine.run(SECOND);
    assert!(matches!(engine.result(started), Some(Ok(Reply::Rmd([0xA2, ..])))));
    let stopped = engine.stop(Request::rmd(id, &Stop));
    engine.latch();
    engine.run(SECOND);
    assert!(matches!(engine.result(stopped), Some(Ok(Reply::Rmd([0x81, ..])))));
    let got = Got::of(&subscription);
    let fastest = got.values(speed[0]).into_iter().map(|(_, dps)| dps).fold(0.0, f64::max);
    assert!((fastest - 360.0).abs() < 40.0, "{fastest}");
    assert!(got.values(speed[0]).last().unwrap().1.abs() < 5.0);

    let refused = engine.command(Request::rmd(id, &turn)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "operator latched: motion is refused until the latch is released"
    );
    let off = engine.command(Request::rmd(id, &Off)).unwrap();
    engine.run(CENTISECOND);
    assert!(matches!(engine.result(off), Some(Ok(_))));
    engine.acquisition.release(&"operator".into());
    assert!(engine.command(Request::rmd(id, &turn)).is_ok());
    let told: Vec<_> = Got::of(&subscription).events().map(name).collect();
    assert!(told.ends_with(&["Released"]), "{told:?}");
}

/// What a good line tells.
fn is_good(what: &What) -> bool {
    matches!(what, What::Heard(_) | What::Confirmed(..))
}

fn name(what: &What) -> &'static str {
    match what {
        What::Lost(_) => "Lost",
        What::Back => "Back",
        What::Unanswered(..) => "Unanswered",
        What::Silent(..) => "Silent",
        What::Answers(_) => "Answers",
        What::Heard(_) => "Heard",
        What::Refused(..) => "Refused",
        What::Doubtful(..) => "Doubtful",
        What::Confirmed(..) => "Confirmed",
        What::Commanded(..) => "Commanded",
        What::Stopping(..) => "Stopping",
        What::Stopped(_) => "Stopped",
        What::StopFailed(..) => "StopFailed",
        What::Latched(_) => "Latched",
        What::Released(_) => "Released",
    }
}

#[test]
fn an_st_motor_is_started_and_stopped_between_the_polls() {
    let bench = bench();
    let mut engine = st_engine(&bench, "");
    let speed = signals(st(1), &["SPEED_MEAS", "STATUS"]);
    let subscription = engine.subscribe(&speed, CENTISECOND);
    let ramp = st::Ramp { speed_rpm: 1500, duration_ms: 300 };
    engine.command(Request::st(1, st::Request::SetRamp(ramp))).unwrap();
    engine.command(Request::st(1, st::Request::ExecuteCommand(st::Command::StartMotor))).unwrap();
    engine.run(Micros(4 * SECOND.0));
    let stop = Request::st(1, st::Request::ExecuteCommand(st::Command::StopMotor));
    let stopped = engine.stop(stop);
    engine.run(Micros(2 * SECOND.0));
    assert!(matches!(engine.result(stopped), Some(Ok(_))));
    let got = Got::of(&subscription);
    let rpm: Vec<_> = got.values(speed[0]).into_iter().map(|(_, rpm)| rpm).collect();
    let fastest = rpm.iter().copied().fold(0.0, f64::max);
    assert!((fastest - 1500.0).abs() < 100.0, "{fastest}");
    assert!(rpm.last().unwrap().abs() < 30.0, "{:?}", rpm.last());
    // 4 s at 100 Hz, and not one instant less for the commands.
    assert!(rpm.len() >= 397, "{}", rpm.len());
}

#[test]
fn a_command_beyond_a_limit_is_refused_and_nothing_is_sent() {
    let bench = bench();
    let mut options = st_options(Profile::Spec);
    options.limits.current_s16a = Some(100);
    let mut engine = Engine::st(bench.bytes(&spec("")), options);
    let value = 200i16.to_le_bytes();
    let write = st::Request::SetRegister { register: RegisterId::TORQUE_REF, value: &value };
    let id = engine.command(Request::st(1, write)).unwrap();
    engine.run(CENTISECOND);
    let Some(Err(CommandError::Line(LineError::St(error)))) = engine.result(id) else {
        panic!("{:?}", engine.ended)
    };
    assert!(error.to_string().contains("limit"), "{error}");
}

#[test]
fn an_absent_motor_is_said_once_and_slows_no_other() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    let mut wanted = signals(rmd(1), &["speed_dps"]);
    wanted.extend(signals(rmd(9), &["speed_dps"]));
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(Micros(4 * SECOND.0));
    let got = Got::of(&subscription);
    assert!(got.values(wanted[0]).len() >= 398, "{}", got.values(wanted[0]).len());
    assert!(got.values(wanted[1]).is_empty());
    let silent: Vec<_> = got.events().filter(|what| !is_good(what)).collect();
    assert!(
        matches!(silent[..], [What::Unanswered(first, _), What::Silent(motor, _)]
            if [first, motor] == [&rmd(9); 2]),
        "{silent:?}"
    );
}

#[test]
fn two_motors_of_a_line_are_confirmed_and_fall_silent_together() {
    let wanted: Vec<Signal> =
        [1, 2].into_iter().flat_map(|n| signals(st(n), &["STATUS"])).collect();
    let mut engine = st_engine(&bench(), "");
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(SECOND);
    let mut rows = Rows::new(wanted.clone());
    std::iter::from_fn(|| subscription.take()).for_each(|record| rows.take(&record));
    let rows = std::iter::from_fn(|| rows.next_item()).count();
    assert!((85..=100).contains(&rows), "{rows}");

    let mut engine = st_engine(&bench(), "drop=0.02,seed=1");
    let subscription = engine.subscribe(&wanted, CENTISECOND);
    engine.run(Micros(6 * SECOND.0));
    let got = Got::of(&subscription);
    let of = |wanted: Motor| {
        got.events()
            .filter_map(|what| match what {
                What::Silent(motor, _) | What::Answers(motor) | What::Doubtful(motor, _) => {
                    (*motor == wanted).then(|| name(what))
                }
                _ => None,
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(of(st(1)), of(st(2)));
    assert!(["Silent", "Answers"].iter().all(|it| of(st(1)).contains(it)), "{:?}", of(st(1)));
}

#[test]
fn a_latch_refuses_motion_that_waits() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    let id = MotorId::new(1).unwrap();
    let turn = SetSpeed { speed: CentiDps::from_dps(360.0) };
    let waits = engine.command(Request::rmd(id, &turn)).unwrap();
    let reads = engine.command(Request::rmd(id, &ReadStatus)).unwrap();
    engine.latch();
    engine.acquisition.release(&"operator".into());
    engine.run(SECOND);
    assert!(matches!(engine.result(waits), Some(Err(CommandError::Latched(_)))));
    assert!(matches!(engine.result(reads), Some(Ok(_))));
    let at = bench.signals().iter().position(|it| it.name == "rmd1.speed_dps").unwrap();
    assert!(bench.values()[at].abs() < 1.0);
}

#[test]
fn a_stop_gets_through_a_bad_line() {
    for seed in 0..3 {
        let bench = bench();
        let mut engine = rmd_engine(&bench, &format!("drop=0.2,seed={seed}"));
        engine.subscribe(&signals(rmd(1), &["speed_dps"]), CENTISECOND);
        let id = MotorId::new(1).unwrap();
        let turn = SetSpeed { speed: CentiDps::from_dps(360.0) };
        for _ in 0..5 {
            engine.command(Request::rmd(id, &turn)).unwrap();
        }
        engine.run(SECOND);
        let at = bench.signals().iter().position(|it| it.name == "rmd1.speed_dps").unwrap();
        assert!(bench.values()[at] > 300.0, "seed {seed}: {}", bench.values()[at]);
        let stopped = engine.stop(Request::rmd(id, &Stop));
        engine.run(SECOND);
        assert!(matches!(engine.result(stopped), Some(Ok(_))), "seed {seed}: {:?}", engine.ended);
        assert!(bench.values()[at].abs() < 5.0, "seed {seed}: {}", bench.values()[at]);
    }
}

#[test]
fn the_sender_of_a_command_is_named_in_an_event() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    let subscription = engine.subscribe(&[], CENTISECOND);
    let by: Arc<str> = "arm".into();
    let id = MotorId::new(1).unwrap();
    let sent = engine.acquisition.command(&by, Request::rmd(id, &Off), SECOND).unwrap();
    engine.run(CENTISECOND);
    let got = Got::of(&subscription);
    let told = got.events().any(|what| {
        matches!(what, What::Commanded(id, who, Request::Rmd(..)) if *id == sent && *who == by)
    });
    assert!(told, "{:?}", got.records);
}

#[test]
fn a_latch_refuses_commands_whose_effect_is_unknown() {
    let bench = bench();
    let mut engine = rmd_engine(&bench, "");
    engine.latch();
    let id = MotorId::new(1).unwrap();
    for code in 0..=u8::MAX {
        let sent = engine.command(Request::Rmd(id, [code, 0, 0, 0, 0, 0, 0, 0]));
        let row = Code::from(code).info();
        let is_harmless = row.is_some_and(|row| !row.motion.may_move());
        assert_eq!(sent.is_ok(), is_harmless, "{code:#04x}");
    }
}

#[test]
fn a_stop_overtakes_the_commands_of_its_own_motor_only() {
    let bench = bench();
    let mut engine = st_engine(&bench, "");
    let ramp = st::Ramp { speed_rpm: 900, duration_ms: 100 };
    let [first, second] =
        [1, 2].map(|motor| engine.command(Request::st(motor, st::Request::SetRamp(ramp))).unwrap());
    let stop = st::Request::ExecuteCommand(st::Command::StopMotor);
    let stop = engine.stop(Request::st(1, stop));
    engine.run(SECOND);
    let overtaken = engine.result(first);
    assert!(matches!(overtaken, Some(Err(CommandError::Overtaken))), "{:?}", engine.ended);
    assert!(matches!(engine.result(second), Some(Ok(_))), "{:?}", engine.ended);
    assert!(matches!(engine.result(stop), Some(Ok(_))), "{:?}", engine.ended);
}
