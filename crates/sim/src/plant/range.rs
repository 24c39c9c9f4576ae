//! The valid ranges of a plant's configuration.

use core::fmt;

use super::PlantConfig;

/// A value of a configuration outside its valid range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutOfRange {
    /// The field, as written in a file.
    pub name: &'static str,
    /// Its value.
    pub value: f32,
    /// The minimum.
    pub least: f32,
    /// The maximum.
    pub most: f32,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let OutOfRange { name, value, least, most } = self;
        write!(f, "{name} is {least} to {most}, not {value}")
    }
}

impl core::error::Error for OutOfRange {}

/// A field with its value, minimum and maximum.
pub(crate) type Range = (&'static str, f32, f32, f32);

/// The first value outside its range. NaN is outside every range.
pub(crate) fn check(ranges: impl IntoIterator<Item = Range>) -> Result<(), OutOfRange> {
    let odd = ranges.into_iter().find(|(_, value, least, most)| !(least..=most).contains(&value));
    match odd {
        Some((name, value, least, most)) => Err(OutOfRange { name, value, least, most }),
        None => Ok(()),
    }
}

impl PlantConfig {
    /// Refuses a configuration that cannot be simulated. No other input can cause NaN.
    pub fn check(&self) -> Result<(), OutOfRange> {
        const SMALL: f32 = 1e-9;
        let PlantConfig { machine, load, heat, supply, inverter, sensing, encoder, .. } = self;
        check([
            ("plant.period_us", self.period_us.into(), 25.0, 250.0),
            (
                "the rest of plant.period_us in 1000",
                f32::from(1000 % self.period_us.max(1)),
                0.0,
                0.0,
            ),
            ("plant.angle_degrees", self.angle_degrees, -1e6, 1e6),
            ("plant.machine.pole_pairs", machine.pole_pairs.into(), 1.0, 100.0),
            ("plant.machine.resistance", machine.resistance, 1e-4, 1e3),
            ("plant.machine.inductance_d", machine.inductance_d, 1e-6, 10.0),
            ("plant.machine.inductance_q", machine.inductance_q, 1e-6, 10.0),
            ("plant.machine.flux_linkage", machine.flux_linkage, 1e-6, 10.0),
            ("plant.machine.magnet_coefficient", machine.magnet_coefficient, -0.01, 0.01),
            ("plant.machine.inertia", machine.inertia, SMALL, 1e3),
            ("plant.machine.viscous_friction", machine.viscous_friction, 0.0, 1e3),
            ("plant.machine.coulomb_friction", machine.coulomb_friction, 0.0, 1e3),
            ("plant.machine.stiction", machine.stiction, machine.coulomb_friction, 1e3),
            ("plant.machine.stribeck_speed", machine.stribeck_speed, 1e-3, 1e6),
            ("plant.machine.cogging_torque", machine.cogging_torque, 0.0, 1e3),
            ("plant.machine.iron_hysteresis", machine.iron_hysteresis, 0.0, 1e3),
            ("plant.machine.iron_eddy", machine.iron_eddy, 0.0, 1e3),
            ("plant.machine.gear.ratio", machine.gear.ratio, 0.01, 1e4),
            ("plant.machine.gear.efficiency", machine.gear.efficiency, 0.1, 1.0),
            ("plant.load.brake", load.brake, 0.0, 1e3),
            ("plant.load.torque", load.torque, -1e3, 1e3),
            ("plant.load.viscous", load.viscous, 0.0, 1e3),
            ("plant.load.fan", load.fan, 0.0, 1e3),
            ("plant.load.inertia", load.inertia, 0.0, 1e3),
            ("plant.load.spring.stiffness", load.spring.stiffness, 0.0, 1e4),
            ("plant.load.spring.centre_degrees", load.spring.centre_degrees, -1e6, 1e6),
            ("plant.load.pendulum.mass", load.pendulum.mass, 0.0, 1e3),
            ("plant.load.pendulum.length", load.pendulum.length, 0.0, 1e2),
            ("plant.heat.ambient", heat.ambient, -100.0, 1000.0),
            ("plant.heat.winding_capacity", heat.winding_capacity, 0.1, 1e6),
            ("plant.heat.housing_capacity", heat.housing_capacity, 0.1, 1e6),
            ("plant.heat.winding_to_housing", heat.winding_to_housing, 0.05, 1e4),
            ("plant.heat.housing_to_air", heat.housing_to_air, 0.05, 1e4),
            ("plant.heat.phase_to_phase", heat.phase_to_phase, 0.1, 1e6),
            ("plant.heat.inverter_capacity", heat.inverter_capacity, 0.1, 1e6),
            ("plant.heat.inverter_to_housing", heat.inverter_to_housing, 0.05, 1e4),
            ("plant.supply.voltage", supply.voltage, 0.0, 1000.0),
            ("plant.supply.resistance", supply.resistance, 1e-3, 1e3),
            ("plant.supply.capacitance", supply.capacitance, 1e-6, 10.0),
            ("plant.inverter.dead_time_us", inverter.dead_time_us, 0.0, 10.0),
            ("plant.inverter.ripple_current", inverter.ripple_current, 1e-4, 1e3),
            ("plant.inverter.on_resistance", inverter.on_resistance, 0.0, 1e2),
            ("plant.inverter.switching_time_ns", inverter.switching_time_ns, 0.0, 1e4),
            ("plant.sensing.full_scale", sensing.full_scale, 1e-3, 1e4),
            ("plant.sensing.noise", sensing.noise, 0.0, sensing.full_scale),
            ("plant.sensing.bits", sensing.bits.into(), 10.0, 16.0),
            ("plant.encoder.bits", encoder.bits.into(), 12.0, 18.0),
            ("plant.encoder.offset_degrees", encoder.offset_degrees, -360.0, 360.0),
        ])?;
        for value in sensing.offset {
            let most = sensing.full_scale;
            check([("plant.sensing.offset", value, -most, most)])?;
        }
        for value in sensing.gain_error {
            check([("plant.sensing.gain_error", value, -0.5, 0.5)])?;
        }
        if let Some(value) = machine.gear.back_efficiency {
            check([("plant.machine.gear.back_efficiency", value, 0.0, 1.0)])?;
        }
        if let Some(chopper) = supply.chopper {
            check([
                ("plant.supply.chopper.resistance", chopper.resistance, 1e-2, 1e5),
                ("plant.supply.chopper.on_voltage", chopper.on_voltage, 0.0, 1e4),
                ("plant.supply.chopper.off_voltage", chopper.off_voltage, 0.0, chopper.on_voltage),
            ])?;
        }
        if let Some(stops) = load.stops {
            check([
                ("plant.load.stops.low_degrees", stops.low_degrees, -1e6, 1e6),
                ("plant.load.stops.high_degrees", stops.high_degrees, stops.low_degrees, 1e6),
                ("plant.load.stops.stiffness", stops.stiffness, 0.0, 1e5),
                ("plant.load.stops.damping", stops.damping, 0.0, 1e3),
            ])?;
        }
        // Oscillations faster than this cannot be simulated with this step.
        let period = f32::from(self.period_us) * 1e-6;
        let weight = load.pendulum.mass * load.pendulum.length;
        let behind = load.inertia + weight * load.pendulum.length;
        let rotor = machine.inertia + behind / (machine.gear.ratio * machine.gear.ratio);
        let stiffest = 0.25 * rotor / (period * period);
        let behind_gear = stiffest * machine.gear.ratio * machine.gear.ratio;
        let inductance = machine.inductance_d.min(machine.inductance_q);
        let magnet = machine.torque_constant() * machine.back_emf_constant() / inductance;
        let apart = 0.5 * (machine.resistance + inverter.on_resistance) * period;
        let apart = apart * (1.0 / machine.inductance_d - 1.0 / machine.inductance_q).abs();
        let stiffness_of_stops = load.stops.map_or(0.0, |stops| stops.stiffness);
        let cogging = machine.cogging_torque * f32::from(machine.cogging_periods);
        check([
            ("in plant.period_us, what R/2L of plant.machine's axes differ by", apart, 0.0, 0.5),
            ("with this inertia, 1.5 p² ψ² / L of plant.machine", magnet, 0.0, stiffest),
            ("with this inertia, cogging_torque times periods", cogging, 0.0, stiffest),
            (
                "with this inertia, plant.load.spring.stiffness",
                load.spring.stiffness,
                0.0,
                behind_gear,
            ),
            (
                "with this inertia, stiffness of plant.load.stops",
                stiffness_of_stops,
                0.0,
                behind_gear,
            ),
            ("with this inertia, weight of plant.load.pendulum", weight * 9.81, 0.0, behind_gear),
        ])
    }
}
