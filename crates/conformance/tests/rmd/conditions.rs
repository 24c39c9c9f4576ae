//! Correct motors pass through any adapter, with any load, and with the noise of real sensors.

use std::collections::VecDeque;
use std::time::Duration as Span;

use motorlink::Clock;
use motorlink::port::{CanLink, Link, PortError};
use motorlink_conformance::rmd::suite;
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::plant::PlantConfig;
use motorlink_sim::rmd::RmdConfig;

use crate::drive::{Behaviour, Event, Motors, Setup, Tested, Wire, motor};

fn passes(tested: &Tested) {
    let failed: Vec<_> = tested.report.failed().collect();
    assert!(failed.is_empty() && tested.report.is_clean(), "{failed:#?}");
}

/// A USB adapter: frames wait for the next transfer.
struct Adapter {
    bus: Box<dyn CanLink>,
    clock: Clock,
    received: VecDeque<(Instant, CanFrame)>,
}

const OUT: Micros = Micros::from_millis(2);
const BACK: Micros = Micros::from_millis(16);

impl Adapter {
    fn pass(&mut self, until: Instant) -> Result<(), PortError> {
        while let Some(frame) = self.bus.receive(Some(until.since(self.clock.now()).into()))? {
            self.received.push_back((self.clock.now() + BACK, frame));
        }
        Ok(())
    }
}

impl Link for Adapter {
    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }
}

impl CanLink for Adapter {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.pass(self.clock.now() + OUT)?;
        self.bus.send(frame)?;
        self.pass(self.clock.now())
    }

    fn receive(&mut self, timeout: Option<Span>) -> Result<Option<CanFrame>, PortError> {
        let until = self.clock.now() + timeout.expect("the kit waits for a while").into();
        let due = self.received.front().map(|(due, _)| *due).filter(|due| *due <= until);
        self.pass(due.unwrap_or(until).max(self.clock.now()))?;
        Ok(due.and_then(|_| self.received.pop_front()).map(|(_, frame)| frame))
    }
}

#[test]
fn a_motor_behind_a_slow_adapter_passes() {
    let slow = || {
        let port = |wire: &Wire| {
            let (bus, clock) = (wire.bus(), wire.clock.clone());
            Box::new(Adapter { bus, clock, received: VecDeque::new() }) as Box<dyn CanLink>
        };
        Setup { port, ..Setup::new(vec![motor(1), motor(2)]) }
    };
    passes(&slow().run());
    let careful = Setup { allowed: &[], ..slow() }.run();
    passes(&careful);
    assert!(careful.seconds() < 30, "{} s", careful.seconds());
}

#[test]
fn motors_with_loads_and_friction_pass() {
    let with = |change: fn(&mut PlantConfig)| {
        let mut config = motor(1);
        change(&mut config.plant);
        config
    };
    for changed in [
        RmdConfig { plant: RmdConfig::default().plant, ..motor(1) },
        with(|plant| plant.load.inertia = 0.12),
        with(|plant| plant.load.viscous = 0.5),
        with(|plant| (plant.load.brake, plant.supply.voltage) = (0.8, 24.0)),
    ] {
        passes(&Setup::new(vec![changed]).run());
    }
}

#[test]
fn a_motor_with_noisy_sensors_passes() {
    passes(&Setup { behaviour: noisy(), ..Setup::new(vec![motor(1)]) }.run());
}

/// A load that two amperes do not move is not a fault of the motor.
#[test]
fn a_motor_blocked_by_its_load_does_not_fail_the_torque_case() {
    let mut config = motor(1);
    config.plant.load.brake = 8.0;
    let mut suite = suite();
    suite.retain(|case| case.name == "torque_has_the_sign_of_its_command");
    let tested = Setup { suite, ..Setup::new(vec![config]) }.run();
    assert_eq!((tested.report.count("skipped"), tested.report.outcomes.len()), (1, 1));
}

#[test]
fn a_motor_that_answers_0x9b_with_0x9b_passes() {
    let config = RmdConfig { clear_reply_0x9b: true, ..motor(1) };
    let mut suite = suite();
    suite.retain(|case| case.clauses.iter().any(|clause| clause.starts_with("RMD-9B-")));
    passes(&Setup { suite, ..Setup::new(vec![config]) }.run());
}

/// Noise of a few digits on current, speed, voltage, temperature and phase currents.
fn noisy() -> Behaviour {
    let mut state = 1_u32;
    let mut noise = move |most: i16| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) as i16 % (most + 1)
    };
    let mut add = move |data: &mut [u8; 8], first: usize, most: i16| {
        let value = i16::from_le_bytes([data[first], data[first + 1]]);
        let value = value.saturating_add(noise(2 * most).abs() - most);
        data[first..first + 2].copy_from_slice(&value.to_le_bytes());
    };
    Box::new(move |motors: &mut Motors, event: Event| {
        let mut replies = motors.pass(event);
        for reply in &mut replies {
            let Some((id, data)) = reply.eight_bytes() else { continue };
            let mut data = *data;
            match data[0] {
                0x9A => add(&mut data, 3, 3),
                0x9C | 0xA1..=0xA6 => {
                    add(&mut data, 2, 8);
                    add(&mut data, 4, 3);
                }
                0x9D => [2, 4, 6].into_iter().for_each(|first| add(&mut data, first, 6)),
                _ => {}
            }
            *reply = CanFrame::new(id, data);
        }
        replies
    })
}
