//! The inverter: three half bridges, averaged over a period.
//!
//! A voltage command is a share of the bus voltage in the stator's frame. Space-vector modulation
//! centres the three duties (the common mode is minus the mean of the greatest and the least, see
//! D. G. Holmes and T. A. Lipo, *Pulse Width Modulation for Power Converters*), and a duty ends at
//! 0 and 1: so what comes out is within the hexagon. During the dead time the current chooses the
//! rail, which takes `dead time / period` of the bus voltage from a phase that gives current and
//! adds it to one that takes it; around zero, within the current's ripple, in proportion to it.
//! Each half bridge switches on and off once a period, with the bus voltage and the phase's current
//! overlapping for half of the rise and of the fall time: that costs V |i| (tr + tf) / 2 (see for
//! example N. Mohan and others, *Power Electronics*, on switching losses).
//! A command within the circle that fits into the hexagon comes out as it is, so only the others are
//! taken apart into duties.

use crate::vector::{INVERSE_SQRT_3, Vector};

/// The configuration of the power stage.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct InverterConfig {
    /// Time in which both switches of a half bridge are off, µs.
    pub dead_time_us: f32,
    /// Current below which the dead time's effect fades, A.
    pub ripple_current: f32,
    /// Resistance of a closed switch, Ω.
    pub on_resistance: f32,
    /// Sum of the rise and fall time of a switch, ns: the cause of its switching losses.
    pub switching_time_ns: f32,
}

impl Default for InverterConfig {
    fn default() -> Self {
        InverterConfig {
            dead_time_us: 0.5,
            ripple_current: 0.2,
            on_resistance: 0.02,
            switching_time_ns: 50.0,
        }
    }
}

/// The command of the drive's firmware to the power stage, for one period.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Bridge {
    /// All switches open. Remaining current flows through the diodes.
    #[default]
    Off,
    /// A voltage in the stator's frame, as a share of the bus voltage. A circle of radius 1/√3 fits
    /// into what can come out.
    Drive(Vector),
}

/// Converts commands to voltages.
#[derive(Debug, Clone)]
pub(super) struct Modulator {
    /// Dead time as a share of the period.
    dead: f32,
    /// One over the current's ripple, 1/A.
    steepness: f32,
    /// Share of a phase's current that switching takes from the bus.
    switching: f32,
}

impl Modulator {
    pub(super) fn new(config: &InverterConfig, period: f32) -> Self {
        Modulator {
            dead: config.dead_time_us * 1e-6 / period,
            steepness: 1.0 / config.ripple_current,
            switching: 0.5e-9 * config.switching_time_ns / period,
        }
    }

    /// Current that switching takes from the bus, with these phase currents, A.
    pub(super) fn switching(&self, phases: [f32; 3]) -> f32 {
        let [a, b, c] = phases;
        self.switching * (a.abs() + b.abs() + c.abs())
    }

    /// The output voltage per bus voltage for a command, with this output current (A).
    pub(super) fn modulate(&self, command: Vector, current: Vector) -> Vector {
        let circle = INVERSE_SQRT_3 * INVERSE_SQRT_3;
        let wanted = if command.square() <= circle { command } else { within_hexagon(command) };
        let [a, b, c] = current.phases().map(|current| (current * self.steepness).clamp(-1.0, 1.0));
        let mean = (a + b + c) * (1.0 / 3.0);
        wanted - Vector::from_phases(a - mean, b - mean) * self.dead
    }
}

/// The output for a command that may be too large.
fn within_hexagon(command: Vector) -> Vector {
    let [a, b, c] = command.phases();
    let centre = 0.5 - 0.5 * (a.max(b).max(c) + a.min(b).min(c));
    let [a, b, c] = [a, b, c].map(|share| (share + centre).clamp(0.0, 1.0));
    let mean = (a + b + c) * (1.0 / 3.0);
    Vector::from_phases(a - mean, b - mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ideal(command: Vector) -> Vector {
        let config = InverterConfig { dead_time_us: 0.0, ..InverterConfig::default() };
        Modulator::new(&config, 50e-6).modulate(command, Vector::ZERO)
    }

    #[test]
    fn a_voltage_within_the_hexagon_is_unchanged() {
        for angle in (0..64).map(|step| step << 26) {
            let command = Vector::unit(angle) * (INVERSE_SQRT_3 - 1e-6);
            assert!((ideal(command) - command).length() < 1e-6);
        }
    }

    #[test]
    fn a_voltage_beyond_the_hexagon_is_limited_to_it() {
        // Two thirds of the bus voltage at a corner, 1/√3 in the middle of a side.
        let corner = ideal(Vector::new(5.0, 0.0));
        assert!((corner - Vector::new(2.0 / 3.0, 0.0)).length() < 1e-6, "{corner:?}");
        let side = ideal(Vector::new(0.0, 5.0));
        assert!((side - Vector::new(0.0, INVERSE_SQRT_3)).length() < 1e-6, "{side:?}");
    }

    #[test]
    fn dead_time_works_against_the_current() {
        let config =
            InverterConfig { dead_time_us: 0.5, ripple_current: 0.1, ..InverterConfig::default() };
        let modulator = Modulator::new(&config, 50e-6);
        let current = Vector::new(2.0, 0.0);
        let lost = modulator.modulate(Vector::ZERO, current);
        // Phase A supplies current, B and C take it: 4/3 of a leg's loss along A.
        assert!((lost - Vector::new(-0.01 * 4.0 / 3.0, 0.0)).length() < 1e-6, "{lost:?}");
        let small = modulator.modulate(Vector::ZERO, current * 0.01);
        assert!(small.length() < 0.5 * lost.length());
    }
}
