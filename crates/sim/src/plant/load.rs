//! The load on the output shaft.

use crate::angle::{TURN, radians};
use crate::plant::GearConfig;

/// Acceleration of gravity, m/s².
const GRAVITY: f32 = 9.806_65;

/// The load on the output shaft. All parts act together. The torque against motion towards growing
/// angles is
///
/// ```text
/// T = torque + viscous ω + fan |ω| ω + stiffness (θ − centre) + m g l sin θ + stops + brake sign ω
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct LoadConfig {
    /// Torque against the motion at any speed, Nm. It holds a shaft at rest.
    pub brake: f32,
    /// Torque against growing angles, Nm; a negative one turns the shaft forwards.
    pub torque: f32,
    /// Torque against the motion per speed, Nm s/rad.
    pub viscous: f32,
    /// Torque against the motion per speed squared, Nm s²/rad².
    pub fan: f32,
    /// Inertia, kg m².
    pub inertia: f32,
    /// A torsion spring.
    pub spring: SpringConfig,
    /// A weight on an arm, hanging at 0; its inertia counts too.
    pub pendulum: PendulumConfig,
    /// End stops, if there are any.
    pub stops: Option<StopsConfig>,
}

/// A torsion spring.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct SpringConfig {
    /// Torque per angle, Nm/rad.
    pub stiffness: f32,
    /// Angle of the rest position, °.
    pub centre_degrees: f32,
}

/// A weight on an arm.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct PendulumConfig {
    /// Mass, kg.
    pub mass: f32,
    /// Length of the arm, m.
    pub length: f32,
}

/// Elastic end stops.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct StopsConfig {
    /// Lowest free angle, °.
    pub low_degrees: f32,
    /// Highest free angle, °.
    pub high_degrees: f32,
    /// Torque per angle beyond a stop, Nm/rad.
    pub stiffness: f32,
    /// Torque per speed beyond a stop, against the motion, Nm s/rad.
    pub damping: f32,
}

/// A load behind its gear.
#[derive(Debug, Clone)]
pub(super) struct Load {
    config: LoadConfig,
    /// One over the gear's ratio.
    step_down: f32,
    /// Whether a torque depends on the position.
    positional: bool,
}

/// Torques of a load at the output against growing angles, Nm, without the brake.
#[derive(Debug, Clone, Copy)]
pub(super) struct Torques {
    /// The part that does not depend on the position; its energy is not stored.
    pub(super) constant: f32,
    /// The part of springs and weights; its energy is stored.
    pub(super) kept: f32,
    /// Torque against the motion per speed, Nm s/rad.
    pub(super) damping: f32,
    /// Speed of the output, rad/s.
    speed: f32,
}

impl Torques {
    /// The sum of all torques.
    pub(super) fn total(&self) -> f32 {
        self.constant + self.kept + self.damping * self.speed
    }
}

impl Load {
    pub(super) fn new(config: LoadConfig, gear: GearConfig) -> Self {
        let positional =
            config.spring.stiffness != 0.0 || config.pendulum.mass != 0.0 || config.stops.is_some();
        Load { config, step_down: 1.0 / gear.ratio, positional }
    }

    pub(super) const fn config(&self) -> &LoadConfig {
        &self.config
    }

    /// Inertia at the rotor, kg m².
    pub(super) fn inertia(&self) -> f32 {
        let PendulumConfig { mass, length } = self.config.pendulum;
        (self.config.inertia + mass * length * length) * self.step_down * self.step_down
    }

    /// A torque at the output as it is at the rotor.
    pub(super) fn referred(&self, torque: f32) -> f32 {
        torque * self.step_down
    }

    /// Torque per speed at the output as it is at the rotor.
    pub(super) fn damping(&self, torques: &Torques) -> f32 {
        torques.damping * self.step_down * self.step_down
    }

    /// Torques at a position (2^32 a turn) and speed (rad/s) of the rotor.
    pub(super) fn at(&self, position: i64, speed: f32) -> Torques {
        let LoadConfig { torque, viscous, fan, .. } = self.config;
        let speed = speed * self.step_down;
        let damping = viscous + fan * speed.abs();
        let plain = Torques { constant: torque, kept: 0.0, damping, speed };
        if !self.positional {
            return plain;
        }
        let angle = self.angle(position);
        let (beyond, damping) = self.beyond(angle);
        let stiffness = self.config.stops.map_or(0.0, |stops| stops.stiffness);
        let spring = self.config.spring.stiffness * self.stretch(angle);
        let weight = self.weight() * libm::sinf(angle);
        Torques {
            kept: spring + weight + stiffness * beyond,
            damping: plain.damping + damping,
            ..plain
        }
    }

    /// Torque of the brake at the rotor, Nm.
    pub(super) fn brake(&self) -> f32 {
        self.config.brake * self.step_down
    }

    /// Energy stored in springs and weights, J.
    pub(super) fn potential(&self, position: i64) -> f32 {
        if !self.positional {
            return 0.0;
        }
        let angle = self.angle(position);
        let (stretch, (beyond, _)) = (self.stretch(angle), self.beyond(angle));
        let stiffness = self.config.stops.map_or(0.0, |stops| stops.stiffness);
        0.5 * self.config.spring.stiffness * stretch * stretch
            + self.weight() * (1.0 - libm::cosf(angle))
            + 0.5 * stiffness * beyond * beyond
    }

    /// Angle of the output, rad.
    fn angle(&self, position: i64) -> f32 {
        // Whole turns of the rotor are separate, so that many turns do not reduce the precision.
        let turns = position.div_euclid(TURN) as f32;
        let rest = radians(position.rem_euclid(TURN));
        (turns * core::f32::consts::TAU + rest) * self.step_down
    }

    fn stretch(&self, angle: f32) -> f32 {
        angle - self.config.spring.centre_degrees.to_radians()
    }

    /// Torque of the weight with the arm level, Nm.
    fn weight(&self) -> f32 {
        self.config.pendulum.mass * GRAVITY * self.config.pendulum.length
    }

    /// How far an angle is beyond a stop, rad, and the damping there.
    fn beyond(&self, angle: f32) -> (f32, f32) {
        let Some(stops) = self.config.stops else { return (0.0, 0.0) };
        let (low, high) = (stops.low_degrees.to_radians(), stops.high_degrees.to_radians());
        let beyond = (angle - high).max(0.0) + (angle - low).min(0.0);
        (beyond, if beyond == 0.0 { 0.0 } else { stops.damping })
    }
}
