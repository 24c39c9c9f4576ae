//! Tests of the plant against physics.

mod electrical;
mod energy;
mod gear;
mod mechanics;
mod presets;
mod surroundings;

use motorlink_sim::plant::{
    EncoderConfig, GearConfig, HeatConfig, InverterConfig, LoadConfig, MachineConfig, PlantConfig,
    SensingConfig, SupplyConfig,
};

/// A motor without friction, cogging and iron losses, on an ideal supply.
pub fn plain() -> PlantConfig {
    PlantConfig {
        period_us: 50,
        seed: 1,
        angle_degrees: 0.0,
        machine: MachineConfig {
            pole_pairs: 4,
            resistance: 0.5,
            inductance_d: 1e-3,
            inductance_q: 1.5e-3,
            flux_linkage: 0.01,
            magnet_coefficient: 0.0,
            inertia: 1e-4,
            viscous_friction: 0.0,
            coulomb_friction: 0.0,
            stiction: 0.0,
            stribeck_speed: 1.0,
            cogging_torque: 0.0,
            cogging_periods: 24,
            iron_hysteresis: 0.0,
            iron_eddy: 0.0,
            gear: GearConfig::default(),
        },
        load: LoadConfig::default(),
        heat: HeatConfig::default(),
        supply: SupplyConfig { resistance: 0.01, takes_back: true, ..SupplyConfig::default() },
        inverter: InverterConfig {
            dead_time_us: 0.0,
            on_resistance: 0.0,
            ripple_current: 0.1,
            switching_time_ns: 0.0,
        },
        sensing: SensingConfig::default(),
        encoder: EncoderConfig::default(),
    }
}
