//! Writes, limits and settings files of pages, through a real share.

use std::sync::atomic::Ordering;
use std::time::Instant;

use crate::world::{Page, World, act, rmd, st};
use motorlink_monitor::message::{Answer, Ask, Mode};
use motorlink_proto::st::Profile;
use motorlink_telemetry::share::message::{MotorName, Reason};

fn write(motor: MotorName, name: &str, value: f64, to_rom: bool) -> Ask {
    Ask::Write { motor, name: name.to_owned(), value, to_rom }
}

pub fn limit(motor: MotorName, mode: Mode, most: Option<f64>) -> Ask {
    Ask::Limit { motor, mode, most }
}

async fn written(page: &Page, ask: Ask) -> Vec<(String, Option<f64>)> {
    match page.ask(ask).await {
        Ok(Answer::Write { values }) => {
            values.into_iter().map(|value| (value.name, value.value)).collect()
        }
        other => panic!("{other:?}"),
    }
}

pub async fn limits(page: &Page) -> Vec<(String, u8, Mode, f64)> {
    match page.ask(Ask::Limits).await {
        Ok(Answer::Limits { limits }) => {
            limits.into_iter().map(|it| (it.motor.line, it.motor.motor, it.mode, it.most)).collect()
        }
        other => panic!("{other:?}"),
    }
}

async fn dump(page: &Page, motor: MotorName) -> String {
    match page.ask(Ask::Dump { motor }).await {
        Ok(Answer::Dump { text, .. }) => text,
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_write_is_read_back_in_both_profiles() {
    for profile in Profile::ALL {
        let world = World::new(&format!("writes-{}", profile.name()), profile);
        let page = world.page().await;
        let kp = written(&page, write(st(1), "SPEED_KP", 123.0, false)).await;
        assert_eq!(kp, [("SPEED_KP".to_owned(), Some(123.0))]);
        assert_eq!(page.read(st(1), &["SPEED_KP"]).await[0].0, Some(123.0));
        let phase = written(&page, write(st(1), "REVUP_1_TORQUE", 321.0, false)).await;
        assert_eq!(phase.len(), 3, "the request writes all of the phase: {phase:?}");
        assert_eq!(phase[1], ("REVUP_1_TORQUE".to_owned(), Some(321.0)));
        assert!(!page.drive.opened.load(Ordering::SeqCst), "a setting moves nothing");
        let mode = written(&page, write(st(1), "CONTROL_MODE", 0.0, false)).await;
        assert_eq!(mode, [("CONTROL_MODE".to_owned(), Some(0.0))]);
        assert!(page.drive.opened.load(Ordering::SeqCst), "a mode may move the motor");
        let gains = written(&page, write(rmd(2), "speed_kp", 33.0, false)).await;
        assert_eq!(gains.len(), 6);
        assert!(gains.contains(&("speed_kp".to_owned(), Some(33.0))), "{gains:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_rom_is_written_only_if_it_is_allowed() {
    let world = World::new("rom", Profile::Spec);
    let page = world.page().await;
    let codes = |world: &World| -> Vec<u8> {
        let sent = world.rmd.lock().unwrap();
        sent.iter()
            .map(|(_, bytes)| bytes[0])
            .filter(|code| [0x31, 0x32, 0x91].contains(code))
            .collect()
    };
    written(&page, write(rmd(1), "speed_kp", 44.0, false)).await;
    let (reason, message) = page.refused(write(rmd(1), "encoder_offset", 7.0, false)).await;
    assert_eq!(reason, Reason::Usage);
    assert!(message.contains("wears the ROM; nothing was written"), "{message}");
    assert_eq!(codes(&world), [0x31]);
    written(&page, write(rmd(1), "speed_kp", 45.0, true)).await;
    let offset = written(&page, write(rmd(1), "encoder_offset", 7.0, true)).await;
    assert_eq!(offset, [("encoder_offset".to_owned(), Some(7.0))]);
    assert_eq!(codes(&world), [0x31, 0x31, 0x32, 0x91]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_write_that_is_not_possible_is_never_sent() {
    let world = World::new("unwritable", Profile::Spec);
    let page = world.page().await;
    for (ask, words) in [
        (write(st(1), "SPEED_MEAS", 1.0, false), "SPEED_MEAS cannot be written"),
        (write(st(1), "SPEED_KP", 32768.0, false), "outside -32768 to 32767"),
        (write(st(1), "SPEED_KP", 1.5, false), "between two values"),
        (write(st(1), "SPEED_KP", f64::NAN, false), "NaN"),
        (write(st(1), "TORQUE_REF", f64::INFINITY, false), "is not a value"),
        (write(st(1), "CONTROL_MODE", 2.0, false), "TORQUE and SPEED"),
        (write(st(1), "RAMP_FINAL_SPEED", 1e6, false), "is beyond ±196602 rpm"),
        (write(st(1), "NOTHING", 1.0, false), "no register `NOTHING`"),
        (write(st(1), "SPEED_KP_DIV", 1.0, false), "cannot be written"),
        (write(rmd(1), "speed_kp", 256.0, false), "outside 0 to 255"),
        (write(rmd(1), "speed_dps", 1.0, false), "is measured and cannot be written"),
        (write(rmd(1), "acceleration", -1.0, false), "negative"),
    ] {
        let (_, message) = page.refused(ask).await;
        assert!(message.contains(words), "{message}");
    }
    assert_eq!(world.st_writes(), []);
    assert!(world.rmd.lock().unwrap().iter().all(|(_, bytes)| bytes[0] >= 0x90));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn limits_of_one_page_hold_for_all_pages_and_in_every_way() {
    let world = World::new("limits", Profile::Mcsdk54);
    let page = world.page().await;
    let other = world.other(&page).await;
    assert_eq!(limits(&other).await, []);
    // The digits of a limit never exceed it.
    for (motor, mode, most) in [
        (rmd(1), Mode::Speed, 100.0),
        (rmd(1), Mode::Torque, 1.0),
        (rmd(1), Mode::Position, 90.009),
        (st(1), Mode::Speed, 1000.0),
        (st(1), Mode::Torque, 500.0),
    ] {
        page.ask(limit(motor.clone(), mode, Some(most))).await.unwrap();
        let of = (&motor.line, motor.motor, mode);
        let told = limits(&other).await;
        let told = told.iter().find(|it| (&it.0, it.1, it.2) == of).unwrap().3;
        assert!((most - 0.01..=most).contains(&told), "{of:?}: {told}");
    }
    let ramp = |rpm: f64| act(st(1), "SET_RAMP", &[("speed_rpm", rpm), ("duration_ms", 100.0)]);
    let current =
        |iq: f64, id: f64| act(st(1), "SET_CURRENT_REF", &[("iq_s16a", iq), ("id_s16a", id)]);
    for ask in [
        ramp(-1001.0),
        current(501.0, 0.0),
        current(0.0, -501.0),
        act(st(1), "SET_TORQUE_RAMP", &[("torque_s16a", 501.0), ("duration_ms", 0.0)]),
        act(st(1), "SET_POSITION_CMD", &[("angle_rad", 1.0), ("duration_s", 1.0)]),
        // Without a ramp the drive goes to its own speed.
        act(st(1), "START_MOTOR", &[]),
        act(st(1), "START_STOP", &[]),
        write(st(1), "TORQUE_REF", 501.0, false),
        write(st(1), "RAMP_FINAL_SPEED", -1001.0, false),
        write(st(1), "REVUP_0_SPEED", 1001.0, false),
        act(rmd(1), "set_speed", &[("speed_dps", -100.01)]),
        act(rmd(1), "set_torque", &[("iq_amps", 1.1)]),
        act(rmd(1), "set_position", &[("angle_degrees", 10.0)]),
        act(rmd(1), "set_position_limited", &[("max_speed_dps", 90.0), ("angle_degrees", 91.0)]),
        act(rmd(1), "run", &[]),
    ] {
        for page in [&page, &other] {
            let (reason, message) = page.refused(ask.clone()).await;
            assert_eq!(reason, Reason::Usage, "{message}");
            assert!(message.contains("nothing was"), "{message}");
        }
    }
    assert_eq!((world.st_writes(), world.rmd_motion(1)), (vec![], vec![]));
    let (_, message) = page.refused(act(st(1), "START_MOTOR", &[])).await;
    assert!(message.contains("limit of 1000 rpm: use Run to target, or set a ramp"), "{message}");
    // Other motors have no limits.
    other.act(rmd(2), "set_speed", &[("speed_dps", 200.0)]).await.unwrap();
    other.ask(ramp(1000.0)).await.unwrap();
    other.act(st(1), "START_MOTOR", &[]).await.unwrap();
    // A ramp within the old limit does not count under a new one.
    page.act(st(1), "STOP_MOTOR", &[]).await.unwrap();
    page.ask(limit(st(1), Mode::Speed, Some(500.0))).await.unwrap();
    page.refused(act(st(1), "START_MOTOR", &[])).await;
    // Neither does a ramp from before the share was lost.
    other.ask(ramp(500.0)).await.unwrap();
    page.drives.reconnected();
    page.refused(act(st(1), "START_MOTOR", &[])).await;
    page.ask(limit(rmd(1), Mode::Speed, None)).await.unwrap();
    assert_eq!(limits(&other).await.len(), 4);
    other.act(rmd(1), "set_speed", &[("speed_dps", 200.0)]).await.unwrap();
    // A limit also binds what the motor did before.
    other.act(rmd(1), "stop", &[]).await.unwrap();
    page.ask(limit(rmd(1), Mode::Speed, Some(100.0))).await.unwrap();
    let (_, message) = other.refused(act(rmd(1), "run", &[])).await;
    assert!(message.contains("resumes the motion before the stop"), "{message}");
    page.ask(limit(rmd(1), Mode::Speed, None)).await.unwrap();
    for (motor, mode, most) in [
        (st(1), Mode::Position, 1.0),
        (st(1), Mode::Speed, -1.0),
        (rmd(1), Mode::Speed, 0.5),
        (rmd(1), Mode::Torque, f64::NAN),
    ] {
        assert_eq!(page.refused(limit(motor, mode, Some(most))).await.0, Reason::Usage);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dump_restores_what_was_changed() {
    let world = World::new("settings", Profile::Mcsdk54);
    let page = world.page().await;
    for (motor, name, value) in [(st(2), "SPEED_KI", 77.0), (rmd(3), "torque_kp", 66.0)] {
        let file = dump(&page, motor.clone()).await;
        assert!(file.contains(name), "{file}");
        let before = page.read(motor.clone(), &[name]).await[0].0;
        written(&page, write(motor.clone(), name, value, false)).await;
        let diff = Ask::Diff { motor: motor.clone(), text: file.clone() };
        let Ok(Answer::Diff { differences }) = page.ask(diff).await else { panic!() };
        assert_eq!(differences.len(), 1);
        assert_eq!((differences[0].name.as_str(), &differences[0].fixed), (name, &None));
        assert_eq!(differences[0].now, value.to_string());
        let restore = Ask::Restore { motor: motor.clone(), text: file.clone(), to_rom: false };
        let Ok(Answer::Restore { written }) = page.ask(restore).await else { panic!() };
        assert_eq!(written, differences);
        assert_eq!(page.read(motor.clone(), &[name]).await[0].0, before);
        assert_eq!(dump(&page, motor).await, file);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restore_needs_a_motor_at_rest_and_a_file_for_it() {
    let world = World::new("rest", Profile::Spec);
    let page = world.page().await;
    let file = dump(&page, rmd(2)).await;
    let restore = |motor, text: &str| Ask::Restore { motor, text: text.to_owned(), to_rom: false };
    for text in ["", "[rmd]\nmotor = 1\n", "nonsense"] {
        assert_eq!(page.refused(restore(rmd(2), text)).await.0, Reason::Usage);
    }
    let (_, message) = page.refused(restore(rmd(3), &file)).await;
    assert!(message.contains("those of motor 2, and this is motor 3"), "{message}");
    let (_, message) = page.refused(restore(st(1), &file)).await;
    assert!(message.contains("speaks `rmd`"), "{message}");
    written(&page, write(rmd(2), "speed_kp", 41.0, false)).await;
    page.act(rmd(2), "set_speed", &[("speed_dps", 180.0)]).await.unwrap();
    world.reaches("rmd2.speed_dps", |dps| dps > 100.0).await;
    let (reason, message) = page.refused(restore(rmd(2), &file)).await;
    assert_eq!(reason, Reason::Refused);
    assert!(
        message.contains("turns at") && message.ends_with("nothing was written; stop it first"),
        "{message}"
    );
    page.act(rmd(2), "off", &[]).await.unwrap();
    let end = Instant::now() + crate::world::LIMIT;
    while let Err(why) = page.ask(restore(rmd(2), &file)).await {
        assert!(why.message.contains("turns at") && Instant::now() < end, "{}", why.message);
    }
    // The value in ROM wears: it is not written without permission.
    let offset = file.lines().find(|line| line.starts_with("encoder_offset")).unwrap();
    let other = file.replace(offset, "encoder_offset = 9");
    let (_, message) = page.refused(restore(rmd(2), &other)).await;
    assert!(message.contains("encoder_offset is in the ROM"), "{message}");
}
