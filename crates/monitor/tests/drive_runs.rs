//! Motion of pages, through a real share: what is on the wire, and what ends it.

use std::time::Duration;

use crate::world::{Page, Sent, World, connect, rmd, st};
use motorlink_monitor::message::{Answer, Ask, Mode};
use motorlink_proto::rmd::{Code, Payload, SetPositionLimited, SetSpeed, SetTorque};
use motorlink_proto::st::{CurrentReference, Profile, Ramp, Request, TorqueRamp};
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::share::message::{self as share, MotorName, Reason};

fn run(motor: MotorName, mode: Mode, target: f64, rate: f64) -> Ask {
    Ask::Run { motor, mode, target, rate, hold: false }
}

async fn from(page: &Page, ask: Ask) -> f64 {
    match page.ask(ask).await {
        Ok(Answer::Run { from, .. }) => from,
        other => panic!("{other:?}"),
    }
}

/// Asks again if a reference of another server comes while the run begins.
async fn begun(page: &Page, ask: Ask) -> f64 {
    loop {
        match page.ask(ask.clone()).await {
            Ok(Answer::Run { from, .. }) => return from,
            Err(Refusal { reason: Reason::Overtaken, .. }) => {}
            other => panic!("{other:?}"),
        }
    }
}

fn speeds(frames: &[Vec<u8>]) -> Vec<f64> {
    let speed = |frame: &Vec<u8>| SetSpeed::decode(&frame[..].try_into().unwrap()).speed.dps();
    frames.iter().filter(|frame| frame[0] == u8::from(Code::SetSpeed)).map(speed).collect()
}

fn torques(frames: &[Vec<u8>]) -> Vec<f64> {
    let iq = |frame: &Vec<u8>| SetTorque::decode(&frame[..].try_into().unwrap()).iq.amps();
    frames.iter().filter(|frame| frame[0] == u8::from(Code::SetTorque)).map(iq).collect()
}

/// Waits until the wire has what is wanted.
async fn until<T>(what: impl Fn() -> Option<T>) -> T {
    let end = std::time::Instant::now() + crate::world::LIMIT;
    loop {
        if let Some(found) = what() {
            return found;
        }
        assert!(std::time::Instant::now() < end, "it did not happen");
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

/// Waits until no frame has moved the motor for several periods of references; gives how many there are.
async fn quiet(world: &World, motor: u8) -> usize {
    let mut before = world.rmd_motion(motor).len();
    loop {
        tokio::time::sleep(Duration::from_millis(300)).await;
        let now = world.rmd_motion(motor).len();
        if now == before {
            return now;
        }
        before = now;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_speed_goes_from_the_measured_value_to_the_target() {
    let world = World::new("run-speed", Profile::Spec);
    let page = world.page().await;
    assert_eq!(from(&page, run(rmd(1), Mode::Speed, 360.0, 1800.0)).await, 0.0);
    world.reaches("rmd1.speed_dps", |dps| dps > 340.0).await;
    until(|| (speeds(&world.rmd_motion(1)).last() == Some(&360.0)).then_some(())).await;
    quiet(&world, 1).await;
    let up = speeds(&world.rmd_motion(1));
    assert_eq!(up[0], 0.0);
    assert!(up.is_sorted() && up.windows(2).all(|two| two[1] - two[0] <= 36.01), "{up:?}");
    assert!(up.ends_with(&[360.0; 3]), "its reply may be a late one: {up:?}");

    let measured = from(&page, run(rmd(1), Mode::Speed, -100.0, 4000.0)).await;
    assert!((measured - 360.0).abs() < 20.0, "{measured}");
    let down = until(|| {
        let down = speeds(&world.rmd_motion(1)[up.len()..]);
        (down.last() == Some(&-100.0)).then_some(down)
    })
    .await;
    assert_eq!(down[0], measured);
    assert!(down.is_sorted_by(|a, b| a >= b), "{down:?}");
    page.stop(rmd(1)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_reference_exceeds_a_limit() {
    let world = World::new("run-limit", Profile::Spec);
    let page = world.page().await;
    let limit = |mode, most| Ask::Limit { motor: rmd(1), mode, most: Some(most) };
    page.act(rmd(1), "set_speed", &[("speed_dps", 300.0)]).await.unwrap();
    // The drive filters the speed that it measures: a run begins with what it says.
    while !matches!(page.read(rmd(1), &["speed_dps"]).await[..], [(Some(dps), _)] if dps > 280.0) {}
    page.ask(limit(Mode::Speed, 100.0)).await.unwrap();
    page.ask(limit(Mode::Torque, 0.5)).await.unwrap();
    let sent = world.rmd_motion(1).len();
    for ask in [
        run(rmd(1), Mode::Speed, 100.5, 10.0),
        run(rmd(1), Mode::Torque, 0.6, 1.0),
        run(rmd(1), Mode::Position, 10.0, 101.0),
        run(rmd(1), Mode::Speed, f64::NAN, 10.0),
        run(rmd(1), Mode::Speed, 50.0, 0.0),
        run(rmd(1), Mode::Speed, 50.0, -1.0),
        run(rmd(1), Mode::Speed, 50.0, f64::NAN),
        run(st(1), Mode::Position, 1.0, 1.0),
        run(st(1), Mode::Speed, 1e7, 1.0),
    ] {
        assert_eq!(page.refused(ask).await.0, Reason::Usage);
    }
    assert_eq!(world.rmd_motion(1).len(), sent);
    // It turns faster than the limit, which is the first reference then.
    assert_eq!(from(&page, run(rmd(1), Mode::Speed, -80.0, 2000.0)).await, 100.0);
    until(|| (speeds(&world.rmd_motion(1)).last() == Some(&-80.0)).then_some(())).await;
    let first = from(&page, run(rmd(1), Mode::Torque, 0.5, 5.0)).await;
    assert!(first.abs() <= 0.5, "{first}");
    until(|| (torques(&world.rmd_motion(1)).last() == Some(&0.496)).then_some(())).await;
    let frames = &world.rmd_motion(1)[sent..];
    assert!(speeds(frames).iter().all(|dps| dps.abs() <= 100.0), "{frames:?}");
    assert!(torques(frames).iter().all(|amps| amps.abs() <= 0.5), "{frames:?}");
    // A limit that is set during a run ends it.
    from(&page, run(rmd(1), Mode::Speed, 90.0, 1.0)).await;
    page.ask(limit(Mode::Speed, 1.0)).await.unwrap();
    let end = quiet(&world, 1).await;
    assert_ne!(speeds(&world.rmd_motion(1)[..end]).last(), Some(&90.0));
    page.stop(rmd(1)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_position_is_the_drives_own_move() {
    let world = World::new("run-position", Profile::Spec);
    let page = world.page().await;
    let start = page.read(rmd(2), &["multi_turn_angle_degrees"]).await[0].0.unwrap();
    let measured = from(&page, run(rmd(2), Mode::Position, start + 90.0, 400.0)).await;
    assert!((measured - start).abs() < 1.0);
    let frames = world.rmd_motion(2);
    assert_eq!(frames.len(), 1);
    let sent = SetPositionLimited::decode(&frames[0][..].try_into().unwrap());
    assert_eq!(sent.max_speed.0, 400);
    assert!((sent.angle.degrees() - start - 90.0).abs() < 0.02);
    let angle = async || page.read(rmd(2), &["multi_turn_angle_degrees"]).await[0].0.unwrap();
    let end = std::time::Instant::now() + crate::world::LIMIT;
    while (angle().await - start - 90.0).abs() > 2.0 {
        assert!(std::time::Instant::now() < end);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stop_ends_a_run_and_no_reference_follows() {
    let world = World::new("run-stop", Profile::Spec);
    let page = world.page().await;
    let other = world.other(&page).await;
    let (program, _listening) = connect(&world.share.path, "shell").await;
    let is_stop = |frame: &Vec<u8>| Code::from(frame[0]).motion().stops();
    for stopping in 0..6 {
        let begin = world.rmd_motion(1).len();
        from(&page, run(rmd(1), Mode::Speed, 3000.0, 100.0)).await;
        until(|| (world.rmd_motion(1).len() - begin > 2).then_some(())).await;
        match stopping {
            0 => page.stop(rmd(1)).await,
            1 => other.stop(rmd(1)).await,
            2 => drop(program.ask(share::Ask::Stop { motor: Some(rmd(1)) }).await.unwrap()),
            3 => drop(program.ask(share::Ask::Stop { motor: None }).await.unwrap()),
            4 => drop(page.act(rmd(1), "stop", &[]).await.unwrap()),
            _ => drop(other.act(rmd(1), "off", &[]).await.unwrap()),
        }
        let end = quiet(&world, 1).await;
        let frames = &world.rmd_motion(1)[begin..end];
        let stop = frames.iter().position(is_stop).unwrap();
        assert!(frames[stop..].iter().all(is_stop), "{stopping}: {frames:02x?}");
        world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_end_of_the_page_stops_its_run() {
    let world = World::new("run-lapse", Profile::Spec);
    let page = world.page().await;
    from(&page, run(rmd(1), Mode::Speed, 3000.0, 500.0)).await;
    world.reaches("rmd1.speed_dps", |dps| dps > 50.0).await;
    page.drive.lapse().await;
    world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
    let end = quiet(&world, 1).await;
    let frames = world.rmd_motion(1);
    assert!(Code::from(frames[end - 1][0]).motion().stops(), "{frames:02x?}");
    assert_eq!(page.refused(run(rmd(1), Mode::Speed, 10.0, 10.0)).await.0, Reason::Lapsed);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_runs_of_a_motor_do_not_fight() {
    let world = World::new("run-two", Profile::Spec);
    let page = world.page().await;
    let other = world.other(&page).await;
    // Another server at the same share knows nothing of these runs.
    let stranger = world.page().await;
    for second in [&page, &other, &stranger] {
        let begin = world.rmd_motion(1).len();
        from(&page, run(rmd(1), Mode::Speed, 200.0, 100.0)).await;
        until(|| (world.rmd_motion(1).len() > begin + 5).then_some(())).await;
        let first = begun(second, run(rmd(1), Mode::Speed, -200.0, 400.0)).await;
        until(|| (speeds(&world.rmd_motion(1)).last() == Some(&-200.0)).then_some(())).await;
        quiet(&world, 1).await;
        let all = speeds(&world.rmd_motion(1)[begin..]);
        let at = all.iter().rposition(|dps| *dps == first).unwrap();
        assert!(all[at..].is_sorted_by(|a, b| a >= b), "{all:?}");
        page.stop(rmd(1)).await;
        world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
    }
    // A single command ends a run, too.
    let begin = world.rmd_motion(1).len();
    from(&page, run(rmd(1), Mode::Speed, 300.0, 100.0)).await;
    until(|| (world.rmd_motion(1).len() > begin + 5).then_some(())).await;
    page.act(rmd(1), "set_speed", &[("speed_dps", -50.0)]).await.unwrap();
    quiet(&world, 1).await;
    assert_eq!(speeds(&world.rmd_motion(1)).last(), Some(&-50.0));
    page.stop(rmd(1)).await;
}

/// The requests to the ST drive that are not reads.
fn requests(sent: &[Sent], profile: Profile) -> Vec<Request<'_>> {
    sent.iter().map(|(_, bytes)| Request::decode(profile, bytes[0], &bytes[1..]).unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_st_motor_ramps_and_starts() {
    let profile = Profile::Spec;
    let world = World::new("run-st", profile);
    let page = world.page().await;
    let (reason, message) = page.refused(run(st(1), Mode::Speed, 0.0, 3000.0)).await;
    assert!(reason == Reason::Usage && message.contains("it is at rest"), "{message}");
    assert_eq!(world.st_writes(), []);
    assert_eq!(from(&page, run(st(1), Mode::Speed, 1500.0, 3000.0)).await, 0.0);
    let sent = world.st_writes();
    let start = Request::ExecuteCommand(motorlink_proto::st::Command::StartMotor);
    let ramp = Request::SetRamp(Ramp { speed_rpm: 1500, duration_ms: 500 });
    assert_eq!(requests(&sent, profile), [ramp, start]);
    world.reaches("st1.speed_rpm", |rpm| (rpm - 1500.0).abs() < 50.0).await;
    let measured = from(&page, run(st(1), Mode::Speed, 2000.0, 1000.0)).await;
    assert!((measured - 1500.0).abs() < 100.0, "{measured}");
    let sent = world.st_writes();
    let Request::SetRamp(ramp) = requests(&sent, profile)[2] else { panic!("{sent:?}") };
    assert_eq!(f64::from(ramp.duration_ms), (2000.0 - measured).abs().ceil());
    world.reaches("st1.speed_rpm", |rpm| rpm > 1900.0).await;
    let (_, message) = page.refused(run(st(1), Mode::Speed, 0.0, 1.0)).await;
    assert!(message.contains("lasts up to 65.535 s"), "{message}");
    page.drive.lapse().await;
    world.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_torque_of_an_st_motor_ramps() {
    for profile in Profile::ALL {
        let world = World::new(&format!("run-iq-{}", profile.name()), profile);
        let page = world.page().await;
        let first = from(&page, run(st(2), Mode::Torque, 600.0, 3000.0)).await;
        let sent = until(|| {
            let sent = world.st_writes();
            let is_last = match requests(&sent, profile).last() {
                Some(Request::SetCurrentReference(last)) => last.iq_s16a == 600,
                Some(Request::ExecuteCommand(_)) => profile == Profile::Mcsdk54,
                _ => false,
            };
            is_last.then_some(sent)
        })
        .await;
        let mut currents = Vec::new();
        for request in requests(&sent, profile) {
            match request {
                Request::SetCurrentReference(CurrentReference { iq_s16a, .. }) => {
                    currents.push(f64::from(iq_s16a));
                }
                Request::SetTorqueRamp(TorqueRamp { torque_s16a, .. }) => {
                    currents.extend([first, f64::from(torque_s16a)]);
                }
                _ => {}
            }
        }
        assert_eq!((currents[0], *currents.last().unwrap()), (first, 600.0));
        assert!(currents.is_sorted(), "{currents:?}");
        world.reaches("st2.speed_rpm", |rpm| rpm > 200.0).await;
        page.stop(st(2)).await;
        // No speed limit holds for a torque.
        let limit = Ask::Limit { motor: st(2), mode: Mode::Speed, most: Some(500.0) };
        page.ask(limit).await.unwrap();
        let (_, message) = page.refused(run(st(2), Mode::Torque, 10.0, 100.0)).await;
        assert!(message.contains("as fast as its load allows"), "{message}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_motor_that_cannot_start_gets_no_ramp() {
    let world = World::new("run-fault", Profile::Spec);
    let page = world.page().await;
    world.execute(r#"{"command":"fault","port":"st","motor":1,"fault":"OVER_TEMP"}"#);
    let (reason, message) = page.refused(run(st(1), Mode::Speed, 1000.0, 1000.0)).await;
    assert_eq!(reason, Reason::Refused);
    assert!(message.contains("OVER_TEMP (heatsink too hot"), "{message}");
    assert_eq!(world.st_writes(), []);
    page.view.ask(share::Ask::Latch).await.unwrap();
    assert_eq!(page.refused(run(rmd(1), Mode::Speed, 10.0, 10.0)).await.0, Reason::Latched);
    assert_eq!(world.rmd_motion(1), Vec::<Vec<u8>>::new());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_start_follows_a_stop_that_comes_while_a_run_begins() {
    let world = World::new("run-begins", Profile::Spec);
    let page = world.page().await;
    let is_stop = |bytes: &[u8]| bytes == [0x03, 0x02];
    let mut stopped_early = 0;
    for round in 0..7 {
        let end = std::time::Instant::now() + crate::world::LIMIT;
        while page.read(st(1), &["STATUS"]).await[0].1 != "IDLE" {
            assert!(std::time::Instant::now() < end, "the motor does not stop");
        }
        let begin = world.st.lock().unwrap().len();
        let since = || world.st.lock().unwrap()[begin..].to_vec();
        let starting = page.ask(run(st(1), Mode::Speed, 1500.0, 3000.0));
        // The stop comes after the first, second or a later request of the run.
        let stopping = async {
            until(|| (since().len() > round).then_some(())).await;
            page.stop(st(1)).await;
        };
        let (started, ()) = tokio::join!(starting, stopping);
        stopped_early += u32::from(started.is_err());
        let sent = since();
        let stop = sent.iter().position(|(_, bytes)| is_stop(bytes)).unwrap();
        let moves = |(_, bytes): &Sent| matches!(bytes[..], [0x07, ..] | [0x03, 0x01]);
        assert!(!sent[stop..].iter().any(moves), "{round}: {started:?} {sent:02x?}");
    }
    assert!(stopped_early > 0);
}
