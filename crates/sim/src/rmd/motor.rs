//! A motor with its loops.

use motorlink_proto::rmd::{Errors, Mode, MotorControl, PhaseCurrents, Sense, Settings};
use motorlink_proto::units::{Celsius, DeciVolts, Dps, IqFeedback, PhaseCurrent};

use super::RmdConfig;
use super::cascade::{Cascade, Task};
use super::config::limit;
use super::current::CurrentLoop;
use super::speed::Speedometer;
use crate::angle;
use crate::control::within;
use crate::plant::{Bridge, OutOfRange, Plant, PlantTruth, board_current};
use crate::vector::INVERSE_SQRT_3;

/// Time between two steps of the loops for speed and position, µs.
const LOOP_US: u16 = 250;
/// Maximum torque current of the power stage, A.
const GREATEST_CURRENT: f32 = 33.0;
/// Fraction of the maximum acceleration that a move is planned with.
const PLANNED: f32 = 0.5;
/// Maximum reference, as a fraction of the speed at which the back-EMF equals the supply voltage.
const REACHABLE: f32 = 0.9;

/// An RMD motor behind its drive's protocol.
#[derive(Debug, Clone)]
pub struct RmdMotor {
    config: RmdConfig,
    plant: Plant,
    current: CurrentLoop,
    cascade: Cascade,
    speedometer: Speedometer,
    /// Periods between two steps of the loops for speed and position, and the number of elapsed
    /// ones.
    periods: u16,
    over: u16,
    /// Faults that are held from outside.
    held: Errors,
    /// Faults that last until the drive has read them.
    injected: Errors,
    mode: Mode,
    settings: Settings,
    rom_writes: u32,
    /// Counts at the start of the encoder's turn at power-on.
    origin: i64,
}

/// The true state of a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// The machine and its environment.
    pub plant: PlantTruth,
    /// The mode.
    pub mode: Mode,
    /// Faults that are present.
    pub faults: Errors,
    /// Speed of the rotor, °/s.
    pub speed_dps: f32,
    /// Speed reference of the rotor, °/s.
    pub speed_reference_dps: f32,
    /// The temperature sensor's reading, °C.
    pub temperature: f32,
}

/// The environment of the motor.
impl RmdMotor {
    /// A motor without a drive, for use with a separate [`Drive`](motorlink_proto::rmd::Drive). The
    /// error is that of [`RmdConfig::check`].
    pub fn new(config: RmdConfig) -> Result<Self, OutOfRange> {
        config.check()?;
        let plant = Plant::new(config.plant);
        let periods = (LOOP_US / config.plant.period_us).max(1);
        let dt = plant.period() * f32::from(periods);
        let speedometer = Speedometer::new(&plant, dt);
        let mut motor = RmdMotor {
            current: CurrentLoop::new(&plant),
            cascade: Cascade::new(dt, speedometer.new_share()),
            speedometer,
            plant,
            periods,
            over: 0,
            held: Errors::NONE,
            injected: Errors::NONE,
            mode: Mode::Off,
            settings: Settings::default(),
            rom_writes: 0,
            origin: 0,
            config,
        };
        motor.power_on();
        Ok(motor)
    }

    /// Resets the turn counter, as an encoder that only knows its position in the turn.
    pub fn power_on(&mut self) {
        let turn = 1 << self.config.plant.encoder.bits;
        self.origin = self.plant.counts() & -turn;
    }

    /// The configuration of the motor and its drive.
    pub const fn config(&self) -> &RmdConfig {
        &self.config
    }

    /// The machine with its supply, power stage and sensors.
    pub const fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The same, mutable, to change the supply, the load and the temperature.
    pub const fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// Number of ROM writes. If it changed, the stored ROM must be saved.
    pub const fn rom_writes(&self) -> u32 {
        self.rom_writes
    }

    /// Injects faults that happen once.
    pub const fn inject(&mut self, faults: Errors) {
        self.injected = self.injected.union(faults);
    }

    /// Holds these faults, in addition to those already held.
    pub const fn hold_faults(&mut self, faults: Errors) {
        self.held = self.held.union(faults);
    }

    /// Releases these held faults.
    pub const fn release_faults(&mut self, faults: Errors) {
        self.held = self.held.without(faults);
    }

    /// The true state.
    pub fn truth(&self) -> Truth {
        Truth {
            plant: self.plant.truth(),
            mode: self.mode,
            faults: self.faults(),
            speed_dps: self.plant.machine().speed().to_degrees(),
            speed_reference_dps: self.cascade.reference().to_degrees(),
            temperature: self.plant.temperature(),
        }
    }
}

/// The simulation.
impl RmdMotor {
    /// Executes one period of the plant. Returns whether the loops for speed and position took a
    /// step. [`RmdNode`](super::RmdNode) calls this itself.
    pub fn step(&mut self) -> bool {
        let bridge = match self.mode {
            Mode::Off => Bridge::Off,
            _ => self.current.step(&self.plant),
        };
        self.plant.step(bridge);
        self.over += 1;
        let slow = self.over >= self.periods;
        if slow {
            self.over = 0;
            self.slow_step();
        }
        slow
    }

    fn slow_step(&mut self) {
        let bus = self.plant.bus_voltage();
        self.plant.draw(board_current(self.config.standby_power, bus));
        self.speedometer.read(self.plant.counts());
        let speed = self.speedometer.speed();
        let most = limit(self.config.max_torque_current)
            .map_or(GREATEST_CURRENT, |most| most.min(GREATEST_CURRENT));
        let iq = match self.mode {
            Mode::Off => return self.cascade.follow(speed, 0.0),
            Mode::Torque(torque) => {
                let iq = torque.amps() as f32;
                self.cascade.follow(speed, iq);
                iq
            }
            Mode::Stopped => self.cascade.step(self.reach(0.0, most), most, speed),
            Mode::Speed(speed_limit) => {
                let reachable = self.reachable(bus);
                let wanted = (speed_limit.dps() as f32).to_radians();
                let task = self.reach(within(wanted, -reachable, reachable), most);
                self.cascade.step(task, most, speed)
            }
            Mode::Position { target, max_speed, within_max_angle } => {
                let own = limit(self.config.max_speed_dps);
                let top_dps = max_speed.map(|limit| limit.dps() as f32).or(own);
                let target = if within_max_angle { self.within_max_angle(target) } else { target };
                let counts = target.wrapping_sub(self.encoder());
                let reachable = self.reachable(bus);
                let possible = self.possible(most);
                let task = Task::Close {
                    distance: angle::radians(counts << self.plant.finer_bits()),
                    top: top_dps.map_or(reachable, |dps| reachable.min(dps.to_radians())),
                    acceleration: self.acceleration(PLANNED * possible),
                };
                self.cascade.step(task, most, speed)
            }
        };
        self.current.command(iq, speed, bus);
    }

    fn reach(&self, speed: f32, most: f32) -> Task {
        Task::Reach { speed, acceleration: self.acceleration(self.possible(most)) }
    }

    /// Speed that references may reach, rad/s.
    fn reachable(&self, bus: f32) -> f32 {
        REACHABLE * INVERSE_SQRT_3 * bus / self.config.plant.machine.back_emf_constant()
    }

    /// Acceleration that a torque current (A) gives the rotor alone, rad/s².
    fn possible(&self, most: f32) -> f32 {
        let machine = &self.config.plant.machine;
        machine.torque_constant() * most / machine.inertia
    }

    /// `most` or the acceleration limit, rad/s².
    fn acceleration(&self, most: f32) -> f32 {
        let own = limit((self.settings.acceleration.0 as f32).to_radians());
        own.map_or(most, |own| own.min(most))
    }

    /// A position command limited to Max Angle.
    fn within_max_angle(&self, target: i64) -> i64 {
        let Some(most) = limit(self.config.max_angle_degrees) else { return target };
        let most = angle::position(most.to_radians()) >> self.plant.finer_bits();
        let dropped = self.config.plant.encoder.bits.saturating_sub(16);
        let zero = i64::from(self.settings.encoder_offset) << dropped;
        target.clamp(zero - most, zero + most)
    }

    /// Encoder counts since power-on.
    fn encoder(&self) -> i64 {
        self.plant.counts().wrapping_sub(self.origin)
    }

    /// Faults that are present.
    pub(super) fn faults(&self) -> Errors {
        let RmdConfig { protect_voltage, protect_temperature, .. } = self.config;
        let causes = [
            (Errors::LOW_VOLTAGE, self.plant.bus_voltage() < protect_voltage),
            (Errors::OVER_TEMPERATURE, self.plant.temperature() > protect_temperature),
        ];
        causes
            .into_iter()
            .filter(|(_, present)| *present)
            .fold(self.held.union(self.injected), |all, (fault, _)| all.union(fault))
    }
}

impl MotorControl for RmdMotor {
    fn set_mode(&mut self, mode: Mode) {
        let speed = self.speedometer.speed();
        if self.mode == Mode::Off {
            self.current.reset();
            self.current.command(0.0, speed, self.plant.bus_voltage());
        }
        if mode == Mode::Stopped && self.mode != Mode::Stopped {
            // The integral of a rotor that was held would turn it after its release.
            self.cascade.follow(speed, 0.0);
        }
        self.mode = mode;
    }

    fn configure(&mut self, settings: &Settings) {
        self.settings = *settings;
        self.cascade.tune(&settings.gains, &self.config.plant.machine);
        self.current.tune(&settings.gains);
    }

    fn sense(&mut self) -> Sense {
        let sample = self.plant.sample();
        let digit = self.config.plant.sensing.full_scale / 32767.0;
        let amps = |sample: i16| PhaseCurrent::from_amps((f32::from(sample) * digit).into());
        let (phase_a, phase_b) = (amps(sample.a), amps(sample.b));
        // There are two sensors; the third current makes the sum zero.
        let phase_c = PhaseCurrent(phase_a.0.saturating_add(phase_b.0).saturating_neg());
        let iq = if self.mode == Mode::Off { 0.0 } else { self.current.iq() };
        let faults = self.faults();
        self.injected = Errors::NONE;
        Sense {
            temperature: Celsius::from_celsius(self.plant.temperature().into()),
            voltage: DeciVolts::from_volts(self.plant.bus_voltage().into()),
            iq: IqFeedback::from_amps(iq.into()),
            speed: Dps::from_dps(self.speedometer.shown().to_degrees().into()),
            encoder: self.encoder(),
            phase_currents: PhaseCurrents { phase_a, phase_b, phase_c },
            faults,
        }
    }

    fn save(&mut self, _rom: &Settings) {
        self.rom_writes = self.rom_writes.saturating_add(1);
    }
}
