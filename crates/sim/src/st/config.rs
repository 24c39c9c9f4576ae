//! What a motor and its drive are built from.

use motorlink_proto::stmcp::register::{Feature, Features};
use motorlink_proto::stmcp::{REVUP_PHASES, RevupPhase};

use super::Registers;
use crate::heat::HeatConfig;
use crate::machine::MachineConfig;

/// A motor with its drive. The default is a mains-fed motor without sensor, with everything that
/// such a build can have; [`servo`](Self::servo) is its counterpart.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct MotorConfig {
    /// What the firmware is built with.
    pub build: BuildConfig,
    /// The machine.
    pub machine: MachineConfig,
    /// How the heatsink warms up from the copper loss.
    pub heat: HeatConfig,
    /// Faults.
    pub thresholds: ThresholdConfig,
    /// Lengths of states.
    pub durations: DurationConfig,
    /// Registers at power-on.
    pub registers: Registers,
    /// The rev-up table at power-on.
    pub revup: [RevupConfig; REVUP_PHASES as usize],
    /// Greatest current, A.
    pub rated_current: f32,
    /// Current of 32767 s16A digits, A.
    pub full_scale_current: f32,
    /// Current that aligns the rotor, A.
    pub alignment_current: f32,
    /// Voltage of the bus, V; with PFC, of the bus while the PFC is off: the mains' peak.
    pub bus_voltage: f32,
    /// Braking torque of the load, Nm.
    pub load_torque: f32,
    /// Speed to go to when a motor starts before any command, rpm.
    pub target_speed_rpm: i32,
    /// How long the ramp to it takes, ms.
    pub target_duration_ms: u16,
}

impl Default for MotorConfig {
    fn default() -> Self {
        MotorConfig {
            build: BuildConfig::default(),
            machine: MachineConfig {
                pole_pairs: 4,
                torque_constant: 0.3,
                resistance: 1.5,
                inductance: 8e-3,
                inertia: 3e-4,
                viscous_friction: 2e-4,
                coulomb_friction: 0.03,
            },
            heat: HeatConfig::default(),
            thresholds: ThresholdConfig::default(),
            durations: DurationConfig::default(),
            registers: Registers::default(),
            revup: [
                RevupConfig { speed_rpm: 0, current: 2.0, duration_ms: 200 },
                RevupConfig { speed_rpm: 500, current: 2.0, duration_ms: 250 },
                RevupConfig { speed_rpm: 1000, current: 2.0, duration_ms: 250 },
                RevupConfig { speed_rpm: 1000, current: 2.0, duration_ms: 50 },
                RevupConfig { speed_rpm: 1000, current: 2.0, duration_ms: 50 },
            ],
            rated_current: 6.0,
            full_scale_current: 16.5,
            alignment_current: 2.0,
            bus_voltage: 325.0,
            load_torque: 0.0,
            target_speed_rpm: 1500,
            target_duration_ms: 1000,
        }
    }
}

impl MotorConfig {
    /// A 24 V motor with encoder, CORDIC observer and position control; without what the default
    /// has.
    pub fn servo() -> Self {
        MotorConfig {
            build: BuildConfig {
                observer_pll: false,
                observer_cordic: true,
                position_sensor: true,
                flux_weakening: false,
                feed_forward: false,
                pfc: false,
                dac: false,
                position_control: true,
            },
            machine: MachineConfig {
                pole_pairs: 2,
                torque_constant: 0.04,
                resistance: 0.64,
                inductance: 0.9e-3,
                inertia: 2e-5,
                viscous_friction: 1e-5,
                coulomb_friction: 2e-3,
            },
            heat: HeatConfig { resistance: 1.0, ..HeatConfig::default() },
            thresholds: ThresholdConfig {
                over_voltage: 32.0,
                under_voltage: 12.0,
                ..ThresholdConfig::default()
            },
            registers: Registers {
                speed_kp: 1600,
                speed_ki: 500,
                max_app_speed: 4000,
                min_app_speed: 0,
                ctrbid: 0x012,
                pwbdid: 0x02C,
                uid: 0x4D4C_0002,
                ..Registers::default()
            },
            rated_current: 4.0,
            full_scale_current: 10.0,
            alignment_current: 2.0,
            bus_voltage: 24.0,
            ..MotorConfig::default()
        }
    }

    /// What a bench without configuration has: two motors between which every feature is there once
    /// and missing once.
    pub fn demo() -> [Self; 2] {
        [Self::default(), Self::servo()]
    }

    /// Nearest s16A digits to a current in A.
    pub(super) fn digits(&self, current: f32) -> i32 {
        super::readings::s16(current, self.full_scale_current)
    }

    /// Current in A of s16A digits.
    pub(super) fn amperes(&self, digits: f32) -> f32 {
        digits * (self.full_scale_current / 32767.0)
    }

    /// The rev-up table as it travels.
    pub(super) fn revup_phases(&self) -> [RevupPhase; REVUP_PHASES as usize] {
        self.revup.map(|phase| RevupPhase {
            speed_rpm: phase.speed_rpm,
            torque_s16a: self.digits(phase.current) as i16,
            duration_ms: phase.duration_ms,
        })
    }
}

/// What the firmware is built with; registers that need something else do not exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct BuildConfig {
    /// State observer with PLL.
    pub observer_pll: bool,
    /// State observer with CORDIC.
    pub observer_cordic: bool,
    /// Encoder or Hall sensors; without, the motor revs up.
    pub position_sensor: bool,
    /// Flux weakening.
    pub flux_weakening: bool,
    /// Feed-forward.
    pub feed_forward: bool,
    /// Power factor correction.
    pub pfc: bool,
    /// DAC.
    pub dac: bool,
    /// Position control.
    pub position_control: bool,
}

impl Default for BuildConfig {
    fn default() -> Self {
        BuildConfig {
            observer_pll: true,
            observer_cordic: false,
            position_sensor: false,
            flux_weakening: true,
            feed_forward: true,
            pfc: true,
            dac: true,
            position_control: false,
        }
    }
}

impl BuildConfig {
    /// The same as the slave wants it.
    pub fn features(&self) -> Features {
        [
            (self.observer_pll, Feature::ObserverPll),
            (self.observer_cordic, Feature::ObserverCordic),
            (self.position_sensor, Feature::PositionSensor),
            (self.flux_weakening, Feature::FluxWeakening),
            (self.feed_forward, Feature::FeedForward),
            (self.pfc, Feature::Pfc),
            (self.dac, Feature::Dac),
            (self.position_control, Feature::PositionControl),
        ]
        .into_iter()
        .filter(|(built, _)| *built)
        .fold(Features::NONE, |features, (_, feature)| features.with(feature))
    }
}

/// When a fault is present.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ThresholdConfig {
    /// OVER_VOLT above this bus voltage, V.
    pub over_voltage: f32,
    /// UNDER_VOLT below this bus voltage, V.
    pub under_voltage: f32,
    /// OVER_TEMP above this heatsink temperature, °C.
    pub over_temperature: f32,
    /// How far the heatsink must cool below it for the fault to go, K.
    pub temperature_hysteresis: f32,
}

impl Default for ThresholdConfig {
    fn default() -> Self {
        ThresholdConfig {
            over_voltage: 430.0,
            under_voltage: 200.0,
            over_temperature: 100.0,
            temperature_hysteresis: 10.0,
        }
    }
}

/// How long the states last, ms. One that is not here lasts one or as long as its cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct DurationConfig {
    /// ICLWAIT after power-on; 0 for a board without inrush limiter.
    pub inrush_ms: u16,
    /// CHARGE_BOOT_CAP and ALIGN_CHARGE_BOOT_CAP.
    pub boot_capacitors_ms: u16,
    /// OFFSET_CALIB and ALIGN_OFFSET_CALIB.
    pub offset_calibration_ms: u16,
    /// ALIGNMENT.
    pub alignment_ms: u16,
    /// SWITCH_OVER.
    pub switch_over_ms: u16,
}

impl Default for DurationConfig {
    fn default() -> Self {
        DurationConfig {
            inrush_ms: 0,
            boot_capacitors_ms: 10,
            offset_calibration_ms: 16,
            alignment_ms: 700,
            switch_over_ms: 25,
        }
    }
}

/// A phase of the rev-up.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct RevupConfig {
    /// Speed at the end of the phase, rpm.
    pub speed_rpm: i32,
    /// Current at the end of the phase, A.
    pub current: f32,
    /// Length of the phase, ms.
    pub duration_ms: u16,
}
