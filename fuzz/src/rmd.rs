//! The RMD protocol: frames, the host, and simulated drives on a bus.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::*;
use motorlink_sim::rmd::{RmdBus, RmdNode};

use crate::input::Input;

/// Any frame: an identifier of 32 bits, a kind, and up to eight bytes.
fn any_frame(input: &mut Input<'_>) -> CanFrame {
    let kind = input.byte();
    let near = [0x140, 0x240, 0x280, u16::from(input.byte())][usize::from(kind) % 4];
    let id = u32::from(near + u16::from(input.byte() % 48));
    match kind / 4 % 16 {
        0 => CanFrame::remote_frame(id, kind >= 128, input.byte()),
        1 => CanFrame::data_frame(id << 16 | 7, true, input.bytes()),
        2 => CanFrame::data_frame(id, false, input.bytes()),
        _ => CanFrame::new(id as u16, input.array()),
    }
}

/// Any bytes as the frame of every command, in both directions, also shown as text.
pub fn frame(data: &[u8]) {
    let mut input = Input::new(data);
    let frame = any_frame(&mut input);
    for direction in [Direction::HostToDrive, Direction::DriveToHost] {
        assert!(!describe(frame, direction).to_string().is_empty());
    }
    let Some((_, data)) = frame.eight_bytes() else { return };
    for row in &COMMANDS {
        for field in row.request.iter().chain(row.reply) {
            let (raw, bits) = (field.raw(data), u32::from(field.len) * 8);
            assert!(raw >= -(1 << (bits - 1)) && raw < 1 << bits, "{}: {raw}", field.name);
        }
    }
    fn stable<P: Payload>(data: &[u8; 8]) {
        let code = Code::from(data[0]);
        let bytes = P::decode(data).encode_as(code);
        assert_eq!(P::decode(&bytes).encode_as(code), bytes);
        for field in P::FIELDS {
            assert_eq!(field.raw(&bytes), field.raw(data), "{}", field.name);
        }
    }
    macro_rules! all_stable {
        ($($name:ident)+) => { $(
            stable::<$name>(data);
            stable::<<$name as Command>::Reply>(data);
        )+ };
    }
    motorlink_proto::for_each_rmd_command!(all_stable);
    assert_eq!(SetTorque4::decode(data).encode(), *data);
}

/// A host under any sequence of calls and frames, while time passes.
pub fn host(data: &[u8]) {
    let mut input = Input::new(data);
    let mut bench = HostFixture {
        host: Host::new(),
        now: Instant(0),
        codes: [0; MotorId::COUNT + 1],
        torque4: None,
    };
    while let Some(operation) = input.operation() {
        let id = MotorId::new(input.byte() % 32 + 1).expect("1 to 32");
        match operation % 14 {
            0..=2 => {
                let data: [u8; 8] = input.array();
                let busy = bench.host.busy().contains(id);
                let limits = bench.host.limits(id);
                let taken = bench.host.request(bench.now, id, data);
                assert!(!(busy && taken.is_ok()), "two exchanges with a motor");
                assert!(limits.check(&data).is_ok() || taken.is_err(), "a limit was passed");
                assert!(taken.is_err() || bench.host.busy().contains(id));
                if taken.is_ok() {
                    bench.codes[usize::from(id.number())] = data[0];
                }
            }
            3 => bench.set_torque4(input.byte(), &input.array()),
            4 | 5 => bench.host.receive(bench.now, &any_frame(&mut input)),
            6 => {
                let data: [u8; 8] = input.array();
                bench.host.receive(bench.now, &CanFrame::new(id.can_id(), data));
            }
            7 => bench.now += Micros(u64::from(input.word()) * 4),
            8 => {
                bench.host.cancel(bench.now, id);
                assert!(!bench.host.busy().contains(id));
                if MotorSet::TORQUE4.contains(id) {
                    bench.torque4 = None;
                }
            }
            9 => {
                let limit = |word: u16| (word & 1 == 0).then_some(word >> 1);
                let limits = Limits {
                    current: limit(input.word()).map(|word| IqCommand(word as i16)),
                    speed: limit(input.word()).map(SpeedLimit),
                    angle: limit(input.word()).map(|word| CentiDegrees(i32::from(word))),
                };
                bench.host.set_limits(id, limits);
            }
            10 => bench.host.set_timeout(Micros(u64::from(input.word()))),
            11 => bench.host.set_quarantine(Micros(u64::from(input.word()))),
            12 => {
                bench.host.reopened(bench.now);
                bench.torque4 = None;
                assert!(bench.host.busy().is_empty());
                assert!(MotorSet::ALL.into_iter().all(|id| bench.host.is_unknown(id)));
            }
            _ => {
                bench.host.trust(id.into());
                assert!(!bench.host.is_unknown(id));
            }
        }
        if operation & 0x80 == 0 {
            bench.drain();
        }
    }
    bench.finish();
}

struct HostFixture {
    host: Host,
    now: Instant,
    /// The code of the last request to each motor.
    codes: [u8; MotorId::COUNT + 1],
    torque4: Option<[u8; 8]>,
}

impl HostFixture {
    fn set_torque4(&mut self, expected: u8, data: &[u8; 8]) {
        let ids = (1..=5).filter(|id| expected >> id & 1 == 1).filter_map(MotorId::new);
        let expected = MotorSet::from_iter(ids);
        let torques = SetTorque4::decode(data);
        if self.host.set_torque4(self.now, torques, expected).is_ok() {
            assert!(torques.0.iter().all(|torque| torque.0.unsigned_abs() <= 2000));
            assert!(expected.without(MotorSet::TORQUE4).is_empty());
            self.torque4 = Some(*data);
            expected.for_each(|id| self.codes[usize::from(id.number())] = Code::SetTorque.into());
        }
    }

    fn drain(&mut self) -> Option<Instant> {
        for _ in 0..=4 * MotorId::COUNT {
            let busy = self.host.busy();
            match self.host.poll(self.now) {
                Output::Transmit(frame) => {
                    let (id, data) = frame.eight_bytes().expect("a request has eight bytes");
                    match MotorId::from_can_id(u32::from(id)) {
                        Some(id) => assert!(busy.contains(id), "nothing is sent unasked"),
                        None => {
                            assert_eq!(id, TORQUE4_ID);
                            assert_eq!(self.torque4.take(), Some(*data));
                        }
                    }
                }
                Output::Done { id, result } => {
                    assert!(busy.contains(id), "done with nothing");
                    let asked = self.codes[usize::from(id.number())];
                    let fits = |[code, ..]: [u8; 8]| code == asked || (asked, code) == (0x9B, 0x9A);
                    assert!(result.is_err() || result.is_ok_and(fits), "another's reply");
                    assert!(!self.host.busy().contains(id), "done and busy");
                }
                Output::Wait(None) => {
                    assert!(busy.is_empty(), "an exchange is forgotten");
                    return None;
                }
                Output::Wait(Some(until)) => {
                    assert!(!busy.is_empty(), "waits for nothing");
                    if until > self.now {
                        return Some(until);
                    }
                }
            }
        }
        panic!("the host does not come to rest");
    }

    /// In silence every exchange ends, at its own deadline at the latest.
    fn finish(&mut self) {
        for _ in 0..=MotorId::COUNT {
            match self.drain() {
                None => return,
                Some(until) => self.now = until,
            }
        }
        panic!("an exchange does not end");
    }
}

/// Four simulated drives on a bus, while their environment changes.
pub fn drive(data: &[u8]) {
    let mut input = Input::new(data);
    let mut bus = RmdBus::demo(Instant(0));
    let mut now = Instant(0);
    while let Some(operation) = input.operation() {
        let number = input.byte() % 4 + 1;
        let id = MotorId::new(number).expect("1 to 4");
        match operation % 8 {
            0 | 1 => ask(&mut bus, now, CanFrame::new(id.can_id(), input.array())),
            2 => {
                // A code of the document, with any values.
                let row = &COMMANDS[usize::from(input.byte()) % COMMANDS.len()];
                let mut data: [u8; 8] = input.array();
                data[0] = row.code.into();
                ask(&mut bus, now, CanFrame::new(id.can_id(), data));
            }
            3 => ask(&mut bus, now, any_frame(&mut input)),
            4 => now += Micros(u64::from(input.byte()) * 50),
            5 => {
                now += Micros(u64::from(input.word()) * 2);
                bus.advance_to(now);
            }
            6 => {
                let (what, value) = (input.byte(), f32::from(input.word()) / 65.0);
                let motor = bus.node_mut(id).expect("1 to 4 are there").motor_mut();
                match what % 6 {
                    0 => motor.plant_mut().set_source(value.min(1000.0)),
                    1 => motor.plant_mut().force_temperature(Some(value - 100.0)),
                    2 => motor.plant_mut().change_load(|load| load.brake = value.min(1000.0)),
                    3 => motor.plant_mut().lock(value > 500.0),
                    4 => motor.inject(Errors::from(value as u8)),
                    _ => motor.hold_faults(Errors::from(value as u8)),
                }
            }
            _ => bus.node_mut(id).expect("1 to 4 are there").power_cycle(now),
        }
    }
    bus.advance_to(now + Micros::from_millis(10));
    finite(bus.nodes());
}

/// The motors turn with finite numbers, and without an error of the simulation.
pub fn finite(nodes: &[RmdNode]) {
    for node in nodes {
        let truth = node.motor().truth();
        let plant = &truth.plant;
        let values = [truth.speed_dps, truth.speed_reference_dps, plant.iq, plant.id];
        let more = [plant.bus_voltage, truth.temperature, plant.winding_temperature];
        assert!(values.iter().chain(&more).all(|value| value.is_finite()), "{truth:?}");
        assert!(plant.angle_degrees.is_finite(), "{truth:?}");
        assert!(node.drive().errors().is_empty() || node.drive().mode() == Mode::Off);
    }
}

/// Passes a frame to the drives. A motor with a valid request answers once, with the code of the
/// request. All others are silent.
fn ask(bus: &mut RmdBus<[RmdNode; 4]>, now: Instant, frame: CanFrame) {
    let rom =
        |bus: &RmdBus<[RmdNode; 4]>| bus.nodes().each_ref().map(|node| node.motor().rom_writes());
    let before = rom(bus);
    let mut replies = Vec::new();
    bus.receive(now, &frame, |reply| replies.push(reply));
    let asked = frame.eight_bytes().map(|(id, data)| (id, *data));
    let code = match asked {
        Some((TORQUE4_ID, _)) => Some(Code::SetTorque),
        Some((id, data)) if (0x141..=0x144).contains(&id) => Some(Code::from(data[0])),
        _ => None,
    };
    let row = code.and_then(Code::info);
    let expected = match (row, asked) {
        (None, _) => 0,
        (_, Some((TORQUE4_ID, _))) => 4,
        _ => 1,
    };
    assert_eq!(replies.len(), expected, "{frame:?}");
    let Some((row, (id, data))) = row.zip(asked) else {
        assert_eq!(rom(bus), before, "{frame:?} wrote to ROM");
        return;
    };
    for reply in replies {
        let (from, answer) = reply.eight_bytes().expect("a reply has eight bytes");
        assert!(from == id || id == TORQUE4_ID);
        let answered = Code::from(answer[0]);
        let cleared = row.code == Code::ClearErrors && answered == Code::ReadStatus;
        assert!(answered == row.code || cleared, "{frame:?}: {answer:02x?}");
        assert!(!row.echo || *answer == data, "{frame:?}: {answer:02x?}");
    }
    assert!(row.rom || rom(bus) == before, "{frame:?} wrote to ROM");
}
