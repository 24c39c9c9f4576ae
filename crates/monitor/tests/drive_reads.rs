//! What pages read of drives, and commands that they send, through a real share.

use std::sync::atomic::Ordering;

use crate::world::{World, act, rmd, st};
use motorlink_link::fault::Faults;
use motorlink_monitor::message::{Answer, Ask, Mode};
use motorlink_proto::st::{Profile, Reading, RegisterId};
use motorlink_telemetry::share::message::Reason;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn values_are_those_that_a_client_reads() {
    for profile in Profile::ALL {
        let world = World::new(&format!("reads-{}", profile.name()), profile);
        let page = world.page().await;
        for line in if profile == Profile::Spec { &["st0", "rmd0"][..] } else { &["st0"] } {
            let Ok(Answer::Motors { motors }) =
                page.ask(Ask::Motors { line: (*line).to_owned() }).await
            else {
                panic!("no motors")
            };
            let expected: &[u8] = if *line == "st0" { &[1, 2] } else { &[1, 2, 3, 4] };
            assert_eq!(motors, expected);
        }

        // The same drives through a client of their own, on virtual time.
        let bench = motorlink_testbench::Bench::new(&motorlink_testbench::BenchConfig {
            profile,
            ..Default::default()
        })
        .unwrap();
        let options = motorlink::st::Options { profile, ..Default::default() };
        let client = motorlink::st::Client::over("bench", bench.bytes(&Faults::NONE), options);
        let Ok(Answer::Describe(description)) =
            page.ask(Ask::Describe { line: "st0".to_owned() }).await
        else {
            panic!("no description")
        };
        // What does not change while a motor is at rest.
        let registers: Vec<_> = description
            .registers
            .iter()
            .filter(|it| it.readable && it.name.parse::<u8>().is_err())
            .filter_map(|it| RegisterId::named(&it.name))
            .filter(|it| it.is_setting(profile))
            .chain([RegisterId::STATUS, RegisterId::CONTROL_MODE, RegisterId::FLAGS])
            .collect();
        assert!(registers.len() > 20);
        let names: Vec<String> = registers.iter().map(ToString::to_string).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        for number in [1, 2] {
            let motor = client.motor(number).unwrap();
            let values = page.read(st(number), &names).await;
            for (register, (value, text)) in registers.iter().zip(values) {
                match motor.get_raw(*register) {
                    Ok(bits) => {
                        let reading = Reading { register: *register, bits, profile };
                        assert_eq!(value, Some(reading.value()), "{register}");
                        assert!(reading.to_string().starts_with(&text), "{register}: {text}");
                    }
                    Err(why) => {
                        assert_eq!(value, None, "{register}: {why}");
                        assert!(text.contains("refused reading"), "{text}");
                    }
                }
            }
        }
        let values = page.read(rmd(3), &["position_kp", "torque_ki", "acceleration"]).await;
        assert!(values.iter().all(|(value, _)| value.is_some()), "{values:?}");
        let values = page.read(rmd(3), &["voltage_volts", "temperature_celsius", "errors"]).await;
        assert_eq!(values[0], (Some(24.0), "24.0".to_owned()));
        assert_eq!(values[2], (Some(0.0), "no error".to_owned()));
        assert!(!page.drive.opened.load(Ordering::SeqCst), "reading needs no control");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_description_has_the_tables_of_the_protocol() {
    let world = World::new("describe", Profile::Mcsdk54);
    let page = world.page().await;
    let describe = async |line: &str| match page.ask(Ask::Describe { line: line.to_owned() }).await
    {
        Ok(Answer::Describe(description)) => description,
        other => panic!("{other:?}"),
    };
    let drive = describe("st0").await;
    let register = |name: &str| drive.registers.iter().find(|it| it.name == name).unwrap();
    let share = register("FLUXWK_BUS");
    assert_eq!((share.unit.as_str(), share.range), ("%", Some([0.0, 100.0, 0.1])));
    assert!(register("SPEED_KP").writable && !register("SPEED_MEAS").writable);
    assert!(register("REVUP_0_SPEED").writable);
    let command = |name: &str| drive.commands.iter().find(|it| it.name == name).unwrap();
    assert!(command("START_MOTOR").moves && command("SET_RAMP").moves);
    assert!(!command("STOP_MOTOR").moves && !command("FAULT_ACK").moves);
    let fields: Vec<_> = command("SET_RAMP").fields.iter().map(|it| it.name.as_str()).collect();
    assert_eq!(fields, ["speed_rpm", "duration_ms"]);
    assert_eq!(drive.faults.len(), 16);
    assert!(drive.faults.iter().all(|it| it.advice.ends_with('.')));
    let over_volt: Vec<_> = drive.faults.iter().filter(|it| it.name == "OVER_VOLT").collect();
    assert_eq!(
        over_volt.iter().map(|it| (it.bit, it.present)).collect::<Vec<_>>(),
        [(1, false), (17, true)]
    );
    assert!(drive.states.iter().any(|it| (it.value, it.name.as_str()) == (6, "RUN")));
    let modes: Vec<_> = drive.modes.iter().map(|it| (it.mode, it.measured.as_str())).collect();
    assert_eq!(modes, [(Mode::Speed, "SPEED_MEAS"), (Mode::Torque, "TORQUE_MEAS")]);

    let motors = describe("rmd0").await;
    let register = |name: &str| motors.registers.iter().find(|it| it.name == name).unwrap();
    assert!(register("position_kp").can_keep && !register("position_kp").wears_rom);
    assert!(register("encoder_offset").wears_rom);
    let command = |name: &str| motors.commands.iter().find(|it| it.name == name).unwrap();
    assert!(command("write_zero_rom").wears_rom && command("set_speed").moves);
    let direction = &command("set_single_turn_position").fields[0];
    assert_eq!(direction.words, ["clockwise", "counterclockwise"]);
    assert_eq!(direction.range, [0.0, 1.0, 1.0]);
    assert_eq!(motors.faults.iter().map(|it| it.bit).collect::<Vec<_>>(), [0, 3]);
    assert_eq!(motors.modes.len(), 3);
    assert_eq!(motors.overview.angle.unwrap().to_string(), "multi_turn_angle_degrees");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_not_possible_is_never_sent() {
    let world = World::new("impossible", Profile::Spec);
    let page = world.page().await;
    let before = (world.st.lock().unwrap().len(), world.rmd.lock().unwrap().len());
    let read = |motor, name: &str| Ask::Read { motor, names: vec![name.to_owned()] };
    let asks = [
        (read(st(1), "SPEED_MES"), "did you mean `SPEED_MEAS`?"),
        (read(st(0), "SPEED_MEAS"), "no motor can have the number 0"),
        (read(st(8), "SPEED_MEAS"), "no motor can have the number 8"),
        (read(rmd(33), "speed_dps"), "no motor can have the number 33"),
        (read(rmd(1), "SPEED_MEAS"), "no setting or value `SPEED_MEAS`"),
        (act(st(1), "SET_RAMP", &[("speed_rpm", 1e9), ("duration_ms", 0.0)]), "is beyond"),
        (act(st(1), "SET_RAMP", &[("speed_rpm", f64::NAN), ("duration_ms", 0.0)]), "NaN"),
        (act(st(1), "SET_RAMP", &[("speed_rpm", 100.0)]), "needs the value `duration_ms`"),
        (act(st(1), "SET_RAMP", &[("speed", 100.0)]), "no value `speed`"),
        (act(st(1), "GO", &[]), "no command `GO`"),
        (act(st(1), "SET_TORQUE_RAMP", &[]), "no command `SET_TORQUE_RAMP`"),
        (act(rmd(1), "set_torque", &[("iq_amps", 40.0)]), "beyond ±32 A"),
        (act(rmd(1), "set_torque", &[("iq_amps", f64::INFINITY)]), "inf"),
        (
            act(rmd(1), "set_single_turn_position", &[("direction", 2.0), ("angle_degrees", 10.0)]),
            "0 (clockwise), 1 (counterclockwise)",
        ),
        (act(rmd(1), "write_zero_rom", &[]), "wears the ROM"),
        (Ask::Describe { line: "st9".to_owned() }, "the lines are rmd0, st0"),
    ];
    for (ask, words) in asks {
        let (reason, message) = page.refused(ask).await;
        assert_eq!(reason, Reason::Usage, "{message}");
        assert!(message.contains(words), "{message}");
    }
    let after = (world.st.lock().unwrap().len(), world.rmd.lock().unwrap().len());
    assert_eq!(before, after);
    assert!(!page.drive.opened.load(Ordering::SeqCst));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn refusals_of_a_drive_are_in_words() {
    let world = World::new("refusals", Profile::Spec);
    let page = world.page().await;
    let refused = page.act(st(5), "FAULT_ACK", &[]).await.unwrap_err();
    assert_eq!((refused.reason, refused.code), (Reason::Refused, Some(11)));
    assert!(refused.message.contains("no motor of this number"), "{}", refused.message);
    let values = page.read(st(5), &["SPEED_MEAS"]).await;
    assert!(values[0].1.contains("no motor of this number"), "{values:?}");
    world.execute(r#"{"command":"fault","port":"st","motor":1,"fault":"OVER_VOLT"}"#);
    let refused = page.act(st(1), "START_MOTOR", &[]).await.unwrap_err();
    assert_eq!(refused.reason, Reason::Refused);
    assert!(refused.message.contains("OVER_VOLT (bus voltage too high"), "{}", refused.message);
    page.act(st(1), "FAULT_ACK", &[]).await.unwrap();
    page.act(st(1), "START_MOTOR", &[]).await.unwrap();
    page.act(st(1), "STOP_MOTOR", &[]).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn commands_move_motors_while_the_page_is_alive() {
    let world = World::new("acts", Profile::Spec);
    let page = world.page().await;
    let answer = page.act(rmd(2), "set_speed", &[("speed_dps", 360.0)]).await.unwrap();
    let Answer::Act { values } = answer else { panic!("{answer:?}") };
    assert!(values.iter().any(|value| value.name == "temperature_celsius"), "{values:?}");
    world.reaches("rmd2.speed_dps", |dps| dps > 300.0).await;
    page.act(rmd(2), "off", &[]).await.unwrap();
    world.reaches("rmd2.speed_dps", |dps| dps.abs() < 5.0).await;
    page.act(st(1), "SET_RAMP", &[("speed_rpm", 1500.0), ("duration_ms", 100.0)]).await.unwrap();
    page.act(st(1), "START_MOTOR", &[]).await.unwrap();
    world.reaches("st1.speed_rpm", |rpm| rpm > 1000.0).await;
    page.drive.lapse().await;
    world.reaches("st1.speed_rpm", |rpm| rpm.abs() < 30.0).await;
    let refused = page.act(st(1), "START_MOTOR", &[]).await.unwrap_err();
    assert_eq!(refused.reason, Reason::Lapsed);
    page.act(st(1), "STOP_MOTOR", &[]).await.unwrap();
    page.read(st(1), &["SPEED_MEAS"]).await;
}
