//! The machine: a permanent-magnet synchronous motor on a shaft.
//!
//! # Equations
//!
//! Windings, in the stator's frame with the flux linkage ψ as state (Park's equations, see P. Krause
//! and others, *Analysis of Electric Machinery and Drive Systems*, chapter on synchronous machines):
//!
//! ```text
//! dψ/dt = v − R i            ψd = Ld id + ψm,   ψq = Lq iq
//! T     = 1.5 p ψ × i        = 1.5 p (ψm iq + (Ld − Lq) id iq)
//! ```
//!
//! In this frame a constant voltage is constant, so only R/L limits the step, not the speed. A step
//! is one of Runge and Kutta's fourth order, with the rotor's angle at begin, middle and end from
//! the speed and the last acceleration; a winding that is faster than [`FASTEST`] takes several.
//!
//! Shaft, at the rotor, with gear ratio N:
//!
//! ```text
//! J dω/dt = T + cogging + T_load/N − B ω − dry(ω) sign ω
//! dry     = Tc + (Ts − Tc) / (1 + (ω/ωs)²) + hysteresis + (brake + (1/η − 1) |T_load|) / N
//! ```
//!
//! Viscous friction is implicit; dry friction takes away speed but never more than there is, so a
//! rotor stays where what pulls it is less (stiction with the Stribeck effect, see B. Armstrong,
//! *A survey of models, analysis tools and compensation methods for the control of machines with
//! friction*, Automatica 30, 1994). Torques that depend on the position are taken in the middle of
//! the step. Iron losses are torques against the motion: hysteresis does not depend on speed, eddy
//! currents are in proportion to it.

use super::load::{Load, LoadConfig};
use crate::angle::{TURN, sin_cos};
use crate::vector::Vector;

/// What a machine is. A machine's values belong together: start from a
/// [preset](crate::preset), not from nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct MachineConfig {
    /// Pairs of poles.
    pub pole_pairs: u8,
    /// Phase resistance at 25 °C, Ω.
    pub resistance: f32,
    /// Inductance along the magnet, H.
    pub inductance_d: f32,
    /// Inductance across the magnet, H.
    pub inductance_q: f32,
    /// Amplitude of the magnet's flux linkage in a phase, Wb.
    pub flux_linkage: f32,
    /// Inertia of the rotor, kg m².
    pub inertia: f32,
    /// Friction that grows with speed, Nm s/rad.
    pub viscous_friction: f32,
    /// Friction of a turning rotor that does not, Nm.
    pub coulomb_friction: f32,
    /// Friction that holds a rotor at rest, Nm; no less than the Coulomb friction.
    pub stiction: f32,
    /// Speed at which half of the difference between both is gone, rad/s.
    pub stribeck_speed: f32,
    /// Amplitude of the cogging torque, Nm.
    pub cogging_torque: f32,
    /// Periods of the cogging torque a turn: the least common multiple of slots and poles.
    pub cogging_periods: u16,
    /// Torque of the iron's hysteresis loss, Nm.
    pub iron_hysteresis: f32,
    /// Torque of the iron's eddy current loss per speed, Nm s/rad.
    pub iron_eddy: f32,
    /// The gear behind the rotor.
    pub gear: GearConfig,
}

/// A gear.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct GearConfig {
    /// Turns of the rotor for a turn of the output; 1 without a gear.
    pub ratio: f32,
    /// Share of the power that gets through, 0 to 1.
    pub efficiency: f32,
}

impl Default for GearConfig {
    fn default() -> Self {
        GearConfig { ratio: 1.0, efficiency: 1.0 }
    }
}

impl MachineConfig {
    /// Torque at the rotor per Iq at Id = 0, Nm/A.
    pub fn torque_constant(&self) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.flux_linkage
    }

    /// Amplitude of a phase's back-EMF per speed of the rotor, V s/rad.
    pub fn back_emf_constant(&self) -> f32 {
        f32::from(self.pole_pairs) * self.flux_linkage
    }
}

/// Greatest share of the windings' time constant that a step of integration may take.
const FASTEST: f32 = 0.3;
/// Growth of copper's resistance from 25 °C, 1/K: it would be nothing at -234.5 °C.
const COPPER: f32 = 1.0 / 259.5;

/// What the windings are fed with for a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Feed {
    /// A voltage that stands still in the stator's frame, V.
    Stator(Vector),
    /// A voltage that turns with the rotor, V: d and q.
    Rotor(Vector),
}

impl Feed {
    /// The voltage in the stator's frame, where the rotor is at `frame`.
    fn voltage(self, frame: Vector) -> Vector {
        match self {
            Feed::Stator(voltage) => voltage,
            Feed::Rotor(voltage) => voltage.turned(frame),
        }
    }
}

/// Where the energy of a step went, J.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flow {
    /// Into the terminals.
    pub electrical: f32,
    /// Heat of the windings and of what is in series with them.
    pub copper: f32,
    /// Viscous and dry friction of the rotor.
    pub friction: f32,
    /// Iron losses.
    pub iron: f32,
    /// Loss of the gear.
    pub gear: f32,
    /// Into what the output drives, without what its springs and weights keep.
    pub load: f32,
}

/// A motor with what hangs on its shaft.
#[derive(Debug, Clone)]
pub struct Machine {
    config: MachineConfig,
    load: Load,
    locked: bool,
    /// Inertia of all that turns, at the rotor, kg m².
    inertia: f32,
    /// One over the inductances, 1/H.
    inverse: Vector,
    /// Phase resistance now, Ω.
    resistance: f32,
    /// Flux linkage in the stator's frame, Wb.
    flux: Vector,
    /// Current in the stator's frame, A.
    current: Vector,
    /// Where the rotor is: its electrical angle as a unit vector.
    frame: Vector,
    /// rad/s.
    speed: f32,
    /// rad/s².
    acceleration: f32,
    /// 2^32 a turn.
    position: i64,
    /// Electromagnetic torque, mean of the last step, Nm.
    torque: f32,
}

impl Machine {
    /// A machine without current, its rotor at `position` (2^32 a turn) and `speed` (rad/s).
    pub fn new(config: MachineConfig, load: LoadConfig, position: i64, speed: f32) -> Self {
        let load = Load::new(load, config.gear);
        let frame = Vector::unit(electrical(position, &config));
        Machine {
            inertia: config.inertia + load.inertia(),
            load,
            locked: false,
            inverse: Vector::new(1.0 / config.inductance_d, 1.0 / config.inductance_q),
            resistance: config.resistance,
            flux: frame * config.flux_linkage,
            current: Vector::ZERO,
            frame,
            speed,
            acceleration: 0.0,
            position,
            torque: 0.0,
            config,
        }
    }

    /// What the machine is.
    pub const fn config(&self) -> &MachineConfig {
        &self.config
    }

    /// What hangs on the output.
    pub const fn load(&self) -> &LoadConfig {
        self.load.config()
    }

    /// Hangs something else on the output.
    pub fn set_load(&mut self, load: LoadConfig) {
        self.load = Load::new(load, self.config.gear);
        self.inertia = self.config.inertia + self.load.inertia();
    }

    /// Holds the rotor where it is, or lets it go.
    pub const fn lock(&mut self, locked: bool) {
        self.locked = locked;
    }

    /// Whether the rotor is held.
    pub const fn locked(&self) -> bool {
        self.locked
    }

    /// Speed of the rotor, rad/s.
    pub const fn speed(&self) -> f32 {
        self.speed
    }

    /// Position of the rotor over all turns, [`TURN`] a turn.
    pub const fn position(&self) -> i64 {
        self.position
    }

    /// Position of the output over all turns, [`TURN`] a turn.
    pub fn output_position(&self) -> i64 {
        (self.position as f64 / f64::from(self.config.gear.ratio)) as i64
    }

    /// Electrical angle, 2^32 a turn.
    pub fn electrical_angle(&self) -> u32 {
        electrical(self.position, &self.config)
    }

    /// Current in the stator's frame, A.
    pub const fn current(&self) -> Vector {
        self.current
    }

    /// Current in the rotor's frame, A: Id and Iq.
    pub fn rotor_current(&self) -> Vector {
        self.current.seen_from(self.frame)
    }

    /// Back-EMF in the stator's frame, V.
    pub fn back_emf(&self) -> Vector {
        let amplitude = self.speed * self.config.back_emf_constant();
        Vector::new(-self.frame.y, self.frame.x) * amplitude
    }

    /// Electromagnetic torque, mean of the last step, Nm.
    pub const fn torque(&self) -> f32 {
        self.torque
    }

    /// Torque that the load puts on the output now, Nm, with the sign of positions.
    pub fn load_torque(&self) -> f32 {
        let brake = if self.speed == 0.0 { 0.0 } else { self.load().brake.copysign(self.speed) };
        self.load.at(self.position, self.speed).total() - brake
    }

    /// Phase resistance at the present temperature, Ω.
    pub const fn resistance(&self) -> f32 {
        self.resistance
    }

    /// Sets the windings' temperature, °C.
    pub fn set_temperature(&mut self, celsius: f32) {
        let growth = (1.0 + COPPER * (celsius - 25.0)).max(0.1);
        self.resistance = self.config.resistance * growth;
    }

    /// Energy in the windings' fields, J.
    pub fn magnetic_energy(&self) -> f32 {
        let Vector { x: id, y: iq } = self.rotor_current();
        0.75 * (self.config.inductance_d * id * id + self.config.inductance_q * iq * iq)
    }

    /// Energy of what turns, and of what springs, weights and the cogging torque hold, J.
    pub fn mechanical_energy(&self) -> f32 {
        let MachineConfig { cogging_torque, cogging_periods, .. } = self.config;
        let periods = f32::from(cogging_periods.max(1));
        let cogging = cogging_torque / periods * (1.0 - self.cogging_angle(self.position).1);
        0.5 * self.inertia * self.speed * self.speed + self.load.potential(self.position) + cogging
    }

    /// Stops the current, as open terminals do.
    pub(super) fn open(&mut self) {
        self.current = Vector::ZERO;
        self.flux = self.frame * self.config.flux_linkage;
        self.torque = 0.0;
    }

    /// Lets `dt` (s) pass with open terminals.
    pub(super) fn coast(&mut self, dt: f32) -> Flow {
        let mut flow = Flow::default();
        let (middle, middle_speed) = self.middle(dt);
        self.open();
        self.advance(dt, middle, middle_speed, &mut flow);
        self.open();
        flow
    }

    /// Whether nothing changes as long as no current flows.
    pub(super) fn rests(&self) -> bool {
        if self.speed != 0.0 || self.current != Vector::ZERO {
            return false;
        }
        let load = self.load.at(self.position, 0.0).total();
        let pull = self.load.referred(load) + self.cogging(self.position);
        self.locked || pull.abs() <= self.dry(0.0, load).total
    }

    /// Lets a voltage act for `dt` (s), with `resistance` (Ω) in series with each phase.
    pub fn step(&mut self, dt: f32, feed: Feed, resistance: f32) -> Flow {
        let resistance = self.resistance + resistance;
        let quickest = resistance * self.inverse.x.max(self.inverse.y) * dt;
        let mut flow = Flow::default();
        if quickest <= FASTEST {
            self.piece(dt, feed, resistance, &mut flow);
        } else {
            let pieces = libm::ceilf(quickest / FASTEST);
            for _ in 0..pieces as u32 {
                self.piece(dt / pieces, feed, resistance, &mut flow);
            }
        }
        flow
    }

    fn piece(&mut self, dt: f32, feed: Feed, resistance: f32, flow: &mut Flow) {
        let half = 0.5 * dt;
        let (middle, middle_speed) = self.middle(dt);
        let begin = self.frame;
        let between = Vector::unit(electrical(middle, &self.config));
        // As far beyond the middle as the middle is beyond the beginning.
        let end = between.turned(between.seen_from(begin));
        let (v1, v2, v3) = (feed.voltage(begin), feed.voltage(between), feed.voltage(end));

        let i1 = self.current;
        let k1 = v1 - i1 * resistance;
        let flux2 = self.flux + k1 * half;
        let i2 = self.current_of(flux2, between);
        let k2 = v2 - i2 * resistance;
        let flux3 = self.flux + k2 * half;
        let i3 = self.current_of(flux3, between);
        let k3 = v2 - i3 * resistance;
        let flux4 = self.flux + k3 * dt;
        let i4 = self.current_of(flux4, end);
        let k4 = v3 - i4 * resistance;

        let sixth = dt / 6.0;
        let power = v1.dot(i1) + 2.0 * (v2.dot(i2) + v2.dot(i3)) + v3.dot(i4);
        flow.electrical += 1.5 * sixth * power;
        let square = i1.square() + 2.0 * (i2.square() + i3.square()) + i4.square();
        flow.copper += 1.5 * resistance * sixth * square;
        let product =
            self.flux.cross(i1) + 2.0 * (flux2.cross(i2) + flux3.cross(i3)) + flux4.cross(i4);
        self.torque = 1.5 * f32::from(self.config.pole_pairs) * product * (1.0 / 6.0);
        self.flux = self.flux + (k1 + (k2 + k3) * 2.0 + k4) * sixth;

        self.advance(dt, middle, middle_speed, flow);
        self.current = self.current_of(self.flux, self.frame);
    }

    /// Position and speed in the middle of a step, by the last acceleration.
    fn middle(&self, dt: f32) -> (i64, f32) {
        let half = 0.5 * dt;
        let speed = self.speed + half * self.acceleration;
        let way = 0.5 * half * (self.speed + speed);
        (self.position.wrapping_add(digits(way)), speed)
    }

    /// Moves the rotor on.
    fn advance(&mut self, dt: f32, middle: i64, middle_speed: f32, flow: &mut Flow) {
        if self.locked {
            (self.speed, self.acceleration) = (0.0, 0.0);
        } else {
            self.turn(dt, middle, middle_speed, flow);
            self.frame = Vector::unit(self.electrical_angle());
        }
    }

    /// Current of a flux linkage, both in the stator's frame.
    fn current_of(&self, flux: Vector, frame: Vector) -> Vector {
        let rotor = flux.seen_from(frame);
        let id = (rotor.x - self.config.flux_linkage) * self.inverse.x;
        Vector::new(id, rotor.y * self.inverse.y).turned(frame)
    }

    /// Lets the torques act for `dt` (s), with those of the load as in the middle of the step.
    fn turn(&mut self, dt: f32, middle: i64, middle_speed: f32, flow: &mut Flow) {
        let MachineConfig { viscous_friction, iron_eddy, iron_hysteresis, .. } = self.config;
        let last = self.speed;
        let gain = dt / self.inertia;
        let load = self.load.at(middle, middle_speed);
        let pull = self.load.referred(load.total()) + self.cogging(middle);
        let viscous = viscous_friction + iron_eddy;
        let free = (last + gain * (self.torque + pull)) / (1.0 + gain * viscous);
        let dry = self.dry(middle_speed, load.total());
        let left = (free.abs() - gain * dry.total).max(0.0);
        self.speed = if left > 0.0 { left.copysign(free) } else { 0.0 };
        self.acceleration = (self.speed - last) / dt;
        let way = 0.5 * (last + self.speed) * dt;
        self.position = self.position.wrapping_add(digits(way));

        // Each torque times the way is the kinetic energy's change, to the last digit.
        let slowed = free * way;
        let braked = (free - self.speed) * way / gain;
        let share = if dry.total > 0.0 { braked / dry.total } else { 0.0 };
        flow.friction += viscous_friction * slowed + dry.rotor * share;
        flow.iron += iron_eddy * slowed + iron_hysteresis * share;
        flow.gear += dry.gear * share;
        flow.load += dry.brake * share - self.load.referred(load.lost) * way;
    }

    /// Torque of the cogging, Nm.
    fn cogging(&self, position: i64) -> f32 {
        if self.config.cogging_torque == 0.0 {
            return 0.0;
        }
        -self.config.cogging_torque * self.cogging_angle(position).0
    }

    /// Sine and cosine of where a position is in a period of the cogging.
    fn cogging_angle(&self, position: i64) -> (f32, f32) {
        sin_cos((position as u32).wrapping_mul(self.config.cogging_periods.into()))
    }

    /// Torques that only brake, at a speed and with a load (Nm at the output).
    fn dry(&self, speed: f32, load: f32) -> Dry {
        let MachineConfig { coulomb_friction, stiction, stribeck_speed, .. } = self.config;
        let relative = speed / stribeck_speed;
        let extra = (stiction - coulomb_friction).max(0.0) / (1.0 + relative * relative);
        let rotor = coulomb_friction + extra;
        let (brake, gear) = self.load.dry(load);
        Dry { rotor, brake, gear, total: rotor + brake + gear + self.config.iron_hysteresis }
    }
}

/// Torques against the motion whatever the speed, at the rotor, Nm.
struct Dry {
    rotor: f32,
    brake: f32,
    gear: f32,
    total: f32,
}

/// Electrical angle of a rotor's position, 2^32 a turn.
fn electrical(position: i64, config: &MachineConfig) -> u32 {
    (position as u32).wrapping_mul(config.pole_pairs.into())
}

/// Digits of a position in a small angle, rad.
fn digits(radians: f32) -> i64 {
    (radians * (TURN as f32 / core::f32::consts::TAU)) as i64
}
