//! Parsers of the host library: slcan, port names, files of settings, configurations and commands of
//! simulated drives.

use motorlink::port::PortName;
use motorlink::settings::{Comparison, Dump, Permissions, RestoreError, SettingsFile, Tunable};
use motorlink::slcan::{self, Answer, Device, HostCodec};
use motorlink::st::{Profile, Reading, RegisterId, find_register, parse_value};
use motorlink_link::fault::Faults;
use motorlink_link::printable;
use motorlink_link::serve::ServeName;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{self, Command as _, MotorId};
use motorlink_proto::st::{self as st, Frame, MAX_FRAME, Request};
use motorlink_proto::time::Instant;
use motorlink_proto::units::CentiDps;
use motorlink_sim::rmd::RmdConfig;
use motorlink_testbench::{Bench, BenchConfig, SimServer};

use crate::input::Input;

/// Any bytes to both ends of slcan.
pub fn slcan(data: &[u8]) {
    let mut input = Input::new(data);
    let cut = usize::from(input.byte()) % 64 + 1;
    let data = &data[data.len().min(1)..];
    let (whole, garbage) = answers(data, 100);
    assert_eq!(answers(data, cut), (whole.clone(), garbage), "chunks make no difference");
    for answer in whole {
        let Answer::Frame(frame) = answer else { continue };
        let mut line = [0; slcan::LONGEST_FRAME];
        let line = slcan::encode(&frame, &mut line);
        assert_eq!(answers(line, 100), (vec![Answer::Frame(frame)], 0));
    }

    let mut device = Device::default();
    let mut replies = Vec::new();
    let mut frames = 0;
    for &byte in data {
        if let Some(frame) = device.receive(byte, |answer| replies.extend_from_slice(answer)) {
            frames += 1;
            device.deliver(Instant(0), &frame, |line| replies.extend_from_slice(line));
        }
    }
    let ends = data.iter().filter(|byte| **byte == b'\r').count();
    let (answers, garbage) = answers(&replies, 100);
    assert_eq!((answers.len(), garbage), (ends + frames, 0), "a line gets one answer");
}

fn answers(data: &[u8], cut: usize) -> (Vec<Answer>, u64) {
    let mut codec = HostCodec::default();
    let mut found = Vec::new();
    for chunk in data.chunks(cut) {
        codec.spare()[..chunk.len()].copy_from_slice(chunk);
        codec.filled(chunk.len());
        found.extend(std::iter::from_fn(|| codec.answer()));
    }
    (found, codec.garbage())
}

/// Any text as a port name. An accepted name is written so that it is parsed as the same name.
pub fn port_name(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match text.parse::<PortName>() {
        Ok(name) => assert_eq!(name.to_string().parse(), Ok(name)),
        Err(error) => assert!(error.to_string().contains(&printable(text))),
    }
    match text.parse::<ServeName>() {
        Ok(name) => assert_eq!(name.to_string().parse(), Ok(name)),
        Err(error) => assert!(error.to_string().contains(&printable(text))),
    }
}

/// Any text as a register and as a value of any register. An accepted value is a number of its
/// type, and is accepted again in its displayed form.
pub fn st_value(data: &[u8]) {
    let mut input = Input::new(data);
    let (register, flags) = (RegisterId(input.byte()), input.byte());
    let Ok(text) = std::str::from_utf8(input.rest()) else { return };
    if let Ok(found) = find_register(text) {
        assert_eq!(find_register(&found.to_string()), Ok(found));
    }
    let profile = [Profile::Spec, Profile::Mcsdk54][usize::from(flags & 1)];
    let raw = flags & 2 != 0;
    match parse_value(register, text, profile, raw) {
        Err(error) => assert!(error.to_string().contains(text)),
        Ok(bits) => {
            let reading = Reading { register, bits, profile };
            assert!(!reading.to_string().is_empty());
            let value = reading.value();
            assert!(raw || value.is_finite(), "{text} became {value}");
            let shown = if raw { reading.digits().to_string() } else { value.to_string() };
            let again = parse_value(register, &shown, profile, raw);
            let same = again.map(|bits| Reading { register, bits, profile }.value());
            assert!(raw && !value.is_finite() || same == Ok(value), "{text}: {shown}");
        }
    }
}

/// Any text as a file of settings. A motor has the settings of an accepted file after a restore, or all
/// of its own.
pub fn settings_file(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let bench = Bench::new(&BenchConfig::default()).expect("the default can be built");
    let st = motorlink::st::Client::over("st", bench.bytes(&Faults::NONE), Default::default());
    restored(text, &st.motor(1).expect("the drive has it"));
    let rmd = motorlink::rmd::Client::over("rmd", bench.can(&Faults::NONE), Default::default());
    restored(text, &rmd.motor(1).expect("the bus has it"));
}

fn restored<M: Tunable<Error: std::fmt::Debug + std::fmt::Display>>(text: &str, motor: &M) {
    let file = match SettingsFile::parse(text, &motor.tuning()) {
        Ok(file) => file,
        Err(error) => {
            assert!((1..=text.split('\n').count()).contains(&error.line), "{error}");
            assert_eq!(printable(&error.to_string()), error.to_string());
            return;
        }
    };
    // The drive may not have a register of the file.
    let Ok(comparison) = Comparison::reading(motor.tuning(), &file).run(motor) else { return };
    let before = Dump::reading(motor.tuning()).run(motor).expect("the line is good").text();
    let permissions = Permissions { rom: true, running: true };
    match comparison.restoring(permissions, || false).run(motor) {
        Ok(()) => {
            let after =
                Comparison::reading(motor.tuning(), &file).run(motor).expect("it was read before");
            assert_eq!(after.differences().count(), 0);
        }
        Err(RestoreError::Undone(undone)) => assert!(undone.is_complete(), "{undone}"),
        Err(_) => {}
    }
    let own = SettingsFile::parse(&before, &motor.tuning()).expect("it is the text of a motor");
    let back =
        Comparison::reading(motor.tuning(), &own).run(motor).expect("the motor has its settings");
    back.restoring(permissions, || false).run(motor).expect("they were its own");
    assert_eq!(Dump::reading(motor.tuning()).run(motor).expect("the line is good").text(), before);
}

/// Any text as a configuration. Drives of an accepted one start and turn with finite numbers.
pub fn sim_config(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(config) = BenchConfig::parse(text) else { return };
    let mut station = config.station(Instant(0)).expect("what was taken can be built");
    let mut bus =
        config.bus(Instant(0), RmdConfig::factory_rom).expect("what was taken can be built");
    for number in 1..=station.drive().last().number() {
        for request in [Request::ExecuteCommand(st::Command::StartMotor), Request::GetBoardInfo] {
            let mut out = [0; MAX_FRAME];
            let frame = Frame::command(number, &request, &mut out).expect("it fits");
            station.receive(Instant(0), frame, |_| {});
        }
    }
    let ids: Vec<MotorId> = bus.nodes().iter().map(|node| node.id()).collect();
    for id in ids {
        let speed = rmd::SetSpeed { speed: CentiDps(36_000) };
        bus.receive(Instant(0), &CanFrame::new(id.can_id(), speed.encode()), |_| {});
    }
    for end in [1_000, 40_000] {
        station.advance_to(Instant(end));
        bus.advance_to(Instant(end));
        crate::st::finite(station.drive().motors());
        crate::rmd::finite(bus.nodes());
    }
}

/// Any lines as commands to simulated drives. Each gets an answer, and the drives' states have
/// finite numbers afterwards.
pub fn sim_command(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let (mut st, mut rmd) = (SimServer::new(), SimServer::new());
    let config = BenchConfig::default();
    let free = ServeName::TcpListen { host: "127.0.0.1".to_owned(), port: 0 };
    st.serve_st(&free, &config).expect("loopback has a free port");
    rmd.serve_rmd(&free, &config).expect("loopback has a free port");
    for line in text.lines() {
        for bench in [&mut st, &mut rmd] {
            let answer = bench.obey(line);
            let done = answer["ok"].as_bool().expect("an answer says whether it was done");
            assert!(done != answer["error"].is_object(), "{answer}");
            let state = bench.obey(r#"{"command":"state"}"#);
            assert_eq!(state["ok"], true);
            assert!(!state.to_string().contains("null"), "behind {line}: {state}");
        }
    }
}
