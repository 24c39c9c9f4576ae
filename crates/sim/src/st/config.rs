//! The configuration of a motor and its drive.

use motorlink_proto::st::register::{Feature, Features};
use motorlink_proto::st::{REVUP_PHASES, RevupPhase};

use super::Registers;
use super::scale::{Scale, s16};
use crate::plant::{OutOfRange, PlantConfig, range};
use crate::preset;

/// A motor with its drive. The default is a mains-fed motor without position sensor, with all
/// features of such a build. [`servo`](Self::servo) has the others.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct MotorConfig {
    /// The motor and its environment. The firmware knows these values, as from the design. The
    /// nominal bus voltage is that of its source; with PFC it is the mains' peak.
    pub plant: PlantConfig,
    /// The firmware's build options.
    pub build: BuildConfig,
    /// Faults.
    pub thresholds: ThresholdConfig,
    /// Durations of states.
    pub durations: DurationConfig,
    /// Registers at power-on.
    pub registers: Registers,
    /// The rev-up table at power-on.
    pub revup: [RevupConfig; REVUP_PHASES as usize],
    /// Maximum current of the motor, amplitude, A.
    pub rated_current: f32,
    /// Maximum current of the PFC from the mains, effective, A.
    pub pfc_current: f32,
    /// Current that aligns the rotor, A.
    pub alignment_current: f32,
    /// Power of the board from the bus, W.
    pub standby_power: f32,
    /// Target speed of a start before any command, rpm.
    pub target_speed_rpm: i32,
    /// Duration of the ramp to it, ms.
    pub target_duration_ms: u16,
}

impl Default for MotorConfig {
    fn default() -> Self {
        MotorConfig::mains()
    }
}

/// A drive: its name in files, and its configuration.
pub type MotorPreset = (&'static str, fn() -> MotorConfig);

impl MotorConfig {
    /// All named drives. The first one is the default.
    pub const PRESETS: [MotorPreset; 4] = [
        ("mains", MotorConfig::mains),
        ("servo", MotorConfig::servo),
        ("shinano", MotorConfig::shinano),
        ("drone", MotorConfig::drone),
    ];

    /// A 325 V [servo motor](preset::mains) without position sensor; observer with PLL, flux
    /// weakening, feed-forward, PFC, DAC, and a brake chopper.
    pub fn mains() -> Self {
        let plant = preset::mains();
        MotorConfig {
            build: BuildConfig::default(),
            thresholds: ThresholdConfig::default(),
            durations: DurationConfig::default(),
            registers: Registers::default(),
            revup: revup(2.0, 1000, 200),
            rated_current: 5.7,
            pfc_current: 10.0,
            alignment_current: 2.0,
            standby_power: 5.0,
            target_speed_rpm: 1500,
            target_duration_ms: 1000,
            plant,
        }
    }

    /// The 24 V [motor of ST's kits](preset::shinano) without position sensor; observer with PLL,
    /// flux weakening, feed-forward and DAC.
    pub fn shinano() -> Self {
        let plant = preset::shinano();
        MotorConfig {
            build: BuildConfig { pfc: false, ..BuildConfig::default() },
            thresholds: ThresholdConfig {
                over_voltage: 32.0,
                under_voltage: 12.0,
                over_current: 14.0,
                ..ThresholdConfig::default()
            },
            registers: Registers {
                max_app_speed: 4000,
                min_app_speed: 400,
                ctrbid: 0x012,
                pwbdid: 0x02C,
                uid: 0x4D4C_0003,
                ..Registers::tuned(&plant)
            },
            revup: revup(3.0, 1000, 300),
            rated_current: 5.3,
            alignment_current: 3.0,
            standby_power: 1.0,
            plant,
            ..MotorConfig::mains()
        }
    }

    /// The motor of [`shinano`](Self::shinano) with an encoder, CORDIC observer, position control
    /// and a brake chopper, without the other features of the default.
    pub fn servo() -> Self {
        let shinano = MotorConfig::shinano();
        MotorConfig {
            plant: preset::servo(),
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
            registers: Registers { min_app_speed: 0, uid: 0x4D4C_0002, ..shinano.registers },
            ..shinano
        }
    }

    /// A [drone motor](preset::drone) without sensor and propeller; observer with PLL, flux
    /// weakening, feed-forward and DAC.
    pub fn drone() -> Self {
        let plant = preset::drone();
        MotorConfig {
            thresholds: ThresholdConfig {
                over_voltage: 16.0,
                under_voltage: 7.0,
                over_current: 18.0,
                ..ThresholdConfig::default()
            },
            registers: Registers {
                max_app_speed: 15_000,
                min_app_speed: 1500,
                uid: 0x4D4C_0004,
                ..Registers::tuned(&plant)
            },
            revup: revup(4.0, 3000, 300),
            rated_current: 10.0,
            alignment_current: 4.0,
            target_speed_rpm: 6000,
            plant,
            ..MotorConfig::shinano()
        }
    }

    /// The default bench: two motors. Each feature is present in one and missing in the other.
    pub fn demo() -> [Self; 2] {
        [Self::mains(), Self::servo()]
    }

    /// Refuses a configuration that cannot be simulated.
    pub fn check(&self) -> Result<(), OutOfRange> {
        const ANY: f32 = 1e6;
        self.plant.check()?;
        let limits = &self.thresholds;
        range::check([
            ("rated_current", self.rated_current, 1e-3, 1e3),
            ("pfc_current", self.pfc_current, 0.0, 1e3),
            ("alignment_current", self.alignment_current, 0.0, 1e3),
            ("standby_power", self.standby_power, 0.0, 1e3),
            ("thresholds.over_voltage", limits.over_voltage, -ANY, ANY),
            ("thresholds.under_voltage", limits.under_voltage, -ANY, ANY),
            ("thresholds.over_temperature", limits.over_temperature, -ANY, ANY),
            ("thresholds.temperature_hysteresis", limits.temperature_hysteresis, 0.0, ANY),
            ("thresholds.over_current", limits.over_current, 0.0, ANY),
            ("registers.fluxwk_bus (in 0.1 %)", self.registers.fluxwk_bus as f32, 0.0, 1000.0),
        ])?;
        range::check(self.revup.iter().map(|phase| ("revup.current", phase.current, -1e3, 1e3)))
    }

    /// The rev-up table in wire units.
    pub(super) fn revup_phases(&self, scale: &Scale) -> [RevupPhase; REVUP_PHASES as usize] {
        self.revup.map(|phase| RevupPhase {
            speed_rpm: phase.speed_rpm,
            torque_s16a: s16(phase.current * scale.ampere) as i16,
            duration_ms: phase.duration_ms,
        })
    }
}

/// A rev-up that aligns the rotor in `phase_ms`, accelerates to `speed_rpm` in twice that time, and
/// stays at this speed for 100 ms.
const fn revup(current: f32, speed_rpm: i32, phase_ms: u16) -> [RevupConfig; 5] {
    const fn phase(speed_rpm: i32, current: f32, duration_ms: u16) -> RevupConfig {
        RevupConfig { speed_rpm, current, duration_ms }
    }
    [
        phase(0, current, phase_ms),
        phase(speed_rpm / 2, current, phase_ms),
        phase(speed_rpm, current, phase_ms),
        phase(speed_rpm, current, 50),
        phase(speed_rpm, current, 50),
    ]
}

/// The firmware's build options. Registers of missing features do not exist.
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
    /// Encoder or Hall sensors. Without them the motor revs up.
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
    /// The same as a set for the slave.
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

/// Thresholds of faults.
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
    /// Hysteresis: the fault ends when the heatsink is this much below the threshold, K.
    pub temperature_hysteresis: f32,
    /// BREAK_IN when a phase's current exceeds this, A: a comparator switches the bridge off.
    pub over_current: f32,
}

impl Default for ThresholdConfig {
    fn default() -> Self {
        ThresholdConfig {
            over_voltage: 430.0,
            under_voltage: 200.0,
            over_temperature: 100.0,
            temperature_hysteresis: 10.0,
            over_current: 15.0,
        }
    }
}

/// Durations of states, ms. Other states last one millisecond, or as long as their cause.
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
