//! The firmware's tasks of each millisecond: faults, states, references.

use core::f32::consts::TAU;

use motorlink_proto::st::{Flags, Status};

use super::control::Feedback;
use super::motor::{Frame, StMotor};
use super::scale::{FULL, RPM, RPM_PER_DIGIT, SPEED, divisor};
use super::state::{self, Situation};
use crate::angle::TURN;
use crate::control::{Gains, within};
use crate::plant::board_current;
use crate::vector::Vector;

/// Speed below which the rotor is at a standstill, rpm.
const STANDING: f32 = 1.0;
/// Maximum time that a rotor with encoder may be stuck in RUN, ms.
const STALL: u32 = 500;
/// Time that the observer must detect the rotor before it takes over, ms.
const SEEN: u32 = 20;
/// Maximum time without detection by the observer in RUN, ms.
const UNSEEN: u32 = 30;
/// Maximum difference of the observed speed from the forced one, relative.
const SLIP: f32 = 0.15;
/// Damping of the rotor's oscillation during the alignment with an encoder.
const ALIGNMENT_DAMPING: f32 = 0.7;
/// Weight of a new value in the mean power.
const POWER_SMOOTHING: f32 = 0.05;

impl StMotor {
    pub(super) fn millisecond(&mut self) {
        self.measure();
        self.watch();
        self.proceed();
        self.steer();
        self.supply();
    }

    fn measure(&mut self) {
        let sensor = self.config.build.position_sensor;
        let sign = self.known_sign();
        let firmware = &mut self.firmware;
        if sensor {
            firmware.tracker.read(self.plant.counts() << self.plant.finer_bits());
        }
        let driven = firmware.frame != Frame::Off;
        if driven {
            for observer in [&mut firmware.pll, &mut firmware.cordic].into_iter().flatten() {
                observer.measure(sign);
            }
        }
        firmware.speed = match firmware.observer() {
            _ if sensor => firmware.tracker.speed(),
            Some(observer) if driven => observer.speed() * SPEED,
            // An open bridge shows the back-EMF at its terminals.
            _ => self.plant.machine().speed(),
        };
        let foc = &firmware.foc;
        let digits = 1.5 * foc.voltage.dot(foc.current);
        let watts =
            digits * self.bus_share() / (self.firmware.scale.volt * self.firmware.scale.ampere);
        let power = &mut self.firmware.power;
        *power = if driven { *power + (watts - *power) * POWER_SMOOTHING } else { 0.0 };
    }

    /// The direction of motion, if it is known without the observer.
    fn known_sign(&self) -> Option<f32> {
        let firmware = &self.firmware;
        if self.config.build.position_sensor {
            return Some(1f32.copysign(firmware.speed));
        }
        let forced = matches!(firmware.status, Status::Start | Status::SwitchOver);
        forced.then(|| if firmware.control.backwards() { -1.0 } else { 1.0 })
    }

    /// Checks for causes of faults. A new one switches the motor off.
    fn watch(&mut self) {
        let limits = self.config.thresholds;
        let (voltage, temperature) = (self.plant.bus_voltage(), self.plant.temperature());
        let hot = self.firmware.present & Flags::OVER_TEMP != 0;
        let cool_down = if hot { limits.temperature_hysteresis } else { 0.0 };
        let causes = [
            (Flags::OVER_VOLT, voltage > limits.over_voltage),
            (Flags::UNDER_VOLT, voltage < limits.under_voltage),
            (Flags::OVER_TEMP, temperature > limits.over_temperature - cool_down),
            (Flags::SPEED_FDBK, self.feedback_lost()),
        ];
        let events = core::mem::take(&mut self.firmware.events);
        let present = causes
            .iter()
            .filter(|(_, present)| *present)
            .fold(self.held | events, |all, (fault, _)| all | fault);
        self.firmware.present = present;
        self.firmware.occurred |= present;
        let status = self.firmware.status;
        if present != 0 && !matches!(status, Status::FaultNow | Status::FaultOver) {
            self.enter(Status::FaultNow);
        }
    }

    /// Whether the rotor differs from the firmware's estimate.
    fn feedback_lost(&mut self) -> bool {
        let running = self.running();
        let speed = self.speed_rpm().abs();
        let most = self.firmware.registers.max_app_speed.saturating_abs() as f32;
        let lost = if self.config.build.position_sensor {
            let stuck = running && self.stuck(speed);
            self.firmware.stalled = if stuck { self.firmware.stalled + 1 } else { 0 };
            self.firmware.stalled >= STALL
        } else {
            let missed =
                running && !self.firmware.observer().is_some_and(|observer| observer.sees());
            self.firmware.unseen = if missed { self.firmware.unseen + 1 } else { 0 };
            self.firmware.unseen >= UNSEEN
        };
        running && (speed > 1.2 * most || lost)
    }

    /// Whether the rotor is at a standstill under current, without a position to hold.
    fn stuck(&self, speed: f32) -> bool {
        let least = self.firmware.registers.min_app_speed as f32;
        let current = self.firmware.foc.current.y.abs() / self.firmware.scale.ampere;
        let pushed = current >= 0.2 * self.config.rated_current;
        pushed && self.firmware.control.path().is_none() && speed <= STANDING.max(0.25 * least)
    }

    fn proceed(&mut self) {
        self.firmware.elapsed = self.firmware.elapsed.saturating_add(1);
        let sensor = self.config.build.position_sensor;
        let situation = Situation {
            elapsed: self.firmware.elapsed,
            durations: &self.config.durations,
            revup: &self.firmware.revup,
            sensor,
            unaligned: sensor && !self.firmware.aligned,
            starting: self.firmware.starting,
            standing: self.speed_rpm().abs() < STANDING,
            faulty: self.firmware.present != 0,
        };
        let Some(next) = state::next(self.firmware.status, &situation) else { return };
        match (self.firmware.status, next) {
            (Status::OffsetCalib | Status::AlignOffsetCalib, _) => {
                let count = self.firmware.offset_count.max(1) as f32;
                self.firmware.offset = self.firmware.offset_sum * (1.0 / count);
            }
            (Status::Alignment, _) => {
                self.firmware.aligned = true;
                self.firmware.zero = self.plant.counts() << self.plant.finer_bits();
            }
            (Status::Start, Status::SwitchOver) => {
                if self.firmware.seen < SEEN {
                    self.firmware.events |= Flags::START_UP;
                    return;
                }
                // The observer's frame takes over, with the vector of the forced current.
                let observed =
                    self.firmware.observer().map_or(Vector::ZERO, |observer| observer.frame());
                let forced = Vector::unit(self.firmware.forced);
                self.firmware.foc.change_frame(observed.seen_from(forced));
            }
            _ => {}
        }
        self.enter(next);
        self.obey();
    }

    /// Speed (rpm) and current (s16A) of the rev-up now.
    fn forced(&self) -> (f32, f32) {
        let (speed, current) = state::revup(&self.firmware.revup, self.firmware.elapsed);
        let sign = if self.firmware.control.backwards() { -1.0 } else { 1.0 };
        (sign * speed, sign * current)
    }

    /// Updates the references and the parameters of the current control.
    fn steer(&mut self) {
        if self.firmware.frame == Frame::Off {
            self.firmware.control.follow(0.0, 0.0);
            return;
        }
        match self.firmware.status {
            Status::Run => self.regulate(),
            Status::Start if self.firmware.frame == Frame::Forced => self.rev_up(),
            Status::Alignment => self.align(),
            Status::SwitchOver => self.switch_over(),
            _ => {
                let iq = self.firmware.foc.reference.y;
                self.firmware.control.follow(self.firmware.speed * RPM, iq);
            }
        }
        let step = match self.firmware.frame {
            Frame::Forced => self.firmware.forced_step,
            _ => self.electrical_step(self.firmware.speed),
        };
        let forward = self.config.build.feed_forward && self.running();
        let (share, speed) = (self.bus_share(), self.firmware.speed / SPEED);
        let firmware = &mut self.firmware;
        let registers = &firmware.registers;
        firmware.foc.adapt(share, step);
        firmware.foc.tune(registers);
        firmware.foc.feed_forward(forward.then_some(registers), speed);
        let (kp, ki) = (registers.pll_kp, registers.pll_ki);
        if let Some(observer) = &mut firmware.pll {
            observer.tune(registers.observer_c1, registers.observer_c2, kp, ki);
        }
        if let Some(observer) = &mut firmware.cordic {
            observer.tune(registers.observer_cr_c1, registers.observer_cr_c2, 0, 0);
        }
    }

    /// Electrical rotation per period at a speed in rad/s, 2^32 a turn.
    fn electrical_step(&self, speed: f32) -> i32 {
        let pairs = f32::from(self.config.plant.machine.pole_pairs);
        (speed * pairs * self.plant.period() * (TURN as f32 / TAU)) as i32
    }

    fn rev_up(&mut self) {
        let (speed_rpm, current) = self.forced();
        let turn = self.electrical_step(speed_rpm / RPM);
        self.firmware.forced_step = turn.wrapping_add(self.approach(current));
        self.firmware.foc.reference = Vector::new(0.0, current);
        self.firmware.control.follow(speed_rpm, current);
        let least = self.firmware.registers.min_app_speed as f32;
        let slip = (self.firmware.speed * RPM - speed_rpm).abs();
        let sees = self.firmware.observer().is_some_and(|observer| observer.sees());
        let found = sees && speed_rpm.abs() >= least && slip <= SLIP * speed_rpm.abs();
        self.firmware.seen = if found { self.firmware.seen + 1 } else { 0 };
    }

    /// In the first half of the first phase the field rotates a quarter turn more, so that no rotor
    /// remains at the point without torque. Per period, 2^32 a turn.
    fn approach(&self, current: f32) -> i32 {
        let half = u32::from(self.firmware.revup[0].duration_ms) / 2;
        if self.firmware.elapsed > half {
            return 0;
        }
        let periods = half as f32 * 1e-3 / self.plant.period();
        (0.25 * TURN as f32 / periods).copysign(current) as i32
    }

    /// A current in one direction. It starts a quarter turn before it, so that no rotor remains at
    /// the point without torque. It yields to the rotor's oscillation to damp it.
    fn align(&mut self) {
        let total = f32::from(self.config.durations.alignment_ms.max(1));
        let done = self.firmware.elapsed as f32 / total;
        let current = self.config.alignment_current * (4.0 * done).min(1.0);
        let machine = &self.config.plant.machine;
        let pairs = f32::from(machine.pole_pairs);
        let pull = machine.torque_constant() * self.config.alignment_current.max(1e-3);
        let ratio = machine.gear.ratio;
        let inertia = machine.inertia + self.config.plant.load.inertia / (ratio * ratio);
        let swing = libm::sqrtf(pairs * pull / inertia);
        let yielding = 2.0 * ALIGNMENT_DAMPING * pairs / swing * self.firmware.speed;
        let turns = -0.25 * (1.0 - 2.0 * done).max(0.0) - within(yielding / TAU, -0.2, 0.2);
        self.firmware.forced = (turns * TURN as f32) as i64 as u32;
        self.firmware.forced_step = 0;
        self.firmware.foc.reference = Vector::new(current * self.firmware.scale.ampere, 0.0);
        self.firmware.control.follow(0.0, 0.0);
    }

    /// The flux current of the rev-up ends; the torque current remains.
    fn switch_over(&mut self) {
        let total = u32::from(self.config.durations.switch_over_ms);
        let left = total.saturating_sub(self.firmware.elapsed);
        let share = left as f32 / (left + 1) as f32;
        self.firmware.foc.reference.x *= share;
        let iq = self.firmware.foc.reference.y;
        self.firmware.control.follow(self.firmware.speed * RPM, iq);
    }

    fn regulate(&mut self) {
        let rated = self.config.rated_current * self.firmware.scale.ampere;
        let id = within(self.flux_reference() as f32 + self.weaken(rated), -rated, rated);
        let most_iq = libm::sqrtf((rated * rated - id * id).max(0.0));
        let feedback = Feedback {
            speed_rpm: self.firmware.speed / SPEED * RPM_PER_DIGIT,
            position: self.position_from_zero(),
            most_iq,
        };
        let firmware = &mut self.firmware;
        let iq = firmware.control.step(&feedback, &firmware.registers);
        firmware.foc.reference = Vector::new(id, iq);
    }

    /// Id that keeps the voltage below FLUXWK_BUS, s16A.
    fn weaken(&mut self, rated: f32) -> f32 {
        if !self.config.build.flux_weakening {
            return 0.0;
        }
        let registers = &self.firmware.registers;
        let gains =
            Gains::new([registers.fluxwk_kp, registers.fluxwk_ki, 0], [divisor::WEAKENING; 3]);
        let most = registers.fluxwk_bus as f32 * (FULL / 1000.0);
        let error = (most * most - self.firmware.foc.wish.square()) / 32768.0;
        self.firmware.weakening.step(error, &gains, -rated, 0.0)
    }

    /// The second feed of the bus, and the board's current.
    fn supply(&mut self) {
        let (source, bus) = (self.plant.supply().voltage, self.plant.bus_voltage());
        if self.config.build.pfc {
            let firmware = &mut self.firmware;
            firmware.pfc.step(source, bus, &firmware.registers);
        }
        if !self.firmware.pfc.enabled() {
            self.plant.feed(0.0);
        }
        self.plant.draw(board_current(self.config.standby_power, bus));
    }

    /// Bus voltage per nominal bus voltage; at least a twentieth, to avoid a division by zero.
    pub(super) fn bus_share(&self) -> f32 {
        (self.plant.bus_voltage() / self.firmware.scale.nominal).max(0.05)
    }

    pub(super) fn running(&self) -> bool {
        self.firmware.status == Status::Run
    }

    pub(super) fn flags(&self) -> Flags {
        Flags::new(self.firmware.occurred, self.firmware.present)
    }

    /// Measured speed, rpm.
    pub(super) fn speed_rpm(&self) -> f32 {
        self.firmware.speed * RPM
    }

    /// Measured position from the aligned zero, 2^32 a turn.
    pub(super) fn position_from_zero(&self) -> i64 {
        (self.plant.counts() << self.plant.finer_bits()).wrapping_sub(self.firmware.zero)
    }
}
