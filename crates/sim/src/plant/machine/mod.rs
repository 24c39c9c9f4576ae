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
//! R grows with the windings' temperature, by 1/259.5 of its value at 25 °C per kelvin, as copper's does;
//! ψm falls with the magnet's.
//!
//! In the rotor's frame Ld id and Lq iq turn back with the electrical speed ω and die away with R/L.
//! What the axes have in common of that, a = R (1/Ld + 1/Lq) / 2, and voltage and back-EMF are solved
//! exactly for half a step of constant speed, as complex numbers:
//!
//! ```text
//! f(h/2) = E f + (1 − E) / (a + jω) (v − jω ψm),   E = exp(−(a + jω) h/2)
//! ```
//!
//! A voltage that stands still in the stator's frame adds (1 − exp(−a h/2)) / a of itself, as the
//! rotor sees it at the end. What the axes differ in, ±R (1/Ld − 1/Lq) / 2, acts in between for h/6,
//! 4h/6 and h/6 (split symmetrically, Strang, *On the construction and comparison of difference
//! schemes*, SIAM J. Numer. Anal. 5, 1968) and is nothing in a motor without saliency. The torque is
//! Simpson's mean of begin, middle and end.
//!
//! Shaft, at the rotor, with gear ratio N and n periods of cogging a turn:
//!
//! ```text
//! J dω/dt   = T − Tcog sin(n θ) − (B + Beddy) ω − dry(ω) sign ω − k τ
//! dry       = Tc + (Ts − Tc) / (1 + (ω/ωs)²) + hysteresis
//! τ         = (J_load dω/dt / N + T_load + brake sign ω) / N
//! k         = 1/η where τ ω > 0,   η' where τ ω < 0
//! ```
//!
//! τ is what the gear has to transmit, the acceleration of the load included. Power that goes
//! forwards arrives with the efficiency η, power that the load drives back with η' (see for example
//! G. Niemann and H. Winter, *Maschinenelemente*, volume 2). A gear that loses the same torque both
//! ways has η' = 2 − 1/η.
//!
//! Viscous friction is implicit, also the load's; dry friction takes away speed but never more than there is, so a
//! rotor stays where what pulls it is less (stiction with the Stribeck effect, see B. Armstrong,
//! *A survey of models, analysis tools and compensation methods for the control of machines with
//! friction*, Automatica 30, 1994). Torques that depend on the position are taken in the middle of
//! the step. Iron losses are torques against the motion: hysteresis does not depend on speed, eddy
//! currents are in proportion to it.

mod config;
mod decay;
mod shaft;
mod step;

pub use config::{GearConfig, MachineConfig};

use super::load::{Load, LoadConfig};
use crate::angle::{self, sin_cos};
use crate::control::within;
use crate::vector::Vector;
use decay::Decay;
use shaft::Shaft;

/// Growth of copper's resistance from 25 °C, 1/K: it would be nothing at -234.5 °C.
const COPPER: f32 = 1.0 / 259.5;

/// Upper limit of the resistance's growth: copper boils at 2560 °C.
const VAPOUR: f32 = 10.0;

/// Lower limit of a magnet's remaining flux.
const LEAST_MAGNET: f32 = 0.1;
const MOST_MAGNET: f32 = 2.0;

/// The voltage at the windings in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Feed {
    /// A voltage that is constant in the stator's frame, V.
    Stator(Vector),
    /// A voltage that is constant in the rotor's frame, V: d and q.
    Rotor(Vector),
}

/// The energies of a step, J.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flow {
    /// Into the terminals.
    pub electrical: f32,
    /// Heat of the windings and of the resistance in series with them.
    pub copper: f32,
    /// Viscous and dry friction of the rotor.
    pub friction: f32,
    /// Iron losses.
    pub iron: f32,
    /// Loss of the gear.
    pub gear: f32,
    /// Into the load, without the energy stored in springs and weights.
    pub load: f32,
}

/// A motor with its load, integrated with a fixed step.
#[derive(Debug, Clone)]
pub struct Machine {
    config: MachineConfig,
    load: Load,
    locked: bool,
    /// Whether it is known to rest, as nothing has changed since.
    resting: bool,
    /// Length of a step, s.
    period: f32,
    /// Phase resistance now, Ω, and the resistance in series with it.
    resistance: f32,
    series: f32,
    /// Flux linkage of the magnet now, Wb.
    magnet: f32,
    decay: Decay,
    shaft: Shaft,
    /// Pairs of poles.
    poles: f32,
    /// Stiction beyond the Coulomb friction, Nm.
    extra_stiction: f32,
    /// One over the speed of the Stribeck effect, s/rad.
    inverse_stribeck: f32,
    /// One over the inductances, 1/H.
    inverse: Vector,
    /// Ld id and Lq iq, Wb.
    flux: Vector,
    /// Current in the stator's frame, A.
    current: Vector,
    /// Position of the rotor: its electrical angle as a unit vector. It is rotated step by step,
    /// and computed from the position every [`EXACT`] steps.
    frame: Vector,
    count: u8,
    /// Speed, rad/s.
    speed: f32,
    /// Change of the speed in the last step, rad/s, and its rounding error.
    change: f32,
    rest: f32,
    /// Position, 2^32 a turn.
    position: i64,
    /// Electromagnetic torque, mean of the last step, Nm.
    torque: f32,
    /// Voltage at the windings in the rotor's frame, mean of the last step, V.
    voltage: Vector,
}

impl Machine {
    /// A machine at rest and without current, with its rotor at 0, for steps of `period` (s).
    pub fn new(config: MachineConfig, load: LoadConfig, period: f32) -> Self {
        let load = Load::new(load, config.gear);
        let inverse = Vector::new(1.0 / config.inductance_d, 1.0 / config.inductance_q);
        Machine {
            shaft: Shaft::new(&config, &load, period),
            decay: Decay::new(period, config.resistance, inverse),
            load,
            locked: false,
            resting: false,
            poles: f32::from(config.pole_pairs),
            period,
            resistance: config.resistance,
            series: 0.0,
            magnet: config.flux_linkage,
            extra_stiction: (config.stiction - config.coulomb_friction).max(0.0),
            inverse_stribeck: 1.0 / config.stribeck_speed,
            inverse,
            flux: Vector::ZERO,
            current: Vector::ZERO,
            frame: Vector::unit(0),
            count: 0,
            speed: 0.0,
            change: 0.0,
            rest: 0.0,
            position: 0,
            torque: 0.0,
            voltage: Vector::ZERO,
            config,
        }
    }

    /// Sets the rotor's position (2^32 a turn) and speed (rad/s).
    pub fn place(&mut self, position: i64, speed: f32) {
        (self.position, self.speed) = (position, speed);
        self.resting = false;
        (self.change, self.rest) = (0.0, 0.0);
        self.frame = Vector::unit(self.electrical_angle());
    }

    /// Sets a resistance (Ω) in series with each phase.
    pub fn set_series(&mut self, resistance: f32) {
        self.series = resistance;
        self.decay = Decay::new(self.period, self.resistance + self.series, self.inverse);
    }

    /// The configuration.
    pub const fn config(&self) -> &MachineConfig {
        &self.config
    }

    /// The load.
    pub const fn load(&self) -> &LoadConfig {
        self.load.config()
    }

    /// Replaces the load.
    pub fn set_load(&mut self, load: LoadConfig) {
        self.resting = false;
        self.load = Load::new(load, self.config.gear);
        self.shaft = Shaft::new(&self.config, &self.load, self.period);
    }

    /// Locks or releases the rotor.
    pub const fn lock(&mut self, locked: bool) {
        (self.locked, self.resting) = (locked, false);
    }

    /// Whether the rotor is locked.
    pub const fn locked(&self) -> bool {
        self.locked
    }

    /// Speed of the rotor, rad/s.
    pub const fn speed(&self) -> f32 {
        self.speed
    }

    /// Position of the rotor over all turns, [`TURN`](crate::angle::TURN) a turn.
    pub const fn position(&self) -> i64 {
        self.position
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
        self.flux.scaled(self.inverse)
    }

    /// Back-EMF in the stator's frame, V.
    pub fn back_emf(&self) -> Vector {
        Vector::new(-self.frame.y, self.frame.x) * self.back_emf_amplitude()
    }

    /// Amplitude of the back-EMF, negative backwards, V.
    pub(super) fn back_emf_amplitude(&self) -> f32 {
        self.poles * self.speed * self.magnet
    }

    /// Voltage at the windings in the rotor's frame, mean of the last step, V: Vd and Vq, without
    /// the voltage of the resistance in series.
    pub const fn voltage(&self) -> Vector {
        self.voltage
    }

    /// A vector of the stator's frame in the rotor's frame in the middle of the last step.
    pub fn seen_in_last_step(&self, vector: Vector) -> Vector {
        let way = 0.5 * self.period * (self.speed - 0.5 * self.change);
        let middle = self.position.wrapping_sub(angle::position(way));
        vector.seen_from(Vector::unit(electrical(middle, &self.config)))
    }

    /// Electromagnetic torque, mean of the last step, Nm.
    pub const fn torque(&self) -> f32 {
        self.torque
    }

    /// Torque of the load against growing angles of the output now, Nm.
    pub fn load_torque(&self) -> f32 {
        let brake = if self.speed == 0.0 { 0.0 } else { self.load().brake.copysign(self.speed) };
        self.load.at(self.position, self.speed).total() + brake
    }

    /// Phase resistance at the present temperature, Ω.
    pub const fn resistance(&self) -> f32 {
        self.resistance
    }

    /// Flux linkage of the magnet at the present temperature, Wb.
    pub const fn flux_linkage(&self) -> f32 {
        self.magnet
    }

    /// Sets the temperatures of windings and magnet, °C.
    pub fn set_temperatures(&mut self, windings: f32, magnet: f32) {
        /// Smallest change of the resistance for which the exponential is computed again.
        const SAME: f32 = 1e-5;
        let left = 1.0 + self.config.magnet_coefficient * (magnet - 25.0);
        self.magnet = self.config.flux_linkage * within(left, LEAST_MAGNET, MOST_MAGNET);
        let growth = within(1.0 + COPPER * (windings - 25.0), 0.1, VAPOUR);
        let resistance = self.config.resistance * growth;
        if (resistance - self.resistance).abs() > SAME * resistance {
            self.resistance = resistance;
            self.set_series(self.series);
        }
    }

    /// Energy in the windings' fields, J.
    pub fn magnetic_energy(&self) -> f32 {
        let Vector { x: id, y: iq } = self.rotor_current();
        0.75 * (self.config.inductance_d * id * id + self.config.inductance_q * iq * iq)
    }

    /// Kinetic energy, and the energy of springs, weights and the cogging torque, J.
    pub fn mechanical_energy(&self) -> f32 {
        let MachineConfig { cogging_torque, cogging_periods, .. } = self.config;
        let periods = f32::from(cogging_periods.max(1));
        let cogging =
            cogging_torque / periods * (1.0 - sin_cos(self.cogging_angle(self.position)).1);
        0.5 * self.shaft.inertia * self.speed * self.speed
            + self.load.potential(self.position)
            + cogging
    }

    /// Phase of the cogging at a position, 2^32 a period.
    fn cogging_angle(&self, position: i64) -> u32 {
        (position as u32).wrapping_mul(self.config.cogging_periods.into())
    }

    /// Sets the current to 0, as with open terminals.
    pub(super) fn open(&mut self) {
        (self.flux, self.current, self.torque) = (Vector::ZERO, Vector::ZERO, 0.0);
    }
}

/// Electrical angle of a rotor's position, 2^32 a turn.
const fn electrical(position: i64, config: &MachineConfig) -> u32 {
    (position as u32).wrapping_mul(config.pole_pairs as u32)
}
