//! Signals of simulated drives: one row each.

use motorlink_proto::rmd::{Errors, Mode};
use motorlink_proto::st::{Flags, Status};
use motorlink_sim::rmd::RmdNode;
use motorlink_sim::st::StMotor;

/// A signal of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Drive, motor and quantity with its unit: `st1.speed_rpm`.
    pub name: String,
    /// Kind of its values.
    pub kind: Kind,
}

impl Signal {
    /// The name of the quantity without drive and unit: `speed reference`.
    pub fn words(&self) -> String {
        let name = self.name.split_once('.').map_or(&*self.name, |(_, name)| name);
        let ending = UNITS.iter().find_map(|(ending, ..)| name.strip_suffix(ending));
        ending.unwrap_or(name).replace('_', " ")
    }
}

/// Kind of a signal's values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Numbers with a unit, which the name ends with.
    Number {
        /// The quantity: `Speed`.
        quantity: &'static str,
        /// Symbol of the unit: `rpm`.
        unit: &'static str,
    },
    /// Numbers that have names.
    Named(Names),
}

/// Where the names of a signal's values come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Names {
    /// States of the ST drive's firmware: register STATUS.
    Status,
    /// Faults of an ST motor, a bit each: either half of register FLAGS.
    Faults,
    /// Mode of an RMD motor: off, stopped, torque, speed, position.
    Mode,
    /// The error byte of an RMD motor, a bit each.
    Errors,
}

impl Names {
    /// The name of a value.
    pub fn name(self, value: u8) -> String {
        match self {
            Names::Status => Status::from(value).to_string(),
            Names::Faults => listed(Flags::names(value.into())),
            Names::Mode => MODES
                .get(usize::from(value))
                .map_or_else(|| value.to_string(), |name| (*name).to_owned()),
            Names::Errors => listed(Errors(value).names()),
        }
    }
}

impl Kind {
    /// Symbol of the unit; empty where values have names.
    pub const fn unit(self) -> &'static str {
        match self {
            Kind::Number { unit, .. } => unit,
            Kind::Named(_) => "",
        }
    }

    /// A value with its unit, or its name.
    pub fn show(self, value: f64) -> String {
        match self {
            Kind::Number { unit, .. } => format!("{} {unit}", short(value)),
            Kind::Named(names) => names.name(value as u8),
        }
    }
}

/// A number with a few significant digits.
pub fn short(value: f64) -> String {
    let decimals = match value.abs() {
        1000.0.. => 0,
        100.0.. => 1,
        10.0.. => 2,
        1.0.. => 3,
        _ => 4,
    };
    let text = format!("{value:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Units by the endings of names: ending, quantity, symbol. The first match counts.
const UNITS: &[(&str, &str, &str)] = &[
    ("_newton_metres", "Torque", "Nm"),
    ("_degrees", "Angle", "°"),
    ("_rpm", "Speed", "rpm"),
    ("_dps", "Speed", "°/s"),
    ("_amps", "Current", "A"),
    ("_volts", "Voltage", "V"),
    ("_celsius", "Temperature", "°C"),
    ("_watts", "Power", "W"),
];

/// A signal of a `T`: its name without the drive, and its value.
pub(crate) struct Row<T: 'static> {
    name: &'static str,
    names: Option<Names>,
    value: fn(&T) -> f64,
}

impl<T> Row<T> {
    pub(crate) fn signal(&self, drive: &str) -> Signal {
        let kind = match self.names {
            Some(names) => Kind::Named(names),
            None => {
                let unit = UNITS.iter().find(|(ending, ..)| self.name.ends_with(ending));
                let (_, quantity, unit) = unit.unwrap_or(&("", "", ""));
                Kind::Number { quantity, unit }
            }
        };
        Signal { name: format!("{drive}.{}", self.name), kind }
    }

    pub(crate) fn value(&self, of: &T) -> f64 {
        (self.value)(of)
    }
}

/// Declares a table of signals of a type: `name = value of the truth`, with `[names]` where its
/// values have names.
macro_rules! signals {
    ($table:ident, $of:ty, |$truth:ident| { $($name:ident $([$names:expr])? = $value:expr;)+ }) => {
        pub(crate) static $table: &[Row<$of>] = &[$( Row {
            name: stringify!($name),
            names: signals!(@names $($names)?),
            value: |$truth| f64::from($value),
        }, )+];
    };
    (@names) => { None };
    (@names $names:expr) => { Some($names) };
}

signals!(ST, motorlink_sim::st::Truth, |truth| {
    speed_rpm = truth.speed_rpm;
    speed_reference_rpm = truth.speed_reference_rpm;
    angle_degrees = truth.plant.angle_degrees;
    iq_amps = truth.plant.iq;
    id_amps = truth.plant.id;
    iq_reference_amps = truth.iq_reference;
    id_reference_amps = truth.id_reference;
    phase_a_amps = truth.plant.phase_currents[0];
    phase_b_amps = truth.plant.phase_currents[1];
    phase_c_amps = truth.plant.phase_currents[2];
    vd_volts = truth.plant.vd;
    vq_volts = truth.plant.vq;
    vd_command_volts = truth.plant.vd_command;
    vq_command_volts = truth.plant.vq_command;
    torque_newton_metres = truth.plant.torque;
    load_newton_metres = truth.plant.load_torque;
    bus_volts = truth.plant.bus_voltage;
    supply_amps = truth.plant.supply_current;
    winding_loss_watts = truth.plant.losses.winding;
    inverter_loss_watts = truth.plant.losses.inverter;
    iron_loss_watts = truth.plant.losses.iron;
    friction_loss_watts = truth.plant.losses.friction;
    gear_loss_watts = truth.plant.losses.gear;
    chopper_loss_watts = truth.plant.losses.chopper;
    heatsink_celsius = truth.temperature;
    winding_celsius = truth.plant.winding_temperature;
    phase_a_celsius = truth.plant.phase_temperatures[0];
    phase_b_celsius = truth.plant.phase_temperatures[1];
    phase_c_celsius = truth.plant.phase_temperatures[2];
    inverter_celsius = truth.plant.inverter_temperature;
    status[Names::Status] = u8::from(truth.status);
    faults[Names::Faults] = (truth.flags.occurred() | truth.flags.present()) as u8;
});

/// State of an RMD motor, and the errors stored in its drive.
pub(crate) struct Rmd {
    truth: motorlink_sim::rmd::Truth,
    errors: Errors,
}

signals!(RMD, Rmd, |rmd| {
    speed_dps = rmd.truth.speed_dps;
    speed_reference_dps = rmd.truth.speed_reference_dps;
    angle_degrees = rmd.truth.plant.angle_degrees;
    output_degrees = rmd.truth.plant.output_degrees;
    iq_amps = rmd.truth.plant.iq;
    id_amps = rmd.truth.plant.id;
    phase_a_amps = rmd.truth.plant.phase_currents[0];
    phase_b_amps = rmd.truth.plant.phase_currents[1];
    phase_c_amps = rmd.truth.plant.phase_currents[2];
    vd_volts = rmd.truth.plant.vd;
    vq_volts = rmd.truth.plant.vq;
    vd_command_volts = rmd.truth.plant.vd_command;
    vq_command_volts = rmd.truth.plant.vq_command;
    torque_newton_metres = rmd.truth.plant.torque;
    load_newton_metres = rmd.truth.plant.load_torque;
    supply_volts = rmd.truth.plant.bus_voltage;
    supply_amps = rmd.truth.plant.supply_current;
    winding_loss_watts = rmd.truth.plant.losses.winding;
    inverter_loss_watts = rmd.truth.plant.losses.inverter;
    iron_loss_watts = rmd.truth.plant.losses.iron;
    friction_loss_watts = rmd.truth.plant.losses.friction;
    gear_loss_watts = rmd.truth.plant.losses.gear;
    chopper_loss_watts = rmd.truth.plant.losses.chopper;
    motor_celsius = rmd.truth.temperature;
    winding_celsius = rmd.truth.plant.winding_temperature;
    phase_a_celsius = rmd.truth.plant.phase_temperatures[0];
    phase_b_celsius = rmd.truth.plant.phase_temperatures[1];
    phase_c_celsius = rmd.truth.plant.phase_temperatures[2];
    inverter_celsius = rmd.truth.plant.inverter_temperature;
    mode[Names::Mode] = mode_number(rmd.truth.mode);
    errors[Names::Errors] = u8::from(rmd.errors);
});

/// Values of an ST motor's signals, in the order of their table.
pub(crate) fn st_values(motor: &StMotor) -> impl Iterator<Item = f64> {
    let truth = motor.truth();
    ST.iter().map(move |row| row.value(&truth))
}

/// Values of an RMD motor's signals, in the order of their table.
pub(crate) fn rmd_values(node: &RmdNode) -> impl Iterator<Item = f64> {
    let truth = node.motor().truth();
    let rmd = Rmd { errors: node.drive().errors().union(truth.faults), truth };
    RMD.iter().map(move |row| row.value(&rmd))
}

fn listed<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let names: Vec<&str> = names.collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Names of modes, by the number that a run shows for each.
const MODES: [&str; 5] = ["off", "stopped", "torque", "speed", "position"];

pub(crate) const fn mode_number(mode: Mode) -> u8 {
    match mode {
        Mode::Off => 0,
        Mode::Stopped => 1,
        Mode::Torque(_) => 2,
        Mode::Speed(_) => 3,
        Mode::Position { .. } => 4,
    }
}

/// The place of a signal in the list.
pub(crate) fn find_signal(name: &str, signals: &[Signal]) -> Result<usize, String> {
    signals.iter().position(|signal| signal.name == name).ok_or_else(|| {
        let likeness = |signal: &&Signal| strsim::jaro_winkler(name, &signal.name);
        let nearest = signals.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        let nearest = nearest.map_or("", |signal| &signal.name);
        format!("unknown signal `{name}`; did you mean `{nearest}`?")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_unit_and_every_signal_is_documented() {
        let document = include_str!("../../../docs/SCENARIOS.md");
        let st = ST.iter().map(|row| row.signal("st1"));
        let rmd = RMD.iter().map(|row| row.signal("rmd1"));
        for signal in st.chain(rmd) {
            let quantity = signal.name.split_once('.').unwrap().1;
            assert!(document.contains(&format!("`{quantity}`")), "{quantity} is not documented");
            assert!(
                !matches!(signal.kind, Kind::Number { unit: "", .. }),
                "{quantity} has no unit"
            );
        }
    }

    #[test]
    fn values_are_shown_as_people_read_them() {
        let speed = ST[0].signal("st1").kind;
        assert_eq!(speed.show(1499.6), "1500 rpm");
        assert_eq!(speed.show(-0.00001), "0 rpm");
        assert_eq!(speed.show(12.5), "12.5 rpm");
        assert_eq!(Names::Faults.name(0), "none");
        assert_eq!(Names::Faults.name(0x42), "OVER_VOLT, BREAK_IN");
        assert_eq!(Names::Errors.name(9), "LOW_VOLTAGE, OVER_TEMPERATURE");
        assert_eq!(Names::Mode.name(4), "position");
    }
}
