//! Thermal bodies: the winding and the inverter, and the housing between them and the air.
//!
//! ```text
//! Cw dTw/dt = P_copper − (Tw − Th)/Rwh
//! Ci dTi/dt = P_inverter − (Ti − Th)/Rih
//! Ch dTh/dt = P_other + (Tw − Th)/Rwh + (Ti − Th)/Rih − (Th − Ta)/Rha
//! ```
//!
//! Each phase is a third of the winding. Its temperature above the winding's mean follows its heat
//! above a third of the total:
//!
//! ```text
//! Cw/3 dTk/dt = P_k − P_copper/3 − Tk (1/(3 Rwh) + 3/Rpp)
//! ```
//!
//! The usual lumped model of a motor's data sheet (winding and stator; see for example Maxon,
//! *Formulae Handbook*, thermal behaviour).

/// How a motor warms up.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct HeatConfig {
    /// Temperature of the air, and of everything at the beginning, °C.
    pub ambient: f32,
    /// Heat capacity of the winding, J/K.
    pub winding_capacity: f32,
    /// Heat capacity of the housing, J/K.
    pub housing_capacity: f32,
    /// From winding to housing, K/W.
    pub winding_to_housing: f32,
    /// From housing to air, K/W.
    pub housing_to_air: f32,
    /// Heat capacity of the inverter's switches, J/K.
    pub inverter_capacity: f32,
    /// From the inverter to the housing, K/W.
    pub inverter_to_housing: f32,
    /// From each phase of the winding to each other, K/W.
    pub phase_to_phase: f32,
    /// Where the drive's sensor is.
    pub sensor: HeatSensor,
}

/// Where a drive measures the temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "lowercase")
)]
pub enum HeatSensor {
    /// In the winding, at the mean of its phases.
    Winding,
    /// In the inverter, at its switches.
    Inverter,
    /// On the housing, which is the power stage's heatsink too.
    #[default]
    Housing,
}

impl Default for HeatConfig {
    fn default() -> Self {
        HeatConfig {
            ambient: 25.0,
            winding_capacity: 30.0,
            housing_capacity: 250.0,
            winding_to_housing: 1.0,
            housing_to_air: 2.5,
            inverter_capacity: 5.0,
            inverter_to_housing: 1.0,
            phase_to_phase: 9.0,
            sensor: HeatSensor::Housing,
        }
    }
}

/// Heat of the bodies in a step, J.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gained {
    pub(super) winding: f32,
    /// Shares of the phases in the winding's heat.
    pub(super) shares: [f32; 3],
    pub(super) inverter: f32,
    pub(super) housing: f32,
}

/// The temperatures.
#[derive(Debug, Clone)]
pub(super) struct Heat {
    config: HeatConfig,
    /// °C, with more digits than the others: the rise of a large body in a step is small compared
    /// with its temperature.
    winding: f64,
    housing: f64,
    inverter: f64,
    /// Temperatures of the phases above the winding's mean, K.
    apart: [f32; 3],
    /// The forced reading of the sensor, °C.
    forced: Option<f32>,
}

impl Heat {
    pub(super) const fn new(config: HeatConfig) -> Self {
        Heat {
            winding: config.ambient as f64,
            housing: config.ambient as f64,
            inverter: config.ambient as f64,
            apart: [0.0; 3],
            forced: None,
            config,
        }
    }

    /// Temperature of the winding, °C.
    pub(super) const fn winding(&self) -> f32 {
        self.winding as f32
    }

    /// Temperature of the housing, °C.
    pub(super) const fn housing(&self) -> f32 {
        self.housing as f32
    }

    /// Temperature of the inverter, °C.
    pub(super) const fn inverter(&self) -> f32 {
        self.inverter as f32
    }

    /// Temperatures of the phases, °C.
    pub(super) fn phases(&self) -> [f32; 3] {
        self.apart.map(|apart| self.winding() + apart)
    }

    /// The reading of the sensor, °C.
    pub(super) fn sensed(&self) -> f32 {
        self.forced.unwrap_or(match self.config.sensor {
            HeatSensor::Winding => self.winding(),
            HeatSensor::Inverter => self.inverter(),
            HeatSensor::Housing => self.housing(),
        })
    }

    pub(super) const fn force(&mut self, temperature: Option<f32>) {
        self.forced = temperature;
    }

    /// Applies heat for `dt` (s).
    pub(super) fn step(&mut self, dt: f32, heat: &Gained) {
        let Gained { winding, shares, inverter, housing } = *heat;
        let HeatConfig { ambient, winding_to_housing, housing_to_air, .. } = self.config;
        let from_inverter =
            (self.inverter() - self.housing()) / self.config.inverter_to_housing * dt;
        self.inverter += f64::from((inverter - from_inverter) / self.config.inverter_capacity);
        let leaking = 1.0 / (3.0 * winding_to_housing) + 3.0 / self.config.phase_to_phase;
        for (apart, share) in self.apart.iter_mut().zip(shares) {
            let gained = winding * (share - 1.0 / 3.0) - *apart * leaking * dt;
            *apart += 3.0 * gained / self.config.winding_capacity;
        }
        let inner = (self.winding() - self.housing()) / winding_to_housing * dt;
        let outer = (self.housing() - ambient) / housing_to_air * dt;
        self.winding += f64::from((winding - inner) / self.config.winding_capacity);
        self.housing +=
            f64::from((housing + from_inverter + inner - outer) / self.config.housing_capacity);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_body_warms_up_to_its_equilibrium() {
        let config = HeatConfig {
            ambient: 40.0,
            winding_capacity: 100.0,
            housing_capacity: 2000.0,
            winding_to_housing: 0.5,
            housing_to_air: 0.5,
            sensor: HeatSensor::Housing,
            ..HeatConfig::default()
        };
        let mut heat = Heat::new(config);
        let gained = Gained { winding: 0.0, shares: [0.0; 3], inverter: 0.0, housing: 3e-3 };
        for _ in 0..10_000_000 {
            heat.step(1e-3, &gained);
        }
        // 3 W through 0.5 K/W, after ten time constants.
        assert!((heat.housing() - 41.5).abs() < 0.01, "{} °C", heat.housing());
    }
}
