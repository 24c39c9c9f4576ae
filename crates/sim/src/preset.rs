//! Real motors, with the sources of their values.
//!
//! The source of a value: P is published by the maker, M was measured by others, D is derived from
//! one of these, E is an estimate. Resistance and inductance are those of a phase, half of the
//! value between two terminals. Flux linkage is the amplitude in a phase.
//!
//! All `phase_to_phase` are E. In the worst case a phase of a stalled motor is 1.5 times as far
//! above the housing as the winding's mean. This agrees with makers who allow 80 % of the current
//! at standstill.

use crate::plant::{
    ChopperConfig, EncoderConfig, GearConfig, HeatConfig, HeatSensor, InverterConfig, LoadConfig,
    MachineConfig, PlantConfig, SensingConfig, SupplyConfig,
};

/// Temperature coefficient of the remanence of NdFeB magnets, 1/K. Makers state -0.11 to -0.12 %
/// for the usual grades.
const NEODYMIUM: f32 = -0.0011;

/// A preset: its name in files, and its configuration.
pub type Preset = (&'static str, fn() -> PlantConfig);

/// Every preset: those of [ST drives](crate::st::MotorConfig::PRESETS), then RMD motors.
pub const ALL: [Preset; 6] = [
    ("drone", drone),
    ("shinano", shinano),
    ("servo", servo),
    ("mains", mains),
    ("rmd-l-5005", rmd_l_5005),
    ("rmd-x8", rmd_x8),
];

/// The preset with this name.
pub fn named(name: &str) -> Option<PlantConfig> {
    ALL.iter().find(|(known, _)| *known == name).map(|(_, config)| config())
}

/// A small drone motor: Bull Running BR2804-1700kV, as in P-NUCLEO-IHM001, at 11.1 V.
///
/// | value | | from |
/// |---|---|---|
/// | pole pairs 7, R 0.11 Ω, L 18 µH | M | Apache NuttX, documentation of its FOC example, table of motors |
/// | ψ 0.463 mWb | D | 1700 rpm/V between terminals: 9.549 / (1700 √3 p) |
/// | 11.1 V, 5 A, 12540 rpm | P | ST, page of P-NUCLEO-IHM001 |
/// | inertia 2e-6 kg m², friction, cogging, iron, heat | E | a bell of 10 g at 14 mm; about 0.5 A without load; 25 g |
pub fn drone() -> PlantConfig {
    PlantConfig {
        period_us: 50,
        seed: 1,
        angle_degrees: 0.0,
        machine: MachineConfig {
            pole_pairs: 7,
            resistance: 0.11,
            inductance_d: 18e-6,
            inductance_q: 18e-6,
            flux_linkage: 0.463e-3,
            magnet_coefficient: NEODYMIUM,
            inertia: 2e-6,
            viscous_friction: 4e-7,
            coulomb_friction: 1.0e-3,
            stiction: 1.4e-3,
            stribeck_speed: 5.0,
            cogging_torque: 5e-4,
            cogging_periods: 84,
            iron_hysteresis: 3e-4,
            iron_eddy: 3e-7,
            gear: GearConfig::default(),
        },
        load: LoadConfig::default(),
        heat: HeatConfig {
            winding_capacity: 3.0,
            housing_capacity: 8.0,
            winding_to_housing: 2.0,
            housing_to_air: 10.0,
            phase_to_phase: 18.0,
            ..HeatConfig::default()
        },
        supply: SupplyConfig { voltage: 11.1, takes_back: true, ..SupplyConfig::default() },
        inverter: InverterConfig {
            dead_time_us: 0.3,
            ripple_current: 0.5,
            on_resistance: 0.01,
            switching_time_ns: 40.0,
        },
        sensing: SensingConfig { full_scale: 20.0, noise: 0.01, ..SensingConfig::default() },
        encoder: EncoderConfig::default(),
    }
}

/// The 24 V motor of ST's kits, Shinano LA052-080E3NL1. There is no complete public data sheet.
///
/// | value | | from |
/// |---|---|---|
/// | pole pairs 2, R 0.32 Ω, ψ 16.06 mWb | M | github.com/mfilippa/STM32_Rev0_old, matlab/parameters.m ("shinano", model not named) |
/// | encoder of 400 lines | P | ST, training slides of MC SDK 5.4 (names the model); here the nearest width, 12 bits |
/// | L 1.1 mH | E | its sibling LA052-040E has 2.2 mH and twice the turns |
/// | inertia 1.5e-5 kg m², friction, cogging, iron | E | a steel rotor of 26 mm by 50 mm; about 0.1 A without load |
/// | 24 V, 80 W, 3000 rpm, 0.25 Nm, 5.3 A | E | "080" read as 80 W |
/// | heat | E | a flange of 52 mm, about 0.6 kg |
pub fn shinano() -> PlantConfig {
    PlantConfig {
        machine: MachineConfig {
            pole_pairs: 2,
            resistance: 0.32,
            inductance_d: 1.1e-3,
            inductance_q: 1.1e-3,
            flux_linkage: 16.06e-3,
            magnet_coefficient: NEODYMIUM,
            inertia: 1.5e-5,
            viscous_friction: 5e-6,
            coulomb_friction: 3e-3,
            stiction: 5e-3,
            stribeck_speed: 3.0,
            cogging_torque: 2e-3,
            cogging_periods: 12,
            iron_hysteresis: 1.5e-3,
            iron_eddy: 5e-6,
            gear: GearConfig::default(),
        },
        heat: HeatConfig {
            winding_capacity: 60.0,
            housing_capacity: 250.0,
            winding_to_housing: 0.8,
            housing_to_air: 1.7,
            phase_to_phase: 7.2,
            ..HeatConfig::default()
        },
        supply: SupplyConfig::default(),
        inverter: InverterConfig::default(),
        sensing: SensingConfig { full_scale: 16.5, noise: 0.005, ..SensingConfig::default() },
        encoder: EncoderConfig { bits: 12, ..EncoderConfig::default() },
        ..drone()
    }
}

/// The [24 V motor](shinano) with a brake chopper, for the drive `servo`.
pub fn servo() -> PlantConfig {
    let chopper = ChopperConfig { resistance: 5.0, on_voltage: 30.0, off_voltage: 29.0 };
    let supply = SupplyConfig { chopper: Some(chopper), ..SupplyConfig::default() };
    PlantConfig { supply, ..shinano() }
}

/// A servo motor for the rectified mains: WITTENSTEIN premo SP, stator 2D, 320 V.
///
/// | value | | from |
/// |---|---|---|
/// | pole pairs 4, R 1.86 Ω, L 3.715 mH, inertia 0.83e-4 kg m² | P | manual 4022-D045530, table 16 (7.43 mH and 3.72 Ω between terminals) |
/// | ψ 61.6 mWb | D | 31.6 V rms between terminals at 1000 rpm; gives the manual's 0.52 Nm/A rms |
/// | 2.11 Nm at 4.04 A rms, 5.53 Nm at 12 A rms | P | the same |
/// | 0.81 K/W, 1289 J/K | P, D | the same: thermal resistance, and with it its time constant of 17.4 min; shared out between winding and housing by us |
/// | friction, cogging, iron | E | 1.5 % of the torque at standstill |
pub fn mains() -> PlantConfig {
    PlantConfig {
        machine: MachineConfig {
            pole_pairs: 4,
            resistance: 1.86,
            inductance_d: 3.715e-3,
            inductance_q: 3.715e-3,
            flux_linkage: 61.6e-3,
            magnet_coefficient: NEODYMIUM,
            inertia: 0.83e-4,
            viscous_friction: 2e-5,
            coulomb_friction: 0.02,
            stiction: 0.03,
            stribeck_speed: 3.0,
            cogging_torque: 0.01,
            cogging_periods: 24,
            iron_hysteresis: 0.01,
            iron_eddy: 2e-5,
            gear: GearConfig::default(),
        },
        heat: HeatConfig {
            winding_capacity: 189.0,
            housing_capacity: 1100.0,
            winding_to_housing: 0.31,
            housing_to_air: 0.5,
            phase_to_phase: 2.8,
            ..HeatConfig::default()
        },
        supply: SupplyConfig {
            voltage: 325.0,
            resistance: 0.5,
            capacitance: 680e-6,
            chopper: Some(ChopperConfig {
                resistance: 100.0,
                on_voltage: 415.0,
                off_voltage: 410.0,
            }),
            ..SupplyConfig::default()
        },
        inverter: InverterConfig {
            dead_time_us: 1.0,
            ripple_current: 0.3,
            on_resistance: 0.1,
            switching_time_ns: 200.0,
        },
        sensing: SensingConfig { full_scale: 20.0, noise: 0.01, ..SensingConfig::default() },
        encoder: EncoderConfig::default(),
        ..shinano()
    }
}

/// A direct drive like MyActuator's RMD-L-5005 (35 turns).
///
/// | value | | from |
/// |---|---|---|
/// | pole pairs 14, R 1.0 Ω, L 0.325 mH, inertia 1.36e-5 kg m² | P | L series manual 251029, page 6 (2.0 Ω and 0.65 mH between terminals), read in a transcription |
/// | ψ 4.0 mWb | D | between 0.08 Nm/A (3.81) and 1970 rpm at 24 V without load (4.8) |
/// | 24 V, 0.13 Nm at 1.67 A, 0.42 Nm at 5 A, encoder of 14 bits, 92 g | P | the same |
/// | friction 4 mNm, cogging, iron | E | 3 % of the rated torque |
/// | heat | E | 60 K at 1.67 A; the surface of 49 mm by 24 mm in still air |
pub fn rmd_l_5005() -> PlantConfig {
    PlantConfig {
        machine: MachineConfig {
            pole_pairs: 14,
            resistance: 1.0,
            inductance_d: 0.325e-3,
            inductance_q: 0.325e-3,
            flux_linkage: 4.0e-3,
            magnet_coefficient: NEODYMIUM,
            inertia: 1.36e-5,
            viscous_friction: 1e-5,
            coulomb_friction: 2.5e-3,
            stiction: 4e-3,
            stribeck_speed: 1.0,
            cogging_torque: 1e-3,
            cogging_periods: 84,
            iron_hysteresis: 1e-3,
            iron_eddy: 5e-6,
            gear: GearConfig::default(),
        },
        heat: HeatConfig {
            winding_capacity: 6.0,
            housing_capacity: 40.0,
            winding_to_housing: 3.0,
            housing_to_air: 8.0,
            phase_to_phase: 27.0,
            sensor: HeatSensor::Winding,
            ..HeatConfig::default()
        },
        supply: SupplyConfig::default(),
        inverter: InverterConfig::default(),
        sensing: SensingConfig { full_scale: 40.0, noise: 0.01, ..SensingConfig::default() },
        encoder: EncoderConfig::default(),
        ..shinano()
    }
}

/// A geared actuator like MyActuator's RMD-X8 V2, 9:1, at 48 V.
///
/// | value | | from |
/// |---|---|---|
/// | pole pairs 21, R 0.2 Ω, L 0.11 mH, 568 g | P | catalogue 240220, read in a transcription ("wire resistance" 0.4 Ω and 0.22 mH taken as between terminals) |
/// | 9:1, inertia of the rotor 2.6e-4 kg m², 40 rpm/V, 2.09 Nm/A at the output | P | docs.ros.org, package myactuator_rmd, class X8V2 |
/// | ψ 6.8 mWb | D | between Kv (6.5) and torque constant (7.4) |
/// | 9 Nm, 170 rpm, 4.3 A; back-drive torque 0.31 Nm at the output | P | as the first; here Coulomb friction |
/// | gear 0.92 | E | one planetary stage |
/// | heat 2.1 K/W | D | 60 K at rated load (footnote of the catalogue), 320 J/K estimated |
pub fn rmd_x8() -> PlantConfig {
    PlantConfig {
        machine: MachineConfig {
            pole_pairs: 21,
            resistance: 0.2,
            inductance_d: 0.11e-3,
            inductance_q: 0.11e-3,
            flux_linkage: 6.8e-3,
            magnet_coefficient: NEODYMIUM,
            inertia: 2.6e-4,
            viscous_friction: 5e-5,
            coulomb_friction: 0.025,
            stiction: 0.035,
            stribeck_speed: 1.0,
            cogging_torque: 5e-3,
            cogging_periods: 126,
            iron_hysteresis: 0.01,
            iron_eddy: 5e-5,
            gear: GearConfig { ratio: 9.0, efficiency: 0.92, back_efficiency: None },
        },
        heat: HeatConfig {
            winding_capacity: 60.0,
            housing_capacity: 260.0,
            winding_to_housing: 0.6,
            housing_to_air: 1.5,
            phase_to_phase: 5.4,
            sensor: HeatSensor::Winding,
            ..HeatConfig::default()
        },
        supply: SupplyConfig { voltage: 48.0, ..SupplyConfig::default() },
        ..rmd_l_5005()
    }
}
