//! The signals of a row, and the text of values.

use motorlink::st::{Reading, RegisterId};
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
