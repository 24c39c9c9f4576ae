//! The file of a node.

use std::path::Path;
use std::time::Duration;

use motorlink::rmd;
use motorlink::st;
use motorlink_fleet::ros2;
use motorlink_telemetry::share::port_config::Limits;
use serde::Deserialize;

use crate::failure::Failure;

/// The longest lease, in seconds.
const LONGEST_LEASE: f64 = 3600.0;

/// What the file of a node says. Times are in seconds.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How long a motor stays with the program that changed it.
    lease_seconds: Option<f64>,
    limits: LimitsOf,
    ros2: Option<ros2::Settings>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct LimitsOf {
    st: StLimits,
    rmd: RmdLimits,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct StLimits {
    speed_rpm: Option<u32>,
    current_s16a: Option<u16>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct RmdLimits {
    current_amps: Option<f64>,
    speed_dps: Option<f64>,
    angle_degrees: Option<f64>,
}

impl Config {
    /// Reads the file.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let failed = |why: String| Failure::usage(format!("{}: {why}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|error| failed(error.to_string()))?;
        toml::from_str(&text).map_err(|error| failed(error.to_string().trim_end().to_owned()))
    }

    /// The lease.
    pub fn lease(&self) -> Result<Option<Duration>, Failure> {
        let Some(seconds) = self.lease_seconds else { return Ok(None) };
        if !(0.0..=LONGEST_LEASE).contains(&seconds) {
            return Err(Failure::usage(format!("lease_seconds is 0 to {LONGEST_LEASE}")));
        }
        Ok(Some(Duration::from_secs_f64(seconds)))
    }

    /// Whether the file is about ROS 2.
    pub fn has_ros2(&self) -> bool {
        self.ros2.is_some()
    }

    /// What the node does for ROS 2 machines of this domain, or of that of the file.
    pub fn ros2(&self, domain: Option<u32>) -> Result<ros2::Settings, Failure> {
        let mut settings = self.ros2.clone().unwrap_or_default();
        settings.domain = domain.unwrap_or(settings.domain);
        settings.check().map_err(Failure::usage)?;
        Ok(settings)
    }

    /// What no program may exceed.
    pub fn limits(&self) -> Result<Limits, Failure> {
        let LimitsOf { st, rmd } = &self.limits;
        Ok(Limits {
            st: st::Limits { speed_rpm: st.speed_rpm, current_s16a: st.current_s16a },
            rmd: rmd::Limits {
                current: quantity("current_amps", rmd.current_amps)?,
                speed: quantity("speed_dps", rmd.speed_dps)?,
                angle: quantity("angle_degrees", rmd.angle_degrees)?,
            },
        })
    }
}

/// A limit in digits.
fn quantity<Q: rmd::Quantity>(name: &str, value: Option<f64>) -> Result<Option<Q>, Failure> {
    let limit = value.map(|value| Q::wanted(value));
    limit.transpose().map_err(|error| Failure::usage(format!("limits.rmd.{name}: {error}")))
}
