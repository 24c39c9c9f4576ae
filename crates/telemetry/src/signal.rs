//! What can be read of a motor again and again.

use std::fmt;
use std::sync::LazyLock;

use motorlink_proto::rmd::{COMMANDS, Code, CommandInfo, Field, MotorId};
use motorlink_proto::st::register::Access;
use motorlink_proto::st::{MotorNumber, RegisterId, UnknownRegister, find_register};
use serde::{Serialize, Serializer};

/// A motor of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Motor {
    /// A motor of the ST drive.
    St(MotorNumber),
    /// A motor on the CAN bus.
    Rmd(MotorId),
}

/// A value of a motor that is read again and again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Signal {
    /// The motor.
    pub motor: Motor,
    /// The value.
    pub source: Source,
}

/// Where a value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Source {
    /// A register of an ST drive.
    Register(RegisterId),
    /// A value in the replies of an RMD motor.
    Quantity(Quantity),
}

/// A value in the replies of RMD motors: the index in the list of all quantities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Quantity(u8);

/// No signal has this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnknownSignal {
    /// Of an RMD motor.
    #[error("unknown signal `{0}`: the signals are {names}", names = names())]
    Quantity(String),
    /// Of an ST drive.
    #[error(transparent)]
    Register(#[from] UnknownRegister),
    /// The register can be written only.
    #[error("{0} can only be written")]
    WriteOnly(RegisterId),
}

impl Motor {
    /// The number of the motor on its line.
    pub fn number(self) -> u8 {
        match self {
            Motor::St(number) => number.number(),
            Motor::Rmd(id) => id.number(),
        }
    }
}

impl Signal {
    /// The signal of a motor with this name: that of a register, or of a quantity such as `speed_dps`.
    ///
    /// # Errors
    /// The motor has no such signal.
    pub fn named(motor: Motor, name: &str) -> Result<Self, UnknownSignal> {
        let source = match motor {
            Motor::St(_) => {
                let register = find_register(name)?;
                let access = register.shape().map(|shape| shape.access);
                if access == Some(Access::WriteOnly) {
                    return Err(UnknownSignal::WriteOnly(register));
                }
                Source::Register(register)
            }
            Motor::Rmd(_) => Source::Quantity(Quantity::named(name)?),
        };
        Ok(Signal { motor, source })
    }
}

impl Source {
    /// All signals of a motor of the same kind.
    pub fn all(motor: Motor) -> Vec<Source> {
        let is_readable = |register: &RegisterId| {
            register.shape().is_some_and(|shape| shape.access != Access::WriteOnly)
        };
        match motor {
            Motor::St(_) => RegisterId::all().filter(is_readable).map(Source::Register).collect(),
            Motor::Rmd(_) => Quantity::all().map(Source::Quantity).collect(),
        }
    }

    /// The symbol of the unit of values; empty without a unit.
    pub fn unit(self) -> &'static str {
        match self {
            Source::Register(register) => {
                register.shape().map_or("", |shape| shape.unit.quantity())
            }
            Source::Quantity(quantity) => quantity.read().1.scale.symbol,
        }
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Source::Register(register) => register.fmt(f),
            Source::Quantity(quantity) => f.write_str(&quantity.name()),
        }
    }
}

impl Serialize for Source {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Quantity {
    /// All quantities. Those of the reads with the most values come first.
    pub fn all() -> impl Iterator<Item = Quantity> {
        (0..).map(Quantity).zip(&*ROWS).map(|(quantity, _)| quantity)
    }

    /// The quantity of this name.
    ///
    /// # Errors
    /// There is none; the error lists the names.
    pub fn named(name: &str) -> Result<Self, UnknownSignal> {
        let found = Self::all().find(|quantity| quantity.name() == name);
        found.ok_or_else(|| UnknownSignal::Quantity(name.to_owned()))
    }

    /// The name, with its unit: `speed_dps`.
    pub fn name(self) -> String {
        self.row().0.clone()
    }

    /// The read with the most values that has this one, and where.
    pub fn read(self) -> (Code, &'static Field) {
        let (_, code, field) = self.row();
        (*code, *field)
    }

    /// The name without its unit: `speed`.
    pub fn short_name(self) -> String {
        let (name, _, field) = self.row();
        let with_unit = field.name_with_unit().to_string();
        let unit = with_unit.strip_prefix(field.name).unwrap_or_default();
        name.strip_suffix(unit).unwrap_or(name).to_owned()
    }

    /// The quantities in the reply of a read, in its order.
    pub fn of_read(code: Code) -> impl Iterator<Item = Quantity> {
        let reply = COMMANDS.iter().filter(move |row| row.code == code).flat_map(|row| row.reply);
        reply.filter_map(move |wanted| {
            let has = |(read, field): (Code, &Field)| read == code && field.name == wanted.name;
            Self::all().find(|quantity| quantity.reads().any(has))
        })
    }

    /// The reads whose replies have this value, and where.
    pub fn reads(self) -> impl Iterator<Item = (Code, &'static Field)> {
        let (_, wanted) = self.read();
        READS.iter().filter_map(move |row| {
            let same = |field: &&Field| field.name == wanted.name && field.scale == wanted.scale;
            Some((row.code, row.reply.iter().find(same)?))
        })
    }

    fn row(self) -> &'static (String, Code, &'static Field) {
        &ROWS[usize::from(self.0)]
    }
}

/// The reads that are repeated. Those with the most values come first.
static READS: LazyLock<Vec<&'static CommandInfo>> = LazyLock::new(|| {
    let mut reads: Vec<_> = COMMANDS.iter().filter(|row| row.sampled).collect();
    reads.sort_by_key(|row| std::cmp::Reverse(row.reply.len()));
    reads
});

/// Each quantity once: its name, the first read that has it, and its field.
static ROWS: LazyLock<Vec<(String, Code, &'static Field)>> = LazyLock::new(|| {
    let mut rows: Vec<(String, Code, &'static Field)> = Vec::new();
    for row in &*READS {
        for field in row.reply {
            let name = name(row, field, &READS);
            if !rows.iter().any(|(known, ..)| *known == name) {
                rows.push((name, row.code, field));
            }
        }
    }
    rows
});

/// The field's name. If another read has the same name for something else, it is the noun of the read.
fn name(row: &CommandInfo, field: &Field, reads: &[&CommandInfo]) -> String {
    let mut fields = reads.iter().flat_map(|read| read.reply);
    let name = field.name_with_unit().to_string();
    match fields.any(|it| it.name == field.name && it.scale != field.scale) {
        true => name.replacen(field.name, row.noun(), 1),
        false => name,
    }
}

/// The names of all quantities.
fn names() -> String {
    Quantity::all().map(Quantity::name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_fields_of_replies() {
        let names: Vec<_> = Quantity::all().map(Quantity::name).collect();
        assert_eq!(
            names,
            [
                "temperature_celsius",
                "iq_amps",
                "speed_dps",
                "encoder",
                "voltage_volts",
                "errors",
                "phase_a_amps",
                "phase_b_amps",
                "phase_c_amps",
                "multi_turn_angle_degrees",
                "single_turn_angle_degrees",
            ]
        );
        for quantity in Quantity::all() {
            assert_eq!(Quantity::named(&quantity.name()), Ok(quantity));
        }
    }

    #[test]
    fn every_listed_signal_has_a_name_and_its_unit() {
        let (st, rmd) =
            (Motor::St(MotorNumber::new(1).unwrap()), Motor::Rmd(MotorId::new(1).unwrap()));
        for motor in [st, rmd] {
            for source in Source::all(motor) {
                assert_eq!(Signal::named(motor, &source.to_string()), Ok(Signal { motor, source }));
            }
        }
        let unit = |motor, name| Signal::named(motor, name).unwrap().source.unit();
        assert_eq!(unit(st, "SPEED_MEAS"), "rpm");
        assert_eq!(unit(st, "STATUS"), "");
        assert_eq!(unit(rmd, "speed_dps"), "°/s");
    }

    #[test]
    fn a_read_has_the_quantities_of_its_reply() {
        let names =
            |code| -> Vec<String> { Quantity::of_read(code).map(Quantity::short_name).collect() };
        assert_eq!(names(Code::ReadStatus), ["temperature", "voltage", "errors"]);
        assert_eq!(names(Code::ReadMultiTurnAngle), ["multi_turn_angle"]);
        assert_eq!(names(Code::ReadSingleTurnAngle), ["single_turn_angle"]);
        assert_eq!(names(Code::ReadPid), Vec::<String>::new());
    }

    #[test]
    fn a_temperature_is_in_two_replies_and_an_angle_in_one() {
        let codes = |name: &str| -> Vec<u8> {
            let quantity = Quantity::named(name).unwrap();
            quantity.reads().map(|(code, _)| code.into()).collect()
        };
        assert_eq!(codes("temperature_celsius"), [0x9C, 0x9A]);
        assert_eq!(codes("iq_amps"), [0x9C]);
        assert_eq!(codes("multi_turn_angle_degrees"), [0x92]);
        assert_eq!(codes("single_turn_angle_degrees"), [0x94]);
    }

    #[test]
    fn a_signal_has_the_name_of_its_register_or_quantity() {
        let (st, rmd) =
            (Motor::St(MotorNumber::new(1).unwrap()), Motor::Rmd(MotorId::new(1).unwrap()));
        let signal = Signal::named(st, "SPEED_MEAS").unwrap();
        assert_eq!(signal.source, Source::Register(RegisterId::SPEED_MEAS));
        assert_eq!(Signal::named(rmd, "speed_dps").unwrap().source.to_string(), "speed_dps");
        let unknown = Signal::named(st, "SPED_MEAS").unwrap_err().to_string();
        assert_eq!(unknown, "there is no register `SPED_MEAS`; did you mean `SPEED_MEAS`?");
        let unknown = Signal::named(rmd, "speed").unwrap_err().to_string();
        assert!(
            unknown.starts_with("unknown signal `speed`: the signals are temp")
                && unknown.ends_with(", single_turn_angle_degrees"),
            "{unknown}"
        );
        let refused = Signal::named(st, "IQ_SPEEDMODE").unwrap_err().to_string();
        assert_eq!(refused, "IQ_SPEEDMODE can only be written");
    }
}
