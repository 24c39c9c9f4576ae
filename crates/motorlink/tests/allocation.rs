//! Exchanges and cycles allocate nothing, counted on real ports.

mod served;

use std::time::Duration;

use allocation_counter::measure;
use motorlink::rmd::{self, MotorId, MotorSet, ReadMotionStatus, SetTorque4};
use motorlink::st::{self, Ramp, RegisterId, register};
use served::Served;

#[test]
fn an_exchange_with_an_st_drive_allocates_nothing() {
    let drives = Served::new("alloc-st");
    let client = st::Client::open(&drives.st.parse().unwrap(), st::Options::default()).unwrap();
    let motor = client.motor(1).unwrap();
    let segment = [RegisterId::STATUS, RegisterId::SPEED_MEAS, RegisterId::I_Q];
    motor.configure_segment(0, &segment).unwrap();
    let counted = measure(|| {
        for n in 0..100 {
            motor.get(register::SPEED_MEAS).unwrap();
            motor.set(register::SPEED_KP, n).unwrap();
            motor.set_ramp(Ramp { speed_rpm: 1000, duration_ms: 10 }).unwrap();
            let mut values = [0; 3];
            motor.segment(0, &segment, &mut values).unwrap();
        }
    });
    assert_eq!(counted.count_total, 0);
}

#[test]
fn exchanges_and_cycles_on_a_bus_allocate_nothing() {
    let drives = Served::new("alloc-rmd");
    let options = rmd::Options { timeout: Duration::from_secs(2), ..rmd::Options::default() };
    let bus = rmd::Client::open(&drives.rmd.parse().unwrap(), options).unwrap();
    let motor = bus.motor(1).unwrap();
    let all: MotorSet = (1..=4).filter_map(MotorId::new).collect();
    let status = [1, 2, 3, 4].map(|id| (MotorId::new(id).unwrap(), ReadMotionStatus));
    let mut answered = 0;
    let counted = measure(|| {
        for _ in 0..100 {
            motor.motion_status().unwrap();
            bus.cycle(&status, |_, reply| answered += u32::from(reply.is_ok())).unwrap();
            for reply in bus.set_torque4(SetTorque4::default(), all).unwrap().into_iter().flatten()
            {
                reply.unwrap();
            }
        }
    });
    assert_eq!((counted.count_total, answered), (0, 400));
}
