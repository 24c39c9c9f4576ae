//! A line of a share as a port: clients of both protocols, alone and beside others.

mod engine;

use std::os::unix::net::UnixListener;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::asking::Asker;
use crate::faulty::{deaf, repeating};
use crate::scripted::{self, Scripted};
use crate::shared::{LIMIT, PATIENT, Share};
use crate::stopping::eventually;
use motorlink::port::{Ending, NotDone, PortError, PortName};
use motorlink::st::{self, Profile, RegisterId, Status};
use motorlink::{LinkState, rmd};
use motorlink_proto::rmd::{MotorId, MotorSet, ReadStatus, SetSpeed, SetTorque4, Stop};
use motorlink_proto::st::{Command, ErrorCode, MotorNumber, Ramp, Request};
use motorlink_proto::time::Micros;
use motorlink_proto::units::{CentiDps, IqCommand, Quantity};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::event::{CommandError, What};
use motorlink_telemetry::line::{self, RmdLine, StLine};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::share::message::{
    self, Answer, Ask, EventKind, Line, MotorName, Protocol, WireFrame,
};
use motorlink_telemetry::share::port;
use motorlink_telemetry::signal::{Motor, Signal};
use motorlink_telemetry::subscription::{Full, Record, Subscription};

impl Share {
    fn port(&self, line: &str) -> PortName {
        port::register();
        format!("share:{}/{line}", self.path.display()).parse().unwrap()
    }

    fn st(&self) -> st::Client {
        st::Client::open(&self.port("st0"), Default::default()).unwrap()
    }

    fn rmd(&self) -> rmd::Client {
        rmd::Client::open(&self.port("rmd0"), Default::default()).unwrap()
    }
}

/// A program that joins a share, and latches it.
fn latched(share: &Share) -> Asker {
    let mut operator = Asker::join(&share.path, "operator");
    operator.ask(Ask::Latch).unwrap();
    operator
}

/// The stops since the last call. Answers overtake events, so it asks twice.
fn stops(witness: &mut Asker) -> usize {
    witness.ask(Ask::Latch).unwrap();
    witness.lines();
    witness.events.drain(..).filter(|event| event.event == EventKind::Stopping).count()
}

fn start(client: &st::Client) {
    let motor = client.motor(1).unwrap();
    sent(|| motor.set_ramp(Ramp { speed_rpm: 1500, duration_ms: 100 }));
    sent(|| motor.start());
}

/// Sends a command. A busy machine may be late: then nothing was sent.
fn sent<T>(command: impl Fn() -> Result<T, st::Error>) {
    let mut done = command();
    while let Err(st::Error::Port(PortError::NotDone { kind: NotDone::Unsent, .. })) = done {
        done = command();
    }
    done.unwrap();
}

fn not_done(error: st::Error) -> (NotDone, String) {
    match error {
        st::Error::Port(PortError::NotDone { kind, why, .. }) => (kind, why),
        other => panic!("{other}"),
    }
}

fn id(number: u8) -> MotorId {
    MotorId::new(number).unwrap()
}

#[test]
fn an_st_client_reads_writes_and_is_refused_as_on_a_port_of_its_own() {
    let share = Share::new("st");
    let client = share.st();
    let read =
        |register| client.exchange(1, &Request::GetRegister(register), |it| Some(it.to_vec()));
    // On a busy machine the engine may begin later than the time to live of the first one.
    eventually(|| client.confirm().is_ok());
    let write = Request::SetRegister { register: RegisterId::SPEED_KP, value: &[77, 0] };
    client.exchange(1, &write, |_| Some(())).unwrap();
    assert_eq!(read(RegisterId::SPEED_KP).unwrap(), [77, 0]);
    client.confirm().unwrap();
    assert_eq!(client.board_info().unwrap().profile, Profile::Spec);
    let refused = client.raw(5, 2, &[RegisterId::STATUS.0]).unwrap_err();
    assert!(
        matches!(&refused, st::Error::Refused { code: ErrorCode::BadMotorSelected, .. }),
        "{refused}"
    );
    // A frame code that no profile has.
    let refused = client.raw(1, 0x1F, &[]).unwrap_err();
    assert!(
        matches!(&refused, st::Error::Refused { code: ErrorCode::BadFrameId, .. }),
        "{refused}"
    );
    // The last request of any program has selected this motor.
    let (kind, why) = not_done(client.raw(0, 2, &[RegisterId::SPEED_MEAS.0]).unwrap_err());
    assert_eq!(kind, NotDone::Usage);
    assert!(why.contains("a number from 1 to 7"), "{why}");
    assert_eq!(client.link_state(), LinkState::Open);
    client.confirm().unwrap();
}

#[test]
fn a_client_that_ends_leaves_motors_that_another_one_has_moved_since() {
    let share = Share::new("moved-since");
    let [(alice, alices), (bob, bobs)] = [(); 2].map(|()| (share.st(), share.rmd()));
    start(&alice);
    start(&bob);
    for client in [&alices, &bobs] {
        client.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap();
    }
    assert!(alice.stop_on_drop().stop_now().is_empty());
    assert!(alices.stop_on_drop().stop_now().is_empty());
    assert_eq!((alice.started().count(), alices.moving().len()), (0, 0));
    drop((alice, alices));
    let mut witness = Asker::join(&share.path, "witness");
    assert_eq!(stops(&mut witness), 0);
    share.reaches("st1.speed_rpm", |rpm| rpm > 1400.0);
    share.reaches("rmd1.speed_dps", |dps| dps > 350.0);
    // What it owns it stops.
    assert!(bob.stop_on_drop().stop_now().iter().all(|one| one.result.is_ok()));
    assert!(bobs.stop_on_drop().stop_now().iter().all(|one| one.result.is_ok()));
    share.reaches("st1.speed_rpm", |rpm| rpm == 0.0);
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 1.0);
}

/// 0x80 of a program that has nothing to do with the load any more lets it fall.
#[test]
fn a_client_that_ends_does_not_switch_off_a_motor_that_another_one_has_stopped() {
    let share = Share::new("holds");
    let (alice, bob) = (share.rmd(), share.rmd());
    for client in [&alice, &bob] {
        client.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap();
    }
    bob.motor(1).unwrap().stop().unwrap();
    assert!(alice.stop_on_drop().with(rmd::StopAction::Off).stop_now().is_empty());
    let mut witness = Asker::join(&share.path, "witness");
    let frames = witness.frames("rmd0", Some(0.0), None);
    let of_code = |code| frames.iter().filter(|frame| frame.bytes.starts_with(code)).count();
    assert_eq!((of_code("80"), of_code("81")), (0, 2), "{frames:?}");
}

#[test]
fn a_client_that_is_refused_has_no_motor_to_stop() {
    let share = Share::leasing("refused", PATIENT, Some(PATIENT), |link| link);
    let [alice, bob] = [(); 2].map(|()| share.rmd());
    alice.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap();
    bob.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap_err();
    assert_eq!((alice.moving().len(), bob.moving().len()), (1, 0));
    // What a command does that waits for the end of its move, and was refused.
    assert!(bob.stop_on_drop().stop_now().is_empty());
    drop(bob);
    let mut witness = Asker::join(&share.path, "witness");
    assert_eq!(stops(&mut witness), 0);
}

#[test]
fn a_share_ends_the_motion_of_a_client_as_the_client_has_declared() {
    let share = Share::new("declared");
    let mut witness = Asker::join(&share.path, "witness");
    for (ending, code) in [(Ending::Stop, "81"), (Ending::Off, "80"), (Ending::Nothing, "a2")] {
        let client = share.rmd();
        client.end_with(ending);
        client.motor(1).unwrap().set_speed(CentiDps(36_000)).unwrap();
        share.reaches("rmd1.speed_dps", |dps| dps > 350.0);
        // As if it was killed.
        drop(client);
        witness.event(EventKind::Left);
        match ending {
            Ending::Nothing => share.reaches("rmd1.speed_dps", |dps| dps > 350.0),
            _ => share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0),
        }
        // The engine keeps a frame after it has sent it.
        let is_last = |frame: &WireFrame| frame.bytes.starts_with(code);
        eventually(|| witness.frames("rmd0", Some(0.0), None).last().is_some_and(is_last));
    }
    // It has no owner. The next program that moves it owns it.
    let next = share.rmd();
    next.motor(1).unwrap().set_speed(CentiDps(18_000)).unwrap();
    drop(next);
    share.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0);
}

#[test]
fn a_refusal_of_the_share_is_told_in_words_and_leaves_the_connection_open() {
    let share = Share::new("port-latch");
    let (mine, other) = (share.st(), share.st());
    start(&mine);
    let mut program = latched(&share);
    let motor = other.motor(1).unwrap();
    for _ in 0..2 {
        let (kind, why) = not_done(motor.start().unwrap_err());
        assert_eq!(kind, NotDone::Latched);
        assert!(why.contains("motion is refused until the latch is released"), "{why}");
    }
    other.confirm().unwrap();
    // The client that started the motor is refused, too, and its connection stays.
    not_done(mine.motor(1).unwrap().start().unwrap_err());
    share.reaches("st1.speed_rpm", |rpm| rpm > 1400.0);
    motor.stop_until_confirmed().unwrap();
    while motor.status().unwrap() != Status::Idle {}
    program.ask(Ask::Release).unwrap();
    start(&other);
    share.reaches("st1.speed_rpm", |rpm| rpm > 1000.0);
}

#[test]
fn rmd_motors_answer_and_a_missing_one_is_silent() {
    let share = Share::with("rmd", Duration::from_secs(1), |link| link);
    let bus = share.rmd();
    bus.ask(id(1), &ReadStatus).unwrap();
    bus.confirm(id(1)).unwrap();
    let mut found = Vec::new();
    let ids = (1..=6).map(id).collect();
    bus.scan(ids, |it| found.push(it), |_| {}).unwrap();
    assert_eq!(found.len(), 4);
    let missing = bus.ask(id(9), &ReadStatus).unwrap_err();
    assert!(matches!(&missing, rmd::Error::Timeout { .. }), "{missing}");
    let torques = SetTorque4([20, 0, 0, 20].map(IqCommand::from_digits));
    let replies = bus.set_torque4(torques, [id(1), id(4)].into_iter().collect()).unwrap();
    let answered: Vec<_> = replies.iter().map(|it| it.as_ref().map(|it| it.is_ok())).collect();
    assert_eq!(answered, [Some(true), None, None, Some(true)]);
    share.reaches("rmd4.speed_dps", |dps| dps > 5.0);
    bus.confirm(id(4)).unwrap();
    drop(bus);
    share.reaches("rmd4.speed_dps", |dps| dps < 5.0);
}

#[test]
fn the_other_profile_is_refused_before_anything_is_sent() {
    let share = Share::new("profile");
    let options = st::Options { profile: Profile::Mcsdk54, ..Default::default() };
    let Err(error) = st::Client::open(&share.port("st0"), options) else { panic!("it is open") };
    assert!(
        matches!(&error, st::Error::Port(PortError::HeldInProfile { profile: "spec", .. })),
        "{error}"
    );
    let Err(error) = st::EventClient::open(&share.port("st0"), options) else { panic!("open") };
    assert!(error.to_string().contains("profile spec"), "{error}");
}

#[test]
fn the_end_of_a_share_is_told_at_once() {
    let mut share = Share::new("port-end");
    let client = share.st();
    start(&client);
    let ended = share.end();
    assert!(ended.iter().all(|(_, one)| one.result.is_ok()), "{ended:?}");
    let began = Instant::now();
    let error = client.confirm().unwrap_err().to_string();
    assert!(error.contains("the share closed the connection: the test is over"), "{error}");
    let error = client.confirm().unwrap_err().to_string();
    assert!(error.contains("no share is at"), "{error}");
    assert!(began.elapsed() < Duration::from_secs(5));
}

#[test]
fn no_wrong_value_is_confirmed_on_a_line_that_repeats_replies() {
    let share = repeating("repeats", 0.02);
    let (client, other) = (share.st(), share.st());
    let registers = [RegisterId::SPEED_KP, RegisterId::SPEED_KI, RegisterId::TORQUE_KP];
    let (mut confirmed, mut round) = (0, 0u8);
    // Which replies are repeated depends on what the share asks meanwhile.
    while round < 10 || confirmed < 2 {
        round = round.checked_add(1).expect("some rounds are confirmed");
        let register = registers[usize::from(round) % 3];
        let value = [round, 0];
        let write = Request::SetRegister { register, value: &value };
        let written = client.exchange(1, &write, |_| Some(()));
        let _ = other.motor(1).unwrap().status();
        let read = client.exchange(1, &Request::GetRegister(register), |it| Some(it.to_vec()));
        let (Ok(()), Ok(read), Ok(())) = (written, read, client.confirm()) else { continue };
        assert_eq!(read, value, "round {round}");
        confirmed += 1;
    }
}

/// The first command that a share gets.
fn first_command(socket: &UnixListener) -> Ask {
    let profile = Some(Profile::Spec.name().to_owned());
    let line = || Line { profile: profile.clone(), ..scripted::line("st0", Protocol::St) };
    Scripted::accept(socket).asked(line).expect("the port was closed").ask
}

#[test]
fn a_command_of_an_engine_lives_no_longer_at_the_share() {
    let path = crate::drives::path("share-expires", "socket");
    let socket = UnixListener::bind(&path).unwrap();
    let share = std::thread::spawn(move || first_command(&socket));
    port::register();
    let port: PortName = format!("share:{}/st0", path.display()).parse().unwrap();
    let line = StLine::open(&port, Default::default()).unwrap();
    let mut engine = Acquisition::new(Box::new(line));
    let start = line::Request::st(1, Request::ExecuteCommand(Command::StartMotor));
    engine.command(&"test".into(), start, Micros::from_millis(500)).unwrap();
    engine.advance(&mut |_, _| {});
    let Ask::Command { time_to_live, .. } = share.join().unwrap() else { panic!("no command") };
    assert!((0.0..=0.5).contains(&time_to_live), "{time_to_live}");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn what_a_program_has_declared_holds_at_the_next_share_too() {
    let path = crate::drives::path("share-declares", "socket");
    let socket = UnixListener::bind(&path).unwrap();
    // It ends after the first command, and begins again.
    let share = std::thread::spawn(move || {
        let mut asks = Vec::new();
        for _ in 0..2 {
            asks.clear();
            let mut share = Scripted::accept(&socket);
            while let Some(asked) = share.asked(|| scripted::line("rmd0", Protocol::Rmd)) {
                let answer = match &asked.ask {
                    Ask::Command { bytes, .. } => {
                        Answer::Command { bytes: [&bytes[..1], &[7; 7]].concat() }
                    }
                    Ask::Ending { .. } => Answer::Ending,
                    _ => Answer::Claim,
                };
                share.answer(asked.id, answer);
                asks.push(asked.ask);
                if matches!(asks.last(), Some(Ask::Command { .. })) {
                    break;
                }
            }
        }
        asks
    });
    port::register();
    let port = format!("share:{}/rmd0", path.display()).parse().unwrap();
    let client = rmd::Client::open(&port, Default::default()).unwrap();
    client.end_with(Ending::Nothing);
    let _ = client.ask(id(1), &SetSpeed { speed: CentiDps::from_digits(10_000) });
    while !share.is_finished() {
        let _ = client.ask(id(1), &ReadStatus);
    }
    let asks = share.join().unwrap();
    let declared = [
        Ask::Ending { motion: message::Ending::Nothing },
        Ask::Claim { motor: MotorName { line: "rmd0".to_owned(), motor: 1 } },
    ];
    assert_eq!(&asks[..2], &declared, "{asks:?}");
    std::fs::remove_file(path).unwrap();
}

#[test]
fn each_of_many_motors_is_confirmed_at_once() {
    let path = crate::drives::path("share-asks", "socket");
    let socket = UnixListener::bind(&path).unwrap();
    // All motors answer each command.
    let share = std::thread::spawn(move || {
        let (mut share, mut confirmed) = (Scripted::accept(&socket), Vec::new());
        while let Some(asked) = share.asked(|| scripted::line("rmd0", Protocol::Rmd)) {
            let answer = match asked.ask {
                Ask::Command { bytes, .. } => {
                    Answer::Command { bytes: [&bytes[..1], &[7; 7]].concat() }
                }
                ask => {
                    confirmed.extend(matches!(ask, Ask::Confirm { .. }).then_some(ask));
                    Answer::Confirm
                }
            };
            share.answer(asked.id, answer);
        }
        confirmed
    });
    port::register();
    let port = format!("share:{}/rmd0", path.display()).parse().unwrap();
    let client = rmd::Client::open(&port, Default::default()).unwrap();
    let motors = [1, 2, 3].map(|number| (id(number), rmd::Asked::Confirmation));
    client.ask_each(&motors, |id, reply, _| assert!(reply.is_ok(), "{id}")).unwrap();
    drop(client);
    let confirm = |motor| Ask::Confirm { line: "rmd0".to_owned(), motor };
    assert_eq!(share.join().unwrap(), [1, 2, 3].map(confirm));
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_client_does_not_repeat_a_stop_that_the_share_has_repeated() {
    let share = deaf("once");
    let mut witness = Asker::join(&share.path, "operator");
    let bus = share.rmd();
    // No motor, but the share does not know.
    bus.ask(id(9), &SetSpeed { speed: CentiDps::from_digits(36_000) }).unwrap_err();
    let client = share.st();
    let failed = client.motor(1).unwrap().stop_until_confirmed().unwrap_err();
    assert!(failed.to_string().contains("no reply in time"), "{failed}");
    assert_eq!(stops(&mut witness), 1);
    let failed = bus.motor(9).unwrap().stop_until_confirmed().unwrap_err();
    assert!(matches!(failed, rmd::Error::Timeout { .. }), "{failed}");
    assert_eq!(stops(&mut witness), 1);
}

#[test]
fn an_engine_does_not_repeat_a_stop_that_the_share_has_repeated() {
    let share = deaf("engine-stops");
    let mut witness = Asker::join(&share.path, "operator");
    let st = StLine::open(&share.port("st0"), Default::default()).unwrap();
    let rmd = RmdLine::open(&share.port("rmd0"), Default::default()).unwrap();
    let client = share.rmd();
    client.ask(id(9), &SetSpeed { speed: CentiDps::from_digits(36_000) }).unwrap_err();
    let stop = Request::ExecuteCommand(Command::StopMotor);
    let engines = [
        (Acquisition::new(Box::new(st)), line::Request::st(1, stop)),
        (Acquisition::new(Box::new(rmd)), line::Request::rmd(id(9), &Stop)),
    ];
    for (mut engine, request) in engines {
        engine.stop(&Arc::from("operator"), request, None, &mut |_, _| {});
        let until = Instant::now() + LIMIT;
        let mut ends: Vec<Result<_, CommandError>> = Vec::new();
        while ends.is_empty() {
            assert!(Instant::now() < until, "the stop has no end");
            engine.advance(&mut |_, result| ends.push(result));
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(matches!(ends[..], [Err(CommandError::Line(_))]), "{ends:?}");
        assert_eq!(stops(&mut witness), 1);
    }
}

#[test]
fn a_stop_of_all_ids_of_a_share_is_certain_and_fails_for_a_motor_that_was_turned_and_is_silent() {
    let share = deaf("all");
    let mut operator = Asker::join(&share.path, "operator");
    let client = share.rmd();
    // What a busy machine answers late is lost for the share, and then silence says nothing.
    let stop_all = || {
        let until = Instant::now() + LIMIT;
        loop {
            let stopping = client.stop_all_until_confirmed(Default::default());
            if stopping.lost == 0 {
                return stopping;
            }
            assert!(Instant::now() < until, "{stopping:?}");
        }
    };
    let stopping = stop_all();
    assert!(stopping.failed.is_empty() && stopping.is_silence_certain(), "{stopping:?}");
    assert_eq!(stopping.confirmed.len() + stopping.silent.len(), MotorSet::ALL.len());
    // The IDs without a motor are no alarm.
    assert!(stops(&mut operator) <= stopping.confirmed.len());
    // Its replies are lost: only the share knows of it.
    operator.ask(Ask::Release).unwrap();
    share.rmd().ask(id(9), &SetSpeed { speed: CentiDps::from_digits(36_000) }).unwrap_err();
    let stopping = stop_all();
    let failed: MotorSet = stopping.failed.iter().map(|(id, _)| *id).collect();
    assert_eq!(failed, id(9).into(), "{stopping:?}");
    assert!(!stopping.silent.contains(id(9)) && stopping.is_silence_certain(), "{stopping:?}");
}
