//! Prints a fingerprint of all replies and states of two simulated drives, moment by moment. `make
//! determinism` compares the output of builds with and without optimisation.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Command as _, ReadPhaseCurrents, SetPosition, SetSpeed};
use motorlink_proto::st::{Command, Frame, MAX_FRAME, Profile, Ramp, RegisterId, Request};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::{CentiDegrees, CentiDps};
use motorlink_sim::hash::fingerprint;
use motorlink_sim::rmd::{RmdBus, RmdConfig, RmdNode};
use motorlink_sim::st::{StDrive, StStation};

pub(crate) fn print() {
    st();
    rmd();
}

fn st() {
    let mut now = Instant(0);
    let mut station = StStation::new(Profile::Mcsdk54, StDrive::demo(now));
    let mut said = Vec::new();
    let mut ask = |station: &mut StStation<_>, now, motor, request: Request<'_>| {
        let mut frame = [0; MAX_FRAME];
        let frame = Frame::command(motor, &request, &mut frame).expect("the request fits");
        station.receive(now, frame, |reply| said.extend_from_slice(reply));
    };
    for motor in [1, 2] {
        ask(&mut station, now, motor, Request::ExecuteCommand(Command::StartMotor));
    }
    for round in 0..30 {
        now += Micros::from_millis(100);
        for motor in [1, 2] {
            let ramp = Ramp { speed_rpm: 1000 + 50 * round, duration_ms: 80 };
            ask(&mut station, now, motor, Request::SetRamp(ramp));
            for id in RegisterId::all() {
                ask(&mut station, now, motor, Request::GetRegister(id));
            }
        }
        println!("st {} {:016x}", now.0, fingerprint(station.drive()));
    }
    println!("st said {:016x}", fingerprint(&said));
}

fn rmd() {
    let mut now = Instant(0);
    let mut geared = RmdConfig { id: 2, ..RmdConfig::x8() };
    geared.plant.load.inertia = 0.05;
    let nodes = [RmdConfig::with_id(1), geared].map(|config| {
        RmdNode::new(now, config, config.factory_rom()).expect("the presets are possible")
    });
    let mut bus = RmdBus::new(nodes).expect("the IDs differ");
    let mut said = Vec::new();
    for round in 0..30 {
        let spin = SetSpeed { speed: CentiDps(round * 3000) }.encode();
        let angle = CentiDegrees::from_degrees(f64::from(round * 37 % 100));
        let requests = [(0x141, spin), (0x142, SetPosition { angle }.encode())];
        let looks = [0x141, 0x142].map(|id| (id, ReadPhaseCurrents.encode()));
        for (id, data) in requests.into_iter().chain(looks) {
            bus.receive(now, &CanFrame::new(id, data), |reply| said.push(reply));
        }
        now += Micros::from_millis(100);
        bus.advance_to(now);
        println!("rmd {} {:016x}", now.0, fingerprint(&bus));
    }
    println!("rmd said {:016x}", fingerprint(&said));
}
