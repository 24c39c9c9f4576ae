//! The configuration of a machine.

/// The configuration of a machine. The values of a machine depend on each other: start from a
/// [preset](crate::preset).
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
    /// Amplitude of the magnet's flux linkage in a phase at 25 °C, Wb.
    pub flux_linkage: f32,
    /// Change of the flux linkage per kelvin of the magnet, as a share, 1/K.
    pub magnet_coefficient: f32,
    /// Inertia of the rotor, kg m².
    pub inertia: f32,
    /// Friction that grows with speed, Nm s/rad.
    pub viscous_friction: f32,
    /// Friction that does not depend on speed, for a turning rotor, Nm.
    pub coulomb_friction: f32,
    /// Maximum friction of a rotor at rest, Nm; at least the Coulomb friction.
    pub stiction: f32,
    /// Speed at which half of the difference between both is lost, rad/s.
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
    /// Fraction of the power that is transmitted while the motor drives the load.
    pub efficiency: f32,
    /// Fraction that is transmitted while the load drives the motor; 0 is self-locking. Default: 2
    /// − 1/`efficiency`, at least 0; this gear loses the same torque in both directions.
    pub back_efficiency: Option<f32>,
}

impl Default for GearConfig {
    fn default() -> Self {
        GearConfig { ratio: 1.0, efficiency: 1.0, back_efficiency: None }
    }
}

impl GearConfig {
    /// Fraction of the power that is transmitted while the load drives the motor.
    pub(super) fn back_efficiency(&self) -> f32 {
        self.back_efficiency.unwrap_or((2.0 - 1.0 / self.efficiency).max(0.0))
    }
}

impl MachineConfig {
    /// Torque at the rotor per Iq at Id = 0 and 25 °C, Nm/A.
    pub fn torque_constant(&self) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.flux_linkage
    }

    /// Amplitude of a phase's back-EMF per speed of the rotor at 25 °C, V s/rad.
    pub fn back_emf_constant(&self) -> f32 {
        f32::from(self.pole_pairs) * self.flux_linkage
    }
}
