//! A motor with its power stage, sensors and loops.

use core::f32::consts::PI;

use motorlink_proto::rmd::{Errors, Mode, Motor, PhaseCurrents, Sense, Settings};
use motorlink_proto::units::{Celsius, DeciVolts, Dps, PhaseCurrent, TorqueFeedback};

use super::RmdConfig;
use super::cascade::{Cascade, DT, Speed};
use super::config::limit;
use crate::heat::Heat;
use crate::machine::{self, Machine, TURN};
use crate::transform::{phases, stator};

/// A degree in rad.
const DEGREE: f32 = PI / 180.0;
/// Torque current that the power stage can make, A.
const GREATEST_CURRENT: f32 = 33.0;
/// Share of the greatest acceleration with which a move is planned.
const PLANNED: f32 = 0.5;
/// Share of the speed at which the back-EMF takes up the supply that references may reach.
const REACHABLE: f32 = 0.9;

/// An RMD motor behind its drive's protocol.
#[derive(Debug, Clone)]
pub struct RmdMotor {
    config: RmdConfig,
    machine: Machine,
    heat: Heat,
    cascade: Cascade,
    supply: f32,
    /// Faults that something outside holds.
    held: Errors,
    /// Faults that are there until the drive has looked.
    injected: Errors,
    mode: Mode,
    settings: Settings,
    rom_writes: u32,
    /// Position where the encoder's turn began at power-on.
    origin: i64,
}

/// What is really going on in a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// What the motor does.
    pub mode: Mode,
    /// Faults that are present.
    pub faults: Errors,
    /// Speed, °/s.
    pub speed_dps: f32,
    /// Speed reference, °/s.
    pub speed_reference_dps: f32,
    /// Angle over all turns since the beginning, °.
    pub angle_degrees: f64,
    /// Torque current, A.
    pub iq: f32,
    /// Supply voltage, V.
    pub supply_voltage: f32,
    /// Motor temperature, °C.
    pub temperature: f32,
    /// Braking torque of the load, Nm.
    pub load_torque: f32,
    /// Whether the rotor is held.
    pub locked: bool,
}

/// The world around the motor.
impl RmdMotor {
    pub(super) fn new(config: RmdConfig) -> Self {
        let start = machine::position(config.angle_degrees * DEGREE);
        let mut machine = Machine::new(config.machine, start);
        machine.set_load(config.load_torque);
        let mut motor = RmdMotor {
            machine,
            heat: Heat::new(config.heat),
            cascade: Cascade::new(&config.machine),
            supply: config.supply_voltage,
            held: Errors::NONE,
            injected: Errors::NONE,
            mode: Mode::Off,
            settings: Settings::default(),
            rom_writes: 0,
            origin: 0,
            config,
        };
        motor.power_on();
        motor
    }

    /// Starts to count turns anew, as an encoder does that only knows its place in the turn.
    pub(super) fn power_on(&mut self) {
        self.origin = self.machine.position() & !(TURN - 1);
        self.cascade.off(&self.machine);
    }

    /// What the motor and its drive are built from.
    pub const fn config(&self) -> &RmdConfig {
        &self.config
    }

    /// How often the ROM was written: what to keep on disk has changed when this has.
    pub const fn rom_writes(&self) -> u32 {
        self.rom_writes
    }

    /// Sets the supply voltage, V.
    pub const fn set_supply_voltage(&mut self, voltage: f32) {
        self.supply = voltage.max(0.0);
    }

    /// Makes the motor show this temperature, °C, or its own again.
    pub const fn set_temperature(&mut self, temperature: Option<f32>) {
        self.heat.force(temperature);
    }

    /// Sets the braking torque of the load, Nm.
    pub const fn set_load_torque(&mut self, torque: f32) {
        self.machine.set_load(torque);
    }

    /// Holds the rotor where it is, or lets it go.
    pub const fn lock_rotor(&mut self, locked: bool) {
        self.machine.set_locked(locked);
    }

    /// Lets faults happen once.
    pub const fn inject(&mut self, faults: Errors) {
        self.injected = self.injected.union(faults);
    }

    /// Sets which faults are kept present from outside.
    pub const fn hold_faults(&mut self, faults: Errors) {
        self.held = faults;
    }

    /// What is really going on.
    pub fn truth(&self) -> Truth {
        Truth {
            mode: self.mode,
            faults: self.faults(),
            speed_dps: self.machine.speed() / DEGREE,
            speed_reference_dps: self.cascade.reference() / DEGREE,
            angle_degrees: self.machine.position() as f64 * (360.0 / TURN as f64),
            iq: self.cascade.iq(),
            supply_voltage: self.supply,
            temperature: self.heat.temperature(),
            load_torque: self.machine.load(),
            locked: self.machine.locked(),
        }
    }
}

/// What happens by itself.
impl RmdMotor {
    /// A quarter of a millisecond.
    pub(super) fn step(&mut self) {
        const INVERSE_SQRT_3: f32 = 0.577_350_3;
        let voltage = self.supply * INVERSE_SQRT_3;
        let most = limit(self.config.max_torque_current).unwrap_or(GREATEST_CURRENT);
        match self.task(voltage, most) {
            Task::Off => self.cascade.off(&self.machine),
            Task::Torque(iq) => self.cascade.torque(iq, voltage, &self.machine),
            Task::Speed(task) => self.cascade.speed(task, most, voltage, &self.machine),
        }
        let iq = self.cascade.iq();
        self.machine.step(DT, self.config.machine.torque_constant * iq);
        self.heat.step(DT, self.config.machine.copper_loss(iq, 0.0));
    }

    /// What the loops have to do with a phase voltage of `voltage` and a torque current of `most`.
    fn task(&self, voltage: f32, most: f32) -> Task {
        let reachable = REACHABLE * voltage / self.config.machine.back_emf_constant();
        let possible = self.config.machine.torque_constant * most / self.config.machine.inertia;
        let acceleration = limit(self.settings.acceleration.0 as f32 * DEGREE)
            .map_or(possible, |limit| possible.min(limit));
        let reach = |speed| Task::Speed(Speed::Reach { speed, acceleration });
        match self.mode {
            Mode::Off => Task::Off,
            Mode::Torque(torque) => Task::Torque(torque.amps() as f32),
            Mode::Stopped => reach(0.0),
            Mode::Speed(speed) => {
                reach(machine::within(speed.dps() as f32 * DEGREE, -reachable, reachable))
            }
            Mode::Position { target, max_speed, within_max_angle } => {
                let own = limit(self.config.max_speed_dps);
                let most_dps = max_speed.map(|limit| limit.dps() as f32).or(own);
                let target = if within_max_angle { self.within_max_angle(target) } else { target };
                let counts = target.wrapping_sub(self.encoder());
                Task::Speed(Speed::Close {
                    distance: machine::radians(counts << self.unused_bits()),
                    top: most_dps.map_or(reachable, |dps| reachable.min(dps * DEGREE)),
                    acceleration: acceleration.min(PLANNED * possible),
                })
            }
        }
    }

    /// A position command held within Max Angle.
    fn within_max_angle(&self, target: i64) -> i64 {
        let Some(most) = limit(self.config.max_angle_degrees) else { return target };
        let most = machine::position(most * DEGREE) >> self.unused_bits();
        let dropped = self.config.encoder_bits.saturating_sub(16);
        let zero = i64::from(self.settings.encoder_offset) << dropped;
        target.clamp(zero - most, zero + most)
    }

    /// Encoder counts since power-on.
    fn encoder(&self) -> i64 {
        self.machine.position().wrapping_sub(self.origin) >> self.unused_bits()
    }

    /// Bits of a position that are finer than the encoder.
    fn unused_bits(&self) -> u32 {
        TURN.trailing_zeros() - u32::from(self.config.encoder_bits)
    }

    /// Faults that are present.
    pub(super) fn faults(&self) -> Errors {
        let causes = [
            (Errors::LOW_VOLTAGE, self.supply < self.config.protect_voltage),
            (Errors::OVER_TEMPERATURE, self.heat.temperature() > self.config.protect_temperature),
        ];
        causes
            .into_iter()
            .filter(|(_, present)| *present)
            .fold(self.held.union(self.injected), |all, (fault, _)| all.union(fault))
    }
}

enum Task {
    Off,
    /// A.
    Torque(f32),
    Speed(Speed),
}

impl Motor for RmdMotor {
    fn set_mode(&mut self, mode: Mode) {
        self.mode = mode;
    }

    fn configure(&mut self, settings: &Settings) {
        self.settings = *settings;
        self.cascade.tune(&settings.gains, &self.config.machine);
    }

    fn sense(&mut self) -> Sense {
        let iq = self.cascade.iq();
        let (a, b) = phases(stator(0.0, iq, self.machine.electrical_angle()));
        let digits = |current: f32| PhaseCurrent::from_amps(current.into());
        let (phase_a, phase_b) = (digits(a), digits(b));
        // Two sensors; the third current is what makes the sum zero.
        let phase_c = PhaseCurrent(phase_a.0.saturating_add(phase_b.0).saturating_neg());
        let faults = self.faults();
        self.injected = Errors::NONE;
        Sense {
            temperature: Celsius::from_celsius(self.heat.temperature().into()),
            voltage: DeciVolts::from_volts(self.supply.into()),
            iq: TorqueFeedback::from_amps(iq.into()),
            speed: Dps::from_dps((self.machine.speed() / DEGREE).into()),
            encoder: self.encoder(),
            phase_currents: PhaseCurrents { phase_a, phase_b, phase_c },
            faults,
        }
    }

    fn save(&mut self, _rom: &Settings) {
        self.rom_writes = self.rom_writes.saturating_add(1);
    }
}
