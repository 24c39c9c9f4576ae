//! The machine: torque turns a rotor against inertia, friction and a load.

use core::f32::consts::TAU;

/// One mechanical turn of [`Machine::position`].
pub const TURN: i64 = 1 << 32;

/// What a machine is. A machine's values belong together, so a file gives all of them or none.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct MachineConfig {
    /// Pairs of poles.
    pub pole_pairs: u8,
    /// Torque per Iq amplitude, Nm/A.
    pub torque_constant: f32,
    /// Phase resistance, Ω.
    pub resistance: f32,
    /// Phase inductance, H.
    pub inductance: f32,
    /// Inertia of rotor and load, kg m².
    pub inertia: f32,
    /// Friction that grows with speed, Nm s/rad.
    pub viscous_friction: f32,
    /// Friction that does not, Nm.
    pub coulomb_friction: f32,
}

impl MachineConfig {
    /// Amplitude of the back-EMF per speed, V s/rad.
    pub fn back_emf_constant(&self) -> f32 {
        self.torque_constant / 1.5
    }

    /// Copper loss of a current amplitude, W.
    pub fn copper_loss(&self, iq: f32, id: f32) -> f32 {
        1.5 * self.resistance * (iq * iq + id * id)
    }
}

/// A rigid rotor.
#[derive(Debug, Clone)]
pub struct Machine {
    config: MachineConfig,
    /// Braking torque of the load, Nm, 0 or more.
    load: f32,
    locked: bool,
    speed: f32,
    position: i64,
}

impl Machine {
    /// A machine at rest at `position`, of which [`TURN`] is a turn.
    pub const fn new(config: MachineConfig, position: i64) -> Self {
        Machine { config, load: 0.0, locked: false, speed: 0.0, position }
    }

    /// What the machine is.
    pub const fn config(&self) -> &MachineConfig {
        &self.config
    }

    /// Speed, rad/s.
    pub const fn speed(&self) -> f32 {
        self.speed
    }

    /// Position over all turns, [`TURN`] a turn: exact however far it turns.
    pub const fn position(&self) -> i64 {
        self.position
    }

    /// Electrical angle, 2^16 a turn.
    pub fn electrical_angle(&self) -> u16 {
        (self.position.wrapping_mul(i64::from(self.config.pole_pairs)) >> 16) as u16
    }

    /// Amplitude of the back-EMF, V; negative when the rotor turns backwards.
    pub fn back_emf(&self) -> f32 {
        self.config.back_emf_constant() * self.speed
    }

    /// The load's torque, Nm. It works as a brake does: against either direction, and it does not
    /// turn a rotor at rest.
    pub const fn set_load(&mut self, torque: f32) {
        self.load = torque.abs();
    }

    /// The load's torque, Nm.
    pub const fn load(&self) -> f32 {
        self.load
    }

    /// Holds the rotor where it is, or lets it go.
    pub const fn set_locked(&mut self, locked: bool) {
        self.locked = locked;
    }

    /// Whether the rotor is held.
    pub const fn locked(&self) -> bool {
        self.locked
    }

    /// Lets `torque` (Nm) act for `dt` (s).
    pub fn step(&mut self, dt: f32, torque: f32) {
        let MachineConfig { inertia, viscous_friction, coulomb_friction, .. } = self.config;
        let gain = dt / inertia;
        let free = (self.speed + gain * torque) / (1.0 + gain * viscous_friction);
        // Dry friction and brake take away speed, never more than there is.
        let left = (free.abs() - gain * (coulomb_friction + self.load)).max(0.0);
        self.speed = if self.locked { 0.0 } else { left.copysign(free) };
        let turned = self.speed * dt * (TURN as f32 / TAU);
        self.position = self.position.wrapping_add(turned as i64);
    }
}

/// Radians of a span of positions.
pub(crate) fn radians(span: i64) -> f32 {
    span as f32 * (TAU / TURN as f32)
}

/// The nearest position to an angle in rad; saturates.
pub(crate) fn position(radians: f32) -> i64 {
    (f64::from(radians) * (TURN as f64 / core::f64::consts::TAU)) as i64
}

/// `value` held between two others; unlike `clamp` it takes any, also from an odd configuration.
pub(crate) fn within(value: f32, least: f32, most: f32) -> f32 {
    value.max(least).min(most)
}
