//! One body that losses heat and the air cools.

/// How a body warms up.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct HeatConfig {
    /// Temperature of the air, °C.
    pub ambient: f32,
    /// Rise of temperature per loss, K/W.
    pub resistance: f32,
    /// Time in which 63 % of a rise is there, s.
    pub time_constant: f32,
}

impl Default for HeatConfig {
    fn default() -> Self {
        HeatConfig { ambient: 25.0, resistance: 0.5, time_constant: 60.0 }
    }
}

/// A body's temperature.
#[derive(Debug, Clone)]
pub(crate) struct Heat {
    config: HeatConfig,
    /// Above the air, K.
    rise: f32,
    forced: Option<f32>,
}

impl Heat {
    pub(crate) const fn new(config: HeatConfig) -> Self {
        Heat { config, rise: 0.0, forced: None }
    }

    /// Temperature, °C.
    pub(crate) fn temperature(&self) -> f32 {
        self.forced.unwrap_or(self.config.ambient + self.rise)
    }

    /// Shows this temperature (°C) in place of the body's own until `None` comes.
    pub(crate) const fn force(&mut self, temperature: Option<f32>) {
        self.forced = temperature;
    }

    /// Lets a `loss` (W) act for `dt` (s).
    pub(crate) fn step(&mut self, dt: f32, loss: f32) {
        let HeatConfig { resistance, time_constant, .. } = self.config;
        self.rise += (loss * resistance - self.rise) * dt / time_constant;
    }
}
