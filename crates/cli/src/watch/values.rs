//! The signals of a row, and the text of values.

use motorlink::rmd::Errors;
use motorlink::st::{Flags, Reading, RegisterId, Status};
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::{Motor, Quantity, Signal, Source};

use crate::json::{RmdUnits, Row};
use crate::st::{STATUS, StUnits};

/// The units of values of both protocols.
#[derive(Clone, Copy)]
pub struct Units {
    pub st: StUnits,
    pub rmd: RmdUnits,
}

/// The signals of a row.
#[derive(Clone, Copy)]
pub struct Main {
    /// The state of an ST motor. RMD motors report none.
    pub state: Option<Source>,
    pub faults: Source,
    pub speed: Source,
    pub current: Source,
    pub temperature: Source,
    pub voltage: Source,
}

impl Main {
    pub fn of(motor: Motor) -> Self {
        let register = Source::Register;
        match motor {
            Motor::St(_) => Main {
                state: Some(register(RegisterId::STATUS)),
                faults: register(RegisterId::FLAGS),
                speed: register(RegisterId::SPEED_MEAS),
                current: register(RegisterId::TORQUE_MEAS),
                temperature: register(RegisterId::HEATS_TEMP),
                voltage: register(RegisterId::BUS_VOLTAGE),
            },
            Motor::Rmd(_) => Main {
                state: None,
                faults: quantity("errors"),
                speed: quantity("speed_dps"),
                current: quantity("iq_amps"),
                temperature: quantity("temperature_celsius"),
                voltage: quantity("voltage_volts"),
            },
        }
    }

    /// Signals that are read at --rate.
    pub fn fast(&self) -> impl Iterator<Item = Source> {
        [Some(self.speed), Some(self.current), self.state, Some(self.faults)].into_iter().flatten()
    }

    /// Signals that are read at a lower rate.
    pub fn slow(&self) -> [Source; 2] {
        [self.temperature, self.voltage]
    }
}

fn quantity(name: &str) -> Source {
    Source::Quantity(Quantity::named(name).expect("replies of RMD motors have it"))
}

/// The signals that the details of a motor show.
pub fn details(motor: Motor) -> Vec<Signal> {
    let sources: Vec<Source> = match motor {
        Motor::St(_) => STATUS.map(Source::Register).to_vec(),
        Motor::Rmd(_) => Source::all(motor),
    };
    sources.into_iter().map(|source| Signal { motor, source }).collect()
}

impl Units {
    /// A value with its unit or its name.
    pub fn text(&self, source: Source, sample: Sample) -> String {
        match source {
            Source::Register(register) => self.st.text(&self.reading(register, sample)),
            Source::Quantity(quantity) => self.row(quantity, sample).text,
            Source::Derived(derived) => Row::derived(derived, sample.value).text,
        }
    }

    /// A value for a narrow column.
    pub fn short(&self, source: Source, sample: Sample) -> String {
        let Source::Register(register) = source else { return self.text(source, sample) };
        let reading = self.reading(register, sample);
        if !reading.is_current() {
            return reading.to_string();
        }
        let row = self.st.current_row(reading.digits());
        format!("{} {}", row.short(), row.unit())
    }

    fn reading(&self, register: RegisterId, sample: Sample) -> Reading {
        self.st.reading(register, sample.digits as i32)
    }

    fn row(&self, quantity: Quantity, sample: Sample) -> Row {
        let (_, field) = quantity.read();
        self.rmd.field(field, sample.digits)
    }
}

/// The state in one or two words. That of an RMD motor is derived from its speed and errors.
pub fn state(main: &Main, value: impl Fn(Source) -> Option<Sample>) -> Option<String> {
    if let Some(source) = main.state {
        return value(source).map(|sample| Status::from(sample.digits as u8).to_string());
    }
    let (errors, speed) = (value(main.faults), value(main.speed)?);
    Some(match errors.is_some_and(|errors| errors.digits != 0) {
        true => "ERROR".to_owned(),
        false if speed.digits != 0 => "turning".to_owned(),
        false => "at rest".to_owned(),
    })
}

/// The names and descriptions of faults; `None`: no fault.
pub fn faults(motor: Motor, sample: Sample) -> Option<String> {
    match motor {
        Motor::Rmd(_) => {
            let errors = Errors(sample.digits as u8);
            (!errors.is_empty()).then(|| errors.to_string())
        }
        Motor::St(_) => {
            let flags = Flags(sample.digits as u32);
            let words = |half: u16| {
                let set = Flags::NAMES.iter().filter(move |(bit, ..)| half & bit != 0);
                set.map(|(_, name, doc)| format!("{name} ({doc})")).collect::<Vec<_>>().join(", ")
            };
            match (flags.present(), flags.occurred()) {
                (0, 0) => None,
                (0, occurred) => Some(format!("over, not acknowledged: {}", words(occurred))),
                (present, _) => Some(format!("present: {}", words(present))),
            }
        }
    }
}
