//! A motor with its supply, power stage and sensors: the hardware below a drive's firmware.
//!
//! [`Plant::step`] is one period of the pulse width modulation. The firmware reads
//! [`sample`](Plant::sample), [`counts`](Plant::counts) and the bus voltage, and gives the power
//! stage's command for the *next* period: the sample's delay of a real drive.

mod energy;
mod heat;
mod inverter;
mod load;
mod machine;
mod noise;
pub(crate) mod range;
mod sensing;
mod supply;

pub use energy::{Energy, Losses};
pub use heat::{HeatConfig, HeatSensor};
pub use inverter::{Bridge, InverterConfig};
pub use load::{LoadConfig, PendulumConfig, SpringConfig, StopsConfig};
pub use machine::{Feed, Flow, GearConfig, Machine, MachineConfig};
pub use range::OutOfRange;
pub use sensing::{EncoderConfig, Sample, SensingConfig};
pub(crate) use supply::board_current;
pub use supply::{ChopperConfig, SupplyConfig};

use heat::{Gained, Heat};
use inverter::Modulator;
use sensing::Sensor;
use supply::{Currents, Supply};

use crate::angle;
use crate::control::at_least;
use crate::vector::{INVERSE_SQRT_3, Vector};

/// The configuration of a plant.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct PlantConfig {
    /// Period of the pulse width modulation and of the current control, µs.
    pub period_us: u16,
    /// Seed of the noise.
    pub seed: u32,
    /// Initial angle of the rotor, °.
    pub angle_degrees: f32,
    /// The motor.
    pub machine: MachineConfig,
    /// Its load.
    pub load: LoadConfig,
    /// Its thermal model.
    pub heat: HeatConfig,
    /// Its supply.
    pub supply: SupplyConfig,
    /// The power stage.
    pub inverter: InverterConfig,
    /// The current sensors.
    pub sensing: SensingConfig,
    /// The encoder.
    pub encoder: EncoderConfig,
}

/// The true state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantTruth {
    /// Speed of the rotor, rad/s.
    pub speed: f32,
    /// Angle of the rotor over all turns, °.
    pub angle_degrees: f64,
    /// Angle of the output over all turns, °.
    pub output_degrees: f64,
    /// Flux current, A.
    pub id: f32,
    /// Torque current, A.
    pub iq: f32,
    /// Currents of the phases, A.
    pub phase_currents: [f32; 3],
    /// Voltage at the windings in the rotor's frame, mean of the last period, V.
    pub vd: f32,
    /// The same of the q axis, V.
    pub vq: f32,
    /// The firmware's voltage command for the last period, in the rotor's frame in the middle of
    /// the period, V. Without the limits of the hexagon, the dead time and the drop of the
    /// switches. 0 while the switches are open.
    pub vd_command: f32,
    /// The same of the q axis, V.
    pub vq_command: f32,
    /// Electromagnetic torque, Nm.
    pub torque: f32,
    /// Torque of the load against growing angles of the output, Nm.
    pub load_torque: f32,
    /// Bus voltage, V.
    pub bus_voltage: f32,
    /// Current out of the source, mean of the last period, A; negative into it.
    pub supply_current: f32,
    /// Whether the brake resistor is on.
    pub chopping: bool,
    /// Losses.
    pub losses: Losses,
    /// Temperature of the winding, mean of its phases, °C.
    pub winding_temperature: f32,
    /// Temperatures of the phases, °C.
    pub phase_temperatures: [f32; 3],
    /// Temperature of the housing, °C.
    pub housing_temperature: f32,
    /// Temperature of the inverter's switches, °C.
    pub inverter_temperature: f32,
    /// Whether the rotor is locked.
    pub locked: bool,
}

/// The effect of the diodes while all switches are open. Current starts to flow when the back-EMF
/// between two terminals is above the bus voltage. The diodes then apply the bus voltage, whose
/// six-step fundamental is 2/π, against the current at the end of the step. Returns the voltage, if
/// current flows, and whether the current ends in this step.
fn through_diodes(machine: &Machine, period: f32, bus: f32) -> (Option<Feed>, bool) {
    const SIX_STEP: f32 = core::f32::consts::FRAC_2_PI;
    let MachineConfig { inductance_d, inductance_q, .. } = *machine.config();
    let current = machine.rotor_current();
    let back_emf = machine.back_emf_amplitude();
    let flows = current != Vector::ZERO;
    let most = if flows { SIX_STEP } else { INVERSE_SQRT_3 } * bus;
    if !flows && back_emf.abs() <= most {
        return (None, false);
    }
    let change = Vector::new(inductance_d * current.x, inductance_q * current.y);
    let ending = Vector::new(0.0, back_emf) - change * (1.0 / period);
    let length = ending.length();
    let ends = length <= most;
    (Some(Feed::Rotor(if ends { ending } else { ending * (most / length) })), ends)
}

/// Interval between two steps of the thermal model, µs.
const SLOW_US: u32 = 1000;

/// A motor with its supply, its power stage and its sensors.
#[derive(Debug, Clone)]
pub struct Plant {
    config: PlantConfig,
    /// Length of a step, s.
    period: f32,
    modulator: Modulator,
    sensor: Sensor,
    machine: Machine,
    supply: Supply,
    heat: Heat,
    /// The command for the next step.
    pending: Bridge,
    /// The command of the last step, in the stator's frame, V.
    commanded: Vector,
    /// Current of a second feed into the bus, and current of the board, A.
    fed: f32,
    board: f32,
    /// The encoder's reading at the rotor's position 0, 2^32 a turn.
    encoder_zero: i64,
    /// Steps since the start.
    count: u32,
    /// Time since the last slow step, µs.
    since_slow: u32,
    /// Sum of the squares of the phase currents since the last slow step, A².
    squares: [f32; 3],
    /// Energies since the last slow step.
    flow: Flow,
    bus: supply::Flow,
    switching: f32,
    energy: Energy,
    losses: Losses,
    /// Stored energy at the start, J.
    initial: f64,
}

impl Plant {
    /// A motor at rest with a charged bus.
    pub fn new(config: PlantConfig) -> Self {
        let start = angle::position(config.angle_degrees.to_radians());
        let period = f32::from(config.period_us) * 1e-6;
        let mut plant = Plant {
            period,
            modulator: Modulator::new(&config.inverter, period),
            sensor: Sensor::new(&config.sensing, config.seed),
            machine: Machine::new(config.machine, config.load, period),
            supply: Supply::new(config.supply),
            heat: Heat::new(config.heat),
            pending: Bridge::Off,
            commanded: Vector::ZERO,
            fed: 0.0,
            board: 0.0,
            encoder_zero: angle::position(config.encoder.offset_degrees.to_radians()),
            count: 0,
            since_slow: 0,
            squares: [0.0; 3],
            flow: Flow::default(),
            bus: supply::Flow::default(),
            switching: 0.0,
            energy: Energy::default(),
            losses: Losses::default(),
            initial: 0.0,
            config,
        };
        plant.machine.place(start, 0.0);
        plant.machine.set_series(config.inverter.on_resistance);
        plant.machine.set_temperatures(plant.heat.winding(), plant.heat.housing());
        plant.initial = plant.stored();
        plant
    }

    /// The configuration. Load and source may have changed since.
    pub const fn config(&self) -> &PlantConfig {
        &self.config
    }

    /// The motor.
    pub const fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Length of a step, s.
    pub const fn period(&self) -> f32 {
        self.period
    }

    /// Executes one period with the command given at its start, and takes the command for the next
    /// one.
    #[inline]
    pub fn step(&mut self, next: Bridge) {
        let bridge = core::mem::replace(&mut self.pending, next);
        self.count = self.count.wrapping_add(1);
        let idle = bridge == Bridge::Off && self.machine.rests();
        if !idle {
            self.move_on(bridge);
        } else if self.fed != 0.0 || self.board != 0.0 || !self.supply.rests() {
            let currents = self.currents(0.0);
            self.supply.rest(self.period, currents, &mut self.bus);
        }
        self.since_slow += u32::from(self.config.period_us);
        if self.since_slow >= SLOW_US {
            self.warm_up();
        }
    }

    #[inline]
    fn move_on(&mut self, bridge: Bridge) {
        let bus = self.supply.voltage();
        let before = self.flow.electrical;
        let Plant { machine, flow, period, .. } = self;
        self.commanded = Vector::ZERO;
        let (feed, ends) = match bridge {
            Bridge::Drive(share) => {
                self.commanded = share * bus;
                let share = self.modulator.modulate(share, machine.current());
                (Some(Feed::Stator(share * bus)), false)
            }
            Bridge::Off => through_diodes(machine, *period, bus),
        };
        match feed {
            Some(feed) => machine.step(feed, flow),
            None => machine.coast(flow),
        }
        let phases = machine.current().phases();
        for (sum, current) in self.squares.iter_mut().zip(phases) {
            *sum += current * current;
        }
        let switching = if bridge == Bridge::Off { 0.0 } else { self.modulator.switching(phases) };
        if ends {
            machine.open();
        }
        self.switching += switching * bus * self.period;
        let taken = (self.flow.electrical - before) / (self.period * at_least(bus, 1e-3));
        let currents = self.currents(taken + switching);
        self.supply.step(self.period, currents, &mut self.bus);
    }

    /// The currents of the bus. `bridge` is the bridge's current, A.
    fn currents(&self, bridge: f32) -> Currents {
        Currents { bridge, board: self.board, fed: self.fed }
    }

    /// The tasks of each millisecond: heat, and the account of energy.
    fn warm_up(&mut self) {
        let dt = self.since_slow as f32 * 1e-6;
        self.since_slow = 0;
        self.energy = self.accounted();
        let bus = core::mem::take(&mut self.bus);
        let flow = core::mem::take(&mut self.flow);
        let series = self.config.inverter.on_resistance;
        let resistance = self.machine.resistance();
        let winding = flow.copper * resistance / (resistance + series);
        let inverter = flow.copper - winding + core::mem::take(&mut self.switching);
        let watts = |joules: f32| joules / dt;
        self.losses = Losses {
            winding: watts(winding),
            inverter: watts(inverter),
            iron: watts(flow.iron),
            friction: watts(flow.friction),
            gear: watts(flow.gear),
            chopper: watts(bus.braked),
        };
        let housing = flow.iron + flow.friction;
        let gained = Gained { winding, shares: self.phase_shares(), inverter, housing };
        self.heat.step(dt, &gained);
        self.machine.set_temperatures(self.heat.winding(), self.heat.housing());
    }

    /// Shares of the phases in the winding's heat since the last slow step.
    fn phase_shares(&mut self) -> [f32; 3] {
        let squares = core::mem::take(&mut self.squares);
        let sum: f32 = squares.iter().sum();
        if sum > 0.0 { squares.map(|square| square / sum) } else { [1.0 / 3.0; 3] }
    }

    /// The account with the energies since its last update, without the stored energy.
    fn accounted(&self) -> Energy {
        Energy {
            source: self.energy.source + f64::from(self.bus.source),
            supply: self.energy.supply + f64::from(self.bus.lost),
            board: self.energy.board + f64::from(self.bus.board),
            chopper: self.energy.chopper + f64::from(self.bus.braked),
            electrical: self.energy.electrical + f64::from(self.flow.electrical),
            copper: self.energy.copper + f64::from(self.flow.copper),
            switching: self.energy.switching + f64::from(self.switching),
            iron: self.energy.iron + f64::from(self.flow.iron),
            friction: self.energy.friction + f64::from(self.flow.friction),
            gear: self.energy.gear + f64::from(self.flow.gear),
            load: self.energy.load + f64::from(self.flow.load),
            ..self.energy
        }
    }

    fn stored(&self) -> f64 {
        f64::from(self.supply.energy())
            + f64::from(self.machine.magnetic_energy())
            + f64::from(self.machine.mechanical_energy())
    }
}

/// The interface of the firmware.
impl Plant {
    /// Opens all switches now, instead of at the end of the period.
    pub const fn open_bridge(&mut self) {
        self.pending = Bridge::Off;
    }

    /// The converter's readings of the phase currents.
    pub fn sample(&self) -> Sample {
        self.sensor.sample(self.machine.current(), self.count)
    }

    /// Counts of the encoder over all turns, 2^bits a turn.
    pub fn counts(&self) -> i64 {
        self.machine.position().wrapping_add(self.encoder_zero) >> self.finer_bits()
    }

    /// Number of position bits below the encoder's resolution.
    pub fn finer_bits(&self) -> u32 {
        angle::TURN.trailing_zeros() - u32::from(self.config.encoder.bits)
    }

    /// Voltage of the bus, V.
    pub fn bus_voltage(&self) -> f32 {
        self.supply.voltage()
    }

    /// The temperature sensor's reading, °C.
    pub fn temperature(&self) -> f32 {
        self.heat.sensed()
    }

    /// Sets a current (A) of a second feed into the bus, for all later steps.
    pub fn feed(&mut self, current: f32) {
        self.fed = current;
    }

    /// Sets the board's current from the bus (A), for all later steps.
    pub fn draw(&mut self, current: f32) {
        self.board = current;
    }
}

/// The environment of the motor.
impl Plant {
    /// Sets the voltage of the source, V.
    pub fn set_source(&mut self, voltage: f32) {
        self.supply.set_source(voltage.max(0.0));
    }

    /// The supply as it is now.
    pub fn supply(&self) -> &SupplyConfig {
        self.supply.config()
    }

    /// Changes the load. The energy stored in it is set accordingly.
    pub fn change_load(&mut self, change: impl FnOnce(&mut LoadConfig)) {
        let before = self.stored();
        let mut load = *self.machine.load();
        change(&mut load);
        self.machine.set_load(load);
        self.initial += self.stored() - before;
    }

    /// Locks or releases the rotor.
    pub const fn lock(&mut self, locked: bool) {
        self.machine.lock(locked);
    }

    /// Forces the temperature sensor's reading, °C; `None` ends this.
    pub const fn force_temperature(&mut self, temperature: Option<f32>) {
        self.heat.force(temperature);
    }

    /// The true state.
    pub fn truth(&self) -> PlantTruth {
        let current = self.machine.rotor_current();
        let (voltage, command) =
            (self.machine.voltage(), self.machine.seen_in_last_step(self.commanded));
        let degrees = |position: i64| position as f64 * (360.0 / angle::TURN as f64);
        PlantTruth {
            speed: self.machine.speed(),
            angle_degrees: degrees(self.machine.position()),
            output_degrees: degrees(self.machine.position())
                / f64::from(self.config.machine.gear.ratio),
            id: current.x,
            iq: current.y,
            phase_currents: self.machine.current().phases(),
            vd: voltage.x,
            vq: voltage.y,
            vd_command: command.x,
            vq_command: command.y,
            torque: self.machine.torque(),
            load_torque: self.machine.load_torque(),
            bus_voltage: self.supply.voltage(),
            supply_current: self.supply.drawn(),
            chopping: self.supply.chopping(),
            losses: self.losses,
            winding_temperature: self.heat.winding(),
            phase_temperatures: self.heat.phases(),
            housing_temperature: self.heat.housing(),
            inverter_temperature: self.heat.inverter(),
            locked: self.machine.locked(),
        }
    }

    /// The account of energy until now.
    pub fn energy(&self) -> Energy {
        Energy { stored: self.stored() - self.initial, ..self.accounted() }
    }
}
